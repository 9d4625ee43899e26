"""Shapes from elsewhere: point files, height fields, boxes, transforms, objects of PyVista and Open3D."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from significance import render

import wavefront as wf

GRID = np.stack([*np.meshgrid(np.arange(12.0), np.arange(10.0)), np.zeros((10, 12))], -1).reshape(-1, 3)
RADIUS = "become spheres of radius 0.5 "
MATRIX = np.array([[0, -2, 0, 1], [2, 0, 0, 0], [0, 0, 2, 3], [0, 0, 0, 1.0]])
STRETCH = np.diag([1, 2, 3, 1.0])
HALF = ((0.5 + 0.055) / 1.055) ** 2.4  # linear, of 0.5 in sRGB


def shapes() -> list[wf.Shape]:
    """One of each kind."""
    box = wf.Box((1, 0, 0), (1, 2, 3))
    return [
        box,
        wf.Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)),
        wf.Instance(box, STRETCH),
        wf.Sphere((1, 2, 3), 0.5),
        wf.Spheres(GRID, 0.2, colors=GRID / 12),
        wf.Cylinders(GRID[:3], GRID[3:6] + 1, 0.2),
        wf.Capsules(GRID[:3], GRID[3:6] + 1, 0.2),
    ]


def corners(shape: Any) -> Any:
    """Points of a shape that transforms move."""
    if isinstance(shape, wf.Instance):
        shape = shape.to_mesh()
    names = "vertices", "centers", "starts"
    return next(getattr(shape, name) for name in names if hasattr(shape, name))


@pytest.mark.parametrize("shape", shapes(), ids=lambda shape: type(shape).__name__)
def test_every_shape_is_placed_by_matrices(shape: Any) -> None:
    before = corners(shape).copy()
    moved = shape.transformed(MATRIX)
    assert type(moved) is type(shape)
    assert corners(moved) == pytest.approx(before @ MATRIX[:3, :3].T + MATRIX[:3, 3])
    assert corners(shape.translated((1, 2, 3))) == pytest.approx(before + np.array([1, 2, 3]))
    turned = before[:, [1, 0, 2]] * (-1, 1, 1)
    assert corners(shape.rotated("z", 90)) == pytest.approx(turned)
    assert corners(shape.rotated((0, 0, -3), -90)) == pytest.approx(turned)
    about = shape.rotated("z", 90, about=(1, 0, 5))
    assert corners(about) == pytest.approx(turned + np.array([1, -1, 0]))
    assert corners(shape.scaled(3)) == pytest.approx(before * 3)
    assert corners(shape.scaled(-2)) == pytest.approx(before * -2)
    assert (corners(shape) == before).all()
    assert shape.bounds.shape == moved.bounds.shape
    for bad, message in (
        (lambda: shape.scaled(0), "factor is 0; it must be other than 0"),
        (lambda: shape.scaled((1, 0, 1)), "none may be 0"),
        (lambda: shape.rotated("w", 3), "axis is 'w'; it must be one of x, y, z"),
        (lambda: shape.rotated((0, 0, 0), 3), "axis .* must not be zero"),
        (lambda: shape.translated((1, 2)), "offset must have shape"),
        (lambda: shape.transformed(np.eye(3)), "must have shape"),
        (lambda: shape.transformed(np.ones((4, 4))), "has the last row"),
    ):
        with pytest.raises(wf.SceneError, match=message):
            bad()


@pytest.mark.parametrize("shape", shapes(), ids=lambda shape: type(shape).__name__)
def test_stretched_shapes_are_meshes_or_an_error(shape: Any) -> None:
    """Three factors are for triangles alone; the radius of others scales with one."""
    if isinstance(shape, wf.Mesh | wf.Instance):
        assert corners(shape.scaled((1, 2, 3))) == pytest.approx(corners(shape) * (1, 2, 3))
    else:
        with pytest.raises(wf.SceneError, match="only meshes can be placed so"):
            shape.scaled((1, 2, 3))
        assert np.unique(shape.transformed(MATRIX).radii) == pytest.approx(2 * np.unique(shape.radii))


def test_normals_and_front_sides_follow() -> None:
    """Normals by the cofactors, and a mirrored box is seen from outside as before."""
    slope = wf.HeightField([[0, 1], [0, 1]], up="z")
    normals = slope.scaled((1, 1, 2)).normals
    assert normals / np.linalg.norm(normals, axis=1, keepdims=True) == pytest.approx(
        np.tile(np.array([-2, 0, 1]) / 5**0.5, (4, 1))
    )
    for box in (wf.Box((0, 0, 0), 1), wf.Box((0, 0, 0), 1).scaled((-1, 1, 1))):
        a, b, c = box.vertices[box.faces].transpose(1, 0, 2)
        assert (np.cross(b - a, c - a) * (a + b + c)).sum(1).min() > 0
        assert np.abs(np.cross(b - a, c - a)).sum() == pytest.approx(12)


def test_a_box_is_a_box() -> None:
    box = wf.Box((1, 2, 3), (2, 4, 6), emission=3)
    assert box.bounds.tolist() == [[0, 0, 0], [2, 4, 6]]
    assert box.uvs.min(0).tolist() == [0, 0]
    assert box.uvs.max(0).tolist() == [1, 1]
    camera = wf.Camera.look_at((1, 2, 20), (1, 2, 3), size=(8, 8), fov=5)
    assert render([box], 1, camera=camera).rgb == pytest.approx(3)
    for size, message in (((1, 0, 1), "size is .* must be above 0"), ((1, 2), "size must have shape")):
        with pytest.raises(wf.SceneError, match=message):
            wf.Box((0, 0, 0), size)


def test_a_plane_is_a_large_square_that_is_not_framed() -> None:
    """Its uvs are lengths; the camera and the ground are those of the other shapes."""
    plane = wf.Plane((1, 2, 3), (0, 0, 2), size=50)
    assert plane.bounds.tolist() == [[-24, -23, 3], [26, 27, 3]]
    assert np.ptp(plane.uvs, 0).tolist() == [50, 50]
    a, b, c = plane.vertices[plane.faces[0]]
    assert np.cross(b - a, c - a)[2] > 0
    ball, floor = wf.Sphere((0, 1, 0), 1), wf.Plane((0, 0, 0))
    alone, both = wf.Scene(ball).framing_camera(), wf.Scene([ball, floor]).framing_camera()
    assert both.origin == pytest.approx(alone.origin)
    assert np.linalg.norm(wf.Scene(floor).framing_camera().origin) > 100
    for arguments, message in (
        (((0, 0, 0), (0, 0, 0)), "normal is .* must not be zero"),
        (((0, 0),), "point must have shape"),
    ):
        with pytest.raises(wf.SceneError, match=message):
            wf.Plane(*arguments)
    with pytest.raises(wf.SceneError, match="size is 0; it must be above 0"):
        wf.Plane((0, 0, 0), size=0)


@pytest.mark.parametrize("up", ["y", "z"])
def test_height_fields_rise_where_they_should(up: str) -> None:
    x, y = np.linspace(-1, 1, 5), np.linspace(0, 3, 4)
    z = 0.3 * x + 0.2 * y[:, None]
    normal = np.array([-0.3, -0.2, 1]) / np.linalg.norm([-0.3, -0.2, 1])
    wanted = normal if up == "z" else normal[[0, 2, 1]] * (1, 1, -1)
    for columns, rows, heights in ((x, y, z), (x[::-1], y, z[:, ::-1]), (x, y[::-1], z[::-1])):
        field = wf.HeightField(heights, columns, rows, up=up)
        a, b, c = field.vertices[field.faces].transpose(1, 0, 2)
        facing = np.cross(b - a, c - a)
        assert facing / np.linalg.norm(facing, axis=1)[:, None] == pytest.approx(np.tile(wanted, (24, 1)))
        normals = field.normals / np.linalg.norm(field.normals, axis=1)[:, None]
        assert normals == pytest.approx(np.tile(wanted, (20, 1)))
        assert field.bounds[:, 2 if up == "z" else 1] == pytest.approx([-0.3, 0.9])


def test_height_fields_have_colors_and_holes() -> None:
    """A row of colors for each height; NaN leaves out the six triangles around."""
    z = np.zeros((4, 5))
    z[1, 1] = np.nan
    field = wf.HeightField(z, colors=np.full((4, 5, 3), 128, np.uint8), smooth=False)
    assert len(field.faces) == 2 * 12 - 6
    assert field.normals is None
    assert field.colors[0, 0] == pytest.approx(0.2158605)
    assert field.uvs[[0, -1]].tolist() == [[0, 0], [1, 1]]
    for arguments, message in (
        (([1, 2, 3],), r"z must have shape \(n, n\)"),
        (([[1, 2]],), r"z has shape \(1, 2\)"),
        (([[1, np.inf], [1, 1]],), r"z\[0\]\[1\] is inf"),
        (([[np.nan, 1], [1, 1]],), "no three heights beside each other"),
        ((np.zeros((2, 3)), [0, 1]), "x must be 3 numbers, strictly rising or falling"),
        ((np.zeros((2, 3)), [0, 2, 1]), "x must be 3 numbers"),
    ):
        with pytest.raises(wf.SceneError, match=message):
            wf.HeightField(*arguments)
    with pytest.raises(wf.SceneError, match=r"colors must have shape \(2, 3, 3\)"):
        wf.HeightField(np.zeros((2, 3)), colors=np.zeros((6, 3)))


def ply(points: Any, colors: bool = False) -> str:
    """Return a PLY file of points."""
    header = "".join(f"property float {name}\n" for name in "xyz")
    header += "".join(f"property uchar {name}\n" for name in ("red", "green", "blue") if colors)
    rows = [" ".join(map(str, point)) + (" 128 255 0" if colors else "") for point in points.tolist()]
    return "\n".join([f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n{header}end_header", *rows, ""])


@pytest.mark.parametrize("colors", [False, True])
@pytest.mark.parametrize("kind", ["ply", "obj"])
def test_files_of_points_become_spheres(tmp_path: Path, kind: str, colors: bool) -> None:
    """Of a stated radius, with their colors; a mesh is not to be had, and strict refuses them."""
    file = tmp_path / f"a.{kind}"
    rows = ["v " + " ".join(map(str, point)) + " 0.502 1 0" * colors for point in GRID.tolist()]
    file.write_text(ply(GRID, colors) if kind == "ply" else "\n".join(rows))
    with pytest.warns(UserWarning, match=rf"a\.{kind}: has no faces; 120 points {RADIUS}"):
        (cloud,) = wf.load(file).shapes
    assert isinstance(cloud, wf.Spheres)
    assert cloud.centers == pytest.approx(GRID)
    assert cloud.radii == pytest.approx(0.5)
    if colors:
        assert cloud.colors[7] == pytest.approx([0.2158605, 1, 0, 1])
    else:
        assert cloud.colors is None
    with pytest.warns(UserWarning, match="has no faces"):
        assert wf.render(str(file), 1, size=(8, 8), lighting="cloudy", material="gold").shape == (8, 8, 3)
    with pytest.raises(wf.SceneError, match="has no faces; 120 points"):
        wf.load(file, strict=True)
    with pytest.raises(wf.SceneError, match="is a Spheres, not a mesh"):
        wf.load_mesh(file)


def test_points_that_are_not_finite_are_dropped(tmp_path: Path) -> None:
    file = tmp_path / "a.ply"
    file.write_text(ply(np.vstack([GRID, [(np.nan, 0, 0)]])))
    with pytest.warns(UserWarning, match="1 point not finite, first: point 120; left out\n.*become"):
        assert wf.load(file).shapes[0].count == 120  # type: ignore[attr-defined]
    file.write_text(ply(np.full((2, 3), np.nan)))
    with pytest.raises(wf.SceneError, match="has no faces"):
        wf.load(file)


def test_points_choose_a_radius() -> None:
    """So that those of a grid touch; many in one place have some."""
    with pytest.warns(UserWarning, match="points: 120 points are shown as spheres of radius 0.5"):
        assert wf.Points(GRID).radii == pytest.approx(0.5)
    for places in (np.zeros((9, 3)), [(0, 0, 0), (1, 0, 0)]):
        with pytest.warns(UserWarning, match="radius"):
            assert wf.Points(places).radii > 0


def test_off_counts_may_follow_the_header_at_once(tmp_path: Path) -> None:
    file = tmp_path / "a.off"
    file.write_text("\t  OFF3 1 0 # or not\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    assert len(wf.load_mesh(file).faces) == 1
    file.write_text("OFFX\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    with pytest.raises(wf.SceneError, match="begins with 'OFFX'"):
        wf.load_mesh(file)


class PolyData(SimpleNamespace):
    """What is read of PyVista's class."""

    __module__ = "pyvista.core.pointset"


