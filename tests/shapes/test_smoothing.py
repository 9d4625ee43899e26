"""Normals of meshes that have none: of files, of trimesh objects and of arrays, by crease angles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from inside import crease_normals, main
from numpy.typing import NDArray

import wavefront as wf

FAST: dict[str, Any] = {"spp": 2, "size": (12, 12), "progress": False}
BALL = trimesh.creation.icosphere(3)


def roof(degrees: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """Two rectangles that share an edge and bend by an angle, as four triangles."""
    angle = np.radians(degrees)
    x, z = np.cos(angle), np.sin(angle)
    vertices = [(0, 0, 0), (0, 1, 0), (-1, 0, 0), (-1, 1, 0), (x, 0, -z), (x, 1, -z)]
    return np.array(vertices, float), np.array([[2, 0, 1], [2, 1, 3], [0, 4, 5], [0, 5, 1]])


def soup(vertices: NDArray[Any], faces: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """The same mesh as an STL has it: no two faces share a vertex."""
    return vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)


def corners(mesh: wf.Mesh) -> NDArray[Any]:
    """Normals at the corners of faces, (m, 3, 3)."""
    assert mesh.normals is not None
    found: NDArray[Any] = mesh.normals[mesh.faces]
    return found


def by_definition(vertices: NDArray[Any], faces: NDArray[Any], degrees: float) -> NDArray[Any]:
    """One corner after the other: faces at its place that bend less, weighed by angle and area."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    cross = np.cross(b - a, c - a)
    area = np.linalg.norm(cross, axis=1)
    flat = cross / area[:, None]
    places = np.unique(vertices, axis=0, return_inverse=True)[1].reshape(-1)[faces]
    out = np.empty((len(faces), 3, 3))
    for face, corner in np.ndindex(*faces.shape):
        total = np.zeros(3)
        for other, k in np.argwhere(places == places[face, corner]):
            if np.degrees(np.arccos(np.clip(flat[face] @ flat[other], -1, 1))) <= degrees + 1e-9:
                p, q, r = vertices[faces[other][[k, (k + 1) % 3, (k + 2) % 3]]]
                cos = (q - p) @ (r - p) / np.linalg.norm(q - p) / np.linalg.norm(r - p)
                total += np.arccos(cos) * area[other] * flat[other]
        out[face, corner] = total / np.linalg.norm(total)
    return out


@pytest.mark.parametrize("degrees", [15.0, 30.0, 75.0, 180.0])
@pytest.mark.parametrize("shared", [True, False])
def test_normals_are_those_of_the_definition(degrees: float, shared: bool) -> None:
    """Of a bent tube with caps, whether faces share vertices or not."""
    tube = trimesh.creation.cylinder(1, 2, sections=14)
    random = np.random.default_rng(2)
    vertices = tube.vertices + 0.08 * random.normal(size=tube.vertices.shape)
    expected = by_definition(vertices, tube.faces, degrees)
    mesh = wf.Mesh(*((vertices, tube.faces) if shared else soup(vertices, tube.faces)), smooth=degrees)
    np.testing.assert_allclose(corners(mesh), expected, atol=1e-7)
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], vertices[tube.faces])


def test_the_crease_angle_divides() -> None:
    """Just below the angle of an edge it is sharp, just above it is smooth; a plane is exactly flat."""
    for degrees in (10.0, 29.0, 60.0, 90.0, 150.0):
        sharp, smooth = (wf.Mesh(*roof(degrees), smooth=degrees + step) for step in (-0.1, 0.1))
        assert sharp.normals is None
        assert corners(smooth)[0, 1] == pytest.approx(
            [np.sin(np.radians(degrees / 2)), 0, np.cos(np.radians(degrees / 2))]
        )
        assert corners(smooth)[0, 0].tolist() == [0, 0, 1]
        assert len(smooth.vertices) == 6


def test_auto_divides_at_60_degrees() -> None:
    """Between the 51 degrees of a pipe of seven sides and the edges of a regular tetrahedron or a box."""
    assert wf.Mesh(*roof(60.1), smooth="auto").normals is None
    assert wf.Mesh(*roof(59.9), smooth="auto").normals is not None


