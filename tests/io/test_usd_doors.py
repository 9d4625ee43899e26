"""What files of USD may open and take: layers, prims, memory, time, and a crash of usd-core."""

from __future__ import annotations

import os
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import pytest
from inside import CHILD, Child
from scripts import children, eventually, runs, start_python, wait_for

import wavefront as wf

pytest.importorskip("pxr")
H = "#usda 1.0\n"
BALL = 'def Sphere "ball"\n{\n}\n'
LIMITS = wf.LoadLimits(seconds=20)
DOORS = {
    "sublayer": "(\n subLayers = [@{}@]\n)\n",
    "reference": 'def Xform "a" (references = @{}@</x>)\n{{\n}}\n',
    "payload": 'def Xform "a" (payload = @{}@</x>)\n{{\n}}\n',
    "an argument": 'def Xform "a" (references = @{}:SDF_FORMAT_ARGS:a=b@</x>)\n{{\n}}\n',
    "packed": 'def Xform "a" (references = @{}[x.usda]@</x>)\n{{\n}}\n',
    "a variant": """def Xform "a" (
 variants = {{ string v = "a" }}
 prepend variantSets = "v"
)
{{
 variantSet "v" = {{
 "a" (references = @{}@</x>) {{
 }}
 }}
}}
""",
    "clips": """def Xform "a" (
 clips = {{
 dictionary default = {{
 asset[] assetPaths = [@{}@]
 asset manifestAssetPath = @{}@
 string primPath = "/a"
 double2[] active = [(0, 0)]
 double2[] times = [(0, 0), (1, 1)]
 }}
 }}
)
{{
 custom double x
}}
""",
    "numbered clips": """def Xform "a" (
 clips = {{
 dictionary default = {{
 string primPath = "/a"
 string templateAssetPath = "{}"
 double templateStartTime = 1
 double templateEndTime = 1
 double templateStride = 1
 }}
 }}
)
{{
 custom double x
}}
""",
    "a picture in an archive": 'def RectLight "l"\n{{\n asset inputs:texture:file = @{}[a.png]@\n}}\n',
    "a picture": 'def RectLight "l"\n{{\n asset inputs:texture:file = @{}@\n}}\n',
    "a variable": '(\n expressionVariables = {{ string N = "{}" }}\n subLayers = [@`"${{N}}"`@]\n)\n',
}


def load(path: Path, **options: Any) -> wf.Scene:
    return wf.load(path, progress=False, **{"limits": LIMITS, **options})


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("way", ["../out/f1", "f1", "link1", "{absolute}/f1", "sub/../../out/f1"])
def test_what_is_no_file_of_the_scene_is_not_opened(tmp_path: Path, door: str, way: str) -> None:
    """Whoever opens one of the pipes waits for its other end."""
    home, out = tmp_path / "home", tmp_path / "out"
    home.mkdir()
    out.mkdir()
    (home / "sub").mkdir()
    suffix = {"packed": "z", "a picture in an archive": "z", "a picture": ".png"}.get(door, "a")
    suffix = suffix if suffix == ".png" else f".usd{suffix}"
    os.mkfifo(out / f"f1{suffix}")
    os.mkfifo(home / f"f1{suffix}")
    (home / f"link1{suffix}").symlink_to(out / f"f1{suffix}")
    name = way.format(absolute=out) + suffix
    if door == "numbered clips":
        name = name.replace("1.", ".#.")
        for folder in (home, out):
            os.mkfifo(folder / "f.1.usda")
        (home / "link.1.usda").symlink_to(out / "f1.usda")
    head, rest = DOORS[door].replace("{}", name).replace("{{", "{").replace("}}", "}"), BALL
    (home / "a.usda").write_text(H + head + rest)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        scene = load(home / "a.usda")
    assert [shape.name for shape in scene.shapes if isinstance(shape, wf.Sphere)] == ["ball"]
    said = "device or pipe" if way == "f1" else "outside its folder"
    assert [said in str(each.message) for each in told] == [True]


TREE = 'def Xform "r0"\n{\n def Sphere "s"\n {\n }\n}\n'
TEN = ", ".join(["(0, 0, 0)"] * 10)


