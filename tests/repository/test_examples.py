"""Every example runs as its user would run it, at a tiny size, and writes a sensible picture."""

import importlib.util
import re
import runpy
import sys
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
from inside import BSDFS_ALL as ALL
from inside import OpenPBRBsdf, as_material

import wavefront as wf

EXAMPLES = Path(__file__).parents[2] / "examples"
SHAPES = {  # the picture of --size 24, (height, width)
    "caustics": (15, 24),
    "cloud": (18, 24),
    "cornell_box": (24, 24),
    "cradle": (16, 16, 24),
    "course_figures": (640, 1200),
    "course_spheres": (24, 24),
    "cuboids": (16, 24),
    "default_look": (20, 24),
    "depth_of_field": (13, 24),
    "environment": (13, 24),
    "estimators": (24, 96),
    "fog": (18, 24),
    "fruit": (16, 24),
    "furnace": (24, 120),
    "gltf_scene": (15, 24),
    "interior": (16, 24),
    "layers": (62, 108),
    "material_sheet": (16, 24),
    "milk": (24, 24),
    "molecule": (16, 24),
    "office": (440, 1200),
    "optical_flow": (16, 48),
    "own_material": (15, 24),
    "photograph": (16, 24),
    "scan": (16, 24),
    "skies": (32, 72),
    "spheres": (16, 24),
    "terrace": (13, 24),
}


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run an example in an empty folder; return what it prints, and its picture (H, W, 3) in [0, 1]."""

    def run_example(name, *options):
        output = tmp_path / f"{name}.png"
        monkeypatch.chdir(tmp_path)
        monkeypatch.syspath_prepend(EXAMPLES)  # some import others
        monkeypatch.setattr(sys, "argv", [name, str(output), *options])
        runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
        printed = capsys.readouterr().out
        assert printed.splitlines()[-1] == f"wrote {output}"
        return printed, iio.imread(output) / 255

    return run_example


def load(name):
    """Import an example by its path."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_all_examples_are_here():
    assert {path.stem for path in EXAMPLES.glob("*.py")} == set(SHAPES)


def test_the_overview_lists_all_examples():
    text = (EXAMPLES.parent / "docs" / "overview.md").read_text("utf-8")
    table = text.partition("## Examples")[2].partition("\n## ")[0]
    listed = re.findall(r"^\| \[(\w+)\.py\]\(\.\./examples/\1\.py\) \|", table, re.MULTILINE)
    assert sorted(listed) == sorted(SHAPES)


QUICK = ["cornell_box", "course_spheres", "cuboids", "depth_of_field"]


@pytest.mark.parametrize("name", [*QUICK, *sorted(SHAPES.keys() - {"furnace", *QUICK})])
@pytest.mark.first(len(QUICK))
def test_example_writes_a_picture(name, run):
    _, picture = run(name, "--spp", "2", "--size", "24")
    assert picture.shape == (*SHAPES[name], 3)
    assert picture.std() > 0.05
    assert 0.01 < picture.mean() < 0.9


@pytest.mark.parametrize("figure", ["plates", "bounces", "samples", "lobes", "roulette", "estimators"])
@pytest.mark.first(3)
def test_figures_of_the_course(figure, run, recwarn):
    _, picture = run("course_figures", "--spp", "4", "--size", "16", "--figure", figure)
    assert picture.shape[1] >= 1000
    assert picture.std() > 0.05


@pytest.mark.parametrize("name", SHAPES)
def test_example_names_its_defaults(name):
    text = (EXAMPLES / f"{name}.py").read_text()
    spp = re.search(r'"--spp", type=int, default=(\d+)', text)[1]
    size = re.search(r'"--size", type=int, default=(\d+)', text)[1]
    assert f"python examples/{name}.py [out.png] [--spp {spp}] [--size {size}]" in text


@pytest.mark.parametrize("name", ["spheres", "cuboids", "molecule"])
def test_scenes_of_scientists_are_short(name):
    """At most 20 lines, from the numbers to the picture."""
    code = (EXAMPLES / f"{name}.py").read_text().partition("parse_args()")[2]
    assert len([line for line in code.splitlines() if line.strip()]) <= 20


@pytest.mark.slow
def test_furnace_prints_numbers_within_their_errors(run):
    out, picture = run("furnace", "--spp", "16", "--size", "8")
    number, signed = r"\s+([\d.]+)", r"\s+([+-][\d.]+)"
    rows = re.findall(rf"^(\D.*?){signed}{number}{number}{number}{signed}%$", out, re.MULTILINE)
    assert [float(exact) for _, _, exact, *_ in rows] == [2, 5, 1, 1, 1]
    for name, t, exact, mean, error, off in rows:
        difference = float(mean) - float(exact)
        # Student's t with 15 degrees of freedom is beyond 6 with a probability of 2e-5
        assert abs(difference) < 6 * float(error) + 1e-5, name
        assert float(error) < 0.01 * float(exact)
        if float(error) > 1e-4:
            assert float(t) == pytest.approx(difference / float(error), abs=0.1)
        assert float(off) == pytest.approx(100 * difference / float(exact), abs=2e-3)
    gray = 0.5 ** (1 / 2.2)
    assert abs(picture.mean() - gray) < 0.01
    assert np.abs(picture - gray).max() < 0.2


