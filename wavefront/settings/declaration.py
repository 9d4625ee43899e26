"""The settings of a render: the one declaration of their names, types, defaults, checks and texts.

Functions take them as `**settings: Unpack[RenderSettings]` and show them by `takes_settings`. The command
line, the identity of a checkpoint and the documentation are made from this table, too.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import wraps
from typing import Annotated, Any, ParamSpec, TypedDict, TypeVar, get_args, get_type_hints

from numpy.typing import ArrayLike

from ..accel.registry import ACCELERATORS, AcceleratorMaker
from ..camera import Camera, ImageSize, check_camera, field_of_view, image_size
from ..compile.program import Feature, check_features
from ..compile.scene import ROULETTE_AFTER
from ..core.errors import flag
from ..core.memory import memory_size
from ..core.progress import Progress
from ..core.registry import Registry
from ..core.suggestions import unknown_keyword
from ..film.aov_names import AOVS, BOXES, FLOW_AOVS, KEYED_AOVS, chosen_aovs
from ..integrators import INTEGRATORS, Integrator
from ..lights.choice import LightSamplerMaker
from ..lights.samplers import LIGHT_SAMPLERS
from ..materials import NAMED_MATERIALS, MaterialLike
from ..motion.shutter import SHUTTER_CURVES, Curve, check_shutter
from ..sampling.filters import FILTERS, Filter
from ..sampling.sampler import SAMPLERS, SamplerMaker
from ..scene.lighting import DEFAULT, LIGHTINGS
from ..scene.scene import FRAMING_FOV, FRAMING_VIEW, VIEWS
from ..shapes.smoothing import check_smooth
from ..workers.executors import EXECUTORS, ExecutorLike
from .checks import (
    AUTO,
    SettingCheck,
    above_zero,
    auto_or,
    check_background,
    check_checkpoint,
    check_flow_times,
    check_ground,
    check_noise,
    check_preset,
    check_progress,
    check_quality,
    check_roulette,
    check_samples,
    check_up,
    check_view,
    exclusions_of,
    one_of_table,
    optional,
    whole_number,
)

MAX_BRANCHES = 64
AOV_LIST = ", ".join(f'"{name}"' for name in (*AOVS, *FLOW_AOVS, *KEYED_AOVS, BOXES))
P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C")

PLACEHOLDER = "{settings}"  # in docstrings, where the settings are described
WIDTH = 100  # of a line of documentation


@dataclass(frozen=True)
class Setting:
    """The declaration of a setting, without its name."""

    default: Any  # its value where none is given
    text: str  # its documentation; settings that exclude it are added from their table
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
            "The camera, in place of the scene's own. A scene without either is framed.",
            check=check_camera,
        ),
    ]
    size: Annotated[
        ImageSize | None,
        Setting(
            None,
            "(width, height) in pixels, in place of the camera's; (512, 512) by default. One number is a "
            "square.",
            option="WIDTHxHEIGHT in pixels (default: the camera's, or 512x512)",
            check=optional(lambda name, value: image_size(value)),
        ),
    ]
    view: Annotated[
        str | ArrayLike | None,
        Setting(
            None,
            "The direction from which a scene is framed, in place of the scene's own camera: "
            '"three_quarter", "front", "back", "left", "right", "top", "bottom", "iso", or a vector (3,) '
            "from the middle of the scene to the camera. A scene without a camera is seen from "
            '"three_quarter": 35° to the right of the front and 22° above it; a flat one '
            "without light from its broad side.",
            option=f"direction from which the scene is framed: {', '.join(VIEWS)} (default: {FRAMING_VIEW}, "
            "where the file has no camera)",
            check=optional(check_view),
        ),
    ]
    fov: Annotated[
        float | None,
        Setting(
            None,
            "Vertical field of view, in degrees, of the camera that frames a scene; 40 by default.",
            option=f"vertical field of view, degrees (default: {FRAMING_FOV:g})",
            check=optional(lambda name, value: field_of_view(value)),
        ),
    ]
    material: Annotated[
        MaterialLike | None,
        Setting(
            None,
            "The material of bare meshes: those of files and of trimesh, whose own material it replaces, "
            "(vertices, faces), and shapes that were given no material. A material, or the name of one, "
            'such as "gold".',
            option=f"material in place of the file's: {', '.join(NAMED_MATERIALS)}",
        ),
    ]
    scalars: Annotated[
        str | ArrayLike | None,
        Setting(
            None,
            "Numbers that a mesh or points show by the colors of a colormap, one for each vertex, face or "
            'point; or their name: that of an array of PyVista or trimesh, or "x", "y" or "z". Data of '
            "PyVista show their active scalars by default.",
        ),
    ]
    cmap: Annotated[
        Any,
        Setting(
            None,
            'The colormap of the scalars: the name of one of matplotlib, by default "viridis", a colormap, '
            "or a list of colors.",
        ),
    ]
    clim: Annotated[
        tuple[float, float] | None,
        Setting(None, "The scalars at both ends of the colormap; by default the least and the greatest."),
    ]
    smooth: Annotated[
        bool | float | str,
        Setting(
            AUTO,
            "Vertex normals of bare meshes. True averages the normals of the faces around each vertex; "
            "False shows the facets. A crease angle in degrees averages only faces that are within this "
            'angle of each other. These replace the normals that a mesh has. "auto" keeps them. For files '
            "and trimesh objects that have none, it takes a crease angle of 60°, but glTF then has flat "
            "facets: docs/formats.md says why. (vertices, faces) and `Mesh` stay as they are.",
            option="normals of meshes: yes, no, a crease angle in degrees, or auto: those of the file, or an "
            "angle of 30 where it has none",
            check=check_smooth,
        ),
    ]
    up: Annotated[
        ArrayLike,
        Setting(
            AUTO,
            'The direction that is up in the scene: a vector (3,), or the name of an axis, such as "z". '
            '"auto" takes it from the file: z for STL and 3MF, what a DAE says, else y. It turns the '
            "camera that frames a scene, the `lighting` and the `ground`.",
            option="up direction of the scene, an axis such as z, or auto: by the file, z for stl and 3mf",
            check=check_up,
        ),
    ]
    lighting: Annotated[
        str | None,
        Setting(
            "auto",
            '"studio", "softbox", "three_point", "cloudy", "daylight" or "even": adds the light of that name '
            'to the scene\'s own lights; `studio` describes them. "auto" adds "studio" to a scene without '
            "light, and to a file whose own lights leave it black, with a warning, and nothing to others. "
            "None adds nothing.",
            option=f"light to add: {', '.join(LIGHTINGS)}, none, "
            f"or auto: {DEFAULT} for a scene without light",
            check=check_preset,
        ),
    ]
    ground: Annotated[
        bool | str,
        Setting(
            AUTO,
            "Adds a level ground under the scene. It catches the shadow and fades into the background. It "
            "belongs to the picture alone: the scene, its bounds and the numbers of its shapes stay. "
            '"shadow" adds one of which the camera sees the shadow alone. So does True where the background '
            "is transparent, and the shadow is in `alpha`. "
            '"auto" adds it where the light is chosen automatically, unless the camera looks '
            "from below or a `background` is given.",
            option="add a ground that catches the shadow, or leave it out; auto: where the light is chosen "
            "automatically",
            check=auto_or(check_ground),
        ),
    ]
    background: Annotated[
        str | ArrayLike | None,
        Setting(
            None,
            '"transparent" or a color. It replaces the environment where the camera sees it directly; its '
            "light and its reflections stay. The picture then has the AOV `alpha`. Colors of a "
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
            '"full", "direct_mis", "direct_simple" or "naive". All settings that take names also take an '
            "object of your own, such as a function; docs/extending.md has an example of each.",
            option="light transport algorithm",
            choices=INTEGRATORS,
            identity=True,
        ),
    ]
    features: Annotated[
        Feature | Sequence[Feature],
        Setting(
            (),
            "Features of your own, such as a fog that only the camera sees; docs/extending.md has it.",
            check=check_features,
        ),
    ]
    max_bounces: Annotated[
        int,
        Setting(
            12,
            "The most scattering events along a path: 0 shows only light seen directly, 1 also direct "
            "light on surfaces.",
            option="scattering events along a path",
            check=whole_number(0, 2**16),
            identity=True,
        ),
    ]
    roulette: Annotated[
        bool | int,
        Setting(
            ROULETTE_AFTER,
            "The number of scattering events before Russian roulette may end a path. The mean of the "
            "picture does not change. False means no roulette: that takes longer, and the noise is only a "
            "little lower.",
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
        range | int | None,
        Setting(
            None,
            "The samples to render, as a range of their numbers, in place of `spp`: range(0, 64) on one "
            "machine and range(64, 128) on another. `Image.merge` makes one picture of them. It has the "
            "same bits as all 128 samples rendered at once.",
            option="FIRST:END, samples to render in place of --spp, such as 64:128; "
            "`wavefront merge` joins the pictures",
            check=check_samples,
        ),
    ]
    sampler: Annotated[
        str | SamplerMaker,
        Setting(
            "sobol",
            '"sobol"; "bluenoise", whose error looks even at few samples; or "independent".',
            option="source of random numbers",
            choices=SAMPLERS,
            identity=True,
        ),
    ]
    accel: Annotated[
        str | AcceleratorMaker,
        Setting(
            "auto",
            'Ray queries by "numpy" or by "embree" (`pip install embreex`). "auto" takes Embree where it '
            "is installed and there are triangles.",
            option="ray queries: auto, numpy or embree",
            choices=ACCELERATORS,
        ),
    ]
    workers: Annotated[
        int | None,
        Setting(
            None,
            "The number of waves that are traced at once. The default is one per core, or one per worker "
            "of the executor or cluster that is given.",
            option="waves traced at once (default: one per core)",
        ),
    ]
    executor: Annotated[
        str | ExecutorLike | None,
        Setting(
            None,
            'The kind of workers: "processes", "threads", "spawn" or "forkserver" (processes that share '
            "no memory with this one); a `concurrent.futures.Executor`, a function that returns one, or a "
            "`dask.distributed.Client`. By default a longer render takes processes, which are faster, "
            "a short one threads, and one that is a single small wave none: the caller traces it. The "
            "picture is the same. docs/scale.md tells more.",
            option="kind of workers (default: the faster here)",
            choices=EXECUTORS,
        ),
    ]
    noise: Annotated[
        float | None,
        Setting(
            None,
            "Render until the estimated relative error of the picture is at most this: 0.02 means 2 %. It "
            "is the root of the relative MSE that `compare` would find against a converged picture. Noisy "
            "pixels get more samples than others, and every pixel at least 32. A warning says when `spp` "
            "or `seconds` end the render before that.",
            option="render until this relative error, such as 0.02",
            check=optional(check_noise),
            identity=True,
        ),
    ]
    quality: Annotated[
        str,
        Setting(
            AUTO,
            'When a picture ends without `spp`, `noise`, `seconds` or `samples`. "auto": where the light was '
            "chosen, too, it is denoised and ends as soon as it is clean, after 4 to 100 samples per pixel; "
            "where the scene has a light of its own, it ends at an error of 2 %, after 100 samples at most. "
            '"reference": 100 samples. docs/choices.md has the rule.',
            option="when a picture ends where nothing else says it: auto or reference (default: auto)",
            check=check_quality,
        ),
    ]
    seconds: Annotated[
        float | None,
        Setting(
            None,
            "Render until this time is used, scene setup included. Waves that need more than a tenth "
            "longer are discarded. Every pixel still gets its first sample, unless a wave of first "
            "samples takes over three seconds. With `noise`, the render ends at whichever comes first.",
            option="render until this time is used",
            check=optional(above_zero),
        ),
    ]
    shutter: Annotated[
        tuple[float, float] | None,
        Setting(
            None,
            "When the shutter is open, (from, until) in seconds of the scene: what moves is blurred. None "
            "shows one moment.",
            option="OPEN:CLOSE in seconds of the scene, such as 0.48:0.52: what moves meanwhile is blurred",
            check=check_shutter,
            identity=True,
        ),
    ]
    shutter_curve: Annotated[
        str | Curve,
        Setting(
            "box",
            'How much light the shutter lets through while it is open: "box", the same all the time, or '
            '"triangle", most in the middle. docs/motion_blur.md has one of your own.',
            option="how the shutter opens and closes",
            choices=SHUTTER_CURVES,
            identity=True,
        ),
    ]
    filter: Annotated[
        str | Filter,
        Setting(
            "box",
            'The reconstruction filter, by which samples of a pixel are spread: "box" (evenly over the '
            'pixel), "tent" (radius 1 pixel) or "gaussian" (σ 0.5 pixels, cut off at 1.5 from the '
            "center); or a `BoxFilter`, `TentFilter` or `GaussianFilter`, which have a radius.",
            option="reconstruction filter",
            choices=FILTERS,
            identity=True,
        ),
    ]
    light_sampler: Annotated[
        str | LightSamplerMaker,
        Setting(
            "spatial",
            'How one light is chosen among many at a point: "spatial" weighs each light by what it brings '
            'there, "power" by its power alone, "uniform" all alike.',
            option="how one light is chosen among many",
            choices=LIGHT_SAMPLERS,
            identity=True,
        ),
    ]
    branches: Annotated[
        int | str,
        Setting(
            AUTO,
            "The number of ways in which a path goes on from its first surface (splitting), at most 64; "
            'only for "full". Each has a light sample there. With two to four, a sample takes longer, but '
            'has less noise where most noise is in light, not at edges. "auto" finds out by a short tuning '
            "run whether that pays: docs/choices.md tells how. Pictures of less than 192x192 pixels have one "
            "branch.",
            option="ways in which a path goes on from its first surface; auto: a tuning run finds what pays",
            check=auto_or(whole_number(1, MAX_BRANCHES)),
        ),
    ]
    guide: Annotated[
        bool | str,
        Setting(
            False,
            "Path guiding: learn from a training pass of 262144 paths where light comes from, and choose "
            'directions by that; only for "full". The training takes a second or two. Guiding pays where '
            "light comes through narrow openings or after several reflections: docs/guiding.md has "
            'figures. What is learned depends on the scene, the camera and the seed alone. "auto" guides '
            'only where a short tuning run says that it pays; `metadata["guided"]` says what it found.',
            option="path guiding: learn where light comes from, for scenes with much indirect light",
            check=auto_or(flag),
            identity=True,
        ),
    ]
    reuse: Annotated[
        bool | str,
        Setting(
            AUTO,
            "Share paths among pixels: what a path finds from its second surface on counts for sixteen "
            'pixels that lie a little apart; only for "full". It pays where most noise is in indirect '
            "light between matte surfaces. The errors of such pixels depend on each other: docs/reuse.md "
            'has figures. "auto" shares paths where a short tuning run says that it pays; beside glass '
            "or much gloss only where light is hard to find: docs/choices.md tells how.",
            check=auto_or(flag),
            option="share paths among pixels: yes, no, or auto: a tuning run finds whether it pays",
        ),
    ]
    clamp: Annotated[
        float | None,
        Setting(
            None,
            "The most that a path may find as indirect light at once: a radiance, as the mean of its "
            "channels. Brighter contributions are scaled down. This removes fireflies, but light as well: "
            'the picture is biased, too dark. The AOV "clamped" holds what was removed, '
            '`metadata["clamped"]` says what part of all light that is, and above 2 % a warning does. '
            "Light seen directly, and light from lights on the first rough surface, is not clamped.",
            option="most indirect radiance that a path finds at once; removes fireflies, and some light",
            check=optional(above_zero),
            identity=True,
        ),
    ]
    caustics: Annotated[
        bool,
        Setting(
            False,
            "Light tracing: one path from the lights for each sample, beside that from the camera. These "
            "paths find caustics, the light that smooth glass and mirrors send on. Without them that "
            "light is found by chance, and that of point, spot and directional lights never. Only for "
            '"full"; docs/caustics.md has figures.',
            option="light tracing: paths from lights, for caustics of smooth glass and mirrors",
            check=flag,
            identity=True,
        ),
    ]
    wave_size: Annotated[
        int | None,
        Setting(
            None,
            "The most paths that one worker traces together, at most 2^24. The default suits their number "
            "and speed, and is at most 131 072. The picture does not depend on it.",
            check=optional(whole_number(1, 2**24)),
        ),
    ]
    checkpoint: Annotated[
        str | os.PathLike[str] | None,
        Setting(
            None,
            "A file that keeps the state of the render. It is written every `checkpoint_interval` "
            "seconds, at Ctrl-C and at the end. The same call goes on from it, with the same bits as "
            "without a break; with more `spp` it goes on further. The file of another scene or of other "
            "settings is refused. It holds samples: the picture before denoising.",
            option="file that keeps the state of the render, from which the same command goes on",
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
            "The most memory that this program and its workers may use together, including what it "
            'already uses: a number of bytes, or a size such as "2GB" or "800MiB". It limits the size of '
            "waves and the number of workers. The picture does not depend on it. A render that needs more "
            "is refused before it begins.",
            option="most memory to use, such as 2GB",
            check=optional(memory_size),
        ),
    ]
    strict: Annotated[
        bool,
        Setting(
            False,
            "True makes it an error, not a warning, when workers on other machines may compute other bits: "
            "because of another version of NumPy or of this package, or another processor.",
            check=flag,
        ),
    ]
    aovs: Annotated[
        str | Sequence[str],
        Setting(
            (),
            f"AOVs, the layers of the image beside the picture, by name: {AOV_LIST}, "
            'or "all" for all but the last seven. docs/layers.md says what each holds, and what it costs.',
            option="AOV to render beside the picture, or all; can be given several times",
            flag="aov",
            check=chosen_aovs,
        ),
    ]
    flow_times: Annotated[
        tuple[float, float] | None,
        Setting(
            None,
            "Times of the pictures before and after, (before, after) in seconds of the scene, to which the "
            'AOVs "flow_back" and "flow" lead. `render_frames` takes those of its frames.',
            option="BEFORE:AFTER in seconds of the scene: where the AOVs flow_back and flow lead to",
            check=check_flow_times,
        ),
    ]
    denoise: Annotated[
        bool | None,
        Setting(
            None,
            "Removes most of the noise of the last picture, as `Image.denoise` does. Edges and textures "
            'are kept by the AOVs "denoising_albedo" and "denoising_normal", which are added. '
            "`image.noisy` is the picture before. None: as `quality` says.",
            option="remove noise from the picture",
            check=optional(flag),
        ),
    ]
    progress: Annotated[
        Progress,
        Setting(
            None,
            "None shows a bar when a render takes over two seconds; in a notebook it shows the picture "
            "while it refines. False shows neither. A function is called with how much is done and how "
            "much there is at most: samples, or seconds where `seconds` is given. During a long wave it "
            "is called every second.",
            check=check_progress,
        ),
    ]


class AllSettings(RenderSettings, total=False):
    """The settings, also `spp`, which functions have as a parameter of its own."""

    spp: Annotated[
        int | None,
        Setting(
            None,
            "Samples per pixel, at least 1; by default as many as `quality` says. With `noise` or `seconds` "
            "the most that a pixel gets; by default then 65536, and with `seconds` as many as there is time "
            "for.",
            option="samples per pixel (default: as --quality says); the most there may be with --noise or "
            "--seconds",
        ),
    ]


def _declared() -> dict[str, Setting]:
    """Return the declaration of each setting, by name."""
    hints = get_type_hints(AllSettings, include_extras=True)
    declared = {
        name: replace(
            get_args(hint)[1],
            text=get_args(hint)[1].text + exclusions_of(name),
            type=_as_written(AllSettings.__annotations__[name]),
        )
        for name, hint in hints.items()
    }
    return {"spp": declared.pop("spp"), **declared}


def _as_written(annotation: Any) -> str:
    """Return the type in an annotation Annotated[type, Setting(...)], as it is written there."""
    text: str = getattr(annotation, "__forward_arg__", annotation)
    return text.removeprefix("Annotated[").partition(", Setting(")[0]


SETTINGS = _declared()  # in the order of parameters


def takes_settings(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function with `**settings: Unpack[RenderSettings]` show each of them as a parameter.

    Its signature and its documentation have all settings that it has no parameter for. An unknown name is a
    TypeError, as in Python, that suggests a known one.
    """
    signature = settings_signature(inspect.signature(function))
    known = tuple(signature.parameters)

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        unexpected = unknown_keyword(function, known, args, kwargs)
        if unexpected is not None:
            raise unexpected
        return function(*args, **kwargs)

    checked.__signature__ = signature  # type: ignore[attr-defined]
    checked.__doc__ = described(function.__doc__)
    return checked


