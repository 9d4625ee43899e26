"""Render the Cornell box in Blender's Cycles and print the seconds of each repeat.

Run by cornell_peers.py with the Python that has `bpy` installed; imports nothing else.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time

import bpy


def material(name: str, color: list[float], emission: list[float] | None) -> bpy.types.Material:
    """Return a diffuse or an emitting material of Cycles."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes = made.node_tree.nodes
    nodes.clear()
    kind = "ShaderNodeEmission" if emission else "ShaderNodeBsdfDiffuse"
    shader, output = nodes.new(kind), nodes.new("ShaderNodeOutputMaterial")
    value = emission or color
    shader.inputs["Color"].default_value = (*value, 1.0)
    made.node_tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return made


def build(shapes: list[dict], size: int, spp: int, threads: int, max_bounces: int, denoise: bool) -> None:
    """Put the shapes, a camera and the settings into Blender's scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    for shape in shapes:
        mesh = bpy.data.meshes.new(shape["name"])
        mesh.from_pydata(shape["vertices"], [], shape["faces"])
        mesh.materials.append(material(shape["name"], shape["color"], shape["emission"]))
        scene.collection.objects.link(bpy.data.objects.new(shape["name"], mesh))
    camera = bpy.data.cameras.new("camera")
    camera.angle = 39.3077 * 3.141592653589793 / 180
    placed = bpy.data.objects.new("camera", camera)
    placed.location = (0, 0, 3.9)
    scene.collection.objects.link(placed)
    scene.camera = placed
    scene.render.engine = "CYCLES"
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.threads_mode, scene.render.threads = "FIXED", threads
    scene.cycles.device = "CPU"
    scene.cycles.samples = spp
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising, scene.cycles.denoiser = denoise, "OPENIMAGEDENOISE"
    scene.cycles.pixel_filter_type = "BOX"
    scene.cycles.filter_width = 1.0
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = max_bounces
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = tempfile.mkdtemp() + "/out.exr"


def main() -> None:
    """Read the job from standard input, then print the seconds of one render per further line."""
    job = json.loads(sys.stdin.readline())
    build(job["shapes"], job["size"], job["spp"], job["threads"], job["max_bounces"], job["denoise"])
    for seed, line in enumerate(sys.stdin):
        bpy.context.scene.cycles.seed = seed
        begin = time.perf_counter()
        bpy.ops.render.render(write_still="write" in line)
        print(f"PICTURE {bpy.context.scene.render.filepath}")
        print(f"SECONDS {time.perf_counter() - begin}", flush=True)


if __name__ == "__main__":
    main()
