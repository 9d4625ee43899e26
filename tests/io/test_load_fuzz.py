"""Damaged files of every kind: a typed error or a scene, never anything else, within memory and time.

Half of the damage is to bytes, the other half to the structure of the format (file_damage.py). It is done in
a process of its own with 3 GB of memory and 25 s for each file; `python tests/io/test_load_fuzz.py SEED N`
repeats a run, and leaves a file that fails as `fuzz-SEED-NUMBER-NAME` in the current folder if KEEP is set.
"""

import os
import random
import re
import struct
import subprocess
import sys
import tempfile
import warnings
import zlib
from collections import Counter
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
import trimesh
from file_damage import mutate
from gltf_builder import Builder
from inside import (
    Cylinders,
    Display,
    IESLight,
    ImageData,
    SceneError,
    Sphere,
    Spheres,
    load,
    load_grid,
    load_materialx,
    load_points,
    load_weather,
    read_image,
    read_picture,
    write_image,
)
from PIL import Image as Pil

MEMORY = 3 << 30  # bytes
SECONDS = 25  # for one file
WORDS = b'0|-1|nan|inf|99999999999|1e400|/|//|\\|#|"|[|{|null|\x00|\xff| |\n|property|f |v |true|-'.split(
    b"|"
)
SCENES = {
    "s.mtl": "m.obj",
    "ball.xml": "s.xml",
    "m.serialized": "s.xml",
    "more.pbrt": "s.pbrt",
    "more.usda": "s.usda",
}  # which refer to these files
NUMBERS = (b"\xff\xff\xff\xff", b"\0\0\0\0", b"\xff\xff\xff\x7f", b"\0\0\0\x80")
OBJ = "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvn 0 0 1\nusemtl m\nf 1/1/1 2/2/1 3/1/1\n"
OBJ += "f -3//1 2 1/1\n"
XML = """<scene version="3.0.0"> <default name="r" value="2"/> <include filename="ball.xml"/>
<integrator type="path"><integer name="max_depth" value="3"/></integrator>
<sensor type="perspective"> <float name="fov" value="40"/> <transform name="to_world">
<lookat origin="0 0 4" target="0 0 0" up="0 1 0"/> </transform> <film type="hdrfilm"> <integer name="width"
value="8"/> <integer name="height" value="8"/> <rfilter type="tent"/> </film> <sampler type="independent">
<integer name="sample_count" value="2"/> </sampler> </sensor>
<emitter type="envmap"> <string name="filename" value="t.exr"/> <float name="scale" value="2"/> </emitter>
<emitter type="spot"> <rgb name="intensity" value="1, 2, 3"/> <float name="cutoff_angle" value="30"/>
</emitter>
<texture type="bitmap" id="t"> <string name="filename" value="t.png"/> <transform name="to_uv">
<scale x="2" y="2"/> </transform> </texture>
<bsdf type="twosided" id="b"> <bsdf type="roughconductor"> <ref id="t" name="alpha"/> </bsdf> </bsdf>
<shape type="shapegroup" id="g"> <shape type="ply"> <string name="filename" value="ball.ply"/> <ref id="b"/>
</shape> </shape> <shape type="instance"> <ref id="g"/> <transform name="to_world"> <rotate y="1" angle="30"/>
<translate value="1 2 3"/> </transform> </shape> <shape type="cylinder"> <emitter type="area"> <spectrum
name="radiance" value="400:1, 700:2"/> </emitter> </shape> <shape type="serialized"> <string name="filename"
value="m.serialized"/> </shape> </scene>"""
PBRT = """LookAt 0 1 5 0 1 0 0 1 0 Camera "perspective" "float fov" 40 Film "rgb"
WorldBegin Texture "t" "spectrum" "imagemap" "string filename" "t.png" "float uscale" 2
LightSource "infinite" "string filename" "t.square.exr" LightSource "distant" "blackbody L" 5000
ObjectBegin "o" Material "coateddiffuse" "texture reflectance" "t" Shape "plymesh"
"string filename" "ball.ply" ObjectEnd
Translate 0 1 0 ObjectInstance "o" Rotate 9 0 1 0 ObjectInstance "o" Include "more.pbrt" """
MORE = """AreaLightSource "diffuse" "rgb L" [ 1 2 3 ] "float power" 3 MakeNamedMaterial "m" "string type"
"conductor"
"spectrum eta" "metal-Au-eta" NamedMaterial "m" Shape "disk" "float radius" 2 Shape "sphere" "float zmax" .5
Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 1 1 0 0 1 0 ] "integer indices" [ 0 1 2 0 2 3 ]"""
BALL = """<scene version="0.6.0"> <shape type="sphere"> <float name="radius" value="$r"/>
<transform name="toWorld"> <matrix value="1 0 0 1 0 1 0 2 0 0 1 3 0 0 0 1"/> </transform> <bsdf type="mask">
<bsdf type="diffuse"> <texture type="checkerboard" name="diffuseReflectance"> <float name="uscale" value="2"/>
</texture> </bsdf> </bsdf> </shape> <shape type="obj"> <string name="filename" value="m.obj"/> </shape>
</scene>"""
USD = """#usda 1.0
(
 defaultPrim = "a"
 metersPerUnit = 0.1
 subLayers = [@more.usda@]
)
def Xform "a" (instanceable = true)
{
 double3 xformOp:translate = (1, 2, 3)
 uniform token[] xformOpOrder = ["xformOp:translate"]
 def Mesh "m" (prepend apiSchemas = ["MaterialBindingAPI"])
 {
  int[] faceVertexCounts = [4, 3]
  int[] faceVertexIndices = [0, 1, 2, 3, 0, 1, 2]
  point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)]
  texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
  color3f[] primvars:displayColor = [(1, 0, 0)]
  rel material:binding = </paint>
 }
 def Sphere "s"
 {
  double radius.timeSamples = { 0: 1, 1: 2 }
 }
}
def PointInstancer "p" (references = @more.usda@</x>)
{
 rel prototypes = [</a>]
 int[] protoIndices = [0, 0]
 point3f[] positions = [(0, 0, 0), (1, 0, 0)]
}
def Material "paint"
{
 token outputs:surface.connect = </paint/shader.outputs:surface>
 def Shader "shader"
 {
  uniform token info:id = "UsdPreviewSurface"
  color3f inputs:diffuseColor.connect = </paint/image.outputs:rgb>
  token outputs:surface
 }
 def Shader "image"
 {
  uniform token info:id = "UsdUVTexture"
  asset inputs:file = @t.png@
  float3 outputs:rgb
 }
}
def RectLight "l"
{
 float inputs:intensity = 3
}
def Camera "c"
{
 float fStop = 2
}
"""
LUMINAIRE = "IESNA:LM-63-2002\nTILT=INCLUDE\n1\n2\n0 90\n1 0.5\n"
LUMINAIRE += "1 -1 1 3 2 1 2 .1 .1 0\n1 1 20\n0 45 90\n0 90\n1 2 3\n3 2 1\n"
WEATHER = "LOCATION,Munich,,DEU,IWEC,108660,48.13,11.7,1.0,529.0\n" + "X\n" * 7
WEATHER += "".join(f"1999,6,21,{hour},60,f{',1' * 8},{hour},5,0\n" for hour in range(1, 25))
POINTS = "x,y,z\n" + "".join(f"{i},0,0.8\n" for i in range(9))
PAINT = """<materialx version="1.38"><image name="i" type="color3"><input name="file" type="filename"
value="t.png"/></image><standard_surface name="s" type="surfaceshader"><input name="base_color" type="color3"
nodename="i"/><input name="metalness" type="float" value="0.5"/></standard_surface> <surfacematerial name="m"
type="material"><input name="surfaceshader" type="surfaceshader" nodename="s"/></surfacematerial>
</materialx>"""
MTL = "newmtl m\nKd 1 1 1\nmap_Kd -s 1 1 1 t.png\nPr 0.3\nd 0.5\nKe 1 1 1\n"


