"""Colored glass: exp(−absorption · length) along the way through it."""

import numpy as np
import pytest

import wavefront as wf
from wavefront.accel import make_accelerator
from wavefront.compile.scene import compile_scene

ABSORPTION = np.array([0.2, 1.0, 3.0])


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
    seen = through(wf.Dielectric(1.0, absorption=ABSORPTION), thickness, integrator=integrator)
    assert seen == pytest.approx(np.exp(-ABSORPTION * thickness), rel=1e-4)


def test_clear_and_absorbing_glass_side_by_side() -> None:
    """Only the material that absorbs does; the clear one beside it lets all light pass."""
    spheres = [
        wf.Sphere((x, 0, 0), 1, material=wf.Dielectric(1.0, absorption=a)) for x, a in ((-2, 0.0), (2, 0.7))
    ]
    for x, expected in ((-2.0, 1.0), (2.0, np.exp(-1.4))):
        aim = wf.Camera.look_at((x, 0, 5), (x, 0, 0), fov=1e-3, size=(1, 1))
        seen = wf.render(wf.Scene(spheres, [wf.Environment(1.0)], aim), 16).rgb
        assert seen == pytest.approx(expected, rel=1e-4)


def test_a_texture_cannot_absorb() -> None:
    """The message says why."""
    material = wf.Dielectric(1.5, absorption=wf.Texture(np.ones((2, 2, 3), np.float32)))
    with pytest.raises(wf.SceneError, match="Dielectric absorption must be a color, not a texture"):
        wf.render(wf.Scene([wf.Sphere((0, 0, 0), 1, material=material)], [wf.Environment(1.0)]), 1)


GLASS = wf.Dielectric(1.0, absorption=ABSORPTION)
ALIKE = wf.Principled(1.0, roughness=0.0, ior=1.0, transmission=1.0, absorption=ABSORPTION)


@pytest.mark.parametrize(
    "mix",
    [
        wf.Mix(GLASS, wf.Diffuse(0.0), 0.0),
        wf.Mix(wf.Diffuse(0.0), GLASS, 1.0),
        wf.Mix(GLASS, ALIKE, 0.0),
        wf.Mix(wf.Diffuse(0.0), wf.Mix(GLASS, wf.Mirror(), 0.0), 1.0),
    ],
    ids=["first", "second", "both", "within"],
)
def test_a_mixture_absorbs_as_its_clear_part(mix: wf.Bsdf) -> None:
    """What lies inside is glass, however much of the surface is."""
    assert through(mix, 0.5) == pytest.approx(np.exp(-ABSORPTION * 0.5), rel=1e-4)


def test_a_mixture_of_opaque_materials_has_no_inside() -> None:
    """A scene of them skips the stage, as before."""
    mix = wf.Mix(wf.Diffuse(), wf.Principled(absorption=2.0))
    scene = wf.Scene([wf.Sphere((0, 0, 0), 1, material=mix)], [wf.Environment(1.0)])
    assert compile_scene(scene, lambda geometry: make_accelerator(geometry, "numpy")).absorption is None


def test_clear_parts_must_absorb_alike() -> None:
    """There is but one matter inside."""
    message = (
        r"Mix first has the absorption \[1.0, 2.0, 3.0\], second \[0.0, 0.0, 0.0\]; where both let light"
    )
    with pytest.raises(wf.SceneError, match=message):
        wf.Mix(wf.Dielectric(absorption=(1, 2, 3)), wf.Dielectric())


def test_there_is_nothing_behind_a_thin_sheet() -> None:
    """The second sheet is met from behind, and the air between the two does not absorb."""
    sheet = wf.Principled(1.0, roughness=0.0, ior=1.0, transmission=1.0, thin=True, absorption=ABSORPTION)
    assert through(sheet, 2.0) == pytest.approx(1, abs=0.01)  # roulette adds a little noise
