"""Lights by lumens and watts: what leaves them, by quadrature over a sphere, or over their surface."""

import numpy as np
import pytest

import wavefront as wf

SPHERE = 200, 400  # cells in height and azimuth


def flux(light: wf.Light, radius: float = 1e4) -> np.ndarray:
    """The irradiance on a far sphere around the origin, times its area, (3,) W."""
    rows, columns = SPHERE
    z = (np.arange(rows) + 0.5) / rows * 2 - 1
    z, phi = np.meshgrid(z, 2 * np.pi * (np.arange(columns) + 0.5) / columns)
    r = np.sqrt(1 - z * z)
    w = np.stack([r * np.cos(phi), z, r * np.sin(phi)]).reshape(3, -1)
    record = light.record(np.zeros(3))
    total = np.zeros(3)
    for k in range(len(record)):
        sample = record.take(np.array([k])).sample_li((radius * w).astype(np.float32), np.zeros_like(w[:2]))
        facing = -(sample.wi * w).sum(0)
        total += (sample.radiance * sample.pdf * facing).mean(1, dtype=float)
    return total * 4 * np.pi * radius**2


LIGHTS = {
    "point": wf.PointLight((0, 1, 0), (1, 0.5, 0.2)),
    "points": wf.PointLights([(0, 1, 0), (1, 0, 0)], [(1, 0.5, 0.2), (0, 3, 1)]),
    "spot": wf.SpotLight((0, 1, 0), (1, 0.5, 0.2), direction=(0, -1, 0), angle=100, blend=0.5),
    "step spot": wf.SpotLight((0, 0, 0), 3, direction=(0, 1, 0), angle=90, blend=0.6, falloff="smoothstep"),
    "linear spot": wf.SpotLight((0, 0, 0), 3, direction=(0, 1, 0), angle=150, blend=0.8, falloff="linear"),
}


@pytest.mark.parametrize("name", LIGHTS)
def test_flux_of_lights(name: str) -> None:
    light = LIGHTS[name]
    assert wf.to_photometric(flux(wf.with_flux(light, lumens=1200))) == pytest.approx(1200, rel=1e-3)
    assert wf.to_photometric(flux(wf.with_flux(light, 1200, efficacy=179)), efficacy=179) == pytest.approx(
        1200, rel=1e-3
    )
    bright = flux(wf.with_flux(light, watts=9))
    assert bright.mean() == pytest.approx(9, rel=1e-3)
    assert bright / bright[0] == pytest.approx(flux(light) / flux(light)[0], rel=1e-3)


SHAPES = {
    "rectangle": (wf.Rectangle((0, 0, 0), (2, 0, 0), (0, 0, 3), emission=(1, 2, 3)), 6),
    "both sides": (wf.Rectangle((0, 0, 0), (2, 0, 0), (0, 0, 3), emission=(1, 2, 3), two_sided=True), 12),
    "box": (wf.Box((0, 0, 0), (1, 2, 3), emission="moccasin"), 22),
    "sphere": (wf.Sphere((0, 0, 0), 0.5, emission=(1, 2, 3)), np.pi),
    "by material": (wf.Sphere((0, 0, 0), 0.5, material=wf.Material(wf.Diffuse(0), emission=2)), np.pi),
}


@pytest.mark.parametrize("name", SHAPES)
def test_flux_of_shapes(name: str) -> None:
    """π times the radiance and the area."""
    shape, area = SHAPES[name]
    before = np.array(shape.emission)
    found = wf.with_flux(shape, lumens=500)
    assert wf.to_photometric(found.emission[:, 0]) * np.pi * area == pytest.approx(500, rel=1e-5)
    assert found.emission / found.emission[1] == pytest.approx(before / before[1], rel=1e-5)
    assert (shape.emission == before).all()


BAD = {
    "neither": (LIGHTS["point"], {}, "needs lumens or watts, and not both"),
    "both": (LIGHTS["point"], {"lumens": 1, "watts": 1}, "and not both"),
    "negative": (LIGHTS["point"], {"lumens": -1}, "with_flux lumens is -1; it must be at least 0"),
    "dark": (wf.PointLight((0, 0, 0), 0), {"watts": 1}, "the PointLight is dark; give it a color"),
    "sun": (
        wf.DirectionalLight((0, -1, 0), 1),
        {"lumens": 1},
        "with_flux source must be a PointLight, .*, got Direct",
    ),
    "picture": (
        wf.SpotLight((0, 0, 0), 1, direction=(0, 1, 0), picture=np.ones((2, 2, 3))),
        {"lumens": 1},
        "SpotLight without a picture",
    ),
    "texture": (
        wf.Sphere((0, 0, 0), 1, emission=wf.Texture(np.ones((2, 2, 3)))),
        {"watts": 1},
        "even emission",
    ),
    "no light": (wf.Sphere((0, 0, 0), 1), {"watts": 1}, "even emission"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_arguments_are_named(name: str) -> None:
    source, arguments, message = BAD[name]
    with pytest.raises(wf.SceneError, match=message):
        wf.with_flux(source, **arguments)