def describes_settings(cls: type[C]) -> type[C]:
    """Let the documentation of a class describe the settings that `__init__` takes."""
    cls.__doc__ = described(cls.__doc__)
    return cls


def settings_signature(signature: inspect.Signature) -> inspect.Signature:
    """Return a signature with a parameter for each setting in place of `**settings`."""
    parameters = [
        parameter
        for parameter in signature.parameters.values()
        if parameter.kind is not inspect.Parameter.VAR_KEYWORD
    ]
    taken = {parameter.name for parameter in parameters}
    rest = [
        inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, default=setting.default, annotation=setting.type
        )
        for name, setting in SETTINGS.items()
        if name not in taken
    ]
    return signature.replace(parameters=[*parameters, *rest])


def described(text: str | None) -> str | None:
    """Return a docstring with the texts of settings that it lacks in place of `{settings}`."""
    before, placeholder, after = (text or "").partition(PLACEHOLDER)
    if not placeholder:
        return text
    indent = before.rpartition("\n")[2]
    missing = (name for name in SETTINGS if f"\n{indent}{name}\n" not in before)
    entries = [f"{name}\n{_wrapped(SETTINGS[name].text, indent + '    ')}" for name in missing]
    return before + f"\n{indent}".join(entries) + after


def _wrapped(text: str, indent: str) -> str:
    """Return text in lines of at most `WIDTH` characters (textwrap would take most of an import)."""
    lines, line = [], indent
    for word in text.split(" "):
        if len(line) + len(word) > WIDTH and line != indent:
            lines.append(line.rstrip())
            line = indent
        line += word + " "
    return "\n".join([*lines, line.rstrip()])
