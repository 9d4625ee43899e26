"""Which files are opened while hostile ones are loaded: none outside of their folder, by any reader.

An audit hook records each path that Python opens, in a process of its own, as hooks stay. What libraries open
by themselves it does not see: those of USD are pipes in test_usd_doors.py, which whoever opens them waits
for.
"""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inside import write_image

import wavefront as wf

SUFFIXES = [
    "mtl",
    "png",
    "exr",
    "bin",
    "obj",
    "ply",
    "xml",
    "pbrt",
    "spd",
    "vol",
    "serialized",
    "tlt",
    "usda",
    "raw",
    "bsdf",
    "ply.gz",
]
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"
WORLD = "WorldBegin\n"
FACE = 'Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 1 1 0 ] "integer indices" [ 0 1 2 ]\n'
PLY = """ply
format ascii 1.0
comment TextureFile {png}
element vertex 3
property float x
property float y
property float z
property float s
property float t
element face 1
property list uchar int vertex_indices
end_header
0 0 0 0 0
1 0 0 1 0
0 1 0 0 1
3 0 1 2
"""
DAE = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<library_images><image id="i">
<init_from>{png}</init_from></image></library_images>
<library_geometries><geometry id="g"><mesh><source id="p">
<float_array id="a" count="9">0 0 0 1 0 0 0 1 0</float_array><technique_common><accessor source="#a" count="3"
stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor>
</technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh>
</geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/>
</node></visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
IES = "IESNA:LM-63-2002\nTILT={tlt}\n1 -1 1 3 1 1 2 .1 .1 0\n1 1 20\n0 45 90\n0\n1 2 3\n"
NRRD = "NRRD0005\ntype: float\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: {raw}\n\n"
MATERIALX = """<materialx version="1.38"><image name="i" type="color3"><input name="file" type="filename"
value="{png}"/></image><standard_surface name="s" type="surfaceshader"><input name="base_color" type="color3"
nodename="i"/></standard_surface><surfacematerial name="m" type="material"><input name="surfaceshader"
type="surfaceshader" nodename="s"/></surfacematerial></materialx>"""
USD = """#usda 1.0
(
 subLayers = [@{usda}@]
)
def "a" (references = @{usda}@</x>)
{{
}}
def RectLight "l"
{{
 asset inputs:texture:file = @{png}@
}}
"""


def mitsuba(part: str) -> str:
    return f'<scene version="3.0.0"><shape type="sphere"/>{part}</scene>'


def named(kind: str, plugin: str, suffix: str, name: str = "filename") -> str:
    """Return a Mitsuba scene with a plugin that names a file."""
    return mitsuba(f'<{kind} type="{plugin}"><string name="{name}" value="{{{suffix}}}"/></{kind}>')


def textured(inside: str) -> str:
    return mitsuba(f'<shape type="sphere"><bsdf type="diffuse">{inside}</bsdf></shape>')


def gltf(**parts: Any) -> str:
    """Return a glTF file; braces are those of JSON."""
    document = {"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}]} | parts
    return json.dumps(document)


POSITIONS = {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}
POSITIONS |= {"min": [0] * 3, "max": [1] * 3}
MESH = [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}]
TEXTURE = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
VIEW = [{"buffer": 0, "byteLength": 36}]
# files by what they test; {png} and so on stand for names of files elsewhere
HOSTILE: dict[str, str] = {
    "library.obj": "mtllib {mtl}\n" + TRIANGLE,
    "texture.obj": "mtllib {own}.mtl\n" + TRIANGLE,
    "texture.ply": PLY,
    "image.dae": DAE,
    "tilt.ies": IES,
    "data.nrrd": NRRD,
    "image.mtlx": MATERIALX,
    "layers.usda": USD,
    "include.xml": mitsuba('<include filename="{xml}"/>'),
    "folder.xml": mitsuba('<path value="{folder}"/><include filename="in.xml"/>'),
    "bitmap.xml": textured(
        '<texture type="bitmap" name="reflectance"><string name="filename" value="{png}"/></texture>'
    ),
    "spectrum.xml": textured('<spectrum name="reflectance" filename="{spd}"/>'),
    "envmap.xml": named("emitter", "envmap", "exr"),
    "obj.xml": named("shape", "obj", "obj"),
    "ply.xml": named("shape", "ply", "ply"),
    "serialized.xml": named("shape", "serialized", "serialized"),
    "grid.xml": named("shape", "sdfgrid", "vol"),
    "measured.xml": textured('<string name="filename" value="{bsdf}"/>').replace("diffuse", "measured"),
    "volume.xml": mitsuba(
        '<shape type="cube"><medium type="heterogeneous" name="interior"><volume type="gridvolume" '
        'name="sigma_t"><string name="filename" value="{vol}"/></volume></medium></shape>'
    ),
    "include.pbrt": FACE + 'Include "{pbrt}"\n',
    "import.pbrt": FACE + 'Import "{pbrt}"\n',
    "mesh.pbrt": FACE + 'Shape "plymesh" "string filename" "{ply}"\n',
    "packed.pbrt": FACE + 'Shape "plymesh" "string filename" "{ply.gz}"\n',
    "image.pbrt": 'Texture "t" "spectrum" "imagemap" "string filename" "{png}"\n'
    'Material "diffuse" "texture reflectance" "t"\n' + FACE,
    "infinite.pbrt": FACE + 'LightSource "infinite" "string filename" "{exr}"\n',
    "web.pbrt": FACE + 'LightSource "goniometric" "string filename" "{exr}"\n',
    "projection.pbrt": FACE + 'LightSource "projection" "string filename" "{png}"\n',
    "spectrum.pbrt": FACE + 'LightSource "distant" "spectrum L" "{spd}"\n',
    "normals.pbrt": 'Material "diffuse" "string normalmap" "{png}"\n' + FACE,
}
LOADERS: dict[str, Callable[[Path], object]] = {
    ".ies": lambda path: wf.IESLight(path, (0, 2, 0)),
    ".nrrd": wf.load_grid,
    ".mtlx": wf.load_materialx,
}


