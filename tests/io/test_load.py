"""Meshes and materials from files that the test writes, and every complaint about bad ones."""

import os
import struct
import warnings

import numpy as np
import pytest
import trimesh
from inside import (
    Camera,
    Dielectric,
    Diffuse,
    Environment,
    Mirror,
    Scene,
    SceneError,
    VertexColors,
    from_trimesh,
    load,
    load_mesh,
    load_meshes,
)

from wavefront import render

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


@pytest.fixture
def write(tmp_path):
    """Write files into one folder; return the path of the first."""

    def write_files(text, name="scene.obj", **others):
        for file, content in {name: text, **{k.replace("_", "."): v for k, v in others.items()}}.items():
            data = content if isinstance(content, bytes) else content.encode()
            (tmp_path / file).write_bytes(data)
        return tmp_path / name

    return write_files


def named_once(path, message):
    """Read meshes, which warns once of something, and with `strict` refuses."""
    with pytest.warns(UserWarning, match=message) as record:
        meshes = load_meshes(path)
    assert len(record) == 1
    with pytest.raises(SceneError, match=message):
        load_meshes(path, strict=True)
    return meshes


def soup(mesh, values=None):
    """What the corners of the faces have, (m, 3, ·)."""
    return (mesh.vertices if values is None else values)[mesh.faces]


def test_triangle(write):
    (mesh,) = load_meshes(write("v 0 0 0\nv 1 0 0\nv 0 1 0.1\nf 1 2 3\n"))
    assert np.array_equal(mesh.vertices, [[0, 0, 0], [1, 0, 0], [0, 1, 0.1]])
    assert np.array_equal(mesh.faces, [[0, 1, 2]])
    assert mesh.normals is None
    assert mesh.uvs is None
    assert mesh.material.bsdf.reflectance.ravel() == pytest.approx([0.5] * 3)


@pytest.mark.parametrize(
    "face",
    [
        "1 2 3 4",
        "-4 -3 -2 -1",
        "1/ 2/ 3/ 4/",
        "1// 2// 3// 4//",
        "\t1  2\t3 4 ",
        "1 2 \\\n3 4",
        "1 2 3 4 # quad",
    ],
)
def test_quad_in_every_spelling(write, face):
    (mesh,) = load_meshes(write(f"{SQUARE}f {face}\n"))
    assert np.array_equal(soup(mesh)[:, :, :2], [[[0, 0], [1, 0], [1, 1]], [[1, 1], [0, 1], [0, 0]]])


def test_polygon_is_a_fan(write):
    angles = np.arange(7) * 2 * np.pi / 7
    rows = "".join(f"v {np.cos(a):.17g} {np.sin(a):.17g} 0\n" for a in angles)
    (mesh,) = load_meshes(write(rows + "f 1 2 3 4 5 6 7\n"))
    assert len(mesh.faces) == 5
    a, b, c = soup(mesh).transpose(1, 0, 2)
    areas = np.cross(b - a, c - a)[:, 2] / 2
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(7 / 2 * np.sin(2 * np.pi / 7))


def test_indices_count_back_from_their_own_line(write):
    (mesh,) = load_meshes(
        write("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf -3 -2 -1\n")
    )
    assert np.array_equal(soup(mesh)[:, 0], [[0, 0, 0], [5, 0, 0]])


def test_normals_and_uvs_follow_their_own_indices(write):
    text = SQUARE + "vt 0 0\nvt 1 0\nvt 0.5 1\nvn 0 0 2\nvn 0 3 4\nf 1/1/1 2/2/1 3/3/2\nf 1/3/2 3/2/1 4/1/1\n"
    (mesh,) = load_meshes(write(text))
    assert np.array_equal(soup(mesh)[:, :, :2], [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]])
    assert np.array_equal(soup(mesh, mesh.uvs), [[[0, 0], [1, 0], [0.5, 1]], [[0.5, 1], [1, 0], [0, 0]]])
    assert soup(mesh, mesh.normals) == pytest.approx(
        np.array([[[0, 0, 1], [0, 0, 1], [0, 0.6, 0.8]], [[0, 0.6, 0.8], [0, 0, 1], [0, 0, 1]]])
    )


def test_vertices_are_shared_where_all_indices_agree(write):
    (mesh,) = load_meshes(write(SQUARE + "vn 0 0 1\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n"))
    assert len(mesh.vertices) == 4


def test_faces_without_normals_among_others_are_flat(write):
    text = SQUARE + "v 0 0 1\nvn 0 1 0\nf 1//1 2//1 3//1\nf 1 3 4\nf 1 4 5\n"
    (mesh,) = load_meshes(write(text))
    assert np.array_equal(soup(mesh, mesh.normals)[:, 0], [[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    assert np.array_equal(soup(mesh, mesh.normals)[1], [[0, 0, 1]] * 3)


def test_a_normal_of_zero_length_is_replaced(write):
    (mesh,) = load_meshes(write(SQUARE + "vn 0 0 0\nf 1//1 2//1 3//1\n"))
    assert np.array_equal(mesh.normals, [[0, 0, 1]] * 3)


def test_faces_of_mixed_forms_keep_their_uvs(write):
    (mesh,) = load_meshes(write(SQUARE + "vt 0.25 0.75\nf 1/1 2/1 3/1\nf 1 3 4\n"))
    assert np.array_equal(soup(mesh, mesh.uvs)[0], [[0.25, 0.75]] * 3)
    assert np.array_equal(soup(mesh, mesh.uvs)[1], [[0, 0]] * 3)


def test_vertices_keep_all_their_digits(write):
    (mesh,) = load_meshes(write("v 1234567.125 1e-30 0.1\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"))
    assert mesh.vertices[0].tolist() == [1234567.125, 1e-30, 0.1]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
def test_encodings_and_line_ends(write, encoding):
    text = ("mtllib s.mtl\n" + SQUARE + "usemtl Fläche\nf 1 2 3\n").replace("\n", "\r\n")
    (mesh,) = load_meshes(write(text.encode(encoding), s_mtl="newmtl Fläche\nKd 1 0 0\n".encode(encoding)))
    assert (mesh.name, len(mesh.faces)) == ("Fläche", 1)
    assert mesh.material.bsdf.reflectance.ravel().tolist() == [1, 0, 0]


@pytest.mark.parametrize("name", [b"caf\xe9.obj", "図.OBJ".encode(), b"a b.obj"])
def test_file_names(tmp_path, name):
    path = os.path.join(os.fsencode(tmp_path), name)
    try:
        with open(path, "w") as file:
            file.write(SQUARE + "f 1 2 3\n")
    except OSError:
        pytest.skip("the file system wants UTF-8 names")
    assert len(load_meshes(os.fsdecode(path))[0].faces) == 1


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("f 0 1 2", r"line 6: f is '0 1 2'; left out, as there is no v 0$"),
        ("\nf 1 2 5", r"line 7: f is '1 2 5'; left out, as there is no v 5$"),
        ("f -5 1 2", r"f is '-5 1 2'; left out, as there is no v -5$"),
        ("f 1 2", r"f is '1 2'; left out$"),
        ("f", r"f is ''; left out$"),
        ("f 1 2 x", r"f is '1 2 x'; left out$"),
        ("f 1 2 3.5", "left out$"),
        ("f 1/1/1/1 2 3", "left out$"),
        ("f /1 2 3", "left out$"),
        ("f 1/1 /1 2/1 3/1", "left out$"),
        ("f 99999999999999999999 2 3", "left out$"),
        (f"f {-(2**63)} 2 3", r"there is no v -9223372036854775808$"),
        (f"f 1 2 3 {-(2**63)}", r"there is no v -9223372036854775808$"),
        (f"f {2**63 - 1} 2 3", r"there is no v 9223372036854775807$"),
        (f"f -0{2**63} 2 3", r"there is no v -9223372036854775808$"),
        ("f 1_0 2 3", "left out$"),
        ("f 1 // 2 3", "left out$"),
        ("v 1 2 1_0", r"line 6: v is '1 2 1_0'; its faces are left out$"),
        ("v 1 2 zero", "v is '1 2 zero'; its faces are left out$"),
        ("v 1,5 2,5 0", "its faces are left out$"),
        ("v", "v is ''; its faces are left out$"),
        ("v 2 2", "v is '2 2'; 0 in place of the rest$"),
        ("vt", r"line 6: vt is ''; 0 0 in its place$"),
        ("vt x y", "0 0 in its place$"),
        ("vn 0 1", r"line 6: vn is '0 1'; left out$"),
        ("<html>", r"line 6: the text is '<html>'; left out$"),
        ("%%%\x07", "the text is .*; left out$"),
    ],
)
def test_a_damaged_line_costs_what_it_says(write, line, message):
    (mesh,) = named_once(write(f"{SQUARE}f 1 2 3\n{line}\nf 1 3 4\n"), message)
    assert soup(mesh)[:, :, :2].tolist() == [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]]


