"""BOP's layout (benchmark for 6D object pose estimation), scene by scene.

Source: https://github.com/thodan/bop_toolkit/blob/master/docs/bop_datasets_format.md. Lengths are in
millimeters, and pixels have their centers at whole numbers, as in OpenCV.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Doubles, Floats
from ..camera import Camera, Perspective
from ..core.errors import SceneError
from ..core.files import make_folder, write_bytes, write_json
from ..shapes import Shape
from .annotated import AnnotatedObject
from .masks import Mask, mask_box, touches_edge
from .models import write_models
from .view import DatasetView, pinhole

SCENE = "train/000000"
FOLDERS = ("rgb", "depth", "mask", "mask_visib")
FINEST = 0.1  # mm, of the codes of depth where the picture is not too deep for it
MOST = np.iinfo(np.uint16).max
NO_BOX = [-1, -1, -1, -1]


class BopLayout:
    """`camera.json`, `models/`, and `train/000000/` with pictures, depth, masks, cameras and poses.

    Parameters
    ----------
    folder, shapes, objects, millimeters
        As for `write_models`.
    depth_scale
        Millimeters of a code of depth; None for 0.1, or in deep pictures for more.
    """

    def __init__(
        self,
        folder: Path,
        shapes: Sequence[Shape],
        objects: Mapping[int, AnnotatedObject],
        millimeters: float,
        depth_scale: float | None,
    ) -> None:
        self._root, self._folder = folder, folder / SCENE
        self._shapes, self._objects = shapes, objects
        self._millimeters = millimeters
        self._depth_scale = depth_scale

    def check(self, name: str, camera: Camera) -> None:
        """Check that a camera can be described.

        Raises
        ------
        SceneError
            If it has a distortion, or is a fisheye camera.
        """
        lens = camera.projection
        if not isinstance(lens, Perspective):
            raise SceneError(f"{name} has a lens {lens!r}; BOP's cameras are perspective ones")
        if lens.distortion is not None:
            raise SceneError(f"{name} has a lens {lens.distortion!r}; BOP's cameras have no distortion")

    def write_view(self, view: DatasetView) -> Any:
        """Write the picture, the depth and the masks of a view, and return its annotations."""
        for name in FOLDERS:
            make_folder(self._folder / name)
        view.write_colors(str(self._folder / "rgb" / f"{view.name}.png"))
        depth, scale = self._depth_codes(view.image.depth)
        self._write_png(f"depth/{view.name}", depth)
        poses: list[dict[str, Any]] = []
        infos: dict[int, dict[str, Any]] = {}
        cut = set()
        for number, whole in view.silhouettes(None):
            if number not in view.objects:
                continue
            mask_name = f"{view.name}_{len(poses):06d}"
            seen = view.image.shape_id == number
            self._write_png(f"mask/{mask_name}", whole)
            self._write_png(f"mask_visib/{mask_name}", seen)
            poses.append(self._pose(view.camera, view.objects[number]))
            infos[number] = _info(whole, seen, depth)
            if touches_edge(whole):
                cut.add(number)
        if cut:
            for number, mask in _wide_silhouettes(view):
                if number in cut:
                    _widen(infos[number], mask, view.camera)
        return {
            "size": list(view.camera.size),
            "camera": self._camera(view.camera, scale),
            "gt": poses,
            "gt_info": list(infos.values()),
        }

    def write_index(self, views: Mapping[int, Any]) -> None:
        """Write models, cameras and annotations; `camera.json` has the camera of the first view."""
        write_models(self._root, self._shapes, self._objects, self._millimeters)
        first = views[min(views)]
        width, height = first["size"]
        fx, _, cx, _, fy, cy, *_ = first["camera"]["cam_K"]
        scale = first["camera"]["depth_scale"]
        about = {"width": width, "height": height, "fx": fx, "fy": fy, "cx": cx, "cy": cy}
        write_json(self._root / "camera.json", {**about, "depth_scale": scale})
        for key in ("camera", "gt", "gt_info"):
            write_json(
                self._folder / f"scene_{key}.json", {str(number): view[key] for number, view in views.items()}
            )

    def _depth_codes(self, depth: Floats) -> tuple[NDArray[np.uint16], float]:
        """Return depth as codes (height, width), 0 where there is nothing, and the millimeters of a code."""
        lengths = np.nan_to_num(depth.astype(np.float64) * self._millimeters, nan=0.0)
        deepest = float(lengths.max())
        scale = max(FINEST, deepest / MOST) if self._depth_scale is None else self._depth_scale
        codes = np.rint(lengths / scale)
        if codes.max() > MOST:
            raise SceneError(
                f"depth_scale is {scale:g} mm; the picture is {deepest:g} mm deep, and 16 bits hold "
                f"{MOST * scale:g} mm: it must be at least {deepest / MOST:.3g}"
            )
        return codes.astype(np.uint16), scale

    def _camera(self, camera: Camera, depth_scale: float) -> dict[str, Any]:
        world = camera.extrinsics()
        return {
            "cam_K": pinhole(camera).intrinsics("integer").ravel().tolist(),
            "depth_scale": depth_scale,
            "cam_R_w2c": world[:3, :3].ravel().tolist(),
            "cam_t_w2c": self._translation(world),
        }

    def _pose(self, camera: Camera, obj: AnnotatedObject) -> dict[str, Any]:
        model = camera.extrinsics() @ obj.pose
        return {
            "obj_id": obj.model,
            "cam_R_m2c": model[:3, :3].ravel().tolist(),
            "cam_t_m2c": self._translation(model),
        }

    def _translation(self, matrix: Doubles) -> list[float]:
        millimeters: list[float] = (matrix[:3, 3] * self._millimeters).tolist()
        return millimeters

    def _write_png(self, name: str, pixels: NDArray[Any]) -> None:
        """Write a gray png: codes of uint16, or a mask as 0 and 255."""
        import imageio.v3 as iio

        codes = pixels if pixels.dtype == np.uint16 else pixels.astype(np.uint8) * np.uint8(255)
        buffer = BytesIO()
        iio.imwrite(buffer, codes, extension=".png", plugin="pillow")
        write_bytes(self._folder / f"{name}.png", buffer.getvalue())


def _info(whole: Mask, seen: Mask, depth: NDArray[np.uint16]) -> dict[str, Any]:
    """Return the boxes and pixel counts of an object, from its silhouette and the part of it that is seen."""
    count, visible = int(whole.sum()), int(seen.sum())
    return {
        "bbox_obj": mask_box(whole) if visible else NO_BOX,
        "bbox_visib": mask_box(seen) or NO_BOX,
        "px_count_all": count,
        "px_count_valid": int(np.count_nonzero(depth[whole])),
        "px_count_visib": visible,
        "visib_fract": visible / count,
    }


def _wide_silhouettes(view: DatasetView) -> Iterator[tuple[int, Mask]]:
    """Yield the silhouettes of shapes in a picture that is three times as wide and high.

    So far BOP's tools look for what an edge has cut off.
    """
    width, height = view.camera.size
    near = pinhole(view.camera)
    k = near.intrinsics()
    k[:2, 2] += width, height
    wide = Camera.from_intrinsics(k, near.extrinsics(), size=(3 * width, 3 * height))
    return view.silhouettes(wide)


def _widen(info: dict[str, Any], mask: Mask, camera: Camera) -> None:
    """Replace the silhouette of an object by the wide one."""
    box = mask_box(mask)
    assert box is not None  # it contains the pixels in the picture
    width, height = camera.size
    info["px_count_all"] = int(mask.sum())
    info["visib_fract"] = info["px_count_visib"] / info["px_count_all"]
    if info["px_count_visib"]:
        info["bbox_obj"] = [box[0] - width, box[1] - height, *box[2:]]
