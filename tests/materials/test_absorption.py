"""Colored glass: exp(−absorption · length) along the way through it."""

import numpy as np
import pytest
from inside import Absorption, compile_scene, make_accelerator

import wavefront as wf

ABSORPTION = np.array([0.2, 1.0, 3.0])


def filled(bsdf: wf.Bsdf, absorption) -> wf.Material:
    """A surface with an absorbing medium behind it."""
    return wf.Material(bsdf, interior=wf.Medium(absorption))


GLASS = filled(wf.Dielectric(1.0), ABSORPTION)


def through(material: wf.Bsdf, thickness: float, **options: object) -> np.ndarray:
    """The light of an environment of 1 through a slab that a ray meets head on, (3,)."""
    slab = [
        wf.Rectangle((-50, -50, 0), (100, 0, 0), (0, 100, 0), material=material),
        wf.Rectangle((-50, -50, -thickness), (0, 100, 0), (100, 0, 0), material=material),
    ]
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=1e-3, size=(1, 1))
    return wf.render(wf.Scene(slab, [wf.Environment(1.0)], camera), 64, max_bounces=64, **options).rgb[0, 0]


@pytest.mark.parametrize("integrator", ["naive", "direct_simple", "direct_mis", "full"])
@pytest.mark.parametrize("thickness", [0.5, 2.0])
def test_light_falls_by_beer_and_lambert(thickness: float, integrator: str) -> None:
    """With an ior of 1 nothing is reflected and only the way counts."""
    seen = through(GLASS, thickness, integrator=integrator)
    assert seen == pytest.approx(np.exp(-ABSORPTION * thickness), rel=1e-4)


def test_clear_and_absorbing_glass_side_by_side() -> None:
    """Only the material that absorbs does; the clear one beside it lets all light pass."""
    spheres = [
        wf.Sphere((x, 0, 0), 1, material=filled(wf.Dielectric(1.0), a)) for x, a in ((-2, 0.0), (2, 0.7))
    ]
    for x, expected in ((-2.0, 1.0), (2.0, np.exp(-1.4))):
        aim = wf.Camera.look_at((x, 0, 5), (x, 0, 0), fov=1e-3, size=(1, 1))
        seen = wf.render(wf.Scene(spheres, [wf.Environment(1.0)], aim), 16).rgb
        assert seen == pytest.approx(expected, rel=1e-4)


def test_a_texture_cannot_absorb() -> None:
    with pytest.raises(
        wf.SceneError, match="Medium absorption must be a color, not a texture: it belongs to"
    ):
        wf.Medium(absorption=wf.Texture(np.ones((2, 2, 3), np.float32)))


@pytest.mark.parametrize(
    "bsdf",
    [
        wf.Mix(wf.Dielectric(1.0), wf.Diffuse(0.0), 0.0),
        wf.Mix(wf.Diffuse(0.0), wf.Mix(wf.Dielectric(1.0), wf.Mirror(), 0.0), 1.0),
        wf.Mix(wf.Dielectric(1.0), wf.Principled(1.0, 0.0, 0.0, 1.0, 1.0), 0.0),
    ],
    ids=["first", "within", "both clear"],
)
def test_the_interior_is_there_whatever_the_bsdf(bsdf: wf.Bsdf) -> None:
    """It belongs to the material, not to the parts of a mixture."""
    assert through(filled(bsdf, ABSORPTION), 0.5) == pytest.approx(np.exp(-ABSORPTION * 0.5), rel=1e-4)


def test_thin_sheets_may_enclose_a_medium() -> None:
    sheet = filled(wf.ThinDielectric(1.0), ABSORPTION)
    assert through(sheet, 0.5) == pytest.approx(np.exp(-ABSORPTION * 0.5), rel=0.02)


def test_a_scene_without_media_skips_the_stage() -> None:
    for material in (wf.Diffuse(), filled(wf.Dielectric(), 0.0)):
        scene = wf.Scene([wf.Sphere((0, 0, 0), 1, material=material)], [wf.Environment(1.0)])
        compiled = compile_scene(scene, lambda geometry: make_accelerator(geometry, "numpy"))
        assert compiled.program.find(Absorption) is None
