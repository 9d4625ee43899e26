"""Scenes: what may be put together, what is refused and how, and what is compiled."""

from typing import Any, Self

import numpy as np
import pytest
import scenes
from inside import compile_scene, f4, group_materials, make_accelerator
from significance import render

import wavefront as wf

NAN, INF = np.nan, np.inf
TRIANGLE = {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "faces": [[0, 1, 2]]}
SQUARE = {"corner": (0, 0, 0), "edge_u": (1, 0, 0), "edge_v": (0, 1, 0)}
BALL = {"center": (0, 0, 0), "radius": 1}
POINT = {"position": (0, 0, 0), "intensity": 1}
FINITE = "it must be finite"


def compiled(*shapes, lights=()):
    """Compile a scene for the NumPy accelerator."""
    return compile_scene(wf.Scene(shapes, lights), lambda geometry: make_accelerator(geometry, "numpy"))


# ruff: noqa: E501
BAD = [
    (wf.Mesh, TRIANGLE, {"vertices": []}, r"mesh: vertices must have shape \(n, 3\), got \(0,\)"),
    (wf.Mesh, TRIANGLE, {"vertices": [[0, 0], [1, 0], [0, 1]]}, r"mesh: vertices must have shape \(n, 3\), got \(3, 2\)"),
    (wf.Mesh, TRIANGLE, {"vertices": [[0, 0, 0], [1, NAN, 0], [0, 1, 0]]}, rf"mesh: vertices\[1\]\[1\] is nan; {FINITE}"),
    (wf.Mesh, TRIANGLE, {"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, -INF]]}, rf"mesh: vertices\[2\]\[2\] is -inf; {FINITE}"),
    (wf.Mesh, TRIANGLE, {"vertices": [[0, 0, 0], [1e39, 0, 0], [0, 1, 0]]}, r"vertices\[1\]\[0\] is 1e\+39; its size must be at most 3.4e\+38"),
    (wf.Mesh, TRIANGLE, {"vertices": "abc"}, r"mesh: vertices must be numeric, got 'abc'"),
    (wf.Mesh, TRIANGLE, {"faces": []}, r"mesh: has no faces"),
    (wf.Mesh, TRIANGLE, {"faces": [[0, 1, 3]]}, r"mesh: faces\[0\]\[2\] is 3; it must be in \[0, 2\]"),
    (wf.Mesh, TRIANGLE, {"faces": [[0, 1, 2], [0, -1, 2]]}, r"mesh: faces\[1\]\[1\] is -1; it must be in \[0, 2\]"),
    (wf.Mesh, TRIANGLE, {"faces": [[0, 1, 2, 0]]}, r"mesh: faces must be integers of shape \(m, 3\), got int64 of shape \(1, 4\)"),
    (wf.Mesh, TRIANGLE, {"faces": [[0.0, 1.0, 2.0]]}, r"mesh: faces must be integers of shape \(m, 3\), got float64"),
    (wf.Mesh, TRIANGLE, {"faces": [0, 1, 2]}, r"mesh: faces must be integers of shape \(m, 3\), got int64 of shape \(3,\)"),
    (wf.Mesh, TRIANGLE, {"faces": [[0, 1, 2], [0, 1]]}, r"mesh: faces must have rows of one length, got \[\[0, 1, 2\], \[0, 1\]\]"),
    (wf.Mesh, TRIANGLE, {"normals": [[0, 0, 1]]}, r"mesh: normals must have a row for each of 3 vertices, got 1"),
    (wf.Mesh, TRIANGLE, {"normals": [[0, 0, 1], [0, 0, NAN], [0, 0, 1]]}, r"mesh: normals\[1\]\[2\] is nan"),
    (wf.Mesh, TRIANGLE, {"uvs": [[0, 0], [1, 0], [INF, 0]]}, r"mesh: uvs\[2\]\[0\] is inf"),
    (wf.Mesh, TRIANGLE, {"uvs": [[0, 0, 0]] * 3}, r"mesh: uvs must have shape \(n, 2\), got \(3, 3\)"),
    (wf.Mesh, TRIANGLE, {"emission": -1}, r"mesh: emission is -1; it must be at least 0"),
    (wf.Mesh, TRIANGLE, {"emission": (1, 2, NAN)}, r"mesh: emission\[2\] is nan"),
    (wf.Mesh, TRIANGLE, {"emission": (1, 2)}, r"mesh: emission must have shape \(3,\), got \(2,\)"),
    (wf.Mesh, TRIANGLE, {"material": "reed"}, r"mesh: material is 'reed'; it must be one of aluminum"),
    (wf.Mesh, TRIANGLE, {"material": wf.Diffuse}, r"mesh: material must be a material"),
    (wf.Mesh, TRIANGLE, {"vertices": [[0, 0, NAN]] * 3, "name": "roof"}, r"roof: vertices\[0\]\[2\] is nan"),
    (wf.Rectangle, SQUARE, {"corner": (0, 0)}, r"rectangle: corner must have shape \(3,\), got \(2,\)"),
    (wf.Rectangle, SQUARE, {"edge_u": (0, NAN, 0)}, r"rectangle: edge_u\[1\] is nan"),
    (wf.Rectangle, SQUARE, {"edge_v": (2, 0, 0)}, r"edge_u \[1.0, 0.0, 0.0\] and edge_v \[2.0, 0.0, 0.0\] span no area"),
    (wf.Rectangle, SQUARE, {"edge_u": (0, 0, 0)}, r"span no area"),
    (wf.Rectangle, SQUARE, {"emission": -2}, r"rectangle: emission is -2; it must be at least 0"),
    (wf.Sphere, BALL, {"radius": 0}, r"sphere: radius is 0; it must be above 0"),
    (wf.Sphere, BALL, {"radius": -1}, r"sphere: radius is -1; it must be above 0"),
    (wf.Sphere, BALL, {"radius": NAN}, r"sphere: radius is nan; it must be above 0"),
    (wf.Sphere, BALL, {"radius": INF}, r"sphere: radius is inf"),
    (wf.Sphere, BALL, {"radius": "big"}, r"sphere: radius must be a number, got 'big'"),
    (wf.Sphere, BALL, {"radius": 1e39}, r"sphere: radius is 1e\+39; it must be"),
    (wf.Sphere, BALL, {"center": (0, INF, 0)}, rf"sphere: center\[1\] is inf; {FINITE}"),
    (wf.Sphere, BALL, {"center": (1e39, 0, 0)}, r"sphere: center\[0\] is 1e\+39"),
    (wf.Sphere, BALL, {"center": 0}, r"sphere: center must have shape \(3,\), got \(\)"),
    (wf.Sphere, BALL, {"emission": (0, -1, 0), "name": "sun"}, r"sun: emission\[1\] is -1; it must be at least 0"),
    (wf.Sphere, BALL, {"material": 0.5}, r"sphere: material must be a material"),
    (wf.PointLight, POINT, {"position": (0, 0)}, r"PointLight position must have shape \(3,\), got \(2,\)"),
    (wf.PointLight, POINT, {"position": (0, 0, NAN)}, rf"PointLight position\[2\] is nan; {FINITE}"),
    (wf.PointLight, POINT, {"intensity": -1}, r"PointLight intensity is -1; it must be at least 0"),
    (wf.PointLight, POINT, {"intensity": (1, NAN, 1)}, r"PointLight intensity\[1\] is nan"),
    (wf.PointLight, POINT, {"intensity": "bright"}, r"PointLight intensity is 'bright', which is no color"),
    (wf.Environment, {}, {"radiance": -0.5}, r"Environment radiance is -0.5; it must be at least 0"),
    (wf.Environment, {}, {"radiance": INF}, r"Environment radiance is inf"),
    (wf.Environment, {}, {"radiance": (1, 2, 3, 4)}, r"Environment radiance must have shape \(3,\), got \(4,\)"),
    (wf.Scene, {}, {"shapes": []}, r"the scene has no shapes"),
    (wf.Scene, {}, {"shapes": [wf.Sphere((0, 0, 0), 1), "ball"]}, r"shapes\[1\] is 'ball'; it must be one of wf.Mesh, wf.Rectangle, wf.Disk, wf.Sphere, wf.Spheres, wf.Cylinders, wf.Capsules, wf.SignedDistanceGrid, wf.Instance"),
    (wf.Scene, {}, {"shapes": ["a.obj"]}, r"; wf.load\(path\) reads a file as a scene$"),
    (wf.Scene, {}, {"shapes": [wf.PointLight((0, 0, 0), 1)]}, r"; lights are given as lights="),
    (wf.Scene, {"shapes": wf.Sphere((0, 0, 0), 1)}, {"lights": wf.Sphere((0, 0, 0), 1)}, r"; emitting shapes belong to the shapes$"),
    (wf.Scene, {"shapes": wf.Sphere((0, 0, 0), 1)}, {"lights": wf.Camera.look_at((0, 0, 5), (0, 0, 0))}, r"; a camera is given as camera="),
    (wf.Scene, {}, {"shapes": 5}, r"shapes must be a list of wf.Mesh, wf.Rectangle, wf.Disk, wf.Sphere, .*, got 5"),
    (wf.Scene, {}, {"shapes": None}, r"shapes must be a list of wf.Mesh, .*, got None"),
    (wf.Scene, {"shapes": wf.Sphere((0, 0, 0), 1)}, {"lights": 3}, r"lights must be a list of wf.PointLight, .*, got 3"),
    (wf.Scene, {"shapes": wf.Sphere((0, 0, 0), 1)}, {"lights": [3]}, r"lights\[0\] is 3; it must be one of wf.PointLight, wf.SpotLight"),
    (wf.Scene, {"shapes": wf.Sphere((0, 0, 0), 1)}, {"lights": [wf.Environment(), wf.Environment()]}, r"more than one Environment; at most one"),
    (wf.Scene, {"shapes": wf.Sphere((0, 0, 0), 1)}, {"camera": (0, 0, 5)}, r"camera must be a wf.Camera, got \(0, 0, 5\)"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("make", "good", "change", "message"), BAD, ids=[f"{b[0].__name__}-{i}" for i, b in enumerate(BAD)]
)
def test_bad_arguments_are_named(make, good, change, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message) as caught:
        make(**{**good, **change})
    assert isinstance(caught.value, ValueError)


@pytest.mark.parametrize(
    "make", [lambda: wf.Mesh(**TRIANGLE), lambda: wf.Rectangle(**SQUARE), lambda: wf.Sphere(**BALL)]
)
def test_a_lone_shape_is_a_scene(make) -> None:
    assert len(wf.Scene(make()).shapes) == 1


def test_a_light_must_have_an_area() -> None:
    """A mesh whose faces are all flat to nothing cannot shine; one such face among others is left out."""
    with pytest.warns(UserWarning, match="wire: dropped 1 face of zero area, first: face 0"):
        line = wf.Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], emission=1.0, name="wire")
    with pytest.raises(wf.SceneError, match=r"wire: a light must have an area; its 1 face has none"):
        compiled(line)
    with pytest.warns(UserWarning, match="mesh: dropped 1 face of zero area, first: face 0"):
        mixed = wf.Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 1, 3]], emission=1.0)
    assert len(compiled(mixed).lights) == 1


