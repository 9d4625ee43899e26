"""Materials by name."""

from __future__ import annotations

from collections.abc import Callable

from ..bsdfs import Bsdf, Conductor, Dielectric, Diffuse, Mirror, OrenNayar, Principled
from ..bsdfs.conductor import METALS, SPELLINGS
from ..colors import is_color_name
from ..core.errors import SceneError, one_of, text
from ..textures.parameter import Color

METAL_ROUGHNESS = 0.2

# Materials of measured constants (Conductor and Dielectric) have no color to choose; all others are made for
# their look, with a color by default.
_FIXED: dict[str, Callable[[], Bsdf]] = {
    **{name: lambda name=name: Conductor.named(name, METAL_ROUGHNESS) for name in METALS},  # type: ignore[misc]
    "brass": lambda: Principled((0.91, 0.78, 0.42), metallic=1, roughness=METAL_ROUGHNESS),
    "bronze": lambda: Principled((0.71, 0.43, 0.18), metallic=1, roughness=0.3),
    "steel": lambda: Principled((0.67, 0.64, 0.60), metallic=1, roughness=0.3),
    "mirror": lambda: Mirror(0.95),
}
_COLORED: dict[str, tuple[Callable[[Color], Bsdf], Color]] = {
    "glass": (lambda color: Dielectric.named("glass", transmittance=color), 1.0),
    "frosted glass": (lambda color: Dielectric.named("glass", 0.3, transmittance=color), 1.0),
    "water": (lambda color: Dielectric.named("water", transmittance=color), 1.0),
    "ice": (lambda color: Dielectric.named("ice", 0.15, transmittance=color), 1.0),
    "diamond": (lambda color: Dielectric.named("diamond", transmittance=color), 1.0),
    "plastic": (lambda color: Principled(color, roughness=0.25), (0.55, 0.55, 0.55)),
    "rubber": (lambda color: Principled(color, roughness=0.75, specular=0.7), (0.03, 0.03, 0.03)),
    "car paint": (
        lambda color: Principled(color, metallic=0.4, roughness=0.4, clearcoat=1),
        (0.5, 0.02, 0.02),
    ),
    "porcelain": (lambda color: Principled(color, roughness=0.05), (0.8, 0.78, 0.74)),
    "velvet": (lambda color: Principled(color, roughness=1, sheen=1, sheen_color=color), (0.3, 0.02, 0.06)),
    "clay": (lambda color: OrenNayar(color, 0.4), (0.46, 0.2, 0.12)),
    "plaster": (lambda color: OrenNayar(color, 0.3), (0.8, 0.8, 0.8)),
    "matte": (Diffuse, 0.5),
}
NAMED_MATERIALS = (*_FIXED, *_COLORED)


def named_bsdf(title: str, name: str, color: Color | None) -> tuple[str, Bsdf]:
    """Return the name of a material as it is in the table, and its BSDF.

    Raises
    ------
    SceneError
        If the name, called `title` in the message, is unknown, or the material takes no color.
    """
    key = " ".join(text(title, name).lower().replace("_", " ").replace("-", " ").split())
    key = SPELLINGS.get(key, key)
    if key not in NAMED_MATERIALS and color is None:
        key, color = _with_color(key)
    one_of(title, key, NAMED_MATERIALS)
    if key in _COLORED:
        make, usual = _COLORED[key]
        return key, make(usual if color is None else color)
    if color is not None:
        colored = ", ".join(_COLORED)
        raise SceneError(f"{title} is {name!r}, whose color is its own; those with a color are {colored}")
    return key, _FIXED[key]()


def _with_color(key: str) -> tuple[str, str | None]:
    """Return the name of a material and its color, from a color, which is "matte", or "red plastic"."""
    if is_color_name(key):
        return "matte", key
    for material in NAMED_MATERIALS:
        color = key.removesuffix(f" {material}")
        if color != key and is_color_name(color):
            return material, color
    return key, None
