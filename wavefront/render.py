"""render(): one call over a session."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any

from numpy.typing import ArrayLike

from .accel.registry import AcceleratorMaker
from .camera import Camera
from .core.progress import Progress
from .core.suggestions import suggests_keywords
from .image import Image
from .integrators import Integrator
from .lights.samplers import LightSamplerMaker
from .materials import MaterialLike
from .sampling.filters import Filter
from .sampling.sampler import SamplerMaker
from .scheduling.executors import ExecutorLike
from .session import Session
from .session.final_checks import interrupted
from .session.notebook import run_shown, shows_pictures


@suggests_keywords
def render(
    scene: Any,
    spp: int | None = None,
    *,
    camera: Camera | None = None,
    size: tuple[int, int] | None = None,
    view: str | ArrayLike | None = None,
    fov: float | None = None,
    material: MaterialLike | None = None,
    smooth: bool | float | str = "auto",
    up: ArrayLike = "auto",
    lighting: str | None = "auto",
    ground: bool | str = "auto",
    background: str | ArrayLike | None = None,
    integrator: str | Integrator = "full",
    max_bounces: int = 12,
    roulette: bool | int = 2,
    seed: int = 0,
    samples: range | None = None,
    sampler: str | SamplerMaker = "sobol",
    accel: str | AcceleratorMaker = "auto",
    workers: int | None = None,
    executor: str | ExecutorLike | None = None,
    noise: float | None = None,
    seconds: float | None = None,
    filter: str | Filter = "box",
    light_sampler: str | LightSamplerMaker = "spatial",
    branches: int | str = "auto",
    guide: bool | str = False,
    reuse: bool | str = "auto",
    clamp: float | None = None,
    caustics: bool = False,
    wave_size: int | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    checkpoint_interval: float = 60,
    max_memory: int | str | None = None,
    strict: bool = False,
    aovs: str | Sequence[str] = (),
    denoise: bool = False,
    progress: Progress = None,
) -> Image:
    """Render a picture.

    Parameters
    ----------
    scene
        A `Scene`, the path of a mesh file, a `trimesh.Trimesh` or `trimesh.Scene`, a pair
        (vertices, faces), a shape, or a list of these.
    spp
        Samples per pixel, at least 1; by default 100. With `noise` or `seconds` the most that a
        pixel gets; by default then 65536, and with `seconds` as many as there is time for.
    camera
        What sees the scene, in place of the scene's own camera. Without either the scene is framed.
    size
        (width, height) in pixels, in place of the camera's; by default (512, 512).
    view
        From where a scene is framed, in place of the scene's own camera: "three_quarter", "front", "back",
        "left", "right", "top", "bottom", "iso", or (3,) from its middle to the camera. Without a camera it is
        "three_quarter", which is 35° to the right of the front and 22° above. Not with `camera`.
    fov
        Vertical field of view of the camera that frames a scene, degrees; by default 40. Not with another
        camera.
    material
        What bare meshes are made of: those of files and of trimesh, where it replaces what they say,
        (vertices, faces), and shapes that were given no material. A material, or the name of one, such as
        "gold".
    smooth
        Normals of bare meshes: True averages those of the faces around each vertex, False shows the facets,
        and a crease angle in degrees averages only over faces that are within it of each other. These replace
        the normals that a mesh has. "auto" keeps them, and computes those of files and trimesh objects that
        have none by a crease angle of 30°, but for glTF, whose facets are flat then: docs/formats.md says
        why. (vertices, faces) and `Mesh` stay as they are.
    up
        What is up in the scene: a vector (3,), or the name of an axis, such as "z". "auto" goes by the file:
        z for STL and 3MF, what a DAE says, else y. It turns the camera that frames a scene without one, and
        the `lighting` and the `ground`.
    lighting
        "studio", "softbox", "three_point", "cloudy" or "even": adds the light of that name, which `studio`
        describes, to the scene's own. "auto" adds "studio" where nothing shines, and nothing elsewhere; None
        adds nothing.
    ground
        Adds a level ground under the scene that catches its shadow and fades into the background. It belongs
        to the picture alone: the scene, its bounds and the numbers of its shapes stay. "auto" adds it where
        the light is chosen by itself and the camera is framed, unless that looks from below or a `background`
        is asked for.
    background
        "transparent" or a color: replaces what the camera sees directly of the environment; its light
        stays, and so do its reflections. Either gives the layer `alpha`. Colors of a transparent picture
        are premultiplied by alpha.
    integrator
        "full", "direct_mis", "direct_simple" or "naive". This and the other settings that take names also
        take a thing of your own, such as a function; docs/extending.md has an example of each.
    max_bounces
        Scattering events along a path: 0 shows only light seen directly, 1 direct light.
    roulette
        Scattering events of a path before Russian roulette may end it, by chance and without a change of
        the mean; False never ends a path so, which takes longer, mostly for less noise than that is worth.
    seed
        The same seed gives the same picture, bit for bit, unless `seconds` is given.
    samples
        The samples to render, as a range of their numbers, in place of `spp`: range(0, 64) on one machine
        and range(64, 128) on another. `Image.merge` makes one picture of them, which is that of all 128,
        bit for bit. Not with `noise` or `seconds`.
    sampler
        "sobol"; "bluenoise", whose error at few samples is even to the eye; or "independent".
    accel
        Ray queries by "numpy", by "embree" (`pip install embreex`), or "auto".
    workers
        How many waves are traced at once; by default one per core, or per worker of an executor or
        cluster that is given.
    executor
        What workers are: "processes", "threads", "spawn" or "forkserver", which are processes that
        share no memory with this one; or a `concurrent.futures.Executor`, a function that returns one,
        or a `dask.distributed.Client`. By default processes, which are faster, when there is work for
        more than a moment, and threads otherwise. The picture is the same. docs/scale.md tells more.
    noise
        Go on until the estimated relative error of the picture is no more than this: 0.02 means
        2 %. It is the root of the relative MSE that `compare` would find against a converged
        picture. Noisy parts get more samples than calm ones, and every pixel at least 32. When
        `spp` or `seconds` end the render above it, a warning says so.
    seconds
        Go on until this time is used, scene setup included; waves that are still under way a tenth
        later are discarded. Every pixel gets its first sample all the same, unless a wave of them
        takes over three seconds. With `noise` as well, whichever comes first.
    filter
        How the samples of a pixel are spread: "box" (evenly over the pixel), "tent" (radius 1
        pixel) or "gaussian" (σ 0.5 pixels, cut off at 1.5 from the center).
    light_sampler
        How one light of many is chosen at a point: "spatial" weighs what each brings there, "power"
        its power alone, "uniform" nothing.
    branches
        In how many ways the path of a sample goes on from the first surface, at most 64; only "full" has any.
        Two to four make a sample dearer, but less noisy by more where most of the noise is in indirect light,
        as in a room. "auto" finds out by a short trial whether they pay: docs/choices.md tells how. In
        pictures of less than 192x192 pixels it is one.
    guide
        Learn from a pilot of 262144 paths where light comes from, and choose directions by that; only "full"
        can be guided. It takes a second or two, and pays where light comes through narrow openings or several
        reflections: docs/guiding.md has figures. The pilot depends on the scene, the camera and the seed
        alone. "auto" guides only where a short trial with it and without it says that it pays;
        `metadata["guided"]` says what it found.
    reuse
        Share paths among pixels: what a path finds from its second surface on counts for sixteen pixels that
        lie a little apart; only "full" does so. It pays where most of the noise is in indirect light between
        matte surfaces. The errors of these pixels depend on each other then: docs/reuse.md has figures.
        "auto" shares where a short trial says that it pays, beside gloss and glass only where light is hard
        to find: docs/choices.md tells how. It never does with `branches`, `clamp`, `noise`,
        `caustics` or light groups.
    clamp
        The most that a path may find as indirect light at once, as radiance, the mean of its channels; what
        is brighter is scaled down. It removes fireflies, and with them light: the picture gets too dark. The
        layer "clamped" holds what was removed, `metadata["clamped"]` says how much of all light that is, and
        a warning does above 2 %. Light seen directly, and that of lights on the first rough surface, is not
        clamped.
    caustics
        Trace paths from the lights as well, one for each sample, which find the light that smooth glass and
        mirrors send on: caustics. Without it paths find that light by chance, and that of points, spots and
        directional lights never. Only "full" has it, and it does not go with `reuse`, `noise`, another filter
        or light groups: docs/caustics.md has figures.
    wave_size
        The most paths that are traced together by one worker; by default what suits their number and
        speed, at most 131 072. The picture does not depend on it.
    checkpoint
        A file that keeps the render: it is written every `checkpoint_interval` seconds, at Ctrl-C and at
        the end. The same call goes on from it, with the same bits as without a break; with more `spp` it
        goes on further. The file of another scene or of other settings is refused.
    checkpoint_interval
        Seconds between two writes of the checkpoint. Writing takes a twentieth of the time at most.
    max_memory
        The most memory that this program and its workers may use together, with what it uses
        already: a number of bytes, or a size such as "2GB" or "800MiB". It sizes waves, and the
        number of workers where not all of them fit. The picture does not depend on it. A render that
        needs more is refused before it begins.
    strict
        True makes it an error, not a warning, when workers on other machines may compute other bits:
        because of another version of NumPy or of this package, or another processor.
    aovs
        Layers beside the picture, by name: "position", "depth", "distance", "normal", "normal_geometric",
        "uv", "shape_id", "instance_id", "material_id", "alpha", "albedo", "direct", "indirect",
        "denoising_albedo", "denoising_normal", "light_groups", "coverage", "boxes", or "all" for all
        but the last three. docs/layers.md says what each holds, and what it costs.
    denoise
        Removes most of the noise of the last picture, as `Image.denoise` does, along edges and textures
        that the layers "denoising_albedo" and "denoising_normal" show, which it adds. `image.noisy` is the
        picture before.
    progress
        By default a bar appears when a render takes over two seconds; in a notebook the picture appears in
        its place, and refines. False shows neither; a function is called with how much is done and how much
        there is at most: samples, or seconds where `seconds` is given. While a wave takes long it is called
        every second.

    Returns
    -------
    Image

    Raises
    ------
    SceneError
        If an argument or the scene is malformed. It is a ValueError.
    Interrupted
        After Ctrl-C, within about two seconds; at a second Ctrl-C at once. It is a KeyboardInterrupt,
        and its `image` is the picture so far.
    RenderError
        If the render cannot go on: memory runs out, worker processes die again and again, more than
        1e-4 of the samples are not finite, or `seconds` are over before there is one sample. Its
        `image` is the picture so far.

    Examples
    --------
    >>> ball = wf.Sphere((0, 0, 0), 1, material=wf.Diffuse(0.5))
    >>> image = wf.render([ball, wf.Environment(1)], spp=4, size=(32, 24))
    >>> image.rgb.shape
    (24, 32, 3)
    """
    shown = shows_pictures(progress)
    session = Session(
        scene,
        spp=spp,
        camera=camera,
        size=size,
        view=view,
        fov=fov,
        material=material,
        smooth=smooth,
        up=up,
        lighting=lighting,
        ground=ground,
        background=background,
        integrator=integrator,
        max_bounces=max_bounces,
        roulette=roulette,
        seed=seed,
        samples=samples,
        sampler=sampler,
        accel=accel,
        workers=workers,
        executor=executor,
        noise=noise,
        seconds=seconds,
        filter=filter,
        light_sampler=light_sampler,
        branches=branches,
        guide=guide,
        reuse=reuse,
        clamp=clamp,
        caustics=caustics,
        wave_size=wave_size,
        checkpoint=checkpoint,
        checkpoint_interval=checkpoint_interval,
        max_memory=max_memory,
        strict=strict,
        aovs=aovs,
        denoise=denoise,
        progress=False if shown else progress,
    )
    return finish(session, run_shown if shown else Session.run_once)


def finish(session: Session, run: Callable[[Session], Image] = Session.run_once) -> Image:
    """Have a function render a session to the end, close it and return the picture, as `render` does."""
    with session.interrupt_handler as ctrl_c:  # until the last worker has ended
        with session:
            image = run(session)
        if ctrl_c.pressed:
            raise interrupted(image, None)
    return image
