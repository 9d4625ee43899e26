"""How the paths of a picture go on: by the settings, and by a choice where these are "auto".

A choice depends on the scene, the camera, the size of the whole picture and on settings that a checkpoint
must have in common with the render that goes on from it. It does not depend on the number of samples, so
that a picture of 64 samples that gets 64 more is the one of 128.
"""

from __future__ import annotations

from dataclasses import replace

from ..arrays.soa import soa
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..core.progress import phase
from ..features.view import seen_by
from ..guiding import GuideTable
from ..integrators.training import train
from ..integrators.tuning import BRANCHES, Run, tuning_run
from ..sampling.sampler import SamplerMaker, make_sampler
from ..sampling.tiles import MEMBERS, SIDE, STRIDE
from ..settings import AUTO, Settings
from ..settings.checks import left_out
from ..stages.glossy_points import glossy_materials
from ..stages.reuse import can_reuse, shared_materials
from ..workers.machine import single_threaded_blas

LEAST_PIXELS = 192 * 192  # of pictures that get a tuning run; smaller ones take no longer than a moment
GUIDE_HINT = "most light is hard to find here: guide=True may pay (docs/guiding.md)"
GAIN_OF_GUIDE = 0.85  # variance times rays must fall below this part: rays tell the cost to about a tenth
GAIN_OF_BRANCHES = 0.95  # likewise; one run tells the costs of both numbers
BRIGHT_SPOTS = 0.6  # part of the variance in few pixels from where on branches only meet more bright spots
BRIGHT_SPOTS_OF_SHARED = 0.5  # likewise of shared paths, beside narrow lobes: they spread spots over a tile
GUIDE_TILES = 128  # whatever the size of the picture: training takes longer anyway
RARE_LIGHT = 0.7  # relative variance of a pixel of four samples, from where on light is hard to find
MOST_PATHS = 0.4  # part of the paths that must meet second points which can be shared
OWN_LIGHT = 0.25  # part of the variance, at most, in light that is not shared; sharing takes thrice the time
NARROW_LOBES = 0.02  # part of the paths, at most, that second points send on in narrow lobes


@soa
class Choice:
    """How paths go on."""

    branches: int = 1
    reuse: bool = False
    guided: bool = False
    hint: str | None = None  # another setting that may pay


def learn_guide(settings: Settings, scene: CompiledScene, camera: Camera) -> GuideTable | None:
    """Return the table that may guide the paths that a camera sees; None if none is asked for."""
    values = settings.values
    if not values["guide"] or not settings.is_full:
        return None
    with phase("learning where light comes from", values["progress"]), single_threaded_blas:
        sampler = make_sampler(values["sampler"], settings.training_seed(), camera.resolution[0])
        return train(
            seen_by(scene, camera, settings.shutter), scene.view(camera), sampler, values["max_bounces"]
        )


def choose(
    settings: Settings,
    scene: CompiledScene,
    camera: Camera,
    maker: SamplerMaker,
    table: GuideTable | None,
) -> Choice:
    """Return the choice of how paths go on, and a hint, by a tuning run where one is needed.

    Parameters
    ----------
    camera
        In the unit of the compiled scene.
    maker
        Of samplers, given a seed and the width of a picture.
    table
        The table that may guide the paths.
    """
    branches, reuse = settings.values["branches"], settings.values["reuse"] is True
    asked = Choice(1 if branches == AUTO else int(branches), reuse, table is not None)
    if settings.quick and settings.is_full and branches == AUTO and not reuse:
        return replace(asked, branches=BRANCHES)
    whole = camera.cropped((0, 0, *camera.resolution))  # a window is a part of the same picture
    sampler = maker(settings.training_seed(1), whole.resolution[0])

    def tune(tiles: int | None = None, table: GuideTable | None = None, like: Run | None = None) -> Run:
        bounces = settings.values["max_bounces"]
        with phase("trying what pays", settings.values["progress"]), single_threaded_blas:
            return tuning_run(scene, whole, sampler, bounces, tiles=tiles, table=table, like=like)

    if settings.is_full and table is not None and settings.values["guide"] == AUTO:
        unguided = tune(tiles=GUIDE_TILES)
        guided = tune(tiles=GUIDE_TILES, table=table, like=unguided)
        return _best(settings, whole, asked, unguided, guided)
    if settings.is_full and _tries_something(settings, scene, whole):
        return _chosen(settings, scene, whole, asked, tune(table=table))
    return asked


