"""What a file says of a surface, in the words of `Principled`, and the material that comes nearest."""

from __future__ import annotations

import inspect
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import bsdfs
from ..bsdfs import Bsdf, Dielectric, Diffuse, Mirror
from ..textures import Texture

SMOOTH = 0.05  # a metal less rough than this is taken for a mirror when nothing better is there


@dataclass
class Look:
    """What a surface looks like."""

    material: Bsdf
    emission: NDArray[np.float64] | None = None  # (3,) radiance
    lost: list[str] = field(default_factory=list)  # what the file asks for in vain


def realise(wanted: dict[str, Any]) -> tuple[Bsdf, list[str]]:
    """Return a material, and the names of the parameters that it cannot have.

    Parameters
    ----------
    wanted
        Parameters of `Principled` by name, as far as they are not neutral; `base_color` is always
        there. Values are numbers, colours or textures.
    """
    principled = getattr(bsdfs, "Principled", None)
    if principled is None:
        return _plain(wanted)
    known = inspect.signature(principled).parameters
    taken = {name: value for name, value in wanted.items() if name in known}
    return principled(**taken), [name for name in wanted if name not in known]


def _plain(wanted: dict[str, Any]) -> tuple[Bsdf, list[str]]:
    """Choose among the simple materials."""
    base = wanted["base_color"]
    if _number(wanted, "transmission", 0.0) > 0.5:
        material: Bsdf = Dielectric(
            wanted.get("ior", 1.5),
            wanted.get("roughness", 0.0),
            transmittance=base,
            absorption=wanted.get("absorption", 0.0),
        )
        return material, _others(wanted, "base_color", "transmission", "ior", "roughness", "absorption")
    if _number(wanted, "metallic", 0.0) > 0.5 and _number(wanted, "roughness", 1.0) < SMOOTH:
        return Mirror(base), _others(wanted, "base_color", "metallic", "roughness")
    return Diffuse(base), _others(wanted, "base_color")


def _number(wanted: dict[str, Any], name: str, default: float) -> float:
    value = wanted.get(name, default)
    return float(value.mean()) if isinstance(value, Texture) else float(value)


def _others(wanted: dict[str, Any], *used: str) -> list[str]:
    return [name for name in wanted if name not in used]


def emission(
    factor: NDArray[np.float64], texture: Texture | None
) -> tuple[NDArray[np.float64] | None, list[str]]:
    """Return the radiance (3,) of a surface, and what is lost: meshes emit evenly, an image is averaged."""
    if not factor.any():
        return None, []
    if texture is None:
        return factor, []
    return factor * texture.mean().astype(np.float64), ["emission texture (its mean is used)"]