def write(home: Path, ways: dict[str, str]) -> list[Path]:
    """Write all hostile files, with names of files elsewhere by suffix."""
    for name, content in HOSTILE.items():
        text = (WORLD if name.endswith(".pbrt") else "") + content
        text = text.replace("{own}", "own").replace("{folder}", str(Path(ways["xml"]).parent))
        for suffix, way in ways.items():
            text = text.replace(f"{{{suffix}}}", way)
        (home / name).write_text(text.replace("{{", "{").replace("}}", "}"))
    png, exr = ways["png"], ways["exr"]
    (home / "own.mtl").write_text(f"newmtl m\nmap_Kd {png}\nmap_Ke {exr}\nnorm {png}\n")
    far = [{"uri": ways["bin"], "byteLength": 36}]
    buffer = gltf(meshes=MESH, accessors=[POSITIONS], bufferViews=VIEW, buffers=far)
    (home / "buffer.gltf").write_text(buffer)
    image = gltf(
        meshes=MESH,
        accessors=[POSITIONS],
        bufferViews=VIEW,
        buffers=[{"uri": "own.bin", "byteLength": 36}],
        materials=[TEXTURE],
        textures=[{"source": 0}],
        images=[{"uri": ways["png"]}],
    )
    (home / "image.gltf").write_text(image)
    (home / "own.bin").write_bytes(np.float32([0, 0, 0, 1, 0, 0, 0, 1, 0]).tobytes())
    archive = BytesIO()
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr(ways["xml"], "<model/>")
        relation = f'<Relationship Target="{ways["xml"]}" Type="3dmodel"/>'
        file.writestr("_rels/.rels", f"<Relationships>{relation}</Relationships>")
    (home / "model.3mf").write_bytes(archive.getvalue())
    own = (path for path in home.iterdir() if path.is_file() and not path.is_symlink())
    return sorted(path for path in own if path.stem != "own")


def main(root: Path) -> None:
    """Load hostile files, and print each path that was opened, and what was loaded."""
    home, out = root / "home", root / "out"
    home.mkdir()
    out.mkdir()
    for suffix in SUFFIXES:
        (out / f"in.{suffix}").write_bytes(b"secret")
        (home / f"link.{suffix}").symlink_to(out / f"in.{suffix}")
    write_image(out / "in.png", np.ones((4, 4, 3)))
    write_image(out / "in.exr", np.ones((4, 4, 3)))
    opened: list[str] = []
    sys.addaudithook(lambda event, given: opened.append(str(given[0])) if event == "open" else None)
    ways = {
        "above": "../out/in.{}",
        "absolute": f"{out}/in.{{}}",
        "a link": "link.{}",
        "around": "x/../../out/in.{}",
        "a URI": f"file://{out}/in.{{}}",
        "backslashes": "..\\out\\in.{}",
    }
    for kind, way in ways.items():
        for path in write(home, {suffix: way.format(suffix) for suffix in SUFFIXES}):
            opened.clear()
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    LOADERS.get(path.suffix, lambda path: wf.load(path, progress=False))(path)
                said = "loaded"
            except wf.SceneError as error:
                said = f"refused: {error}"
            real = [str(Path(each).resolve()) for each in opened]
            outside = [each for each in real if each.startswith(str(out))]
            print(json.dumps([kind, path.name, said, outside, len(real)]))


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, str, str, list[str], int]]:
    """What was opened for each file."""
    root = tmp_path_factory.mktemp("files").resolve()
    done = subprocess.run([sys.executable, __file__, str(root)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]
    return [tuple(json.loads(line)) for line in done.stdout.splitlines()]  # type: ignore[misc]


@pytest.mark.skipif(sys.platform == "win32", reason="symbolic links need rights there")
def test_no_reader_opens_a_file_outside_of_its_folder(
    found: list[tuple[str, str, str, list[str], int]],
) -> None:
    assert [each for each in found if each[3]] == []
    assert len(found) > 150
    assert all(count for *_, count in found)  # the hook hears of the file itself
    assert [each for each in found if "secret" in each[2]] == []


if __name__ == "__main__":
    main(Path(sys.argv[1]))