def test_faces_of_a_damaged_vertex_are_left_out(write):
    """The others keep their indices; numbers that are missing are 0."""
    text = "v 1 2 zero\nv 0 0\nv 1 0\nv 0 1\nf 2 3 4\nf 1 2 3\n"
    path = write(text)
    (mesh,) = named_once(path, "line 1: v is '1 2 zero'; its faces are left out")
    assert soup(mesh).tolist() == [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]
    named_once(path, "1 face with a vertex that is not finite or beyond float32, first: line 6")


@pytest.mark.parametrize(
    ("lines", "message", "uvs", "normals"),
    [
        (
            "vt .5 0\nf 1/1 2/1 3/2",
            r"f is '1/1 2/1 3/2'; without it, as there is no vt 2$",
            [0.5, 0.5, 0],
            None,
        ),
        (
            "vn 0 .6 .8\nf 1//1 2//2 3//1",
            r"f is '1//1 2//2 3//1'; without it, as there is no vn 2$",
            None,
            [0.6, 0, 0.6],
        ),
        (f"f 1/{-(2**63)} 2/1 3/1\nvt .5 0", "there is no vt -9223372036854775808$", [0, 0.5, 0.5], None),
        ("vt x\nvt .5 0\nf 1/1 2/2 3/2", "vt is 'x'; 0 0 in its place$", [0, 0.5, 0.5], None),
        ("vn 1\nvn 0 .6 .8\nf 1//1 2//2 3//2", "vn is '1'; left out$", None, [0, 0.6, 0.6]),
    ],
)
def test_a_stray_normal_or_uv_costs_that_alone(write, lines, message, uvs, normals):
    (mesh,) = named_once(write(f"{SQUARE}{lines}\n"), message)
    assert uvs is None or soup(mesh, mesh.uvs)[0, :, 0].tolist() == uvs
    assert normals is None or soup(mesh, mesh.normals)[0, :, 1] == pytest.approx(normals)


@pytest.mark.parametrize("ending", ["\x1a", "\n\x1a", "\x1a\0\0", "\0\0"])
def test_files_may_end_in_control_z(write, ending):
    path = write(f"mtllib s.mtl\n{SQUARE}usemtl m\nf 1 2 3{ending}", s_mtl=f"newmtl m\nKd 1 0 0{ending}")
    (mesh,) = load_meshes(path, strict=True)
    assert mesh.material.bsdf.reflectance.ravel().tolist() == [1, 0, 0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("vn 0 0 1\n", r"scene\.obj: has no faces$"),
        ("", r"scene\.obj: is empty"),
        (b"\x00\x01\x02\x03\xff" * 9, r"scene\.obj: has no faces:\s+line 1: the text is '"),
        ("<html>\n", r"scene\.obj: has no faces:\s+line 1: the text is '<html>'; left out"),
        (SQUARE + "f 1 2\n", r"scene\.obj: has no faces:\s+line 5: f is '1 2'; left out"),
        (
            SQUARE + "f 1 2 9\n",
            r"scene\.obj: has no faces:\s+line 5: f is '1 2 9'; left out, as there is no v 9",
        ),
    ],
)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_without_a_face_the_first_defect_is_the_error(write, text, message):
    with pytest.raises(SceneError, match=message):
        load_meshes(write(text))


@pytest.mark.parametrize(
    ("face", "message"),
    [
        ("1/1 2/2 3/3", r"scene\.obj: line 5: f is '1/1 2/2 3/3'; without vt, as there is none$"),
        ("1//-1 2//2 3", r"scene\.obj: line 5: f is '1//-1 2//2 3'; without vn, as there is none$"),
    ],
)
def test_uvs_and_normals_that_no_line_gives_are_left_out(write, face, message):
    (mesh,) = named_once(write(f"{SQUARE}f {face}\nf 1 3 4\n"), message)
    assert (mesh.uvs, mesh.normals) == (None, None)
    assert np.array_equal(soup(mesh)[:, :, :2], [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]])


def test_names_and_comments_may_hold_keywords(write):
    text = f"# usemtl x f 1 2 3\nmtllib s.mtl\n{SQUARE}o usemtl f\nusemtl v usemtl #f\n"
    text += "f 1 2 3 # usemtl y\ng f 1\nusemtl 0\nf 1 3 4\n"
    scene = load(write(text, s_mtl="newmtl v usemtl #f\nnewmtl 0\n"))
    assert [(shape.name, len(shape.faces)) for shape in scene.shapes] == [("v usemtl #f", 1), ("0", 1)]


@pytest.mark.parametrize("cut", range(60, 5, -3))
def test_a_truncated_file_is_an_error_or_a_shorter_mesh(write, cut):
    text = SQUARE + "f 1 2 3\nf 1 3 4\nf 2 3 4\n"
    whole = soup(load_meshes(write(text))[0])
    try:
        (mesh,) = load_meshes(write(text[:cut]), strict=True)  # what has vertices alone would be points
    except SceneError:
        return
    assert np.array_equal(soup(mesh), whole[: len(mesh.faces)])


BAD_FACES = {
    "nan": ("v nan 0 0\n", "vertex that is not finite"),
    "inf": ("v 0 -inf 0\n", "vertex that is not finite"),
    "huge": ("v 1e39 0 0\n", "beyond float32"),
    "flat": ("v 2 0 0\n", "of zero area"),
}


@pytest.mark.parametrize("case", BAD_FACES)
def test_bad_faces_are_dropped_and_counted(write, case):
    row, message = BAD_FACES[case]
    text = f"mtllib s.mtl\n{SQUARE}{row}usemtl a\nf 1 2 3\nf 1 2 5\nf 5 2 1\n"
    path = write(text, s_mtl="newmtl a\n")
    (mesh,) = named_once(path, rf"scene\.obj: 'a': 2 faces .*{message}.*, first: line 9")
    assert len(mesh.faces) == 1


def test_nothing_left_is_an_error(write):
    path = write(SQUARE + "f 1 1 2\n")
    with pytest.raises(SceneError, match="has no faces: 1 face of zero area, first: line 5; left out"):
        load_meshes(path)


@pytest.mark.parametrize("scale", [1e-30, 1e-6, 1, 1e6, 1e30])
@pytest.mark.parametrize("shift", [0.0, 1e5])
def test_thin_and_tiny_faces_stay(write, scale, shift):
    rows = np.array([[0, 0, 0], [1, 0, 0], [0, 1e-5, 0]]) * scale + shift * scale
    path = write("".join("v {:.17g} {:.17g} {:.17g}\n".format(*row) for row in rows) + "f 1 2 3\n")
    assert len(load_meshes(path)[0].faces) == 1