def make_seeds(folder):
    """Write a sound file of every kind."""
    ball = trimesh.creation.icosphere(1)
    for extension in ("obj", "ply", "stl", "glb", "off", "dae", "3mf"):
        ball.export(folder / f"ball.{extension}")
    (folder / "text.ply").write_bytes(trimesh.exchange.ply.export_ply(ball, encoding="ascii"))
    (folder / "text.stl").write_text(trimesh.exchange.stl.export_stl_ascii(ball))
    (folder / "m.obj").write_text(OBJ)
    (folder / "s.mtl").write_text(MTL)
    (folder / "s.xml").write_text(XML)
    (folder / "ball.xml").write_text(BALL)
    (folder / "s.pbrt").write_text(PBRT)
    (folder / "more.pbrt").write_text(MORE)
    packed = struct.pack("<I5sQQ", 0x1001, b"part\0", 3, 1) + np.eye(3, dtype="<f4").tobytes() * 2
    packed += np.array([0, 1, 2], "<u4").tobytes()
    (folder / "m.serialized").write_bytes(struct.pack("<HH", 0x041C, 4) + zlib.compress(packed))
    build = Builder()
    info = build.image(np.zeros((4, 4, 3), np.uint8))
    build.material(
        pbrMetallicRoughness={"baseColorTexture": info, "metallicRoughnessTexture": info}, normalTexture=info
    )
    build.gltf(folder / "m.gltf")
    build.glb(folder / "m.glb")
    make_others(folder)
    for extension in ("png", "jpg", "exr", "hdr", "npy"):
        write_image(folder / f"t.{extension}", np.random.default_rng(0).random((9, 11, 3)))
    make_pictures(folder)
    write_image(folder / "t.square.exr", np.random.default_rng(0).random((8, 8, 3)))
    rgb = np.random.default_rng(1).random((9, 11, 3), np.float32)
    arrays = {"alpha": rgb[..., 0], "shape_id": np.arange(99, dtype=np.int32).reshape(9, 11)}
    metadata = {"background": "transparent", "noise": 0.1}
    layered = ImageData(rgb, arrays, {"spp": 4, "metadata": metadata, "names": {"shape": {0: "a"}}})
    for extension in ("exr", "npz"):
        write_image(folder / f"p.{extension}", layered)
    write_image(folder / "p.png", layered, Display(), bits=16)


