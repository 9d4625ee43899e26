"""OFF, COLLADA and 3MF: what is read, and every complaint about files that are damaged or hostile."""

import io
import zipfile

import numpy as np
import pytest
import trimesh
from inside import LoadLimits, SceneError, from_trimesh, load, load_mesh, load_meshes
from PIL import Image

OFF = "OFF # a comment\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n\n0 1 0\n3 0 1 2\n3 0 2 3\n"


@pytest.fixture
def write(tmp_path):
    """Write a file; return its path."""

    def write_file(data, name):
        (tmp_path / name).write_bytes(data if isinstance(data, bytes) else data.encode())
        return tmp_path / name

    return write_file


def soup(mesh, values=None):
    """What the corners of the faces have, (m, 3, ·)."""
    return (mesh.vertices if values is None else values)[mesh.faces]


# ---- OFF --------------------------------------------------------------------------------------


def test_off(write):
    (mesh,) = load_meshes(write(OFF, "a.off"), strict=True)
    assert np.array_equal(soup(mesh)[:, :, :2], [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]])
    (quad,) = load_meshes(
        write(OFF.replace("4 2 0", "4 1 0").replace("3 0 1 2\n3 0 2 3", "4 0 1 2 3"), "a.off")
    )
    assert len(quad.faces) == 2
    (mesh,) = load_meshes(write(OFF.replace("OFF # a comment\n", "OFF "), "a.off"))
    assert len(mesh.faces) == 2


STL = "solid\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 0 0\nvertex 1 1 0\nvertex 0 1 0\nendsolid\n"


@pytest.mark.parametrize(
    ("name", "data"),
    [("a.off", OFF), ("a.off", OFF.replace("3 0 1 2", "3 0 1 2 9 9 9")), ("a.stl", STL)],
)
def test_trimesh_reads_triangles(write, monkeypatch, name, data):
    loaders, kind = trimesh.exchange.load.mesh_loaders, name[2:]
    read, seen = loaders[kind], []
    monkeypatch.setitem(loaders, kind, lambda file: seen.append(kind) or read(file))
    (mesh,) = load_meshes(write(data, name), materials=False)
    assert seen == [kind]
    assert np.array_equal(soup(mesh)[:, :, :2], [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]])


@pytest.mark.parametrize("word", ["1_0", "1\0", "1.0.0"])
def test_words_that_only_python_takes_for_numbers(write, word):
    path = write(OFF.replace("0 1 0", f"0 {word} 0"), "a.off")
    with pytest.warns(UserWarning, match="1 face with a vertex that is not finite"):
        (mesh,) = load_meshes(path)
    assert len(mesh.faces) == 1


@pytest.mark.parametrize(
    ("data", "named"),
    [
        (OFF.replace("3 0 1 2", "3 0 1 2 255 0 0"), "colors of faces"),
        (OFF.replace("OFF", "COFF").replace("0 0 0\n", "0 0 0 1 0 0 1\n", 1), "colors of vertices"),
        (OFF.replace("OFF", "NOFF"), "normals"),
    ],
)
def test_what_is_not_read_of_off_is_named(write, data, named):
    path = write(data, "a.off")
    with pytest.warns(UserWarning, match=rf"a\.off: not honored: {named}$"):
        (mesh,) = load_meshes(path)
    assert len(mesh.faces) == 2
    with pytest.raises(SceneError, match="not honored"):
        load_meshes(path, strict=True)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("", r"a\.off: is empty"),
        ("hello", r"a\.off: begins with 'HELLO'; it must be one of OFF, COFF"),
        (OFF.replace("OFF", "4OFF"), r"a\.off: begins with '4OFF'"),
        (OFF.replace("OFF", "OFF BINARY"), r"a\.off line 1: counts are 'BINARY'"),
        (OFF.replace("4 2 0", "4 -2 0"), r"a\.off line 2: counts are '4 -2 0'; they must be whole numbers"),
        ("OFF\n0 0 0\n", r"a\.off: has no faces$"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n", r"a\.off: has no faces:\s+the last 1 row of vertex; missing"),
    ],
)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_off_without_a_mesh(write, data, message):
    with pytest.raises(SceneError, match=message):
        load_meshes(write(data, "a.off"))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (
            OFF.replace("4 2 0", f"4 {10**15} 0"),
            "the last 999999999999998 rows of face; missing, as the file",
        ),
        (OFF[:-2], "1 row of face with too few or malformed words, first: line 9; left out$"),
        (
            OFF.replace("0 1 0", "0 1"),
            "1 row of vertex with too few or malformed words, first: line 7; left out",
        ),
        (
            OFF.replace("0 1 0", "0 x 0"),
            "1 face with a vertex that is not finite or beyond float32, first: fa",
        ),
        (
            OFF.replace("3 0 2 3", "2 0 2"),
            "1 row of face with fewer than 3 corners, first: line 9; left out$",
        ),
        (
            OFF.replace("3 0 2 3", "3 0 2 4"),
            "1 row of face with a vertex beyond the 4, first: line 9; left out$",
        ),
        (OFF.replace("3 0 2 3", "3 0 2 -1"), "1 row of face with a vertex beyond the 4"),
    ],
)
def test_damaged_off(write, data, message):
    path = write(data, "a.off")
    with pytest.warns(UserWarning, match=message) as record:
        (mesh,) = load_meshes(path)
    assert len(record) == 1
    assert soup(mesh)[0].tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
    assert len(mesh.faces) == (2 if "rows" in message else 1)
    with pytest.raises(SceneError, match=message):
        load_meshes(path, strict=True)