def test_not_finite_normals_and_uvs_are_announced(write):
    path = write(SQUARE + "vt nan 0\nvt 0 0\nvn inf 0 0\nvn 0 0 1\nf 1/1/1 2/2/2 3/2/2\n")
    message = (
        "1 normal is not finite, first: vertex 0; .*\n.*1 uv is not finite, first: vertex 0; 0 in its place"
    )
    with pytest.warns(UserWarning, match=message):
        (mesh,) = load_meshes(path)
    assert np.array_equal(mesh.normals, [[0, 0, 1]] * 3)
    with pytest.raises(SceneError, match="1 normal is not finite"):
        load_meshes(path, strict=True)


def test_uvs_beyond_all_textures_are_announced(write):
    path = write(SQUARE + "vt 1e38 0\nvt 0 0\nvt 1 -1e30\nf 1/1 2/2 3/3\n")
    (mesh,) = named_once(path, r"2 uvs are beyond ±16777216")
    assert not mesh.uvs.any()


def test_what_is_not_read_is_named_once(write):
    path = write(SQUARE + "f 1 2 3\nl 1 2\nl 2 3\np 1\ncurv2 1 2\n")
    named_once(path, r"not honored: line 6: l\n  not honored: line 8: p\n  not honored: line 9: curv2")


@pytest.mark.parametrize(
    "line", ["usemap a", "bevel on", "c_interp on", "d_interp on", "lod 5", "mg 1 2", "shadow_obj a.obj"]
)
def test_statements_that_obj_has_for_rendering_are_named(write, line):
    path = write(f"{SQUARE}{line}\n{line}\nf 1 2 3\n")
    with pytest.warns(UserWarning, match=rf"not honored: line 5: {line.split()[0]}$") as record:
        load_meshes(path)
    assert len(record) == 1
    load_meshes(write(f"o a\ng b c\n{SQUARE}{line.split()[0]} off\nf 1 2 3\n"))
    load_meshes(write(f"{SQUARE}{line.split()[0]} 0\nf 1 2 3\n"))


def test_numbers_after_the_color_of_a_vertex_are_named(write):
    path = write("v 0 0 0 1 0 0\nv 1 0 0 1 0 0 0.5\nv 0 1 0 1 0 0 0.5\nf 1 2 3\n")
    with pytest.warns(UserWarning, match=r"not honored: line 2: numbers of v after the sixth$"):
        (mesh,) = load_meshes(path)
    assert mesh.colors.tolist() == [[1, 0, 0, 1]] * 3


def test_smoothing_groups_are_named_where_normals_are_missing(write):
    some = SQUARE + "vn 0 0 1\n{}\nf 1//1 2//1 3//1\n{}\nf {}\n"
    for first, second, face in (("s 1", "s 2", "1//1 3//1 4//1"), ("s off", "s 0", "1 3 4")):
        load_meshes(write(some.format(first, second, face)))
    with pytest.warns(UserWarning, match=r"not honored: line 8: s, of faces without normals$"):
        load_meshes(write(some.format("s off", "s 3", "1 3 4")))
    with pytest.warns(UserWarning, match=r"not honored: line 5: s, of faces without normals$"):
        load_meshes(write(SQUARE + "s 1\nf 1 2 3\n"))


def test_materials_without_a_material_file_are_named(write):
    path = write(SQUARE + "f 1 2 3\nusemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n")
    with pytest.warns(
        UserWarning, match=r"scene\.obj: names no material file for its materials 'a', 'b'; gray"
    ):
        load_meshes(path)
    load_mesh(path, Diffuse(0.5))


# ---- files that are no files ------------------------------------------------------------------


def test_missing_folder_extension(tmp_path):
    with pytest.raises(SceneError, match=r"no\.obj: there is no such file"):
        load(tmp_path / "no.obj")
    (tmp_path / "d.obj").mkdir()
    with pytest.raises(SceneError, match=r"d\.obj: is a folder"):
        load(tmp_path / "d.obj")
    for name in ("a.zip", "a.fbx", "a"):
        (tmp_path / name).write_text("x")
        with pytest.raises(
            SceneError, match=r"it must be one of \.obj, \.ply, \.stl, \.glb, \.gltf, \.off, \.dae, \.3mf"
        ):
            load(tmp_path / name)


@pytest.mark.parametrize("extension", ["ply", "stl", "glb", "gltf", "obj"])
def test_archives_are_refused_under_any_name(write, extension):
    with pytest.raises(SceneError, match="is an archive"):
        load_meshes(write(b"PK\x03\x04" + bytes(200), f"a.{extension}"))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes")
def test_pipes_and_devices_are_refused(tmp_path):
    os.mkfifo(tmp_path / "a.obj")
    with pytest.raises(SceneError, match="is a device or pipe"):
        load(tmp_path / "a.obj")
    (tmp_path / "b.stl").symlink_to("/dev/zero")
    with pytest.raises(SceneError, match="is a device or pipe"):
        load(tmp_path / "b.stl")


# ---- materials --------------------------------------------------------------------------------


def one(write, mtl, **kwargs):
    """Load a triangle with the material `m` of some MTL text."""
    path = write(f"mtllib s.mtl\n{SQUARE}usemtl m\nf 1 2 3\n", s_mtl=f"newmtl m\n{mtl}\n")
    (mesh,) = load_meshes(path, **kwargs)
    return mesh


def test_kd_and_ke(write):
    mesh = one(write, "Kd 0.1 0.2 0.3\nKe 4 5 6")
    assert isinstance(mesh.material.bsdf, Diffuse)
    assert mesh.material.bsdf.reflectance.ravel() == pytest.approx([0.1, 0.2, 0.3])
    assert mesh.emission.ravel().tolist() == [4, 5, 6]
    assert one(write, "Kd 0.1").emission is None
    assert one(write, "Ke 0 0 0").emission is None


@pytest.mark.parametrize("illum", [4, 6, 7, 9])
def test_glass(write, illum):
    mesh = one(write, f"Kd 1 1 1\nNi 1.33\nTf 0.5 1 1\nillum {illum}")
    assert isinstance(mesh.material.bsdf, Dielectric)
    assert mesh.material.bsdf.ior == pytest.approx(1.33)
    assert mesh.material.bsdf.transmittance.ravel() == pytest.approx([0.5, 1, 1])
    assert one(write, f"illum {illum}").material.bsdf.ior == pytest.approx(1.5)


@pytest.mark.parametrize("illum", [3, 5, 8])
def test_mirror(write, illum):
    mesh = one(write, f"Kd 0 0 0\nKs 0.9 0.8 0.7\nillum {illum}")
    assert isinstance(mesh.material.bsdf, Mirror)
    assert mesh.material.bsdf.reflectance.ravel() == pytest.approx([0.9, 0.8, 0.7])
    assert isinstance(one(write, f"Kd 1 1 1\nKs 0 0 0\nillum {illum}").material.bsdf, Diffuse)


@pytest.mark.parametrize(
    ("lines", "kind"),
    [
        ("d 1", Diffuse),
        ("Tr 0", Diffuse),
        ("Tr 1", Diffuse),  # MeshLab's way to say opaque
        ("d 1\nTr 1\nNi 1.5", Diffuse),
        ("d 1\nTr 0\nNi 1.5", Diffuse),
        ("d 0.1\nNi 1.5", Dielectric),
        ("Tr 0.9\nNi 1.5", Dielectric),
    ],
)
def test_opacity(write, lines, kind):
    assert type(one(write, f"Kd 0.5 0.5 0.5\n{lines}").material.bsdf) is kind


def test_colors_outside_their_range_are_clamped(write):
    with pytest.warns(
        UserWarning, match=r"s\.mtl line 2: Kd is 1\.5 -1 0\.5; clamped, as it must be in \[0, 1\]"
    ):
        mesh = one(write, "Kd 1.5 -1 0.5")
    assert mesh.material.bsdf.reflectance.ravel().tolist() == [1, 0, 0.5]
    with pytest.raises(SceneError, match=r"s\.mtl line 2: Kd"):
        one(write, "Kd 1.5 -1 0.5", strict=True)


