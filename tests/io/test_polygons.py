"""Polygons of files as triangles: concave ones, with holes, bent, degenerate, in every format."""

import struct
import warnings

import numpy as np
import pytest
from inside import fans, fans_by_size, from_pyvista, load, load_mesh, triangulate, turned_fans

L = [(-1, -1), (1, -1), (1, 0), (0, 0), (0, 1), (-1, 1)]
DART = [(-1, -1), (0, -0.5), (1, -1), (0, 1)]
RING = [(-0.5, -0.5), (-0.5, 0.5), (0.5, 0.5), (0.5, -0.5)]
SQUARE = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
WALL = [*SQUARE, SQUARE[0], *RING, RING[0]]  # a window, joined to the wall by a seam
COMB = [(0, 0), (7, 0), *((x, y) for x in range(7, 0, -1) for y in ((1, 3) if x % 2 else (3, 1))), (0, 1)]
SPIRAL = [(0, 0), (5, 0), (5, 5), (1, 5), (1, 2), (3, 2), (3, 3), (2, 3), (2, 4), (4, 4), (4, 1), (0, 1)]
TURNS = [np.linalg.matrix_power(np.array([[0, 1], [-1, 0]]), k) for k in range(4)]
POLYGONS = {"L": L, "dart": DART, "wall": WALL, "comb": COMB, "spiral": SPIRAL}


def area(polygon):
    """The signed area of a plane polygon."""
    x, y = np.array(polygon, float).T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)


def areas(points, triangles):
    """Twice their area as vectors (m, 3)."""
    a, b, c = (np.asarray(points)[triangles[:, i]] for i in range(3))
    return np.cross(b - a, c - a)


def covered(points, triangles, at):
    """How many triangles lie over points (n, 2) of the plane."""
    a, b, c = (np.asarray(points)[triangles[:, i]][:, None, :2] for i in range(3))
    sides = [
        (q - p)[..., 0] * (at - p)[..., 1] - (q - p)[..., 1] * (at - p)[..., 0]
        for p, q in ((a, b), (b, c), (c, a))
    ]
    return (np.sign(sides[0]) == np.sign(sides[1])) & (np.sign(sides[1]) == np.sign(sides[2]))


def cut(points, order=fans):
    """Triangulate one polygon."""
    points = np.array([(*point, 0)[:3] for point in points], float)
    return points, triangulate(points, np.arange(len(points)), np.array([len(points)]), order).corner


@pytest.mark.parametrize("name", POLYGONS)
@pytest.mark.parametrize("begin", [0, 1, 3])
@pytest.mark.parametrize("backwards", [False, True])
def test_concave_polygons_are_covered_once(name, begin, backwards):
    """From every first corner, with the winding of the polygon."""
    polygon = POLYGONS[name][begin:] + POLYGONS[name][:begin]
    points, triangles = cut(polygon[::-1] if backwards else polygon)
    found = areas(points, triangles)[:, 2] / 2 * (-1 if backwards else 1)
    assert (found > 0).all()
    assert found.sum() == pytest.approx(area(polygon))
    at = np.random.default_rng(0).uniform(-1, 7, (2000, 2))
    assert covered(points, triangles, at).sum(0).max() == 1


@pytest.mark.parametrize("name", POLYGONS)
def test_polygons_in_any_plane_far_from_the_origin(name):
    rng = np.random.default_rng(1)
    for _ in range(5):
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        flat, _ = cut(POLYGONS[name])
        points = flat @ turn.T * 0.1 + rng.normal(size=3) * 1e5
        triangles = cut(points)[1]
        found = areas(points, triangles) @ turn[:, 2] * np.linalg.det(turn) / 0.02 * np.linalg.det(turn)
        assert (found > -1e-8).all()  # positions are rounded to 1e-10 of the polygon
        assert found.sum() == pytest.approx(area(POLYGONS[name]), rel=1e-6)


def test_polygons_that_are_bent():
    """They are seen along their mean normal."""
    height = np.random.default_rng(2).uniform(-0.2, 0.2, len(SPIRAL))
    points, triangles = cut([(x, y, z) for (x, y), z in zip(SPIRAL, height, strict=True)])
    found = areas(points, triangles)[:, 2] / 2
    assert (found > 0).all()
    assert found.sum() == pytest.approx(area(SPIRAL))


