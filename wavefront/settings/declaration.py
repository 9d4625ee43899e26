"""The settings of a render: the one declaration of their names, types, defaults, checks and texts.

Functions take them as `**settings: Unpack[RenderSettings]` and show them by `takes_settings`. The command
line, the identity of a checkpoint and the documentation are made from this table, too.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, TypedDict, get_args, get_type_hints

from numpy.typing import ArrayLike

from ..accel.registry import ACCELERATORS, AcceleratorMaker
from ..camera import Camera, check_camera, field_of_view, image_size
from ..compile.scene import ROULETTE_AFTER
from ..core.memory import memory_size
from ..core.progress import Progress
from ..core.registry import Registry
from ..film.aov_names import chosen_layers
from ..integrators import INTEGRATORS, Integrator
from ..lights.samplers import LIGHT_SAMPLERS, LightSamplerMaker
from ..materials import NAMED_MATERIALS, MaterialLike
from ..sampling.filters import FILTERS, Filter
from ..sampling.sampler import SAMPLERS, SamplerMaker
from ..scene.lighting import DEFAULT, LIGHTINGS
from ..scene.scene import FRAMING_FOV, FRAMING_VIEW, VIEWS
from ..scheduling.executors import EXECUTORS, ExecutorLike
from ..shapes.smoothing import check_smooth
from .checks import (
    AUTO,
    SettingCheck,
    above_zero,
    auto_or,
    check_background,
    check_checkpoint,
    check_flag,
    check_noise,
    check_preset,
    check_progress,
    check_roulette,
    check_samples,
    check_up,
    check_view,
    one_of_table,
    optional,
    whole_number,
)

MAX_BRANCHES = 64


@dataclass(frozen=True)
class Setting:
    """What is declared of a setting, beside its name."""

    default: Any  # its value where none is given
    text: str  # what it means, for documentation
    option: str | None = None  # the help text of its command-line option; None where it has none
    check: SettingCheck | None = None  # checks a value that was given, and returns it as it is kept
    choices: Registry[Any] | None = None  # the table of its names
    flag: str | None = None  # the name of its option, which is given once for each of several values
    identity: bool = False  # renders of the same samples have it in common
    type: str = ""  # of its values; taken from the annotation

    def checked(self, name: str, value: Any) -> Any:
        """Return a value as it is kept.

        Raises
        ------
        SceneError
            If it is malformed.
        """
        if self.choices is not None and not (value is None and self.default is None):
            return one_of_table(self.choices)(name, value)
        return value if self.check is None else self.check(name, value)


class RenderSettings(TypedDict, total=False):
    """The settings that are given by name."""

    camera: Annotated[
        Camera | None,
        Setting(
            None,
            "What sees the scene, in place of the scene's own camera. Without either the scene is framed.",
            check=check_camera,
        ),
    ]
    size: Annotated[
        tuple[int, int] | None,
        Setting(
            None,
            "(width, height) in pixels, in place of the camera's; by default (512, 512).",
            option="WIDTHxHEIGHT in pixels (default: the camera's, or 512x512)",
            check=optional(lambda name, value: image_size(value)),
        ),
    ]
    view: Annotated[
        str | ArrayLike | None,
        Setting(
            None,
            "From where a scene is framed, in place of the scene's own camera: "
            '"three_quarter", "front", "back", "left", "right", "top", "bottom", "iso", or (3,) from its '
            'middle to the camera. Without a camera it is "three_quarter", which is 35° to the right of the '
            "front and 22° above. Not with `camera`.",
            option=f"from where the scene is framed: {', '.join(VIEWS)} (default: {FRAMING_VIEW}, "
            "where the file has no camera)",
            check=optional(check_view),
        ),
    ]
    fov: Annotated[
        float | None,
        Setting(
            None,
            "Vertical field of view of the camera that frames a scene, degrees; by default 40. Not with "
            "another camera.",
            option=f"vertical field of view, degrees (default: {FRAMING_FOV:g})",
            check=optional(lambda name, value: field_of_view(value)),
        ),
    ]
    material: Annotated[
        MaterialLike | None,
        Setting(
            None,
            "What bare meshes are made of: those of files and of trimesh, where it replaces what they "
            "say, (vertices, faces), and shapes that were given no material. A material, or the name of "
            'one, such as "gold".',
            option=f"material in place of the file's: {', '.join(NAMED_MATERIALS)}",
        ),
    ]
    smooth: Annotated[
        bool | float | str,
        Setting(
            AUTO,
            "Normals of bare meshes: True averages those of the faces around each vertex, False shows the "
            "facets, and a crease angle in degrees averages only over faces that are within it of each "
            'other. These replace the normals that a mesh has. "auto" keeps them, and computes those of '
            "files and trimesh objects that have none by a crease angle of 30°, but for glTF, whose facets "
            "are flat then: docs/formats.md says why. (vertices, faces) and `Mesh` stay as they are.",
            option="normals of meshes: yes, no, a crease angle in degrees, or auto (default), which is 30 "
            "where the file has none",
            check=check_smooth,
        ),
    ]
    up: Annotated[
        ArrayLike,
        Setting(
            AUTO,
            'What is up in the scene: a vector (3,), or the name of an axis, such as "z". "auto" goes by '
            "the file: z for STL and 3MF, what a DAE says, else y. It turns the camera that frames a scene "
            "without one, and the `lighting` and the `ground`.",
            option="what is up in the scene, or an axis such as z (default: by the file; z for stl and 3mf)",
            check=check_up,
        ),
    ]
    lighting: Annotated[
        str | None,
        Setting(
            "auto",
            '"studio", "softbox", "three_point", "cloudy" or "even": adds the light of that name, which '
            '`studio` describes, to the scene\'s own. "auto" adds "studio" where nothing shines, and '
            "nothing elsewhere; None adds nothing.",
            option=f"light to add: {', '.join(LIGHTINGS)}, none, "
            f"or auto, which is {DEFAULT} where nothing shines",
            check=check_preset,
        ),
    ]
    ground: Annotated[
        bool | str,
        Setting(
            AUTO,
            "Adds a level ground under the scene that catches its shadow and fades into the background. "
            "It belongs to the picture alone: the scene, its bounds and the numbers of its shapes stay. "
            '"auto" adds it where the light is chosen by itself and the camera is framed, unless that looks '
            "from below or a `background` is asked for.",
            option="add a ground that catches the shadow, or leave it out (default: where light and camera "
            "are chosen by themselves)",
            check=auto_or(check_flag),
        ),
    ]
    background: Annotated[
        str | ArrayLike | None,
        Setting(
            None,
            '"transparent" or a color: replaces what the camera sees directly of the environment; its '
            "light stays, and so do its reflections. Either gives the layer `alpha`. Colors of a "
            "transparent picture are premultiplied by alpha.",
            option="transparent, or a color in place of the visible environment: a name such as white, "
            "#rrggbb, or linear R,G,B",
            check=check_background,
        ),
    ]
    integrator: Annotated[
        str | Integrator,
        Setting(
            "full",
            '"full", "direct_mis", "direct_simple" or "naive". This and the other settings that take names '
            "also take a thing of your own, such as a function; docs/extending.md has an example of each.",
            option="estimator of light",
            choices=INTEGRATORS,
            identity=True,
        ),
    ]
    max_bounces: Annotated[
        int,
        Setting(
            12,
            "Scattering events along a path: 0 shows only light seen directly, 1 direct light.",
            option="scattering events along a path",
            check=whole_number(0, 2**16),
            identity=True,
        ),
    ]
    roulette: Annotated[
        bool | int,
        Setting(
            ROULETTE_AFTER,
            "Scattering events of a path before Russian roulette may end it, by chance and without a change "
            "of the mean; False never ends a path so, which takes longer, mostly for less noise than that "
            "is worth.",
            option="scattering events before Russian roulette may end a path, or no",
            check=check_roulette,
            identity=True,
        ),
    ]
    seed: Annotated[
        int,
        Setting(
            0,
            "The same seed gives the same picture, bit for bit, unless `seconds` is given.",
            option="same seed, same picture",
            identity=True,
        ),
    ]
    samples: Annotated[
        range | None,
        Setting(
            None,
            "The samples to render, as a range of their numbers, in place of `spp`: range(0, 64) on one "
            "machine and range(64, 128) on another. `Image.merge` makes one picture of them, which is that "
            "of all 128, bit for bit. Not with `noise` or `seconds`.",
            option="FIRST:END, samples to render in place of --spp, such as 64:128; "
            "`wavefront merge` joins the pictures",
            check=check_samples,
        ),
    ]
    sampler: Annotated[
        str | SamplerMaker,
        Setting(
            "sobol",
            '"sobol"; "bluenoise", whose error at few samples is even to the eye; or "independent".',
            option="source of random numbers",
            choices=SAMPLERS,
            identity=True,
        ),
    ]
    accel: Annotated[
        str | AcceleratorMaker,
        Setting(
            "auto",
            'Ray queries by "numpy", by "embree" (`pip install embreex`), or "auto".',
            option="ray queries: auto, numpy or embree",
            choices=ACCELERATORS,
        ),
    ]
    workers: Annotated[
        int | None,
        Setting(
            None,
            "How many waves are traced at once; by default one per core, or per worker of an executor or "
            "cluster that is given.",
            option="waves traced at once (default: one per core)",
        ),
    ]
    executor: Annotated[
        str | ExecutorLike | None,
        Setting(
            None,
            'What workers are: "processes", "threads", "spawn" or "forkserver", which are processes that '
            "share no memory with this one; or a `concurrent.futures.Executor`, a function that returns one, "
            "or a `dask.distributed.Client`. By default processes, which are faster, when there is work for "
            "more than a moment, and threads otherwise. The picture is the same. docs/scale.md tells more.",
            option="what workers are (default: the faster here)",
            choices=EXECUTORS,
        ),
    ]
    noise: Annotated[
        float | None,
        Setting(
            None,
            "Go on until the estimated relative error of the picture is no more than this: 0.02 means "
            "2 %. It is the root of the relative MSE that `compare` would find against a converged picture. "
            "Noisy parts get more samples than calm ones, and every pixel at least 32. When `spp` or "
            "`seconds` end the render above it, a warning says so.",
            option="go on to this relative error, such as 0.02",
            check=optional(check_noise),
            identity=True,
        ),
    ]
    seconds: Annotated[
        float | None,
        Setting(
            None,
            "Go on until this time is used, scene setup included; waves that are still under way a tenth "
            "later are discarded. Every pixel gets its first sample all the same, unless a wave of them "
            "takes over three seconds. With `noise` as well, whichever comes first.",
            option="go on until this time is used",
            check=optional(above_zero),
        ),
    ]
    filter: Annotated[
        str | Filter,
        Setting(
            "box",
            'How the samples of a pixel are spread: "box" (evenly over the pixel), "tent" (radius 1 '
            'pixel) or "gaussian" (σ 0.5 pixels, cut off at 1.5 from the center).',
            option="spread of samples over a pixel",
            choices=FILTERS,
            identity=True,
        ),
    ]
    light_sampler: Annotated[
        str | LightSamplerMaker,
        Setting(
            "spatial",
            'How one light of many is chosen at a point: "spatial" weighs what each brings there, "power" '
            'its power alone, "uniform" nothing.',
            option="how one light of many is chosen",
            choices=LIGHT_SAMPLERS,
            identity=True,
        ),
    ]
    branches: Annotated[
        int | str,
        Setting(
            AUTO,
            "In how many ways the path of a sample goes on from the first surface, at most 64; only "
            '"full" has any. Two to four make a sample dearer, but less noisy by more where most of the '
            'noise is in indirect light, as in a room. "auto" finds out by a short trial whether they pay: '
            "docs/choices.md tells how. In pictures of less than 192x192 pixels it is one.",
            option="ways a path goes on from its first surface, or auto (default), which tries what pays",
            check=auto_or(whole_number(1, MAX_BRANCHES)),
        ),
    ]
    guide: Annotated[
        bool | str,
        Setting(
            False,
            "Learn from a pilot of 262144 paths where light comes from, and choose directions by that; "
            'only "full" can be guided. It takes a second or two, and pays where light comes through '
            "narrow openings or several reflections: docs/guiding.md has figures. The pilot depends on the "
            'scene, the camera and the seed alone. "auto" guides only where a short trial with it and '
            'without it says that it pays; `metadata["guided"]` says what it found.',
            option="learn where light comes from, for scenes with much indirect light",
            check=auto_or(check_flag),
            identity=True,
        ),
    ]
    reuse: Annotated[
        bool | str,
        Setting(
            AUTO,
            "Share paths among pixels: what a path finds from its second surface on counts for sixteen "
            'pixels that lie a little apart; only "full" does so. It pays where most of the noise is in '
            "indirect light between matte surfaces. The errors of these pixels depend on each other then: "
            'docs/reuse.md has figures. "auto" shares where a short trial says that it pays, beside gloss '
            "and glass only where light is hard to find: docs/choices.md tells how. It never does with "
            "`branches`, `clamp`, `noise`, `caustics` or light groups.",
            check=auto_or(check_flag),
            option="share paths among pixels: yes, no, or auto (default), which tries whether it pays",
        ),
    ]
    clamp: Annotated[
        float | None,
        Setting(
            None,
            "The most that a path may find as indirect light at once, as radiance, the mean of its "
            "channels; what is brighter is scaled down. It removes fireflies, and with them light: the "
            'picture gets too dark. The layer "clamped" holds what was removed, `metadata["clamped"]` says '
            "how much of all light that is, and a warning does above 2 %. Light seen directly, and that of "
            "lights on the first rough surface, is not clamped.",
            option="most indirect light that a path finds at once; removes fireflies, and some light",
            check=optional(above_zero),
            identity=True,
        ),
    ]
    caustics: Annotated[
        bool,
        Setting(
            False,
            "Trace paths from the lights as well, one for each sample, which find the light that smooth "
            "glass and mirrors send on: caustics. Without it paths find that light by chance, and that of "
            'points, spots and directional lights never. Only "full" has it, and it does not go with '
            "`reuse`, `noise`, another filter or light groups: docs/caustics.md has figures.",
            option="trace paths from lights for caustics of smooth glass and mirrors",
            check=check_flag,
            identity=True,
        ),
    ]
    wave_size: Annotated[
        int | None,
        Setting(
            None,
            "The most paths that are traced together by one worker; by default what suits their number "
            "and speed, at most 131 072. The picture does not depend on it.",
            check=optional(whole_number(1, 2**24)),
        ),
    ]
    checkpoint: Annotated[
        str | os.PathLike[str] | None,
        Setting(
            None,
            "A file that keeps the render: it is written every `checkpoint_interval` seconds, at Ctrl-C "
            "and at the end. The same call goes on from it, with the same bits as without a break; with "
            "more `spp` it goes on further. The file of another scene or of other settings is refused.",
            option="file that keeps the render, from which the same command goes on",
            check=check_checkpoint,
        ),
    ]
    checkpoint_interval: Annotated[
        float,
        Setting(
            60,
            "Seconds between two writes of the checkpoint. Writing takes a twentieth of the time at most.",
            option="seconds between two writes of the checkpoint",
            check=above_zero,
        ),
    ]
    max_memory: Annotated[
        int | str | None,
        Setting(
            None,
            "The most memory that this program and its workers may use together, with what it uses "
            'already: a number of bytes, or a size such as "2GB" or "800MiB". It sizes waves, and the '
            "number of workers where not all of them fit. The picture does not depend on it. A render that "
            "needs more is refused before it begins.",
            option="memory to use at most, such as 2GB",
            check=optional(memory_size),
        ),
    ]
    strict: Annotated[
        bool,
        Setting(
            False,
            "True makes it an error, not a warning, when workers on other machines may compute other bits: "
            "because of another version of NumPy or of this package, or another processor.",
            check=check_flag,
        ),
    ]
    aovs: Annotated[
        str | Sequence[str],
        Setting(
            (),
            'Layers beside the picture, by name: "position", "depth", "distance", "normal", '
            '"normal_geometric", "uv", "shape_id", "instance_id", "material_id", "alpha", "albedo", '
            '"direct", "indirect", "denoising_albedo", "denoising_normal", "light_groups", "coverage", '
            '"boxes", or "all" for all but the last three. docs/layers.md says what each holds, and what it '
            "costs.",
            option="layer to render beside the picture, or all; can be given several times",
            flag="aov",
            check=chosen_layers,
        ),
    ]
    denoise: Annotated[
        bool,
        Setting(
            False,
            "Removes most of the noise of the last picture, as `Image.denoise` does, along edges and "
            'textures that the layers "denoising_albedo" and "denoising_normal" show, which it adds. '
            "`image.noisy` is the picture before.",
            option="remove noise from the picture",
            check=check_flag,
        ),
    ]
    progress: Annotated[
        Progress,
        Setting(
            None,
            "By default a bar appears when a render takes over two seconds; in a notebook the picture "
            "appears in its place, and refines. False shows neither; a function is called with how much is "
            "done and how much there is at most: samples, or seconds where `seconds` is given. While a "
            "wave takes long it is called every second.",
            check=check_progress,
        ),
    ]


class AllSettings(RenderSettings, total=False):
    """The settings, also `spp`, which functions have as a parameter of its own."""

    spp: Annotated[
        int | None,
        Setting(
            None,
            "Samples per pixel, at least 1; by default 100. With `noise` or `seconds` the most that a "
            "pixel gets; by default then 65536, and with `seconds` as many as there is time for.",
            option="samples per pixel (default: 100); the most there may be with --noise or --seconds",
        ),
    ]


def _declared() -> dict[str, Setting]:
    """Return what is declared of each setting, by name."""
    hints = get_type_hints(AllSettings, include_extras=True)
    declared = {
        name: replace(get_args(hint)[1], type=_as_written(AllSettings.__annotations__[name]))
        for name, hint in hints.items()
    }
    return {"spp": declared.pop("spp"), **declared}


def _as_written(annotation: Any) -> str:
    """Return the type in an annotation Annotated[type, Setting(...)], as it is written there."""
    text: str = getattr(annotation, "__forward_arg__", annotation)
    return text.removeprefix("Annotated[").partition(", Setting(")[0]


SETTINGS = _declared()  # in the order of parameters
