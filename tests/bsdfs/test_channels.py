"""Dispersion: a refractive index for each channel, of which a path follows one."""

import numpy as np
import pytest
from inside import Dielectric, Diffuse, Mix, SurfaceInteraction
from significance import assert_same_images, repeat

import wavefront as wf
from wavefront.testing import check_bsdf

F4 = np.float32
INDICES = (1.4, 1.5, 1.7)
SKY = np.random.default_rng(2).random((8, 16, 3)) ** 4 * 5


def surface(wo, inside=False, throughput=None):
    n = wo.shape[1]
    up, zero, lane = np.repeat(F4([[0], [0], [1]]), n, 1), np.zeros(n, F4), np.zeros(n, np.intp)
    at = SurfaceInteraction(up, zero, up, up, wo, lane, lane, np.full(n, inside))
    at.throughput = throughput
    return at


def directions(n, seed=0):
    v = np.random.default_rng(seed).normal(size=(3, n))
    v[2] = np.abs(v[2])
    return (v / np.linalg.norm(v, axis=0)).astype(F4)


def test_contract():
    """Smooth glass absorbs nothing; of rough glass the checker has no index for each channel."""
    check_bsdf(Dielectric(INDICES), samples=10_000, angles=(20.0, 75.0), reciprocal=False, albedo=(1, 1))
    check_bsdf(Dielectric(INDICES, 0.4), samples=10_000, angles=(60.0,), reciprocal=False, albedo=(0, 1.6))


@pytest.mark.parametrize("inside", [False, True])
def test_each_channel_is_glass_of_its_index(inside):
    """The values of rough glass, with a density that is the mean of theirs, in each channel."""
    wo, wi = directions(2000), directions(2000, 1)
    wi[2, ::2] *= -1
    f, pdf = Dielectric(INDICES, 0.5, transmittance=(1, 0.5, 0.2)).bind(surface(wo, inside)).evaluate(wo, wi)
    parts = [
        Dielectric(index, 0.5, multiscatter=False).bind(surface(wo, inside)).evaluate(wo, wi)
        for index in INDICES
    ]
    tint = np.where(wi[2] > 0, 1, np.reshape([1, 0.5, 0.2], (3, 1)))
    assert f == pytest.approx(
        np.stack([part[0][k] for k, part in enumerate(parts)]) * tint, rel=1e-5, abs=1e-7
    )
    assert pdf == pytest.approx(np.mean([part[1] for part in parts], 0), rel=1e-5)


@pytest.mark.parametrize("inside", [False, True])
@pytest.mark.parametrize("roughness", [0.0, 0.4])
def test_a_path_keeps_to_the_channel_that_it_follows(inside, roughness):
    """With light in one channel only, samples are those of glass of that index."""
    wo = directions(500)
    u = np.random.default_rng(3).random((3, 500), F4)
    for k, index in enumerate(INDICES):
        only = np.zeros((3, 500), F4)
        only[k] = 0.3
        ours = Dielectric(INDICES, roughness).bind(surface(wo, inside, only)).sample_f(wo, u)
        known = Dielectric(index, roughness, multiscatter=False).bind(surface(wo, inside)).sample_f(wo, u)
        assert ours.wi == pytest.approx(known.wi, abs=1e-5)
        assert ours.pdf == pytest.approx(known.pdf, rel=1e-3)
        assert ours.weight[k] == pytest.approx(known.weight[k], rel=1e-3)
        assert ours.eta == pytest.approx(known.eta)
    assert (
        not np.delete(Dielectric(INDICES).bind(surface(wo, inside, only)).sample_f(wo, u).weight, k, 0)[
            :, known.wi[2] < 0
        ].any()
        or roughness
    )


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.0, pytest.param(0.5, marks=pytest.mark.slow)])
def test_pictures_are_those_of_the_indices_one_by_one(roughness):
    """Unbiased: a ball of dispersive glass, also in a mix, against three balls."""

    def scene(ior):
        bsdf = Mix(Dielectric(ior, roughness, multiscatter=False), Diffuse(0.5), 0.2)
        ball, floor = wf.Sphere((0, 0, 0), 1, material=bsdf), wf.Rectangle((-2, -1, 2), (4, 0, 0), (0, 0, -4))
        camera = wf.Camera.look_at((0, 1, 4), (0, 0, 0), fov=35, size=(16, 16))
        return wf.Scene([ball, floor], [wf.Environment(SKY)], camera)

    ours = repeat(scene(INDICES), 16, 12)
    for k, index in enumerate(INDICES):
        known = repeat(scene(index), 16, 12, first_seed=100)
        assert_same_images(ours[..., k : k + 1], known[..., k : k + 1], 0.02)


def test_bad_indices_are_named():
    with pytest.raises(wf.SceneError, match=r"Dielectric ior\[1\] is 0\.?0?; it must be more than 0"):
        Dielectric((1.5, 0, 1.5))