class TriangleMesh(SimpleNamespace):
    """What is read of Open3D's classes."""

    __module__ = "open3d.cpu.pybind.geometry"


CODES = np.array([(128, 255, 0), (0, 0, 0), (255, 255, 255), (9, 9, 9)], np.uint8)
SQUARE = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], float)
UP = np.tile([0.0, 0, 1], (4, 1))


def poly(**data: Any) -> PolyData:
    """A square of two triangles."""
    faces = np.array([3, 0, 1, 2, 3, 0, 2, 3])
    return PolyData(**{"points": SQUARE, "faces": faces, "point_data": {}, "cell_data": {}, **data})


def test_meshes_of_pyvista() -> None:
    """Points, faces, normals, texture coordinates, colors of points or cells; polygons are triangulated."""
    given = {"values": np.arange(4.0), "Normals": UP, "RGB": CODES}
    (mesh,) = wf.Scene([poly(point_data=given, active_texture_coordinates=SQUARE[:, :2])]).shapes
    assert isinstance(mesh, wf.Mesh)
    assert mesh.vertices.tolist() == SQUARE.tolist()
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.normals.tolist() == UP.tolist()
    assert mesh.uvs.tolist() == SQUARE[:, :2].tolist()
    assert mesh.colors[0] == pytest.approx([0.2158605, 1, 0, 1])
    (mesh,) = wf.from_pyvista(poly(cell_data={"paint": CODES[:2]})).shapes
    assert mesh.colors[:, 1].tolist() == [1, 1, 1, 0, 0, 0]  # type: ignore[attr-defined]
    quad = poly(faces=np.array([4, 0, 1, 2, 3]), triangulate=poly)
    grid = PolyData(extract_surface=lambda: quad)
    blocks = type("MultiBlock", (list,), {"n_blocks": 2, "__module__": "pyvista"})([grid, None, poly()])
    assert [len(shape.faces) for shape in wf.from_pyvista(blocks).shapes] == [2, 2]  # type: ignore[attr-defined]
    image = render([poly(), wf.Environment(1)], 1, size=(8, 8), up="z", material=None)
    assert image.shape == (8, 8, 3)
    with pytest.raises(
        wf.SceneError, match="expected a PolyData, a grid or a Plotter of PyVista, got PolyData"
    ):
        wf.from_pyvista(PolyData())
    with pytest.raises(wf.SceneError, match=r"PyVista: .*uses vertex 9"):
        wf.from_pyvista(poly(faces=np.array([3, 0, 1, 9])))


