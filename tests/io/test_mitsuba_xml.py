"""Scene files of Mitsuba: the elements of XML, parameters, includes, and what is refused."""

from __future__ import annotations

import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from counting import calls
from inside import Document, SceneFiles, main

import wavefront as wf

BALL = "<shape type='sphere'/>"


def write(folder: Path, body: str, name: str = "scene.xml", version: str = "3.0.0") -> Path:
    path = folder / name
    path.write_text(f"<scene version='{version}'>\n{body}\n</scene>\n")
    return path


def dictionary(folder: Path, body: str, version: str = "3.0.0", **parameters: Any) -> dict[str, Any]:
    path = write(folder, body, version=version)
    return Document(SceneFiles(path), path.read_bytes(), parameters).scene


def load(folder: Path, body: str, **options: Any) -> wf.Scene:
    return wf.load(write(folder, body), strict=True, **options)


def test_elements_become_the_dictionary_of_load_dict(tmp_path: Path) -> None:
    body = """
    <shape type="sphere" id="ball" name="own">
        <float name="radius" value="2"/> <boolean name="flip_normals" value="TRUE"/>
        <point name="center" x="1" z="3"/> <vector name="axis" value="1, 2 3"/>
        <string name="label" value="a b"/> <integer name="count" value="-3"/>
        <ref id="clay"/> <ref name="other" id="clay"/>
        <bsdf type="diffuse" id="clay"> <rgb name="reflectance" value="0.5"/> </bsdf>
        <spectrum name="a" value="400:1, 700:2"/> <spectrum name="b" filename="x.spd"/>
        <spectrum name="c" type="uniform"/>
    </shape>"""
    ball = dictionary(tmp_path, body)["own"]
    clay = {"type": "ref", "id": "clay"}
    assert ball == {
        "type": "sphere",
        "id": "ball",
        "radius": 2,
        "flip_normals": True,
        "center": [1, 0, 3],
        "axis": [1, 2, 3],
        "label": "a b",
        "count": -3,
        "_arg_0": clay,
        "other": clay,
        "_arg_1": {"type": "diffuse", "id": "clay", "reflectance": {"type": "rgb", "value": [0.5] * 3}},
        "a": {"type": "spectrum", "value": "400:1, 700:2"},
        "b": {"type": "spectrum", "filename": "x.spd"},
        "c": {"type": "uniform"},
    }


@pytest.mark.parametrize(
    ("steps", "point", "expected"),
    [
        ('<translate x="1" z="-2"/>', (0, 0, 0), (1, 0, -2)),
        ('<translate value="1 2 3"/>', (1, 0, 0), (2, 2, 3)),
        ('<scale value="2"/>', (1, 2, 3), (2, 4, 6)),
        ('<scale x="2" z="0.5"/>', (1, 2, 3), (2, 2, 1.5)),
        ('<rotate z="1" angle="90"/>', (1, 0, 0), (0, 1, 0)),
        ('<rotate value="0 0 2" angle="90"/><translate x="1"/>', (1, 0, 0), (1, 1, 0)),
        ('<translate x="1"/><rotate z="1" angle="90"/>', (1, 0, 0), (0, 2, 0)),
        ('<matrix value="0 -1 0 5  1 0 0 6  0 0 1 7  0 0 0 1"/>', (1, 2, 3), (3, 7, 10)),
        ('<matrix value="0 -1 0  1 0 0  0 0 1"/>', (1, 2, 3), (-2, 1, 3)),
        # looks along z, x points to the left
        ('<lookat origin="0 0 5" target="0 0 0" up="0 1 0"/>', (1, 2, 3), (-1, 2, 2)),
        # without up, values of Mitsuba 3.9.1
        ('<lookat origin="1 2 3" target="2 4 5"/>', (1, 2, 3), (4, 3, 5)),
    ],
)
def test_transforms(tmp_path: Path, steps: str, point: Any, expected: Any) -> None:
    made = dictionary(tmp_path, f'<shape type="cube"><transform name="to_world">{steps}</transform></shape>')
    np.testing.assert_allclose(made["_arg_0"]["to_world"] @ [*point, 1], [*expected, 1], atol=1e-12)