def test_a_ball_without_normals_is_round() -> None:
    """The computed normals are within a degree of those of a sphere; facets bend by 8°."""
    mesh = wf.Mesh(*soup(BALL.vertices, BALL.faces), smooth=True)
    cos = (corners(mesh) * mesh.vertices[mesh.faces]).sum(2)
    assert np.degrees(np.arccos(cos.min())) < 1
    assert wf.Mesh(BALL.vertices, BALL.faces, smooth=True).vertices.shape == BALL.vertices.shape


def test_a_plane_stays_flat_beside_a_fillet() -> None:
    """Its area outweighs that of the narrow facets around its corner."""
    angles = np.radians(np.arange(0, 91, 15))
    profile = [(-1.0, 0.0), *((0.05 * np.sin(a), 0.05 * np.cos(a) - 0.05) for a in angles), (0.05, -1.0)]
    vertices = np.array([(x, y, z) for x, y in profile for z in (0.0, 1.0)])
    quads = [(2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2) for k in range(len(profile) - 1)]
    faces = np.array([part for a, b, c, d in quads for part in ((a, b, c), (a, c, d))])
    normals = corners(wf.Mesh(vertices, faces, smooth="auto"))
    assert np.degrees(np.arccos(normals[:2, :, 1].min())) < 0.5
    assert np.degrees(np.arccos(normals[4, :, 1].min())) > 14


def test_what_belongs_to_vertices_goes_with_them() -> None:
    box = trimesh.creation.box()
    values = np.random.default_rng(1).random((8, 4))
    mesh = wf.Mesh(box.vertices, box.faces, uvs=values[:, :2], colors=values, smooth=100)
    bare = wf.Mesh(box.vertices, box.faces, uvs=values[:, :2], colors=values)
    for name in ("vertices", "uvs", "colors"):
        found, expected = (getattr(each, name)[each.faces] for each in (mesh, bare))
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(("sections", "kept"), [(256, False), (257, True)])
def test_many_faces_at_one_place_are_not_many_squared(sections: int, kept: bool) -> None:
    """Above a limit of 256 the facets at the place keep their normals; at the rim all are smooth."""
    cone = trimesh.creation.cone(1, 1, sections=sections)
    normals = crease_normals(cone.vertices, cone.faces, 30)
    assert normals is not None
    crowded = np.bincount(cone.faces.ravel())[cone.faces] >= 256
    off = np.linalg.norm(normals - cone.face_normals[:, None], axis=-1)
    assert crowded.sum() == 2 * sections
    assert (off[crowded].max() < 1e-9) == kept
    assert (off[(cone.face_normals[:, 2] > 0)[:, None] & ~crowded] > 1e-3).all()


def test_opposite_faces_keep_their_normals() -> None:
    vertices = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], float)
    mesh = wf.Mesh(vertices, [(0, 1, 2), (0, 2, 1)], smooth=True)
    assert mesh.normals is None


@pytest.mark.parametrize("value", ["yes", -1, 181, np.nan, (30,), None])
def test_other_values_are_refused(value: Any) -> None:
    for call in (
        lambda: wf.render("no such file", smooth=value),
        lambda: wf.Mesh(BALL.vertices, BALL.faces, smooth=value),
        lambda: wf.load("no such file.stl", smooth=value),
        lambda: wf.from_trimesh(BALL, smooth=value),
    ):
        with pytest.raises(wf.SceneError, match="smooth"):
            call()


def test_meshes_from_arrays_stay_as_they_are() -> None:
    """Unless they are told; normals that are given are not computed as well."""
    given = np.array(BALL.vertices), np.array(BALL.faces)
    assert wf.Mesh(*given).normals is None
    flat, pair, told, off = (
        wf.render(subject, **FAST, **how).rgb
        for subject, how in (
            (wf.Mesh(*given), {}),
            (given, {}),
            (given, {"smooth": True}),
            (wf.Mesh(*given, normals=BALL.vertices), {"smooth": False}),
        )
    )
    np.testing.assert_array_equal(flat, pair)
    np.testing.assert_array_equal(flat, off)
    assert (told != flat).any()
    np.testing.assert_array_equal(told, wf.render(wf.Mesh(*given, smooth=True), **FAST).rgb)
    mesh = wf.Mesh(*given)
    np.testing.assert_array_equal(told, wf.render(mesh, **FAST, smooth=True).rgb)
    assert mesh.normals is None
    with pytest.raises(wf.SceneError, match="ball: has normals; then smooth must be False"):
        wf.Mesh(*given, normals=BALL.vertices, smooth=30, name="ball")


