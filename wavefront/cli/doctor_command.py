"""`wavefront doctor`: what is installed, whether pictures are correct, and how fast they are."""

from __future__ import annotations

import argparse
import math
import os
import platform
import sys
import time
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from ..accel.embree import installed
from ..arrays.soa import soa
from ..arrays.vec import Doubles, Ints
from ..bsdfs import Dielectric, Diffuse
from ..camera import Camera
from ..core.memory import available_memory
from ..core.plural import plural
from ..drive import Session
from ..drive.render import render
from ..lights import Environment
from ..scene import Scene
from ..shapes import Mesh, Rectangle, Sphere
from ..version import VERSION
from ..workers.executors import worker_count
from ..workers.machine import describe_machine
from .command import add_command
from .messages import FAULT

SECONDS = 10.0
CHECKS_TAKE = 2.0  # seconds, about; the rest is for speed
REQUIRED = ("numpy", "imageio", "trimesh", "OpenEXR", "tqdm", "threadpoolctl", "pycollada", "mapbox_earcut")

SIZE = (128, 128)
FURNACE_SPP = 64
MOST_SPP = 1 << 16  # more than there is time for
STANDARD_ERRORS = 5  # by which the mean of a correct picture differs in one of two million tests
ROUNDING = 1e-5  # relative, of sums of float32 along a path
RINGS, SIDES = 32, 64  # of the mesh that rays are timed with
ROOM = (  # the scene of `timed_room`
    f"a room with a mesh of {2 * RINGS * SIDES} triangles, a sphere of glass and one light, "
    f"in {SIZE[0]}x{SIZE[1]} pixels"
)


@soa
class Extra:
    """An extra of the package: what it installs and what that brings."""

    packages: tuple[str, ...]
    brings: str


@soa
class CheckResult:
    """The result of a test."""

    name: str
    passed: bool
    text: str


EXTRAS = {
    "embree": Extra(("embreex",), "ray queries on meshes by Intel Embree, several times as fast"),
    "denoise": Extra(("pyoidn",), "Intel Open Image Denoise, for denoise=True"),
    "metrics": Extra(("flip-evaluator",), "FLIP in wavefront compare"),
    "dask": Extra(("distributed",), "renders on a Dask cluster"),
    "plot": Extra(("matplotlib",), "Image.plot"),
    "video": Extra(("av",), "animations as mp4"),
    "sky": Extra(("pvlib",), "sun_position and load_weather: where the sun stands"),
    "materialx": Extra(("materialx",), "load_materialx: materials of MaterialX documents"),
    "usd": Extra(("usd-core",), "scenes of USD"),
    "viewer": Extra(("viser",), "wf.view and wavefront view: a scene in the browser"),
    "nrrd": Extra(("pynrrd",), "load_grid: grids of NRRD for media"),
    "vti": Extra(("vtk",), "load_grid: grids of VTK, ImageData, for media"),
    "pyvista": Extra(("pyvista",), "data.wavefront.render(...) and plotter.wavefront.render(...)"),
    "gltf": Extra(("dracopy", "meshopt"), "compressed meshes of glTF"),
    "completion": Extra(("shtab",), "completion of this command line in bash and zsh"),
}


def add_doctor_command(commands: Any) -> None:
    """Add the command and its options to a parser's commands."""
    command = add_command(
        commands,
        "doctor",
        "say what is installed, what else could be, and test it for some seconds",
        ["wavefront doctor", "wavefront doctor --seconds 0"],
    )
    command.add_argument("--seconds", type=float, default=SECONDS, help="length of the test; 0 for none")
    command.set_defaults(run=_doctor)


def _doctor(options: argparse.Namespace) -> int:
    """Describe and test the installation; return the exit status."""
    for line in (*_about_program(), *_about_machine(), *_about_extras(), *_about_settings()):
        print(line, flush=True)
    if not options.seconds > 0:
        return 0
    print("Test", flush=True)
    workers = worker_count(None)
    results = [check_furnace(), check_workers()]
    results += measure_speeds(max(1.0, options.seconds - CHECKS_TAKE), workers)
    for result in results:
        print(f"  {'passed' if result.passed else 'FAILED'}  {result.name}: {result.text}")
    print(f"  Speeds are of {ROOM}.")
    print("  Rays to surfaces and to lights count alike. Other scenes have other speeds.")
    return 0 if all(result.passed for result in results) else FAULT


def _about_program() -> Iterator[str]:
    yield f"wavefront {VERSION}, Python {platform.python_version()} ({sys.executable})"
    yield "Packages: " + ", ".join(f"{name} {_version(name) or 'MISSING'}" for name in REQUIRED)


def _about_machine() -> Iterator[str]:
    from threadpoolctl import threadpool_info

    machine = describe_machine()
    yield "Machine"
    yield f"  system: {platform.platform()}"
    yield f"  cores: {worker_count(None)} for this process, {os.cpu_count()} in all"
    if hasattr(os, "getloadavg"):
        yield f"  load: {os.getloadavg()[0]:.1f} in the last minute; other programs slow the test below"
    memory = available_memory()
    yield f"  memory: {'unknown' if math.isinf(memory) else f'{memory / 1e9:.1f} GB available'}"
    yield f"  CPU: {machine['architecture']}; NumPy uses {machine['CPU features']}"
    libraries = [library for library in threadpool_info() if library.get("user_api") == "blas"]
    names = [
        f"{library['internal_api']} {library['version']}, {plural(library['num_threads'], 'thread')}"
        for library in libraries
    ]
    yield f"  BLAS: {'; '.join(names) or 'none found'}"


