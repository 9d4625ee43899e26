"""Files of optical flow: Middlebury's .flo, and the png files of KITTI.

Sources: D. Scharstein, "Flow file format" (https://vision.middlebury.edu/flow/code/flow-code/README.txt);
M. Menze and A. Geiger, "Object Scene Flow for Autonomous Vehicles", CVPR 2015, and its development kit.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Bools, Floats
from ..core.errors import SaveError
from ..core.files import write_bytes
from .png_jpeg import png_of_codes

MAGIC = b"PIEH"  # 202021.25 as float32
UNKNOWN = np.float32(1666666752)  # as in Middlebury's own files; above 1e9 is unknown
STEPS, ZERO = 64.0, 2**15  # codes of a pixel, and the code of 0
MOST_CODE = 2**16 - 1


def flo_file(flow: Floats, valid: Bools) -> bytes:
    """Return a .flo file of a flow (H, W, 2), pixels, where it is valid (H, W)."""
    height, width = valid.shape
    values = np.where(valid[..., None], flow, UNKNOWN).astype("<f4")
    return MAGIC + np.array([width, height], "<i4").tobytes() + values.tobytes()


def kitti_file(flow: Floats, valid: Bools) -> bytes:
    """Return a png of 16 bits: red and green are the flow in steps of 1/64 pixel, blue is where it is known.

    Where the flow is 512 pixels or more it is not valid.
    """
    codes = np.rint(np.where(valid[..., None], flow, 0).astype(np.float64) * STEPS) + ZERO
    valid = valid & ((codes > 0) & (codes <= MOST_CODE)).all(2)
    seen = np.where(valid[..., None], codes, 0)
    return png_of_codes(np.concatenate([seen, valid[..., None]], 2).astype(np.uint16))


WRITERS: dict[str, Callable[[Any, Any], bytes]] = {".flo": flo_file, ".png": kitti_file}


def write_flow(path: str | os.PathLike[str], flow: Floats, valid: NDArray[np.bool_]) -> None:
    """Write a flow (H, W, 2), pixels, where it is valid (H, W), by the extension of the file.

    Raises
    ------
    SaveError
        If the extension is another one, or the file cannot be written.
    """
    extension = Path(path).suffix.lower()
    if extension not in WRITERS:
        raise SaveError(f"{os.fspath(path)}: flow is written as {' or '.join(WRITERS)}, not as {extension!r}")
    write_bytes(path, WRITERS[extension](flow, valid))
