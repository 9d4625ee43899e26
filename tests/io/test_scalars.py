"""Numbers of vertices, faces and points as colors; datasets and plotters of PyVista."""

from __future__ import annotations

import tomllib
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import matplotlib
import numpy as np
import pytest
import trimesh
from inside import color_map
from significance import render

import wavefront as wf

SIDE = 9
X, Y = np.meshgrid(np.linspace(-0.5, 0.5, SIDE), np.linspace(-0.5, 0.5, SIDE))
PLANE = np.stack([X.ravel(), Y.ravel(), np.zeros(SIDE * SIDE)], 1)
CELLS = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)[:-1, :-1].ravel()
QUADS = np.stack([CELLS, CELLS + 1, CELLS + SIDE + 1, CELLS + SIDE], 1)
TRIANGLES = QUADS[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
CODE = 1 / 255


def colors_seen(subject: Any, **settings: Any) -> Any:
    """The colors in sRGB of a row of small pixels across the plane, and where they are."""
    camera = wf.Camera.orthographic((0, 0.03, 5), (0, 0.03, 0), height=0.001, size=(1000, 1))
    camera = camera.replace(crop=(50, 0, 950, 1))
    image = render(subject, 1, camera=camera, aovs="albedo", filter=lambda u: 0 * u + 0.5, **settings)
    linear = image.albedo[0].astype(np.float64)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def due(values: Any, cmap: str = "viridis", low: float = -0.5, high: float = 0.5) -> Any:
    return matplotlib.colormaps[cmap](np.clip((values - low) / (high - low), 0, 1))[:, :3]


WHERE = (np.arange(50, 950) + 0.5) / 1000 - 0.5


class Data(SimpleNamespace):
    """What is read of a pyvista.PolyData with quads."""

    __module__ = "pyvista.core.pointset"

    def __init__(self, faces: Any = QUADS, active: str | None = None, **arrays: Any) -> None:
        flat = np.column_stack([np.full(len(faces), faces.shape[1]), faces]).ravel()
        of_points = {name: each for name, each in arrays.items() if len(each) == len(PLANE)}
        of_cells = {name: each for name, each in arrays.items() if len(each) != len(PLANE)}
        super().__init__(points=PLANE, faces=flat, point_data=of_points, cell_data=of_cells)
        self.active_scalars_name, self.n_cells, self.corners = active, len(faces), faces

    def triangulate(self) -> Data:
        twice = {name: np.repeat(each, 2, 0) for name, each in self.cell_data.items()}
        return Data(TRIANGLES, self.active_scalars_name, **self.point_data, **twice)

    def copy(self, deep: bool) -> Data:
        return Data(self.corners, self.active_scalars_name, **self.point_data, **self.cell_data)


def mesh_of(subject: Any) -> Any:
    return wf.Mesh(PLANE, TRIANGLES) if subject == "mesh" else subject


@pytest.mark.parametrize(
    "subject",
    [
        "mesh",
        (PLANE, TRIANGLES),
        trimesh.Trimesh(PLANE, TRIANGLES, process=False),
        Data(),
        Data(TRIANGLES),
        wf.Scene(wf.Mesh(PLANE, TRIANGLES)),
    ],
)
def test_scalars_of_points_are_those_of_matplotlib(subject) -> None:
    """To one code, between the vertices as well: numbers are interpolated, not colors."""
    found = colors_seen(mesh_of(subject), scalars=np.array(PLANE[:, 0]), cmap="coolwarm")
    expected = due(WHERE, "coolwarm")
    near = np.minimum.reduce([np.abs(found - due(WHERE + d, "coolwarm")).max(1) for d in (-1e-6, 0, 1e-6)])
    assert near.max() < CODE
    assert np.abs(found - expected).max() < 0.02
    assert colors_seen(mesh_of(subject), scalars="x", cmap="coolwarm").tobytes() == found.tobytes()


def test_limits_are_kept() -> None:
    found = colors_seen((PLANE, TRIANGLES), scalars="x", clim=(-0.2, 0.1))
    assert np.abs(found - due(WHERE, "viridis", -0.2, 0.1)).max() < 0.03
    with pytest.raises(wf.SceneError, match="clim must have shape"):
        render((PLANE, TRIANGLES), 1, scalars="x", clim=3)


@pytest.mark.parametrize("faces", [QUADS, TRIANGLES])
@pytest.mark.parametrize("given", [True, False])
def test_scalars_of_cells(faces, given) -> None:
    """Each cell has one color, also where it is not a triangle."""
    values = PLANE[faces].mean(1)[:, 0]
    data = Data(faces) if given else Data(faces, "v", v=values)
    found = colors_seen(data, **({"scalars": values} if given else {}))
    there = np.unique(np.round(due(values, low=values.min(), high=values.max()) * 255), axis=0).astype(int)
    seen = np.unique(np.round(found * 255), axis=0).astype(int)
    assert len(seen) >= SIDE - 2
    assert {tuple(each) for each in seen} <= {tuple(each) for each in there}


def test_active_scalars_are_shown() -> None:
    """What PyVista would plot, by its default colormap."""
    found = colors_seen(Data(active="z", z=PLANE[:, 0]))
    assert np.abs(found - due(WHERE)).max() < 0.02


@pytest.mark.parametrize("faces", [QUADS, TRIANGLES])
@pytest.mark.parametrize("active", ["c", None])
def test_bytes_are_colors(faces, active) -> None:
    codes = np.where(PLANE[faces].mean(1)[:, :1] < 0, (255, 0, 0), (0, 0, 255)).astype(np.uint8)
    found = colors_seen(Data(faces, active, c=codes))
    assert found[0].round(3).tolist() == [1, 0, 0]
    assert found[-1].round(3).tolist() == [0, 0, 1]


def test_floats_like_colors_are_colors_and_that_is_said() -> None:
    colors = np.tile([1.0, 0.5, 0.0], (len(PLANE), 1))
    with pytest.warns(UserWarning, match="'c' is taken for colors in sRGB"):
        found = colors_seen(Data(active="c", c=colors))
    assert found == pytest.approx(np.tile([1, 0.5, 0], (900, 1)), abs=CODE)


def test_vectors_are_shown_by_their_lengths() -> None:
    vectors = np.stack([PLANE[:, 0] + 0.5, 0 * PLANE[:, 0], -0.0 * PLANE[:, 0]], 1) * -2
    found = colors_seen(Data(active="v", v=vectors))
    assert np.abs(found - due(2 * WHERE + 1, low=0, high=2)).max() < 0.02


def test_what_is_no_number_has_a_color_of_its_own() -> None:
    values = np.where(PLANE[:, 0] < -0.1, np.nan, PLANE[:, 0])
    found = colors_seen((PLANE, TRIANGLES), scalars=values)
    assert found[:250] == pytest.approx(np.tile(169 / 255, (250, 3)), abs=CODE)
    assert np.isfinite(found).all()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"scalars": "w"}, r"scalars is 'w'; there are 'x', 'y', 'z'"),
        ({"scalars": [1.0, 2.0]}, "there are 2 scalars; there must be one for each of 81 vertices or of 128"),
        ({"scalars": "x", "cmap": "virids"}, "no colormap of matplotlib; the nearest names are 'viridis'"),
        ({"scalars": "x", "cmap": 3}, "cmap is 3; it must be a colormap"),
        ({"scalars": "x", "material": "gold"}, "scalars=.x. does not go with material=.gold."),
        ({"cmap": "plasma"}, "cmap and clim are for scalars"),
        ({"scalars": np.full(81, np.nan)}, "scalars has no finite number"),
    ],
)
def test_wrong_scalars_are_named(settings, message) -> None:
    with pytest.raises(wf.SceneError, match=message):
        render((PLANE, TRIANGLES), 1, **settings)


