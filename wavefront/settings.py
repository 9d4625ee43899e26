"""The settings of a render: one declaration of their names, defaults, checks and help texts.

`render` and `Session` have a parameter, and the command line most often an option, for each of them.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import field, fields
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .accel.registry import ACCELERATORS, AcceleratorMaker
from .arrays.record import record
from .arrays.vec import Floats, f4
from .camera import Camera, check_camera, field_of_view, image_size, upward
from .codecs.image_data import TRANSPARENT
from .colors import rgb
from .compile.scene import ROULETTE_AFTER
from .core.errors import SceneError, in_brief, number, warn_caller
from .core.files import check_target
from .core.memory import memory_size
from .core.progress import Progress
from .core.registry import Registry
from .film.aov_names import CLAMPED, GUIDES, chosen_layers, sampled_names
from .film.exact_sum import MAX_TERMS
from .integrators import INTEGRATORS, Integrator, li_full
from .integrators.tuning import MOST_WAYS
from .lights.samplers import LIGHT_SAMPLERS, LightSamplerMaker
from .materials import NAMED_MATERIALS, MaterialLike
from .sampling.filters import FILTERS, Filter, box
from .sampling.sampler import SAMPLERS, SamplerMaker, make_sampler
from .scene.lighting import DEFAULT, LIGHTINGS, check_lighting
from .scene.scene import FRAMING_FOV, FRAMING_VIEW, VIEWS, view_direction
from .scheduling.budget import Budget, make_budget
from .scheduling.executors import EXECUTORS, ExecutorLike, choose_executor, worker_count
from .shapes.smoothing import check_smooth
from .stages.reuse import SHARED_WAYS

DEFAULT_SPP = 100
MAX_BRANCH_SAMPLES = 2**32  # a sample's index is 32 bits of its address, and each branch has one
MAX_BRANCHES = 64
AUTO = "auto"
PILOT = 0x5EED_0F_9417D  # the seed of the pilot is that of the picture XOR this
MAX_SPP_FOR_NOISE = 2**16  # where only `noise` was given

# called with the name and the value of a setting; returns the value as it is kept
SettingCheck: TypeAlias = Callable[[str, Any], Any]


def setting(
    default: Any,
    text: str,
    *,
    option: str | None = None,
    check: SettingCheck | None = None,
    choices: Registry[Any] | None = None,
    flag: str | None = None,
) -> Any:
    """Declare a setting.

    Parameters
    ----------
    default
        Its value where none is given.
    text
        What it means, for the documentation of `render`.
    option
        The help text of its command-line option; None where it has none.
    check
        Checks a value that was given, and returns it as it is kept.
    choices
        The table of its names.
    flag
        The name of its option, which is given once for each of several values; None for that of the setting.
    """
    if choices is not None:
        check = partial(_check_choice, choices)
        check = optional(check) if default is None else check
    return field(
        default=default,
        metadata={"text": text, "option": option, "check": check, "choices": choices, "flag": flag},
    )


def _check_choice(choices: Registry[Any], name: str, value: Any) -> Any:
    choices.find(value, name)
    return value


def optional(check: SettingCheck) -> SettingCheck:
    """Return a check that lets None pass."""
    return lambda name, value: None if value is None else check(name, value)


def whole_number(low: int, high: int) -> SettingCheck:
    """Return a check for integers from `low` to `high`."""

    def check(name: str, value: Any) -> int:
        whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
        if not whole or not low <= value <= high:
            raise SceneError(f"{name} is {in_brief(value)}; it must be a whole number from {low} to {high}")
        return int(value)

    return check


def auto_or(check: SettingCheck) -> SettingCheck:
    """Return a check that lets "auto" pass."""

    def check_other(name: str, value: Any) -> Any:
        try:
            return value if isinstance(value, str) and value == AUTO else check(name, value)
        except SceneError as error:
            raise SceneError(f"{error}, or {AUTO!r}") from None

    return check_other


def check_flag(name: str, value: Any) -> bool:
    """Check that something is True or False."""
    if not isinstance(value, bool | np.bool_):
        raise SceneError(f"{name} is {in_brief(value)}; it must be True or False")
    return bool(value)


def above_zero(name: str, value: Any) -> float:
    """Check that a number is positive and finite."""
    return number(name, value, lambda x: x > 0, "above 0")


def check_noise(name: str, value: Any) -> float:
    """Check that a relative error is positive, and warn if it is no less than the picture."""
    found = above_zero(name, value)
    if found >= 1:
        warn_caller(
            f"{name} is {found:g}, a relative error of {100 * found:g} %; {found:g} % is {found / 100:g}"
        )
    return found


def check_progress(name: str, value: Any) -> Progress:
    """Check that something is True, False, None or can be called."""
    if not (value is None or isinstance(value, bool) or callable(value)):
        raise SceneError(f"{name} is {in_brief(value)}; it must be True, False, None or a function")
    return value


def check_samples(name: str, value: Any) -> range | None:
    """Check that something is a range of consecutive numbers from 0 on, or None."""
    if value is None:
        return None
    if not isinstance(value, range) or value.step != 1 or not value or value.start < 0:
        raise SceneError(
            f"{name} is {in_brief(value)}; it must be a range of consecutive samples, "
            "such as range(64, 128); spp is their number"
        )
    return value


def check_background(name: str, value: Any) -> Any:
    """Check a background: "transparent", or a color, which becomes (3, 1)."""
    if value is None or (isinstance(value, str) and value == TRANSPARENT):
        return value
    try:
        return rgb(name, value)
    except SceneError as error:
        raise SceneError(f"{error}, or {TRANSPARENT!r}" if isinstance(value, str) else f"{error}") from None


def check_roulette(name: str, value: Any) -> int | bool:
    """Check that something is False, or how many scattering events roulette spares."""
    if isinstance(value, bool | np.bool_):
        if value:
            raise SceneError(
                f"{name} is True; it must be False or a whole number, by default {ROULETTE_AFTER}"
            )
        return False
    try:
        return int(whole_number(0, 2**16)(name, value))
    except SceneError as error:
        raise SceneError(f"{error}, or False") from None


def check_checkpoint(name: str, value: Any) -> str | None:
    """Check that a checkpoint can be written to a path, or that there is none."""
    if value is None:
        return None
    if not isinstance(value, str | os.PathLike):
        raise SceneError(f"{name} is {value!r}; it must be a path, such as 'out.wfck'")
    return str(check_target(value))


def check_view(name: str, value: Any) -> Any:
    """Check the name of a view, or a direction."""
    view_direction(name, value)
    return value


def check_up(name: str, value: Any) -> Any:
    """Check what is up: a vector, the name of an axis, or "auto"."""
    return value if isinstance(value, str) and value == AUTO else upward(name, value)


def check_preset(name: str, value: Any) -> str | None:
    """Check the name of a preset."""
    check_lighting(value)
    return value


@record
class Settings:
    """The settings of a render, checked.

    Raises
    ------
    SceneError
        If one is malformed, or two of them exclude each other.
    """

    spp: int | None = setting(
        None,
        "Samples per pixel, at least 1; by default 100. With `noise` or `seconds` the most that a "
        "pixel gets; by default then 65536, and with `seconds` as many as there is time for.",
        option="samples per pixel (default: 100); the most there may be with --noise or --seconds",
    )
    camera: Camera | None = setting(
        None,
        "What sees the scene, in place of the scene's own camera. Without either the scene is framed.",
        check=check_camera,
    )
    size: tuple[int, int] | None = setting(
        None,
        "(width, height) in pixels, in place of the camera's; by default (512, 512).",
        option="WIDTHxHEIGHT in pixels (default: the camera's, or 512x512)",
        check=optional(lambda name, value: image_size(value)),
    )
    view: str | ArrayLike | None = setting(
        None,
        "From where a scene is framed, in place of the scene's own camera: "
        '"three_quarter", "front", "back", "left", "right", "top", "bottom", "iso", or (3,) from its middle '
        'to the camera. Without a camera it is "three_quarter", which is 35° to the right of the front and '
        "22° above. Not with `camera`.",
        option=f"from where the scene is framed: {', '.join(VIEWS)} (default: {FRAMING_VIEW}, "
        "where the file has no camera)",
        check=optional(check_view),
    )
    fov: float | None = setting(
        None,
        "Vertical field of view of the camera that frames a scene, degrees; by default 40. Not with another "
        "camera.",
        option=f"vertical field of view, degrees (default: {FRAMING_FOV:g})",
        check=optional(lambda name, value: field_of_view(value)),
    )
    material: MaterialLike | None = setting(
        None,
        "What bare meshes are made of: those of files and of trimesh, where it replaces what they "
        "say, (vertices, faces), and shapes that were given no material. A material, or the name of one, "
        'such as "gold".',
        option=f"material in place of the file's: {', '.join(NAMED_MATERIALS)}",
    )
    smooth: bool | float | str = setting(
        AUTO,
        "Normals of bare meshes: True averages those of the faces around each vertex, False shows the "
        "facets, and a crease angle in degrees averages only over faces that are within it of each other. "
        'These replace the normals that a mesh has. "auto" keeps them, and computes those of files and '
        "trimesh objects that have none by a crease angle of 30°, but for glTF, whose facets are flat then: "
        "docs/formats.md says why. (vertices, faces) and `Mesh` stay as they are.",
        option="normals of meshes: yes, no, a crease angle in degrees, or auto (default), which is 30 where "
        "the file has none",
        check=check_smooth,
    )
    up: ArrayLike = setting(
        AUTO,
        'What is up in the scene: a vector (3,), or the name of an axis, such as "z". "auto" goes by the '
        "file: z for STL and 3MF, what a DAE says, else y. It turns the camera that frames a scene without "
        "one, and the `lighting` and the `ground`.",
        option="what is up in the scene, or an axis such as z (default: by the file; z for stl and 3mf)",
        check=check_up,
    )
    lighting: str | None = setting(
        "auto",
        '"studio", "softbox", "three_point", "cloudy" or "even": adds the light of that name, which '
        '`studio` describes, to the scene\'s own. "auto" adds "studio" where nothing shines, and '
        "nothing elsewhere; None adds nothing.",
        option=f"light to add: {', '.join(LIGHTINGS)}, none, "
        f"or auto, which is {DEFAULT} where nothing shines",
        check=check_preset,
    )
    ground: bool | str = setting(
        AUTO,
        "Adds a level ground under the scene that catches its shadow and fades into the background. "
        "It belongs to the picture alone: the scene, its bounds and the numbers of its shapes stay. "
        '"auto" adds it where the light is chosen by itself and the camera is framed, unless that looks from '
        "below or a `background` is asked for.",
        option="add a ground that catches the shadow, or leave it out (default: where light and camera are "
        "chosen by themselves)",
        check=auto_or(check_flag),
    )
    background: str | ArrayLike | None = setting(
        None,
        '"transparent" or a color: replaces what the camera sees directly of the environment; its light '
        "stays, and so do its reflections. Either gives the layer `alpha`. Colors of a transparent picture "
        "are premultiplied by alpha.",
        option="transparent, or a color in place of the visible environment: a name such as white, #rrggbb, "
        "or linear R,G,B",
        check=check_background,
    )
    integrator: str | Integrator = setting(
        "full",
        '"full", "direct_mis", "direct_simple" or "naive". This and the other settings that take names '
        "also take a thing of your own, such as a function; docs/extending.md has an example of each.",
        option="estimator of light",
        choices=INTEGRATORS,
    )
    max_bounces: int = setting(
        12,
        "Scattering events along a path: 0 shows only light seen directly, 1 direct light.",
        option="scattering events along a path",
        check=whole_number(0, 2**16),
    )
    roulette: bool | int = setting(
        ROULETTE_AFTER,
        "Scattering events of a path before Russian roulette may end it, by chance and without a change of "
        "the mean; False never ends a path so, which takes longer, mostly for less noise than that is worth.",
        option="scattering events before Russian roulette may end a path, or no",
        check=check_roulette,
    )
    seed: int = setting(
        0,
        "The same seed gives the same picture, bit for bit, unless `seconds` is given.",
        option="same seed, same picture",
    )
    samples: range | None = setting(
        None,
        "The samples to render, as a range of their numbers, in place of `spp`: range(0, 64) on one machine "
        "and range(64, 128) on another. `Image.merge` makes one picture of them, which is that of all 128, "
        "bit for bit. Not with `noise` or `seconds`.",
        option="FIRST:END, samples to render in place of --spp, such as 64:128; "
        "`wavefront merge` joins the pictures",
        check=check_samples,
    )
    sampler: str | SamplerMaker = setting(
        "sobol",
        '"sobol"; "bluenoise", whose error at few samples is even to the eye; or "independent".',
        option="source of random numbers",
        choices=SAMPLERS,
    )
    accel: str | AcceleratorMaker = setting(
        "auto",
        'Ray queries by "numpy", by "embree" (`pip install embreex`), or "auto".',
        option="ray queries: auto, numpy or embree",
        choices=ACCELERATORS,
    )
    workers: int | None = setting(
        None,
        "How many waves are traced at once; by default one per core, or per worker of an executor or "
        "cluster that is given.",
        option="waves traced at once (default: one per core)",
    )
    executor: str | ExecutorLike | None = setting(
        None,
        'What workers are: "processes", "threads", "spawn" or "forkserver", which are processes that '
        "share no memory with this one; or a `concurrent.futures.Executor`, a function that returns one, "
        "or a `dask.distributed.Client`. By default processes, which are faster, when there is work for "
        "more than a moment, and threads otherwise. The picture is the same. docs/scale.md tells more.",
        option="what workers are (default: the faster here)",
        choices=EXECUTORS,
    )
    noise: float | None = setting(
        None,
        "Go on until the estimated relative error of the picture is no more than this: 0.02 means "
        "2 %. It is the root of the relative MSE that `compare` would find against a converged picture. "
        "Noisy parts get more samples than calm ones, and every pixel at least 32. When `spp` or "
        "`seconds` end the render above it, a warning says so.",
        option="go on to this relative error, such as 0.02",
        check=optional(check_noise),
    )
    seconds: float | None = setting(
        None,
        "Go on until this time is used, scene setup included; waves that are still under way a tenth "
        "later are discarded. Every pixel gets its first sample all the same, unless a wave of them "
        "takes over three seconds. With `noise` as well, whichever comes first.",
        option="go on until this time is used",
        check=optional(above_zero),
    )
    filter: str | Filter = setting(
        "box",
        'How the samples of a pixel are spread: "box" (evenly over the pixel), "tent" (radius 1 '
        'pixel) or "gaussian" (σ 0.5 pixels, cut off at 1.5 from the center).',
        option="spread of samples over a pixel",
        choices=FILTERS,
    )
    light_sampler: str | LightSamplerMaker = setting(
        "spatial",
        'How one light of many is chosen at a point: "spatial" weighs what each brings there, "power" '
        'its power alone, "uniform" nothing.',
        option="how one light of many is chosen",
        choices=LIGHT_SAMPLERS,
    )
    branches: int | str = setting(
        AUTO,
        "In how many ways the path of a sample goes on from the first surface, at most 64; only "
        '"full" has any. Two to four make a sample dearer, but less noisy by more where most of the '
        'noise is in indirect light, as in a room. "auto" finds out by a short trial whether they pay: '
        "docs/choices.md tells how. In pictures of less than 192x192 pixels it is one.",
        option="ways a path goes on from its first surface, or auto (default), which tries what pays",
        check=auto_or(whole_number(1, MAX_BRANCHES)),
    )
    guide: bool | str = setting(
        False,
        "Learn from a pilot of 262144 paths where light comes from, and choose directions by that; only "
        '"full" can be guided. It takes a second or two, and pays where light comes through narrow openings '
        "or several reflections: docs/guiding.md has figures. The pilot depends on the scene, the camera and "
        'the seed alone. "auto" guides only where a short trial with it and without it says that it pays; '
        '`metadata["guided"]` says what it found.',
        option="learn where light comes from, for scenes with much indirect light",
        check=auto_or(check_flag),
    )
    reuse: bool | str = setting(
        AUTO,
        "Share paths among pixels: what a path finds from its second surface on counts for sixteen pixels "
        'that lie a little apart; only "full" does so. It pays where most of the noise is in indirect light '
        "between matte surfaces. The errors of these pixels depend on each other then: docs/reuse.md has "
        'figures. "auto" shares where a short trial says that it pays, beside gloss and glass only where '
        "light is hard to find: docs/choices.md tells how. It never does with `branches`, `clamp`, `noise`, "
        "`caustics` or light groups.",
        check=auto_or(check_flag),
        option="share paths among pixels: yes, no, or auto (default), which tries whether it pays",
    )
    clamp: float | None = setting(
        None,
        "The most that a path may find as indirect light at once, as radiance, the mean of its channels; "
        "what is brighter is scaled down. It removes fireflies, and with them light: the picture gets too "
        'dark. The layer "clamped" holds what was removed, `metadata["clamped"]` says how much of all light '
        "that is, and a warning does above 2 %. Light seen directly, and that of lights on the first rough "
        "surface, is not clamped.",
        option="most indirect light that a path finds at once; removes fireflies, and some light",
        check=optional(above_zero),
    )
    caustics: bool = setting(
        False,
        "Trace paths from the lights as well, one for each sample, which find the light that smooth glass "
        "and mirrors send on: caustics. Without it paths find that light by chance, and that of points, "
        'spots and directional lights never. Only "full" has it, and it does not go with `reuse`, `noise`, '
        "another filter or light groups: docs/caustics.md has figures.",
        option="trace paths from lights for caustics of smooth glass and mirrors",
        check=check_flag,
    )
    wave_size: int | None = setting(
        None,
        "The most paths that are traced together by one worker; by default what suits their number "
        "and speed, at most 131 072. The picture does not depend on it.",
        check=optional(whole_number(1, 2**24)),
    )
    checkpoint: str | os.PathLike[str] | None = setting(
        None,
        "A file that keeps the render: it is written every `checkpoint_interval` seconds, at Ctrl-C and at "
        "the end. The same call goes on from it, with the same bits as without a break; with more `spp` it "
        "goes on further. The file of another scene or of other settings is refused.",
        option="file that keeps the render, from which the same command goes on",
        check=check_checkpoint,
    )
    checkpoint_interval: float = setting(
        60,
        "Seconds between two writes of the checkpoint. Writing takes a twentieth of the time at most.",
        option="seconds between two writes of the checkpoint",
        check=above_zero,
    )
    max_memory: int | str | None = setting(
        None,
        "The most memory that this program and its workers may use together, with what it uses already: "
        'a number of bytes, or a size such as "2GB" or "800MiB". It sizes waves, and the number of workers '
        "where not all of them fit. The picture does not depend on it. A render that needs more is refused "
        "before it begins.",
        option="memory to use at most, such as 2GB",
        check=optional(memory_size),
    )
    strict: bool = setting(
        False,
        "True makes it an error, not a warning, when workers on other machines may compute other bits: "
        "because of another version of NumPy or of this package, or another processor.",
        check=check_flag,
    )
    aovs: str | Sequence[str] = setting(
        (),
        'Layers beside the picture, by name: "position", "depth", "distance", "normal", '
        '"normal_geometric", "uv", "shape_id", "instance_id", "material_id", "alpha", "albedo", '
        '"direct", "indirect", "denoising_albedo", "denoising_normal", "light_groups", "coverage", '
        '"boxes", or "all" for all but the last three. docs/layers.md says what each holds, and what it '
        "costs.",
        option="layer to render beside the picture, or all; can be given several times",
        flag="aov",
        check=chosen_layers,
    )
    denoise: bool = setting(
        False,
        "Removes most of the noise of the last picture, as `Image.denoise` does, along edges and textures "
        'that the layers "denoising_albedo" and "denoising_normal" show, which it adds. `image.noisy` is the '
        "picture before.",
        option="remove noise from the picture",
        check=check_flag,
    )
    progress: Progress = setting(
        None,
        "By default a bar appears when a render takes over two seconds; in a notebook the picture appears "
        "in its place, and refines. False shows neither; a function is called with how much is done and "
        "how much there is at most: samples, or seconds where `seconds` is given. While a wave takes long "
        "it is called every second.",
        check=check_progress,
    )
    max_spp: int = field(init=False)  # the most samples that a pixel may get
    worker_count: int = field(init=False)
    memory_limit: int | None = field(init=False)  # bytes

    def __post_init__(self) -> None:
        for each in fields(self):
            check = each.metadata.get("check")
            if check is not None:
                setattr(self, each.name, check(each.name, getattr(self, each.name)))
        for name in ("view", "fov"):
            if self.camera is not None and getattr(self, name) is not None:
                raise SceneError(f"{name} is {getattr(self, name)!r}; with a camera it must be None")
        if self.denoise:
            self.aovs = chosen_layers("aovs", (*self.aovs, *GUIDES))
        self.max_spp = self._most_samples()
        self.memory_limit = None if self.max_memory is None else int(self.max_memory)
        self.worker_count = worker_count(self.workers, self.executor)
        self._check_integrator()
        self._check_reuse()
        self._check_caustics()
        make_sampler(self.sampler, self.seed)
        self.executor_for((0, 0))

    def _check_integrator(self) -> None:
        """Check that the integrator can do what is asked for."""
        if self.is_full:
            return
        label = INTEGRATORS.label(self.integrator)
        for name in ("guide", "reuse", "caustics"):
            if getattr(self, name) is True:
                raise SceneError(f"{name} is True; with integrator={label!r} it must be False")
        if self.branches not in (1, AUTO):
            raise SceneError(f"branches is {self.branches}; with integrator={label!r} it must be 1")

    def _check_reuse(self) -> None:
        """Check that shared paths have no light that must be told apart by the path that found it."""
        if self.reuse is True and "light_groups" in self.aovs:
            raise SceneError("reuse is True; then aovs must not have 'light_groups'")
        if self.reuse is True and self.clamp is not None:
            raise SceneError(f"clamp is {self.clamp:g}; with reuse=True it must be None")

    def _check_caustics(self) -> None:
        """Check that nothing is asked for that light paths, which reach any pixel, cannot give."""
        if not self.caustics:
            return
        if self.reuse is True:
            raise SceneError("caustics is True; then reuse must not be True")
        if self.noise is not None:
            raise SceneError(f"noise is {self.noise:g}; with caustics=True it must be None")
        if FILTERS.find(self.filter) is not box:
            raise SceneError(f"filter is {FILTERS.label(self.filter)!r}; with caustics=True it must be 'box'")
        if "light_groups" in self.aovs:
            raise SceneError("caustics is True; then aovs must not have 'light_groups'")

    @property
    def first_sample(self) -> int:
        """Index of the first sample of every pixel."""
        return 0 if self.samples is None else self.samples.start

    @property
    def background_color(self) -> Floats | None:
        """What camera rays that miss show, (3, 1), black where it is transparent; None: the environment."""
        if self.background is None:
            return None
        return np.zeros((3, 1), f4) if isinstance(self.background, str) else np.asarray(self.background, f4)

    @property
    def roulette_after(self) -> float:
        """Scattering events before Russian roulette may end paths; infinite where it may not."""
        return np.inf if self.roulette is False else self.roulette

    @property
    def sampled_layers(self) -> tuple[str, ...]:
        """The sampled layers that are asked for; a background gives alpha, a clamp what it removes."""
        wanted = self.aovs if self.background is None else chosen_layers("aovs", [*self.aovs, "alpha"])
        return (*sampled_names(wanted), *(() if self.clamp is None else (CLAMPED,)))

    @property
    def target_spp(self) -> int | None:
        """Samples that every pixel gets; None where noise or time decides."""
        return self.max_spp if self.noise is None and self.seconds is None else None

    @property
    def is_full(self) -> bool:
        """Whether the integrator is the one whose paths can branch, be guided and be shared."""
        return INTEGRATORS.find(self.integrator) is li_full

    @property
    def most_branches(self) -> int:
        """The most branches that a path may have."""
        return MOST_WAYS if isinstance(self.branches, str) else self.branches

    def sampler_maker(self) -> SamplerMaker:
        """Return what makes the sampler of a picture, given a seed and how many pixels wide it is."""
        return SAMPLERS.find(self.sampler)

    def pilot_seed(self, number: int = 0) -> int:
        """Return the seed of the pilot or of a block of the trial, whose numbers are their own."""
        return (self.seed ^ PILOT) + number

    def executor_for(self, size: tuple[int, int]) -> str | ExecutorLike:
        """Return the executor for a picture of a size (width, height)."""
        branches = self.branches if isinstance(self.branches, int) else 1
        paths = size[0] * size[1] * self.max_spp * branches
        return choose_executor(self.executor, self.worker_count, paths)

    def budget(
        self, size: tuple[int, int], executor: str | ExecutorLike, layers: Sequence[str] = ()
    ) -> Budget:
        """Return the workers, and the largest wave, for a picture of a size (width, height) with layers."""
        processes = executor != "threads"
        return make_budget(
            self.memory_limit, size, self.worker_count, self.wave_size, processes, layers, self.caustics
        )

    def _most_samples(self) -> int:
        ways = self.most_branches * (SHARED_WAYS if self.reuse is True else 1)
        most = min(MAX_TERMS, MAX_BRANCH_SAMPLES // ways)
        if self.samples is not None:
            return self._chosen_samples(self.samples, most)
        if self.spp is not None:
            return int(whole_number(1, most)("spp", self.spp))
        if self.seconds is not None:
            return most
        return DEFAULT_SPP if self.noise is None else MAX_SPP_FOR_NOISE

    def _chosen_samples(self, samples: range, most: int) -> int:
        for name in ("spp", "noise", "seconds"):
            if getattr(self, name) is not None:
                raise SceneError(f"samples is {samples!r}; then {name} must not be given")
        if samples.stop > most:
            raise SceneError(f"samples is {samples!r}; it must end at {most} at most")
        return len(samples)
