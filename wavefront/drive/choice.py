"""How the paths of a picture go on: what was asked for, and what "auto" comes to.

A choice depends on the scene, the camera, the size of the whole picture and on settings that a checkpoint
must have in common with the render that goes on from it. It does not depend on the number of samples, so
that a picture of 64 samples that gets 64 more is the one of 128.
"""

from __future__ import annotations

from dataclasses import replace

from ..arrays.soa import soa
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..guiding import GuideTable
from ..integrators.training import train
from ..integrators.tuning import BRANCHES, JobsRunner, Run, Trial
from ..sampling.sampler import make_sampler
from ..sampling.tiles import MEMBERS, SIDE, STRIDE
from ..settings import AUTO, Settings
from ..settings.checks import left_out
from ..stages.glossy_points import glossy_materials
from ..stages.reuse import can_reuse, shared_materials, shares_all

LEAST_PIXELS = 192 * 192  # of pictures that get a trial; smaller ones take no longer than a moment
GUIDE_HINT = "most light is hard to find here: guide=True may pay (docs/guiding.md)"
# Variance times rays must fall below this part: rays tell the cost to about a tenth, and a trial may miss the
# few paths that find most of the light.
GAIN = 0.85
GAIN_OF_BRANCHES = 0.95  # likewise; costs of branches are known better, since one run tells all of them
OUTLIERS = 0.02  # part of the pixels, the noisiest, that do not count
OUTLIERS_OF_SHARED = 0.005  # likewise, for re-use, which may bring most where few pixels hold the noise
GAIN_BESIDE_GLOSS = 0.6  # of re-use beside sharp lobes: they gain little, and trials miss it
GUIDE_TILES = 128  # whatever the size of the picture: training takes longer anyway
RARE_LIGHT = 1.0  # relative variance of a pixel of four samples, from where on light is hard to find
MOST_PATHS = 0.4  # part of the paths that must meet second points which can be shared


@soa
class Choice:
    """How paths go on."""

    branches: int = 1
    reuse: bool = False
    guided: bool = False
    hint: str | None = None  # what may pay besides

    @property
    def ways(self) -> int:
        """In how many ways a path goes on for itself: branches of shared paths are not told apart."""
        return 1 if self.reuse else self.branches


def learn_guide(settings: Settings, scene: CompiledScene, camera: Camera) -> GuideTable | None:
    """Return the table that may guide the paths of a picture; None if there is nothing to learn.

    Parameters
    ----------
    camera
        In the unit of the compiled scene.
    """
    sampler = make_sampler(settings.values["sampler"], settings.training_seed(), camera.resolution[0])
    return train(scene, camera, sampler, settings.values["max_bounces"])


def choose(
    settings: Settings,
    scene: CompiledScene,
    camera: Camera,
    has_guide: bool,
    run: JobsRunner,
    workers: int = 1,
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
    workers
        How many of them have something to do.
    """
    branches, reuse = settings.values["branches"], settings.values["reuse"] is True
    asked = Choice(1 if branches == AUTO else int(branches), reuse, has_guide)
    if settings.quick and settings.is_full and branches == AUTO and not reuse:
        return replace(asked, branches=BRANCHES[-1])
    whole = camera.cropped((0, 0, *camera.resolution))  # a window is a part of the same picture
    seed, bounces = settings.training_seed(1), settings.values["max_bounces"]
    if settings.is_full and has_guide and settings.values["guide"] == AUTO:
        trial = Trial(whole, seed, bounces, run, GUIDE_TILES, workers)
        plain, guided = (_branched(settings, trial, replace(asked, guided=each)) for each in (False, True))
        return guided if _cost(trial, guided, plain) < GAIN else plain
    if settings.is_full and _tries_something(settings, scene, whole):
        return _tried(settings, scene, whole, Trial(whole, seed, bounces, run, workers=workers), asked)
    return asked


def _tried(settings: Settings, scene: CompiledScene, camera: Camera, trial: Trial, plain: Choice) -> Choice:
    """Return whether pixels share paths, or else how many branches these have; `plain` is neither."""
    found = trial.run(False, plain.guided)
    light_is_rare = found.mean_variance(OUTLIERS_OF_SHARED) > RARE_LIGHT
    plain = replace(plain, hint=GUIDE_HINT if light_is_rare and not plain.guided else None)
    branched = _branched(settings, trial, plain)
    if not _may_reuse(settings, camera) or not _may_gain(scene, found, light_is_rare):
        return branched
    branched, shared = plain if light_is_rare else branched, replace(plain, reuse=True)
    cost = _cost(trial, shared, branched, OUTLIERS_OF_SHARED)
    if shares_all(scene):  # a few noisy pixels, which the trial may miss, are what sharing gains most in
        cost -= _run(trial, shared).cost_error(_run(trial, branched), OUTLIERS_OF_SHARED, 1, branched.ways)
    elif not light_is_rare and _cost(trial, shared, plain, OUTLIERS_OF_SHARED) >= GAIN_BESIDE_GLOSS:
        return branched
    return shared if cost < GAIN else branched


def _may_gain(scene: CompiledScene, found: Run, light_is_rare: bool) -> bool:
    """Return whether the second points of a run of plain paths are such that sharing them may pay."""
    kept = ~(shared_materials(scene) | glossy_materials(scene))
    if not can_reuse(scene) or found.met[~kept].sum() < MOST_PATHS * found.paths:
        return False
    return light_is_rare or not kept.any()


def _branched(settings: Settings, trial: Trial, choice: Choice) -> Choice:
    """Return a choice with as many branches as pay; paths from sensors have no first ray to share."""
    if settings.values["branches"] == AUTO and not choice.reuse and trial.of_picture:
        costs = [_cost(trial, replace(choice, branches=each), choice) for each in BRANCHES]
        if min(costs) < GAIN_OF_BRANCHES:
            return replace(choice, branches=BRANCHES[costs.index(min(costs))])
    return choice


def _cost(trial: Trial, one: Choice, other: Choice, outliers: float = OUTLIERS) -> float:
    """Return variance times rays of a choice over that of another."""
    return _run(trial, one).cost(_run(trial, other), outliers, one.ways, other.ways)


def _run(trial: Trial, choice: Choice) -> Run:
    """Return the run of a choice."""
    return trial.run(choice.reuse, choice.guided)


def _tries_something(settings: Settings, scene: CompiledScene, camera: Camera) -> bool:
    """Return whether branches or re-use are "auto" and can bring anything."""
    values = settings.values
    if values["branches"] != AUTO or values["reuse"] is True or values["max_bounces"] < 2:
        return False
    if camera.size[0] * camera.size[1] < (LEAST_PIXELS if camera.sensor is None else MEMBERS):
        return False
    rough = any(not bsdf.specular for bsdf in scene.materials.groups)
    return rough and bool(scene.lights.kinds)


def _may_reuse(settings: Settings, camera: Camera) -> bool:
    """Return whether settings and size of a picture allow that its pixels share paths by themselves."""
    free = settings.values["reuse"] == AUTO and not left_out(settings.values, "reuse")
    return free and (camera.sensor is not None or min(camera.size) >= SIDE * STRIDE)