def test_colormaps_of_other_kinds() -> None:
    values = np.linspace(0, 1, 5)
    named = color_map("v", values, "plasma").colors(values)
    assert np.array_equal(named, color_map("v", values, matplotlib.colormaps["plasma"]).colors(values))
    two = color_map("v", values, ["red", (0, 0, 1)]).colors(values)
    assert two[:, :3].tolist() == [[1, 0, 0]] * 2 + [[0, 0, 1]] * 3


def test_points_show_scalars() -> None:
    cloud = wf.Points(PLANE, 0.02)
    shown = wf.Scene(cloud)
    image = render(shown, 1, scalars="x", size=8, aovs="albedo", camera=shown.framing_camera())
    assert image.albedo.std() > 0
    assert cloud.colors is None


def test_default_colors_of_trimesh_do_not_dim_a_texture() -> None:
    """Its SimpleMaterial is gray where no color is given; one that is given is a factor."""
    from PIL import Image

    picture = Image.new("RGB", (4, 4), (255, 255, 255))
    uv = PLANE[:, :2] + 0.5
    plain = trimesh.visual.TextureVisuals(uv=uv, image=picture)
    dyed = trimesh.visual.TextureVisuals(
        uv=uv, material=trimesh.visual.material.SimpleMaterial(image=picture, diffuse=(255, 0, 0, 255))
    )
    for visual, expected in ((plain, [1, 1, 1]), (dyed, [1, 0, 0])):
        mesh = trimesh.Trimesh(PLANE, TRIANGLES, visual=visual, process=False)
        assert colors_seen(mesh)[450] == pytest.approx(expected, abs=CODE)