def test_names_with_spaces_and_several_libraries(write):
    path = write(
        f"mtllib a b.mtl\nmtllib c.mtl\n{SQUARE}usemtl my red  \nf 1 2 3\nusemtl other\nf 1 3 4\n",
        **{"a b_mtl": "newmtl my red\nKd 1 0 0\n", "c_mtl": "newmtl\tother\nKd 0 1 0\n"},
    )
    red, other = load_meshes(path)
    assert red.material.bsdf.reflectance.ravel().tolist() == [1, 0, 0]
    assert other.material.bsdf.reflectance.ravel().tolist() == [0, 1, 0]


def test_a_missing_library_and_a_missing_material(write):
    with pytest.warns(UserWarning, match=r"scene\.obj: material file 'no\.mtl' is missing"):
        load_meshes(write(f"mtllib no.mtl\n{SQUARE}usemtl m\nf 1 2 3\n"))
    path = write(f"mtllib s.mtl\n{SQUARE}usemtl x\nf 1 2 3\n", s_mtl="newmtl m\n")
    named_once(path, r"scene\.obj: not in its material files: 'x'")


@pytest.mark.parametrize(
    "reference", ["../s.mtl", "/etc/hostname", "C:\\s.mtl", "http://example.org/s.mtl", "..\\s.mtl"]
)
def test_libraries_outside_the_folder_are_left_out(write, reference):
    path = write(f"mtllib {reference}\n{SQUARE}f 1 2 3\n")
    with pytest.warns(UserWarning, match=r"material file .*: scene\.obj: refers to .*; left out"):
        load_meshes(path)
    with pytest.raises(SceneError, match=r"material file .*: scene\.obj: refers to "):
        load_meshes(path, strict=True)


def test_a_library_behind_a_symlink_is_left_out(write, tmp_path):
    inside = tmp_path / "scene"
    inside.mkdir()
    (tmp_path / "s.mtl").write_text("newmtl m\n")
    (inside / "s.mtl").symlink_to(tmp_path / "s.mtl")
    (inside / "a.obj").write_text(f"mtllib s.mtl\n{SQUARE}f 1 2 3\n")
    with pytest.warns(UserWarning, match="outside its folder"):
        load_meshes(inside / "a.obj")


def test_a_library_in_a_folder_below(write, tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "s.mtl").write_text("newmtl m\nKd 1 0 0\n")
    (mesh,) = load_meshes(write(f"mtllib sub\\s.mtl\n{SQUARE}usemtl m\nf 1 2 3\n"))
    assert mesh.material.bsdf.reflectance.ravel().tolist() == [1, 0, 0]


# ---- PLY, STL, in memory ----------------------------------------------------------------------


# ---- vertex colors ---------------------------------------------------------------------------

CODES = np.array([[255, 0, 0], [0, 188, 0], [0, 0, 100], [10, 11, 12]])
LINEAR = np.where(CODES / 255 <= 0.04045, CODES / 255 / 12.92, ((CODES / 255 + 0.055) / 1.055) ** 2.4)


def colored_ply(colors, *properties):
    """A square with colors in ASCII PLY."""
    lines = ["ply", "format ascii 1.0", "element vertex 4", *(f"property float {x}" for x in "xyz")]
    lines += [*(f"property {p}" for p in properties), "element face 2"]
    lines += ["property list uchar int vertex_indices", "end_header"]
    places = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]
    lines += [f"{place} {' '.join(map(str, row))}" for place, row in zip(places, colors, strict=True)]
    return "\n".join([*lines, "3 0 1 2", "3 0 2 3", ""])


BYTES = ("uchar red", "uchar green", "uchar blue")


def test_ply_colors_are_srgb(write):
    (mesh,) = load_meshes(write(colored_ply(CODES, *BYTES), "a.ply"))
    assert mesh.colors == pytest.approx(np.column_stack([LINEAR, np.ones(4)]), rel=1e-5)
    assert isinstance(mesh.material.bsdf.reflectance, VertexColors)
    clear = np.column_stack([CODES, [0, 51, 102, 255]])
    with pytest.warns(UserWarning, match=r"a\.ply: not honored: opacity of vertex colors"):
        (mesh,) = load_meshes(write(colored_ply(clear, *BYTES, "uchar alpha"), "a.ply"))
    assert mesh.colors[:, 3].tolist() == [0, 0.2, 0.4, 1]
    floats = ("float red", "float green", "float blue")
    (mesh,) = load_meshes(write(colored_ply(CODES / 255, *floats), "a.ply"))
    assert mesh.colors[:, :3] == pytest.approx(LINEAR, rel=1e-5)


def test_ply_colors_show_beside_texture_coordinates(write, tmp_path):
    """But not beside a texture."""
    rows = np.column_stack([CODES, [0, 1, 1, 0], [0, 0, 1, 1]])
    text = colored_ply(rows, *BYTES, "float s", "float t")
    (mesh,) = load_meshes(write(text, "a.ply"), strict=True)
    assert mesh.colors[:, :3] == pytest.approx(LINEAR, rel=1e-5)
    assert mesh.uvs.tolist() == [[0, 0], [1, 0], [1, 1], [0, 1]]
    from PIL import Image

    Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / "b.png")
    path = write(text.replace("element vertex", "comment TextureFile b.png\nelement vertex"), "a.ply")
    (mesh,) = named_once(path, "not honored: vertex colors$")
    assert mesh.colors is None
    assert mesh.material.bsdf.reflectance.mean() == pytest.approx([1, 0, 0])


@pytest.mark.parametrize("kind", ["ushort", "int", "float"])
def test_ply_colors_of_other_types(write, kind):
    scale = {"ushort": 257, "int": 1, "float": 1 / 255}[kind]
    names = (f"{kind} {name}" for name in ("red", "green", "blue"))
    (mesh,) = load_meshes(write(colored_ply(CODES * scale, *names), "a.ply"), strict=True)
    assert mesh.colors[:, :3] == pytest.approx(LINEAR, rel=1e-5)


