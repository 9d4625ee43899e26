"""`wf.program` lists the stages that run for a scene, and the features that act between them."""

from pathlib import Path

import numpy as np
import pytest
from inside import accumulate, bounce_sample, intersect_and_compact, main, prepare_shading

import wavefront as wf

PACKAGE = Path(wf.__file__).parent
BALL, SKY = wf.Sphere((0, 0, 0), 1), wf.Environment(1.0)
FULL = ["generate", "intersect", "emitted", "mis_weighted", "accumulate", "compact", "interaction", "shading"]
FULL += ["direct", "bounce_sample", "roulette"]


def names(stages) -> list[str]:
    return [stage.name for stage in stages]


@pytest.mark.parametrize(
    ("integrator", "without"),
    [
        ("full", set()),
        ("direct_mis", {"roulette"}),
        ("direct_simple", {"mis_weighted", "roulette"}),
        ("naive", {"mis_weighted", "direct"}),
    ],
)
def test_each_estimator_has_its_stages(integrator: str, without: set[str]) -> None:
    found = wf.program([BALL, SKY], integrator=integrator, size=(8, 8), progress=False)
    assert names(found) == [name for name in FULL if name not in without]


def test_features_stand_where_they_act() -> None:
    glass = wf.Material(wf.Dielectric(1.5), interior=wf.Medium(absorption=1.0), alpha=0.5)
    scene = [wf.Sphere((0, 0, 0), 1, material=glass), wf.Sphere((3, 0, 0), 1), SKY]
    options = {"size": (8, 8), "background": "white", "branches": 2, "progress": False}
    listed = list(wf.program(scene, **options))
    found = {f"{each.name}.{each.point}": listed[i - 1].name for i, each in enumerate(listed) if each.point}
    assert found == {
        "Alpha.passable": "intersect",
        "Passing.fly": "Alpha",
        "Background.meet": "emitted",
        "Absorption.weaken": "interaction",
        "Branches.ways": "bounce_sample",
    }
    assert all((PACKAGE / each.file).is_file() and each.sentence.endswith(".") for each in listed)
    text = str(wf.program(scene, **options)).splitlines()
    assert len(text) == len(listed)
    assert text[0].startswith("generate ")
    assert text[2].startswith("  + Alpha.passable ")
    assert "(Camera rays only.)" in next(line for line in text if "Background" in line)


def test_what_is_of_a_user() -> None:
    class Own(wf.Feature):
        """Does nothing."""

        def fly(self, leg) -> None:
            pass

    def seen_directly(scene, paths, sampler, max_bounces):
        L = np.zeros((3, len(paths)), np.float32)
        paths, hits = intersect_and_compact(scene, paths, sampler, 0, L, mis=False)
        left = bounce_sample(paths, prepare_shading(scene, paths, hits), sampler, 0)
        accumulate(L, left, wf.integrators.emitted(scene, left, hits))
        return L

    listed = wf.program([BALL, SKY], integrator=seen_directly, features=Own(), size=(8, 8), progress=False)
    assert "direct" not in names(listed)
    own = next(each for each in listed if each.point)
    assert (own.name, own.point, own.file, own.sentence) == ("Own", "fly", __name__, "Does nothing.")


def test_the_command_lists_them(tmp_path: Path, capsys) -> None:
    path = str(tmp_path / "ball.ply")
    write_triangle(path)
    assert main(["info", "--stages", path]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines if not line.startswith("  +")] == FULL


def write_triangle(path: str) -> None:
    """A PLY file of one triangle."""
    header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    header += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    Path(path).write_text(header + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