def branches(level: int, arc: str) -> str:
    """Return a prim that holds the one of the level below ten times."""
    inside = "".join(f' def Xform "c{i}" ({arc})\n {{\n }}\n' for i in range(10))
    return f'def Xform "r{level}"\n{{\n{inside}}}\n'


def instancer(level: int, prototypes: str, count: int) -> str:
    which = [i % (prototypes.count("<")) for i in range(count)]
    return f"""def PointInstancer "p{level}"
{{
 rel prototypes = [{prototypes}]
 int[] protoIndices = {which}
 point3f[] positions = [{", ".join(["(0, 0, 0)"] * count)}]
}}
"""


BOMBS = {
    "references": TREE + "".join(branches(i, f"references = </r{i - 1}>") for i in range(1, 9)),
    "payloads": TREE + "".join(branches(i, f"payload = </r{i - 1}>") for i in range(1, 9)),
    "inherited": TREE + "".join(branches(i, f"inherits = </r{i - 1}>") for i in range(1, 9)),
    "instances": TREE
    + "".join(branches(i, f"references = </r{i - 1}>\n instanceable = true") for i in range(1, 9)),
    "what a reference brings": TREE
    + "".join(
        branches(i, f"references = </q{i - 1}/k>")
        + f'def "w{i - 1}"\n{{\n def "k" (references = </r{i - 1}>)\n {{\n }}\n}}\n'
        + f'def "q{i - 1}" (references = </w{i - 1}>)\n{{\n}}\n'
        for i in range(1, 9)
    ),
    "instancers": 'def Sphere "p0"\n{\n}\n' + "".join(instancer(i, f"</p{i - 1}>", 10) for i in range(1, 9)),
    "prototypes": 'def Sphere "a0"\n{\n}\ndef Sphere "b0"\n{\n}\n'
    + "".join(
        instancer(i, f"</a{i - 1}>, </b{i - 1}>", 4).replace(f'"p{i}"', f'"{name}{i}"')
        for i in range(1, 16)
        for name in "ab"
    ),
}


QUICK = "references", "instancers", "prototypes"  # the others take a second each


@pytest.mark.parametrize(
    "bomb", [each if each in QUICK else pytest.param(each, marks=pytest.mark.slow) for each in BOMBS]
)
def test_prims_are_counted_before_they_are_made(tmp_path: Path, bomb: str) -> None:
    path = tmp_path / "a.usda"
    path.write_text(H + BOMBS[bomb])
    begin = time.monotonic()
    with pytest.raises(wf.SceneError, match=r"^\S+a\.usda: /\S+: is beyond the limit"):
        load(path, limits=wf.LoadLimits(seconds=60))
    assert time.monotonic() - begin < 50


@pytest.mark.parametrize("places", ["</p1>", "</p0>"])
def test_an_instancer_does_not_place_itself(tmp_path: Path, places: str) -> None:
    path = tmp_path / "a.usda"
    path.write_text(H + instancer(0, "</p1>", 1) + instancer(1, places, 1))
    with pytest.raises(wf.SceneError, match=r"places itself|cannot be placed|deeper than"):
        load(path)


def test_layers_in_allowed_folders_are_read(tmp_path: Path) -> None:
    """Also by absolute names, from a folder of the search paths, from an archive, by variables, and clips."""
    from pxr import UsdUtils

    home, shared = tmp_path / "home", tmp_path / "shared"
    home.mkdir()
    shared.mkdir()
    for folder, name in ((home, "beside"), (home, "absolute"), (shared, "far"), (home, "packed")):
        (folder / f"{name}.usda").write_text(f'{H}(defaultPrim = "x")\ndef "x"\n{{\n{BALL}}}\n')
    (home / "clip.1.usda").write_text(H + 'over "c"\n{\n double radius.timeSamples = { 0: 3 }\n}\n')
    UsdUtils.CreateNewUsdzPackage(str(home / "packed.usda"), str(home / "packed.usdz"))
    names = ("beside.usda", home / "absolute.usda", "far.usda", "packed.usdz", "packed.usdz[packed.usda]")
    body = "".join(f'def "a{i}" (references = @{name}@)\n{{\n}}\n' for i, name in enumerate(names))
    body += 'def "v" (references = @`"${NAME}.usda"`@)\n{\n}\n'
    body += """def Sphere "c" (
 clips = {
 dictionary default = {
 string templateAssetPath = "clip.#.usda"
 string primPath = "/c"
 double templateStartTime = 1
 double templateEndTime = 1
 double templateStride = 1
 }
 }
)
{
}
"""
    path = home / "a.usda"
    head = '(expressionVariables = { string NAME = "beside" }\nmetersPerUnit = 1)\n'
    path.write_text(H + head + body)
    scene = load(path, strict=True, search_paths=shared, time=1 / 24)
    assert [shape.radius for shape in scene.shapes] == [1] * 6 + [3]