# ---- COLLADA ----------------------------------------------------------------------------------


def dae(
    nodes='<node id="n"><instance_geometry url="#g">{bind}</instance_geometry></node>', image="t.png", more=""
):
    """A square with normals of its own and a texture, with any nodes."""
    bind = '<bind_material><technique_common><instance_material symbol="m" target="#m"/></technique_common>'
    nodes = nodes.replace("{bind}", bind + "</bind_material>")

    def source(name, values, params):
        count = len(values.split())
        return (
            f'<source id="{name}"><float_array id="{name}a" count="{count}">{values}</float_array>'
            f'<technique_common><accessor source="#{name}a" count="{count // len(params)}" '
            f'stride="{len(params)}">'
            + "".join(f'<param name="{p}" type="float"/>' for p in params)
            + "</accessor></technique_common></source>"
        )

    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.01"/><up_axis>Z_UP</up_axis></asset>
<library_images><image id="i"><init_from>{image}</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON>
<newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>
<newparam sid="p"><sampler2D><source>s</source></sampler2D></newparam>
<technique sid="c"><lambert><diffuse><texture texture="p" texcoord="u"/></diffuse></lambert></technique>
</profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
{source("v", "0 0 0 1 0 0 1 1 0 0 1 0", "XYZ")}{source("k", "0 0 1 0 1 0", "XYZ")}
{source("w", "0 0 1 0 1 1 0 1", "ST")}
<vertices id="vs"><input semantic="POSITION" source="#v"/></vertices>
<triangles count="2" material="m"><input semantic="VERTEX" source="#vs" offset="0"/>
<input semantic="NORMAL" source="#k" offset="1"/><input semantic="TEXCOORD" source="#w" offset="2" set="0"/>
<p>0 0 0 1 0 1 2 0 2 0 1 0 2 1 2 3 1 3</p></triangles>
</mesh></geometry></library_geometries>
{more}<library_visual_scenes><visual_scene id="vis">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#vis"/></scene></COLLADA>"""


@pytest.fixture
def image(tmp_path):
    """An image beside the files."""
    Image.fromarray(np.full((4, 4, 3), (255, 0, 0), np.uint8)).save(tmp_path / "t.png")


def test_dae(write, image):
    matrix = '<node><matrix>1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1</matrix><instance_geometry url="#g">{bind}'
    path = write(dae(matrix + "</instance_geometry></node>"), "a.dae")
    (mesh,) = load_meshes(path, strict=True)
    # meters; up_axis turns nothing, and corners with normals of their own stay apart
    assert soup(mesh)[:, :, 0] == pytest.approx(np.array([[0.05, 0.06, 0.06], [0.05, 0.06, 0.05]]))
    assert np.array_equal(soup(mesh, mesh.normals)[:, 0], [[0, 0, 1], [0, 1, 0]])
    assert np.array_equal(soup(mesh, mesh.uvs)[0], [[0, 0], [1, 0], [1, 1]])
    assert (
        getattr(mesh.material.bsdf, "base_color", None) is not None
        or mesh.material.bsdf.reflectance is not None
    )
    assert len(load(path).shapes) == 1


