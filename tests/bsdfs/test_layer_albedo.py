"""The layer albedo of glass and of `Principled`, in closed form: tints that differ, a part that transmits."""

import numpy as np
import pytest
from inside import albedo_of

import wavefront as wf

f4 = np.float32
COSINES = np.array([1.0, 0.8, 0.5, 0.2])
WO = np.stack([np.sqrt(1 - COSINES**2), 0 * COSINES, COSINES]).astype(f4)


def polarizations(ior: float) -> np.ndarray:
    """Reflectance (2, n) of each polarization, by Snell and Fresnel (E. Hecht, Optics, 4.34 and 4.40)."""
    inside = np.sqrt(1 - (1 - COSINES**2) / ior**2)
    s = (COSINES - ior * inside) / (COSINES + ior * inside)
    p = (ior * COSINES - inside) / (ior * COSINES + inside)
    return np.stack([s**2, p**2])


def fresnel(ior: float) -> np.ndarray:
    """Unpolarized reflectance of a face."""
    return polarizations(ior).mean(0)


def of_a_sheet(ior: float) -> np.ndarray:
    """Unpolarized reflectance of both faces."""
    faces = polarizations(ior)
    return (2 * faces / (1 + faces)).mean(0)


REFLECTED, THROUGH = np.array([[0.9], [0.3], [0.1]]), np.array([[0.2], [0.6], [1.0]])


@pytest.mark.parametrize("ior", [1.3, 1.5, 2.4])
@pytest.mark.parametrize("roughness", [0.0, 0.3])
def test_glass_reflects_and_lets_through_its_tints(ior: float, roughness: float) -> None:
    part = fresnel(ior)
    tints = {"reflectance": REFLECTED[:, 0], "transmittance": THROUGH[:, 0]}
    due = REFLECTED * part + THROUGH * (1 - part)
    np.testing.assert_allclose(albedo_of(wf.Dielectric(ior, roughness, **tints), WO), due, rtol=1e-5)
    sheet = of_a_sheet(ior)
    due = REFLECTED * sheet + THROUGH * (1 - sheet)
    np.testing.assert_allclose(albedo_of(wf.ThinDielectric(ior, roughness, **tints), WO), due, rtol=1e-5)


@pytest.mark.parametrize("thin", [False, True])
@pytest.mark.parametrize("ior", [1.3, 2.4])
def test_clear_parts_of_principled_are_glass(ior: float, thin: bool) -> None:
    """What is let through has the base color; metal and the opaque part have their own."""
    part = of_a_sheet(ior) if thin else fresnel(ior)
    color, options = THROUGH[:, 0], {"roughness": 0.2, "ior": ior}
    clear = THROUGH * (1 - part) + part
    found = albedo_of(wf.Principled(color, transmission=1.0, thin=thin, **options), WO)
    np.testing.assert_allclose(found, clear, rtol=1e-5)
    opaque = albedo_of(wf.Principled(color, **options), WO).astype(float)
    metal = albedo_of(wf.Principled(color, metallic=1.0, **options), WO).astype(float)
    found = albedo_of(wf.Principled(color, metallic=0.2, transmission=0.7, thin=thin, **options), WO)
    due = 0.2 * metal + 0.8 * (0.7 * clear + 0.3 * opaque)
    np.testing.assert_allclose(found, due, rtol=1e-5)


def test_the_layer_shows_it() -> None:
    glass = wf.Dielectric(1.5, reflectance=(0.9, 0.3, 0.1), transmittance=(0.2, 0.6, 1))
    pane = wf.Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0), material=glass)
    camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), fov=2, size=(4, 4))
    scene = wf.Scene([pane], [wf.Environment(1)], camera)
    image = wf.render(scene, 2, aovs="albedo", workers=1, accel="numpy", progress=False)
    due = 0.04 * REFLECTED[:, 0] + 0.96 * THROUGH[:, 0]
    np.testing.assert_allclose(image.layers["albedo"].mean((0, 1)), due, atol=1e-4)
