"""One view of a data set, as formats get it, and its camera's matrices."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, TypeAlias

import numpy as np

from ..arrays.soa import soa
from ..camera import Camera, Fisheye, Perspective, Projection
from ..codecs.display import Display
from ..image import Image
from .annotated import AnnotatedObject
from .masks import Mask

# called with a camera, yields the ids and silhouettes of shapes; None is the view's own camera
Silhouettes: TypeAlias = Callable[[Camera | None], Iterator[tuple[int, Mask]]]
NEAREST = 1e-5  # of the near clipping plane, in depths of the far one


@soa
class DatasetView:
    """A rendered view."""

    number: int
    camera: Camera
    image: Image  # with the layers depth, normal and shape_id
    objects: dict[int, AnnotatedObject]  # by the number of the shape
    display: Display
    silhouettes: Silhouettes
    frame: int = 0  # its place among the times of its camera
    frames: int = 1  # how many of them there are

    @property
    def name(self) -> str:
        """The name of its files, without extension."""
        return view_name(self.number)

    def write_colors(self, path: str) -> None:
        """Write the colors as they are shown."""
        how = self.display
        self.image.save(path, how.gamma, how.exposure, how.tone, how.white_balance)


def view_name(number: int) -> str:
    """Return the name of the files of a view, without extension."""
    return f"{number:06d}"


def pinhole(camera: Camera) -> Camera:
    """Return a camera without lens or distortion, whose whole picture is the window of `camera`.

    Raises
    ------
    SceneError
        If the camera is no perspective one.
    """
    k = camera.intrinsics()
    k[:2, 2] -= camera.window[:2]
    return Camera.from_intrinsics(k, camera.extrinsics(), size=camera.size)


def camera_matrices(camera: Camera, farthest: float) -> dict[str, Any]:
    """Return the matrices of a view as values of JSON, row by row.

    Parameters
    ----------
    camera
        The camera of the view.
    farthest
        A depth that is greater than that of all points, scene units.
    """
    k = camera.intrinsics("integer")
    k[:2, 2] -= camera.window[:2]
    return {
        "size": list(camera.size),
        **({"rolling_shutter": camera.rolling_shutter} if camera.rolling_shutter else {}),
        "opencv": {
            "K": k.tolist(),
            "world_to_camera": camera.extrinsics().tolist(),
            "camera_to_world": camera.to_matrix("opencv").tolist(),
            **_distortion(camera.projection),
        },
        "opengl": {
            "camera_to_world": camera.to_matrix("opengl").tolist(),
            "world_to_camera": np.linalg.inv(camera.to_matrix("opengl")).tolist(),
            **_clip(camera, farthest),
        },
    }


def _distortion(lens: Projection) -> dict[str, Any]:
    """Return the entries of a record about a lens, other than K."""
    if isinstance(lens, Fisheye):
        numbers = [0.0] * 4 if lens.distortion is None else lens.distortion.tolist()
        return {"model": "fisheye", "mapping": lens.mapping, "distortion": numbers}
    known = lens.distortion if isinstance(lens, Perspective) else None
    return {"distortion": [0.0] * 8 if known is None else np.asarray(known.coefficients).tolist()}


def _clip(camera: Camera, farthest: float) -> dict[str, Any]:
    """Return OpenGL's projection to clip space, which only perspective cameras have."""
    if not isinstance(camera.projection, Perspective):
        return {}
    near = farthest * NEAREST
    matrix = pinhole(camera).projection_matrix(near, farthest)
    return {"projection": matrix.tolist(), "near": near, "far": farthest}