def test_cornell_box_has_its_colors_where_they_belong():
    rgb = wf.render(load("cornell_box").cornell_box(32), 16, progress=False).rgb
    left, right, floor = rgb[8:24, 2:5].mean((0, 1)), rgb[8:24, -5:-2].mean((0, 1)), rgb[-3, 8:24].mean(0)
    assert left[0] > 4 * left[1]
    assert right[1] > 2 * right[0]
    assert floor[0] > floor[1] > floor[2] > 0
    assert rgb.max() > 15  # the light itself


def test_course_spheres_show_matte_mirror_and_glass():
    rgb = wf.render(load("course_spheres").course_spheres(48), 32, progress=False).rgb
    height, width, _ = rgb.shape
    diffuse = rgb[27:31, 7:11].mean((0, 1))
    assert diffuse[0] > 1.5 * diffuse[2]  # orange
    assert (rgb.reshape(-1, 3).min(0) >= 0).all()
    assert (rgb[: height // 8].mean(), rgb[-height // 8 :].mean()) > (0.05, 0.05)  # ceiling and floor
    assert rgb[height // 3, 1, 0] > rgb[height // 3, 1, 2]  # red wall on the left
    assert rgb[height // 3, width - 2, 2] > rgb[height // 3, width - 2, 0]  # blue wall on the right


def test_own_material_is_proved_and_shines_back(run):
    out, picture = run("own_material", "--spp", "4", "--size", "48")
    assert "FAIL" not in out
    assert "chi-square" in out
    left, right = picture[:, :24].max(), picture[:, 24:].max()
    assert right > 1.3 * left


def test_estimators_agree_where_they_estimate_the_same(run):
    module = load("estimators")
    assert list(module.ESTIMATORS) == ["naive", "direct_simple", "direct_mis", "full"]
    results = module.compare(module.courtyard(24), 32)
    mean = {name: picture.mean() for name, (picture, _) in results.items()}
    error = {name: np.sqrt(variance / 32 / (24 * 24 * 3)) for name, (_, variance) in results.items()}
    for one, other in (("naive", "full"), ("direct_simple", "direct_mis")):
        # the channels of a pixel are correlated, so its error may be √3 as large
        assert abs(mean[one] - mean[other]) < 5 * np.sqrt(3) * np.hypot(error[one], error[other])
    assert mean["full"] > 1.1 * mean["direct_mis"]
    variance = {name: variance for name, (_, variance) in results.items()}
    assert variance["full"] < variance["naive"]
    assert variance["direct_mis"] < variance["direct_simple"] / 2
    out, _ = run("estimators", "--spp", "2", "--size", "16")
    assert [line.split()[0] for line in out.splitlines()[1:5]] == list(module.ESTIMATORS)


def test_material_sheet_has_every_material_of_the_package():
    rows = load("material_sheet").rows()
    assert [len(row) for row in rows] == [9] * 6
    materials = [[as_material("ball", item) for item in row] for row in rows]
    shown = {type(material.bsdf) for row in materials for material in row}
    # a smooth `Conductor` shows a mirror, `Principled` what `OpenPBR` does, and `ThinDisney` a matte sheet
    assert shown == set(ALL) - {wf.Mirror, OpenPBRBsdf}
    assert any(material.normal_map is not None for material in materials[-1])
    assert any(material.opacity is not None for material in materials[-1])


def test_gltf_scene_is_honored_whole(tmp_path):
    scene = load("gltf_scene").scene(tmp_path / "a.glb", 48)
    instances = [shape for shape in scene.shapes if isinstance(shape, wf.Instance)]
    assert len(instances) == 7
    assert len({id(instance.mesh) for instance in instances}) == 1
    assert [type(light) for light in scene.lights] == [wf.SpotLight, wf.Environment]
    assert sum(shape.emission is not None for shape in scene.shapes) == 1
    assert sum(shape.material.opacity is not None for shape in scene.shapes) == 1
    assert sum(shape.material.bsdf.transmissive for shape in scene.shapes) == 1
    rgb = wf.render(scene, 16, progress=False).rgb
    urn, ball, bare = rgb[9, 20:25].mean(0), rgb[16:19, 31:36].mean((0, 1)), rgb[27:].mean((0, 1))
    assert urn[2] > 1.5 * urn[0]  # blue glaze
    assert ball[1] > 1.2 * max(ball[0], ball[2])  # green glass
    assert bare[0] > bare[2]  # the floor by the light of the warm panel