@pytest.mark.parametrize("counts", [[3, 3], [4, 4], [5], [3, 4, 5, 4, 3, 7], []])
def test_convex_polygons_are_fans(counts):
    """In the order of each reader, also with corners that are on a line but for rounding."""
    corner = [(np.cos(t), np.sin(t), 0) for n in counts for t in np.arange(n) * 2 * np.pi / n]
    points = np.array(corner, np.float32).reshape(-1, 3).astype(float)
    for order in (fans, turned_fans, fans_by_size):
        found = triangulate(points, np.arange(len(points)), np.array(counts, int), order)
        assert np.array_equal(found.corner, order(np.array(counts, int)).corner)
    assert [tuple(row) for row in fans(np.array([4])).corner] == [(0, 1, 2), (0, 2, 3)]
    assert [tuple(row) for row in turned_fans(np.array([4])).corner] == [(0, 1, 2), (2, 3, 0)]
    assert fans_by_size(np.array([5, 4, 3, 4])).polygon.tolist() == [2, 1, 3, 1, 3, 0, 0, 0]


def test_a_circle_of_float32_stays_a_fan():
    angles = np.arange(2048) * 2 * np.pi / 2048
    points = (np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1) + 3).astype(np.float32).astype(float)
    found = triangulate(points, np.arange(2048), np.array([2048]))
    assert np.array_equal(found.corner, fans(np.array([2048])).corner)


def test_corners_on_a_line_but_for_rounding_stay_in_a_fan():
    """Those of float32 are up to 1e-7 of the size on either side of it."""
    side = np.linspace(-1, 1, 17)[:-1]
    square = np.concatenate([np.stack([side, 0 * side - 1], 1) @ turn for turn in TURNS])
    turn = np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]])
    points = np.pad((square @ turn).astype(np.float32), ((0, 0), (0, 1))).astype(float)
    points = np.roll(points, 5, 0)
    bent = areas(points, fans(np.array([64])).corner)[:, 2]
    assert bent.min() < 0  # which counts as 0
    found = triangulate(points, np.arange(64), np.array([64]))
    assert set(map(tuple, found.corner)) <= set(map(tuple, fans(np.array([64])).corner))


@pytest.mark.parametrize(
    ("polygon", "expected"),
    [
        ([(0, 0), (1, 0), (2, 0), (2, 2)], [[0, 2, 3]]),  # corners on a line
        ([(0, 0), (1, 0), (1, 1), (1, 1), (0, 1)], [[0, 1, 2], [0, 3, 4]]),  # one corner twice
        ([(0, 0), (1, 0), (1, 0), (0, 1)], [[0, 2, 3]]),
        (
            [(0, 0), (1, 0), (2, 0), (3, 0)],
            [[0, 1, 2], [0, 2, 3]],
        ),  # without an area; dropped where meshes are built
        ([(0, 0), (1, 0), (0, 1), (1, 1)], [[0, 1, 2], [0, 2, 3]]),  # crosses itself
        ([(0, 0), (np.nan, 0), (1, 1), (0.2, 0.1), (0, 1)], [[1, 1, 1]]),  # left out as a whole
        ([(0, 0), (0, np.inf), (1, 1e39), (1, 1)], [[1, 1, 1]]),
    ],
)
def test_degenerate_polygons(polygon, expected):
    assert cut(polygon)[1].tolist() == expected


def test_a_star_that_crosses_itself_has_no_error():
    star = [(np.cos(t), np.sin(t)) for t in np.arange(5) * 4 * np.pi / 5]
    points, triangles = cut(star)
    assert (areas(points, triangles)[:, 2] > 0).all()


def test_holes_are_left_out():
    points = np.array([(x, y, 0) for x, y in SQUARE * 3], float)
    found = triangulate(points, np.arange(12), np.array([4, 4, 4]), holes=np.array([1, 7]))
    assert found.polygon.tolist() == [0, 0, 2, 2]


# ---- in files ---------------------------------------------------------------------------------


def obj(polygons):
    corners = [corner for polygon in polygons for corner in polygon]
    numbers = iter(range(1, len(corners) + 1))
    faces = [" ".join(f"{i}/{i}/1" for _, i in zip(polygon, numbers, strict=False)) for polygon in polygons]
    rows = [f"v {x} {y} 0\nvt {x} {y}" for x, y in corners]
    return "\n".join([*rows, "vn 0 0 1", *(f"f {face}" for face in faces), ""])


