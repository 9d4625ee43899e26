"""How the paths of a picture go on: what was asked for, and what "auto" comes to.

A choice depends on the scene, the camera, the size of the whole picture and on settings that a checkpoint
must have in common with the render that goes on from it. It does not depend on the number of samples, so
that a picture of 64 samples that gets 64 more is the one of 128.
"""

from __future__ import annotations

from .camera import Camera
from .compile.scene import CompiledScene
from .guiding import GuideTable
from .pilot import train
from .pixel_tiles import SIDE, STRIDE
from .record import record
from .settings import AUTO, Settings
from .stages.reuse import can_reuse, shares_all
from .trial import BLOCKS, MOST_TILES, Trial, is_worth_it, run_trial, tiles_for

LEAST_PIXELS = 192 * 192  # of pictures that get a trial; smaller ones take no longer than a moment
GUIDE_HINT = "most light is hard to find here: guide=True may pay (docs/guiding.md)"
GUIDE_TILES = MOST_TILES // 2  # whatever the size of the picture: the pilot takes longer anyway


@record
class Choice:
    """How paths go on."""

    branches: int = 1
    reuse: bool = False
    table: GuideTable | None = None
    hint: str | None = None  # what may pay besides


def choose(settings: Settings, scene: CompiledScene, camera: Camera) -> Choice:
    """Return how the paths of a picture go on; train a guide and run trials where they are needed.

    Parameters
    ----------
    camera
        In the unit of the compiled scene.
    """
    asked = Choice(1 if settings.branches == AUTO else int(settings.branches), settings.reuse is True)
    if not settings.is_full:
        return asked
    table = None
    if settings.guide:
        table = train(scene, camera, settings.pilot_sampler(camera.film[0]), settings.max_bounces)
    whole = camera.cropped((0, 0, *camera.film))  # a window is a part of the same picture
    if settings.guide == AUTO and table is not None:
        return _choose_guide(settings, scene, whole, asked, table)
    if _tries_something(settings, scene, whole):
        tiles, may_reuse = tiles_for(whole.size), _may_reuse(settings, whole) and can_reuse(scene)
        tries_reuse = may_reuse and shares_all(scene)
        found = _trial(settings, scene, whole, table, tiles, tries_reuse)
        if may_reuse and not tries_reuse and found.light_is_rare and found.gloss_is_common:
            tries_reuse = True
            found = _trial(settings, scene, whole, table, tiles, tries_reuse)
        hint = GUIDE_HINT if table is None and found.light_is_rare else None
        if tries_reuse and found.reuse_pays():
            return Choice(1, True, table, hint)
        return Choice(found.best_ways(), False, table, hint)
    return Choice(asked.branches, asked.reuse, table)


def _choose_guide(
    settings: Settings, scene: CompiledScene, camera: Camera, asked: Choice, table: GuideTable
) -> Choice:
    """Return whether a guide is used, and how many branches go with that."""
    fixed = None if settings.branches == AUTO and not asked.reuse else asked.branches
    guided, plain = (_trial(settings, scene, camera, each, GUIDE_TILES) for each in (table, None))
    pays = is_worth_it(guided, plain, fixed)
    found, chosen = (guided, table) if pays else (plain, None)
    return Choice(fixed or found.best_ways(), asked.reuse, chosen)


def _trial(
    settings: Settings,
    scene: CompiledScene,
    camera: Camera,
    table: GuideTable | None,
    tiles: int,
    reuse: bool = False,
) -> Trial:
    width = camera.film[0]
    samplers = tuple(settings.pilot_sampler(width, number) for number in range(1, BLOCKS + 1))
    return run_trial(scene, camera, samplers, settings.max_bounces, table, tiles, reuse)


def _tries_something(settings: Settings, scene: CompiledScene, camera: Camera) -> bool:
    """Return whether branches or re-use are "auto" and can bring anything."""
    if settings.branches != AUTO or settings.reuse is True or settings.max_bounces < 2:
        return False
    if camera.size[0] * camera.size[1] < LEAST_PIXELS:
        return False
    rough = any(not bsdf.specular for bsdf in scene.materials.groups)
    return rough and bool(scene.lights.kinds)


def _may_reuse(settings: Settings, camera: Camera) -> bool:
    """Return whether settings and size of a picture allow that its pixels share paths by themselves."""
    plain = settings.clamp is None and settings.noise is None and not settings.denoise
    told_apart = "light_groups" in settings.aovs
    return settings.reuse == AUTO and plain and not told_apart and min(camera.size) >= SIDE * STRIDE