def test_a_dark_light_is_still_a_light() -> None:
    """Emission 0 gives black, without a warning and without a division by its power."""
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), size=(4, 4))
    scene = wf.Scene([wf.Sphere(**BALL, emission=0.0)], camera=camera)
    for integrator in scenes.ALL:
        assert (render(scene, 4, integrator=integrator).rgb == 0).all()


def test_bounds_hold_what_faces_use() -> None:
    mesh = wf.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1e6, 0, 0]], [[0, 1, 2]])
    ball = wf.Sphere((5, 5, 5), 2)
    assert wf.Scene([mesh, ball]).bounds.tolist() == [[0, 0, 0], [7, 7, 7]]


def test_primitives_know_their_material_and_light() -> None:
    """Triangles of all meshes first, then spheres; lights number their own faces."""
    dark = wf.Mesh(**TRIANGLE)
    area_light = wf.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2], [0, 2, 3]], emission=2.0)
    glow = wf.Sphere((5, 0, 0), 1, emission=3.0)
    scene = compiled(
        dark, glow, area_light, wf.Sphere(**BALL), lights=[wf.PointLight(**POINT), wf.Environment()]
    )
    assert scene.triangles == 3
    assert scene.material_of.tolist() == [0, 1, 1, 2, 3]
    assert scene.light_of.tolist() == [-1, 0, 1, 2, -1, 4]
    assert len(scene.lights) == 5
    assert scene.lights.delta_of.tolist() == [False, False, False, True, False]