def test_points_and_lines_of_pyvista() -> None:
    none = np.zeros(0, int)
    with pytest.warns(UserWarning, match="PyVista: has no faces; 4 points become spheres of radius 0.5 "):
        (cloud,) = wf.from_pyvista(poly(faces=none, point_data={"RGB": CODES})).shapes
    assert cloud.colors[0] == pytest.approx([0.2158605, 1, 0, 1])  # type: ignore[attr-defined]
    with pytest.warns(UserWarning, match=r"3 lines become capsules of radius 0.00354"):
        (lines,) = wf.from_pyvista(poly(faces=none, lines=np.array([3, 0, 1, 2, 2, 0, 3]))).shapes
    assert lines.ends.tolist() == SQUARE[[1, 2, 3]].tolist()  # type: ignore[attr-defined]
    with pytest.raises(wf.SceneError, match="PyVista: has no points"):
        wf.from_pyvista(poly(faces=none, points=np.zeros((0, 3))))


def test_meshes_points_and_lines_of_open3d() -> None:
    """Colors are sRGB floats; tensors become legacy objects; absent arrays are empty."""
    colors = np.full((4, 3), 0.5)
    mesh = TriangleMesh(
        vertices=SQUARE,
        triangles=[[0, 1, 2], [0, 2, 3]],
        vertex_colors=colors,
        vertex_normals=UP,
        textures=[],
    )
    for data in (mesh, TriangleMesh(to_legacy=lambda: mesh)):
        (found,) = wf.Scene(data).shapes
        assert found.faces.tolist() == [[0, 1, 2], [0, 2, 3]]  # type: ignore[attr-defined]
        assert found.colors == pytest.approx(np.tile([HALF] * 3 + [1], (4, 1)))  # type: ignore[attr-defined]
        assert found.normals.tolist() == UP.tolist()  # type: ignore[attr-defined]
    mesh.vertex_colors, mesh.vertex_normals, mesh.textures = [], [], [1]
    with pytest.warns(UserWarning, match="Open3D: not honored: textures"):
        assert wf.from_open3d(mesh).shapes[0].colors is None  # type: ignore[attr-defined]
    points = TriangleMesh(points=SQUARE, colors=colors, normals=UP)
    with pytest.warns(UserWarning, match="Open3D: has no faces; 4 points become spheres"):
        (cloud,) = wf.from_open3d(points).shapes
    assert cloud.colors == pytest.approx(np.tile([HALF] * 3 + [1], (4, 1)))  # type: ignore[attr-defined]
    assert wf.Points(points, 0.1).colors[0] == pytest.approx([HALF] * 3 + [1])
    assert wf.Points(poly(point_data={"RGB": CODES}), 0.1).colors[0] == pytest.approx([0.2158605, 1, 0, 1])
    with pytest.warns(UserWarning, match="Open3D: has no faces; 2 lines become capsules"):
        (lines,) = wf.from_open3d(
            TriangleMesh(points=SQUARE, lines=[[0, 2], [1, 3]], colors=colors[:2])
        ).shapes
    assert lines.starts.tolist() == SQUARE[:2].tolist()  # type: ignore[attr-defined]
    for bad, message in (
        (TriangleMesh(), "expected a TriangleMesh, PointCloud or LineSet of Open3D, got TriangleMesh"),
        (TriangleMesh(points=[]), "Open3D: has no points"),
        (TriangleMesh(points=SQUARE, lines=[]), "Open3D: has no lines"),
        (TriangleMesh(vertices=SQUARE, triangles=[]), "Open3D: has no faces"),
    ):
        with pytest.raises(wf.SceneError, match=message):
            wf.from_open3d(bad)


@pytest.mark.parametrize("count", [2, 3, 4, 8])
def test_few_points_have_a_radius_by_their_nearest_neighbor(count: int) -> None:
    """However far the others are."""
    places = np.zeros((count, 3))
    places[:, 0] = 10.0 ** np.arange(count)
    gaps = np.abs(places[:, None, 0] - places[None, :, 0]) + np.diag([np.inf] * count)
    with pytest.warns(UserWarning, match="are shown as spheres of radius"):
        cloud = wf.Points(places)
    assert cloud.radii[0] == pytest.approx(np.sqrt(np.median(gaps.min(1) ** 2)) / 2)


def test_one_point_needs_a_radius(tmp_path: Path) -> None:
    """Given as an array, or in a file."""
    with pytest.raises(wf.SceneError, match="a radius for one point is not known"):
        wf.Points([(0, 0, 0)])
    assert wf.Points([(0, 0, 0)], 0.1).radii.tolist() == [0.1]
    (tmp_path / "a.obj").write_text("v 1 2 3\n")
    with pytest.raises(wf.SceneError, match="a radius for one point is not known"):
        wf.load(tmp_path / "a.obj")
