"""The table of integrators."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

from ..arrays.state import Paths
from ..arrays.vec import Floats
from ..compile.scene import CompiledScene
from ..core.registry import Registry
from ..guiding import GuideTable
from ..sampling.sampler import Sampler
from ..sampling.tiles import Tiles
from .ladder import li_direct_mis, li_direct_simple, li_full, li_naive
from .shared_paths import li_reuse

Integrator: TypeAlias = Callable[[CompiledScene, Paths, Sampler, int], Floats]


def integrator_for(
    integrator: Integrator, branches: int, tiles: Tiles | None, table: GuideTable | None
) -> Integrator:
    """Return an integrator with the given branches, tiles whose pixels share paths, and guide."""
    if tiles is not None:
        return partial(li_reuse, branches=branches, table=table, tiles=tiles)
    if branches == 1 and table is None:
        return integrator
    return partial(li_full, branches=branches, table=table)


WITH_MIS: tuple[Integrator, ...] = (li_direct_mis, li_full)  # weigh light samples against BSDF samples
INTEGRATORS: Registry[Integrator] = Registry(
    "integrator",
    "a function of (scene, paths, sampler, max_bounces)",
    {"naive": li_naive, "direct_simple": li_direct_simple, "direct_mis": li_direct_mis, "full": li_full},
)
