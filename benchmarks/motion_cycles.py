"""Render what moves in Blender's Cycles. Run by motion_peers.py with a Python that has `bpy`."""

from __future__ import annotations

import json
import sys
import tempfile
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

FRAMES = 2  # in the time from 0 to 1 s, so that its middle is a whole frame
KEYS = 65
STEPS = 7  # 2**6 steps while the shutter is open


def material(emission: float | None) -> Any:
    """Return a material that shines, or is diffuse with the albedo 0.5."""
    made = bpy.data.materials.new("material")
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    nodes.clear()
    if emission is None:
        node = nodes.new("ShaderNodeBsdfDiffuse")
        node.inputs["Color"].default_value = (0.5, 0.5, 0.5, 1)
    else:
        node, front = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeMath")
        front.operation = "MULTIPLY_ADD"  # nothing behind, as elsewhere
        links.new(nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], front.inputs[0])
        front.inputs[1].default_value, front.inputs[2].default_value = -emission, emission
        links.new(front.outputs[0], node.inputs["Strength"])
        node.inputs["Color"].default_value = (1, 1, 1, 1)
        made.cycles.emission_sampling = "FRONT"
    links.new(node.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return made


def follow(placed: Any, matrices: list[list[list[float]]]) -> None:
    """Let an object go from matrix to matrix in the time from 0 to 1 s, linearly from key to key."""
    placed.rotation_mode = "QUATERNION"
    placed.cycles.motion_steps = STEPS
    last = None
    for frame, matrix in zip(np.linspace(0, FRAMES, len(matrices)), matrices, strict=True):
        placed.location, turn, placed.scale = Matrix(matrix).decompose()
        if last is not None:
            turn.make_compatible(last)
        placed.rotation_quaternion = last = turn
        for name in ("location", "rotation_quaternion", "scale"):
            placed.keyframe_insert(name, frame=float(frame))


def add_mesh(shape: dict[str, Any]) -> None:
    """Add a mesh that moves, or goes from one form to another."""
    forms = shape["forms"]
    mesh = bpy.data.meshes.new("shape")
    mesh.from_pydata(forms[0], [], shape["faces"])
    mesh.materials.append(material(shape["emission"]))
    placed = bpy.data.objects.new("shape", mesh)
    bpy.context.scene.collection.objects.link(placed)
    placed.cycles.motion_steps = STEPS
    if len(forms) > 1:
        placed.shape_key_add(name="first")
        key = placed.shape_key_add(name="last")
        key.data.foreach_set("co", np.ravel(forms[1]))
        for part in np.linspace(0, 1, KEYS).tolist():  # whatever curve is between two keys
            key.value = part
            key.keyframe_insert("value", frame=part * FRAMES)
    if len(shape["matrices"]) > 1:
        follow(placed, shape["matrices"])


def add_camera(job: dict[str, Any]) -> None:
    """Add the camera, which looks along -z of its frame."""
    made = bpy.data.cameras.new("camera")
    made.sensor_fit = "VERTICAL"
    made.angle_y = job["fov"]
    made.clip_end = 1000
    placed = bpy.data.objects.new("camera", made)
    scene = bpy.context.scene
    scene.collection.objects.link(placed)
    scene.camera = placed
    scene.render.resolution_x, scene.render.resolution_y = job["size"]
    if len(job["camera"]) > 1:
        follow(placed, job["camera"])
    else:
        placed.matrix_world = Matrix(job["camera"][0])


def settings(job: dict[str, Any]) -> None:
    """Open the shutter from 0 to 1 s, without anything that changes means."""
    scene = bpy.context.scene
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.threads_mode, render.threads = "FIXED", job["threads"]
    render.image_settings.file_format, render.image_settings.color_mode = "OPEN_EXR", "RGBA"
    render.image_settings.color_depth = "32"
    render.film_transparent = True
    render.use_motion_blur, render.motion_blur_position = True, "CENTER"
    render.motion_blur_shutter = FRAMES
    if job["rolling"]:
        cycles.rolling_shutter_type, cycles.rolling_shutter_duration = "TOP", job["rolling"]
    cycles.device, cycles.samples, cycles.use_adaptive_sampling = "CPU", job["spp"], False
    cycles.use_denoising = False
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    cycles.max_bounces = 0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.light_sampling_threshold = 0


def pixels(path: str, size: list[int]) -> np.ndarray:
    """Return the picture (H, W, 4) of a file."""
    image = bpy.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    found = np.empty(size[0] * size[1] * 4, np.float32)
    image.pixels.foreach_get(found)
    bpy.data.images.remove(image)
    return found.reshape(size[1], size[0], 4)[::-1]


def main() -> None:
    """Read the job from standard input, and write its pictures (seeds, H, W, 4) to a file."""
    job = json.load(sys.stdin)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.preferences.edit.keyframe_new_interpolation_type = "LINEAR"
    bpy.context.scene.world = bpy.data.worlds.new("black")
    bpy.context.scene.world.use_nodes = True
    bpy.context.scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0, 0, 0, 1)
    for shape in job["meshes"]:
        add_mesh(shape)
    add_camera(job)
    settings(job)
    found = []
    for seed in range(job["seeds"]):
        scene = bpy.context.scene
        scene.frame_set(FRAMES // 2)
        scene.cycles.seed = seed
        scene.render.filepath = tempfile.mkdtemp() + "/out.exr"
        bpy.ops.render.render(write_still=True)
        found.append(pixels(scene.render.filepath, job["size"]))
    np.save(job["file"], np.stack(found))


if __name__ == "__main__":
    main()
