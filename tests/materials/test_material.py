"""`Material`: a BSDF, and everything else that a surface is made of."""

from typing import Any

import numpy as np
import pytest
from inside import Alpha, CompiledScene, compile_scene, make_accelerator
from significance import render

import wavefront as wf

TRIANGLE = (np.eye(3), [[0, 1, 2]])
CAMERA = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=30, size=(8, 8))


def compiled(*shapes: Any) -> CompiledScene:
    scene = wf.Scene(shapes, wf.Environment())
    return compile_scene(scene, lambda geometry: make_accelerator(geometry, "numpy"))


@pytest.mark.parametrize(
    "shape",
    [
        lambda material: wf.Sphere((0, 0, 0), 1, material=material),
        lambda material: wf.Mesh(*TRIANGLE, material=material),
        lambda material: wf.Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), material=material),
        lambda material: wf.Disk((0, 0, 0), (0, 0, 1), 1, material=material),
        lambda material: wf.Instance(wf.Mesh(*TRIANGLE), np.eye(4), material=material),
        lambda material: wf.Instance.many(wf.Mesh(*TRIANGLE), np.eye(4)[None], material=material)[0],
    ],
    ids=["Sphere", "Mesh", "Rectangle", "Disk", "Instance", "Instance.many"],
)
def test_a_bare_bsdf_is_taken_wherever_a_material_is(shape) -> None:
    bsdf = wf.Mirror(0.8)
    bare = shape(bsdf)
    assert type(bare.material) is wf.Material
    assert bare.material.bsdf is bsdf
    assert repr(bare.material) == "Material(bsdf=Mirror(reflectance=0.8))"
    bare.material.bsdf.reflectance = 0.1
    assert bsdf.reflectance[0] == np.float32(0.1)
    material = wf.Material(bsdf, alpha=0.5)
    assert shape(material).material is material
    with pytest.raises(wf.SceneError, match=r'material must be a material such as .* or "gold", got 3'):
        shape(3)


def test_render_takes_both() -> None:
    ball = wf.Sphere((0, 0, 0), 1)
    options: dict[str, Any] = {"camera": CAMERA, "size": (8, 8)}
    bare = render(ball, 2, material=wf.Diffuse(0.2), **options).rgb
    assert np.array_equal(render(ball, 2, material=wf.Material(wf.Diffuse(0.2)), **options).rgb, bare)
    with pytest.raises(wf.SceneError, match="material must be a material such as"):
        render(ball, 2, material=3, **options)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("bsdf", None, r"Material bsdf must be a Bsdf such as wf.Diffuse\(0.5\), got None"),
        ("bsdf", wf.Material(wf.Diffuse()), r"Material bsdf must be a Bsdf .*, got Material\("),
        ("alpha", 2, r"Material alpha is 2; it must be in \[0, 1\]"),
        ("alpha_cutoff", -1, "Material alpha_cutoff is -1; it must be at least 0"),
        ("normal_map", 1, "Material normal_map must be a NormalMap or a BumpMap, got 1"),
        ("emission", -1, "Material emission is -1; it must be at least 0"),
        ("interior", 1, r"Material interior must be a Medium such as wf.Medium\(absorption=1\), got 1"),
    ],
)
def test_attributes_are_checked_whenever_they_are_assigned(name: str, value: Any, message: str) -> None:
    material = wf.Material(wf.Diffuse())
    before = getattr(material, name)
    with pytest.raises(wf.SceneError, match=message):
        setattr(material, name, value)
    assert getattr(material, name) is before
    arguments = {"bsdf": wf.Diffuse(), name: value}
    with pytest.raises(wf.SceneError, match=message):
        wf.Material(**arguments)


def test_what_follows_changes_too() -> None:
    material = wf.Material(wf.Diffuse(), alpha=0.25)
    assert material.opacity is not None
    assert material.opacity.constant == 0.25
    material.alpha_cutoff = 0.2
    assert material.opacity is None
    material.alpha_cutoff = 0.3
    assert material.opacity.constant == 0
    material.alpha = None
    assert material.opacity is None


@pytest.mark.parametrize("value", [-1, np.inf, (1, 2), "red"])
def test_media_are_checked(value: Any) -> None:
    with pytest.raises(wf.SceneError, match="Medium absorption"):
        wf.Medium(value)


def test_materials_are_shaded_by_bsdf() -> None:
    """Alpha, normal maps, emission and media cost no BSDF its group; normal maps are numbered."""
    bumps = wf.BumpMap(np.random.default_rng(0).random((4, 4)), 0.1)
    materials = [
        wf.Material(wf.Diffuse(0.1), alpha=0.5),
        wf.Material(wf.Diffuse(0.2), normal_map=bumps),
        wf.Material(wf.Diffuse(0.3), normal_map=bumps, interior=wf.Medium(2.0)),
        wf.Material(wf.Diffuse(0.4), emission=1.0),
    ]
    uvs = np.random.default_rng(1).random((3, 2))
    scene = compiled(*(wf.Mesh(*TRIANGLE, uvs=uvs, material=material) for material in materials))
    assert len(scene.materials.groups) == 1
    assert scene.materials.normal_map_of.tolist() == [-1, 0, 0, -1]
    assert scene.materials.normal_maps == (bumps,)
    assert scene.media is not None
    assert scene.media.entry_of.tolist() == [0, 0, 1, 0]
    alpha = scene.program.find(Alpha)
    assert alpha is not None
    assert alpha.opacities.constant.tolist() == [0.5, 1, 1, 1]


def test_shapes_of_one_bsdf_share_a_material() -> None:
    """As many shapes as there are, it has one number; one bsdf with a texture is one group."""
    rough, image = wf.Mirror(), wf.Diffuse(wf.Texture(np.ones((2, 2, 3)) / 2))
    spheres = [wf.Sphere((x, 0, 0), 0.4, material=rough) for x in range(5)]
    assert compiled(*spheres).material_of.tolist() == [0] * 5
    pair = [wf.Material(image), wf.Material(image, alpha=0.5)]
    uvs = np.random.default_rng(1).random((3, 2))
    scene = compiled(*(wf.Mesh(*TRIANGLE, uvs=uvs, material=material) for material in pair))
    assert (len(scene.materials.groups), scene.material_of.tolist()) == (1, [0, 1])


def test_lengths_are_scaled() -> None:
    """Those of normal maps and media; a material without any is returned itself."""
    plain = wf.Material(wf.Diffuse(), alpha=0.5, normal_map=wf.NormalMap(np.full((1, 1, 3), 0.6)))
    assert plain.scaled(4.0) is plain
    material = wf.Material(wf.Diffuse(), normal_map=wf.BumpMap(np.eye(2), 0.5), interior=wf.Medium((1, 2, 0)))
    assert material.scaled(1.0) is material
    scaled = material.scaled(4.0)
    assert scaled.bsdf is material.bsdf
    assert scaled.normal_map.height == 2
    assert scaled.interior.sigma_a.ravel().tolist() == [0.25, 0.5, 0]
    assert material.interior.absorption.ravel().tolist() == [1, 2, 0]
