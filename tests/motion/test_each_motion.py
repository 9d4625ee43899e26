"""What moves, with what light does beside it: blurred pictures are means of stills.

A table of the kinds of motion by materials and settings. The accelerators alternate over it, so that each
kind of motion and each of the others is traced by both.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from stills import assert_mean_of_stills

import wavefront as wf


def placed(linear: Any = (1, 1, 1), shift: Any = (0, 0, 0), degrees: float = 0) -> np.ndarray:
    """Scales along the axes, a turn about y, and then a shift, as a matrix (4, 4)."""
    turn, matrix = np.radians(degrees), np.eye(4)
    matrix[0, 0] = matrix[2, 2] = np.cos(turn)
    matrix[0, 2], matrix[2, 0] = np.sin(turn), -np.sin(turn)
    matrix[:3, :3] = matrix[:3, :3] @ np.diag(linear)
    matrix[:3, 3] = shift
    return matrix


TURN = wf.Keyframes([0, 0.4, 1], [placed(), placed(shift=(0.4, 0.2, 0), degrees=60), placed(degrees=170)])
SLIDE = wf.Keyframes([0, 1], [placed(), placed(shift=(0.8, 0, 0.3))])
GROWS = wf.Keyframes([0, 1], [placed((-0.7, 0.7, 0.7)), placed((-1.2, 0.5, 1), (0.5, 0, 0), 100)])
SWELLS = wf.Keyframes([0, 1], [placed((0.6, 0.6, 0.6)), placed((1.1, 1.1, 1.1), (0.4, 0, 0))])
PAN = wf.Keyframes([0, 1], [placed(), placed(shift=(0.3, -0.1, -0.2), degrees=4)])
BALL = trimesh.creation.icosphere(2, 0.6)
BOX = wf.Box((0, 0, 0), 0.9)
RNG = np.random.default_rng(1)
HOLES = wf.Texture((RNG.random((4, 4, 1)) > 0.4).astype(np.float32), srgb=False, channel=0, filter="nearest")
STRIPES = wf.Texture(RNG.random((4, 8, 3)).astype(np.float32) * 12, srgb=False)
VIEW = wf.Camera.look_at((0, 1.6, 5), (0, 0.2, 0), fov=40, size=12)
LENS = wf.Camera.look_at((0, 1.6, 5), (0, 0.2, 0), fov=40, size=12, aperture=0.2, focus=4)
FLOOR = wf.Rectangle((-3, -0.6, 3), (6, 0, 0), (0, 0, -6), material=wf.Diffuse(0.6))
SKY = wf.Environment(0.3)
PANEL = wf.Rectangle((-0.6, 2.4, -0.6), (1.2, 0, 0), (0, 0, 1.2), emission=12)
INNER = wf.Box((0, -0.1, 0), (0.6, 0.5, 0.6))


def filled(bsdf: wf.bsdfs.Bsdf, priority: int | None = None, **medium: Any) -> wf.Material:
    return wf.Material(bsdf, interior=wf.Medium(**medium), priority=priority)


def box(material: Any) -> wf.Mesh:
    uvs = np.tile([(0, 0), (1, 0), (1, 1), (0, 1)], (6, 1))[: len(BOX.vertices)]
    return wf.Mesh(BOX.vertices, BOX.faces, uvs=uvs, material=material)


def moving(name: str, material: Any, inner: list[wf.Shape]) -> tuple[list[Any], list[Any], wf.Camera]:
    """Shapes, lights and a camera, one of which moves; the shapes have a material, with `inner` in them."""
    still, lamps = [box(material), *inner], [PANEL]
    match name:
        case "nested":
            return [shape.transformed(SLIDE).transformed(TURN) for shape in still] + lamps, [], VIEW
        case "mirrored":
            return [shape.transformed(GROWS) for shape in still] + lamps, [], VIEW
        case "sphere":
            return [wf.Sphere((0, 0, 0), 0.6, material=material).transformed(SWELLS), *lamps], [], VIEW
        case "deforming":
            forms = np.stack([BALL.vertices, BALL.vertices * (1.2, 0.6, 1) + (0.4, 0, 0)])
            mesh = wf.Mesh(forms, BALL.faces, times=[0, 1], material=material)
            return [mesh, *lamps], [], VIEW
        case "spheres":
            places = np.array([[(0, 0, 0), (-0.9, 0.3, 0)], [(0.5, 0, 0.2), (-0.9, 0.3, 0.8)]])
            return [wf.Spheres(places, 0.4, material=material, times=[0, 1]), *lamps], [], VIEW
        case "camera":
            return still + lamps, [], VIEW.transformed(PAN)
        case "lens":
            return (
                [*still, *lamps, wf.Sphere((0.9, 0, -1), 0.4).transformed(SLIDE)],
                [],
                LENS.transformed(PAN),
            )
        case "lamp":
            quad = wf.Mesh(
                PANEL.vertices,
                PANEL.faces,
                uvs=[(0, 0), (1, 0), (1, 1), (0, 1)],
                emission=STRIPES,
                material=wf.Material(wf.Diffuse(0), alpha=HOLES),
            )
            return [*still, quad.transformed(TURN)], [], VIEW
        case _:
            return still, [wf.SpotLight((0, 2.2, 0.5), 30, direction=(0, -1, -0.2)).transformed(TURN)], VIEW


MOVES = ("nested", "mirrored", "sphere", "deforming", "spheres", "camera", "lens", "lamp", "spot")
CAN_HOLD = ("nested", "mirrored", "camera", "lens", "lamp", "spot")  # another shape inside
GLASS = wf.Dielectric(1.5)
WATER = wf.Mesh(INNER.vertices, INNER.faces, material=filled(wf.Dielectric(1.33), 2, absorption=(0.2, 1, 2)))
SEED = wf.Mesh(INNER.vertices, INNER.faces, material=wf.Diffuse((0.8, 0.3, 0.2)))
WITH: dict[str, tuple[Any, list[wf.Shape], dict[str, Any]]] = {
    "gold": (wf.Conductor("gold", roughness=0.3), [], {}),
    "glass": (GLASS, [], {}),
    "prism": (wf.Dielectric((1.4, 1.5, 1.65)), [], {}),
    "ink": (filled(wf.NullSurface(), absorption=(0.3, 1, 3)), [SEED], {}),
    "fog": (filled(wf.NullSurface(), scattering=1.5), [SEED], {}),
    "drink": (filled(GLASS, 1, absorption=0.05), [WATER], {}),
    "holes": (wf.Material(wf.Diffuse(0.6), alpha=HOLES), [SEED], {}),
    "unseen": (wf.Material(wf.Diffuse(0.6), visible_to_camera=False), [], {}),
    "caustics": (GLASS, [], {"caustics": True}),
    "branches": (wf.Plastic((0.7, 0.2, 0.2), roughness=0.3), [], {"branches": 4}),
    "shared": (wf.Diffuse(0.6), [], {"reuse": True}),
}
TABLE = [
    pytest.param(motion, with_what, ("numpy", "embree")[(row + column) % 2], id=f"{motion}-{with_what}")
    for row, motion in enumerate(MOVES)
    for column, with_what in enumerate(WITH)
    if motion in CAN_HOLD or not WITH[with_what][1]
]


@pytest.mark.slow
@pytest.mark.parametrize(("motion", "with_what", "accel"), TABLE)
def test_blurred_pictures_are_means_of_stills(motion: str, with_what: str, accel: str) -> None:
    material, inner, settings = WITH[with_what]
    shapes, lights, camera = moving(motion, material, inner)
    assert_mean_of_stills(
        wf.Scene([FLOOR, *shapes], [SKY, *lights], camera),
        **{"runs": 4, "strata": 16, "spp": 64, "still_spp": 4, "accel": accel},
        **{"max_error": 0.08, "max_bounces": 5, **settings},
    )


@pytest.mark.slow
@pytest.mark.parametrize("scattering", [0, 0.3])
def test_inks_that_touch_while_they_move_are_both_known(scattering: float) -> None:
    """One turns with the other, and one goes along a still one."""
    inks = [
        wf.Mesh(
            half.vertices,
            half.faces,
            material=filled(wf.NullSurface(), absorption=ink, scattering=scattering),
        )
        for half, ink in (
            (wf.Box((-0.4, 0, 0), 0.8), (0.2, 2, 4)),
            (wf.Box((0.4, 0, 0), 0.8), (4, 2, 0.2)),
        )
    ]
    along = wf.Keyframes([0, 1], [placed(), placed(shift=(0, 0.4, 0.3))])
    for shapes in ([ink.transformed(TURN) for ink in inks], [inks[0], inks[1].transformed(along)]):
        assert_mean_of_stills(
            wf.Scene([FLOOR, *shapes], [SKY, wf.PointLight((2, 4, 3), 40)], VIEW),
            **{"runs": 4, "strata": 16, "spp": 64, "still_spp": 4, "max_bounces": 5},
        )
