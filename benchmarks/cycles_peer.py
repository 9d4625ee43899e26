"""Describe a wavefront scene to a process of Blender's Cycles, and have it rendered there."""

from __future__ import annotations

import json
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from mitsuba_scene import texels_of

import wavefront as wf
from wavefront.workers.executors import worker_count

SPHERE_SUBDIVISIONS = 5  # 20 480 triangles: Cycles has no spheres


FILES = tempfile.TemporaryDirectory()  # images of textures


class Cycles:
    """A Cycles process that renders a scene once per call, each time with another seed."""

    def __init__(
        self,
        python: str,
        scene: wf.Scene,
        spp: int,
        max_bounces: int,
        *,
        denoise: bool = False,
        guide: bool = False,
    ) -> None:
        script = Path(__file__).with_name("cycles_scene.py")
        self.process = subprocess.Popen(
            [python, str(script)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        options = {"denoise": denoise, "guide": guide, "threads": worker_count(None)}
        self._say(json.dumps({**described(scene), "spp": spp, "max_bounces": max_bounces, **options}))

    def seconds(self) -> float:
        """Render, and return the seconds that Cycles took."""
        return float(self._answers("again")["SECONDS"])

    def picture(self, *given: float) -> np.ndarray:
        """Render and return the picture (H, W, 3).

        Another number of samples may be given, and with it the threshold of adaptive sampling.
        """
        return wf.Image.load(self._answers(" ".join(map(str, ("write", *given))))["PICTURE"]).rgb

    def _answers(self, line: str) -> dict[str, str]:
        """Return what Cycles says, by its first word."""
        self._say(line)
        assert self.process.stdout is not None
        found = {}
        for answer in self.process.stdout:
            word, _, rest = answer.strip().partition(" ")
            found[word] = rest
            if word == "SECONDS":
                return found
        raise RuntimeError("Cycles stopped without an answer")

    def _say(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()


def described(scene: wf.Scene) -> dict[str, Any]:
    """Return a scene as plain lists and numbers; what has no twin raises ValueError."""
    camera = scene.camera or scene.framing_camera()
    found: dict[str, Any] = {
        "shapes": [_shape(shape) for shape in scene.shapes],
        "suns": [],
        "sky": None,
        "camera": {
            "fov": float(np.radians(camera.fov)),
            "size": list(camera.size),
            "to_world": _frame(camera.rotation, camera.origin),
        },
    }
    for light in scene.lights:
        if isinstance(light, wf.Environment):
            image = light._image
            found["sky"] = np.ravel(light.radiance).tolist() if image is None else _file(image.image)
        elif isinstance(light, wf.DirectionalLight):
            found["suns"].append(_sun(light))
        else:
            raise ValueError(f"no twin in Cycles for {light!r}")
    return found


def _frame(rotation: np.ndarray, origin: np.ndarray) -> list[list[float]]:
    """Return the matrix (4, 4) of a frame whose axes are the columns of a rotation."""
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = rotation, origin
    return frame.tolist()


def _sun(light: wf.DirectionalLight) -> dict[str, Any]:
    z = -np.asarray(light.direction)
    x = np.cross((0, 1, 0) if abs(z[1]) < 0.9 else (1, 0, 0), z)
    x /= np.linalg.norm(x)
    return {
        "irradiance": np.ravel(light.irradiance).tolist(),
        "angle": float(np.radians(light.angle)),
        "to_world": _frame(np.stack([x, np.cross(z, x), z], 1), np.zeros(3)),
    }


def _shape(shape: wf.Mesh | wf.Sphere) -> dict[str, Any]:
    if isinstance(shape, wf.Sphere):
        ball = trimesh.creation.icosphere(subdivisions=SPHERE_SUBDIVISIONS)
        vertices, faces, smooth = ball.vertices * shape.radius + shape.center, ball.faces, True
    else:
        vertices, faces, smooth = shape.vertices, shape.faces, shape.normals is not None
    return {
        "vertices": np.asarray(vertices).tolist(),
        "faces": np.asarray(faces).tolist(),
        "smooth": smooth,
        "uvs": None if getattr(shape, "uvs", None) is None else shape.uvs.tolist(),
        "look": _look(shape.material.bsdf),
        "emission": None if shape.emission is None else np.ravel(shape.emission).tolist(),
    }


def _file(texture: wf.Texture) -> str:
    """Write an image to a file that lives as long as this process, and return its name."""
    path = Path(FILES.name) / f"{id(texture)}.exr"
    wf.Image(texels_of(texture)).save(path)
    return str(path)


def _look(material: wf.Bsdf) -> dict[str, Any]:
    if isinstance(material, wf.Diffuse):
        color = material.reflectance
        return {
            "type": "diffuse",
            "color": _file(color) if isinstance(color, wf.Texture) else np.ravel(color).tolist(),
        }
    if isinstance(material, wf.Dielectric) and material.specular:
        return {"type": "glass", "ior": float(material.ior[0])}
    if isinstance(material, wf.Conductor) and (material.k >= 1000).all():  # reflects all light
        return {"type": "glossy", "roughness": float(material.roughness[0])}
    if isinstance(material, wf.Conductor):
        eta, k = (np.ravel(values).tolist() for values in (material.eta, material.k))
        return {"type": "metal", "eta": eta, "k": k, "roughness": float(material.roughness[0])}
    if isinstance(material, wf.Mix):
        parts = [_look(part) for part in (material.first, material.second)]
        return {"type": "mix", "weight": float(np.ravel(material.weight)[0]), "parts": parts}
    raise ValueError(f"no twin in Cycles for {material!r}")