def make_pictures(folder):
    """Write sound pictures of formats that are read and not written."""
    codes = np.random.default_rng(2).integers(0, 256, (9, 11, 4), np.uint8)
    color, deep = Pil.fromarray(codes), np.random.default_rng(3).random((9, 11), np.float32)
    for name in ("t.tga", "t.webp", "t.tiff"):
        color.save(folder / name)
    for name in ("t.gif", "t.ppm", "t.palette.tif"):
        (color.convert("P") if "palette" in name else color.convert("RGB")).save(folder / name)
    color.convert("CMYK").save(folder / "t.ink.jpg")
    color.convert("P").save(folder / "t.clear.png", transparency=bytes([0, 9, 200]))
    Pil.fromarray(deep).save(folder / "t.tif", compression="tiff_lzw")
    Pil.fromarray((deep * 65535).astype(np.uint16)).save(folder / "t.deep.tif")
    (folder / "t.pfm").write_bytes(b"Pf 11 9 -1\n" + deep.astype("<f4").tobytes())
    channels = {f"ViewLayer.{name}": deep for name in ("Combined.R", "Combined.G", "Combined.B", "Depth.Z")}
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    OpenEXR.File(header, channels).write(str(folder / "t.layers.exr"))


def make_others(folder):
    """Write files of luminaires, weather, points, grids and materials, and of USD where it is installed."""
    (folder / "l.ies").write_text(LUMINAIRE)
    (folder / "p.csv").write_text(POINTS)
    (folder / "m.mtlx").write_text(PAINT)
    if find_spec("pvlib"):
        (folder / "w.epw").write_text(WEATHER)
    grid = np.random.default_rng(2).random((3, 4, 5), np.float32)
    np.save(folder / "g.npy", grid)
    np.savez(folder / "g.npz", a=grid)
    head = struct.pack("<3sBi4i6f", b"VOL", 3, 1, 5, 4, 3, 1, 0, 0, 0, 1, 1, 1)
    (folder / "g.vol").write_bytes(head + grid.tobytes())
    if find_spec("nrrd"):
        text = "NRRD0005\ntype: float\ndimension: 3\nsizes: 5 4 3\nendian: little\nencoding: raw\n"
        text += "spacings: 1 2 3\n\n"
        (folder / "g.nrrd").write_bytes(text.encode() + grid.tobytes())
    if find_spec("pxr"):
        from pxr import Sdf, UsdUtils

        (folder / "s.usda").write_text(USD)
        (folder / "more.usda").write_text('#usda 1.0\nover "a"\n{\n}\ndef Sphere "x"\n{\n}\n')
        write_image(folder / "t.png", np.ones((4, 4, 3)))
        layer = Sdf.Layer.FindOrOpen(str(folder / "s.usda"))
        layer.Export(str(folder / "s.usdc"))
        UsdUtils.CreateNewUsdzPackage(str(folder / "s.usdc"), str(folder / "s.usdz"))


# readers of what is no scene and no picture
OTHERS = {
    "l.ies": lambda path: IESLight(path, (0, 2, 0)).lumens,
    "p.csv": load_points,
    "w.epw": load_weather,
    "m.mtlx": load_materialx,
    **dict.fromkeys(("g.npy", "g.npz", "g.vol", "g.nrrd"), load_grid),
}