def test_parameters(tmp_path: Path) -> None:
    body = """
    <default name="r" value="2"/> <default name="kind" value="sphere"/> <default name="radius" value="9"/>
    <shape type="$kind"> <float name="radius" value="$r"/>
    <string name="s" value="a$r\\$b$radius"/> </shape>"""
    assert dictionary(tmp_path, body)["_arg_0"] == {"type": "sphere", "radius": 2, "s": "a2$b9"}
    assert dictionary(tmp_path, body, r=3.5, kind="disk")["_arg_0"]["radius"] == 3.5
    with pytest.raises(wf.SceneError, match="does not use the parameter 'rr'; did you mean"):
        dictionary(tmp_path, body, rr=1)
    with pytest.raises(wf.SceneError, match=r"scene\.xml: line 2: the parameter \$q has no value"):
        load(tmp_path, f'{BALL}<shape type="$q"/>')
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(wf.SceneError, match=r"parameters are for \.xml files"):
        wf.load(tmp_path / "a.obj", parameters={"r": 1})


def test_old_versions(tmp_path: Path) -> None:
    body = """
    <shape type="sphere"> <transform name="toWorld"> <lookAt origin="0,0,1" target="0,0,0" up="0,1,0"/>
    </transform> <bsdf type="diffuse"> <texture type="bitmap" name="diffuseReflectance">
    <float name="uscale" value="2"/> <float name="voffset" value="0.5"/>
    <string name="filterType" value="nearest"/>
    </texture> </bsdf> </shape>"""
    ball = dictionary(tmp_path, body, version="0.6.0")["_arg_0"]
    image = ball["_arg_0"]["reflectance"]
    assert ball["to_world"].shape == (4, 4)
    assert image["filter_type"] == "nearest"
    assert (image["to_uv"] @ [1, 1, 0, 1]).tolist() == [2, 1.5, 0, 1]


