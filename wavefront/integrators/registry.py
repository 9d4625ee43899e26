"""The table of integrators."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

from ..arrays.state import Paths
from ..arrays.vec import Floats
from ..compile.scene import CompiledScene
from ..core.registry import Registry
from ..sampling.sampler import Sampler
from ..sampling.tiles import Tiles
from .ladder import li_direct_mis, li_direct_simple, li_full, li_naive
from .shared_paths import li_reuse

Integrator: TypeAlias = Callable[[CompiledScene, Paths, Sampler, int], Floats]


def integrator_for(integrator: Integrator, tiles: Tiles | None) -> Integrator:
    """Return an integrator, or that of tiles whose pixels share paths."""
    return integrator if tiles is None else partial(li_reuse, tiles=tiles)


WITH_MIS: tuple[Integrator, ...] = (li_direct_mis, li_full)  # weigh light samples against BSDF samples
INTEGRATORS: Registry[Integrator] = Registry(
    "integrator",
    "a function of (scene, paths, sampler, max_bounces)",
    {"naive": li_naive, "direct_simple": li_direct_simple, "direct_mis": li_direct_mis, "full": li_full},
)
