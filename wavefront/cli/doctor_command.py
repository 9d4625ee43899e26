"""`wavefront doctor`."""

from __future__ import annotations

import argparse
import math
import os
import platform
import sys
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from ..arrays.record import record
from ..core.counted import counted
from ..core.memory import available_memory
from ..scheduling.executors import worker_count
from ..scheduling.machine import describe_machine
from ..version import VERSION
from .command import add_command
from .status import FAULT

SECONDS = 10.0
CHECKS_TAKE = 2.0  # seconds, about; the rest is for speed
REQUIRED = ("numpy", "imageio", "trimesh", "OpenEXR", "tqdm", "threadpoolctl", "pycollada")


@record
class Extra:
    """An extra of the package: what it installs and what that brings."""

    packages: tuple[str, ...]
    brings: str


EXTRAS = {
    "embree": Extra(("embreex",), "ray queries on meshes by Intel Embree, several times as fast"),
    "denoise": Extra(("pyoidn",), "Intel Open Image Denoise, for denoise=True"),
    "metrics": Extra(("flip-evaluator",), "FLIP in wavefront compare"),
    "dask": Extra(("distributed",), "renders on a Dask cluster"),
    "plot": Extra(("matplotlib",), "Image.plot"),
    "video": Extra(("av",), "animations as mp4"),
    "viewer": Extra(("viser",), "wf.view and wavefront view: a scene in the browser"),
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
    from .self_test import ROOM, check_furnace, check_workers, measure_speeds

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
    found = [each for each in threadpool_info() if each.get("user_api") == "blas"]
    names = [
        f"{each['internal_api']} {each['version']}, {counted(each['num_threads'], 'thread')}"
        for each in found
    ]
    yield f"  BLAS: {'; '.join(names) or 'none found'}"


def _about_extras() -> Iterator[str]:
    yield "Extras"
    for name, extra in EXTRAS.items():
        versions = {package: _version(package) for package in extra.packages}
        there = ", ".join(f"{package} {found}" for package, found in versions.items() if found)
        missing = " ".join(package for package, found in versions.items() if not found)
        state = f"installed ({there})" if not missing else f"not installed: pip install {missing}"
        yield f"  {name}: {extra.brings}; {state}"


def _about_settings() -> Iterator[str]:
    yield "Settings"
    yield "  --branches, --reuse: auto; a short trial finds out what pays, in 192x192 pixels or more"
    yield "  --guide: off; may pay where light is hard to find, as image.metadata['hint'] says then"
    yield "  --caustics: off; paths from lights find what smooth glass and mirrors send on"


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