@pytest.mark.parametrize(
    ("vertex", "face", "tail", "named"),
    [
        (["float quality"], [], "", "not honored: quality of vertex"),
        ([], ["uchar flags"], "", "not honored: flags of face"),
        ([], [], "element edge 1\nproperty int vertex1\nproperty int vertex2\n", "not honored: element edge"),
        (
            ["int a", "int b"],
            ["int a"],
            "element x 1\nproperty int y\n",
            r"4 things[^:]*:\n.* a of vertex\n.* b of vertex\n.* a of face\n.* element x",
        ),
    ],
)
def test_what_is_not_read_of_ply_is_named_once(write, vertex, face, tail, named):
    lines = ["ply", "format ascii 1.0", "element vertex 3", *(f"property float {x}" for x in "xyz")]
    lines += [f"property {x}" for x in vertex] + ["element face 1", "property list uchar int vertex_indices"]
    lines += [f"property {x}" for x in face] + [*tail.splitlines(), "element none 0", "end_header"]
    lines += [f"{row}{' 7' * len(vertex)}" for row in ("0 0 0", "1 0 0", "0 1 0")] + [
        "3 0 1 2" + " 7" * len(face)
    ]
    lines += ["0 1"[: 2 * tail.count("property") - 1]] if tail else []
    path = write("\n".join([*lines, ""]), "a.ply")
    (mesh,) = named_once(path, rf"a\.ply: {named}$")
    assert np.array_equal(soup(mesh)[0], [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    load_mesh(path, Diffuse(0.5))


def obj_with_colors(colors=CODES / 255):
    places = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]
    rows = [f"v {place} {' '.join(map(str, row))}" for place, row in zip(places, colors, strict=True)]
    return "\n".join([*rows, ""])


def test_obj_colors_are_srgb(write):
    (mesh,) = load_meshes(write(obj_with_colors() + "f 1 2 3\nf 1 3 4\n"))
    assert mesh.colors == pytest.approx(np.column_stack([LINEAR, np.ones(4)]), rel=1e-5)
    material = "newmtl m\nKd 0.5 1 1\n"
    text = "mtllib s.mtl\n" + obj_with_colors() + "usemtl m\nf 1 2 3\n"
    (mesh,) = load_meshes(write(text, s_mtl=material))
    assert mesh.material.bsdf.reflectance.times.ravel().tolist() == [0.5, 1, 1]
    with pytest.warns(UserWarning, match=r"not honored: material 'm': vertex colors"):
        (mesh,) = load_meshes(write(text, s_mtl="newmtl m\nillum 4\n"))
    assert isinstance(mesh.material.bsdf, Dielectric)


def test_obj_colors_that_are_wanting_or_too_large_are_announced(write):
    some = obj_with_colors(CODES / 200)[:-1].rsplit(" ", 3)[0] + "\nf 1 2 3\nf 1 3 4\n"
    message = (
        r"1 vertex color is not finite, first: vertex 3; 1 in its place\n.*1 vertex color is outside \[0, 1\]"
    )
    with pytest.warns(UserWarning, match=message + ", first: vertex 0; clamped$"):
        (mesh,) = load_meshes(write(some))
    assert mesh.colors[0].tolist() == [1, 0, 0, 1]
    assert mesh.colors[3].tolist() == [1, 1, 1, 1]


def textured_ply(write, *comments):
    lines = ["ply", "format ascii 1.0", *(f"comment TextureFile {c}" for c in comments), "element vertex 4"]
    lines += [*(f"property float {x}" for x in "xyzst"), "element face 2"]
    lines += ["property list uchar int vertex_indices", "end_header"]
    lines += ["0 0 0 0 0", "1 0 0 1 0", "1 1 0 1 1", "0 1 0 0 1", "3 0 1 2", "3 0 2 3", ""]
    return write("\n".join(lines), "a.ply")


def textured_obj(write, *lines):
    text = "mtllib s.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    return write(text + "f 1/1 2/2 3/3 4/4\n", s_mtl="\n".join(["newmtl m", *lines]))


def textured_glb(write, image):
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=image, metallicFactor=0.0)
    corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    plane = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)
    plane.visual = trimesh.visual.TextureVisuals(uv=plane.vertices[:, :2], material=material)
    return write(plane.export(file_type="glb"), "a.glb")


@pytest.mark.parametrize(
    ("make", "least"),
    [
        (lambda write, _: textured_ply(write, "my tex.png"), 0.1),
        (lambda write, _: textured_obj(write, "map_Kd my tex.png"), 0.1),
        (lambda write, _: textured_obj(write, "Kd 0.5 1 0.25", "map_Kd my tex.png"), 0.05),
        (lambda write, _: textured_obj(write, "Pr 0.5"), 0.0),
        (lambda write, _: textured_obj(write, "Ks 0.5 1 0.25", "Ns 300", "map_Kd my tex.png"), 0.1),
        (textured_glb, 0.1),
    ],
    ids=["ply", "obj without Kd", "obj", "obj of no color", "glossy obj", "glb"],
)
def test_objects_in_memory_render_as_their_file(write, tmp_path, make, least):
    """Bit for bit; `least` is how far the pixels differ in each channel."""
    from PIL import Image

    image = Image.fromarray(np.random.default_rng(0).integers(0, 256, (4, 4, 3), np.uint8))
    image.save(tmp_path / "my tex.png")
    path = make(write, image)
    camera = Camera.look_at((0.5, 0.5, 3), (0.5, 0.5, 0), fov=25, size=(8, 8))
    a, b = (
        render(Scene(scene.shapes, [Environment(1.0)], camera), 2, workers=1, progress=False).rgb
        for scene in (load(path), from_trimesh(trimesh.load(path, process=False)))
    )
    assert np.array_equal(a, b)
    assert a.max() > 0.4
    assert np.ptp(a, axis=(0, 1)).min() >= least


def test_textures_of_ply(write, tmp_path):
    from PIL import Image

    with pytest.warns(UserWarning, match=r"a\.ply: texture 'b\.png' is missing"):
        (mesh,) = load_meshes(textured_ply(write, "b.png"))
    assert isinstance(mesh.material.bsdf, Diffuse)
    Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / "b.png")
    with pytest.warns(UserWarning, match=r"several textures; 'b\.png' is taken for all faces"):
        (mesh,) = load_meshes(textured_ply(write, "a.png", "b.png"))
    assert mesh.material.bsdf.reflectance.mean() == pytest.approx([1, 0, 0])
    assert load_mesh(textured_ply(write, "b.png"), Diffuse(0.25)).material.bsdf.reflectance[0] == 0.25
    for name in ("../b.png", "C:\\\\author\\\\b.png", "/home/author/b.png", "./textures/B.PNG"):
        with pytest.warns(UserWarning, match=r"a\.ply: the file '.*' is missing; 'b\.png' in its place"):
            (mesh,) = load_meshes(textured_ply(write, name))
        assert mesh.material.bsdf.reflectance.mean() == pytest.approx([1, 0, 0])
    for name in ("../c.png", "/etc/passwd"):
        with pytest.warns(UserWarning, match=r"texture '.*': a\.ply: refers to .*; gray in its place"):
            (mesh,) = load_meshes(textured_ply(write, name))
        assert mesh.material is None or mesh.material.bsdf.reflectance.ravel().tolist() == [0.5] * 3
    (tmp_path / "b.png").write_bytes(b"\x89PNG")
    with pytest.warns(UserWarning, match=r"a\.ply: texture 'b\.png': b\.png: not a readable image: .*; gray"):
        load_meshes(textured_ply(write, "b.png"))


def painted_ply(rows, faces, *properties, extra=()):
    lines = ["ply", "format ascii 1.0", "element vertex 4", *(f"property float {x}" for x in "xyz"), *extra]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    lines += [f"property uchar {x}" for x in (*properties, "red", "green", "blue")]
    return "\n".join([*lines, "end_header", *rows, *faces, ""])


PLACES = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]


def test_face_colors_are_those_of_all_corners(write):
    (mesh,) = load_meshes(write(painted_ply(PLACES, ["3 0 1 2 255 188 0", "3 0 2 3 0 0 51"]), "a.ply"))
    assert np.array_equal(soup(mesh)[1], [[0, 0, 0], [1, 1, 0], [0, 1, 0]])
    green, blue = ((np.array([188, 51]) / 255 + 0.055) / 1.055) ** 2.4
    expected = [[[1, green, 0, 1]], [[0, 0, blue, 1]]]
    assert soup(mesh, mesh.colors) == pytest.approx(np.repeat(expected, 3, 1), rel=1e-6)
    assert isinstance(mesh.material.bsdf.reflectance, VertexColors)


def test_colors_of_faces_show_beside_vertices_that_are_all_white(write):
    white = [f"{row} 255 255 255" for row in PLACES]
    extra = [f"property uchar {x}" for x in ("red", "green", "blue")]
    faces = ["3 0 1 2 255 0 0", "3 0 2 3 0 255 0"]
    path = write(painted_ply(white, faces, extra=extra), "a.ply")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (mesh,) = load_meshes(path, strict=True)
        (held,) = from_trimesh(trimesh.load(path, process=False)).shapes
    for found in (mesh, held):
        assert soup(found, found.colors).tolist() == [[[1, 0, 0, 1]] * 3, [[0, 1, 0, 1]] * 3]
    white[0] = f"{PLACES[0]} 0 0 255"  # a real color: those of the vertices count
    with pytest.warns(UserWarning, match="not honored: face colors"):
        (mesh,) = load_meshes(write(painted_ply(white, faces, extra=extra), "a.ply"))
    assert soup(mesh, mesh.colors)[0].tolist() == [[0, 0, 1, 1], [1, 1, 1, 1], [1, 1, 1, 1]]


