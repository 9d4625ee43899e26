"""Functions that add a user's own things to the tables that settings are looked up in.

A name belongs to one thing for as long as the program runs. Worker processes know all names that were
registered before they were started. What is used once need not be registered: the settings of `render` take
the thing itself in place of a name.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .accel.registry import ACCELERATORS, AcceleratorMaker
from .arrays.vec import Floats
from .codecs.images import IMAGE_READERS, IMAGE_WRITERS
from .core.errors import SceneError
from .core.registry import Registry
from .integrators import INTEGRATORS, Integrator
from .lights.choice import LightSamplerMaker
from .lights.samplers import LIGHT_SAMPLERS
from .sampling.filters import FILTERS, Filter
from .sampling.sampler import SAMPLERS, SamplerMaker
from .scene import Scene
from .workers.executors import EXECUTORS, ExecutorLike


def register_integrator(name: str, integrator: Integrator) -> None:
    """Let `render(integrator=name)` use an integrator.

    Parameters
    ----------
    name
        A name that is not taken.
    integrator
        Called with the compiled scene, the paths of a wave, the sampler and `max_bounces`; returns the
        radiance of each path, (3, n), in the order of the paths. `wf.integrators` has the steps that it may
        be made of.

    Raises
    ------
    SceneError
        If the name is taken, or the integrator is not a function.

    Examples
    --------
    >>> wf.register_integrator("naive twin", wf.integrators.li_naive)
    >>> scene = [wf.Sphere((0, 0, 0), 1), wf.Environment(1)]
    >>> wf.render(scene, spp=1, size=(8, 8), integrator="naive twin").metadata["integrator"]
    'naive twin'
    """
    INTEGRATORS.register(name, integrator)


def register_sampler(name: str, sampler: SamplerMaker) -> None:
    """Let `render(sampler=name)` use a sampler.

    Parameters
    ----------
    name
        A name that is not taken.
    sampler
        A subclass of `Sampler`, or a function; it is called with the seed and the width of the picture.

    Raises
    ------
    SceneError
        If the name is taken, or the sampler cannot be called.

    Examples
    --------
    >>> class Middle(wf.Sampler):
    ...     def draw_1d(self, pixel, sample, bounce, dimension):
    ...         return np.full(len(pixel), 0.5, np.float32)
    ...     def draw_2d(self, pixel, sample, bounce, dimension):
    ...         return np.full((2, len(pixel)), 0.5, np.float32)
    >>> wf.register_sampler("middle", Middle)
    >>> scene = [wf.Sphere((0, 0, 0), 1), wf.PointLight((0, 3, 3), 20)]
    >>> wf.render(scene, spp=1, size=(8, 8), sampler="middle").metadata["sampler"]
    'middle'
    """
    SAMPLERS.register(name, sampler)


def register_filter(name: str, filter: Filter) -> None:
    """Let `render(filter=name)` use a reconstruction filter.

    Parameters
    ----------
    name
        A name that is not taken.
    filter
        Called with u (2, n) in [0, 1)²; returns positions (2, n) in pixels from the corner of the pixel,
        distributed as the filter weighs them.

    Raises
    ------
    SceneError
        If the name is taken, or the filter is not a function.

    Examples
    --------
    >>> def center(u):
    ...     return np.full_like(u, 0.5)
    >>> wf.register_filter("center", center)
    >>> scene = [wf.Sphere((0, 0, 0), 1), wf.Environment(1)]
    >>> wf.render(scene, spp=1, size=(8, 8), filter="center").metadata["filter"]
    'center'
    """
    FILTERS.register(name, filter)


def register_light_sampler(name: str, light_sampler: LightSamplerMaker) -> None:
    """Let `render(light_sampler=name)` use a light sampler.

    Parameters
    ----------
    name
        A name that is not taken.
    light_sampler
        Called with the estimated power (k,) of each light, all above 0; half of the scene's extent (3,),
        whose middle is the origin; and a function that takes points (3, c) and a radius, and returns a bound
        on the irradiance (c, k) by each light within the radius of each point. Lengths are scene units.
        Returns a `LightSampler`. It is not called for scenes with one light.

    Raises
    ------
    SceneError
        If the name is taken, or the light sampler cannot be called.

    Examples
    --------
    >>> class First(wf.LightSampler):
    ...     def __init__(self, power, half_size, irradiance):
    ...         pass
    ...     def sample(self, point, u):
    ...         return np.zeros(len(u), np.intp), np.ones(len(u), np.float32)
    ...     def pmf(self, light, point):
    ...         return (light == 0).astype(np.float32)
    >>> wf.register_light_sampler("first", First)
    >>> scene = [wf.Sphere((0, 0, 0), 1), wf.PointLight((0, 3, 3), 20)]
    >>> wf.render(scene, spp=1, size=(8, 8), light_sampler="first").shape
    (8, 8, 3)
    """
    LIGHT_SAMPLERS.register(name, light_sampler)


def register_accelerator(name: str, accelerator: AcceleratorMaker) -> None:
    """Let `render(accel=name)` use an accelerator.

    Parameters
    ----------
    name
        A name that is not taken.
    accelerator
        A class or a function; it is called with a `Geometry` and returns an `Accelerator`.

    Raises
    ------
    SceneError
        If the name is taken, or the accelerator cannot be called.

    Examples
    --------
    >>> from wavefront.accel.numpy_accel import NumpyAccelerator
    >>> class Mine(NumpyAccelerator):
    ...     name = "mine"
    >>> wf.register_accelerator("mine", Mine)
    >>> scene = [wf.Sphere((0, 0, 0), 1), wf.Environment(1)]
    >>> wf.render(scene, spp=1, size=(8, 8), accel="mine").metadata["accelerator"]
    'mine'
    """
    ACCELERATORS.register(name, accelerator)


def register_executor(name: str, executor: ExecutorLike) -> None:
    """Let `render(executor=name)` use workers of another kind.

    Parameters
    ----------
    name
        A name that is not taken.
    executor
        Called with the number of workers; returns a `concurrent.futures.Executor`, which is shut down at
        the end of the render. An executor itself, or a `dask.distributed.Client`, is not shut down.

    Raises
    ------
    SceneError
        If the name is taken, or it is not an executor.

    Examples
    --------
    >>> from concurrent.futures import ThreadPoolExecutor
    >>> wf.register_executor("pool", ThreadPoolExecutor)
    >>> scene = [wf.Sphere((0, 0, 0), 1), wf.Environment(1)]
    >>> wf.render(scene, spp=1, size=(8, 8), executor="pool").shape
    (8, 8, 3)
    """
    EXECUTORS.register(name, executor)


def register_format(
    extension: str,
    *,
    load: Callable[[str, bytes], Scene] | None = None,
    read_image: Callable[[bytes], Any] | None = None,
    write_image: Callable[[Floats], bytes] | None = None,
) -> None:
    """Let scenes or pictures be read from files, or pictures be written to files, of another format.

    Parameters
    ----------
    extension
        How the names of such files end, such as ".xyz"; upper and lower case are the same.
    load
        Called with the path and the bytes of a file; returns its `Scene`. `wf.load`, `wf.load_mesh` and
        `render` use it.
    read_image
        Called with the bytes of a file; returns pixels (H, W, 1 to 4): linear floats, or uint8 or uint16 that
        are encoded as sRGB. `Texture`, `Environment` and `Image.load` use it.
    write_image
        Called with linear float32 pixels (H, W, 3); returns the bytes of a file. `Image.save` uses it.

    Raises
    ------
    SceneError
        If the extension does not begin with a dot or is taken, or no function is given.

    Examples
    --------
    >>> def load_balls(path, data):
    ...     rows = [[float(word) for word in line.split()] for line in data.decode("ascii").splitlines()]
    ...     return wf.Scene([wf.Sphere(row[:3], row[3]) for row in rows])
    >>> wf.register_format(".balls", load=load_balls)
    >>> with open("three.balls", "w") as file:
    ...     _ = file.write("0 0 0 1\\n2 0 0 1\\n4 0 0 1\\n")
    >>> len(wf.load("three.balls").shapes)
    3
    """
    if not isinstance(extension, str) or not extension.startswith(".") or len(extension) < 2:
        raise SceneError(f"extension is {extension!r}; it must begin with a dot, as '.xyz' does")
    from .io.readers import READERS  # here, as few programs read scenes of their own formats

    functions: list[tuple[Registry[Any], Any]] = [
        (READERS, load),
        (IMAGE_READERS, read_image),
        (IMAGE_WRITERS, write_image),
    ]
    if all(function is None for _, function in functions):
        raise SceneError("register_format needs load, read_image or write_image")
    for table, function in functions:
        if function is not None:
            table.register(extension.lower(), function)