def test_images_of_dae(write, image, tmp_path):
    with pytest.warns(UserWarning, match=r"a\.dae: texture 'no\.png' is missing"):
        load_meshes(write(dae(image="no.png"), "a.dae"))
    with pytest.raises(SceneError, match=r"a\.dae: texture 'no\.png' is missing"):
        load_meshes(write(dae(image="no.png"), "a.dae"), strict=True)
    (tmp_path / "my t.png").write_bytes((tmp_path / "t.png").read_bytes())
    load_meshes(write(dae(image="my%20t.png"), "a.dae"), strict=True)
    for elsewhere in ("../t.png", "file:///home/author/t.png"):
        with pytest.warns(UserWarning, match=r"a\.dae: the file '.*' is missing; 't\.png' in its place$"):
            load_meshes(write(dae(image=elsewhere), "a.dae"))
    for outside in ("../u.png", "http://example.org/t.bmp", "/etc/hostname"):
        with pytest.warns(UserWarning, match=r"a\.dae: texture '.*': .*refers to .*; gray in its place$"):
            load_meshes(write(dae(image=outside), "a.dae"))
    (tmp_path / "t.png").write_bytes(b"\x89PNG")
    with pytest.warns(UserWarning, match=r"a\.dae: texture 't\.png': t\.png: not a readable .*; gray in its"):
        load_meshes(write(dae(), "a.dae"))


def test_what_is_not_read_of_dae_is_named(write, image):
    more = '<library_lights><light id="l"><technique_common><ambient><color>1 1 1</color></ambient>'
    more += "</technique_common></light></library_lights>"
    nodes = '<node><instance_light url="#l"/><instance_geometry url="#g">{bind}</instance_geometry></node>'
    path = write(dae(nodes, more=more), "a.dae")
    with pytest.warns(UserWarning, match=r"a\.dae: not honored: line \d+: instance_light$"):
        load_meshes(path)
    with pytest.raises(SceneError, match="not honored"):
        load_meshes(path, strict=True)


def test_opacity_of_dae_is_named(write, image):
    clear = "</diffuse><transparent><color>1 1 1 0.5</color></transparent>"
    with pytest.warns(UserWarning, match=r"a\.dae: not honored: opacity of materials$"):
        load_meshes(write(dae().replace("</diffuse>", clear), "a.dae"))


def test_damaged_parts_of_dae_are_announced(write, image):
    data = dae()
    begin, end = data.index("<geometry"), data.index("</geometry>") + len("</geometry>")
    broken = data[begin:end].replace('"g"', '"h"').replace('source="#vs"', 'source="#no"')
    node = '<node><instance_geometry url="#h"/></node>'
    data = data[:end] + broken + data[end:]
    path = write(data.replace('<visual_scene id="vis">', '<visual_scene id="vis">' + node), "a.dae")
    with pytest.warns(UserWarning, match=r"a\.dae: 1 of 2 parts of its geometry is damaged; left out"):
        (mesh,) = load_meshes(path)
    assert len(mesh.faces) == 2
    with pytest.raises(SceneError, match="1 of 2 parts of its geometry is damaged"):
        load_meshes(path, strict=True)


