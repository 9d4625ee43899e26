"""Lights and emitting shapes that are given by their flux: lumens or watts."""

from __future__ import annotations

from copy import copy
from typing import Any, TypeVar

import numpy as np

from ..arrays.vec import Doubles
from ..colors import EFFICACY, to_photometric
from ..core.errors import SceneError, in_brief, number
from ..core.suggestions import suggests_keywords
from ..shapes import Mesh, Shape, Sphere
from .base import Light
from .ies import IESLight
from .point import PointLight, PointLights
from .spot import SpotLight

Source = TypeVar("Source", bound=Light | Shape)


@suggests_keywords
def with_flux(
    source: Source, lumens: float | None = None, *, watts: float | None = None, efficacy: float = EFFICACY
) -> Source:
    """Return a copy of a light, or of an emitting shape, that emits this flux in the same color.

    Parameters
    ----------
    source
        A `PointLight`, `PointLights` (together), `SpotLight` or `IESLight`, or a `Mesh` or `Sphere` with an
        even emission; of it only the color counts. A `DirectionalLight` and an `Environment` have no flux:
        they take lux and cd/m², by `from_photometric`.
    lumens, watts
        Luminous flux, or power as the mean of the channels. The area that emits is in square scene units.
    efficacy
        lm/W of white, as in `from_photometric`. Light given in lumens has it in `Measurement.lux`, too.

    Raises
    ------
    SceneError
        If not exactly one of both is given, or the source is dark, of another kind, or has a picture.

    Examples
    --------
    >>> bulb = wf.with_flux(wf.PointLight((0, 2, 0), wf.srgb("moccasin")), lumens=800)
    >>> panel = wf.with_flux(wf.Rectangle((0, 2.5, 0), (0.6, 0, 0), (0, 0, 0.6), emission=1), lumens=3600)
    >>> round(float(panel.emission[0, 0]), 2)  # 3600 lm / (683 lm/W · π · 0.36 m²)
    4.66
    """
    if (lumens is None) == (watts is None):
        raise SceneError("with_flux needs lumens or watts, and not both")
    name, value = ("lumens", lumens) if watts is None else ("watts", watts)
    wanted = number(f"with_flux {name}", value, lambda x: x >= 0, "at least 0")
    strength, power = _strength_and_power(source)
    emitted = float(to_photometric(power, efficacy=efficacy) if watts is None else power.mean())
    if emitted <= 0:
        raise SceneError(f"with_flux: the {type(source).__name__} is dark; give it a color")
    scaled = copy(source)
    setattr(scaled, strength, getattr(source, strength) * (wanted / emitted))
    return scaled if watts is not None else _with_efficacy(scaled, efficacy)


def _with_efficacy(source: Any, efficacy: float) -> Any:
    """Return a source that was given lumens with the efficacy that `Measurement.lux` is to take for it."""
    owner: Any = source if isinstance(source, Light) else source.material
    if owner.efficacy != efficacy:
        if owner is not source:
            owner = source.material = copy(owner)
        owner.efficacy = efficacy
    return source


def _strength_and_power(source: Any) -> tuple[str, Doubles]:
    """Return the name of the attribute with the strength of a source, and its power (3,), W by channel."""
    if isinstance(source, Mesh | Sphere) and isinstance(source.emission, np.ndarray):
        return "emission", source.emission[:, 0].astype(np.float64) * np.pi * _area(source)
    pictured = isinstance(source, SpotLight) and source.picture is not None
    if pictured or not isinstance(source, PointLight | PointLights | SpotLight | IESLight):
        kinds = (
            "PointLight, PointLights, IESLight, SpotLight without a picture, Mesh or Sphere of even emission"
        )
        raise SceneError(f"with_flux source must be a {kinds}, got {in_brief(source)}")
    record = source.record(np.zeros(3))
    intensity = record.intensity.astype(np.float64)
    mean = intensity.mean(0)
    power = (intensity * (record.power(1.0) / np.where(mean > 0, mean, 1))).sum(1)
    return "intensities" if isinstance(source, PointLights) else "intensity", power


def _area(shape: Mesh | Sphere) -> float:
    if isinstance(shape, Sphere):
        return 4 * np.pi * shape.radius**2
    a, b, c = shape.vertices[shape.faces].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) * (1.0 if shape.two_sided else 0.5)