def test_scenes_and_instances_are_told_elsewhere() -> None:
    mesh = wf.Mesh(BALL.vertices, BALL.faces)
    with pytest.raises(wf.SceneError, match=r"smooth is for bare meshes; .* use Mesh\(..., smooth=...\)"):
        wf.render(wf.Scene(mesh), **FAST, smooth=True)
    with pytest.raises(wf.SceneError, match=r"smooth is for bare meshes; mesh is an instance"):
        wf.render([wf.Instance(mesh, np.eye(4))], **FAST, smooth=True)


@pytest.mark.parametrize("kind", ["stl", "off", "ply", "obj", "trimesh"])
def test_auto_smooths_what_has_no_normals(tmp_path: Path, kind: str) -> None:
    for made, degrees in ((trimesh.creation.icosphere(3), 1.5), (trimesh.creation.box(), None)):
        path = tmp_path / f"a.{kind}"
        if kind != "trimesh":
            made.export(path, **({"include_normals": False} if kind == "obj" else {}))
        subject = made if kind == "trimesh" else path
        scene = wf.from_trimesh(made) if kind == "trimesh" else wf.load(path)
        (mesh,) = scene.shapes
        if degrees is None:
            assert mesh.normals is None
            continue
        cos = (corners(mesh) * mesh.vertices[mesh.faces]).sum(2)
        assert np.degrees(np.arccos(cos.min())) < degrees
        auto, thirty, off = (wf.render(subject, **FAST, smooth=smooth).rgb for smooth in ("auto", 30, False))
        np.testing.assert_array_equal(auto, thirty)
        assert (auto != off).any()


def test_glb_without_normals_is_flat(tmp_path: Path) -> None:
    """As its standard says; another value is honored."""
    BALL.export(tmp_path / "a.glb", include_normals=False)
    path = tmp_path / "a.glb"
    assert wf.load(path).shapes[0].normals is None
    assert wf.from_trimesh(trimesh.load(path, process=False)).shapes[0].normals is None
    assert wf.load(path, smooth=True).shapes[0].normals is not None
    assert wf.load_mesh(path, smooth=30).normals is not None


def test_normals_of_a_file_stay_unless_told(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 1 0 1\nf 1//1 2//1 3//1\n")
    assert wf.load_mesh(path).normals[0] == pytest.approx([0.5**0.5, 0, 0.5**0.5])
    assert wf.load_mesh(path, smooth=False).normals is None
    assert wf.load_mesh(path, smooth=30).normals is None
    assert wf.load(path, smooth=True).shapes[0].normals is None


def test_some_meshes_of_a_file_may_be_flat(tmp_path: Path) -> None:
    """Joined, those get the normals of their facets, and nothing is left out."""
    ball, box = trimesh.creation.icosphere(2), trimesh.creation.box()
    faces = [("ball", ball, 0), ("box", box, len(ball.vertices))]
    lines = [f"v {x} {y} {z}" for mesh in (ball, box) for x, y, z in mesh.vertices]
    for name, mesh, start in faces:
        lines += [f"usemtl {name}", *(f"f {a} {b} {c}" for a, b, c in mesh.faces + 1 + start)]
    path = tmp_path / "a.obj"
    path.write_text("\n".join(lines))
    joined = wf.load_mesh(path, material=wf.Diffuse(0.5))
    np.testing.assert_allclose(corners(joined)[len(ball.faces) :, 1], box.face_normals, atol=1e-12)
    cos = (corners(joined) * joined.vertices[joined.faces]).sum(2)[: len(ball.faces)]
    assert np.degrees(np.arccos(cos.min())) < 3


def test_the_command_line_takes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, output = tmp_path / "a.stl", tmp_path / "out.npy"
    BALL.export(path)
    common = ["render", str(path), "-o", str(output), "--spp", "2", "--size", "12x12", "--quiet"]
    for words, smooth in (([], "auto"), (["no"], False), (["yes"], True), (["12.5"], 12.5)):
        assert main([*common, *(["--smooth", *words] if words else [])]) == 0
        np.testing.assert_array_equal(np.load(output), wf.render(path, **FAST, smooth=smooth).rgb)
    with pytest.raises(SystemExit):
        main([*common, "--smooth", "200"])
    assert "'200' is not yes, no, auto, or a crease angle from 0 to 180" in capsys.readouterr().err
