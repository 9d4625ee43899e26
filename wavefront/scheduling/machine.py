"""What the bits of a picture depend on beside the scene: versions and processor of a machine."""

from __future__ import annotations

import platform
import sys

import numpy as np

from ..version import VERSION

NONE = "none"


def describe_machine() -> dict[str, str]:
    """Return, by name, what the bits of results of this process depend on."""
    described = {
        "wavefront": VERSION,
        "NumPy": np.__version__,
        "architecture": platform.machine(),
        "CPU features": " ".join(_cpu_features()) or NONE,
    }
    if "embreex" in sys.modules:
        described["embreex"] = _embreex_version()
    return described


def machine_differences(here: dict[str, str]) -> tuple[str, ...]:
    """Return in what this process differs from the machine that was described, in words."""
    there = describe_machine()
    if "embreex" in here and "embreex" not in there:
        there["embreex"] = _embreex_version()
    return tuple(
        _difference(name, value, there[name]) for name, value in here.items() if there[name] != value
    )


def _difference(name: str, here: str, there: str) -> str:
    if name != "CPU features":
        return f"{name} {there} in place of {here}"
    ours, theirs = set(here.split()), set(there.split())
    added, missing = " ".join(sorted(theirs - ours)), " ".join(sorted(ours - theirs))
    parts = [f"{text} {names}" for text, names in (("with", added), ("without", missing)) if names]
    return f"a CPU {' and '.join(parts)}"


def _cpu_features() -> list[str]:
    """Return the extensions of the processor that NumPy uses; as `np.show_runtime` finds them."""
    from numpy._core import _multiarray_umath as umath  # type: ignore[attr-defined]

    return [name for name in umath.__cpu_dispatch__ if umath.__cpu_features__[name]]


def _embreex_version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("embreex")
    except PackageNotFoundError:
        return NONE