def test_face_colors_survive_faces_that_do_not(write):
    faces = ["3 0 1 1 255 0 0", "3 0 1 2 0 255 0", "3 0 1 7 9 9 9", "2 0 1 9 9 9", "3 0 2 3 0 0 255"]
    path = write(painted_ply(PLACES, faces), "a.ply")
    for message in (
        "1 face of zero area",
        "1 row of face with a vertex beyond the 4, first: line 19; left out",
        "1 row of face with fewer than 3 corners, first: line 20; left out",
    ):
        (mesh,) = named_once(path, message)
    assert soup(mesh, mesh.colors)[:, :, 1:3].tolist() == [[[1, 0]] * 3, [[0, 1]] * 3]


@pytest.mark.parametrize("extra", [[], ["s", "t"]])
def test_face_colors_of_polygons(write, extra):
    rows = [f"{row} 0 1" if extra else row for row in PLACES]
    faces = ["4 0 1 2 3 255 0 0", "3 0 1 2 0 255 0"]
    text = painted_ply(rows, faces, extra=[f"property float {x}" for x in extra])
    (mesh,) = load_meshes(write(text, "a.ply"), strict=True)
    assert soup(mesh, mesh.colors)[:, 0, :2].tolist() == [[0, 1], [1, 0], [1, 0]]
    assert (mesh.uvs is not None) == bool(extra)


def test_face_colors_beside_those_of_vertices_are_named(write):
    rows = [f"{row} 9 9 9" for row in PLACES]
    extra = [f"property uchar {x}" for x in ("red", "green", "blue")]
    text = painted_ply(rows, ["3 0 1 2 255 0 0"], extra=extra)
    (mesh,) = named_once(write(text, "a.ply"), r"a\.ply: not honored: face colors$")
    assert soup(mesh, mesh.colors)[0, 0] == pytest.approx([(9 / 255) / 12.92] * 3 + [1])


def test_load_mesh_keeps_colors_and_the_second_uvs(write):
    mesh = load_mesh(write(obj_with_colors() + "f 1 2 3\nf 1 3 4\n"))
    assert mesh.colors[:, :3] == pytest.approx(LINEAR, rel=1e-5)
    assert isinstance(mesh.material.bsdf.reflectance, VertexColors)
    assert load_mesh(write(obj_with_colors() + "f 1 2 3\n"), Diffuse(0.5)).colors is not None


def test_from_trimesh_takes_normals_that_are_there():
    flat, smooth = trimesh.creation.icosphere(1), trimesh.creation.icosphere(1)
    tilted = smooth.vertices + np.array([0, 0, 0.5])
    smooth.vertex_normals = tilted / np.linalg.norm(tilted, axis=1, keepdims=True)
    assert from_trimesh(flat, smooth=False).shapes[0].normals is None
    assert from_trimesh(smooth).shapes[0].normals == pytest.approx(smooth.vertex_normals)


def test_several_materials_of_one_trimesh_object_are_named():
    box = trimesh.creation.box()
    parts = [trimesh.visual.material.SimpleMaterial(diffuse=[255, 0, 0])] * 2
    material = trimesh.visual.material.MultiMaterial(parts)
    box.visual = trimesh.visual.TextureVisuals(uv=np.zeros((8, 2)), material=material)
    with pytest.warns(UserWarning, match=r"trimesh object: not honored: mesh '': MultiMaterial") as record:
        from_trimesh(box)
    assert len(record) == 1


def test_from_trimesh_refuses_other_things():
    with pytest.raises(SceneError, match=r"expected a trimesh\.Trimesh or trimesh\.Scene, got list"):
        from_trimesh([1, 2])
    with pytest.raises(SceneError, match="has no faces"):
        from_trimesh(trimesh.Scene())


def ply(count, body, extra=""):
    xyz = "property float x\nproperty float y\nproperty float z\n"
    return (
        f"ply\nformat ascii 1.0\nelement vertex 3\n{xyz}{extra}"
        f"element face {count}\nproperty list uchar int vertex_indices\nend_header\n{body}"
    )


def test_ply(write):
    (mesh,) = load_meshes(write(ply(1, "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), "a.ply"))
    assert np.array_equal(soup(mesh)[0], [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    normals = "property float nx\nproperty float ny\nproperty float nz\n"
    (mesh,) = load_meshes(write(ply(1, "0 0 0 0 0 1\n1 0 0 0 0 1\n0 1 0 0 1 0\n3 0 1 2\n", normals), "a.ply"))
    assert np.array_equal(mesh.normals, [[0, 0, 1], [0, 0, 1], [0, 1, 0]])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (ply("8²", "").encode("latin-1"), r"a\.ply line 7: 'element face 8²' is not part of a PLY header"),
        (ply("x", ""), r"a\.ply line 7: 'element face x' is not part of a PLY header"),
        (ply(1, "").replace("uchar int", "quad int"), r"a\.ply line 8: .* is not part of a PLY header"),
        (ply(1, "").replace("uchar int", "uchar quad"), r"a\.ply line 8"),
        (ply(1, "").replace("uchar int", "float int"), r"a\.ply line 8"),
        ("ply\nformat ascii 1.0\n", r"a\.ply: not a PLY file: its header is damaged"),
        ("hello", r"a\.ply: not a PLY file"),
        (ply(1, "0 0 0\n1 0 0\n0 1 0\n2 0 1\n"), r"has no faces:\s+1 row of face with fewer than 3 corners"),
        (ply(1, "0 0 0\n1 0"), r"has no faces:\s+the last 1 row of vertex; missing"),
        (ply(1, "0 0 0\n").replace("vertex 3", "thing 3"), r"a\.ply: has no faces"),
        (ply(1, "0\n").replace("property float y\n", ""), r"a\.ply: has no faces"),
    ],
)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_ply_without_a_mesh(write, data, message):
    with pytest.raises(SceneError, match=message):
        load_meshes(write(data, "a.ply"))


ROW = "0 0 0\n1 0 0\n0 1 0\n{}3 0 1 2\n"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (
            ply(2, ROW.format("3 0 1 9\n")),
            "1 row of face with a vertex beyond the 3, first: line 13; left out",
        ),
        (ply(2, ROW.format("3 0 -1 2\n")), "1 row of face with a vertex beyond the 3"),
        (ply(2, ROW.format("3 0 1.5 2\n")), "1 row of face with a vertex beyond the 3"),
        (ply(2, ROW.format("3 0 x 2\n")), "1 row of face with a vertex beyond the 3"),
        (ply(2, ROW.format("3 0 1\n")), "1 row of face with too few or malformed words, first: line 13"),
        (ply(2, ROW.format("x 0 1 2\n")), "1 row of face with too few or malformed words"),
        (ply(2, ROW.format("-3 0 1 2\n")), "1 row of face with too few or malformed words"),
        (ply(3, ROW.format("2 0 1\n1 0\n")), "2 rows of face with fewer than 3 corners, first: line 13"),
        (ply(2, ROW.format("")), "the last 1 row of face; missing, as the file ends before$"),
        (ply(10**12, ROW.format("")), "the last 999999999999 rows of face; missing"),
        (
            ply(1, ROW.format("")[:-1] + " 7\n"),
            "1 row of face with more words, first: line 13; these are not",
        ),
        (
            ply(1, ROW.format("").replace("1 0 0", "1 0 0 5")),
            "1 row of vertex with more words, first: line 11",
        ),
        (
            ply(1, ROW.format("2 2\n")).replace("vertex 3", "vertex 4"),
            "1 row of vertex with too few or malformed words, first: line 13; left out",
        ),
    ],
)
def test_damaged_rows_of_ply_are_left_out(write, data, message):
    (mesh,) = named_once(write(data, "a.ply"), message)
    assert soup(mesh).tolist() == [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]


@pytest.mark.parametrize("row", ["2 2", "2 2 x", "2 nan 0", "2_0 0 0"])
def test_faces_of_damaged_vertices_of_ply_are_left_out(write, row):
    text = ply(2, ROW.format(f"{row}\n3 0 1 3\n")).replace("vertex 3", "vertex 4")
    (mesh,) = named_once(write(text, "a.ply"), "1 face with a vertex that is not finite or beyond float32")
    assert soup(mesh).tolist() == [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]


@pytest.mark.parametrize("first", [["uchar flags"], ["list uchar float more", "int other"]])
def test_properties_before_the_list_of_a_text(write, first):
    words = "7 " if len(first) == 1 else "2 .5 .5 7 "
    text = ply(2, ROW.format(f"{words}4 0 1 2 2\n").replace("3 0 1 2", f"{words}3 2 1 0"))
    properties = "".join(f"property {each}\n" for each in first)
    path = write(text.replace("property list uchar int", f"{properties}property list uchar int"), "a.ply")
    (mesh,) = named_once(path, f"not honored: {first[-1].split()[-1]} of face")
    assert soup(mesh)[:, :, 0].tolist() == [[0, 1, 0], [0, 1, 0]]
    assert soup(mesh)[:, 0, 1].tolist() == [1, 0]


def test_texture_coordinates_of_corners_of_ply(write):
    rows = "4 0 1 2 3 8 0 0 1 0 1 1 0 1\n3 0 1 2 6 .5 .5 1 0 1 1\n3 2 1 0 2 9 9\n"
    text = ply(3, "0 0 0\n1 0 0\n1 1 0\n0 1 0\n" + rows).replace("vertex 3", "vertex 4")
    text = text.replace("vertex_indices\n", "vertex_indices\nproperty list uchar float texcoord\n")
    path = write(text, "a.ply")
    message = "1 row of face with texture coordinates that do not fit the corners, first: line 17; 0 in place"
    (mesh,) = named_once(path, message)
    assert soup(mesh, mesh.uvs).tolist() == [
        [[0.5, 0.5], [1, 0], [1, 1]],
        [[0, 0]] * 3,
        [[0, 0], [1, 0], [1, 1]],
        [[1, 1], [0, 1], [0, 0]],
    ]


CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0]], np.float32)


