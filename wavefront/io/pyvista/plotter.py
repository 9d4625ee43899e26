"""Plotters of PyVista: the camera, and the actors as they are shown."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...bsdfs import Diffuse, Principled
from ...camera import Camera
from ...colors import srgb
from ...colors.maps import ColorMap
from ...core.errors import SceneError
from ...materials import Material
from ...scene import Scene
from ...shapes import Edges, Mesh, Points, Shape
from ...shapes.scalars import Coloring
from ...textures.image import Texture
from ..foreign import LINE
from ..losses import Losses
from .objects import NAME, Look, shapes_of

STYLES = {"wireframe": "edges", "points": "points"}


def from_plotter(plotter: Any, smooth: bool | float | str) -> Scene:
    """Return the scene of a plotter: the shapes that it shows, and its camera.

    Raises
    ------
    SceneError
        If it shows nothing that can be rendered.
    """
    shapes: list[Shape] = []
    with Losses(NAME) as losses:
        for name, actor in plotter.renderer.actors.items():
            if actor.GetVisibility():
                shapes += _shapes(str(name), actor, smooth, losses)
        if not shapes:
            raise SceneError("the plotter shows no dataset")
        return Scene(shapes, camera=camera_of(plotter))


def camera_of(plotter: Any) -> Camera:
    """Return the camera of a plotter, with the size of its window."""
    camera, (width, height) = plotter.camera, plotter.window_size
    size = int(width), int(height)
    place, middle = (camera.position, camera.focal_point, camera.up), np.array(camera.GetWindowCenter())
    if camera.parallel_projection:
        view = Camera.orthographic(*place, height=2 * camera.parallel_scale, size=size)
        moved = middle * camera.parallel_scale * (width / height, 1)
        return view.replace(origin=view.origin + view.rotation[:, :2] @ moved)
    angle = math.radians(camera.view_angle)
    if camera.GetUseHorizontalViewAngle():
        angle = 2 * math.atan(math.tan(angle / 2) * size[1] / size[0])
    return Camera.look_at(*place, math.degrees(angle), size=size, shift=(middle[0] / 2, middle[1] / 2))


def _shapes(name: str, actor: Any, smooth: bool | float | str, losses: Losses) -> list[Shape]:
    """Return the shapes of an actor, where it is."""
    mapper, prop = getattr(actor, "mapper", None), getattr(actor, "prop", None)
    data = getattr(mapper, "dataset", None)
    if data is None or prop is None:
        return []  # texts, axes and scalar bars
    if not hasattr(prop, "style"):
        losses.note("volume", name, done="left out; wf.load_grid and wf.GridBox show volumes")
        return []
    shapes = shapes_of(data, smooth, _look(actor, mapper, prop))
    style = STYLES.get(str(prop.style).lower())
    if prop.show_edges and style is None:
        losses.note("edges", name)
    placed = [_styled(shape, style) for shape in shapes]
    matrix = _matrix(actor)
    if (matrix != np.eye(4)).any():
        placed = [shape.transformed(matrix) for shape in placed]
    for shape in placed:
        shape.name = NAME if "(Addr=" in name else name
    return placed


def _matrix(actor: Any) -> Any:
    matrix = actor.GetMatrix()
    return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])


def _styled(shape: Shape, style: str | None) -> Shape:
    """Return a mesh as its edges or vertices, where an actor shows only these."""
    if style is None or not isinstance(shape, Mesh):
        return shape
    radius = LINE * float(np.linalg.norm(np.ptp(shape.vertices, axis=0))) or 1.0
    if style == "edges":
        return Edges(shape, radius, material=shape.material if shape.has_material else None)
    return Points(shape.vertices, 2 * radius, shape.colors)


def _look(actor: Any, mapper: Any, prop: Any) -> Look:
    """Return how an actor shows its dataset."""
    opacity = float(prop.opacity)
    material = _material(actor, prop, opacity)
    name = getattr(mapper, "array_name", None)
    if not mapper.scalar_visibility:
        return Look(plain=True, material=material)
    coloring = Coloring(name) if name else None
    table = getattr(mapper, "lookup_table", None)
    if coloring is None or table is None or str(mapper.color_mode) == "direct":
        return Look(coloring, material=material, opacity=opacity, rgb=True)
    codes = np.asarray(table.values, np.uint8)
    no_number = tuple(round(255 * component) for component in table.GetNanColor())
    low, high = (float(limit) for limit in mapper.scalar_range)
    return Look(
        coloring,
        ColorMap(codes, (low, high), no_number, bool(table.log_scale)),
        material=material,
        opacity=opacity,
    )


def _material(actor: Any, prop: Any, opacity: float) -> Material:
    """Return the material of an actor without scalars."""
    texture = getattr(actor, "texture", None)
    color: Any = srgb(*(float(component) for component in prop.color.float_rgb))
    if texture is not None and hasattr(texture, "to_array"):
        color = Texture(np.asarray(texture.to_array(), np.uint8)[..., :3])
    alpha = None if opacity == 1 else opacity
    if str(prop.interpolation).lower().endswith("pbr") or "physically" in str(prop.interpolation).lower():
        bsdf = Principled(color, metallic=float(prop.metallic), roughness=float(prop.roughness))
        return Material(bsdf, alpha=alpha)
    return Material(Diffuse(color), alpha=alpha)