def test_normals_that_oppose_the_faces_of_an_open_mesh_are_turned() -> None:
    up = np.tile([0, 0, 1.0], (len(PLANE), 1))
    with pytest.warns(UserWarning, match="the normals are turned"):
        mesh = wf.Mesh(PLANE, TRIANGLES, normals=-up)
    assert np.array_equal(mesh.normals, up)
    assert np.array_equal(mesh.faces, TRIANGLES)


def test_faces_of_a_closed_mesh_that_face_inwards_are_turned() -> None:
    """As those of skimage.measure.marching_cubes."""
    ball = trimesh.creation.icosphere(2)
    normals = np.array(ball.vertex_normals)
    with pytest.warns(UserWarning, match="the faces, which face inwards, are turned"):
        mesh = wf.Mesh(ball.vertices, np.array(ball.faces)[:, ::-1], normals=normals)
    assert np.array_equal(mesh.faces, ball.faces)
    assert np.array_equal(mesh.normals, normals)
    with pytest.warns(UserWarning, match="the normals are turned"):
        mesh = wf.Mesh(ball.vertices, ball.faces, normals=-normals)
    assert np.array_equal(mesh.normals, normals)


def test_normals_of_which_many_agree_stay() -> None:
    ball = trimesh.creation.icosphere(2)
    normals = np.array(ball.vertex_normals) * np.where(ball.vertices[:, :1] > 0.6, 1, -1)
    mesh = wf.Mesh(ball.vertices, ball.faces, normals=normals)
    assert np.array_equal(mesh.normals, normals)


def test_the_entry_points_of_pyvista_lead_to_a_module() -> None:
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8"))["project"]
    points = project["entry-points"]
    assert points["pyvista.accessors"] == points["pyvista.plotter_components"]
    path = points["pyvista.accessors"]["wavefront"].replace(".", "/") + ".py"
    assert (Path(wf.__file__).parents[1] / path).is_file()


@pytest.fixture
def pyvista():
    found = pytest.importorskip("pyvista")
    found.OFF_SCREEN = True
    return found


@pytest.mark.slow
@pytest.mark.parametrize("parallel", [False, True])
@pytest.mark.parametrize("size", [(300, 200), (120, 250)])
def test_a_plotter_is_seen_as_by_vtk(pyvista, parallel, size) -> None:
    """The camera projects as that of VTK, and actors are as they are shown."""
    plotter = pyvista.Plotter(off_screen=True, window_size=size)
    ball = pyvista.Sphere(center=(1, 2, 3))
    ball["v"] = ball.points[:, 2]
    plotter.add_mesh(ball, cmap="plasma", clim=(2.7, 3.2), opacity=0.5, name="ball")
    cube = plotter.add_mesh(pyvista.Cube(), color="red", name="cube")
    cube.position = (2, 2, 3)
    plotter.add_mesh(pyvista.Cone(), name="hidden").SetVisibility(False)
    plotter.camera.parallel_projection = parallel
    plotter.camera.azimuth = 20
    plotter.camera.SetWindowCenter(0.1, -0.2)
    scene = wf.from_pyvista(plotter)
    assert [shape.name for shape in scene.shapes] == ["ball", "cube"]
    assert scene.shapes[0].material.alpha == pytest.approx(0.5)
    assert scene.shapes[1].material.bsdf.reflectance.ravel().tolist() == [1, 0, 0]
    assert scene.shapes[1].bounds.mean(0) == pytest.approx([2, 2, 3])
    matrix = plotter.camera.GetCompositeProjectionTransformMatrix(size[0] / size[1], -1, 1)
    rows = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
    points = np.asarray(ball.points, np.float64)
    clip = np.column_stack([points, np.ones(len(points))]) @ rows.T
    pixels = (clip[:, :2] / clip[:, 3:] * (1, -1) + 1) / 2 * size
    assert np.abs(scene.camera.project(points)[0] - pixels).max() < 0.01
    assert scene.camera.size == size