def damage(data, rng):
    """Change bytes, put words in, cut, or repeat a part."""
    for _ in range(rng.choice((1, 1, 2, 5))):
        at = rng.randrange(len(data) + 1)
        kind = rng.randrange(6)
        if kind == 0:
            data = data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]
        elif kind == 1:
            data = data[:at] + rng.choice(WORDS) + data[at:]
        elif kind == 2:
            data = data[:at] + rng.choice(WORDS) + data[at + rng.randrange(12) :]
        elif kind == 3:
            data = data[:at] + rng.choice(NUMBERS) + data[at + 4 :]
        elif kind == 4:
            data = data[:at] + data[at // 2 : at // 2 + 60] + data[at:]
        else:
            data = data[:at]
    return data


def attempt(folder, name):
    """Load a file and return whether it loads; only a SceneError may stop it."""
    try:
        if name in OTHERS:
            OTHERS[name](folder / name)
        elif name.startswith("t."):
            assert read_image(folder / name).ndim == 3
        elif name.startswith("p."):
            assert read_picture(folder / name).rgb.shape[2] == 3
        else:
            found = load(folder / SCENES.get(name, name))
            assert found.shapes
            for shape in found.shapes:
                mesh = getattr(shape, "mesh", shape)
                if isinstance(mesh, Sphere | Cylinders):
                    assert np.isfinite(mesh.bounds).all()
                    continue
                if isinstance(mesh, Spheres):  # a file whose faces are damaged, not its points
                    assert np.isfinite(mesh.centers).all()
                    continue
                assert np.isfinite(mesh.vertices).all()
                assert mesh.faces.max() < len(mesh.vertices)
    except SceneError as error:
        if len(str(error)) < 10:
            raise AssertionError(f"{name}: {error!r} says nothing") from error
        return False
    return True


def main(seed, count):
    """Damage `count` files, and print how many of each kind loaded and were refused."""
    import resource
    import signal

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", UserWarning)  # repairs are announced
    rng = random.Random(seed)
    tally: Counter[tuple[str, bool]] = Counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_seeds(folder)
        sound = {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
        for number in range(count):
            name = rng.choice(list(sound))
            change = damage if rng.random() < 0.5 else partial(mutate, name)
            data = change(sound[name], rng)
            (folder / name).write_bytes(data)
            print(number, name, flush=True)
            if "KEEP" in os.environ:
                Path(f"fuzz-{seed}-{number}-{name}").write_bytes(data)
            signal.alarm(SECONDS)
            tally[name.rpartition(".")[2], attempt(folder, name)] += 1
            signal.alarm(0)
            if "KEEP" in os.environ:
                Path(f"fuzz-{seed}-{number}-{name}").unlink()
            (folder / name).write_bytes(sound[name])
    for kind in sorted({kind for kind, _ in tally}):
        print(f"{kind}: {tally[kind, True]} loaded, {tally[kind, False]} refused")


@pytest.mark.skipif(sys.platform != "linux", reason="memory limits as Linux has them")
@pytest.mark.parametrize(("seed", "count"), [(0, 24), pytest.param(1, 20000, marks=pytest.mark.slow)])
def test_damaged_files(seed, count):
    done = subprocess.run(
        [sys.executable, __file__, str(seed), str(count)], capture_output=True, text=True, errors="replace"
    )
    assert done.returncode == 0, done.stdout[-100:] + done.stderr[-3000:]
    print(f"{count} inputs tried")
    print(done.stdout.partition(f"\n{count - 1} ")[2])
    assert f"{count - 1} " in done.stdout


def mutated(parts, rng):
    """Return a text of which words are exchanged, left out or put in, or lose a letter."""
    parts = list(parts)
    for _ in range(rng.choice((1, 1, 1, 2))):
        at = rng.randrange(len(parts))
        word, other = parts[at], parts[rng.randrange(len(parts))]
        cut = rng.randrange(len(word) + 1)
        odd = rng.choice(WORDS[:16]).decode("latin-1")
        letters = word[:cut] + chr(rng.randrange(32, 127)) + word[cut + rng.randrange(3) :]
        parts[at] = rng.choice((other, odd, "", word + other, letters, letters))
    return "".join(parts)


@pytest.mark.parametrize("name", ["s.xml", "s.pbrt"])
@pytest.mark.parametrize("count", [20, pytest.param(3000, marks=pytest.mark.slow)])
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_mutated_scenes_are_shown_with_notes_of_file_and_line(tmp_path, name, count):
    make_seeds(tmp_path)
    path, rng = tmp_path / name, random.Random(count)
    parts = re.split(r"(\s+)", path.read_text())
    losses, messages = [], []
    for _ in range(count):
        path.write_text(mutated(parts, rng))
        try:
            scene = load(path, progress=False)
        except SceneError as error:
            messages.append(str(error))
            continue
        assert scene.shapes
        losses.append(scene.losses)
    assert len(messages) < count / 10
    assert all(each.startswith(str(tmp_path)) for each in messages)
    assert sum(map(bool, losses)) > count / 3
    assert [each for found in losses for each in found if not each.place.startswith(str(tmp_path))] == []


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