def test_positions_are_relative_to_the_center() -> None:
    near = wf.Mesh(**TRIANGLE), wf.Sphere((0.25, 0.5, 0), 0.125)
    far = (
        wf.Mesh(np.array(TRIANGLE["vertices"]) + 2.0**40, TRIANGLE["faces"]),
        wf.Sphere(near[1].center + 2.0**40, 0.125),
    )
    a, b = compiled(*near, lights=[wf.Environment()]), compiled(*far, lights=[wf.Environment()])
    assert a.curved.kinds[0].centers.any()
    assert (a.curved.kinds[0].centers == b.curved.kinds[0].centers).all()
    assert (a.center + 2.0**40 == b.center).all()


PAIRS = [
    (wf.Diffuse((0.8, 0.1, 0.1)), wf.Diffuse(0.4)),
    (wf.Mirror((0.8, 0.1, 0.1)), wf.Mirror(0.4)),
    (
        wf.Dielectric(1.5, 0.3, multiscatter=False),
        wf.Dielectric(1.3, 0.6, transmittance=(1, 0.5, 0.2), multiscatter=False),
    ),
    (wf.Conductor.named("gold", roughness=0.3), wf.Conductor.named("silver", roughness=0.3)),
    (wf.OrenNayar(0.8, 0.3), wf.OrenNayar((0.2, 0.3, 0.4), 0.6)),
    (wf.ThinDielectric(1.5), wf.ThinDielectric(1.3)),
    (wf.Principled((0.8, 0.1, 0.1), 0, 0.2), wf.Principled(0.4, 0, 0.6, 1.3)),
    (
        wf.Principled((0.8, 0.1, 0.1), 0.3, 0.2, multiscatter=False),
        wf.Principled(0.4, 1.0, 0.6, 1.3, multiscatter=False),
    ),
    (
        wf.Principled((0.8, 0.1, 0.1), transmission=0.5, multiscatter=False),
        wf.Principled(0.4, transmission=1.0, ior=1.3, multiscatter=False),
    ),
    (wf.Principled(0.8, clearcoat=0.5, sheen=0.2), wf.Principled((0.1, 0.4, 0.6), clearcoat=1.0, sheen=1.0)),
]


