"""The content of files of pictures: arrays by name, and the rest as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Floats
from ..core.errors import SceneError
from ..core.files import check_size

TRANSPARENT = "transparent"  # the background in the metadata of a picture with an alpha channel
ERROR = "error."  # before the name of a layer: its standard error


@dataclass(frozen=True, slots=True)
class ImageData:
    """A picture as files hold it."""

    rgb: Floats  # (H, W, 3) linear, premultiplied by alpha
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)  # (H, W, ...) all others, by name
    info: Mapping[str, Any] = field(default_factory=dict)  # spp, metadata, names: values of JSON
    sums: Mapping[str, NDArray[Any]] = field(default_factory=dict)  # of the samples, by name, for merging

    @property
    def metadata(self) -> Mapping[str, Any]:
        """Settings and results of the render."""
        metadata: Mapping[str, Any] = self.info.get("metadata", {})
        return metadata

    @property
    def alpha(self) -> Floats | None:
        """Alpha (H, W) if the background is transparent, else None."""
        return self.arrays.get("alpha") if self.metadata.get("background") == TRANSPARENT else None

    def with_rgb(self, rgb: Floats) -> ImageData:
        """Return the picture with other colors, without the arrays that belong to the old ones."""
        alpha = self.alpha
        return ImageData(rgb, {} if alpha is None else {"alpha": alpha}, self.info)

    def named(self) -> dict[str, NDArray[Any]]:
        """Return all arrays by name, "rgb" first."""
        return {"rgb": self.rgb, **self.arrays}


def from_named(arrays: Mapping[str, NDArray[Any]], info: Mapping[str, Any]) -> ImageData:
    """Return the picture of arrays by name, as a file of unknown origin holds them.

    Raises
    ------
    SceneError
        If there is no rgb (H, W, 3), or an array has other rows and columns or is not numeric.
    """
    others = dict(arrays)
    rgb = others.pop("rgb", None)
    if rgb is None or rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.float32:
        fault = "is missing" if rgb is None else f"is {rgb.dtype} of shape {rgb.shape}"
        raise SceneError(f"the array 'rgb' {fault}; a picture has one of float32, (height, width, 3)")
    check_size(rgb.shape[0], rgb.shape[1])
    for name, values in others.items():
        if values.shape[:2] != rgb.shape[:2] or values.dtype.kind not in "fiub":
            raise SceneError(
                f"the array {name!r} is {values.dtype} of shape {values.shape}; "
                f"it must hold numbers of {rgb.shape[1]} × {rgb.shape[0]} pixels"
            )
    alpha = others.get("alpha")
    if alpha is not None and alpha.ndim != 2:
        raise SceneError(f"the array 'alpha' has shape {alpha.shape}; it must be (height, width)")
    return ImageData(rgb, others, info)


def to_json(info: Mapping[str, Any]) -> str:
    """Return values as JSON text, with NaN as Python's `json` writes it, and other objects as their text."""
    import json  # imported here to keep `import wavefront` quick

    return json.dumps(info, default=_plain)


def _plain(value: Any) -> Any:
    """Return a value as JSON can hold it: a list of the numbers of an array, or its text."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


def from_json(text: str) -> dict[str, Any]:
    """Return the values of `to_json`, checked for the types of spp, metadata and names.

    Raises
    ------
    SceneError
        If the text is not JSON, or holds values of other types.
    """
    import json

    try:
        info = json.loads(text)
        if not isinstance(info, dict) or not isinstance(info.get("metadata", {}), dict):
            raise TypeError("metadata are not an object")
        info["spp"] = int(info.get("spp", 0))
        names = {
            str(kind): {int(number): str(name) for number, name in table.items()}
            for kind, table in info.get("names", {}).items()
        }
    except (ValueError, TypeError, AttributeError, RecursionError, OverflowError) as error:
        raise SceneError(f"its metadata are damaged: {error}") from error
    return {**info, "names": names}
