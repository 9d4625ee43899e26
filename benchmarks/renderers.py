"""The sides of a comparison: this project with several settings, Mitsuba 3 and Cycles.

A side is called by its engine and its method: "wavefront embree guided", "llvm_ad_rgb multijitter",
"cycles guided". All draw a scene with as many bounces, a box filter and a worker per core.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from cycles_peer import Cycles
from mitsuba_scene import sensor, to_mitsuba

import wavefront as wf

DENOISED = "denoised"
GUIDED = "guided"
PLAIN = {"sampler": "sobol", "branches": 1, "guide": False, "reuse": False}
METHODS: dict[str, dict[str, Any]] = {  # settings of `wf.render` by what a side is called
    "default": {},
    "plain": PLAIN,
    "independent": {**PLAIN, "sampler": "independent"},
    "bluenoise": {**PLAIN, "sampler": "bluenoise"},
    "plain/4": {**PLAIN, "branches": 4},
    GUIDED: {**PLAIN, "guide": True},
    "guided/4": {**PLAIN, "guide": True, "branches": 4},
    "guided/reused": {**PLAIN, "guide": True, "reuse": True},
    "reused": {**PLAIN, "reuse": True},
    "reused/4": {**PLAIN, "reuse": True, "branches": 4},
    "auto": {"guide": "auto", "branches": "auto"},
    DENOISED: {**PLAIN, "denoise": True},
}
CYCLES = {"plain": {}, DENOISED: {"denoise": True}, GUIDED: {"guide": True}}
Render = Callable[[int, int], np.ndarray]  # spp, seed -> picture
_COPIES: WeakKeyDictionary[wf.Scene, dict[tuple[str, int], Any]] = WeakKeyDictionary()


def renderer(
    side: str, scene: wf.Scene, max_bounces: int, counts: tuple[int, ...], bpy_python: str | None = None
) -> Render:
    """Return the renderer of a side, for some sample counts."""
    *_, engine, method = side.split()
    if engine == "cycles":
        assert bpy_python is not None
        return cycles(scene, max_bounces, method, bpy_python, counts)
    if side.startswith("wavefront"):
        return ours(scene, max_bounces, method, engine)
    return mitsuba(scene, max_bounces, method, engine, counts)


def ours(scene: wf.Scene, max_bounces: int, method: str, accel: str) -> Render:
    """Return a renderer of this project; four branches of a path count as four samples."""
    options = {"accel": accel, "max_bounces": max_bounces, "progress": False, **METHODS[method]}
    branches = 4 if method.endswith("/4") else 1
    return lambda spp, seed: wf.render(scene, max(1, spp // branches), seed=seed, **options).rgb


def mitsuba(scene: wf.Scene, max_bounces: int, sampler: str, variant: str, counts: tuple[int, ...]) -> Render:
    """Return a renderer of Mitsuba, with a sensor for each of some sample counts."""
    import mitsuba as mi

    mi.set_variant(variant)
    loaded = loaded_by_mitsuba(mi, scene, max_bounces)
    sensors = {spp: sensor(mi, scene, sampler, spp) for spp in counts}

    def render(spp: int, seed: int) -> np.ndarray:
        mi.set_variant(variant)
        at = sensors.get(spp, sensors[counts[-1]])
        return np.array(mi.render(loaded, sensor=at, spp=spp, seed=seed))

    return render


def loaded_by_mitsuba(mi: Any, scene: wf.Scene, max_bounces: int) -> Any:
    """Return a scene as the variant of Mitsuba in use loads it, one copy for all samplers that draw it."""
    key = mi.variant(), max_bounces
    copies = _COPIES.setdefault(scene, {})
    if key not in copies:
        copies[key] = to_mitsuba(mi, scene, max_bounces)
    return copies[key]


def cycles(scene: wf.Scene, max_bounces: int, method: str, python: str, counts: tuple[int, ...]) -> Render:
    """Return a renderer of Cycles, a process of a Python for each of some sample counts."""
    made = {spp: Cycles(python, scene, spp, max_bounces, **CYCLES[method]) for spp in counts}
    return lambda spp, seed: made[spp].picture()
