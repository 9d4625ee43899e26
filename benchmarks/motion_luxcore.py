"""Render what moves in LuxCore. Run by motion_peers.py with a Python that has `pyluxcore`."""

from __future__ import annotations

import json
import os
import sys
from typing import Any

import numpy as np
import pyluxcore

Pairs = dict[str, Any]


def columns(matrix: list[list[float]]) -> list[float]:
    """Return a matrix column by column, as LuxCore takes it."""
    return np.transpose(matrix).ravel().tolist()


def motion(prefix: str, matrices: list[list[list[float]]]) -> Pairs:
    """Return the properties of a motion from 0 to 1 s."""
    found: Pairs = {}
    for number, matrix in enumerate(matrices):
        found[f"{prefix}.motion.{number}.time"] = number / (len(matrices) - 1)
        found[f"{prefix}.motion.{number}.transformation"] = columns(matrix)
    return found


def camera(job: dict[str, Any]) -> Pairs:
    """Return the properties of the camera, which looks along -z of its frame."""
    aspect = job["size"][0] / job["size"][1]
    found: Pairs = {
        "scene.camera.type": "perspective",
        "scene.camera.fieldofview": float(np.degrees(job["fov"])),
        "scene.camera.screenwindow": [-aspect, aspect, -1.0, 1.0],
        "scene.camera.shutteropen": 0.0,
        "scene.camera.shutterclose": 1.0,
    }
    frame = np.array(job["camera"][0]) if len(job["camera"]) == 1 else np.eye(4)
    found["scene.camera.lookat.orig"] = frame[:3, 3].tolist()
    found["scene.camera.lookat.target"] = (frame[:3, 3] - frame[:3, 2]).tolist()
    found["scene.camera.up"] = frame[:3, 1].tolist()
    return found | (motion("scene.camera", job["camera"]) if len(job["camera"]) > 1 else {})


def mesh(shape: dict[str, Any], number: int) -> Pairs:
    """Return the properties of a mesh and its material."""
    look, form, placed = f"scene.materials.m{number}", f"scene.shapes.s{number}", f"scene.objects.o{number}"
    shines = shape["emission"]
    found: Pairs = {f"{look}.type": "matte", f"{look}.kd": [0.0] * 3 if shines else [0.5] * 3}
    if shines:
        found[f"{look}.emission"] = [shines] * 3
        found[f"{look}.emission.power"] = found[f"{look}.emission.efficency"] = 0.0
    found |= {
        f"{form}.type": "inlinedmesh",
        f"{form}.vertices": np.ravel(shape["forms"][0]).tolist(),
        f"{form}.faces": np.ravel(shape["faces"]).tolist(),
        f"{placed}.shape": f"s{number}",
        f"{placed}.material": f"m{number}",
    }
    return found | (motion(placed, shape["matrices"]) if len(shape["matrices"]) > 1 else {})


def properties(pairs: Pairs) -> Any:
    """Return properties as LuxCore takes them."""
    found = pyluxcore.Properties()
    for name, value in pairs.items():
        found.Set(pyluxcore.Property(name, value))
    return found


def settings(job: dict[str, Any], seed: int) -> Pairs:
    """Return the settings of a render, without anything that changes means."""
    return {
        "renderengine.type": "PATHCPU",
        "renderengine.seed": seed + 1,
        "native.threads.count": job["threads"],
        "sampler.type": "SOBOL",
        "path.pathdepth.total": 1,
        "film.width": job["size"][0],
        "film.height": job["size"][1],
        "film.filter.type": "NONE",
        "film.imagepipelines.0.0.type": "NOP",
        "film.outputs.0.type": "RGB",
        "film.outputs.0.filename": "rgb.exr",
        "film.outputs.1.type": "ALPHA",
        "film.outputs.1.filename": "alpha.exr",
        "batch.haltspp": job["spp"],
    }


def render(scene: Any, job: dict[str, Any], seed: int) -> np.ndarray:
    """Return a picture (H, W, 4)."""
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(properties(settings(job, seed)), scene))
    session.Start()
    while not session.HasDone():
        session.UpdateStats()
    session.Stop()
    width, height = job["size"]
    rgb, alpha = np.zeros((height, width, 3), np.float32), np.zeros((height, width, 1), np.float32)
    session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB, rgb, 0, True)
    session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.ALPHA, alpha, 0, True)
    picture = np.concatenate([rgb, alpha], 2)[::-1]
    return np.roll(picture, -1, 0)  # what LuxCore shows is one row too low


def main() -> None:
    """Read the job from standard input, and write its pictures (seeds, H, W, 4) to a file."""
    job = json.load(sys.stdin)
    pyluxcore.Init(lambda message: None)
    scene = pyluxcore.Scene()
    pairs = camera(job)
    for number, shape in enumerate(job["meshes"]):
        pairs |= mesh(shape, number)
    scene.Parse(properties(pairs))
    np.save(job["file"], np.stack([render(scene, job, seed) for seed in range(job["seeds"])]))
    sys.stdout.flush()
    os._exit(0)  # the library ends with an error where Python ends it


if __name__ == "__main__":
    main()
