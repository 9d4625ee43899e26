"""Objects in a picture: boxes of the visible part of each shape and of all of it, and its silhouette.

The rays of the geometric AOVs go on behind each surface, so one pass finds all shapes that each pixel's
center covers, whatever hides them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..arrays.vec import Bools, Ints
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..stages.generate import center_rays
from ..stages.interaction import interaction
from ..stages.passing import covering_hits
from ..stages.transmittance import continue_behind
from .geometric import ShapeTable, pixel_spans


def object_boxes(scene: CompiledScene, camera: Camera, shapes: ShapeTable) -> list[dict[str, Any]]:
    """Return the boxes of all shapes of which the picture would show anything without the others.

    Parameters
    ----------
    scene, camera, shapes
        As for `geometric_aovs`.

    Returns
    -------
    Dictionaries in the order of the shapes, with the keys "shape" (the id), "name", "visible" and "amodal":
    boxes [x0, y0, x1, y1] of columns x0 to x1 - 1 and rows y0 to y1 - 1, None where nothing is seen, and
    "visible_fraction": of the pixels that the whole shape covers.
    """
    width, height = camera.size
    view = scene.view(camera)
    visible, amodal = _Extents(len(shapes.shapes)), _Extents(len(shapes.shapes))
    for _, pixel in pixel_spans(width * height):
        nearest, all_met = _shapes_met(scene, view, pixel.astype(np.int64))
        for extents, (shape, at) in ((visible, nearest), (amodal, all_met)):
            extents.add(shape, at % width, at // width)
    return [
        {
            "shape": number,
            "name": shapes.shapes[number].name,
            "visible": visible.box(number),
            "amodal": amodal.box(number),
            "visible_fraction": float(visible.count[number] / amodal.count[number]),
        }
        for number in np.flatnonzero(amodal.count).tolist()
    ]


def silhouettes(scene: CompiledScene, camera: Camera) -> Iterator[tuple[int, Bools]]:
    """Yield the id of each shape and the pixels (height, width) that it would cover if it were alone.

    Shapes that would cover none are left out.

    Parameters
    ----------
    scene, camera
        As for `geometric_aovs`.
    """
    width, height = camera.size
    view = scene.view(camera)
    spans = [_shapes_met(scene, view, pixel.astype(np.int64))[1] for _, pixel in pixel_spans(width * height)]
    shape, at = (np.concatenate(column) for column in zip(*spans, strict=True))
    order = np.argsort(shape, kind="stable")
    numbers, first = np.unique(shape.take(order), return_index=True)
    for number, pixels in zip(numbers.tolist(), np.split(at.take(order), first[1:]), strict=False):
        mask = np.zeros(width * height, bool)
        mask[pixels] = True
        yield number, mask.reshape(height, width)


def _shapes_met(
    scene: CompiledScene, view: Camera, pixel: Ints
) -> tuple[tuple[Ints, Ints], tuple[Ints, Ints]]:
    """Return the shapes and pixels of nearest hits, and all distinct pairs of both."""
    rays = center_rays(scene, view, pixel.astype(np.uint32))
    surfaces: list[tuple[Ints, Ints]] = []
    while len(rays):
        rays, hits = covering_hits(scene, rays)
        met = hits.found
        rays, hits, pixel = rays.take(met), hits.take(met), pixel.take(met)
        surfaces.append((scene.shape_numbers.of(hits), pixel))
        if met.size:
            rays = continue_behind(rays, interaction(scene, rays, hits))
    shape, at = (np.concatenate(column) for column in zip(*surfaces, strict=True))
    order = np.lexsort((shape, at))
    shape, at = shape.take(order), at.take(order)
    new = np.append(True, (np.diff(shape) != 0) | (np.diff(at) != 0))[: shape.size]
    return surfaces[0], (shape.compress(new), at.compress(new))


class _Extents:
    """The boxes and sizes of sets of pixels, one for each of `count` shapes."""

    def __init__(self, count: int) -> None:
        self.count = np.zeros(count, np.int64)
        self._low = np.full((2, count), np.iinfo(np.int64).max)
        self._high = np.full((2, count), -1)

    def add(self, shape: Ints, column: Ints, row: Ints) -> None:
        """Add a pixel of each of some shapes, (n,)."""
        np.add.at(self.count, shape, 1)
        for axis, place in enumerate((column, row)):
            np.minimum.at(self._low[axis], shape, place)
            np.maximum.at(self._high[axis], shape, place)

    def box(self, shape: int) -> list[int] | None:
        """Return the box of a shape; None if it has no pixel."""
        if not self.count[shape]:
            return None
        return [*self._low[:, shape].tolist(), *(self._high[:, shape] + 1).tolist()]
