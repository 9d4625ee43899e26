"""A user's script type-checks against the package, strictly, and its mistakes are found."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

GOOD = """
from __future__ import annotations

import numpy as np
import numpy.typing as npt

import wavefront as wf

Array = npt.NDArray[np.float32]


class Glow(wf.Bsdf):
    def __init__(self, strength: float) -> None:
        self.strength = np.array([strength], np.float32)

    def f(self, wo: Array, wi: Array) -> Array:
        return np.zeros_like(wi)


def picture(side: int) -> wf.Image:
    shapes = [
        wf.Sphere((0, 0, 0), 1, material=Glow(3)),
        wf.Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)),
        wf.Instance(wf.Disk((0, 0, 0), (0, 0, 1), 1), np.eye(4)),
    ]
    lights = [wf.PointLight((0, 1, 0), 3), wf.Environment(0.2)]
    scene = wf.Scene(shapes, lights, camera=wf.Camera.look_at((0, 0, 5), (0, 0, 0), size=(side, side)))
    balls = [wf.Sphere((i, 0, 0), 0.5) for i in range(3)]
    scene.add(wf.Scene(balls).shapes[0], wf.SpotLight((0, 3, 0), 5, target=(0, 0, 0)))
    wf.Scene(balls, lights=[wf.Environment()])
    scene.camera = wf.Camera.look_at(np.zeros(3), [0, 0, 1], "z", fov=30)
    mesh = wf.Mesh(np.zeros((3, 3)), [[0, 1, 2]], material=wf.Diffuse((0.1, 0.2, 0.3)))
    mesh.material = wf.Mirror()
    paint = wf.Diffuse(0.5)
    paint.reflectance = (0.1, 0.2, 0.3)
    scene.shapes.append(mesh)
    image = wf.render(scene, spp=4, size=(64, 48), integrator="full", progress=lambda done, total: None)
    rgb: npt.NDArray[np.float32] = image.rgb
    print(rgb.mean(), image.metadata["seconds"], wf.compare(image, image).rmse)
    if scene.camera is not None:
        print(scene.camera.size)
    return image


def first(shapes: list[wf.Shape]) -> wf.Material:
    shapes[0].material.bsdf.reflectance = 0.5
    shapes[0].material = wf.Material(wf.Dielectric(), alpha=0.5, interior=wf.Medium((1, 2, 3)))
    return shapes[0].material
"""

BAD = {
    'wf.render("x.obj", spp="4")': "arg-type",
    'wf.render("x.obj", sample_count=4)': "call-arg",
    "wf.Diffuse(albedo=0.5)": "call-arg",
    "wf.Scene([wf.Sphere((0, 0, 0), 1)], camera=(0, 0, 5))": "arg-type",
    'wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov="wide")': "arg-type",
    "wf.Mesh([[0, 0, 0]], [[0, 0, 0]]).material = 0.5": "assignment",
    "wf.Diffuse().with_alpha(0.5)": "attr-defined",
    "wf.Material(0.5)": "arg-type",
    "wf.Environment().emission": "attr-defined",
}


@pytest.mark.slow
def test_a_users_script_is_well_typed_and_mistakes_are_found(tmp_path: Path) -> None:
    """By `mypy --strict`, outside of the package's folder; each mistake on its line, so not all is `Any`."""
    (tmp_path / "good.py").write_text(GOOD)
    (tmp_path / "bad.py").write_text("import wavefront as wf\n\n" + "\n".join(BAD) + "\n")
    command = [
        sys.executable,
        "-m",
        "mypy",
        "--strict",
        "--no-error-summary",
        "--config-file=",
        "--cache-dir=c",
    ]
    done = subprocess.run(
        [*command, "good.py", "bad.py"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "MYPYPATH": ""},
        timeout=300,
    )
    found = [line.split(":", 3) for line in done.stdout.splitlines() if ": error:" in line]
    errors = [(file, int(line), text.rsplit("[", 1)[1].rstrip("]")) for file, line, _, text in found]
    assert errors == [("bad.py", *each) for each in enumerate(BAD.values(), 3)], done.stdout + done.stderr
