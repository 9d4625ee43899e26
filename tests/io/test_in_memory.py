"""A trimesh scene renders bit for bit as the file that trimesh writes of it, read by `load` or by trimesh.

Coordinates are multiples of 1/64, which every format holds exactly; others a format rounds.
"""

import numpy as np
import pytest
import trimesh
from trimesh.visual import ColorVisuals, TextureVisuals
from trimesh.visual.material import PBRMaterial, SimpleMaterial

import wavefront as wf

CAMERA = wf.Camera.look_at((0, 0, 6), (0, 0, 0), fov=30, size=(32, 24))
LIGHTS = [wf.Environment(1.0), wf.PointLight((0, 3, 5), 20)]


def exact(values):
    return np.round(np.asarray(values) * 64) / 64


def ball(subdivisions=1):
    mesh = trimesh.creation.icosphere(subdivisions, radius=0.5)
    return trimesh.Trimesh(exact(mesh.vertices), mesh.faces, process=False)


def image(seed):
    from PIL import Image

    return Image.fromarray(np.random.default_rng(seed).integers(0, 256, (8, 4, 3), np.uint8))


def textured(material):
    mesh = ball()
    mesh.visual = TextureVisuals(uv=exact(mesh.vertices[:, :2] + 0.5), material=material)
    return mesh


def placed(x, y, *scale):
    matrix = np.diag([*(scale or (1, 1, 1)), 1.0])
    matrix[:2, 3] = x, y
    return matrix


def glb():
    scene = trimesh.Scene()
    rough = {"metallicRoughnessTexture": image(1), "metallicFactor": 0.75, "roughnessFactor": 0.5}
    glow = {"emissiveTexture": image(2), "emissiveFactor": [0.5, 0.25, 0.0]}
    color = {"baseColorTexture": image(0), "baseColorFactor": [255, 200, 100, 255]}
    urn = textured(PBRMaterial(**color, **rough, **glow, normalTexture=image(3)))
    box = trimesh.creation.box()
    green = PBRMaterial(baseColorFactor=[10, 200, 30, 255], metallicFactor=0.0, roughnessFactor=0.25)
    box.visual = TextureVisuals(material=green)
    scene.add_geometry(urn, geom_name="urn", transform=placed(-1, 0))
    scene.add_geometry(box, geom_name="box", transform=placed(0, 0.25, 0.5, 0.5, -0.5))
    clay = ball(2)
    clay.visual = TextureVisuals(material=PBRMaterial(metallicFactor=0.0, roughnessFactor=1.0))
    scene.add_geometry(clay, geom_name="ball", transform=placed(1, 0))
    scene.graph.update("again", "world", matrix=placed(0, -1), geometry="ball")
    return scene


def obj():
    scene = trimesh.Scene()
    shine = {"specular": [99, 120, 255, 255], "glossiness": 200.0}
    urn = textured(SimpleMaterial(image(0), diffuse=[255, 200, 100, 255], name="urn", **shine))
    box = trimesh.creation.box()
    box.visual = TextureVisuals(
        uv=np.zeros((8, 2)), material=SimpleMaterial(diffuse=[10, 201, 30], name="box")
    )
    scene.add_geometry(urn, geom_name="urn", transform=placed(-1, 0))
    scene.add_geometry(box, geom_name="box", transform=placed(0, 0.25, 0.5, 0.5, -0.5))
    return scene


def ply():
    mesh = ball(2)
    colors = np.random.default_rng(4).integers(0, 256, (len(mesh.vertices), 3), np.uint8)
    mesh.visual = ColorVisuals(mesh, vertex_colors=colors)
    return mesh


@pytest.mark.filterwarnings("ignore:.*not honored. .*[Kk]a")  # which trimesh always writes
@pytest.mark.parametrize("make", [glb, obj, ply])
def test_a_scene_in_memory_renders_as_its_file(tmp_path, make):
    held = make()
    path = tmp_path / f"a.{make.__name__}"
    held.export(path)
    flat = {"smooth": False} if make is glb else {}  # as glTF wants it where a file has no normals
    scenes = wf.from_trimesh(held, **flat), wf.from_trimesh(trimesh.load(path, process=False)), wf.load(path)
    direct, through, file = (
        wf.render(wf.Scene(scene.shapes, LIGHTS, CAMERA), 4, workers=1, progress=False).rgb
        for scene in scenes
    )
    assert np.ptp(direct, axis=(0, 1)).min() > 0.3
    assert np.array_equal(direct, file)
    assert np.array_equal(through, file)
