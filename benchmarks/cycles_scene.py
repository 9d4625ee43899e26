"""Render a scene in Blender's Cycles and print the seconds of each repeat.

Run by cycles_peer.py with the Python that has `bpy` installed; imports nothing else.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from typing import Any

import bpy
from mathutils import Matrix


def shader(nodes: Any, links: Any, look: dict) -> Any:
    """Return the node of a diffuse surface, glass, metal, a mirror that reflects all light, or a mix."""
    if look["type"] == "mix":
        node = nodes.new("ShaderNodeMixShader")
        node.inputs[0].default_value = look["weight"]
        for slot, part in zip(node.inputs[1:], look["parts"], strict=True):
            links.new(shader(nodes, links, part).outputs[0], slot)
        return node
    if look["type"] == "glossy":
        node = nodes.new("ShaderNodeBsdfAnisotropic")
        node.distribution = "GGX"
        node.inputs["Roughness"].default_value = look["roughness"]
        node.inputs["Color"].default_value = (1, 1, 1, 1)
        return node
    if look["type"] == "metal":
        node = nodes.new("ShaderNodeBsdfMetallic")
        node.distribution, node.fresnel_type = "GGX", "PHYSICAL_CONDUCTOR"
        node.inputs["IOR"].default_value, node.inputs["Extinction"].default_value = look["eta"], look["k"]
        node.inputs["Roughness"].default_value = look["roughness"]
        return node
    if look["type"] == "glass":
        node = nodes.new("ShaderNodeBsdfGlass")
        node.inputs["Color"].default_value = (1, 1, 1, 1)
        node.inputs["IOR"].default_value, node.inputs["Roughness"].default_value = look["ior"], 0
        return node
    node = nodes.new("ShaderNodeBsdfDiffuse")
    if isinstance(look["color"], str):
        texture = nodes.new("ShaderNodeTexImage")
        texture.image = bpy.data.images.load(look["color"])
        links.new(texture.outputs["Color"], node.inputs["Color"])
    else:
        node.inputs["Color"].default_value = (*look["color"], 1)
    return node


def lamp(nodes: Any, links: Any, radiance: list[float]) -> Any:
    """Return the node of a surface that shines on its front side and is black."""
    node = nodes.new("ShaderNodeEmission")
    node.inputs["Color"].default_value = (*radiance, 1)
    front = nodes.new("ShaderNodeMath")
    front.operation = "SUBTRACT"
    front.inputs[0].default_value = 1
    links.new(nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], front.inputs[1])
    links.new(front.outputs[0], node.inputs["Strength"])
    return node


def material(shape: dict) -> Any:
    """Return the material of a shape."""
    made = bpy.data.materials.new("material")
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    nodes.clear()
    if shape["emission"]:
        surface = lamp(nodes, links, shape["emission"])
        made.cycles.emission_sampling = "FRONT"
    else:
        surface = shader(nodes, links, shape["look"])
    links.new(surface.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return made


def add_shape(shape: dict) -> None:
    """Add a mesh to Blender's scene."""
    mesh = bpy.data.meshes.new("shape")
    mesh.from_pydata(shape["vertices"], [], shape["faces"])
    mesh.polygons.foreach_set("use_smooth", [shape["smooth"]] * len(shape["faces"]))
    if shape["uvs"]:
        corners = [shape["uvs"][i] for face in shape["faces"] for i in face]
        mesh.uv_layers.new().data.foreach_set("uv", [x for corner in corners for x in corner])
    mesh.materials.append(material(shape))
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("shape", mesh))


def add_sun(sun: dict) -> None:
    """Add a sun, which shines along -z of its frame."""
    light = bpy.data.lights.new("sun", "SUN")
    light.energy, light.color, light.angle = 1.0, sun["irradiance"], sun["angle"]
    placed = bpy.data.objects.new("sun", light)
    placed.matrix_world = Matrix(sun["to_world"])
    bpy.context.scene.collection.objects.link(placed)


def add_sky(sky: list[float] | str) -> None:
    """Surround Blender's scene by a constant environment, or by the image of a file."""
    world = bpy.context.scene.world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    color = nodes["Background"].inputs["Color"]
    if not isinstance(sky, str):
        color.default_value = (*sky, 1)
        return
    parts, turned = nodes.new("ShaderNodeSeparateXYZ"), nodes.new("ShaderNodeCombineXYZ")
    links.new(nodes.new("ShaderNodeTexCoord").outputs["Generated"], parts.inputs[0])
    for to, axis in enumerate("ZXY"):  # Blender's images have +x in their middle and +z at their top
        links.new(parts.outputs[axis], turned.inputs[to])
    image = nodes.new("ShaderNodeTexEnvironment")
    image.image = bpy.data.images.load(sky)
    links.new(turned.outputs[0], image.inputs["Vector"])
    links.new(image.outputs["Color"], color)


def add_camera(camera: dict) -> None:
    """Add the camera, which looks along -z of its frame."""
    made = bpy.data.cameras.new("camera")
    made.sensor_fit = "VERTICAL"
    made.angle_y = camera["fov"]
    placed = bpy.data.objects.new("camera", made)
    placed.matrix_world = Matrix(camera["to_world"])
    scene = bpy.context.scene
    scene.collection.objects.link(placed)
    scene.camera = placed
    scene.render.resolution_x, scene.render.resolution_y = camera["size"]


def settings(job: dict) -> None:
    """Set Cycles to what the other renderers do: no clamping, no filtering, no skipped lights."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.threads_mode, scene.render.threads = "FIXED", job["threads"]
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = tempfile.mkdtemp() + "/out.exr"
    cycles = scene.cycles
    cycles.device, cycles.samples = "CPU", job["spp"]
    cycles.use_adaptive_sampling = False
    cycles.use_denoising, cycles.denoiser = job["denoise"], "OPENIMAGEDENOISE"
    cycles.use_guiding = job["guide"]
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    bounces = job["max_bounces"] - 1  # direct light is no bounce to Cycles
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = bounces
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.blur_glossy = cycles.light_sampling_threshold = 0


def main() -> None:
    """Read the job from standard input, then print the seconds of one render per further line."""
    job = json.loads(sys.stdin.readline())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    for shape in job["shapes"]:
        add_shape(shape)
    for sun in job["suns"]:
        add_sun(sun)
    if job["sky"]:
        add_sky(job["sky"])
    add_camera(job["camera"])
    settings(job)
    for seed, line in enumerate(sys.stdin):
        action, *given = line.split()
        cycles = bpy.context.scene.cycles
        cycles.seed, cycles.samples = seed, int(given[0]) if given else job["spp"]
        cycles.use_adaptive_sampling = len(given) > 1
        if cycles.use_adaptive_sampling:
            cycles.adaptive_threshold, cycles.adaptive_min_samples = float(given[1]), 4
        begin = time.perf_counter()
        bpy.ops.render.render(write_still=action == "write")
        print(f"PICTURE {bpy.context.scene.render.filepath}")
        print(f"SECONDS {time.perf_counter() - begin}", flush=True)


if __name__ == "__main__":
    main()