def _about_extras() -> Iterator[str]:
    yield "Extras"
    for name, extra in EXTRAS.items():
        versions = {package: _version(package) for package in extra.packages}
        installed = ", ".join(f"{package} {version}" for package, version in versions.items() if version)
        missing = " ".join(package for package, version in versions.items() if not version)
        state = f"installed ({installed})" if not missing else f"not installed: pip install {missing}"
        yield f"  {name}: {extra.brings}; {state}"


def _about_settings() -> Iterator[str]:
    yield "Settings"
    yield "  --branches, --reuse: auto; a short tuning run finds out what pays, in 192x192 pixels or more"
    yield "  --guide: off; may pay where light is hard to find, as image.metadata['hint'] says then"
    yield "  --caustics: off; paths from lights find what smooth glass and mirrors send on"


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def check_furnace() -> CheckResult:
    """Render a white sphere in white light, which must not be seen: its radiance is that of the light."""
    scene = Scene(
        [Sphere((0, 0, 0), 1, material=Diffuse(1.0))],
        [Environment(1.0)],
        Camera.look_at((0, 0, 4), (0, 0, 0), fov=20, size=(64, 64)),
    )
    image = render(scene, FURNACE_SPP, seed=1, progress=False)
    assert image.standard_error is not None
    mean = float(image.rgb.mean(dtype=np.float64))
    # the channels of a gray picture have the same samples
    error = float(np.sqrt(np.square(image.standard_error[..., 0], dtype=np.float64).sum()))
    error /= image.standard_error[..., 0].size
    passed = abs(mean - 1) <= STANDARD_ERRORS * error + ROUNDING
    return CheckResult(
        "furnace", passed, f"a white sphere in light of radiance 1 has {mean:.6f} ± {error:.6f}"
    )


def check_workers() -> CheckResult:
    """Render one picture with one worker and with two, which must have the same bits."""
    scene = timed_room()
    alone, together = (render(scene, 4, size=(64, 64), workers=n, progress=False) for n in (1, 2))
    return CheckResult(
        "workers", bool(np.array_equal(alone.rgb, together.rgb)), "one worker and two give the same bits"
    )


def measure_speeds(seconds: float, workers: int) -> list[CheckResult]:
    """Measure rays per second with each accelerator that is installed, for some seconds in all."""
    accelerators = ["numpy", *(["embree"] if installed() else [])]
    return [_measure_speed(name, seconds / len(accelerators), workers) for name in accelerators]


def _measure_speed(accelerator: str, seconds: float, workers: int) -> CheckResult:
    """Render for some seconds, counted from the first picture: its workers have started and are warm."""
    with Session(timed_room(), MOST_SPP, accel=accelerator, workers=workers, progress=False) as session:
        first = last = next(session)
        begin, passed = time.perf_counter(), 0.0
        while passed < seconds and (image := next(session, None)) is not None:
            last, passed = image, time.perf_counter() - begin
    rays, samples = (
        (last.metadata[name] - first.metadata[name]) / passed / 1e6 for name in ("rays", "samples")
    )
    text = (
        f"{rays:.2f} million rays per second, {samples:.2f} million samples per second "
        f"({plural(workers, 'worker')}, in {passed:.1f} s)"
    )
    return CheckResult(f"speed, {accelerator}", bool(np.isfinite(last.rgb).all()), text)


def timed_room() -> Scene:
    """Return a room with a ball of triangles and one of glass."""
    vertices, faces = _ball(RINGS, SIDES)
    white, red = Diffuse(0.75), Diffuse((0.7, 0.2, 0.1))
    walls = [
        Rectangle((-2, -1, -2), (0, 0, 4), (4, 0, 0), material=white),
        Rectangle((-2, -1, -2), (4, 0, 0), (0, 3, 0), material=white),
        Rectangle((-2, -1, -2), (0, 3, 0), (0, 0, 4), material=red),
    ]
    light = Rectangle((-0.5, 1.9, -0.5), (1, 0, 0), (0, 0, 1), emission=12.0)
    balls = [
        Mesh(vertices - (0.8, 0, 0), faces, material=white),
        Sphere((0.9, -0.3, 0.4), 0.7, material=Dielectric(1.5)),
    ]
    return Scene(
        [*walls, light, *balls], camera=Camera.look_at((1, 0.6, 5.5), (0, 0.1, 0), fov=40, size=SIZE)
    )


def _ball(rings: int, sides: int) -> tuple[Doubles, Ints]:
    """Return the vertices (n, 3) and faces (m, 3) of a unit ball of latitudes and longitudes."""
    latitude = np.linspace(0.01, np.pi - 0.01, rings + 1)[:, None]
    longitude = np.linspace(0, 2 * np.pi, sides, endpoint=False)[None]
    x, y, z = np.sin(latitude) * np.cos(longitude), np.cos(latitude), np.sin(latitude) * np.sin(longitude)
    vertices = np.stack([x, np.broadcast_to(y, x.shape), z], -1).reshape(-1, 3)
    row, column = (indices.ravel() for indices in np.mgrid[:rings, :sides])
    a, b = row * sides + column, row * sides + (column + 1) % sides
    faces = np.concatenate([np.stack([a, b, a + sides], 1), np.stack([b, b + sides, a + sides], 1)])
    return vertices, faces
