"""Every parameter of every public call, with values that are wrong: the error names it."""

from __future__ import annotations

import inspect
import re
import warnings
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

import wavefront as wf

P3, TRIANGLE = (0.0, 0.0, 0.0), {"vertices": np.eye(3), "faces": [[0, 1, 2]]}
BALL, GRAY, SKY = wf.Sphere(P3, 1), wf.Diffuse(), wf.Environment(1)
MESH = wf.Mesh(**TRIANGLE)
SCENE, CAMERA = wf.Scene([BALL], [SKY]), wf.Camera.look_at((0, 0, 4), P3, size=(4, 4))
GRID = wf.GridMedium(np.ones((2, 2, 2)))
PICTURE = wf.Image(np.ones((4, 4, 3), np.float32))
BITS = np.ones((2, 2, 3), np.uint8)
ENDS = {"starts": [P3], "ends": [(1, 0, 0)], "radii": 0.1}
YEAR = {"direct_normal": [1.0], "diffuse_horizontal": [1.0], "sun": [(0, 1, 0)]}
SMALL = {"spp": 1, "size": (4, 4)}
WITHOUT = """BoxFilter Dielectric Diffuse DiffuseTransmission Disney GaussianFilter HenyeyGreenstein Isotropic
LoadLimits Medium Mirror NullSurface OpenPBR OrenNayar Plastic Principled Rayleigh ShadowCatcher TentFilter
ThinDielectric ThinDisney VertexColors studio"""
K = [[4, 0, 2], [0, 4, 2], [0, 0, 1]]
CALLS: dict[str, dict[str, Any]] = {
    **{name: {} for name in WITHOUT.split()},
    "Conductor": {"eta": "gold"},
    "Material": {"bsdf": GRAY},
    "exposure": {"ev100": 10},
    "Box": {"center": P3, "size": 1},
    "BumpMap": {"image": BITS},
    "NormalMap": {"image": BITS},
    "Texture": {"source": BITS},
    "Camera": {"origin": P3, "rotation": np.eye(3), "projection": CAMERA.projection, "size": (4, 4)},
    "Camera.look_at": {"origin": (0, 0, 4), "target": P3},
    "Camera.from_intrinsics": {
        "K": [[4, 0, 2], [0, 4, 2], [0, 0, 1]],
        "R": np.eye(3),
        "t": P3,
        "size": (4, 4),
    },
    "Camera.from_matrix": {"cam_to_world": np.eye(4)},
    "Camera.framing": {"scene": SCENE},
    "Camera.orthographic": {"origin": (0, 0, 4), "target": P3, "height": 2},
    "Camera.panorama": {"origin": P3},
    "Camera.fisheye": {"K": np.eye(3), "D": np.zeros(4), "R": np.eye(3), "t": P3, "size": (4, 4)},
    "Fisheye": {"fov": 90},
    "Conductor.named": {"name": "gold"},
    "Dielectric.named": {"name": "glass"},
    "Instance.many": {"mesh": MESH, "transforms": [np.eye(4)]},
    "Sky.hosek_wilkie": {"turbidity": 3, "ground_albedo": 0.2, "sun": (0, 1, 0)},
    "Capsules": ENDS,
    "Cylinders": ENDS,
    "DirectionalLight": {"direction": (0, -1, 0), "irradiance": 1},
    "Disk": {"center": P3, "normal": (0, 1, 0), "radius": 1},
    "Edges": {"lines": [[P3, (1, 0, 0)]], "radius": 0.1},
    "Environment": {"radiance": 1},
    "GridBox": {"medium": GRID},
    "GridMedium": {"density": np.ones((2, 2, 2))},
    "Group": {"shapes": [BALL]},
    "HeightField": {"z": np.ones((3, 3))},
    "Image": {"rgb": np.ones((4, 4, 3), np.float32)},
    "Instance": {"mesh": MESH, "transform": np.eye(4)},
    "Mesh": TRIANGLE,
    "Mix": {"first": GRAY, "second": GRAY},
    "PhaseMix": {"first": wf.Isotropic(), "second": wf.Rayleigh()},
    "Plane": {"point": P3},
    "PointLight": {"position": P3, "intensity": 1},
    "PointLights": {"positions": [P3], "intensities": 1},
    "Points": {"points": [P3, (1, 0, 0)]},
    "Projector": {"position": P3, "picture": BITS, "direction": (0, 0, -1)},
    "Rectangle": {"corner": P3, "edge_u": (1, 0, 0), "edge_v": (0, 1, 0)},
    "Scene": {"shapes": [BALL]},
    "Sides": {"front": GRAY},
    "SignedDistanceGrid": {"values": np.indices((3, 3, 3)).sum(0) - 2.5},
    "Sky.cie": {"type": 12, "sun": (0, 1, 0)},
    "Sphere": {"center": P3, "radius": 1},
    "Spheres": {"centers": [P3], "radii": 1},
    "SpotLight": {"position": P3, "intensity": 1, "direction": (0, -1, 0)},
    "Weather": YEAR,
    "blackbody": {"temperature": 5000},
    "compare": {"a": PICTURE, "b": PICTURE},
    "from_photometric": {"value": 1},
    "to_photometric": {"radiometric": 1},
    "grid_points": {"corner": P3, "edge_u": (1, 0, 0), "edge_v": (0, 1, 0), "counts": 2},
    "interpolate_cameras": {"cameras": [CAMERA, CAMERA], "n": 3},
    "orbit": {"camera": CAMERA, "center": P3, "degrees": 30},
    "turntable": {"scene": SCENE, "n": 2},
    "with_flux": {"source": wf.PointLight(P3, 1), "lumens": 100},
    "render": {"scene": SCENE, **SMALL},
    "Material.named": {"name": "gold"},
}
ODD: dict[str, Any] = {
    "text": "nonsense",
    "bytes": b"x",
    "object": object(),
    "nan": float("nan"),
    "negative": -1e30,
    "huge": 1e300,
    "complex": 1j,
    "picture of nan": np.full((4, 4, 3), np.nan),
    "picture below 0": np.full((4, 4, 3), -5.0),
    "four axes": np.ones((2, 2, 2, 2)),
    "truths": np.array([True, False]),
    "words": np.array(["a", "b"]),
    "nothing": [],
    "no rows": np.zeros((0, 3)),
    "ragged": [[1, 2], [3]],
    "none in it": [None],
    "empty dict": {},
    "function": len,
}
# these take names of files, of which the error says that there is no such file, and functions of the user
PATHS = "source", "image", "picture", "radiance", "backdrop", "scene", "a", "b"
PLUGGED = "integrator", "sampler", "accel", "filter", "light_sampler"
NEVER = "executor", "workers", "progress", "checkpoint"  # they would start processes, and write files