def numbered(polygons):
    """Corners of polygons, and their numbers."""
    ends = np.cumsum([len(polygon) for polygon in polygons])
    corners = [corner for polygon in polygons for corner in polygon]
    return corners, [range(end - len(polygon), end) for end, polygon in zip(ends, polygons, strict=True)]


def ply(polygons, kind="ascii"):
    corners, faces = numbered(polygons)
    lines = ["ply", f"format {kind} 1.0", f"element vertex {len(corners)}"]
    lines += [f"property float {x}" for x in ("x", "y", "z", "s", "t")]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    header = "\n".join(lines)
    if kind == "ascii":
        rows = [f"{x} {y} 0 {x} {y}" for x, y in corners]
        return header + "\n".join([*rows, *(f"{len(f)} {' '.join(map(str, f))}" for f in faces), ""])
    order = "<" if "little" in kind else ">"
    rows = b"".join(struct.pack(f"{order}5f", x, y, 0, x, y) for x, y in corners)
    return header.encode() + rows + b"".join(struct.pack(f"{order}B{len(f)}i", len(f), *f) for f in faces)


def off(polygons):
    corners, faces = numbered(polygons)
    rows = [f"{x} {y} 0" for x, y in corners] + [f"{len(f)} {' '.join(map(str, f))}" for f in faces]
    return "\n".join([f"OFF {len(corners)} {len(faces)} 0", *rows, ""])


def usda(polygons, more=""):
    corners, faces = numbered(polygons)
    points = [(float(x), float(y), 0.0) for x, y in corners]
    return f"""#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Y"
)
def Mesh "m" {{
    int[] faceVertexCounts = {[len(face) for face in faces]}
    int[] faceVertexIndices = {[i for face in faces for i in face]}
    point3f[] points = {points}
    normal3f[] normals = {[(0, 0, 1)] * len(corners)} (interpolation = "faceVarying")
    texCoord2f[] primvars:st = {[(x, y) for x, y, _ in points]} (interpolation = "faceVarying")
    uniform token subdivisionScheme = "none"
    {more}
}}
"""


SOURCE = """<source id="{0}"><float_array id="{0}a" count="{1}">{2}</float_array><technique_common>
<accessor source="#{0}a" count="{3}" stride="{4}">{5}</accessor></technique_common></source>"""
DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset/>
<library_geometries><geometry id="g"><mesh>{}
<vertices id="vs"><input semantic="POSITION" source="#v"/></vertices>{}</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def source(name, rows, axes):
    params = "".join(f'<param name="{axis}" type="float"/>' for axis in axes)
    values = " ".join(str(value) for row in rows for value in row)
    return SOURCE.format(name, len(rows) * len(axes), values, len(rows), len(axes), params)


def dae(polygons, kind="polylist", holes=()):
    """A document of polylist or of polygons; each of `holes` is one more polygon, and its holes."""
    corners, faces = numbered([*polygons, *(ring for rings in holes for ring in rings)])
    uvs = [(x, y) for x, y in corners]
    sources = source("v", [(x, y, 0) for x, y in corners], "XYZ") + source("w", uvs, "ST")
    sources += source("n", [(0, 0, 1)], "XYZ")
    rows = [" ".join(f"{i} 0 {i}" for i in face) for face in faces]
    inputs = (
        '<input semantic="VERTEX" source="#vs" offset="0"/><input semantic="NORMAL" source="#n" offset="1"/>'
    )
    inputs += '<input semantic="TEXCOORD" source="#w" offset="2" set="0"/>'
    if kind == "polylist":
        counts = " ".join(str(len(face)) for face in faces)
        content = f"{inputs}<vcount>{counts}</vcount><p>{' '.join(rows)}</p></polylist>"
        return DAE.format(sources, f'<polylist count="{len(faces)}">{content}')
    plain, rest = rows[: len(polygons)], iter(rows[len(polygons) :])
    content = "".join(f"<p>{row}</p>" for row in plain)
    for rings in holes:
        content += f"<ph><p>{next(rest)}</p>" + "".join(f"<h>{next(rest)}</h>" for _ in rings[1:]) + "</ph>"
    return DAE.format(sources, f'<polygons count="{len(plain) + len(holes)}">{inputs}{content}</polygons>')