def multiplied(levels, width=10):
    """Nodes of which each holds the next one `width` times."""
    nodes = "".join(
        f'<node id="n{i}">' + f'<instance_node url="#n{i + 1}"/>' * width + "</node>" for i in range(levels)
    )
    nodes += f'<node id="n{levels}"><instance_geometry url="#g"/></node>'
    return dae('<node><instance_node url="#n0"/></node>', more=f"<library_nodes>{nodes}</library_nodes>")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("<COLLADA>", r"a\.dae: not a readable file: no element found: line 1"),
        ("hello", r"a\.dae: not a readable file: syntax error: line 1"),
        ("<a/>", r"a\.dae: not a readable dae file"),
        (
            dae().replace("<COLLADA", "<!DOCTYPE a [<!ENTITY b 'c'>]><COLLADA"),
            r"a\.dae line 2: has a document type",
        ),
        (
            dae()
            .replace("<COLLADA", "<!DOCTYPE a SYSTEM 'http://example.org/a.dtd'><COLLADA")
            .encode("utf-16"),
            r"a\.dae.*(has a document type|not a readable file)",
        ),
        (multiplied(9), r"a\.dae: its nodes refer to each other so often that they stand for \d+ bytes"),
        (dae('<node id="n"><instance_node url="#n"/></node>'), r"a\.dae: node '#n' holds itself"),
        (dae("<node>" * 200 + "</node>" * 200), r"a\.dae: its nodes are nested deeper than 128"),
        (dae("<node/>"), r"a\.dae: has no faces"),
        (
            dae().replace('source="#vs"', 'source="#no"'),
            r"a\.dae: has no faces: 1 of 1 parts of its geometry is damaged; left out",
        ),
        (dae().replace("<scene>", "<!--").replace("</scene>", "-->"), r"a\.dae: .*it has no scene"),
    ],
)
def test_damaged_dae(write, image, data, message):
    with pytest.raises(SceneError, match=message):
        load_meshes(write(data, "a.dae"))


def test_an_archive_behind_a_dae_is_refused(write, image):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("b.dae", dae())
    with pytest.raises(SceneError, match=r"a\.dae: is an archive"):
        load_meshes(write(dae().encode() + packed.getvalue(), "a.dae"))


# ---- 3MF --------------------------------------------------------------------------------------

MESH = """<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/>
</vertices><triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh>"""


def model(resources=f'<object id="1" name="part">{MESH}</object>', build='<item objectid="1"/>'):
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
 xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06">