def binary_ply(rows, order="<", kind="face", before=(), after=(), length="uchar"):
    """A PLY file whose lists have any lengths; `before` and `after` are float properties of value 7."""
    name = {"<": "little", ">": "big"}[order]
    lines = ["ply", f"format binary_{name}_endian 1.0", f"element vertex {len(CORNERS)}"]
    lines += [*(f"property float {x}" for x in "xyz"), f"element {kind} {len(rows)}"]
    lines += [*(f"property float {x}" for x in before), f"property list {length} int vertex_indices"]
    lines += [*(f"property float {x}" for x in after), "end_header", ""]
    size = {"uchar": "B", "int": "i"}[length]
    packed = [
        struct.pack(
            f"{order}{len(before)}f{size}{len(row)}i{len(after)}f",
            *[7.0] * len(before), len(row), *row, *[7.0] * len(after),
        )
        for row in rows
    ]  # fmt: skip
    return "\n".join(lines).encode() + CORNERS.astype(order + "f4").tobytes() + b"".join(packed)


@pytest.mark.parametrize("order", "<>")
def test_polygons_of_several_sizes_in_a_binary_ply(write, order):
    (mesh,) = load_meshes(write(binary_ply([(0, 1, 3, 2), (2, 3, 4)], order), "a.ply"))
    found = {tuple(face) for face in mesh.faces.tolist()}
    assert found == {(0, 1, 3), (3, 2, 0), (2, 3, 4)}
    assert np.array_equal(mesh.vertices, CORNERS)
    # as long together as three quads would be, so that trimesh would read three of them
    rows = [(0, 1, 3, 2), (2, 3, 4), (1, 3, 4, 2, 0)]
    path = write(binary_ply(rows, order, before=["a"], after=["red"]), "a.ply")
    (mesh,) = named_once(path, r"not honored: a of face\n  not honored: red of face$")
    assert len(mesh.faces) == 6


STRIPS = [(0, 1, 2, 3, 4), (2, 1, 0, -1, 4, 3, 2), (0, 1, 1, 2, 3)]
UNROLLED = [[0, 1, 2], [2, 1, 3], [2, 3, 4], [2, 1, 0], [4, 3, 2], [1, 2, 3]]


@pytest.mark.parametrize("order", ["<", ">", "text"])
def test_triangle_strips_of_ply(write, order):
    if order == "text":
        text = "ply\nformat ascii 1.0\nelement vertex 5\n" + "".join(f"property float {x}\n" for x in "xyz")
        text += "element tristrips 3\nproperty list int int vertex_indices\nend_header\n"
        text += "".join("{} {} {}\n".format(*corner) for corner in CORNERS)
        data = text + "".join(f"{len(strip)} {' '.join(map(str, strip))}\n" for strip in STRIPS)
    else:
        data = binary_ply(STRIPS, order, "tristrips", length="int")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (mesh,) = load_meshes(write(data, "a.ply"), strict=True)
    assert np.array_equal(mesh.faces, UNROLLED)
    assert np.array_equal(mesh.vertices, CORNERS)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (
            binary_ply([(0, 1, 2), (0, 1)]),
            "1 row of face with fewer than 3 corners, first: face 1; left out$",
        ),
        (
            binary_ply([(0, 1, 2), (0, 1, 2, 3)])[:-1],
            "the last 1 row of face; missing, as the file ends before$",
        ),
        (
            binary_ply([(0, 1, 9, 3), (0, 1, 2)]),
            "1 row of face with a vertex beyond the 5, first: face 0; left",
        ),
        (binary_ply([(0, 1, 2)] * 2)[:-1], "the last 1 row of face; missing"),
        (
            binary_ply([(0, 1, 2), (2, 2)], length="int")[:-12] + b"\xff" * 12,
            "the last 1 row of face; missing",
        ),
    ],
)
def test_damaged_polygons_of_ply(write, data, message):
    (mesh,) = named_once(write(data, "a.ply"), message)
    assert mesh.faces.tolist() == [[0, 1, 2]]


def test_faces_and_strips_of_ply(write):
    data = binary_ply([(0, 1, 2)]).replace(
        b"end_h", b"element tristrips 2\nproperty list uchar int vertex_indices\nend_h"
    )
    strips = struct.pack("<B4iB3i", 4, 0, 1, 2, 3, 3, 0, 1, 9)
    (mesh,) = named_once(write(data + strips, "a.ply"), "1 row of tristrips with a vertex beyond the 5")
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 1, 2], [2, 1, 3]]


def stl(count, faces):
    return bytes(80) + struct.pack("<I", count) + b"".join(struct.pack("<12fH", *f, 0) for f in faces)


FACET = (0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0)


