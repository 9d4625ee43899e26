"""COCO's layout: pictures, and one file of annotations.

Source: https://cocodataset.org/#format-data.
Segmentations are uncompressed run lengths of the visible pixels.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..camera import Camera
from ..core.files import make_folder, write_json
from ..version import VERSION
from .annotated import AnnotatedObject
from .masks import mask_box, run_lengths
from .view import DatasetView, view_name

IMAGES = "images"


class CocoLayout:
    """`images/` and `annotations.json`.

    Parameters
    ----------
    folder
        Of the data set.
    objects
        The shapes that are annotated.
    """

    def __init__(self, folder: Path, objects: Mapping[int, AnnotatedObject]) -> None:
        self._folder = folder
        self._objects = objects

    def check(self, name: str, camera: Camera) -> None:
        """Check that a camera can be described: any can."""

    def write_view(self, view: DatasetView) -> Any:
        """Write the picture of a view, and return its annotations."""
        make_folder(self._folder / IMAGES)
        view.write_colors(str(self._folder / IMAGES / f"{view.name}.png"))
        height, width = view.image.shape[:2]
        annotations = []
        for number, obj in view.objects.items():
            mask = view.image.shape_id == number
            box = mask_box(mask)
            if box is not None:
                annotations.append(
                    {
                        "category_id": obj.category,
                        "bbox": box,
                        "area": int(mask.sum()),
                        "segmentation": {"size": [height, width], "counts": run_lengths(mask)},
                        "iscrowd": 0,
                        "shape_id": number,
                    }
                )
        return {"size": [width, height], "annotations": annotations}

    def write_index(self, views: Mapping[int, Any]) -> None:
        """Write the annotations of all views."""
        annotations: list[dict[str, Any]] = []
        for number, view in views.items():
            for annotation in view["annotations"]:  # ids from 1 on: readers take an annotation 0 for none
                annotations.append({"id": len(annotations) + 1, "image_id": number, **annotation})
        categories = {obj.category: obj.name for obj in self._objects.values()}
        write_json(
            self._folder / "annotations.json",
            {
                "info": {"description": f"rendered by wavefront {VERSION}"},
                "licenses": [],
                "images": [
                    {
                        "id": number,
                        "file_name": f"{view_name(number)}.png",
                        "width": view["size"][0],
                        "height": view["size"][1],
                    }
                    for number, view in views.items()
                ],
                "annotations": annotations,
                "categories": [
                    {"id": number, "name": name, "supercategory": "object"}
                    for number, name in sorted(categories.items())
                ],
            },
        )