<resources>{resources}</resources><build>{build}</build></model>"""


def package(content=None, **others):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", model() if content is None else content)
        for name, data in others.items():
            archive.writestr(name, data)
    return packed.getvalue()


def test_3mf(write):
    (mesh,) = load_meshes(write(package(), "a.3mf"), strict=True)
    assert soup(mesh)[0] == pytest.approx(np.array([[0, 0, 0], [0.001, 0, 0], [0, 0.001, 0]]))  # meters
    build = '<item objectid="1"/><item objectid="1" transform="1 0 0 0 1 0 0 0 1 5 0 0"/>'
    scene = load(write(package(model(build=build)), "a.3mf"))
    assert len(scene.shapes) == 2
    found = sorted(
        mesh.vertices[:, 0].min() for mesh in load_meshes(write(package(model(build=build)), "a.3mf"))
    )
    assert found == pytest.approx([0, 0.005])


def test_3mf_equals_the_object_in_memory(tmp_path):
    ball = trimesh.creation.icosphere(1)
    ball.export(tmp_path / "a.3mf")
    (mesh,) = load_meshes(tmp_path / "a.3mf")
    (again,) = from_trimesh(trimesh.load_scene(tmp_path / "a.3mf", process=False)).shapes
    assert soup(mesh) == pytest.approx(0.001 * soup(again))
    assert soup(again) == pytest.approx(ball.triangles, abs=1e-5)


def test_what_is_not_read_of_3mf_is_named(write):
    textures = '<texture2dgroup id="5"/><multiproperties id="6"/>'
    path = write(package(model(f'{textures}<object id="1">{MESH}</object>')), "a.3mf")
    with pytest.warns(
        UserWarning,
        match=r"a\.3mf: 2 things.*\n  not honored: texture2dgroup\n  not honored: multiproperties$",
    ):
        load_meshes(path)
    load_mesh(path, from_trimesh(trimesh.creation.box()).shapes[0].material)
    with pytest.raises(SceneError, match="not honored"):
        load_meshes(path, strict=True)


SIDES = MESH.replace("</triangles>", "{}</triangles>").replace('v3="2"/>', 'v3="2" {}/>')
COLORS = """<basematerials id="5"><base name="a" displaycolor="#FF8800"/>
<base name="b" displaycolor="#0000FFFF"/></basematerials>
<colorgroup id="6"><color color="#FF0000"/><color color="#00FF00"/><color color="#0000FF"/></colorgroup>"""
ORANGE, GRAY = [1, 0.2462013, 0], [0.5, 0.5, 0.5]
SECOND = '<triangle v1="0" v2="2" v3="1" {}/>'


@pytest.mark.parametrize(
    ("own", "first", "second", "colors"),
    [
        ('pid="5" pindex="0"', "", "", None),
        ('pid="5" pindex="1"', 'pid="5" p1="0"', "", [[ORANGE] * 3, [[0, 0, 1]] * 3]),
        ("", 'pid="6" p1="0" p2="1" p3="2"', "", [np.eye(3), [GRAY] * 3]),
        ('pid="6" pindex="0"', 'p1="2"', 'pid="5" p1="0"', [[[0, 0, 1]] * 3, [ORANGE] * 3]),
    ],
)
def test_colors_of_3mf(write, own, first, second, colors):
    """Of an object, of triangles and of corners; sRGB, from materials and from groups of colors."""
    mesh = SIDES.format(first, SECOND.format(second))
    content = model(f'{COLORS}<object id="1" {own}>{mesh}</object>')
    (found,) = load_meshes(write(package(content), "a.3mf"), strict=True)
    if colors is None:
        assert found.colors is None
        assert found.material.bsdf.reflectance.ravel() == pytest.approx(ORANGE)
    else:
        assert found.colors[found.faces][..., :3] == pytest.approx(np.array(colors, float))
        assert (found.colors[:, 3] == 1).all()


def test_clear_colors_of_3mf_are_named(write):
    content = model(COLORS.replace("FFFF", "FF80") + f'<object id="1" pid="5" pindex="1">{MESH}</object>')
    with pytest.warns(UserWarning, match="not honored: opacity of colors"):
        (found,) = load_meshes(write(package(content), "a.3mf"))
    assert found.material.bsdf.reflectance.ravel() == pytest.approx([0, 0, 1])


def test_several_meshes_of_a_member_of_3mf(write):
    """Objects of another member are found by their ids, with the matrices on the way."""
    part = '<component objectid="{}" p:path="/b.model" transform="1 0 0 0 1 0 0 0 1 {} 0 0"/>'
    parts = part.format(2, 5) + part.format(3, 9)
    other = model(f'<object id="2">{MESH}</object><object id="3">{MESH}</object>', "")
    build = '<item objectid="1" transform="0 1 0 -1 0 0 0 0 1 0 0 0"/>'
    content = model(f'<object id="1"><components>{parts}</components></object>', build)
    content = content.replace("millimeter", "meter")
    found = load_meshes(write(package(content, **{"b.model": other}), "a.3mf"), strict=True)
    assert [mesh.vertices.tolist() for mesh in found] == [
        [[0, x, 0], [0, x + 1, 0], [-1, x, 0]] for x in (5, 9)
    ]


def components(levels, width=10):
    """Objects of which each holds the next one `width` times."""
    objects = f'<object id="{levels}">{MESH}</object>'
    for i in range(levels - 1, -1, -1):
        objects += f'<object id="{i}"><components>' + f'<component objectid="{i + 1}"/>' * width
        objects += "</components></object>"
    return model(objects, '<item objectid="0"/>')


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"hello", r"a\.3mf: not a readable 3mf file: BadZipFile"),
        (package()[:-30], r"a\.3mf: not a readable 3mf file"),
        (package("<model>"), r"a\.3mf: 3D/3dmodel\.model: not a readable file"),
        (
            package("<!DOCTYPE a [<!ENTITY b 'c'>]>" + model()[38:]),
            r"3dmodel\.model line 1: has a document type",
        ),
        (package(components(9)), r"a\.3mf: its nodes refer to each other so often"),
        (
            package(model('<object id="1"><components><component objectid="1"/></components></object>')),
            "itself",
        ),
        (package(model("", "")), r"a\.3mf"),
        (
            package(model(build='<item objectid="7"/>')),
            r"has no faces: build refers to object .*#7, which does not exist; left out",
        ),
        (package(model(f'<object id="1">{MESH}</object>'.replace('x="0"', ""))), r"x is missing; left out"),
        (package(model(f'<object id="1">{MESH}</object>'.replace('x="1"', 'x="b"'))), "x is 'b'; left out"),
        (package(model(f'<object id="1">{MESH}</object>'.replace('v3="2"', ""))), "v3 is missing; left out"),
    ],
)
def test_3mf_without_a_mesh(write, data, message):
    with pytest.raises(SceneError, match=message):
        load_meshes(write(data, "a.3mf"))


PAIR = MESH.replace("</triangles>", '<triangle v1="0" v2="1" v3="2"/></triangles>')
PAIR = PAIR.replace("</vertices>", '<vertex x="1" y="1" z="0"/></vertices>')


def part(mesh=PAIR, own="", colors=""):
    return model(f'{colors}<object id="1" {own}>{mesh}</object>')


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            part(PAIR.replace('v3="2"', 'v3="9"', 1)),
            "1 triangle with a vertex beyond the 4, first: triangle 0",
        ),
        (part(PAIR.replace('v3="2"', 'v3="-1"', 1)), "1 triangle with a vertex beyond the 4"),
        (part(PAIR.replace('v3="2"', 'v3="x"', 1)), r"3D/3dmodel\.model: v3 is 'x'; left out"),
        (part(PAIR.replace('v3="2"', f'v3="{2**63}"', 1)), "1 triangle with a vertex beyond the 4"),
        (
            part(PAIR.replace('v3="2"', 'v3="3"', 1).replace('x="1" y="1"', 'x="1" y="x"')),
            "y is 'x'; left out",
        ),
        (
            model(f'<object id="1">{MESH}</object>', '<item objectid="1"/><item objectid="7"/>'),
            "build refers to",
        ),
        (
            model(
                f'<object id="1">{MESH}</object>',
                '<item objectid="1"/><item objectid="1" transform="1e300 0 0 0 1 0 0 0 1 5 0 0"/>',
            ),
            "the matrix of object .*#1 is beyond all limits; left out",
        ),
        (
            model(f'<object id="1">{MESH}</object>', '<item objectid="1" transform="1 2"/>'),
            "transform is '1 2'; left out, as it must be 12 numbers",
        ),
        (part(MESH, 'pid="5" pindex="2"', COLORS), "group 5 has 2 colors, not number 2; gray in its place"),
        (part(MESH, 'pid="5" pindex="x"', COLORS), "pindex is 'x'; left out"),
        (
            part(MESH, 'pid="5" pindex="0"', COLORS.replace("#FF8", "x")),
            "group 5 has 'x800', which is no color; gray in its place",
        ),
        (
            part(MESH).replace('unit="millimeter"', 'unit="parsec"'),
            "unit is 'parsec'; millimeter in its place",
        ),
    ],
)
def test_damaged_parts_of_3mf_cost_no_more_than_themselves(write, content, message):
    path = write(package(content), "a.3mf")
    with pytest.warns(UserWarning, match=message) as record:
        (mesh,) = load_meshes(path)
    assert len(record) == 1
    assert soup(mesh)[:, :, 0] == pytest.approx(np.array([[0, 0.001, 0]]))
    if mesh.material is not None and not getattr(mesh.material.bsdf.reflectance, "texture", None):
        assert mesh.material.bsdf.reflectance.ravel() == pytest.approx([0.5] * 3)
    with pytest.raises(SceneError, match=message):
        load_meshes(path, strict=True)


@pytest.mark.parametrize(
    ("unit", "meters"),
    [("micron", 1e-6), ("centimeter", 0.01), ("inch", 0.0254), ("foot", 0.3048), ("meter", 1), (None, 0.001)],
)
def test_units_of_3mf_and_dae(write, image, unit, meters):
    """As those of USD."""
    written = "" if unit is None else f'unit="{unit}"'
    scene = load(write(package(model().replace('unit="millimeter"', written)), "a.3mf"), strict=True)
    assert np.ptp(scene.bounds, 0) == pytest.approx([meters, meters, 0], rel=1e-6)
    assert scene.up.tolist() == [0, 0, 1]
    written = "" if unit is None else f'<unit name="{unit}" meter="{meters}"/>'
    scene = load(write(dae().replace('<unit meter="0.01"/>', written), "a.dae"), strict=True)
    assert np.ptp(scene.bounds, 0) == pytest.approx(
        [meters if unit else 1, meters if unit else 1, 0], rel=1e-6
    )


@pytest.mark.parametrize("meter", ["0", "-1", "nan", "inf"])
def test_units_of_dae_that_are_none(write, image, meter):
    path = write(dae().replace('meter="0.01"', f'meter="{meter}"'), "a.dae")
    with pytest.warns(UserWarning, match=rf"a\.dae: unit is {meter} meters; 1 in its place$"):
        (mesh,) = load_meshes(path)
    assert np.ptp(mesh.vertices[:, 0]) == 1


@pytest.mark.parametrize("element", ["inf", "nan", "1e300"])
def test_matrices_of_3mf_that_are_not_finite_are_named(write, element):
    """Found by damaged files: a matrix that is not finite gave a warning of NumPy."""
    build = f'<item objectid="1" transform="{element} 0 0 0 1 0 0 0 1 5 0 0"/>'
    with pytest.raises(
        SceneError, match=r"a\.3mf: has no faces: the matrix of object .* is beyond all limits"
    ):
        load_meshes(write(package(model(build=build)), "a.3mf"))


def test_members_of_3mf_are_limited(write):
    bomb = package(**{"zeros": bytes(2**22)})
    assert len(bomb) < 2**14
    with pytest.raises(SceneError, match=r"a\.3mf: unpacks to \d+ bytes; the limit is 4194304"):
        load_meshes(write(bomb, "a.3mf"), limits=LoadLimits(unpacked_bytes=2**22))
    many = package(**{str(i): b"" for i in range(2**12)})
    with pytest.raises(SceneError, match=r"a\.3mf: has 4097 members; the limit is 4096"):
        load_meshes(write(many, "a.3mf"))


def zipped(members, method=zipfile.ZIP_DEFLATED):
    """Return an archive of (name, content)."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as archive:
        for name, content in members:
            archive.writestr(name, content)
    return buffer.getvalue()


