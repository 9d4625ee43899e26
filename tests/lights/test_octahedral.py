"""Presets: light samples take means over texels of an octahedron; cameras and mirrors see the image."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from inside import LIGHTS_SIDE as SIDE
from inside import PRESETS, SHARP, OctahedralEnvironment, Receiver, _directions, _texels, f4
from scipy import stats
from significance import assert_same_images, repeat

import wavefront as wf

NORMALS = [(0, 1, 0), (0, -1, 0), (1, 0, 0), (-0.6, 0.48, 0.64), None]


@cache
def light_of(preset: str = "studio") -> OctahedralEnvironment:
    found = wf.studio(preset, up=(1, 2, 3))[0].record(np.zeros(3)).compensated()
    assert isinstance(found, OctahedralEnvironment)
    return found


def lit_for(normal: object) -> OctahedralEnvironment:
    up = (0, 1, 0) if normal is None else normal
    return light_of().lighting(Receiver(f4(up).reshape(3, 1), np.array([normal is not None])))


def without_texels(preset: str = "studio") -> wf.Environment:
    """The same light, whose image is looked up by all."""
    light = wf.studio(preset)[0]
    light._image = replace(light._image, in_texels=False)
    return light


def solid_angles() -> np.ndarray:
    return 4 / _directions(1)[1] ** 3 / SIDE**2


@pytest.mark.parametrize("normal", NORMALS)
def test_samples_have_the_density_that_is_told(normal: object) -> None:
    light, n = lit_for(normal), 200_000
    sample = light.sample_li(np.zeros((3, n), f4), np.random.default_rng(1).random((2, n), f4))
    texel, _ = _texels(sample.wi)
    assert np.array_equal(sample.radiance, light.means.take(texel, 1))
    assert np.allclose(np.sqrt((sample.wi**2).sum(0)), 1, atol=1e-6)
    assert np.allclose(light.pdf_li(np.zeros((3, n), f4), sample.wi), sample.pdf, rtol=1e-4)
    middle = light.pdf_li(np.zeros((3, SIDE**2), f4), _directions(1)[0].astype(f4))
    share = middle * solid_angles()
    assert abs(share.sum() - 1) < 1e-5
    block = np.arange(SIDE**2).reshape(SIDE, SIDE) // SIDE // 8 * 22 + np.arange(SIDE) // 8
    expected = np.bincount(block.ravel(), share, 22 * 22) * n
    counts = np.bincount(block.ravel()[texel], minlength=22 * 22)
    enough = expected > 10
    assert counts[expected == 0].sum() == 0
    chi2 = ((counts - expected)[enough] ** 2 / expected[enough]).sum()
    assert stats.chi2.sf(chi2, enough.sum() - 1) > 1e-4
    # places within texels are uniform, by solid angle: their mean is the middle of the light
    weight = sample.radiance.sum(0) / sample.pdf
    mean, error = (sample.wi * weight).mean(1), (sample.wi * weight).std(1) / np.sqrt(n)
    drawn = np.where(middle > 0, light.means.sum(0), 0) * solid_angles()
    assert (np.abs(mean - (_directions(1)[0] * drawn).sum(1)) < 4.5 * error + 1e-4).all()


@pytest.mark.parametrize("preset", PRESETS)
def test_means_bring_the_light_of_the_image(preset: str) -> None:
    light = light_of(preset)
    wi, length = _directions(3)  # other places than those that the means are of
    angle = 4 / length**3 / (3 * SIDE) ** 2
    radiance, texels = light.le(wi.astype(f4)), light.means.take(_texels(wi.astype(f4))[0], 1)
    for normal in NORMALS:
        cos = np.ones_like(length) if normal is None else np.maximum(np.asarray(normal) @ wi, 0)
        exact, found = ((each * (cos * angle)).sum(1) for each in (radiance, texels))
        assert np.allclose(found, exact, rtol=5e-4)  # the cosine varies over a texel, too


def test_cameras_mirrors_and_sharp_lobes_see_the_image() -> None:
    light = light_of()
    wi = _directions(1)[0].astype(f4)[:, ::7]
    assert np.array_equal(light.le_of_texels(wi, np.full(wi.shape[1], np.inf, f4)), light.le(wi))
    assert np.array_equal(light.le_of_texels(wi, np.full(wi.shape[1], SHARP)), light.le(wi))
    below = light.le_of_texels(wi, np.full(wi.shape[1], np.nextafter(SHARP, f4(0))))
    assert np.array_equal(below, light.means.take(_texels(wi)[0], 1))
    assert 0 < np.abs(below - light.le(wi)).max() < 0.5
    sphere = wf.Sphere((0, 0, 0), 1, material=wf.Mirror())
    pictures = [
        wf.render(
            wf.Scene([sphere], [each], wf.Camera.look_at((0, 0, 4), (0, 0, 0))),
            spp=4,
            size=(24, 24),
            workers=1,
            progress=False,
            accel="numpy",
        )
        for each in (*wf.studio(), without_texels())
    ]
    assert np.array_equal(pictures[0].rgb, pictures[1].rgb)


@pytest.mark.parametrize("lamp", [True, False])
@pytest.mark.first(1)
def test_surfaces_are_as_bright_as_by_the_image(lamp: bool) -> None:
    """Also beside another light, of which one is chosen."""
    shapes = [
        wf.Sphere((-1.1, 0, 0), 1, material=wf.Diffuse(0.8)),
        wf.Sphere((1.1, 0, 0), 1, material=wf.Conductor("gold", roughness=0.2)),
    ]
    if lamp:
        shapes.append(wf.Sphere((0, 2, 1), 0.2, emission=20))
    camera = wf.Camera.look_at((0, 0, 6), (0, 0, 0), size=(16, 8))
    runs = [
        repeat(wf.Scene(shapes, [each], camera), 48, 12, first_seed=first)
        for first, each in ((0, *wf.studio()), (100, without_texels()))
    ]
    assert_same_images(*runs, 0.008)
