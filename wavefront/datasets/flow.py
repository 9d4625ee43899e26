"""Layouts of data sets with optical flow, as `torchvision.datasets` reads them: KITTI's and Sintel's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..camera import Camera
from ..codecs.png_jpeg import png_of_codes
from ..core.errors import SceneError
from ..core.files import make_folder, write_bytes
from .view import DatasetView


class FlowLayout:
    """Base class of layouts with flow: each view but the last one of a camera has flow to the next one.

    Parameters
    ----------
    folder
        Of the data set.
    """

    root: str  # folder of the layout within that

    def __init__(self, folder: Path) -> None:
        self._folder = folder / self.root

    def check(self, name: str, camera: Camera) -> None:
        """Check that a camera can be described: any can."""

    def _path(self, *parts: str) -> Path:
        """Return the path of a file, in a folder that is there."""
        path = self._folder.joinpath(*parts)
        make_folder(path.parent)
        return path

    def write_view(self, view: DatasetView) -> Any:
        """Write the files of a view."""
        raise NotImplementedError

    def write_index(self, views: dict[int, Any]) -> None:
        """Write nothing: the names of the files say all."""


class KittiLayout(FlowLayout):
    """`KittiFlow/training/`: `image_2` with pairs of pictures, and `flow_occ` and `flow_noc`."""

    root = "KittiFlow/training"

    def write_view(self, view: DatasetView) -> Any:
        """Write the picture of a view as the first and second of pairs, and its flow."""
        if view.frame + 1 < view.frames:
            view.write_colors(str(self._path("image_2", f"{view.name}_10.png")))
            for name, hidden_too in (("flow_occ", True), ("flow_noc", False)):
                path = self._path(name, f"{view.name}_10.png")
                view.image.save_flow(path, hidden=hidden_too)
        if view.frame > 0:
            view.write_colors(str(self._path("image_2", f"{view.number - 1:06d}_11.png")))
        return None


class SintelLayout(FlowLayout):
    """`Sintel/training/`: a folder for each camera in `clean`, `final`, `flow`, `occlusions` and `invalid`.

    `clean` and `final` have the same pictures.
    """

    root = "Sintel/training"

    def write_view(self, view: DatasetView) -> Any:
        """Write the picture of a view, its flow as .flo, and masks of hidden and of unknown flow."""
        camera, name = f"camera_{view.number // view.frames:02d}", f"frame_{view.frame + 1:04d}"
        for folder in ("clean", "final"):
            view.write_colors(str(self._path(folder, camera, f"{name}.png")))
        if view.frame + 1 < view.frames:
            view.image.save_flow(self._path("flow", camera, f"{name}.flo"))
            occluded = view.image.flow_occluded
            for folder, mask in (("occlusions", occluded == 1), ("invalid", occluded == -1)):
                codes = np.repeat(mask[..., None].astype(np.uint8) * np.uint8(255), 3, 2)
                write_bytes(self._path(folder, camera, f"{name}.png"), png_of_codes(codes))
        return None


FLOW_LAYOUTS: dict[str, type[FlowLayout]] = {"kitti": KittiLayout, "sintel": SintelLayout}


def check_times(formats: list[str], times: list[float] | None) -> None:
    """Raise a SceneError if a format needs views at several times, and there are none."""
    for name in formats:
        if name in FLOW_LAYOUTS and (times is None or len(times) < 2):
            raise SceneError(
                f"format is {name!r}, which has flow from one time to the next; give at least two times"
            )
