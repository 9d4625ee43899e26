"""Estimators of light, the steps that they are made of, and how their settings are tuned.

Examples
--------
>>> from wavefront.integrators import INTEGRATORS
>>> list(INTEGRATORS)
['naive', 'direct_simple', 'direct_mis', 'full']
"""

from ..stages.bounce import bounce_sample
from ..stages.compact import alive, compact, roulette, select
from ..stages.interaction import interaction
from ..stages.intersect import intersect
from ..stages.shade import direct, emitted, shading
from .ladder import li_direct_mis, li_direct_simple, li_full, li_naive
from .registry import INTEGRATORS, WITH_MIS, Integrator, integrator_for
from .shared_paths import li_reuse
from .steps import accumulate, intersect_and_compact, note, prepare_shading

__all__ = [
    "INTEGRATORS",
    "WITH_MIS",
    "Integrator",
    "accumulate",
    "alive",
    "bounce_sample",
    "compact",
    "direct",
    "emitted",
    "integrator_for",
    "interaction",
    "intersect",
    "intersect_and_compact",
    "li_direct_mis",
    "li_direct_simple",
    "li_full",
    "li_naive",
    "li_reuse",
    "note",
    "prepare_shading",
    "roulette",
    "select",
    "shading",
]
