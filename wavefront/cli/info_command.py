"""`wavefront info`."""

from __future__ import annotations

import argparse

import numpy as np

from ..io.load import load
from ..shapes import Instance, Mesh


def describe_scene(options: argparse.Namespace) -> int:
    """Say what a scene file holds; return the exit status."""
    scene = load(options.scene)
    low, high = scene.bounds
    meshes = [shape.mesh if isinstance(shape, Instance) else shape for shape in scene.shapes]
    faces = sum(len(mesh.faces) for mesh in meshes if isinstance(mesh, Mesh))
    print(f"{options.scene}: {len(scene.shapes)} shapes, {faces} triangles, {len(scene.lights)} lights")
    print(f"bounds: {_triple(low)} to {_triple(high)}")
    print(f"camera: {'in the file' if scene.camera else 'none; the scene will be framed'}")
    for shape in scene.shapes:
        glow = "" if shape.emission is None else ", emits"
        print(f"  {shape!r} {type(shape.material.bsdf).__name__}{glow}")
    return 0


def _triple(values: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in values) + ")"
