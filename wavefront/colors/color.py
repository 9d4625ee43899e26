"""Colors of any spelling as linear RGB."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays.vec import Floats, f4
from ..core.errors import SceneError, as_array, exact, finite_array, in_brief
from .names import CSS_COLORS
from .transfer import srgb_to_linear

HEX = frozenset("0123456789abcdef")
MOST_HINTS = 3  # names that an error suggests
CODES = (np.dtype(np.uint8), np.dtype(np.uint16))


def is_color_name(text: str) -> bool:
    """Return whether a text is the name of a color, or begins as one of hexadecimal digits does."""
    return text.startswith("#") or _plain(text) in CSS_COLORS


def named_color(name: str, text: str) -> Floats:
    """Return the linear color (3,) of a CSS name, "#rgb" or "#rrggbb", which are sRGB.

    Raises
    ------
    SceneError
        If it is none, with the nearest names.
    """
    word = _plain(text)
    digits = word[1:] if word.startswith("#") else CSS_COLORS.get(word, "")
    if len(digits) == 3:
        digits = "".join(2 * digit for digit in digits)
    if len(digits) != 6 or not HEX.issuperset(digits):
        near = [repr(color_name) for color_name in get_close_matches(word, CSS_COLORS, MOST_HINTS)]
        hint = f"; the nearest names are {', '.join(near)}" if near else ""
        raise SceneError(
            f"{name} is {in_brief(text)}, which is no color; "
            f'it must be a CSS name such as "red", "#rgb" or "#rrggbb"{hint}'
        )
    return srgb_to_linear(np.frombuffer(bytes.fromhex(digits), np.uint8) / f4(255))


def rgb(
    name: str, value: ArrayLike, high: float = np.inf, dtype: type[np.floating] = np.float32
) -> NDArray[Any]:
    """Return a linear color as a (3, 1) column, of float32 unless another type is given.

    A number means gray. A text is a CSS name, "#rgb" or "#rrggbb": these are sRGB, and are decoded.

    Raises
    ------
    SceneError
        If it is not one or three finite numbers in [0, `high`], exceeds the type, or is an unknown name.
    """
    if isinstance(value, str):
        return named_color(name, value).astype(dtype).reshape(3, 1)
    value = as_array(name, value)
    scalar = np.ndim(value) == 0
    if np.shape(value) == (3, 1):  # as stored
        value = np.ravel(value)
    array = finite_array(name, value, () if scalar else (3,))
    largest = float(np.finfo(dtype).max)
    bad = np.flatnonzero(~((array >= 0) & (array <= min(high, largest))))
    if len(bad):
        where = "" if scalar else f"[{bad[0]}]"
        limit = f"in [0, {high:g}]"
        if np.isinf(high):
            limit = "at least 0" if array.flat[bad[0]] < 0 else f"at most {largest:.3g}"
        raise SceneError(f"{name}{where} is {exact(array.flat[bad[0]])}; it must be {limit}")
    return np.broadcast_to(array.astype(dtype).reshape(-1, 1), (3, 1)).copy()


def srgb(*color: Any) -> Floats:
    """Return the linear values of colors that are given in sRGB, as most programs and colormaps give them.

    Parameters
    ----------
    color
        Three numbers in [0, 1]; or one array (..., 3), or (..., 4) with opacity, which is not decoded:
        floats in [0, 1], or uint8 or uint16 codes; or the name of a color, or a list of names: CSS names,
        "#rgb" or "#rrggbb".

    Returns
    -------
    ndarray
        Linear float32 of the same shape; (3,) for three numbers or a name.

    Raises
    ------
    SceneError
        If a value is out of range or a name unknown.

    Notes
    -----
    All colors of this package are linear: twice the value is twice the light. A name or a uint8 array is
    decoded wherever a color is taken; floats are taken as linear, so those of a colormap need this function.

    Examples
    --------
    >>> wf.srgb(1.0, 0.5, 0.0).round(3).tolist()
    [1.0, 0.21400000154972076, 0.0]
    >>> orange = wf.Diffuse(wf.srgb(1.0, 0.5, 0.0))
    >>> import matplotlib
    >>> points = np.random.default_rng(1).random((100, 3))
    >>> cloud = wf.Points(points, 0.02, colors=wf.srgb(matplotlib.colormaps["viridis"](points[:, 2])))
    """
    value = color[0] if len(color) == 1 else color
    if isinstance(value, str):
        return named_color("srgb color", value)
    if len(color) not in (1, 3, 4):
        raise SceneError(f"srgb takes three numbers or one array, got {len(color)} values")
    names = named_rows("srgb color", value)
    if names is not None:
        return names
    raw = as_array("srgb color", value)
    array = finite_array("srgb color", raw, (None,) * raw.ndim)
    if array.ndim == 0:
        array = np.broadcast_to(array, 3)
    if array.shape[-1] not in (3, 4):
        raise SceneError(f"srgb color must have shape (..., 3) or (..., 4), got {array.shape}")
    values = array.astype(f4)
    if raw.dtype in CODES:
        values /= f4(np.iinfo(raw.dtype).max)
    bad = np.argwhere(~((values >= 0) & (values <= 1)))
    if len(bad):
        where = "".join(f"[{i}]" for i in bad[0])
        hint = ". Values from 0 to 255 are passed as a uint8 array, or divided by 255"
        value = values[tuple(bad[0])]
        more = hint if 1 < value <= 255 else ""
        raise SceneError(f"srgb color{where} is {exact(value)}; it must be in [0, 1]{more}")
    values[..., :3] = srgb_to_linear(values[..., :3])
    return values


def named_rows(name: str, value: Any) -> Floats | None:
    """Return the linear colors (n, 3) of a list of names of colors; None if it is something else."""
    if isinstance(value, np.ndarray) and value.dtype.kind != "U":
        return None
    if not isinstance(value, list | tuple | np.ndarray) or not len(value):
        return None
    if not all(isinstance(color_name, str) for color_name in value):
        return None
    return np.stack([named_color(f"{name}[{i}]", color_name) for i, color_name in enumerate(value)])


def _plain(text: str) -> str:
    return text.strip().lower().replace(" ", "")
