"""Describe a wavefront scene to Mitsuba 3, mesh by mesh from the same arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates

import wavefront as wf

FAR = 1e5  # distance of a sun, in units of the scene


def to_mitsuba(mi: Any, scene: wf.Scene, max_bounces: int, *, guides: bool = False) -> Any:
    """Return the scene as Mitsuba loads it; materials and lights that have no twin raise ValueError.

    With `guides` its pictures have albedo and normal, too, as channels 3 to 8. One copy of a scene serves
    all samplers, by `sensor`: the time of Mitsuba's kernels grows with the lights of all scenes of a process.

    Flat meshes that look and shine alike become one: Mitsuba compiles code for each, so that a
    thousand small lights would take ten times as long, with no less noise.
    """
    paths = {"type": "path", "max_depth": max_bounces + 1}
    layers = {"type": "aov", "aovs": "albedo:albedo,normal:sh_normal", "paths": paths}
    description: dict[str, Any] = {
        "type": "scene",
        "integrator": layers if guides else paths,
        "sensor": _sensor(mi, scene, "independent", 16),
    }
    for i, shape in enumerate(_joined(scene.shapes)):
        description[f"shape{i}"] = _sphere(shape) if isinstance(shape, wf.Sphere) else _mesh(mi, shape, i)
    for i, light in enumerate(scene.lights):
        description[f"light{i}"] = _light(mi, light)
    return mi.load_dict(description)


def sensor(mi: Any, scene: wf.Scene, sampler: str, spp: int) -> Any:
    """Return the camera of a scene as Mitsuba loads it, with a sampler."""
    return mi.load_dict(_sensor(mi, scene, sampler, spp))


def _sensor(mi: Any, scene: wf.Scene, sampler: str, spp: int) -> dict[str, Any]:
    camera = scene.camera or scene.framing_camera()
    return {
        "type": "perspective",
        "fov": camera.fov,
        "fov_axis": "y",
        "to_world": mi.ScalarTransform4f().look_at(
            origin=camera.origin.tolist(),
            target=(camera.origin - camera.rotation[:, 2]).tolist(),
            up=camera.rotation[:, 1].tolist(),
        ),
        "film": {
            "type": "hdrfilm",
            "width": camera.size[0],
            "height": camera.size[1],
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
        },
        "sampler": {"type": sampler, "sample_count": spp},
    }


def _joined(shapes: list[Any]) -> list[Any]:
    """Join meshes without normals of their own and textures that have the same material and emission."""
    groups: dict[Any, list[wf.Mesh]] = {}
    for i, shape in enumerate(shapes):
        material = repr(_bsdf(shape.material.bsdf))
        plain = isinstance(shape, wf.Mesh) and shape.normals is None and "bitmap" not in material
        look = (material, repr(shape.emission)) if plain else i
        groups.setdefault(look, []).append(shape)
    return [meshes[0] if len(meshes) == 1 else _union(meshes) for meshes in groups.values()]


def _union(meshes: list[wf.Mesh]) -> wf.Mesh:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    return wf.Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]),
        material=meshes[0].material,
        emission=None if meshes[0].emission is None else meshes[0].emission.ravel(),
    )


def _rgb(values: np.ndarray) -> dict[str, Any]:
    return {"type": "rgb", "value": np.ravel(values).astype(float).tolist()}


def texels_of(texture: wf.Texture) -> np.ndarray:
    """Return the image (H, W, 3) of a texture that was made of an array of floats."""
    width, height = texture.size
    return np.asarray(texture._texels, np.float32).reshape(height, width, 3)


def _with_corners(pixels: np.ndarray) -> np.ndarray:
    """Return an image by latitude of four times the size: Mitsuba has its first row at the very top."""
    height, width, _ = np.multiply(pixels.shape, (4, 4, 1))
    rows = np.clip(np.arange(height + 1) / 4 - 0.5, 0, len(pixels) - 1)
    columns = np.arange(width) / 4 - 0.5
    places = np.meshgrid(rows, columns, indexing="ij")
    planes = [
        map_coordinates(np.pad(p, ((0, 0), (1, 1)), "wrap"), [places[0], places[1] + 1], order=1)
        for p in np.moveaxis(pixels, 2, 0)
    ]
    return np.ascontiguousarray(np.stack(planes, 2), np.float32)


def _bitmap(texture: wf.Texture) -> dict[str, Any]:
    import mitsuba as mi

    return {"type": "bitmap", "bitmap": mi.Bitmap(texels_of(texture)), "raw": True}


def _bsdf(material: wf.Bsdf) -> dict[str, Any]:
    if isinstance(material, wf.Dielectric) and material.specular:
        return {"type": "dielectric", "int_ior": float(material.ior[0]), "ext_ior": 1.0}
    return {"type": "twosided", "bsdf": _reflection(material)}


def _reflection(material: wf.Bsdf) -> dict[str, Any]:
    """Return the twin of a material that reflects on its front side."""
    if isinstance(material, wf.Diffuse):
        reflectance = material.reflectance
        return {
            "type": "diffuse",
            "reflectance": _bitmap(reflectance) if isinstance(reflectance, wf.Texture) else _rgb(reflectance),
        }
    if isinstance(material, wf.Mirror):
        return {"type": "conductor", "specular_reflectance": _rgb(material.reflectance)}
    if isinstance(material, wf.Conductor):
        metal = {"type": "conductor", "eta": _rgb(material.eta), "k": _rgb(material.k)}
        if material.specular:
            return metal
        alpha = float(material.roughness[0]) ** 2
        return {**metal, "type": "roughconductor", "alpha": alpha, "distribution": "ggx"}
    if isinstance(material, wf.Mix):
        first, second = _reflection(material.first), _reflection(material.second)
        weight = float(np.ravel(material.weight)[0])
        return {"type": "blendbsdf", "weight": weight, "bsdf_0": first, "bsdf_1": second}
    raise ValueError(f"no twin in Mitsuba for {material!r}")


def _mesh(mi: Any, shape: wf.Mesh, number: int) -> Any:
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(_bsdf(shape.material.bsdf))
    properties["face_normals"] = shape.normals is None
    if shape.emission is not None:
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": _rgb(shape.emission)})
    smooth = shape.normals is not None
    mesh = mi.Mesh(
        f"shape{number}",
        len(shape.vertices),
        len(shape.faces),
        has_vertex_normals=smooth,
        has_vertex_texcoords=shape.uvs is not None,
        props=properties,
    )
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = shape.vertices.ravel().astype(np.float32)
    parameters["faces"] = shape.faces.ravel().astype(np.uint32)
    if shape.normals is not None:
        parameters["vertex_normals"] = shape.normals.ravel().astype(np.float32)
    if shape.uvs is not None:
        # the top row of an image is at v = 0
        parameters["vertex_texcoords"] = (shape.uvs * (1, -1) + (0, 1)).ravel().astype(np.float32)
    parameters.update()
    return mesh


def _sphere(shape: wf.Sphere) -> dict[str, Any]:
    made = {
        "type": "sphere",
        "center": shape.center.tolist(),
        "radius": shape.radius,
        "bsdf": _bsdf(shape.material.bsdf),
    }
    if shape.emission is not None:
        made["emitter"] = {"type": "area", "radiance": _rgb(shape.emission)}
    return made


def _light(mi: Any, light: Any) -> dict[str, Any]:
    if isinstance(light, wf.PointLight):
        return {"type": "point", "position": light.position.tolist(), "intensity": _rgb(light.intensity)}
    if isinstance(light, wf.Environment) and light._image is not None:
        return {"type": "envmap", "bitmap": mi.Bitmap(_with_corners(texels_of(light._image.image)))}
    if isinstance(light, wf.Environment):
        return {"type": "constant", "radiance": _rgb(light.radiance)}
    if isinstance(light, wf.DirectionalLight) and light.angle > 0:
        return _sun(mi, light)
    raise ValueError(f"no twin in Mitsuba for {light!r}")


def _sun(mi: Any, light: wf.DirectionalLight) -> dict[str, Any]:
    """Return a far disk that shines: Mitsuba's own directional light has no size."""
    half = np.radians(light.angle) / 2
    origin = (-FAR * np.asarray(light.direction)).tolist()
    place = mi.ScalarTransform4f().look_at(origin=origin, target=[0, 0, 0], up=[0, 1, 0])
    return {
        "type": "disk",
        "to_world": place @ mi.ScalarTransform4f().scale(FAR * float(np.tan(half))),
        "bsdf": {"type": "diffuse", "reflectance": 0.0},
        "emitter": {"type": "area", "radiance": _rgb(light.irradiance / (np.pi * np.sin(half) ** 2))},
    }