if find_spec("mitsuba") is None:
    del CALLS["Sky.hosek_wilkie"]


def made(name: str) -> Callable[..., Any]:
    """Return a public class, function or class method."""
    found: Any = wf
    for part in name.split("."):
        found = getattr(found, part)
    return found  # type: ignore[no-any-return]


def odd_calls(name: str) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield a parameter, what is odd, and the arguments, for each parameter and each odd value."""
    for parameter in inspect.signature(made(name)).parameters:
        for kind, value in ODD.items():
            skipped = parameter in NEVER or (kind == "text" and parameter in PATHS)
            if not skipped and not (kind == "function" and parameter in PLUGGED):
                yield parameter, kind, {**CALLS[name], parameter: value}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", CALLS)
def test_errors_name_the_parameter_as_it_is_written(name: str) -> None:
    call, wrong = made(name), []
    call(**CALLS[name])
    for parameter, kind, arguments in odd_calls(name):
        try:
            call(**arguments)
        except wf.SceneError as error:
            if not re.search(rf"\b{parameter}\b", str(error)):
                wrong.append(f"{parameter}, {kind}: {error}")
        except Exception as error:
            wrong.append(f"{parameter}, {kind}: {error!r}")
    assert wrong == []


FLAGS = {
    "Principled": ("thin", "conserve_energy", "multiscatter"),
    "Dielectric": ("multiscatter",),
    "Plastic": ("nonlinear", "multiscatter"),
    "OrenNayar": ("energy_preserving",),
    "OpenPBR": ("geometry_thin_walled",),
    "Sky.hosek_wilkie": ("disk",),
    "GaussianFilter": ("windowed",),
    "Material": ("visible_to_camera",),
    "Texture": ("srgb",),
    "Mesh": ("two_sided",),
    "Rectangle": ("two_sided",),
    "Cylinders": ("caps",),
    "HeightField": ("smooth",),
    "SignedDistanceGrid": ("smooth",),
    "render": ("strict", "caustics"),
}


if find_spec("mitsuba") is None:  # which brings the data of this sky
    del FLAGS["Sky.hosek_wilkie"]


@pytest.mark.parametrize("name", FLAGS)
@pytest.mark.parametrize("value", ["false", "True", 0, 1, None, np.array([True]), []])
def test_flags_are_true_or_false(name: str, value: Any) -> None:
    for parameter in FLAGS[name]:
        with pytest.raises(wf.SceneError, match=f"{parameter} is .*; it must be True or False"):
            made(name)(**{**CALLS[name], parameter: value})
        if name != "render":
            made(name)(**{**CALLS[name], parameter: np.True_})


def test_only_numbers_that_have_a_range_of_their_own_are_odd() -> None:
    """What is neither named nor refused is known: values that mean something there."""
    accepted = set()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in ("Principled", "Mesh", "Image", "Scene", "OpenPBR", "Points"):
            for parameter, kind, arguments in odd_calls(name):
                try:
                    made(name)(**arguments)
                    accepted.add((name, parameter, kind))
                except wf.SceneError:
                    pass
    strange = {"object", "nan", "complex", "truths", "words", "ragged", "none in it", "function", "bytes"}
    assert [each for each in sorted(accepted) if each[2] in strange] == []


@pytest.mark.parametrize("value", [kind for kind in ODD if kind != "empty dict"])
def test_methods_of_shapes_and_pictures_name_their_arguments(value: str) -> None:
    odd: Any = ODD[value]
    for shape in (MESH, BALL, wf.Spheres([P3], 1)):
        with pytest.raises(wf.SceneError, match="matrix"):
            shape.transformed(odd)
        with pytest.raises(wf.SceneError, match="offset"):
            shape.translated(odd)
    with pytest.raises(wf.SceneError, match="gamma"):
        PICTURE.to_uint8(gamma=odd)
