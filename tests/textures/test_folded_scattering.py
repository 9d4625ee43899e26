"""Scattering around tilted normals, folded at the surface: its density, its energy, and one mean."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from inside import (
    BsdfSample,
    Frame,
    MappedShading,
    _folded,
    _sample,
    _surface,
    broadcast,
    ensure_valid_reflection,
    group_materials,
    origin_above,
    weigh,
)
from significance import assert_same_images, repeat

import wavefront as wf

F4 = np.float32
WHITE = wf.Principled(1.0, metallic=1, roughness=0.3)


def leaning(degrees):
    """A map of normals that lean so far towards u."""
    angle = np.radians(degrees)
    code = np.array([0.5 + 0.5 * np.sin(angle), 0.5, 0.5 + 0.5 * np.cos(angle)], F4)
    return wf.NormalMap(code.reshape(1, 1, 3))


class Tilted(wf.Bsdf):
    """What the stages make of a BSDF whose normal is tilted, in the frame of the surface."""

    dimensions = 3

    def __init__(self, bsdf, degrees):
        self.inner, self.transmissive = bsdf, bsdf.transmissive
        self.normal = np.array([[np.sin(np.radians(degrees))], [0], [np.cos(np.radians(degrees))]], F4)

    def shading(self, wo):
        n = wo.shape[1]
        surface = replace(_surface(wo, np.zeros(n, bool)), wo=wo, folds=np.ones(n, bool))
        normals = np.repeat(self.normal, n, 1)
        surface.ns = ensure_valid_reflection(wo, surface.ng, surface.ng.copy(), normals)
        frame = Frame.from_normal(surface.ns)
        materials = group_materials([wf.Material(self.inner)])
        groups = [(slice(0, n), materials.groups[0].bind(surface))]
        at = frame.to_local(wo)
        return MappedShading(surface, frame, at, origin_above(surface), groups, materials=materials)

    def evaluate(self, wo, wi):
        shade = self.shading(wo)
        f, pdf = shade.evaluate(shade.frame.to_local(wi))
        cos, _ = shade.cosines(shade.frame.to_local(wi), wi)
        height = np.where(wi[2] == 0, F4(1), np.abs(wi[2]))
        return f * cos / height, np.where(cos > 0, pdf, F4(0))

    def f(self, wo, wi):
        return self.evaluate(wo, wi)[0]

    def pdf(self, wo, wi):
        return self.evaluate(wo, wi)[1]

    def sample_f(self, wo, u):
        shade = self.shading(wo)
        sample = _sample(shade, u)
        sample, direction = _folded(shade, sample, shade.frame.to_world(sample.wi))
        f, pdf = self.evaluate(wo, direction)
        weight = weigh(f, direction, pdf)
        drawn = (pdf > 0) & (sample.pdf > 0)
        # the directions are rounded by changes of frames; those that graze the surface lose digits
        assert np.allclose(sample.weight[:, drawn], weight[:, drawn], 2e-3, 1e-5)
        assert np.allclose(sample.pdf[drawn], pdf[drawn], 2e-3, 1e-5)
        weight, pdf = weight * drawn, pdf * drawn
        return BsdfSample(direction, weight, pdf, broadcast(np.False_, wo.shape[1]), sample.eta)


BSDFS = [
    (wf.Conductor((0.2, 1, 1.5), (3, 2, 2), roughness=0.5), (0, 1)),
    pytest.param(wf.Principled(1.0, metallic=1, roughness=0.6), (0.99, 1.01), marks=pytest.mark.slow),
    (wf.Diffuse(1.0), (0.999, 1.001)),
    pytest.param(wf.Dielectric(1.5, roughness=0.5), (0.9, 1.01), marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("bsdf", "albedo"), BSDFS, ids=["metal", "white", "matte", "glass"])
def test_the_density_is_that_of_the_directions(bsdf, albedo):
    wf.testing.check_bsdf(Tilted(bsdf, 40), samples=20_000, angles=(10, 70), reciprocal=False, albedo=albedo)


def patch(material, angle):
    """A square in even light, seen from an angle to its normal."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    square = wf.Mesh(corners, [[0, 1, 2], [0, 2, 3]], uvs=corners[:, :2], material=material)
    eye = (0.5 + 3 * np.sin(angle), 0.5, 3 * np.cos(angle))
    camera = wf.Camera.orthographic(eye, (0.5, 0.5, 0), height=0.5 * np.cos(angle), size=(16, 16))
    return wf.Scene(square, [wf.Environment(1.0)], camera)


@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.7])
@pytest.mark.parametrize("degrees", [30, 50])
@pytest.mark.parametrize("angle", [0.0, np.pi / 4])
def test_a_white_metal_loses_no_light(roughness, degrees, angle):
    white = wf.Principled(1.0, metallic=1, roughness=roughness)
    scene = patch(wf.Material(white, normal_map=leaning(degrees)), angle)
    image = wf.render(scene, 64, max_bounces=1, progress=False)
    assert image.rgb.mean() == pytest.approx(1, abs=0.008)


def test_a_map_that_does_not_fold_loses_what_lies_below():
    lean = leaning(45)
    lean.folds_light = False
    scene = patch(wf.Material(WHITE, normal_map=lean), 0.0)
    assert wf.render(scene, 64, max_bounces=1, progress=False).rgb.mean() == pytest.approx(0.55, abs=0.01)


WAVES = wf.NormalMap(
    np.stack(
        [
            0.5 + 0.45 * np.sin(np.arange(64) * 0.7)[:, None] * np.ones(64),
            0.5 + 0.45 * np.ones(64)[:, None] * np.sin(np.arange(64) * 0.5),
            np.full((64, 64), 0.75),
        ],
        -1,
    ).astype(F4)
)


def beside_a_wall(bsdf, *lights, emission=None):
    """A wavy floor, all of whose light comes from a low wall."""
    floor = wf.Rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4), material=wf.Material(bsdf, normal_map=WAVES))
    wall = wf.Rectangle((-2, 0, -2), (4, 0, 0), (0, 1.5, 0), material=wf.Diffuse(0.9), emission=emission)
    camera = wf.Camera.look_at((0, 3, 0.5), (0, 0, 0), up=(0, 0, -1), fov=40, size=(8, 8))
    return wf.Scene([floor, wall], [wf.Environment(0.2), *lights], camera)


WAYS = [
    {"integrator": "naive"},
    {"integrator": "direct_simple"},
    {"reuse": True},
    pytest.param({"guide": True}, marks=pytest.mark.slow),
]


@cache
def scene_and_pictures(bsdf, shines):
    """A scene whose wall shines, or that the sun lights, its bounces, and pictures by the usual way."""
    lights = [] if shines else [wf.DirectionalLight((0, 0, -1), 1)]
    scene, bounces = beside_a_wall(bsdf, *lights, emission=1.0 if shines else None), 1 if shines else 2
    return scene, bounces, repeat(scene, 64, runs=8, max_bounces=bounces, reuse=False, first_seed=100)


@pytest.mark.parametrize("options", WAYS, ids=str)
@pytest.mark.parametrize("bsdf", [wf.Diffuse(1.0), wf.Conductor.named("silver", roughness=0.5)])
@pytest.mark.first(2)
def test_every_way_finds_the_same_light(bsdf, options):
    scene, bounces, expected = scene_and_pictures(bsdf, "integrator" in options)
    spp = 256 if "integrator" in options else 64
    assert_same_images(repeat(scene, spp, runs=8, max_bounces=bounces, **options), expected, 0.02)