WRITERS = {
    "polylist.dae": dae,
    "polygons.dae": lambda polygons: dae(polygons, "polygons"),
    "obj": obj,
    "ply": ply,
    "little.ply": lambda polygons: ply(polygons, "binary_little_endian"),
    "big.ply": lambda polygons: ply(polygons, "binary_big_endian"),
    "off": off,
    "usda": usda,
}
GROUPS = {
    "one": [L],
    "mixed": [L, SQUARE, DART, [(0, 0), (1, 0), (0, 1)], WALL],
    "darts": [DART, SQUARE, DART],
    "walls": [WALL, WALL],
}


@pytest.mark.parametrize("group", GROUPS)
@pytest.mark.parametrize("name", WRITERS)
def test_polygons_of_files(tmp_path, name, group):
    """Positions, normals and texture coordinates follow the same triangles, without a warning."""
    if name == "usda":
        pytest.importorskip("pxr")
    data = WRITERS[name](GROUPS[group])
    path = tmp_path / f"a.{name}"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mesh = load_mesh(path, strict=True)
    found = areas(mesh.vertices, mesh.faces)[:, 2] / 2
    assert (found > 0).all()
    assert found.sum() == pytest.approx(sum(map(area, GROUPS[group])))
    if mesh.uvs is not None:
        assert np.array_equal(mesh.uvs, mesh.vertices[:, :2])
    assert (mesh.uvs is None) == (name == "off")


def test_polygons_with_a_bad_vertex_are_left_out_as_a_whole(tmp_path):
    """Their line is that of the face, however many triangles those before have."""
    text = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 .5 0\nv nan 0 0\nf 1 2 3 4\nf 1 2 3\nf 1 2 3 5\n"
    (tmp_path / "a.obj").write_text(text)
    message = "1 face with a vertex that is not finite or beyond float32, first: line 8"
    with pytest.warns(UserWarning, match=message):
        mesh = load_mesh(tmp_path / "a.obj")
    assert len(mesh.faces) == 3


@pytest.mark.parametrize("handed", ["rightHanded", "leftHanded"])
def test_hole_indices_and_orientation_of_usd(tmp_path, handed):
    pytest.importorskip("pxr")
    more = f'int[] holeIndices = [1]\n    uniform token orientation = "{handed}"'
    text = usda([L, SQUARE, DART], more)
    if handed == "leftHanded":
        text = text.replace("(0, 0, 1)", "(0, 0, -1)")
    (tmp_path / "a.usda").write_text(text)
    (mesh,) = load(tmp_path / "a.usda", strict=True).shapes
    found = areas(mesh.vertices, mesh.faces)[:, 2] / 2 * (1 if handed == "rightHanded" else -1)
    assert (found > 0).all()
    assert found.sum() == pytest.approx(area(L) + area(DART))


def moved(ring, x, y, scale=1.0):
    return [(scale * a + x, scale * b + y) for a, b in ring]


WALLS = [
    [SQUARE, RING],  # holes may wind either way
    [SQUARE, RING[::-1]],
    [SQUARE[::-1], RING],
    [moved(SQUARE, 0, 0, 4), moved(RING, -2, -2), moved(RING[::-1], 2, 2), moved(RING, 2, -2, 2)],
    # one behind another, seen from the wall
    [moved(SQUARE, 0, 0, 9), moved(RING, 0, 0), *(moved(RING, x, y, 4) for x, y in ((5, 0), (-5, 0)))],
    [moved(SQUARE, 0, 0, 9), moved(RING, 0, 0), *(moved(RING, 0, y, 8) for y in (4.6, -4.6))],
]


@pytest.mark.parametrize("rings", WALLS)
@pytest.mark.parametrize("beside", [[], [L, SQUARE]])
def test_polygons_with_holes_of_dae(tmp_path, rings, beside):
    (tmp_path / "a.dae").write_text(dae(beside, "polygons", [rings, [SQUARE]]))
    mesh = load_mesh(tmp_path / "a.dae", strict=True)
    found = areas(mesh.vertices, mesh.faces)[:, 2] / 2
    whole = abs(area(rings[0])) - sum(abs(area(ring)) for ring in rings[1:])
    turn = np.sign(area(rings[0]))
    assert found.sum() == pytest.approx(turn * whole + 4 + sum(map(area, beside)))
    assert np.abs(found).sum() == pytest.approx(whole + 4 + sum(map(area, beside)))
    assert np.array_equal(mesh.uvs, mesh.vertices[:, :2])