SPY = "<!DOCTYPE a [<!ENTITY b SYSTEM 'file:///etc/passwd'>]>"
PART = model(
    '<object id="1"><components><component objectid="2" p:path="/parts/{}"/></components></object>'
).format


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ([("3D/3dmodel.modelx", SPY + model()[38:])], r"3dmodel\.modelx line 1: has a document type"),
        ([("x/3D/3DModel.MODEL.bak", SPY + model()[38:])], r"MODEL\.bak line 1: has a document type"),
        (
            [("3D/3dmodel.model", PART("a.xml")), ("parts/a.xml", SPY + model()[38:])],
            r"refers to object parts/a\.xml#2, which does not exist",
        ),
        ([("3D/3dmodel.model", PART("a.model"))], r"refers to object parts/a\.model#2, which does not exist"),
        ([("3D/3dmodel.txt", model())], "has no member '3d/3dmodel.model'"),
    ],
)
def test_the_members_of_3mf_that_are_read_are_those_that_are_checked(write, members, message):
    with pytest.raises(SceneError, match=rf"a\.3mf: .*{message}"):
        load_meshes(write(zipped(members), "a.3mf"))


def test_the_first_model_of_a_package_is_the_one(write):
    """Also under a longer name; others are read where it refers to them alone."""
    members = [("thumbnail.png", b"x"), ("3D/3dmodel.modelx", model()), ("b.model", model())]
    assert len(load_meshes(write(zipped(members), "a.3mf"))) == 1


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_other_methods_of_compression_are_refused_in_3mf(write, method):
    """Python's decoders of these have no limit."""
    data = zipped([("3D/3dmodel.model", model())], method)
    with pytest.raises(SceneError, match=r"a\.3mf: its member '3D/3dmodel\.model' is compressed by"):
        load_meshes(write(data, "a.3mf"))


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_members_of_one_name_are_refused(write):
    """Readers differ in which of them they take."""
    data = zipped([("3D/3dmodel.model", model())] * 2)
    with pytest.raises(SceneError, match=r"a\.3mf: has two members '3D/3dmodel\.model'"):
        load_meshes(write(data, "a.3mf"))


@pytest.mark.parametrize("name", ["a.dae", "a.3mf"])
def test_unknown_encodings_are_refused(write, name):
    text = '<?xml version="1.0" encoding="foo"?><COLLADA/>'
    data = text if name == "a.dae" else zipped([("3D/3dmodel.model", text)])
    with pytest.raises(SceneError, match=rf"{name}: .*unknown encoding: foo"):
        load_meshes(write(data, name))
