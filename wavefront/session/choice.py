"""How the paths of a picture go on: what was asked for, and what "auto" comes to.

A choice depends on the scene, the camera, the size of the whole picture and on settings that a checkpoint
must have in common with the render that goes on from it. It does not depend on the number of samples, so
that a picture of 64 samples that gets 64 more is the one of 128.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from ..arrays.soa import soa
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..guiding import GuideTable
from ..integrators.training import train
from ..integrators.tuning import BLOCKS, MOST_TILES, JobsRunner, Trial, guide_pays, run_trial, tiles_for
from ..sampling.sampler import make_sampler
from ..sampling.tiles import SIDE, STRIDE
from ..settings import AUTO, Settings
from ..settings.combinations import left_out
from ..stages.reuse import can_reuse, shares_all

LEAST_PIXELS = 192 * 192  # of pictures that get a trial; smaller ones take no longer than a moment
GUIDE_HINT = "most light is hard to find here: guide=True may pay (docs/guiding.md)"
GUIDE_TILES = MOST_TILES // 2  # whatever the size of the picture: the pilot takes longer anyway


@soa
class Choice:
    """How paths go on."""

    branches: int = 1
    reuse: bool = False
    guided: bool = False
    hint: str | None = None  # what may pay besides


def learn_guide(settings: Settings, scene: CompiledScene, camera: Camera) -> GuideTable | None:
    """Return the table that may guide the paths of a picture; None if there is nothing to learn.

    Parameters
    ----------
    camera
        In the unit of the compiled scene.
    """
    sampler = make_sampler(settings.values["sampler"], settings.pilot_seed(), camera.resolution[0])
    return train(scene, camera, sampler, settings.values["max_bounces"])


def choose(
    settings: Settings, scene: CompiledScene, camera: Camera, has_guide: bool, run: JobsRunner
) -> Choice:
    """Return how the paths of a picture go on, and what else may pay; run trials where they are needed.

    Parameters
    ----------
    camera
        In the unit of the compiled scene.
    has_guide
        Whether there is something to guide them.
    run
        Does the jobs of trials.
    """
    branches = settings.values["branches"]
    asked = Choice(1 if branches == AUTO else int(branches), settings.values["reuse"] is True)
    if not settings.is_full:
        return asked
    whole = camera.cropped((0, 0, *camera.resolution))  # a window is a part of the same picture
    trial = partial(_trial, settings, scene, whole, run)
    if settings.values["guide"] == AUTO and has_guide:
        return _choose_guide(settings, asked, trial)
    if _tries_something(settings, scene, whole):
        tiles, may_reuse = tiles_for(whole.size), _may_reuse(settings, whole) and can_reuse(scene)
        tries_reuse = may_reuse and shares_all(scene)
        found = trial(has_guide, tiles, tries_reuse)
        if may_reuse and not tries_reuse and found.light_is_rare and found.gloss_is_common:
            tries_reuse = True
            found = trial(has_guide, tiles, tries_reuse)
        hint = GUIDE_HINT if not has_guide and found.light_is_rare else None
        if tries_reuse and found.reuse_pays():
            return Choice(1, True, has_guide, hint)
        return Choice(found.best_ways(), False, has_guide, hint)
    return Choice(asked.branches, asked.reuse, has_guide)


def _choose_guide(settings: Settings, asked: Choice, trial: Callable[[bool, int], Trial]) -> Choice:
    """Return whether a guide is used, and how many branches go with that."""
    fixed = None if settings.values["branches"] == AUTO and not asked.reuse else asked.branches
    guided, plain = (trial(each, GUIDE_TILES) for each in (True, False))
    pays = guide_pays(guided, plain, fixed)
    found = guided if pays else plain
    return Choice(fixed or found.best_ways(), asked.reuse, pays)


def _trial(
    settings: Settings,
    scene: CompiledScene,
    camera: Camera,
    run: JobsRunner,
    guided: bool,
    tiles: int,
    reuse: bool = False,
) -> Trial:
    seeds = tuple(settings.pilot_seed(number) for number in range(1, BLOCKS + 1))
    bounces = settings.values["max_bounces"]
    return run_trial(scene, camera, seeds, bounces, run, guided=guided, tiles=tiles, reuse=reuse)


def _tries_something(settings: Settings, scene: CompiledScene, camera: Camera) -> bool:
    """Return whether branches or re-use are "auto" and can bring anything."""
    values = settings.values
    if values["branches"] != AUTO or values["reuse"] is True or values["max_bounces"] < 2:
        return False
    if camera.size[0] * camera.size[1] < LEAST_PIXELS:
        return False
    rough = any(not bsdf.specular for bsdf in scene.materials.groups)
    return rough and bool(scene.lights.kinds)


def _may_reuse(settings: Settings, camera: Camera) -> bool:
    """Return whether settings and size of a picture allow that its pixels share paths by themselves."""
    free = settings.values["reuse"] == AUTO and not left_out(settings.values, "reuse")
    return free and min(camera.size) >= SIDE * STRIDE