def test_stl(write):
    (mesh,) = load_meshes(write(stl(1, [FACET]), "a.stl"))
    assert np.array_equal(soup(mesh)[0], [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert mesh.normals is None


@pytest.mark.parametrize(
    ("header", "extra", "named"),
    [
        (b"COLOR=\xff\x00\x00\xff", [0, 0], "COLOR= in the header"),
        (b"exported", [0, 0x801F], r"colors of facets \(facet 1\)"),
        (b"COLOR=abcd,MATERIAL=abcdefghijkl", [3, 0], r"COLOR= .*\n.*: MATERIAL= .*\n.*: colors of facets.*"),
    ],
)
def test_colors_of_stl_are_named_once(write, header, extra, named):
    facets = b"".join(struct.pack("<12fH", *FACET, color) for color in extra)
    path = write(header.ljust(80) + struct.pack("<I", len(extra)) + facets, "a.stl")
    (mesh,) = named_once(path, rf"a\.stl: (.*\n  )?not honored: {named}$")
    assert len(mesh.faces) == 2


def test_stl_as_text(write):
    facet = (
        "facet normal 0 0 1\n outer loop\n  vertex 0 0 {0}\n  VERTEX 1 0 {0}\n  vertex 0 1e0 {0}\n"
        " endloop\nendfacet\n"
    )
    text = (
        f"solid one\n{facet.format(0)}{facet.format(1)}endsolid one\nsolid two\n{facet.format(2)}endsolid\n"
    )
    one, two = load_meshes(write(text, "a.stl"))
    assert (one.name, two.name) == ("one", "two")
    assert np.array_equal(soup(one)[1], [[0, 0, 1], [1, 0, 1], [0, 1, 1]])
    assert np.array_equal(soup(two)[0], [[0, 0, 2], [1, 0, 2], [0, 1, 2]])


def test_stl_with_tabs_and_names_of_keywords(write):
    lines = ["solid\tvertex normal solid", "facet\tnormal 0 0 1", "\touter loop", *["vertex\t0 0\t0"]]
    lines += ["\tvertex\t1 0 0", "vertex 0\t1 0\t", "endloop", "\tendfacet", "endsolid\tvertex", ""]
    (mesh,) = load_meshes(write("\r\n".join(lines), "a.stl"))
    assert mesh.name == "vertex normal solid"
    assert np.array_equal(soup(mesh)[0], [[0, 0, 0], [1, 0, 0], [0, 1, 0]])


def test_a_binary_stl_may_say_solid(write):
    (mesh,) = load_meshes(write(b"solid" + stl(1, [FACET])[5:], "a.stl"))
    assert len(mesh.faces) == 1


TEXT = "solid a\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n{}\nendsolid\n"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (stl(2**32 - 1, [FACET]), "the number of facets is 4294967295, but the file has 134 bytes; 1 read$"),
        (stl(2, [FACET, FACET])[:-1], "the number of facets is 2, but the file has 183 bytes; 1 read$"),
        (b"solid" + stl(2, [FACET, FACET])[5:-1], "the number of facets is 2, but the file has 183 bytes"),
        (stl(0, [FACET]), "the number of facets is 0, but the file has 134 bytes; 1 read$"),
        (stl(1, [FACET]) + b"\r\n", "the number of facets is 1, but the file has 136 bytes; 1 read$"),
        (TEXT.format("vertex 0 0 0"), "line 5: facet is 1 vertex; left out$"),
        (TEXT.format("facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nendloop"), "is 2 vertices"),
        (
            TEXT.format("vertex 0 0 0\nvertex 1 0\nvertex 0 1 0"),
            "1 face with a vertex .* first: line 5; left",
        ),
        (TEXT.format("vertex 0 0 0\nvertex 1 0 x\nvertex 0 1 0"), "vertex is '1 0 x'; its facet is left out"),
        (TEXT.format("VERTEX 0 0 0\nvertex 1 0 0 7\nvertex 0 1 0"), "vertex is '1 0 0 7'; its facet is left"),
        (TEXT.format("hello"), "line 5: the text is 'hello'; left out$"),
        (TEXT.format("").replace("endsolid\n", ""), "endsolid is missing; the text ends early$"),
    ],
)
def test_damaged_stl(write, data, message):
    (mesh,) = named_once(write(data, "a.stl"), message)
    assert soup(mesh).tolist() == [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"\0" * 50, r"a\.stl: has 50 bytes; a binary STL has at least 84"),
        (stl(0, []), r"a\.stl: has no faces$"),
        (
            "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n",
            r"has no faces:\s+line 4: facet is 1 vertex",
        ),
        ("solid a\nhello\nendsolid\n", r"a\.stl: has no faces:\s+line 2: the text is 'hello'; left out"),
    ],
)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_stl_without_a_mesh(write, data, message):
    with pytest.raises(SceneError, match=message):
        load_meshes(write(data, "a.stl"))


# ---- load_mesh --------------------------------------------------------------------------------


def test_load_mesh_joins_and_places(write):
    text = f"mtllib s.mtl\n{SQUARE}usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n"
    path = write(text, s_mtl="newmtl a\nnewmtl b\n")
    glass = Dielectric(1.5)
    matrix = np.array([[0, -2, 0, 5], [2, 0, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1.0]])
    mesh = load_mesh(path, glass, matrix)
    assert mesh.material.bsdf is glass
    assert mesh.emission is None
    assert mesh.name == "scene"
    assert np.array_equal(soup(mesh)[0], [[5, 0, 0], [5, 2, 0], [3, 2, 0]])
    assert len(mesh.faces) == 2


def test_load_mesh_without_material_takes_the_file_s(write):
    path = write(f"mtllib s.mtl\n{SQUARE}usemtl m\nf 1 2 3\n", s_mtl="newmtl m\nKd 1 0 0\nKe 2 2 2\n")
    mesh = load_mesh(path)
    assert mesh.material.bsdf.reflectance.ravel().tolist() == [1, 0, 0]
    assert mesh.emission.ravel().tolist() == [2, 2, 2]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert load_mesh(path, Diffuse(0.25)).emission is None


def test_load_mesh_asks_which_material(write):
    path = write(
        f"mtllib s.mtl\n{SQUARE}usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n",
        s_mtl="newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 1 0\n",
    )
    with pytest.raises(SceneError, match=r"has 2 materials; pass one, or use wf\.load"):
        load_mesh(path)


def test_load_mesh_turns_normals(write):
    path = write(SQUARE + "vn 0.6 0 0.8\nf 1//1 2//1 3//1\n")
    mesh = load_mesh(path, transform=np.diag([2.0, 1, 1, 1]))
    expected = np.array([0.3, 0, 0.8]) / np.hypot(0.3, 0.8)
    assert mesh.normals == pytest.approx(np.tile(expected, (3, 1)))
    mirrored = load_mesh(path, transform=np.diag([-1.0, 1, 1, 1]))
    a, b, c = soup(mirrored)[0]
    assert np.cross(b - a, c - a)[2] > 0
    assert mirrored.normals[0] == pytest.approx([-0.6, 0, 0.8])


@pytest.mark.parametrize(
    ("transform", "message"),
    [
        (np.eye(3), r"transform must have shape \(4, 4\), got \(3, 3\)"),
        (np.full((4, 4), np.nan), r"transform\[0\]\[0\] is nan"),
        (np.diag([1.0, 1, 0, 1]), "transform is singular"),
        (np.diag([1.0, 1, 1, 2]), "last row"),
    ],
)
def test_load_mesh_refuses_transforms(write, transform, message):
    with pytest.raises(SceneError, match=message):
        load_mesh(write(SQUARE + "f 1 2 3\n"), transform=transform)


# ---- real files -------------------------------------------------------------------------------


def test_load_mesh_keeps_normals_that_only_some_parts_have(write):
    """The others get those of their facets."""
    faces = "usemtl a\nf 1//1 2//1 3//1\nusemtl b\nf 1 3 4\n"
    path = write("mtllib s.mtl\n" + SQUARE + "vn 0 1 1\n" + faces, s_mtl="newmtl a\nnewmtl b\n")
    mesh = load_mesh(path, Diffuse(0.5), strict=True)
    tilted, flat = mesh.normals[mesh.faces].tolist()
    assert tilted == [pytest.approx([0, 0.5**0.5, 0.5**0.5])] * 3
    a, b, c = mesh.vertices[mesh.faces[1]]
    normal = np.cross(b - a, c - a)
    assert flat == [pytest.approx(normal / np.linalg.norm(normal))] * 3