@pytest.mark.parametrize(
    ("change", "message", "expected"),
    [
        (
            ("<vcount>6 4 3", "<vcount>6 4 2"),
            "1 polygon with fewer than 3 corners or an index below 0; left out",
            7,
        ),
        (("<vcount>6 4 3", "<vcount>6 4 9"), "1 polygon without indices; left out", 7),
        (("<vcount>6 4 3", "<vcount>6 4 -3"), "1 polygon without indices; left out", 7),
        (("<p>0 0 0", "<p>-1 0 0"), "1 polygon with fewer than 3 corners or an index below 0; left out", 4.5),
        (("<p>0 0 0", "<p>99 0 0"), "1 polygon with fewer than 3 corners or an index below 0; left out", 4.5),
        (("<p>0 0 0", "<p>0 3 0"), "1 polygon with fewer than 3 corners or an index below 0; left out", 4.5),
        (("<p>0 0 0", "<p>x 0 0"), "1 polygon with fewer than 3 corners or an index below 0; left out", 4.5),
        (("</p>", " 7</p>"), "a number or index is damaged; what has it is left out", 7.5),
        (("<vcount>6 4 3", "<vcount>6 4 x"), "1 polygon without indices; left out", 7),
        (
            (">-1 -1 0 1", ">-1 nan 0 1"),
            "face with a vertex that is not finite or beyond float32, first: face",
            None,
        ),
        (
            (">-1 -1 0 1", ">-1 x 0 1"),
            "face with a vertex that is not finite or beyond float32, first: face",
            None,
        ),
        (
            (">-1 -1 0 1", ">-1 - 0 1"),
            "face with a vertex that is not finite or beyond float32, first: face",
            None,
        ),
    ],
)
def test_damaged_polygons_of_dae(tmp_path, change, message, expected):
    text = dae([L, SQUARE, [(0, 0), (1, 0), (0, 1)]])
    assert change[0] in text
    (tmp_path / "a.dae").write_text(text.replace(*change))
    with pytest.warns(UserWarning, match=message) as record:
        mesh = load_mesh(tmp_path / "a.dae")
    assert len(record) == 1
    found = areas(mesh.vertices, mesh.faces)[:, 2].sum() / 2
    assert found == pytest.approx(4.5 if expected is None else expected)


@pytest.mark.parametrize(
    "change", [("<h>", "<h>99 0 0 "), ("<h>", "<h>x 0 0 "), ("<h>", "<h>7 "), ("<ph><p>", "<ph><p>99 0 0 ")]
)
def test_damaged_polygons_with_holes_of_dae(tmp_path, change):
    text = dae([L], "polygons", [[SQUARE, RING]])
    (tmp_path / "a.dae").write_text(text.replace(*change))
    with pytest.warns(UserWarning, match="a number or index is damaged; what has it is left out"):
        mesh = load_mesh(tmp_path / "a.dae")
    assert areas(mesh.vertices, mesh.faces)[:, 2].sum() / 2 >= area(L)


@pytest.mark.parametrize("polygons", [[L, DART], [WALL, SQUARE, [(0, 0), (1, 0), (0, 1)]]])
def test_polygons_of_pyvista(polygons):
    """Also those that VTK leaves out; the colors of cells follow."""
    pyvista = pytest.importorskip("pyvista")
    corners, faces = numbered(polygons)
    points = [(x, y, 0) for x, y in corners]
    data = pyvista.PolyData(points, np.concatenate([[len(face), *face] for face in faces]))
    data.cell_data["c"] = np.arange(3 * len(faces), dtype=np.uint8).reshape(-1, 3) * 20
    (mesh,) = from_pyvista(data).shapes
    found = areas(mesh.vertices, mesh.faces)[:, 2] / 2
    assert (found > 0).all()
    shown = np.unique(mesh.colors[mesh.faces[:, 0], 0], return_inverse=True)[1]
    assert np.bincount(shown, found) == pytest.approx([area(polygon) for polygon in polygons])