@pytest.mark.parametrize(("red", "gray"), PAIRS, ids=lambda material: type(material).__name__)
def test_grouping_changes_no_picture(red: wf.Bsdf, gray: wf.Bsdf) -> None:
    assert len(group_materials([wf.Material(red), wf.Material(gray)]).groups) == 1
    left, right = wf.Sphere((-1, 0, 0), 1), wf.Sphere((1, 0, 0), 1)
    camera = wf.Camera.look_at((0, 0, 6), (0, 0, 0), fov=30, size=(8, 4))

    def picture(a: wf.Bsdf, b: wf.Bsdf):
        left.material, right.material = a, b
        return render(wf.Scene([left, right], [wf.Environment()], camera), 4, max_bounces=1).rgb

    both = picture(red, gray)
    assert both[:, :4].tobytes() == picture(red, red)[:, :4].tobytes()
    assert both[:, 4:].tobytes() == picture(gray, gray)[:, 4:].tobytes()


def test_shading_normals_are_normalized_and_zero_ones_replaced() -> None:
    """A mesh may bring normals of any length; a zero one takes the face's."""
    mesh = wf.Mesh(**TRIANGLE, normals=[[0, 0, 5], [0, 3, 4], [0, 0, 0]])
    scene = compiled(mesh, lights=[wf.Environment()])
    a, b, c = scene.corner_normals
    assert a[:, 0].tolist() == [0, 0, 1]
    assert b[:, 0] == pytest.approx([0, 0.6, 0.8])
    assert c[:, 0].tolist() == [0, 0, 1]
    assert a.dtype == f4