@pytest.mark.slow
def test_actors_are_as_they_are_shown(pyvista) -> None:
    """Colors of points, logarithms, opacity by the scalars, blocks with common limits, styles."""
    ball = pyvista.Sphere()
    height = ball.points[:, 2].astype(float)

    def shapes(data: Any, **arguments: Any) -> list[Any]:
        plotter = pyvista.Plotter(off_screen=True)
        plotter.add_mesh(data, **arguments)
        return wf.from_pyvista(plotter).shapes

    colors = np.random.default_rng(1).random((ball.n_points, 3))
    (shown,) = shapes(ball.copy(), scalars=colors, rgb=True)
    assert shown.colors[:, :3] == pytest.approx(wf.srgb(colors), abs=1e-6)
    (shown,) = shapes(ball.copy(), scalars=10 ** (3 * height), log_scale=True)
    assert shown.uvs[:, 0] == pytest.approx(height + 0.5, abs=1e-5)
    (shown,) = shapes(ball.copy(), scalars=height, opacity="linear")
    assert shown.material.alpha.limits() == pytest.approx((0, 1), abs=CODE)
    ball["z"] = height
    other = ball.translate((0, 0, 5))
    other["z"] = height + 5
    low, high = (shape.uvs[:, 0] for shape in wf.from_pyvista(pyvista.MultiBlock([ball, other])).shapes)
    assert (low.min(), low.max()) == pytest.approx((0, 1 / 6))
    assert (high.min(), high.max()) == pytest.approx((5 / 6, 1))
    assert isinstance(shapes(ball, style="wireframe")[0], wf.Capsules)
    assert isinstance(shapes(ball, style="points")[0], wf.Spheres)
    with pytest.raises(wf.SceneError, match="the plotter shows no dataset"):
        wf.from_pyvista(pyvista.Plotter(off_screen=True))


@pytest.mark.slow
def test_accessors_of_pyvista(pyvista) -> None:
    import_module("wavefront.plugins.pyvista_accessors")
    ball = pyvista.Sphere()
    ball["z"] = ball.points[:, 2]
    found = ball.wavefront.render(1, size=16, progress=False)
    assert found.rgb.tobytes() == wf.render(ball, 1, size=16, progress=False).rgb.tobytes()
    plotter = pyvista.Plotter(off_screen=True, window_size=(20, 12))
    plotter.add_mesh(ball)
    assert plotter.wavefront.render(1, progress=False).shape == (12, 20, 3)
    grid = pyvista.ImageData(dimensions=(3, 3, 3))
    grid["v"] = np.arange(27.0)
    assert len(grid.wavefront.scene().shapes[0].faces) == 48


def test_opacity_of_a_colormap_is_shown() -> None:
    faint = matplotlib.colors.ListedColormap([(1, 0, 0, 0.5), (0, 0, 1, 1)])
    camera = wf.Camera.orthographic((0, 0.03, 5), (0, 0.03, 0), height=0.5, size=(16, 8))
    image = render(
        (PLANE, TRIANGLES), 64, scalars="x", cmap=faint, camera=camera, aovs="alpha", background="transparent"
    )
    assert image.alpha[:, :7].mean() == pytest.approx(128 / 255, abs=0.05)
    assert image.alpha[:, 9:].min() == 1