def _best(settings: Settings, camera: Camera, asked: Choice, unguided: Run, guided: Run) -> Choice:
    """Return whether paths are guided, with the branches that pay."""
    plain = _branched(settings, camera, unguided, replace(asked, guided=False))
    other = _branched(settings, camera, guided, asked)
    cost = guided.cost(_ways(other), unguided, _ways(plain))
    return other if cost < GAIN_OF_GUIDE else plain


def _ways(choice: Choice) -> int:
    """Return in how many ways a path goes on for itself: branches of shared paths are not told apart."""
    return 1 if choice.reuse else choice.branches


def _chosen(settings: Settings, scene: CompiledScene, camera: Camera, asked: Choice, run: Run) -> Choice:
    """Return whether pixels share paths, or else how many branches these have, by the results of a run."""
    asked = replace(asked, hint=GUIDE_HINT if _light_is_rare(run) and not asked.guided else None)
    if _may_reuse(settings, scene, camera) and _sharing_pays(scene, run):
        return replace(asked, reuse=True)
    return _branched(settings, camera, run, asked)


def _light_is_rare(run: Run) -> bool:
    return run.mean_variance() > RARE_LIGHT


def _sharing_pays(scene: CompiledScene, run: Run) -> bool:
    """Return whether sharing paths pays: most of them can be shared, and these make the noise.

    Narrow lobes at second points may make bright spots, which no pixel can share. So do mirrors and glass,
    also those that the run has not met, unless all light is hard to find.
    """
    alone = ~(shared_materials(scene) | glossy_materials(scene))
    if not can_reuse(scene) or run.met[~alone].sum() < MOST_PATHS * run.paths:
        return False
    if run.share_of_own() > OWN_LIGHT:
        return False
    wide = run.narrow <= NARROW_LOBES * run.paths
    even = wide or run.share_of_outliers() < BRIGHT_SPOTS_OF_SHARED
    return even and (_light_is_rare(run) or not alone.any())


def _branched(settings: Settings, camera: Camera, run: Run, choice: Choice) -> Choice:
    """Return a choice with branches if they pay.

    Paths from sensors have no first ray to share. Where light is rare, and not shared, few bright paths make
    the noise: branches meet more of those.
    """
    if settings.values["branches"] != AUTO or choice.reuse or camera.sensor is not None:
        return choice
    even = not _light_is_rare(run) and run.share_of_outliers() < BRIGHT_SPOTS
    pays = even and run.cost(BRANCHES, run) < GAIN_OF_BRANCHES
    return replace(choice, branches=BRANCHES) if pays else choice


def _tries_something(settings: Settings, scene: CompiledScene, camera: Camera) -> bool:
    """Return whether branches or re-use are "auto" and can bring anything."""
    values = settings.values
    if values["branches"] != AUTO or values["reuse"] is True or values["max_bounces"] < 2:
        return False
    if camera.size[0] * camera.size[1] < (LEAST_PIXELS if camera.sensor is None else MEMBERS):
        return False
    rough = any(not bsdf.specular for bsdf in scene.materials.groups)
    return rough and bool(scene.lights.kinds)


def _may_reuse(settings: Settings, scene: CompiledScene, camera: Camera) -> bool:
    """Return whether settings, scene and camera allow that pixels share paths by themselves."""
    in_turn = scene.motion is not None and camera.rolling_shutter != 0
    free = settings.values["reuse"] == AUTO and not left_out(settings.values, "reuse") and not in_turn
    return free and (camera.sensor is not None or min(camera.size) >= SIDE * STRIDE)