def test_includes_aliases_and_folders(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    write(tmp_path / "parts", '<default name="r" value="3"/><include filename="ball.xml"/>', "all.xml")
    (tmp_path / "parts" / "ball.xml").write_text(
        "<shape version='3.0.0' type='sphere'><float name='radius' value='$r'/><ref id='mud'/></shape>"
    )
    body = """
    <path value="meshes"/> <bsdf type="diffuse" id="clay"/> <alias id="clay" as="mud"/>
    <include filename="parts/all.xml"/> <shape type="obj"><string name="filename" value="a.obj"/></shape>"""
    scene = load(tmp_path, body, parameters={"r": 2})
    ball, mesh = scene.shapes
    assert ball.radius == 2  # type: ignore[attr-defined]
    assert ball.material.name == "clay"
    assert len(mesh.faces) == 1  # type: ignore[attr-defined]


def test_folders_of_includes_may_be_those_of_the_scene(tmp_path: Path) -> None:
    for name in ("scene", "scene/parts", "meshes"):
        (tmp_path / name).mkdir()
    (tmp_path / "meshes" / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    body = "<path value='../meshes'/><shape type='obj'><string name='filename' value='a.obj'/></shape>"
    write(tmp_path / "scene" / "parts", body, "part.xml")
    area = "<emitter type='area' id='lamp'/><sampler type='independent' id='s'/><bsdf type='hair' id='h'/>"
    made = load(tmp_path / "scene", f"<include filename='parts/part.xml'/>{area}", search_paths=tmp_path)
    assert (len(made.shapes), made.lights) == (1, [])  # what is only defined is not used


def test_files_outside_of_the_folder_need_search_paths(tmp_path: Path) -> None:
    home, other = tmp_path / "scene", tmp_path / "common"
    home.mkdir()
    other.mkdir()
    (other / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    body = "<path value='../common'/><shape type='obj'><string name='filename' value='a.obj'/></shape>"
    with pytest.raises(wf.SceneError, match=r"outside its folder and the search paths|missing"):
        load(home, body)
    assert load(home, body, search_paths=tmp_path).shapes
    assert main(["info", str(home / "scene.xml"), "--search-path", str(tmp_path)]) == 0


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("<shape/>", "line 2: <shape> has no type"),
        ("<shap type='sphere'/>", "<shap> is no element of scenes; did you mean 'shape'"),
        ("<scale value='2'/>", "it belongs in a <transform>"),
        ("<shape type='sphere' radius='2'/>", "unknown attribute 'radius'"),
        ("<shape type='sphere'><float name='radius'/></shape>", "<float> has no value"),
        (
            "<shape type='sphere'><float name='radius' value='x'/></shape>",
            "radius is 'x'; it must be a number",
        ),
        ("<shape type='sphere'><float name='radius' value='nan'/></shape>", "must be a number"),
        ("<shape type='sphere'><integer name='n' value='1.5'/></shape>", "it must be an integer"),
        ("<shape type='sphere'><boolean name='n' value='yes'/></shape>", "must be one of true, false"),
        ("<shape type='sphere'><rgb name='n' value='1 2'/></shape>", "a number or 3 numbers"),
        ("<shape type='sphere'><point name='n' value='1 2 3' x='1'/></shape>", "give one of them"),
        ("<shape type='sphere'><spectrum name='n'/></shape>", "needs a value or a filename"),
        ("<shape type='sphere'><float name='n' value='1'><ref id='x'/></float></shape>", "cannot be inside"),
        (
            "<shape type='sphere'><float name='n' value='1'/><float name='n' value='2'/></shape>",
            "given twice",
        ),
        ("<shape type='sphere'><transform name='t'><turn/></transform></shape>", "<turn> is no operation"),
        ("<shape type='sphere'><transform name='t'><scale w='2'/></transform></shape>", "attribute 'w'"),
        ("<shape type='sphere'><transform name='t'><rotate angle='2'/></transform></shape>", "axis is"),
        (
            "<shape type='sphere'><transform name='t'><matrix value='1'/></transform></shape>",
            "9 numbers or 16",
        ),
        ("<include filename='none.xml'/>", "line 2: .*none.xml' is missing"),
        ("<include filename='/etc/passwd'/>", "absolute path is not followed"),
        (
            "<shape type='obj'><string name='filename' value='a.obj'/></shape>",
            "line 2: obj: file 'a.obj' is miss",
        ),
        (
            "<shape type='obj'><string name='filename' value='../a.obj'/></shape>",
            "line 2: obj: refers to '../a",
        ),
        ("<path value='none'/>", "there is no such folder"),
        ("<shape type='sphere'><ref id='x'/></shape>", r"line 2: refers to the id 'x'"),
        ("<bsdf type='diffuse' id='a'/><bsdf type='diffuse' id='a'/>", "line 2: the id 'a' is used twice"),
        ("<shape type='sphere'>", "mismatched tag: line 3.*what follows is left out"),
        ("<shape type='spere'/>", "line 2: there is no plugin 'spere'; did you mean 'sphere'"),
    ],
)
def test_what_is_malformed_costs_its_element_and_is_noted_with_its_line(
    tmp_path: Path, body: str, message: str
) -> None:
    body = f"{BALL}{body}"
    with pytest.warns(UserWarning, match=message) as found:
        made = wf.load(write(tmp_path, body))
    assert "scene.xml" in str(found[0].message)
    assert isinstance(made.shapes[0], wf.Sphere)
    assert made.losses
    with pytest.raises(wf.SceneError, match=message):
        load(tmp_path, body)


def test_what_is_lost_of_an_element(tmp_path: Path) -> None:
    """A number its value, a transform a step, a shape its bsdf; the others stay as they are."""
    body = """<shape type="sphere"><float name="radius" value="x"/>
    <point name="center" x="1" y="2" z="3"/></shape> <shape type="sphere">
    <transform name="to_world"><scale value="2"/><turn x="1"/><translate x="5"/></transform></shape>
    <shape type="sphere"><ref id="none"/><float name="radius" value="3"/></shape>
    <shape type="obj"><string name="filename" value="none.obj"/></shape>"""
    with pytest.warns(UserWarning, match="4 things not as in the file"):
        one, two, three = wf.load(write(tmp_path, body)).shapes
    assert (one.radius, one.center.tolist()) == (1, [1, 2, 3])
    assert (two.radius, two.center.tolist()) == (2, [5, 0, 0])
    assert (three.radius, np.ravel(three.material.bsdf.reflectance).tolist()) == (3, [0.5] * 3)


def test_files_of_old_versions_name_it_and_keep_what_they_can(tmp_path: Path) -> None:
    body = """<integrator type="bdpt"><integer name="maxDepth" value="5"/></integrator>
    <bsdf type="phong" id="p"><rgb name="diffuseReflectance" value=".5 .25 1"/></bsdf>
    <shape type="sphere"><bsdf type="coating"><ref id="p"/></bsdf></shape> <subsurface type="dipole"/>
    <camera type="perspective"><film type="ldrfilm"><integer name="width" value="64"/></film></camera>"""
    with pytest.warns(UserWarning, match=r"'phong' in Mitsuba 3; the file is of Mitsuba 0\.6\.0") as found:
        made = wf.load(write(tmp_path, body, version="0.6.0"))
    assert "<subsurface> is no element of scenes in Mitsuba 3; the file is of" in str(found[0].message)
    assert made.shapes[0].material.bsdf.front.reflectance.ravel().tolist() == [0.5, 0.25, 1]
    assert made.settings["max_bounces"] == 4
    assert made.camera is not None
    assert made.camera.size == (64, 576)


def test_nothing_that_can_be_shown_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(wf.SceneError, match=r"has no shapes: line 2: there is no plugin 'spere'.*left out"):
        wf.load(write(tmp_path, "<shape type='spere'/>"))
    (tmp_path / "a.xml").write_text("<html version='3.0.0'/>")
    with pytest.raises(wf.SceneError, match="cannot be the first element"):
        wf.load(tmp_path / "a.xml")


def test_light_from_far_away_alone_is_a_scene(tmp_path: Path) -> None:
    made = load(tmp_path, '<emitter type="constant"><rgb name="radiance" value="1 .5 .25"/></emitter>')
    image = wf.render(made, spp=1, size=(4, 4), progress=False)
    np.testing.assert_allclose(image.rgb, np.broadcast_to([1, 0.5, 0.25], (4, 4, 3)))


def test_versions_are_needed(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(f"<scene>{BALL}</scene>")
    with pytest.warns(UserWarning, match=r"a\.xml: line 1: <scene> has no version; read as of 3\.0\.0"):
        assert wf.load(tmp_path / "a.xml").shapes
    with pytest.warns(UserWarning, match="version is 'x'.*read as of"):
        assert wf.load(write(tmp_path, BALL, version="x")).shapes


def test_bombs_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(
        '<!DOCTYPE s [<!ENTITY a "x"><!ENTITY b "&a;&a;">]><scene version="3.0.0">&b;</scene>'
    )
    with pytest.raises(wf.SceneError, match="line 1: has a document type"):
        wf.load(tmp_path / "a.xml")
    write(tmp_path, '<include filename="own.xml"/>', "own.xml")
    with pytest.raises(wf.SceneError, match="files include each other; the limit is 15 levels"):
        wf.load(tmp_path / "own.xml")
    for level in range(10):  # 10^9 files
        write(tmp_path, f'<include filename="b{level + 1}.xml"/>' * 8, f"b{level}.xml")
    write(tmp_path, BALL, "b10.xml")
    with pytest.raises(wf.SceneError, match=r"more than 1024 files; the limit is LoadLimits\.includes"):
        wf.load(tmp_path / "b0.xml")
    deep = "<bsdf type='twosided'>" * 5000 + "</bsdf>" * 5000
    with pytest.raises(wf.SceneError, match="nested deeper than 128"):
        load(tmp_path, deep)


def test_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    film = '<film type="hdrfilm"><integer name="width" value="$w"/><integer name="height" value="6"/></film>'
    body = f"""
    <default name="w" value="8"/> <integrator type="path"><integer name="max_depth" value="3"/></integrator>
    <sensor type="perspective">{film}<sampler type="independent"><integer name="sample_count" value="2"/>
    </sampler><transform name="to_world"><translate z="-4"/></transform></sensor>
    {BALL}<emitter type="constant"/>"""
    path = write(tmp_path, body)
    assert main(["info", str(path), "-D", "w=12"]) == 0
    told = capsys.readouterr().out
    assert "settings: filter GaussianFilter(radius=2.0, stddev=0.5, windowed=True), spp 2, max_b" in told
    out = tmp_path / "out.npz"
    assert main(["render", str(path), "-D", "w=12", "-o", str(out), "--quiet"]) == 0
    image = wf.Image.load(out)
    assert (image.rgb.shape, image.spp) == ((6, 12, 3), 2)
    assert main(["render", str(path), "-o", str(out), "--quiet", "--spp", "3", "--size", "4x4"]) == 0
    assert (wf.Image.load(out).rgb.shape, wf.Image.load(out).spp) == ((4, 4, 3), 3)
    assert main(["info", str(path), "-D", "h=12"]) == 2
    assert "does not use the parameter 'h'" in capsys.readouterr().err


def test_a_default_that_is_given_counts_before_the_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bounces = []

    def finish(session: wf.Session) -> wf.Image:
        bounces.append(session._settings.values["max_bounces"])
        return session.run()

    monkeypatch.setattr("wavefront.cli.render_command.finish", finish)
    integrator = '<integrator type="path"><integer name="max_depth" value="2"/></integrator>'
    path = write(tmp_path, f'{integrator}{BALL}<emitter type="constant"/>')
    for given in (["--max-bounces", "12"], []):
        rest = ["-o", str(tmp_path / "out.npz"), "--quiet", "--spp", "1", "--size", "4x4", *given]
        assert main(["render", str(path), *rest]) == 0
    assert bounces == [12, 1]


def test_a_file_keeps_the_medium_around(tmp_path: Path) -> None:
    fog = "<sensor type='perspective'> <medium type='homogeneous' id='fog'/> </sensor>"
    assert isinstance(load(tmp_path, BALL + fog).medium, wf.Medium)


def test_a_dollar_sign_may_stand_for_itself(tmp_path: Path) -> None:
    body = """<default name="a" value="x"/> <default name="ab" value="y"/>
    <shape type="sphere"> <string name="s" value="\\$\\$a$a\\$$ab$abc$$"/> </shape>"""
    with pytest.raises(wf.SceneError, match=r"line \d+: the parameter \$ has no value"):
        load(tmp_path, body)
    assert dictionary(tmp_path, body.replace('$$"', '"'))["_arg_0"]["s"] == "$$ax$yyc"


def test_the_text_of_parameters_counts_as_memory_of_the_load(tmp_path: Path) -> None:
    """Each value is ten times the one before; 554 bytes would be a third of a gigabyte."""
    values = ["x" * 3, *(f"$a{level}" * 10 for level in range(8))]
    body = "".join(f'<default name="a{level}" value="{value}"/>' for level, value in enumerate(values))
    tracemalloc.start()
    with pytest.raises(wf.SceneError, match=r"line \d+: the value of \$a\d takes .*LoadLimits\.memory_bytes"):
        dictionary(tmp_path, body + '<shape type="$a8"/>')
    assert tracemalloc.get_traced_memory()[1] < 2**27
    tracemalloc.stop()


def test_many_parameters_take_time_in_proportion(tmp_path: Path) -> None:
    def work(count: int) -> int:
        body = "".join(f'<default name="n{i}" value="1"/>' for i in range(count))
        body += "".join(
            f'<shape type="sphere"><float name="radius" value="$n{i}"/></shape>' for i in range(count)
        )
        return calls(lambda: dictionary(tmp_path, body))

    assert work(2000) < 4.2 * work(500)  # 16 times where each looks at all others


def test_names_of_parameters_are_short(tmp_path: Path) -> None:
    with pytest.raises(wf.SceneError, match=r"line \d+: the name of a parameter has more than 256 letters"):
        load(tmp_path, f'{BALL}<default name="{"a" * 257}" value="1"/>')
