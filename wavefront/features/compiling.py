"""Scenes are compiled: flat arrays, and the program of features that the scene has."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from ..accel import Accelerator, Geometry
from ..compile.program import Feature, Program
from ..compile.scene import CompiledScene, gather_scene
from ..lights.choice import LightSamplerMaker
from ..scene import Scene
from .absorption import Absorption
from .alpha import Alpha
from .background import Backdrop, Background
from .black_lights import BlackLights
from .caustics import Caustics
from .dispersion import Dispersion
from .instances import Instances
from .interpolation import Interpolation, SmoothNormals
from .media import Glow, Media
from .motion import Deformations, Moments, Motion
from .nested import Nested
from .normal_maps import NormalMaps
from .passing import Passing
from .receivers import Receivers
from .shadow_catchers import ShadowCatchers
from .shadow_terminator import ShadowTerminator
from .unseen import Unseen

# In the order in which they act.
FEATURES: tuple[type[Feature], ...] = (
    Interpolation,
    Deformations,
    Instances,
    Motion,
    Moments,
    SmoothNormals,
    ShadowTerminator,
    Receivers,
    Alpha,
    Nested,
    Unseen,
    ShadowCatchers,
    NormalMaps,
    Dispersion,
    Absorption,
    Media,
    Passing,
    Glow,
    Caustics,
    BlackLights,
    Backdrop,
    Background,
)


def compile_scene(
    scene: Scene,
    make_accelerator: Callable[[Geometry], Accelerator],
    light_sampler: str | LightSamplerMaker = "spatial",
    most_copies: int = 0,
    mis: bool = False,
    caustics: bool = False,
    asked: Mapping[str, Any] | None = None,
) -> CompiledScene:
    """Return a scene as flat arrays, with the program of the features that it has.

    Parameters
    ----------
    scene, make_accelerator, light_sampler, most_copies, mis, caustics
        As for `compile.scene.gather_scene`.
    asked
        Settings that features read, by their names; those that are missing are None.

    Raises
    ------
    SceneError
        As `gather_scene`.
    """
    facts = gather_scene(scene, make_accelerator, light_sampler, most_copies, mis, caustics, asked)
    return replace(facts.compiled, program=Program.of(facts, FEATURES))