def test_a_layer_that_is_missing_or_damaged_costs_what_it_holds(tmp_path: Path) -> None:
    (tmp_path / "bad.usda").write_text("#usda 1.0\ndef {")
    (tmp_path / "a.usda").write_text(
        f'{H}(subLayers = [@none.usda@])\n{BALL}def "b" (references = @bad.usda@</x>)\n{{\n}}\n'
    )
    with pytest.warns(UserWarning, match=r"(?s)refers to 'none\.usda', which is missing.*bad\.usda") as told:
        assert len(load(tmp_path / "a.usda").shapes) == 1
    assert len(told) == 1


def test_text_that_is_not_utf_8_is_a_typed_error(tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_bytes((H + 'def Sphere "S"\n{\n double radius = \xff\n}\n').encode("latin-1"))
    with pytest.raises(wf.SceneError, match=r"a\.usda: cannot be read") as error:
        load(tmp_path / "a.usda")
    assert "a.usda:4:2" in str(error.value)


def test_a_crash_of_usd_core_is_a_typed_error(tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_text(H + BALL)
    with pytest.raises(wf.SceneError, match=r"a\.usda: ends usd-core by signal 6"):
        CHILD.call("a.usda", 20, os.abort)
    assert load(tmp_path / "a.usda").shapes


@pytest.mark.slow
def test_a_process_of_usd_core_that_hangs_or_ends_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_text(H + BALL)
    with pytest.raises(wf.SceneError, match=r"a\.usda: ends usd-core with status 0"):
        CHILD.call("a.usda", 20, os._exit, 0)
    with pytest.raises(wf.SceneError, match=r"a\.usda: takes more than 0\.2 seconds.*LoadLimits\.seconds"):
        CHILD.call("a.usda", 0.2, time.sleep, 60)
    assert load(tmp_path / "a.usda").shapes


@pytest.mark.skipif(sys.platform != "linux", reason="memory limits as Linux has them")
def test_memory_of_usd_core_is_limited(tmp_path: Path) -> None:
    """A file of a few kilobytes holds integers that become hundreds of megabytes."""
    from pxr import Sdf, Vt

    path = tmp_path / "a.usdc"
    layer = Sdf.Layer.CreateAnonymous(".usdc")
    layer.ImportFromString(H + 'def Mesh "m"\n{\n int[] faceVertexCounts\n int[] faceVertexIndices\n}\n')
    for name in ("faceVertexCounts", "faceVertexIndices"):
        layer.GetAttributeAtPath(f"/m.{name}").default = Vt.IntArray(2**25)
    layer.Export(str(path))
    assert path.stat().st_size < 2**18
    with pytest.raises(wf.SceneError, match=r"a\.usdc: .*memory"):
        load(path, limits=wf.LoadLimits(memory_bytes=2**20))
    (tmp_path / "a.usda").write_text(H + BALL)
    assert load(tmp_path / "a.usda", limits=wf.LoadLimits(memory_bytes=2**20)).shapes


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="children are looked for in /proc")
def test_the_process_of_usd_core_ends_with_its_parent(tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_text(H + BALL)
    code = "import sys, wavefront as wf; wf.load(sys.argv[1]); print('loaded', flush=True); sys.stdin.read()"
    process = start_python("-c", code, str(tmp_path / "a.usda"))
    wait_for(process, "loaded")
    (child,) = children(process)
    process.kill()
    process.communicate()
    assert eventually(lambda: not runs(child))


@pytest.mark.slow
def test_the_process_of_usd_core_imports_nothing_from_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A scene may lie beside a module of a name that Python looks for."""
    (tmp_path / "numpy.py").write_text("raise SystemExit(3)")
    monkeypatch.chdir(tmp_path)
    child = Child()
    assert child.call("a.usda", 60, len, "abc") == 3
    child.close()
