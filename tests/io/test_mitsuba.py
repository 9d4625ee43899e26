"""Scenes of Mitsuba: each plugin and each parameter, from dictionaries."""

from __future__ import annotations

import importlib.util
import re
import struct
import warnings
import zlib
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from expected import Near, check
from inside import FILTERS as FILTERS_HERE
from inside import NODES_TABLE as TABLE
from inside import Entity, RawMesh, blackbody_spectrum, facing, spectrum_rgb, write_image
from inside import io_Job as Job
from measurements import adaptive_fields, tensor_file

import wavefront as wf

PLUGINS = {name: each for (kind, name), each in TABLE.makers.items()}
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"
PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
property float heat_0
property float heat_1
property float heat_2
element face 1
property list uchar int vertex_indices
property float weight_0
end_header
0 0 0 1 0 0
1 0 0 0 1 0
0 1 0 0 0 1
3 0 1 2 0.25
"""
TURN = [[0, 0, 1, 1], [1, 0, 0, 2], [0, 1, 0, 3], [0, 0, 0, 1]]  # x to y, y to z, z to x


def rgb(*value: float) -> dict[str, Any]:
    return {"type": "rgb", "value": value}


def scene(strict: bool = True, **parts: Any) -> wf.Scene:
    """Return a scene of some parts, with a sphere if there is no shape."""
    kinds = (
        PLUGINS.get(part.get("type")) if isinstance(part.get("type"), str) else None
        for part in parts.values()
    )
    shapes = any(each is not None and each.kind == "shape" for each in kinds)
    ball = {} if shapes else {"ball": {"type": "sphere"}}
    return wf.from_mitsuba({"type": "scene", **parts, **ball}, strict=strict)


def shape(kind: str, **parameters: Any) -> Any:
    return scene(shape={"type": kind, **parameters}).shapes[0]


def material(kind: str, strict: bool = True, **parameters: Any) -> wf.Material:
    board = {"type": "rectangle", "bsdf": {"type": kind, **parameters}}
    found = scene(strict, shape=board).shapes[0].material
    if isinstance(found.bsdf, wf.Sides) and found.bsdf.back is None:
        found.bsdf = found.bsdf.front
    return found


def light(kind: str, **parameters: Any) -> Any:
    return scene(light={"type": kind, **parameters}).lights[0]


def camera(kind: str = "perspective", **parameters: Any) -> wf.Camera:
    found = scene(sensor={"type": kind, **parameters}).camera
    assert found is not None
    return found


def value(parameter: Any) -> list[float]:
    return np.asarray(parameter).ravel().tolist()


FILTERS: dict[str, tuple[dict[str, Any], Any]] = {
    "box": ({"type": "box"}, "box"),
    "tent": ({"type": "tent"}, "tent"),
    "wide tent": ({"type": "tent", "radius": 1.25}, wf.TentFilter(1.25)),
    "gaussian": ({"type": "gaussian"}, wf.GaussianFilter(2.0, windowed=True)),
    "narrow gaussian": ({"type": "gaussian", "stddev": 0.25}, wf.GaussianFilter(1.0, 0.25, windowed=True)),
}


USUAL_FILTER = FILTERS["gaussian"][1]
CLAY, GLASS, LAMP, NULL = {"type": "diffuse"}, {"type": "dielectric"}, {"type": "area"}, {"type": "null"}
FLAT_SPECTRUM = {"type": "regular", "values": "3, 3"}
FOG = {"type": "homogeneous", "sigma_t": rgb(0.4, 0.6, 1), "albedo": rgb(0.5, 1, 0), "scale": 2}
METAL, BOTH_SIDES = {"type": "conductor"}, {"type": "twosided", "b": CLAY}
PIPE = {"p0": [0, 0, 1], "p1": [0, 0, 3], "radius": 0.5, "to_world": TURN}
BROWN = Near([0.2, 0.3, 0.4])
PHASES = {"type": "blendphase", "weight": 0.3, "a": {"type": "hg", "g": 0.6}, "b": {"type": "rayleigh"}}
THREE = [{"type": "regular", "values": "3, 3"}, {"type": "constvolume", "value": FLAT_SPECTRUM}]
SCALED = np.array(TURN) @ np.diag([5, 5, 1, 1.0])
THIN = {"roughness": 0.6, "anisotropic": 0.45, "sheen": 0.9, "sheen_tint": 0.35, "flatness": 0.55}
THICK = THIN | {"metallic": 0.1, "clearcoat": 0.8, "clearcoat_gloss": 1.0}


def bsdf(kind: str, **parameters: Any) -> Any:
    return material(kind, **parameters).bsdf


def sides(*kind: str, **parameters: Any) -> Any:
    """Return the BSDF of a rectangle, which has a back."""
    return shape("rectangle", **({"b": {"type": kind[0], **parameters}} if kind else {})).material.bsdf


def medium(kind: str, **parameters: Any) -> Any:
    return inside("cube", interior={"type": kind, **parameters})


def inside(kind: str, **parameters: Any) -> Any:
    return shape(kind, **parameters).material.interior


def lens(kind: str, **parameters: Any) -> Any:
    return camera(kind, **parameters).projection


def filter_of(**film: Any) -> Any:
    return scene(view={"type": "perspective", "film": {"type": "hdrfilm", **film}}).settings["filter"]


def seen_from(z: float, body: Any) -> Any:
    """Return the BSDF of a shape that a camera at (0, 0, z) sees."""
    place = np.eye(4)
    place[2, 3] = z
    return scene(view={"type": "perspective", "to_world": place}, body=body).shapes[0].material.bsdf


def row(make: Callable[..., Any], kind: str, due: dict[str, Any], **given: Any) -> Any:
    """Return what makes something of a plugin and its parameters, and what it is by `check`."""
    return pytest.param(make, [kind] if kind else [], given, due, id=f"{make.__name__} {kind or [*given]}")


READ = [
    # shapes are where to_world places them
    row(shape, "sphere", {"center": [1, 3, 3]}, center=[1, 0, 0], radius=2, to_world=TURN),
    row(shape, "rectangle", {"bounds": [[1, 1, 2], [1, 3, 4]]}, to_world=TURN),
    row(shape, "cube", {"bounds": [[0, 1, 2], [2, 3, 4]]}, to_world=TURN),
    row(shape, "disk", {"bounds": Near([[1, 1, 2], [1, 3, 4]], 1e-3)}, to_world=TURN),
    row(shape, "cylinder", {"starts": [2, 2, 3], "ends": [4, 2, 3], "radii": 0.5}, **PIPE),
    # a lamp is black, as in Mitsuba
    row(shape, "sphere", {"material.bsdf.reflectance": 0.5}),
    row(shape, "sphere", {"material.bsdf.reflectance": 0}, e=LAMP),
    row(shape, "sphere", {"emission": [1, 2, 3]}, e=LAMP | {"radiance": rgb(1, 2, 3)}),
    row(shape, "rectangle", {"material.opacity.constant": 1 / 32}, b=NULL, e=LAMP),
    row(shape, "sphere", {"material.bsdf": wf.NullSurface}, b=NULL),
    # metals and glass; spectra as RGB may be below 0
    row(bsdf, "diffuse", {"reflectance": BROWN}, reflectance=rgb(*BROWN.value)),
    row(bsdf, "conductor", {"k": Near([3.983, 2.3856, 1.6034], 1e-4)}, material="Au"),
    row(bsdf, "conductor", {"": wf.Mirror}, specular_reflectance=0.5),
    row(bsdf, "roughconductor", {"eta": [1, 2, 3], "k": 4}, eta=rgb(1, 2, 3), k=4.0),
    row(bsdf, "roughconductor", {"roughness": 0.5, "distribution": "ggx"}, alpha=0.25, distribution="ggx"),
    row(bsdf, "roughconductor", {"k": [0, 5, 6]}, eta=rgb(-0.1, 2, 3), k=rgb(-0.2, 5, 6)),
    row(bsdf, "roughconductor", {"reflectance": BROWN}, specular_reflectance=rgb(*BROWN.value)),
    row(bsdf, "roughconductor", {"roughness": 0.5, "roughness_v": Near(0.3)}, alpha_u=0.25, alpha_v=0.09),
    row(bsdf, "roughconductor", {"distribution": "beckmann", "shadowing": "separable"}),
    row(bsdf, "dielectric", {"ior": Near(1.5046 / 1.000277)}),
    row(bsdf, "dielectric", {"ior": Near(2.419 / 1.333)}, int_ior="diamond", ext_ior="water"),
    row(bsdf, "dielectric", {"transmittance": 0.5}, specular_transmittance=0.5),
    row(bsdf, "roughdielectric", {"roughness": Near(0.3)}, alpha=0.09, distribution="ggx"),
    row(bsdf, "roughdielectric", {"reflectance": 0.25}, specular_reflectance=0.25),
    row(bsdf, "roughdielectric", {"roughness_v": Near(0.3)}, alpha_u=0.25, alpha_v=0.09),
    row(bsdf, "thindielectric", {"": wf.ThinDielectric, "ior": Near(1.7)}, int_ior=1.7, ext_ior=1.0),
    # plastics
    row(bsdf, "plastic", {"ior": 1.9, "nonlinear": True}, int_ior=1.9, ext_ior=1.0, nonlinear=True),
    row(bsdf, "plastic", {"reflectance": 0.25, "nonlinear": False}, diffuse_reflectance=0.25),
    row(bsdf, "roughplastic", {"roughness": 0.5, "distribution": "ggx"}, alpha=0.25, distribution="ggx"),
    row(bsdf, "roughplastic", {"specular_reflectance": 0.5, "nonlinear": False}, specular_reflectance=0.5),
    row(bsdf, "pplastic", {"reflectance": Near(0.3)}, diffuse_reflectance=0.3),
    row(bsdf, "pplastic", {"roughness": 0.5}, alpha=0.25),
    # panes let half of the light through
    row(material, "polarizer", {"alpha": 0.5}),
    row(material, "circular", {"alpha": 0.75}, transmittance=0.5),
    row(material, "retarder", {"alpha": 0.0}),
    row(bsdf, "polarizer", {"transmittance": [0.5, 0.25, 0]}, transmittance=rgb(1, 0.5, 0)),
    # Disney's models
    row(bsdf, "principled", {"": wf.Disney} | {name: Near(each) for name, each in THICK.items()}, **THICK),
    row(bsdf, "principled", {"base_color": BROWN}, base_color=rgb(*BROWN.value)),
    row(bsdf, "principled", {"transmission": Near(0.7), "ior": Near(1.4)}, spec_trans=0.7, eta=1.4),
    row(bsdf, "principled", {"specular_tint": Near(0.65), "ior": Near(1.5)}, spec_tint=0.65, specular=0.5),
    row(bsdf, "principledthin", {"": wf.ThinDisney}),
    row(bsdf, "principledthin", {name: Near(each) for name, each in THIN.items()}, **THIN),
    row(bsdf, "principledthin", {"base_color": BROWN}, base_color=rgb(*BROWN.value)),
    row(bsdf, "principledthin", {"transmission": Near(0.7), "ior": Near(1.4)}, spec_trans=0.7, eta=1.4),
    row(bsdf, "principledthin", {"diffuse_transmission": Near(1.6)}, diff_trans=1.6),
    row(bsdf, "principledthin", {"specular_tint": Near(0.65)}, spec_tint=0.65),
    row(bsdf, "principledthin", {"ior": Near(3, 2e-3)}, eta=FLAT_SPECTRUM),
    # masks, maps and mixtures keep what is in them
    row(material, "twosided", {"bsdf.reflectance": 0.25}, b=CLAY | {"reflectance": 0.25}),
    row(material, "mask", {"bsdf.reflectance": 0.5, "alpha": 0.125}, b=CLAY, opacity=0.125),
    row(material, "null", {"opacity.constant": 0}),
    row(bsdf, "blendbsdf", {"first": wf.Diffuse, "second": wf.Mirror}, a=CLAY, b=METAL),
    row(bsdf, "blendbsdf", {"weight": 0.75}, a=CLAY, b=METAL, weight=0.75),
    # backs are black where Mitsuba has them so, and where they are seen
    row(sides, "", {"": wf.Sides}),
    row(sides, "diffuse", {"": wf.Sides}),
    row(sides, "mask", {"": wf.Sides}, b=CLAY),
    row(sides, "dielectric", {"": wf.Dielectric}),
    row(sides, "principled", {"": wf.Sides}),
    row(sides, "principled", {"": wf.Disney}, spec_trans=0.5),
    row(sides, "twosided", {"": wf.Diffuse}, b=CLAY),
    row(sides, "twosided", {"front": wf.Diffuse, "back": wf.Mirror}, a=CLAY, b=METAL),
    row(sides, "blendbsdf", {"": wf.Sides, "front": wf.Mix}, a=CLAY, b=CLAY),
    row(sides, "blendbsdf", {"first": wf.Sides, "second": wf.Diffuse}, a=CLAY, b=BOTH_SIDES),
    row(seen_from, "", {"": wf.Diffuse}, z=5.0, body={"type": "sphere", "b": CLAY}),
    row(seen_from, "", {"": wf.Sides}, z=0.5, body={"type": "sphere", "b": CLAY}),
    row(seen_from, "", {"": wf.Diffuse}, z=5.0, body={"type": "cube", "b": CLAY}),
    row(seen_from, "", {"": wf.Sides}, z=0.5, body={"type": "cube", "b": CLAY}),
    # lights
    row(light, "point", {"position": [1, 2, 3]}, to_world=TURN),
    row(light, "point", {"position": [1, 2, 3]}, position=[1, 2, 3]),
    row(light, "point", {"intensity": [4, 5, 6]}, intensity=rgb(4, 5, 6)),
    row(light, "directional", {"direction": [1, 0, 0]}, to_world=TURN),
    row(light, "directional", {"direction": [0, 0, -1]}, direction=[0, 0, -2]),
    row(light, "directional", {"irradiance": 3}, irradiance=3.0),
    row(light, "spot", {"angle": 60, "blend": 0.5, "falloff": "linear"}, cutoff_angle=30.0, beam_width=15.0),
    row(light, "spot", {"angle": 40, "blend": 0.25}),
    row(light, "spot", {"direction": [1, 0, 0]}, to_world=TURN),
    # cameras and settings
    row(camera, "perspective", {"resolution": (768, 576)}),
    row(lens, "thinlens", {"aperture": 1, "focus": 3}, aperture_radius=0.5, focus_distance=3.0),
    row(lens, "orthographic", {"height": Near(7.5)}, to_world=SCALED),
    row(camera, "orthographic", {"origin": [1.5, 2, 3]}, to_world=SCALED, near_clip=0.5),
    *(row(filter_of, "", {"": expected}, rfilter=given) for given, expected in FILTERS.values()),
    row(filter_of, "", {"": wf.BoxFilter(0.75)}, rfilter={"type": "box", "radius": 0.75}),
    row(filter_of, "", {"": USUAL_FILTER}),
    row(scene, "", {"settings": {"filter": USUAL_FILTER}}, view={"type": "perspective"}),
    row(scene, "", {"settings": {"max_bounces": 1}}, i={"type": "direct"}),
    # media: extinction times albedo is scattering
    row(medium, "homogeneous", {"sigma_s": 0.75, "sigma_a": 0.25, "phase": wf.Isotropic}),
    row(medium, "homogeneous", {"sigma_s": Near([0.4, 1.2, 0])}, **FOG),
    row(medium, "homogeneous", {"sigma_a": Near([0.4, 0, 2])}, **FOG),
    row(medium, "homogeneous", {"phase.weight": 0.3, "phase.second": wf.Rayleigh}, phase=PHASES),
    row(medium, "homogeneous", {"phase.first.g": 0.6}, phase=PHASES),
    row(medium, "homogeneous", {"sigma_s": 0.5}, albedo={"type": "constvolume", "value": rgb(0.5, 0.5, 0.5)}),
    row(medium, "homogeneous", {"sigma_s": Near([[1.5]] * 3, 2e-3)}, sigma_t=THREE[0], albedo=0.5),
    row(medium, "homogeneous", {"sigma_s": Near([[1.5]] * 3, 2e-3)}, sigma_t=THREE[1], albedo=0.5),
    # a shape with a medium outside alone is a hole
    row(inside, "sphere", {"sigma_s": 0, "sigma_a": 0}, b=NULL, exterior=FOG),
]


@pytest.mark.parametrize(("make", "kind", "given", "due"), READ)
def test_what_plugins_become(make: Any, kind: list[str], given: dict[str, Any], due: dict[str, Any]) -> None:
    check(make(*kind, **given), due)


# values that are not supported, what is said of them, and what stands in their place
CLAMPED: list[tuple[dict[str, Any], str, dict[str, Any]]] = [
    (
        {"type": "sphere", "b": CLAY | {"reflectance": rgb(1.00016, 0.5, -1e-9)}},
        r"reflectance is 1\.00016 0\.5 -1e-09; clamped to 1 0\.5 0",
        {"shapes[0].material.bsdf.reflectance": [1, 0.5, 0]},
    ),
    (
        {"type": "perspective", "film": {"type": "hdrfilm", "width": 8.0000001}},
        r"width is 8\.0000001; taken as 8",
        {"camera.size[0]": 8},
    ),
    (
        {"type": "sphere", "to_world": np.diag([2.0, 2, 2, 0.9999999])},
        r"last row is .*0\.9999999.*; divided by it",
        {"shapes[0].radius": Near(2 / 0.9999999, 1e-12)},
    ),
    (
        {"type": "rectangle", "b": {"type": "roughplastic", "alpha_u": 0.25}},
        "alpha_u",
        {"shapes[0].material.bsdf.front.roughness": Near(0.1**0.5)},
    ),
]


@pytest.mark.parametrize(("part", "message", "due"), CLAMPED)
def test_values_by_a_hair_are_clamped(part: dict[str, Any], message: str, due: dict[str, Any]) -> None:
    with pytest.warns(UserWarning, match=message):
        made = scene(False, part=part)
    check(made, due)


def test_textures_by_a_hair_are_clamped() -> None:
    data = np.array([[[-1.0, 0.5, 2], [3, 1, 0]]], np.float32)
    image = {"type": "bitmap", "data": data, "raw": True, "filter_type": "nearest"}
    at_left = SimpleNamespace(uv=np.array([[0.25], [0.5]], np.float32))
    with pytest.warns(UserWarning, match="reflectance, a texture, is -1 to 3; clamped to 0 to 1"):
        made = material("diffuse", False, reflectance=image).bsdf
    assert value(made.reflectance.at(at_left)) == [0, 0.5, 1]
    with pytest.warns(UserWarning, match="radiance, a texture, is -1 to 3; clamped to 0 to more"):
        made = scene(False, lamp={"type": "rectangle", "e": LAMP | {"radiance": image}}).shapes[0]
    assert value(made.emission.at(at_left)) == [0, 0.5, 2]


def test_equal_references_are_one_material() -> None:
    one = {"type": "diffuse", "id": "clay"}
    both = scene(a={"type": "sphere", "bsdf": one}, b={"type": "cube", "bsdf": {"type": "ref", "id": "clay"}})
    assert both.shapes[0].material is both.shapes[1].material
    assert both.shapes[0].material.name == "clay"


# --- Shapes ---------------------------------------------------------------------------------------


def normals(mesh: wf.Mesh) -> Any:
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return np.cross(b - a, c - a)


@pytest.mark.parametrize("kind", ["rectangle", "cube", "disk", "cylinder"])
def test_front_sides_and_flip_normals(kind: str) -> None:
    # an area light makes a mesh of the cylinder
    lamp = {"emitter": {"type": "area"}}
    front, back = shape(kind, **lamp), shape(kind, flip_normals=True, **lamp)
    outward = [0, 0, 1] if kind in ("rectangle", "disk") else None
    for mesh, sign in ((front, 1), (back, -1)):
        centers = mesh.vertices[mesh.faces].mean(1)
        if kind == "cylinder":
            centers[:, 2] = 0
        ahead = normals(mesh) @ outward if outward else (normals(mesh) * centers).sum(1)
        assert (ahead * sign > 0).all()


def test_a_reflection_keeps_the_front_side() -> None:
    mesh = shape("rectangle", to_world=np.diag([1, 1, -1, 1.0]))
    assert (normals(mesh)[:, 2] < 0).all()


MIRROR = np.diag([-1.0, 1, 1, 1])
QUAD = "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 1\nf 1 2 3\nf 1 3 4\n"


@pytest.mark.parametrize("form", ["obj", "serialized"])
@pytest.mark.parametrize("face_normals", [False, True])
def test_a_reflection_turns_the_faces_of_a_file_without_normals(
    tmp_path: Path, form: str, face_normals: bool
) -> None:
    (tmp_path / "a.obj").write_text(OBJ)
    data = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes() + np.arange(3, dtype="<u4").tobytes()
    packed = zlib.compress(struct.pack("<I", 0x1000) + b"\0" + struct.pack("<QQ", 3, 1) + data)
    (tmp_path / "a.serialized").write_bytes(struct.pack("<HH", 0x041C, 4) + packed + struct.pack("<QI", 0, 1))
    given = {"filename": str(tmp_path / f"a.{form}"), "face_normals": face_normals}
    mesh = shape(form, to_world=MIRROR, **given)
    assert (normals(mesh)[:, 2] < 0).all()
    assert (mesh.normals is None) == face_normals
    assert mesh.normals is None or (mesh.normals[:, 2] < 0).all()
    assert (normals(shape(form, to_world=MIRROR, flip_normals=True, **given))[:, 2] > 0).all()


@pytest.mark.parametrize("along", [1, -1])
def test_the_front_of_a_file_with_normals_is_theirs(tmp_path: Path, along: int) -> None:
    text = f"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 {along}\nf 1//1 2//1 3//1\n"
    (tmp_path / "a.obj").write_text(text)
    for matrix in (np.eye(4), MIRROR):
        mesh = shape("obj", filename=str(tmp_path / "a.obj"), to_world=matrix)
        assert (normals(mesh)[:, 2] * along > 0).all()
        assert (mesh.normals[:, 2] * along > 0).all()


def test_normals_of_files_weigh_by_angle_alone(tmp_path: Path) -> None:
    """At the first corner 90° and 45°, whatever the areas; vertices apart in texture have their own."""
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 9 0 0\nv 0 1 0\nv 0 1 1\nf 1 2 3\nf 1 3 4\n")
    found = shape("obj", filename=str(tmp_path / "a.obj")).normals[0]
    assert found / found[2] == pytest.approx([0.5, 0, 1])
    seam = "v 0 0 0\nv 9 0 0\nv 0 1 0\nv 0 1 1\nvt 0 0\nvt 1 1\nf 1/1 2/1 3/1\nf 1/2 3/2 4/2\n"
    (tmp_path / "b.obj").write_text(seam)
    mesh = shape("obj", filename=str(tmp_path / "b.obj"))
    assert sorted(map(tuple, np.abs(np.round(mesh.normals)).tolist())) == [(0, 0, 1)] * 3 + [(1, 0, 0)] * 3
    parts = seam.replace("f 1/2", "usemtl b\nf 1/2").replace("/2", "/1")
    (tmp_path / "c.obj").write_text(parts)
    mesh = shape("obj", filename=str(tmp_path / "c.obj"))
    assert len(mesh.vertices) == 4


def test_normals_that_face_away_from_the_viewer_are_black(tmp_path: Path) -> None:
    """As in Mitsuba, where the side that is seen is that of the shading normals."""
    (tmp_path / "a.obj").write_text(OBJ)
    made = shape("obj", filename=str(tmp_path / "a.obj")).material.bsdf
    bound = made.bind(SimpleNamespace(back_facing=np.zeros(2, np.bool_), index_around=None))
    wo, wi = np.array([[0, 0], [1, 1], [0.002, 0.01]], np.float32), np.eye(3, dtype=np.float32)[:, [2, 2]]
    assert (bound.evaluate(wo, wi)[0][0] > 0).tolist() == [False, True]


def test_grain_runs_around_the_axis_of_a_sphere_and_a_cylinder() -> None:
    grain = {"type": "roughconductor", "alpha_u": 0.05, "alpha_v": 0.4}
    ball = shape("sphere", bsdf=grain, to_world=TURN)
    assert ball.transform[:, 1] @ np.array(TURN)[:3, 2] == pytest.approx(1)  # the pole of a `Sphere` is y
    assert shape("sphere", bsdf={"type": "roughconductor"}, to_world=TURN).transform is None
    assert isinstance(shape("cylinder", bsdf=grain), wf.Mesh)


def test_meshes_without_texture_coordinates_have_those_of_mitsuba(tmp_path: Path) -> None:
    """Weights of the second and third corner, which grain follows, too."""
    (tmp_path / "a.obj").write_text(QUAD)
    board = {"type": "diffuse", "reflectance": {"type": "checkerboard"}}
    grain = {"type": "roughconductor", "alpha_u": 0.05, "alpha_v": 0.4}
    for bsdf in (board, grain):
        mesh = shape("obj", filename=str(tmp_path / "a.obj"), bsdf=bsdf)
        assert mesh.uvs[mesh.faces].tolist() == [[[0, 0], [1, 0], [0, 1]]] * 2
    assert shape("obj", filename=str(tmp_path / "a.obj"), bsdf={"type": "diffuse"}).uvs is None


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("matrix", [np.eye(4), MIRROR])
def test_a_reflection_turns_the_front_of_a_sphere(flip: bool, matrix: Any) -> None:
    lamp = {"emitter": {"type": "area"}, "center": [1, 0, 0], "flip_normals": flip, "to_world": matrix}
    ball = shape("sphere", **lamp)
    inward = flip != (matrix[0, 0] < 0)
    assert isinstance(ball, wf.Mesh) == inward
    if inward:
        middle = ball.vertices[ball.faces].mean(1) - matrix[:3, 0]
        assert ((normals(ball) * middle).sum(1) < 0).all()
        assert ((ball.normals * (ball.vertices - matrix[:3, 0])).sum(1) < 0).all()
    textured = shape("sphere", bsdf={"type": "diffuse", "reflectance": {"type": "checkerboard"}}, **lamp)
    plain = shape(
        "sphere", bsdf={"type": "diffuse", "reflectance": {"type": "checkerboard"}}, center=[1, 0, 0]
    )
    if isinstance(textured, wf.Mesh):  # its texture is mirrored with it
        found, at = matrix[:3, :3] @ np.array([0, 0.6, 0.8]), textured.vertices - matrix[:3, 0]
        u, v = textured.uvs[np.abs(at - found).sum(1).argmin()]
        local = plain.transform.T @ [0, 0.6, 0.8]
        expected = np.arctan2(local[0], local[2]) / (2 * np.pi) + 0.5, 1 - np.arccos(local[1]) / np.pi
        assert (u, v) == pytest.approx(expected, abs=0.02)


def test_the_back_of_a_masked_ball_is_seen_and_black() -> None:
    bsdf = {"type": "mask", "opacity": 0.5, "b": {"type": "diffuse"}}
    assert isinstance(shape("sphere", bsdf=bsdf).material.bsdf, wf.Sides)
    assert not isinstance(shape("sphere", bsdf={"type": "diffuse"}).material.bsdf, wf.Sides)


def test_all_light_of_a_masked_emitter_is_seen() -> None:
    lamp = {"emitter": {"type": "area", "radiance": 3.0}, "to_world": np.diag([9.0, 9, 1, 1])}
    at = np.diag([-1.0, 1, -1, 1])
    at[2, 3] = 5
    eye = {"type": "perspective", "to_world": at, "film": {"type": "hdrfilm", "width": 8, "height": 8}}
    for opacity, mask in ((0.25, "mask"), (1 / 32, "null")):
        bsdf = {"type": mask} | ({"opacity": opacity, "b": {"type": "diffuse"}} if mask == "mask" else {})
        made = scene(eye=eye, lamp={"type": "rectangle", "bsdf": bsdf, **lamp}, sky={"type": "constant"})
        assert float(np.ravel(made.shapes[0].material.opacity.constant)[0]) == pytest.approx(opacity)
        image = wf.render(made, spp=256, max_bounces=1, progress=False)
        error = 3 / opacity * np.sqrt(opacity / (256 * 64))
        assert image.rgb.mean() == pytest.approx(3 + (1 - opacity) + 0.5 * opacity, abs=4 * error)
    bsdf = {"type": "mask", "opacity": 0.5, "b": {"type": "diffuse"}}
    ball = scene(ball={"type": "sphere", "bsdf": bsdf, "emitter": {"type": "area"}})
    wf.render(ball, spp=1, size=(4, 4), progress=False)
    board = {"type": "bitmap", "data": np.array([[[0.5], [1.0]]], np.float32), "raw": True}
    bsdf = {"type": "mask", "opacity": board, "b": {"type": "diffuse"}}
    made = scene(lamp={"type": "rectangle", "bsdf": bsdf, **lamp}).shapes[0]
    at_left = SimpleNamespace(uv=np.array([[0.25], [0.5]], np.float32))
    assert made.emission.at(at_left).ravel().tolist() == [6, 6, 6]


def test_curved_shapes_of_a_group_may_be_stretched() -> None:
    ball = {"type": "sphere", "center": [0, 1, 0], "radius": 0.5, "bsdf": {"type": "diffuse", "id": "clay"}}
    pipe = {"type": "cylinder", "p1": [0, 0, 3], "radius": 0.25}
    group = {"type": "shapegroup", "ball": ball, "pipe": pipe}
    ref = {"type": "ref", "id": "group"}
    stretched = {"type": "instance", "to_world": np.diag([1.0, 2, 3, 1]), "group": ref}
    even = {"type": "instance", "group": ref}
    made = scene(group=group, one=stretched, two=even, three={**stretched}).shapes
    assert [type(each).__name__ for each in made[2:4]] == ["Sphere", "Cylinders"]
    egg, tube = (each.to_mesh() for each in made[:2])
    np.testing.assert_allclose(egg.bounds, [[-0.5, 1, -1.5], [0.5, 3, 1.5]], atol=1e-3)
    np.testing.assert_allclose(tube.bounds, [[-0.25, -0.5, 0], [0.25, 0.5, 9]], atol=1e-3)
    assert (np.einsum("ij,ij->i", normals(egg), egg.vertices[egg.faces].mean(1) - [0, 2, 0]) > 0).all()
    assert made[0].mesh is made[4].mesh


def test_texture_coordinates() -> None:
    flat = shape("rectangle")
    assert (flat.vertices[:, :2] == 2 * flat.uvs - 1).all()
    disk = shape("disk")
    radius, turn = disk.uvs[: len(disk.faces)].T
    np.testing.assert_allclose(
        disk.vertices[: len(disk.faces), :2],
        1.0004 * radius[:, None] * np.stack([np.cos(2 * np.pi * turn), np.sin(2 * np.pi * turn)], 1),
        atol=1e-3,
    )
    tube = shape("cylinder", emitter={"type": "area"})
    np.testing.assert_allclose(tube.vertices[:, 2], tube.uvs[:, 1])
    np.testing.assert_allclose(tube.vertices[:, 0], np.cos(2 * np.pi * tube.uvs[:, 0]), atol=1e-12)


def test_files_of_meshes(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(OBJ)
    path = str(tmp_path / "a.obj")
    assert shape("obj", filename=path).uvs.tolist() == [[0, 1], [1, 1], [0, 0]]
    assert shape("obj", filename=path, flip_tex_coords=False).uvs.tolist() == [[0, 0], [1, 0], [0, 1]]
    assert shape("obj", filename=path, face_normals=True).normals is None
    assert shape("obj", filename=path).name == "shape"
    (tmp_path / "a.ply").write_text(PLY)
    for name, expected in (("vertex_heat", np.eye(3)), ("face_weight", np.full((3, 3), 0.25))):
        shown = {"type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": name}}
        mesh = shape("ply", filename=str(tmp_path / "a.ply"), bsdf=shown)
        np.testing.assert_array_equal(mesh.colors[:, :3], expected)
    shown["reflectance"]["name"] = "vertex_warmth"  # type: ignore[index]
    with pytest.raises(wf.SceneError, match=r"shape .ply.: the attribute 'vertex_warmth'"):
        shape("ply", filename=str(tmp_path / "a.ply"), bsdf=shown)


def serialized(version: int, double: bool, count: int = 3) -> bytes:
    kind = "<f8" if double else "<f4"
    name = b"part\0" if version == 4 else b""
    body = struct.pack("<I", 1 | 2 | (0x2000 if double else 0x1000)) + name + struct.pack("<QQ", count, 1)
    for rows in ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 1]] * 3, [[0, 0], [1, 0], [0, 1]]):
        body += np.array(rows, kind).tobytes()
    body += np.array([0, 1, 2], "<u4").tobytes()
    return struct.pack("<HH", 0x041C, version) + zlib.compress(body)


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("double", [False, True])
def test_serialized_meshes(tmp_path: Path, version: int, double: bool) -> None:
    parts = [serialized(version, double), serialized(version, double)]
    places = struct.pack("<II" if version == 3 else "<QQ", 0, len(parts[0]))
    (tmp_path / "a.serialized").write_bytes(b"".join(parts) + places + struct.pack("<I", 2))
    path = str(tmp_path / "a.serialized")
    for index in (0, 1):
        mesh = shape("serialized", filename=path, shape_index=index)
        assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
        assert (mesh.normals[:, 2] == 1).all()
        assert mesh.uvs.tolist() == [[0, 0], [1, 0], [0, 1]]
    assert shape("serialized", filename=path, face_normals=True).normals is None
    with pytest.raises(wf.SceneError, match="shape_index is 2; the file has 2 meshes"):
        shape("serialized", filename=path, shape_index=2)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "has 0 bytes"),
        (b"x" * 90, "begins with"),
        (serialized(4, False)[:-20], "bytes before the end|cannot be unpacked"),
        (serialized(4, False, 2**40), "memory|bytes before"),
    ],
)
def test_a_damaged_serialized_mesh_is_refused(tmp_path: Path, data: bytes, message: str) -> None:
    (tmp_path / "a.serialized").write_bytes(data)
    with pytest.raises(wf.SceneError, match=message):
        shape("serialized", filename=str(tmp_path / "a.serialized"))


def test_groups_and_instances() -> None:
    group = {"type": "shapegroup", "cube": {"type": "cube"}, "ball": {"type": "sphere"}}
    copies = {
        f"copy{k}": {"type": "instance", "to_world": TURN, "group": {"type": "ref", "id": "group"}}
        for k in range(2)
    }
    found = scene(group=group, **copies).shapes
    assert [type(each) for each in found] == [wf.Instance, wf.Sphere] * 2
    assert found[0].mesh is found[2].mesh
    assert [each.name for each in found] == ["copy0", "copy0", "copy1", "copy1"]
    assert found[3].center.tolist() == [1, 2, 3]
    with pytest.raises(wf.SceneError, match=r"LoadLimits\.instances"):
        wf.from_mitsuba({"type": "scene", "group": group, **copies}, limits=wf.LoadLimits(instances=3))


# --- BSDFs ----------------------------------------------------------------------------------------


def test_maps_of_normals() -> None:
    inner = {"type": "diffuse", "reflectance": 0.25}
    image = {"type": "bitmap", "data": np.ones((2, 2, 1), np.float32), "raw": True}
    made = material("bumpmap", bsdf=inner, map=image, scale=2.0)
    due = {"height": 2, "shadows_grazing": True, "mirrors_hidden": True}
    check(made, {"bsdf.reflectance": 0.25} | {f"normal_map.{name}": each for name, each in due.items()})
    mapped = material("bumpmap", bsdf=inner, map=image, use_shadowing_function=False).normal_map
    check(mapped, {"shadows_grazing": False, "mirrors_hidden": True})
    with pytest.raises(wf.SceneError, match="flip_invalid_normals"):
        material("bumpmap", bsdf=inner, map=image, flip_invalid_normals=False)
    flat = {"type": "bitmap", "data": np.full((2, 2, 3), (0.5, 0.5, 1), np.float32), "raw": True}
    assert material("normalmap", bsdf=inner, normalmap=flat).normal_map is not None


def test_steps_have_no_slopes() -> None:
    """In Mitsuba bitmaps of filter_type nearest have the slope 0, and a checkerboard has none at all."""
    inner = {"type": "diffuse"}
    texels = {"type": "bitmap", "data": np.eye(2, dtype=np.float32)[..., None], "raw": True}
    assert material("bumpmap", bsdf=inner, map=texels).normal_map is not None
    assert material("bumpmap", bsdf=inner, map={**texels, "filter_type": "nearest"}).normal_map is None
    with pytest.warns(UserWarning, match="bumpmap.*: a map by checkerboard"):
        found = material("bumpmap", False, bsdf=inner, map={"type": "checkerboard"})
    assert found.normal_map is None


def test_a_normal_map_is_in_the_frame_of_the_shading_normal() -> None:
    # Mitsuba's green is normal × u, wherever v points: on the rectangle towards the lower rows of an image
    tilted = {"type": "rawconstant", "value": [0.5, 0.9, 0.9]}
    board = {
        "type": "rectangle",
        "bsdf": {"type": "normalmap", "normalmap": tilted, "bsdf": {"type": "diffuse"}},
    }
    for up, brighter in ((1, True), (-1, False)):
        lit = scene(board=board, sun={"type": "directional", "direction": [0, -up, -1]})
        lit.camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), size=(8, 8))
        plain = scene(board={"type": "rectangle"}, sun={"type": "directional", "direction": [0, -up, -1]})
        plain.camera = lit.camera
        means = [np.asarray(wf.render(each, spp=1, max_bounces=1).rgb).mean() for each in (lit, plain)]
        assert (means[0] > means[1]) == brighter


def test_textures() -> None:
    codes = np.arange(12, dtype=np.uint8).reshape(2, 2, 3) * 20

    def texture(**parameters: Any) -> wf.Texture:
        image = {"type": "bitmap", "data": codes, **parameters}
        found = material("diffuse", reflectance=image).bsdf.reflectance
        assert isinstance(found, wf.Texture)
        return found

    raw = texture(raw=True, filter_type="nearest", wrap_mode="clamp")
    assert (raw.srgb, raw.filter, raw.wrap) == (False, "nearest", ("clamp", "clamp"))
    # v is 0 in the top row
    np.testing.assert_allclose(
        raw.lookup(np.array([[0.1], [0.1]], np.float32))[:, 0], codes[0, 0] / 255, rtol=1e-6
    )
    moved = np.eye(4)
    moved[0, 3] = 0.5
    for to_uv in (moved, moved[np.ix_((0, 1, 3), (0, 1, 3))]):
        found = texture(raw=True, filter_type="nearest", to_uv=to_uv)
        np.testing.assert_allclose(
            found.lookup(np.array([[0.1], [0.1]], np.float32))[:, 0], codes[0, 1] / 255, rtol=1e-6
        )
    assert texture().srgb
    board = {"type": "checkerboard", "color0": 0.25, "color1": rgb(1, 0, 0)}
    board = material("diffuse", reflectance=board).bsdf.reflectance
    at = np.array([[0.2, 0.7, 0.2], [0.2, 0.2, 0.7]], np.float32)
    np.testing.assert_array_equal(board.lookup(at)[:, 0], [0.25] * 3)
    np.testing.assert_array_equal(board.lookup(at)[:, 1:].T, [[1, 0, 0]] * 2)
    board = material("mask", bsdf={"type": "diffuse"}, opacity={"type": "checkerboard"}).alpha
    np.testing.assert_allclose(board.lookup(at), [0.2, 0.4, 0.4])  # as in Mitsuba
    # the roughness is the root of a texture of α, and numbers are luminances
    alpha = {"type": "bitmap", "data": np.full((2, 2, 3), 0.25, np.float32), "raw": True}
    rough = material("roughconductor", alpha=alpha, distribution="ggx").bsdf.roughness
    assert rough.limits() == (0.5, 0.5)
    cut = {"type": "bitmap", "data": np.full((2, 2, 3), 0.25, np.float32)}
    assert material("mask", bsdf={"type": "diffuse"}, opacity=cut).alpha.limits() == pytest.approx(
        (0.25, 0.25)
    )


def test_spectra() -> None:
    def radiance(**spectrum: Any) -> list[float]:
        return value(light("constant", radiance=spectrum).radiance)

    # values of Mitsuba 3.9.1, variant scalar_rgb
    assert radiance(type="spectrum", value=2.0) == pytest.approx([2.40959, 1.89658, 1.81783], 1e-4)
    given = [(400, 0), (500, 8), (600, 15.6), (700, 18.4)]
    assert radiance(type="spectrum", value=given) == pytest.approx([20.7108, 10.8546, 2.77115], 2e-3)
    text = "400:0, 500:8, 600:15.6, 700:18.4"
    assert radiance(type="spectrum", value=text) == radiance(type="spectrum", value=given)
    bounded = {"type": "spectrum", "value": [(400, 0.2), (500, 0.3), (600, 0.6), (700, 0.8)]}
    found = material("diffuse", reflectance=bounded).bsdf.reflectance
    assert value(found) == pytest.approx([0.708449, 0.422684, 0.22573], 2e-3)
    assert (
        value(material("diffuse", reflectance={"type": "spectrum", "value": 0.25}).bsdf.reflectance)
        == [0.25] * 3
    )
    assert radiance(type="d65", scale=2.0) == [2] * 3
    assert radiance(type="srgb", color=rgb(1, 2, 3)) == [1, 2, 3]
    warm = radiance(type="blackbody", temperature=3000.0)
    assert warm[0] > 2 * warm[1] > 6 * warm[2]
    white = spectrum_rgb([(360, 1), (830, 1)], emission=False, bounded=True)
    assert white == pytest.approx([1, 1, 1], 2e-3)


RISING = [(400.0, 0.2), (500.0, 0.3), (600.0, 0.6), (700.0, 0.8)]
STEEP = [(wave, 5 * each) for wave, each in RISING]
PLANCK = [(wave, float(power)) for wave, power in blackbody_spectrum(3000.0)]
FLAT = [(360.0, 3.0), (830.0, 3.0)]
# a plugin; what RGB variants of Mitsuba take for it, as these have no `regular`, `irregular` and `blackbody`;
# and what they make of that (3.9.1, scalar_rgb): as light, as an albedo, and as eta and k. Their sums over
# wavelengths are 0.1 % too small: the step is a 1000th of the range, and there are 1000 points
SPECTRA: dict[str, tuple[dict[str, Any], dict[str, Any], tuple[Any, Any, Any]]] = {
    "regular": (
        {"type": "regular", "values": "3, 3", "wavelength_min": 360.0, "wavelength_max": 830.0},
        {"type": "spectrum", "value": FLAT},
        ([3.6147, 2.8447, 2.7278], [1, 1, 1], [2.997, 2.9966, 2.9964]),
    ),
    "irregular": (
        {"type": "irregular", "wavelengths": "400, 500, 600, 700", "values": "1, 1.5, 3, 4"},
        {"type": "spectrum", "value": STEEP},
        ([4.1377, 2.0168, 1.0012], [1, 1, 1], [3.5422, 2.1134, 1.1286]),
    ),
    "spectrum": (
        {"type": "spectrum", "value": "400:0.2, 500:0.3, 600:0.6, 700:0.8"},
        {"type": "spectrum", "value": RISING},
        ([0.8275, 0.4034, 0.2002], [0.7085, 0.4227, 0.2257], [0.7085, 0.4227, 0.2257]),
    ),
    "constant spectrum": (
        {"type": "spectrum", "value": 0.5},
        {"type": "spectrum", "value": 0.5},
        ([0.6024, 0.4742, 0.4545], [0.5] * 3, [0.5] * 3),
    ),
    "blackbody": (
        {"type": "blackbody", "temperature": 3000.0},
        {"type": "spectrum", "value": PLANCK},
        ([733.08, 349.58, 112.71], [1, 1, 1], [626.7, 366.53, 130.88]),
    ),
    "uniform": ({"type": "uniform", "value": 0.5}, {"type": "uniform", "value": 0.5}, ([0.5] * 3,) * 3),
    "rawconstant": (
        {"type": "rawconstant", "value": [0.1, 0.2, 0.4]},
        rgb(0.1, 0.2, 0.4),
        ([0.1, 0.2, 0.4],) * 3,
    ),
    "d65": (
        {"type": "d65", "color": rgb(0.1, 0.2, 0.4), "scale": 2.0},
        rgb(0.2, 0.4, 0.8),
        ([0.2, 0.4, 0.8],) * 3,
    ),
    "d65 alone": ({"type": "d65", "scale": 0.5}, {"type": "d65", "scale": 0.5}, ([0.5] * 3,) * 3),
    "d65 in d65": (
        {"type": "d65", "nested": {"type": "regular", "values": "3, 3"}},
        {"type": "spectrum", "value": FLAT},
        ([3.6147, 2.8447, 2.7278], [1, 1, 1], [2.997, 2.9966, 2.9964]),
    ),
    "srgb": ({"type": "srgb", "color": rgb(0.1, 0.2, 0.4)}, rgb(0.1, 0.2, 0.4), ([0.1, 0.2, 0.4],) * 3),
    "rgb": (rgb(0.1, 0.2, 0.4), rgb(0.1, 0.2, 0.4), ([0.1, 0.2, 0.4],) * 3),
}


def colors_of(spectrum: dict[str, Any]) -> list[list[float]]:
    """Return what a spectrum is as light, as an albedo and as the index of a metal."""
    lamp, clay = light("constant", radiance=spectrum), material("diffuse", reflectance=spectrum)
    metal = material("roughconductor", eta=spectrum, k=spectrum)
    assert value(metal.bsdf.eta) == value(metal.bsdf.k)
    area = shape("sphere", emitter={"type": "area", "radiance": spectrum})
    assert value(area.emission) == value(lamp.radiance)
    return [value(each) for each in (lamp.radiance, clay.bsdf.reflectance, metal.bsdf.eta)]


@pytest.mark.parametrize("name", SPECTRA)
def test_spectra_are_the_colors_of_their_use(name: str) -> None:
    given, known = SPECTRA[name][::2]
    for found, due in zip(colors_of(given), known, strict=True):
        assert found == pytest.approx(due, 2e-3, 1e-4)


@pytest.mark.parametrize("name", SPECTRA)
def test_spectra_are_the_colors_that_they_are_in_mitsuba(name: str) -> None:
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    mitsuba.set_log_level(mitsuba.LogLevel.Error)

    def loaded(key: str, **plugin: Any) -> Any:
        return np.broadcast_to(mitsuba.traverse(mitsuba.load_dict(plugin))[f"{key}.value"], 3)

    given, theirs = SPECTRA[name][:2]
    due = [
        loaded("radiance", type="constant", radiance=theirs),
        loaded("reflectance", type="diffuse", reflectance=theirs),
        loaded("eta", type="conductor", eta=theirs, k=theirs),
    ]
    for found, expected in zip(colors_of(given), due, strict=True):
        np.testing.assert_allclose(found, expected, 2e-3, 1e-6 * max(expected))


def test_one_spectrum_has_two_uses() -> None:
    """Light and an albedo may refer to the same plugin."""
    flat = {"type": "regular", "id": "flat", "values": "0.5, 0.5"}
    ref = {"type": "ref", "id": "flat"}
    made = scene(
        flat=flat,
        ball={"type": "sphere", "b": {"type": "diffuse", "reflectance": ref}},
        sky={"type": "constant", "radiance": ref},
    )
    bsdf: Any = made.shapes[0].material.bsdf
    assert value(bsdf.reflectance) == pytest.approx([0.5] * 3, 2e-3)
    assert value(made.lights[0].radiance) == pytest.approx([0.6024, 0.4741, 0.4545], 2e-3)  # type: ignore[attr-defined]


def test_spectra_whose_numbers_do_not_match_are_refused() -> None:
    uneven = {"type": "irregular", "wavelengths": "400, 500", "values": "1, 2, 3"}
    with pytest.raises(wf.SceneError, match="has 2 wavelengths and 3 values"):
        material("diffuse", reflectance=uneven)


def test_spectrum_files(tmp_path: Path) -> None:
    (tmp_path / "a.spd").write_text("# nm, value\n400 0.2\n500 0.3\n600 0.6 # here\n700 0.8\n")
    read = {"type": "spectrum", "filename": str(tmp_path / "a.spd")}
    found = material("diffuse", reflectance=read).bsdf.reflectance
    assert value(found) == pytest.approx([0.708449, 0.422684, 0.22573], 2e-3)
    (tmp_path / "a.spd").write_text("400 0.2\n500\n")
    with pytest.raises(wf.SceneError, match=r"a\.spd line 2: spectrum is '500'"):
        material("diffuse", reflectance=read)


def test_measured_materials(tmp_path: Path) -> None:
    path = tmp_path / "metal.bsdf"
    path.write_bytes(tensor_file(adaptive_fields()))
    assert type(material("measured", filename=str(path)).bsdf) is wf.Measured
    board = {"type": "rectangle", "bsdf": {"type": "measured", "filename": str(path)}}
    assert type(scene(board=board).shapes[0].material.bsdf) is wf.Sides
    two = scene(a=dict(board), b={**board, "to_world": TURN}).shapes
    assert two[0].material.bsdf.front is two[1].material.bsdf.front  # read once
    path.write_bytes(b"none")
    with pytest.raises(wf.SceneError, match=r"bsdf .*: .*metal\.bsdf: begins neither"):
        material("measured", filename=str(path))


# --- Emitters -------------------------------------------------------------------------------------


def test_maps_of_environments(tmp_path: Path) -> None:
    pixels = np.zeros((2, 4, 3), np.float32)
    pixels[0, 1] = (1, 2, 3)
    write_image(tmp_path / "sky.exr", pixels)
    sky = light("envmap", filename=str(tmp_path / "sky.exr"), scale=2.0, to_world=TURN)
    mirrored = light("envmap", bitmap=pixels[:, ::-1] * 2, to_world=np.array(TURN) @ np.diag([-1, 1, 1, 1]))
    records = [each.record(np.zeros(3)) for each in (sky, mirrored)]
    away = np.random.default_rng(1).normal(size=(3, 64)).astype(np.float32)
    away /= np.sqrt((away**2).sum(0))
    first, second = (each.le(away, None) for each in records)
    assert first.max() > 1
    np.testing.assert_allclose(first, second, atol=1e-5)
    up = np.array([[0], [1], [0]], np.float32)
    pixels[0], pixels[1] = (4, 2, 1), 8
    for rows, ahead in ((1, [4, 2, 1]), (2, [8, 8, 8])):  # the last row is repeated until there are three
        sky = light("envmap", bitmap=pixels[:rows]).record(np.zeros(3))
        np.testing.assert_allclose(sky.le(np.hstack([up, up[[0, 2, 1]]])).T, [[4, 2, 1], ahead], rtol=1e-6)


def test_spots_and_projectors() -> None:
    with pytest.raises(wf.SceneError, match=r"cutoff_angle is 0.*above 0 and at most 90"):
        light("spot", cutoff_angle=0.0)
    screen = {"type": "rectangle", "bsdf": {"type": "diffuse", "reflectance": 1.0}}
    codes = np.zeros((2, 2, 3), np.float32)
    codes[0, 0], codes[0, 1] = (1, 0, 0), (0, 1, 0)  # the upper row
    slide = {"type": "bitmap", "data": codes, "filter_type": "nearest", "raw": True}
    place = np.diag([-1.0, 1, -1, 1])  # looks along -z from z = 1, with x to the left
    place[2, 3] = 1
    view = wf.Camera.look_at((0, 0, 1), (0, 0, 0), fov=60, size=(2, 2))
    beam = {"type": "projector", "irradiance": slide, "fov": 90.0, "scale": 2.0, "to_world": place}
    lit = scene(screen=screen, beam=beam)
    lit.camera = view
    shown = np.asarray(wf.render(lit, spp=4, max_bounces=1).rgb)
    np.testing.assert_allclose(shown, 2 * codes, atol=1e-3)  # π·scale is the irradiance of white
    # a spot shows the same picture upside down, and mirrored
    beam = {"type": "spot", "texture": slide, "cutoff_angle": 45.0, "beam_width": 44.0, "to_world": place}
    lit = scene(screen=screen, beam=beam)
    lit.camera = view
    shown = np.asarray(wf.render(lit, spp=4, max_bounces=1).rgb)
    np.testing.assert_array_equal(shown > 0.05, codes[::-1, ::-1] > 0)


def test_textures_of_spheres_are_where_mitsuba_has_them() -> None:
    codes = np.random.default_rng(4).random((8, 8, 3), np.float32)
    image = {"type": "bitmap", "data": codes, "filter_type": "nearest", "raw": True}
    ball = {"type": "sphere", "to_world": TURN, "bsdf": {"type": "diffuse", "reflectance": image}}
    (body,) = scene(ball=ball).shapes
    turn = np.array(TURN)[:3, :3]
    for own in np.random.default_rng(5).normal(size=(6, 3)):
        x, y, z = own / np.linalg.norm(own)
        u, v = np.arctan2(y, x) / (2 * np.pi) % 1, np.arccos(z) / np.pi
        normal = turn @ (x, y, z)
        view = wf.Camera.look_at(body.center + 3 * normal, body.center, (0.1, 0.2, 0.3), 1e-3, size=(1, 1))
        found = wf.render([body, wf.Environment(1)], spp=1, camera=view, aovs="albedo").albedo
        np.testing.assert_allclose(found[0, 0], codes[int(v * 8), int(u * 8)], atol=1e-5)
    shared = {"a": ball, "b": {"type": "sphere", "bsdf": ball["bsdf"]}}
    first, second = scene(**shared).shapes
    assert first.material is second.material


# --- Sensors and settings -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("parameters", "across"),
    [
        ({"fov": 60.0}, 60),
        ({"fov": 60.0, "fov_axis": "larger"}, 60),
        ({"fov": 60.0, "fov_axis": "y"}, 2 * np.degrees(np.arctan(np.tan(np.pi / 6) * 2))),
        ({"fov": 60.0, "fov_axis": "smaller"}, 2 * np.degrees(np.arctan(np.tan(np.pi / 6) * 2))),
        ({"fov": 60.0, "fov_axis": "diagonal"}, 2 * np.degrees(np.arctan(np.tan(np.pi / 6) / np.sqrt(1.25)))),
        ({"focal_length": "35mm"}, 2 * np.degrees(np.arctan(np.hypot(36, 24) / 70 / np.sqrt(1.25)))),
    ],
)
def test_fields_of_view(parameters: Any, across: float) -> None:
    film = {"type": "hdrfilm", "width": 200, "height": 100}
    seen = camera(film=film, **parameters)
    points = np.array([[-np.tan(np.radians(across / 2)), 0, 1.0], [0, 0, 1], [0, 0.1, 1]])
    pixels, depth = seen.project(points)  # Mitsuba's camera looks along z, with x to the left
    np.testing.assert_allclose(pixels[:2] + 0.5, [[200.5, 50.5], [100.5, 50.5]], atol=1e-6)
    assert pixels[2, 1] < 50
    np.testing.assert_allclose(depth, 1)


def test_films_crop_and_shift() -> None:
    crop = {"crop_width": 20, "crop_height": 10, "crop_offset_x": 5, "crop_offset_y": 2}
    film = {"type": "hdrfilm", "width": 200, "height": 100, **crop}
    seen = camera(film=film, principal_point_offset_x=0.25, principal_point_offset_y=0.1, fov=60.0)
    assert (seen.resolution, seen.window) == ((200, 100), (5, 2, 25, 12))
    # the film point of the axis is where sample + offset is the middle
    np.testing.assert_allclose(seen.project([(0, 0, 1)])[0], [[50, 40]], atol=1e-6)


def test_planes_that_would_cut_are_named() -> None:
    board = {"type": "rectangle"}
    for kind, near, far, lost in (
        ("perspective", 1.0, 9.0, ""),
        ("perspective", 6.0, 9.0, "near_clip"),
        ("orthographic", 1.0, 4.0, "far_clip"),
    ):
        to_world = np.diag([-1.0, 1, -1, 1])
        to_world[2, 3] = 5
        if kind == "orthographic":
            to_world[:2] *= 3
        view = {"type": kind, "near_clip": near, "far_clip": far, "to_world": to_world}
        if lost:
            with pytest.raises(wf.SceneError, match=lost):
                scene(view=view, board=board)
        else:
            scene(view=view, board=board)


def test_the_first_sensor_that_there_is_counts() -> None:
    views = {"a": {"type": "distant"}, "b": {"type": "thinlens", "aperture_radius": 0.1}}
    with pytest.warns(UserWarning, match=r"a \(distant\): left out") as found:
        made = scene(False, **views, c={"type": "perspective"})
    assert made.camera is not None
    assert made.camera.projection.aperture == 0.2  # type: ignore[attr-defined]
    assert "the further sensor 'perspective'" in str(found[0].message)


def test_settings() -> None:
    film = {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "tent"}, "pixel_format": "rgba"}
    sampler = {"type": "multijitter", "sample_count": 7}
    path = {"type": "path", "max_depth": 3, "rr_depth": 9, "hide_emitters": True}
    made = scene(
        sensor={"type": "perspective", "film": film, "sampler": sampler},
        integrator={"type": "aov", "aovs": "d:depth", "nested": path},
        sky={"type": "constant"},
    )
    expected = {"filter": "tent", "spp": 7, "max_bounces": 2, "roulette": 9, "background": "transparent"}
    assert made.settings == expected
    image = wf.render(made, progress=False)
    assert image.spp == 7
    assert wf.render(made, spp=2, progress=False).spp == 2
    assert wf.render(made, samples=range(3), progress=False).spp == 3
    assert wf.render([wf.PointLight((0, 3, 0), 1), made], progress=False).spp == 7
    assert scene(integrator={"type": "path"}).settings["max_bounces"] > 1000


@pytest.mark.parametrize("name", FILTERS)
def test_filters_are_those_of_mitsuba(name: str) -> None:
    """Positions are distributed as its weights say."""
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    given, ours = FILTERS[name]
    theirs = mitsuba.load_dict(given)
    x = np.linspace(-theirs.radius(), theirs.radius(), 2001)[:-1] + theirs.radius() / 2000
    below = np.cumsum([theirs.eval(each) for each in x])
    u = np.full((2, 4096), 0.5, np.float32)
    u[0] = (np.arange(4096) + 0.5) / 4096
    offsets = (FILTERS_HERE.get(ours) if isinstance(ours, str) else ours)(u)[0] - 0.5
    found = np.searchsorted(np.sort(offsets), x + theirs.radius() / 2000) / 4096
    np.testing.assert_allclose(found, below / below[-1], atol=1e-3)


@pytest.mark.parametrize("pixels", ["rgb", "rgba", "xyz", "xyza", "luminance", "luminance_alpha"])
def test_pixel_formats(pixels: str) -> None:
    """Formats with alpha leave transparent what no ray meets; an environment is met everywhere."""
    view = {"type": "perspective", "film": {"type": "hdrfilm", "pixel_format": pixels}}
    lost = f"pixel_format '{pixels}'; its colors are rgb"
    if not pixels.startswith("rgb"):
        with pytest.raises(wf.SceneError, match=lost):
            scene(view=view)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", f".*{lost}")
        alone = scene(False, view=view)
        before_sky = scene(False, view=view, sky={"type": "constant"})
        measured = scene(False, view={**view, "type": "radiancemeter"})
    assert alone.settings.get("background") == ("transparent" if pixels.endswith("a") else None)
    assert "background" not in before_sky.settings
    assert "background" not in measured.settings
    with pytest.raises(wf.SceneError, match="pixel_format is 'cmyk'"):
        scene(view={**view, "film": {"type": "hdrfilm", "pixel_format": "cmyk"}})


@pytest.mark.parametrize(
    ("integrator", "hidden"),
    [
        ({"type": "path", "hide_emitters": True}, True),
        ({"type": "path"}, False),
        ({"type": "moment", "inner": {"type": "volpath", "hide_emitters": True}}, True),
        ({"type": "moment", "hide_emitters": True, "inner": {"type": "path"}}, False),
    ],
    ids=str,
)
def test_hidden_emitters(integrator: dict[str, Any], hidden: bool) -> None:
    """They are not seen by the camera, nor is the environment."""
    lamp = {"type": "rectangle", "bsdf": {"type": "diffuse", "id": "clay"}, "emitter": {"type": "area"}}
    board = {"type": "rectangle", "bsdf": {"type": "ref", "id": "clay"}}
    made = scene(lamp=lamp, ball={"type": "sphere", "lamp": {"type": "area"}}, board=board, i=integrator)
    assert [each.material.visible_to_camera for each in made.shapes] == [not hidden, not hidden, True]
    assert made.settings.get("background") == ("transparent" if hidden else None)


def test_hidden_emitters_beside_mitsuba() -> None:
    """A lamp hides a part of a board that it lights; both faces of it are passed."""
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    place, turned = np.diag([-1.0, 1, -1, 1]), np.diag([0.4, 0.4, -0.4, 1.0])
    place[2, 3], turned[2, 3] = 4, 1
    film = {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}}
    view = {"type": "perspective", "fov": 40.0, "to_world": place, "film": film}
    parts: dict[str, Any] = {
        "i": {"type": "path", "max_depth": 4, "hide_emitters": True},
        "view": view | {"sampler": {"type": "independent", "sample_count": 256}},
        "board": {"type": "rectangle", "bsdf": {"type": "twosided", "b": {"type": "diffuse"}}},
        "lamp": {"type": "rectangle", "to_world": turned, "emitter": {"type": "area", "radiance": 5.0}},
    }
    ours = np.asarray(wf.render(scene(**parts), progress=False).rgb)
    for part in (parts["view"], parts["lamp"]):
        part["to_world"] = mitsuba.ScalarTransform4f(part["to_world"])
    theirs = np.asarray(mitsuba.render(mitsuba.load_dict({"type": "scene", **parts})))
    assert ours[3:5, 3:5].min() > 0.1
    np.testing.assert_allclose(ours[2:6, 2:6].mean(), theirs[2:6, 2:6].mean(), 0.02)
    np.testing.assert_allclose(ours.mean(), theirs.mean(), 0.02)


def test_settings_of_a_scene_are_checked() -> None:
    ball = wf.Sphere((0, 0, 0), 1)
    with pytest.raises(wf.SceneError, match=r"a setting of the scene is 'sp'; .*did you mean 'spp'"):
        wf.render(wf.Scene(ball, settings={"sp": 1}), size=(4, 4))
    with pytest.raises(wf.SceneError, match="max_bounces"):
        wf.render(wf.Scene(ball, settings={"max_bounces": -1}), size=(4, 4))


# --- Media ----------------------------------------------------------------------------------------


def test_shapes_with_one_bsdf_have_media_of_their_own() -> None:
    glass = {"type": "dielectric", "id": "glass"}
    one = {"type": "sphere", "bsdf": glass, "interior": {**FOG, "id": "fog"}}
    two = {"type": "sphere", "bsdf": {"type": "ref", "id": "glass"}}
    three = {"type": "cube", "bsdf": {"type": "ref", "id": "glass"}, "interior": {"type": "ref", "id": "fog"}}
    first, second, third = (each.material for each in scene(one=one, two=two, three=three).shapes)
    assert second.interior is None
    assert first is third
    assert first.bsdf is second.bsdf


def test_the_medium_around_all_shapes() -> None:
    """It is outside of a shape, or around the sensor, and inside of none."""
    fog, inside = {**FOG, "id": "fog"}, {"type": "homogeneous", "id": "inside"}
    ref = {"type": "ref", "id": "fog"}
    nested = {"type": "sphere", "exterior": {"type": "ref", "id": "inside"}}
    ball = {"type": "sphere", "radius": 2, "interior": inside, "exterior": ref}
    made = scene(fog=fog, nested=nested, ball=ball, eye={"type": "perspective", "medium": ref})
    assert made.medium.sigma_s.ravel() == pytest.approx([0.4, 1.2, 0])
    assert scene(ball={"type": "sphere", "interior": inside}).medium is None
    with pytest.warns(UserWarning, match="another medium around all shapes"):
        scene(
            False, fog=fog, one=ball, two={"type": "cube", "exterior": {"type": "homogeneous", "sigma_t": 3}}
        )


def test_the_scene_has_the_medium_of_its_sensor_alone() -> None:
    """One outside of a shape elsewhere does not fill it; equal media, wherever they stand, are one."""
    inside, same = {**FOG, "id": "a"}, {**FOG, "id": "b"}
    box = {"type": "cube", "bsdf": {"type": "null"}, "interior": inside}
    ball = {"type": "sphere", "radius": 0.3, "exterior": same}
    at = np.eye(4)
    at[:3, 3] = 0, 0, 9
    eye = {"type": "perspective", "to_world": at}
    made = scene(eye=eye, box=box, ball=ball)
    assert made.medium is None
    with pytest.warns(UserWarning, match="the medium outside, where the sensor is not"):
        assert scene(False, eye=eye, ball=ball).medium is None
    outside = scene(eye={**eye, "m": same}, box=box, ball=ball)
    assert outside.medium is outside.shapes[0].material.interior
    within = {"type": "perspective", "m": {**FOG}}  # at the middle of the box
    assert scene(eye=within, box=box, ball=ball).medium is None
    dense = {**box, "interior": {**FOG, "phase": {"type": "rayleigh"}}}
    first, second = scene(one=box, two=dense).shapes
    assert first.material.interior is not second.material.interior


@pytest.mark.parametrize("name", ["volpath", "volpathmis", "path", "direct", "ptracer", "prb", "moment"])
def test_media_are_seen_by_integrators_that_see_them_in_mitsuba(name: str) -> None:
    ball = {"type": "sphere", "interior": FOG, "exterior": {"type": "homogeneous"}}
    inner = {"inner": {"type": "path"}} if name == "moment" else {}
    made = scene(integrator={"type": name, **inner}, ball=ball)
    seen = name.startswith("volpath")
    assert (made.shapes[0].material.interior is not None) == (made.medium is not None) == seen


def test_media_on_grids(tmp_path: Path) -> None:
    """Files of one and of three channels, constant ones, and where they are."""
    grid = np.random.default_rng(1).random((4, 3, 2, 3)).astype("<f4")
    header = struct.pack("<3sB5i6f", b"VOL", 3, 1, 2, 3, 4, 3, -1, -1, -1, 1, 3, 2)
    (tmp_path / "color.vol").write_bytes(header + grid.tobytes())
    header = header[:20] + struct.pack("<i", 1) + header[24:]
    (tmp_path / "gray.vol").write_bytes(header + grid[..., 0].tobytes())
    gray, color = (
        {"type": "gridvolume", "filename": str(tmp_path / f"{each}.vol"), "use_grid_bbox": True}
        for each in ("gray", "color")
    )

    def medium(**parameters: Any) -> Any:
        return shape("cube", interior={"type": "heterogeneous", "scale": 2, **parameters}).material.interior

    made = medium(sigma_t=gray, albedo=rgb(0.5, 1, 0), phase={"type": "hg", "g": 0.6})
    assert made.bounds.tolist() == [[-1, -1, -1], [1, 3, 2]]
    np.testing.assert_array_equal(made.density, grid[..., 0])
    assert made.sigma_s.ravel() == pytest.approx([1, 2, 0])
    assert made.sigma_a.ravel() == pytest.approx([1, 0, 2])
    assert repr(made.phase) == repr(wf.HenyeyGreenstein(0.6))
    np.testing.assert_array_equal(medium(sigma_t=color).density, grid)
    np.testing.assert_array_equal(medium(sigma_t=gray, albedo=color).albedo, grid)
    there = {**color, "use_grid_bbox": False}
    np.testing.assert_allclose(medium(sigma_t=rgb(1, 2, 3), albedo=there).density, [[[[1, 2, 3]]]])
    plain = medium(sigma_t={"type": "constvolume", "value": rgb(1, 2, 3)})
    assert (plain.sigma_s + plain.sigma_a).ravel() == pytest.approx([2, 4, 6])
    assert plain.bounds.tolist() == [[0, 0, 0], [1, 1, 1]]
    ball = {"type": "sphere", "interior": {"type": "homogeneous", "sigma_t": gray}}
    lost = {"sigma_t": {**gray, "filter_type": "nearest"}, "albedo": color}
    for each, what in (
        (ball, "sigma_t"),
        ({**ball, "interior": {"type": "heterogeneous", **lost}}, "nearest"),
    ):
        with pytest.warns(UserWarning, match=what):
            scene(False, ball=each)


@pytest.mark.filterwarnings("ignore:Mitsuba scene. not honored")
@pytest.mark.parametrize("inside", [{"type": "twosided"}, {"type": "blendbsdf", "b": {"type": "diffuse"}}])
def test_null_surfaces_in_other_plugins_are_black(inside: dict[str, Any]) -> None:
    material = (
        scene(False, ball={"type": "sphere", "b": {**inside, "a": {"type": "null"}}}).shapes[0].material
    )
    assert not material.bsdf.transmissive


# --- What is not honored, and what is wrong -------------------------------------------------------


@pytest.mark.parametrize("name", sorted(name for name, each in PLUGINS.items() if each.convert is None))
def test_unsupported_plugins_are_named(name: str) -> None:
    kind = PLUGINS[name].kind
    inside: dict[str, dict[str, Any]] = {
        "bsdf": {"ball": {"type": "sphere", "thing": {"type": name}}},
        "texture": {"ball": {"type": "sphere", "b": {"type": "diffuse", "reflectance": {"type": name}}}},
        "medium": {"ball": {"type": "sphere", "interior": {"type": name}}},
        "phase": {"ball": {"type": "sphere", "interior": {"type": name}}},
        "volume": {"ball": {"type": "sphere", "interior": {"type": name}}},
        "rfilter": {"s": {"type": "perspective", "film": {"type": "hdrfilm", "f": {"type": name}}}},
    }
    parts = inside.get(kind, {"thing": {"type": name}})
    parts["board"] = {"type": "rectangle"}
    with pytest.warns(UserWarning, match="Mitsuba scene: not honored: ") as found:
        made = scene(False, **parts)
    assert len(found) == 1
    assert (kind in str(found[0].message)) if kind in ("phase", "volume") else (name in str(found[0].message))
    assert made.shapes
    with pytest.raises(wf.SceneError, match="not honored"):
        scene(True, **parts)


def test_every_plugin_of_mitsuba_is_known() -> None:
    """Those of its shared libraries and those that its Python code registers."""
    spec = importlib.util.find_spec("mitsuba")
    if spec is None or spec.origin is None:
        pytest.skip("mitsuba is not installed")
    folder = Path(spec.origin).parent
    compiled = {path.stem for path in (folder / "plugins").iterdir()}
    sources = "".join(path.read_text() for path in (folder / "python").rglob("*.py"))
    registered = re.findall(r"register_(\w+)\(\s*\"(\w+)\"", sources)
    assert len(compiled) > 80
    assert len(registered) > 5
    assert not compiled - PLUGINS.keys()
    for kind, name in registered:
        assert PLUGINS[name].kind == kind


def test_one_warning_names_plugin_id_and_parameter() -> None:
    parts = {
        "ball": {"type": "sphere", "softness": 3, "bsdf": {"type": "diffuse", "id": "clay", "grain": 1}},
        "sky": {"type": "constant", "clouds": True},
    }
    with pytest.warns(UserWarning, match="not honored") as found:
        scene(False, **parts)
    (message,) = [str(each.message) for each in found]
    for part in ("ball (sphere): softness", "bsdf (diffuse) 'clay': grain", "sky (constant): clouds"):
        assert part in message


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"ball": {"type": "spere"}}, "there is no plugin 'spere'; did you mean 'sphere'"),
        ({"ball": {"type": "sphere", "radius": -1}}, r"ball \(sphere\): radius is -1; it must be above 0"),
        ({"ball": {"type": "sphere", "radius": "big"}}, "radius must be a number"),
        ({"ball": {"type": "sphere", "to_world": np.eye(3)}}, "to_world must have shape"),
        ({"ball": {"type": "sphere", "b": {"type": "ref", "id": "x"}}}, "refers to the id 'x'"),
        ({"a": {"type": "ref", "id": "b"}, "b": {"type": "ref", "id": "a"}}, "lead to each other|refers to"),
        ({"ball": {"type": "sphere", "b": {"type": "diffuse", "reflectance": 2}}}, r"reflectance is .*2"),
        ({"ball": {"type": "sphere", "b": {"type": "conductor", "material": "Xx"}}}, "material is 'Xx'"),
        ({"ball": {"type": "sphere", "b": {"type": "dielectric", "int_ior": "tea"}}}, "int_ior is 'tea'"),
        ({"ball": {"type": "obj", "filename": "none.obj"}}, r"none\.obj"),
        ({"ball": {"type": "sphere", "e": {"type": "point"}}}, "which is no area light"),
        ({"s": {"type": "perspective", "fov": 60, "focal_length": "35mm"}}, "give one of them"),
        ({"s": {"type": "perspective", "film": {"type": "hdrfilm", "width": 0}}}, "width is 0"),
        ({"s": {"type": "perspective", "fov": 180.0}}, r"fov is 180\.0.*39\.6 in its place"),
        (
            {"s": {"type": "perspective", "film": {"type": "hdrfilm", "crop_width": 999}}},
            "the crop .* outside",
        ),
        ({"a": {"type": "constant"}, "b": {"type": "constant"}}, "1 further light from all around; left out"),
        ({"ball": {"type": "cube", "interior": {"type": "homogeneous", "albedo": 1.5}}}, "clamped to 1"),
        ({"i": {"type": "path", "max_depth": -5}}, "max_depth is -5"),
        ({"i": {"type": "instance", "group": {"type": "cube"}}}, "it must be a shapegroup"),
        ({"i": {"type": "instance"}}, "holds no shape"),
        ({"ball": {"type": "sphere", "b": {"type": "mask"}}}, "holds no bsdf"),
        (
            {"ball": {"type": "sphere", "b": {"type": "normalmap", "bsdf": {"type": "diffuse"}}}},
            "normalmap is None",
        ),
        ({"ball": {"type": "sphere", "b": {"type": "blendbsdf", "a": {"type": "diffuse"}}}}, "holds 1 bsdfs"),
        ({"ball": {"type": 3}}, "there is no plugin 3"),
    ],
)
def test_damage_costs_the_damaged_part(parts: Any, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        scene(board={"type": "rectangle"}, **parts)
    with pytest.warns(UserWarning, match=message) as caught:
        made = scene(False, board={"type": "rectangle"}, **parts)
    assert len(caught) == 1
    assert len(made.shapes[0].faces) == 2
    if "ball" in parts and parts["ball"]["type"] == "sphere":  # the others are as they are
        assert isinstance(made.shapes[1], wf.Sphere)


def test_a_scene_is_a_dictionary_of_type_scene() -> None:
    for wrong in (None, [], {"type": "sphere"}, "scene"):
        with pytest.raises(wf.SceneError, match=r'of type "scene"'):
            wf.from_mitsuba(wrong)  # type: ignore[arg-type]


def test_bombs_are_refused() -> None:
    # each level refers to the one before twice: 2^40 plugins
    parts: dict[str, Any] = {"m0": {"type": "diffuse"}}
    for level in range(1, 41):
        before = {"type": "ref", "id": f"m{level - 1}"}
        parts[f"m{level}"] = {"type": "blendbsdf", "a": before, "b": dict(before), "weight": 0.5}
    with pytest.raises(wf.SceneError, match="as they refer to each other; the limit is"):
        scene(ball={"type": "sphere", "bsdf": {"type": "ref", "id": "m40"}}, **parts)
    chain = {f"m{k}": {"type": "twosided", "b": {"type": "ref", "id": f"m{k + 1}"}} for k in range(2000)}
    with pytest.raises(wf.SceneError, match="refer to each other over more than 128 levels"):
        scene(**chain, m2000={"type": "diffuse"})
    boards = {f"board{k}": {"type": "rectangle"} for k in range(3)}
    with pytest.raises(wf.SceneError, match=r"board1 \(rectangle\): has 4 triangles; the limit is 3"):
        wf.from_mitsuba({"type": "scene", **boards}, limits=wf.LoadLimits(triangles=3))
    deep: dict[str, Any] = {"type": "diffuse"}
    for _level in range(1000):
        deep = {"type": "twosided", "bsdf": deep}
    with pytest.raises(wf.SceneError, match="nested deeper"):
        scene(ball={"type": "sphere", "bsdf": deep})
    own: dict[str, Any] = {"type": "twosided"}
    own["bsdf"] = own
    with pytest.raises(wf.SceneError, match=r"nested deeper|contains itself"):
        scene(ball={"type": "sphere", "bsdf": own})


ODD = (
    None,
    -1,
    0,
    3,
    1e400,
    float("nan"),
    "",
    "x",
    [],
    [1, 2],
    {},
    {"type": "rgb"},
    {"type": "ref", "id": "clay"},
)
ODD += (
    {"type": "bitmap", "data": np.ones((1, 1))},
    {"type": "spectrum", "value": [(1, 2)]},
    True,
    np.eye(4),
    object(),
)  # type: ignore[assignment]
ODD += (
    {"type": "checkerboard", "color0": 0.5},
    {"type": "diffuse"},
    "400:1, 500:2",
    {"type": "irregular"},
    {1: 2},
)  # type: ignore[assignment]


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_odd_values_give_a_scene_or_a_typed_error(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bases = [
        {"type": name, **{each: 1.0 for each in entry.reads if each in ("fov", "value", "temperature")}}
        for name, entry in PLUGINS.items()
        if entry.convert is not None and entry.kind != "scene"
    ]
    for _turn in range(10 if seed else 1):
        for base in bases:
            entry = PLUGINS[base["type"]]  # type: ignore[index]
            for name in (*entry.reads, "type", "id", "inner"):
                if not seed and rng.random() < 0.5:
                    continue  # the slow run tries all
                part: dict[Any, Any] = {**base, name: ODD[rng.integers(len(ODD))]}
                where: dict[str, Any] = {
                    "bsdf": {"type": "sphere", "b": part},
                    "texture": {"type": "sphere", "b": {"type": "diffuse", "reflectance": part}},
                    "film": {"type": "perspective", "film": part},
                    "rfilter": {"type": "perspective", "film": {"type": "hdrfilm", "f": part}},
                    "sampler": {"type": "perspective", "s": part},
                }
                try:
                    scene(
                        False,
                        clay={"type": "diffuse"},
                        board={"type": "rectangle"},
                        part=where.get(entry.kind, part),
                    )
                except (wf.SceneError, UserWarning):
                    continue


def files_of_scenes(folder: Path) -> dict[str, str]:
    """Write a file of each kind that plugins read, and return their paths."""
    header = struct.pack("<3sB5i6f", b"VOL", 3, 1, 2, 2, 2, 1, 0, 0, 0, 1, 1, 1)
    grid, mesh = np.linspace(-1, 1, 8, dtype="<f4"), serialized(4, False)
    contents = {
        "mesh.obj": OBJ.encode(),
        "mesh.ply": PLY.encode(),
        "mesh.serialized": mesh + struct.pack("<QI", 0, 1),
        "distances.vol": header + grid.tobytes(),
        "densities.vol": header + abs(grid).tobytes(),
        "a.bsdf": tensor_file(adaptive_fields()),
        "a.spd": b"400 0.2\n700 0.8\n",
    }
    for name, content in contents.items():
        (folder / name).write_bytes(content)
    write_image(folder / "a.exr", np.ones((2, 4, 3), np.float32))
    return {name: str(folder / name) for name in (*contents, "a.exr")}


def parameters_of(name: str, files: dict[str, str]) -> list[dict[str, Any]]:
    """Return parameters with which a plugin reads all that it ever reads, in one scene or in several."""
    image = {"type": "bitmap", "data": np.ones((2, 2, 3), np.float32)}
    clay, facets = {"bsdf": {"type": "diffuse"}}, {"alpha_u": 0.1, "alpha_v": 0.2}
    phases = {"a": {"type": "hg"}, "b": {"type": "isotropic"}}
    found = {
        "obj": [{"filename": files["mesh.obj"], "face_normals": True}],
        "ply": [{"filename": files["mesh.ply"], "face_normals": True}],
        "serialized": [{"filename": files["mesh.serialized"], "face_normals": True}],
        "sdfgrid": [
            {"filename": files["distances.vol"]},
            {"grid": np.eye(2)[None, ..., None].repeat(2, 0) - 0.5},
        ],
        "instance": [{"group": {"type": "shapegroup", "cube": {"type": "cube"}}}],
        "conductor": [{"eta": 1.0, "k": 2.0}],
        "roughconductor": [{"eta": 1.0, "k": 2.0}, facets],
        "roughdielectric": [{}, facets],
        "principled": [{"eta": 1.4}, {"specular": 0.5}],
        "blendbsdf": [{"a": clay["bsdf"], "b": {"type": "conductor"}}],
        "bumpmap": [clay | {"map": image}],
        "normalmap": [clay | {"normalmap": {**image, "raw": True}}],
        "measured": [{"filename": files["a.bsdf"]}],
        "rgb": [{"value": 0.5}],
        "spectrum": [{"value": 0.5}, {"filename": files["a.spd"]}],
        "irregular": [{"wavelengths": "400, 700", "values": "1, 2"}],
        "regular": [{"values": "1, 2"}],
        "mesh_attribute": [{"name": "vertex_heat"}],
        "bitmap": [{"filename": files["a.exr"]}, image, {"bitmap": image["data"]}],
        "spot": [{"texture": image}],
        "projector": [{"irradiance": image, "fov": 30.0}, {"irradiance": image}],
        "envmap": [{"filename": files["a.exr"]}, {"bitmap": image["data"]}],
        "sunsky": [{}, {"sun_direction": [0, 0.5, 1]}],
        "perspective": [{}, {"fov": 30.0}],
        "thinlens": [{}, {"fov": 30.0}],
        "radiancemeter": [{"origin": [0, 0, 3], "direction": [0, 0, 1]}, {}],
        "blendphase": [phases],
        "moment": [{"inner": {"type": "path"}}],
        "gridvolume": [{"filename": files["densities.vol"], "use_grid_bbox": True}],
    }
    alike = {
        "mask": [clay],
        "twosided": [clay],
        "aov": found["moment"],
    }
    default = {"sample_count": 4} if PLUGINS[name].kind == "sampler" else {}
    return (found | alike).get(name, [default])


def scene_with(name: str, parameters: dict[str, Any], files: dict[str, str]) -> dict[str, Any]:
    """Return the parts of a scene in which a plugin is used."""
    part = {"type": name, **parameters}
    ply = {"type": "ply", "filename": files["mesh.ply"]}
    fog = {"type": "heterogeneous", "sigma_t": part}
    wrapped: dict[str, dict[str, Any]] = {
        "bsdf": {"type": "rectangle", "b": part},
        "texture": ply | {"b": {"type": "diffuse", "reflectance": part}},
        "film": {"type": "perspective", "film": part},
        "rfilter": {"type": "perspective", "film": {"type": "hdrfilm", "f": part}},
        "sampler": {"type": "perspective", "s": part},
        "medium": {"type": "cube", "interior": part},
        "phase": {"type": "cube", "interior": {"type": "homogeneous", "phase": part}},
        "volume": {"type": "cube", "interior": fog},
    }
    if name == "area":
        return {"lamp": {"type": "rectangle", "emitter": part}}
    if name == "irradiancemeter":
        return {"meter": {"type": "rectangle", "sensor": part}}
    return {"part": wrapped.get(PLUGINS[name].kind, part), "board": {"type": "rectangle"}}


@pytest.mark.filterwarnings("ignore:Mitsuba scene. not honored")
@pytest.mark.parametrize("name", sorted(name for name, each in PLUGINS.items() if each.convert is not None))
def test_the_table_says_what_is_read(name: str, calls_of: Any, tmp_path: Path) -> None:
    if name == "sunsky" and None in map(importlib.util.find_spec, ("mitsuba", "pvlib")):
        pytest.skip("its data come with mitsuba, and the place of the sun from pvlib")
    files = files_of_scenes(tmp_path)
    calls = calls_of("wavefront.io.description.entity.Entity.get")
    for parameters in parameters_of(name, files):
        scene(False, **scene_with(name, parameters, files))
    assert {call.args[1] for call in calls if call.args[0].type == name} == set(PLUGINS[name].reads)


def test_what_the_table_does_not_say_cannot_be_read() -> None:
    with pytest.raises(KeyError, match="does not read"):
        Entity("shape", "sphere", "", "", {}, Job).get("softness")


def test_the_documentation_lists_the_plugins() -> None:
    page = Path(__file__).parents[2] / "docs" / "mitsuba.md"
    text = page.read_text()
    table = plugin_table()
    begin, end = "<!-- plugins -->\n", "<!-- end -->\n"
    found = text.partition(begin)[2].partition(end)[0]
    assert found == table, f"docs/mitsuba.md must have this table:\n{table}"


def plugin_table() -> str:
    """Return the table of plugins as the documentation has it."""
    rows: dict[tuple[str, tuple[str, ...], str], list[str]] = {}
    for name, each in PLUGINS.items():
        if each.convert is not None and each.kind != "scene":
            rows.setdefault((each.kind, each.reads, each.note), []).append(name)
    order = ("shape", "bsdf", "texture", "emitter", "sensor", "film", "rfilter", "sampler", "integrator")
    order += ("medium", "phase", "volume")
    lines = ["| kind | plugins | reads | note |", "|---|---|---|---|"]
    for kind in order:
        for (own, reads, note), names in rows.items():
            if own == kind:
                listed, read = (", ".join(f"`{each}`" for each in part) for part in (names, reads))
                lines.append(f"| {kind} | {listed} | {read or '–'} | {note or '–'} |")
    lines += ["", "Not supported, and named in the warning:", ""]
    for kind in order:  # not that of the table, in which modules stand as they were imported
        names = [f"`{name}`" for name, each in PLUGINS.items() if each.kind == kind and each.convert is None]
        if names:
            lines.append(f"- {kind}: {', '.join(names)}")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(("bsdf", "most"), [("principledthin", 1.4), ("diffuse", 1.0)])
def test_fields_of_a_checkerboard_have_the_range_of_their_use(bsdf: str, most: float) -> None:
    """`diff_trans` goes up to 2; a reflectance above 1 is clamped, with a word."""
    board = {"type": "checkerboard", "color0": 0.2, "color1": 1.4}
    name = "diff_trans" if bsdf == "principledthin" else "reflectance"
    scene = {"type": "scene", "a": {"type": "sphere", "bsdf": {"type": bsdf, name: board}}}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        made = wf.from_mitsuba(scene).shapes[0].material.bsdf
    texture = made.diffuse_transmission if bsdf == "principledthin" else made.reflectance
    assert max(texture.limits()) == pytest.approx(most)
    assert len(caught) == (most == 1)


def test_a_mesh_with_normals_keeps_faces_of_vertices_that_do_not_exist_until_they_are_left_out() -> None:
    """Its faces are turned to its normals before that."""
    raw = facing(RawMesh("a", np.eye(3), np.array([[0, 1, 2], [0, 1, 99]]), np.ones((3, 3))), reverse=False)
    assert raw.faces.shape == (2, 3)
    assert raw.faces.max() == 99