def test_repr_counts() -> None:
    text = repr(wf.Scene([wf.Sphere(**BALL)], [wf.PointLight(**POINT)]))
    assert text == "<Scene: 1 shape, 1 light, camera=False>"
    assert repr(wf.Mesh(**TRIANGLE)) == "<Mesh 'mesh': 3 vertices, 1 face>"
    assert repr(wf.Sphere(**BALL)) == "<Sphere 'sphere': center [0.0, 0.0, 0.0], radius 1>"


def test_materials_out_of_sight_are_not_shaded() -> None:
    """They are neither looked up nor asked, and the picture is the same bit for bit."""

    class Untouched(wf.Diffuse):
        def __init__(self, number: int) -> None:
            super().__init__(0.5)
            self.number = number  # keeps each in a group of its own

        def bind(self, surface):
            raise AssertionError("a material that no ray meets was bound")

    room = [
        wf.Sphere((0, 0, 0), 10, material=wf.Diffuse(0.5)),
        wf.Sphere((0, 0, -5), 1, material=wf.Mirror()),
        wf.Sphere((0, 4, -5), 0.5, material=wf.Diffuse(0), emission=5.0),
    ]
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), size=(8, 8))
    pictures = []
    for materials in ([wf.Diffuse(0.2)] * 10, [Untouched(i) for i in range(10)]):
        outside = [wf.Sphere((20 + i, 0, 0), 0.4, material=m) for i, m in enumerate(materials)]
        pictures.append(render(wf.Scene([*room, *outside], camera=camera), 4, max_bounces=4).rgb)
    assert (pictures[0] == pictures[1]).all()
    assert pictures[0].max() > 0


class Ink(wf.Diffuse):
    """Black, in a group of its own, and aware of what is shaded."""

    black = True

    def __init__(self) -> None:
        super().__init__(0)
        self.number = 1
        self.shaded: list[int] = []

    def bind(self, surface: Any) -> Self:
        self.shaded.append(len(surface))
        return self


class ShadedInk(Ink):
    """Black, too, but does not say so."""

    black = False


def test_paths_end_on_black_lights() -> None:
    """They shine, but are not shaded; the picture is the same bit for bit if they are."""
    room = [
        wf.Sphere((0, 0, 0), 10, material=wf.Diffuse(0.5)),
        wf.Sphere((0, 0, -2), 1, material=wf.Diffuse(0.5), emission=1.0),
    ]
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), size=(8, 8))
    pictures = []
    for ink in (Ink(), ShadedInk()):
        scene = wf.Scene([*room, wf.Sphere((0, 3, -2), 1, material=ink, emission=5.0)], camera=camera)
        pictures.append(render(scene, 4, max_bounces=4).rgb)
        assert bool(ink.shaded) is not ink.black
    assert pictures[0].tobytes() == pictures[1].tobytes()
    assert pictures[0].max() > 1
