"""Clear materials whose shading normals differ from the geometric ones: no light is lost, none leaks."""

import numpy as np
import pytest
import trimesh
from inside import (
    bounce_sample,
    compile_scene,
    generate,
    interaction,
    intersect,
    make_accelerator,
    make_sampler,
    shading,
)
from scipy import stats
from significance import ALPHA, Mean, render

import wavefront as wf

CAMERA = wf.Camera.orthographic((0, 0.3, 5), (0, 0, 0), height=1.9, size=(24, 24))


def ball(subdivisions, material, lean=0.0, seed=0):
    """An icosphere with the normals of the sphere, turned by random vectors of length up to `lean`."""
    shape = trimesh.creation.icosphere(subdivisions=subdivisions)
    normals = shape.vertices / np.linalg.norm(shape.vertices, axis=1, keepdims=True)
    normals = normals + lean * np.random.default_rng(seed).uniform(-1, 1, normals.shape)
    return wf.Mesh(shape.vertices, shape.faces, normals=normals, material=material)


def furnace(shape, spp, **options):
    """The mean of a picture of a shape in even light of radiance 1; the pixels are independent."""
    scene = wf.Scene(shape, [wf.Environment(1.0)], CAMERA)
    rgb = render(scene, spp, **{"max_bounces": 200, **options}).rgb
    return Mean.of(rgb.mean(-1, dtype=float).ravel())


@pytest.mark.slow
@pytest.mark.parametrize("subdivisions", [2, 4], ids=["320", "5120"])
def test_a_ball_of_smooth_shaded_glass_loses_no_light(subdivisions):
    mean = furnace(ball(subdivisions, wf.Dielectric(1.5)), spp=64)
    assert mean.error < 1e-4
    assert mean.value == pytest.approx(1, abs=3e-4)


CLEAR = {
    "bubble": wf.Dielectric(1 / 1.33),
    "thin": wf.ThinDielectric(1.5),
    "principled": wf.Principled(1.0, roughness=0.0, transmission=1.0),
    "principled thin": wf.Principled(1.0, roughness=0.0, transmission=1.0, thin=True),
    "mix": wf.Mix(wf.Dielectric(1.5), wf.Mirror(1.0), 0.2),
}


@pytest.mark.parametrize("name", CLEAR)
@pytest.mark.parametrize("integrator", [pytest.param("naive", marks=pytest.mark.slow), "full"])
@pytest.mark.first(2)
def test_every_clear_material_keeps_its_light(name, integrator):
    mean = furnace(ball(2, CLEAR[name]), spp=32, integrator=integrator)
    assert mean.error < 2e-4
    assert mean.value == pytest.approx(1, abs=6e-4)


@pytest.mark.slow
def test_rough_glass_loses_no_more_than_on_a_sphere():
    glass = wf.Dielectric(1.5, 0.1)
    facets, sphere = furnace(ball(2, glass), spp=64), furnace(wf.Sphere((0, 0, 0), 1, material=glass), spp=64)
    assert facets.error + sphere.error < 6e-4
    assert facets.value == pytest.approx(sphere.value, abs=1e-3)


@pytest.mark.slow
def test_normal_mapped_glass_loses_no_light():
    lean = np.random.default_rng(1).uniform(-0.15, 0.15, (32, 32, 2))
    normal_map = wf.NormalMap(np.concatenate([0.5 + lean, np.ones((32, 32, 1))], 2))
    shape = wf.Sphere((0, 0, 0), 1, material=wf.Material(wf.Dielectric(1.5), normal_map=normal_map))
    mean = furnace(shape, spp=4, max_bounces=1000)
    assert mean.error < 3e-3
    assert mean.value == pytest.approx(1, abs=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.4, 0.0])
@pytest.mark.parametrize("kind", [wf.Dielectric, wf.ThinDielectric])
@pytest.mark.first(1)
def test_estimators_agree_on_tilted_clear_surfaces(kind, roughness):
    """Directions that are turned have no density: no light sample finds them, and none counts twice."""
    area_light = wf.Sphere((0, 3, 0), 1.0, material=wf.Diffuse(0.0), emission=4.0)
    scene = wf.Scene([ball(1, kind(1.5, roughness), lean=0.6), area_light], [wf.Environment(0.5)], CAMERA)
    options = {"max_bounces": 6}
    means = [
        np.array(
            [render(scene, 4, seed=k, integrator=name, **options).rgb.mean(dtype=float) for k in range(8)]
        )
        for name in ("naive", "full")
    ]
    for values in means:
        assert Mean.of(values).error < 0.01 * values.mean()
    assert stats.ttest_ind(*means, equal_var=False).pvalue > ALPHA


@pytest.mark.parametrize("lean", [0.0, 0.8])
@pytest.mark.parametrize("roughness", [0.0, 0.3])
@pytest.mark.parametrize("back_facing", [False, True])
def test_rays_start_on_the_side_that_their_lobe_leads_to(lean, roughness, back_facing):
    """Reflected ones on that of wo by the geometric normal, refracted ones beyond."""
    camera = wf.Camera.look_at(
        (0.2, 0.1, 0.3 if back_facing else 3), (1, 0, 0) if back_facing else (0, 0, 0), size=(64, 64)
    )
    scene = wf.Scene(ball(2, wf.Dielectric(1.5, roughness), lean), [wf.Environment(1.0)], camera)
    compiled = compile_scene(scene, lambda geometry: make_accelerator(geometry, "numpy"))
    sampler, pixel = make_sampler("sobol"), np.arange(64 * 64, dtype=np.uint32)
    paths = generate(compiled, camera, sampler, pixel, np.zeros_like(pixel))
    hits = intersect(compiled, paths)
    paths, hits = paths.take(hits.found), hits.take(hits.found)
    surface = interaction(compiled, paths, hits)
    assert surface.back_facing.all() == back_facing
    out = bounce_sample(paths, shading(compiled, surface), sampler, 0)
    crossed = out.roulette_scale != 1
    cos = (out.direction * surface.ng).sum(0)
    start = ((out.origin - surface.point) * surface.ng).sum(0)
    sampled = out.throughput[0] > 0
    assert sampled.mean() > (0.99 if roughness == 0 else 0.9)
    assert crossed[sampled].any()
    assert not crossed[sampled].all()
    assert np.array_equal((cos < 0)[sampled], crossed[sampled])
    assert np.array_equal((start < 0)[sampled], crossed[sampled])
    assert np.linalg.norm(out.direction, axis=0) == pytest.approx(1, abs=1e-5)


OPAQUE = {
    "diffuse": wf.Diffuse(1.0),
    "mirror": wf.Mirror(1.0),
    "metal": wf.Conductor.named("gold", 0.4),
    "oren": wf.OrenNayar(1.0, 0.5),
    "principled": wf.Principled(1.0, metallic=0.5, roughness=0.3, clearcoat=1.0, sheen=1.0),
    "mix": wf.Mix(wf.Diffuse(1.0), wf.Mirror(1.0), 0.5),
    "glass that lets nothing through": wf.Dielectric(1.5, transmittance=0.0),
    "rough glass that lets nothing through": wf.Dielectric(1.5, 0.5, transmittance=0.0),
    "sheet that lets nothing through": wf.ThinDielectric(1.5, 0.3, transmittance=0.0),
}


@pytest.mark.filterwarnings("ignore:the picture is black")
@pytest.mark.parametrize("lean", [pytest.param(0.5, marks=pytest.mark.slow), 2.0])
@pytest.mark.parametrize("name", OPAQUE)
def test_nothing_leaks_through_walls_with_strongly_tilted_normals(name, lean):
    """A light and a point light within a closed ball are not seen from outside."""
    area_light = wf.Sphere((0, 0, 0), 0.4, material=wf.Diffuse(0.0), emission=10.0)
    point = wf.PointLight((0.5, 0, 0.2), 10)
    for integrator, lights in (("naive", []), ("full", [point])):
        scene = wf.Scene([ball(2, OPAQUE[name], lean), area_light], lights, CAMERA)
        assert render(scene, 8, integrator=integrator).rgb.max() == 0


@pytest.mark.parametrize("lean", [0.0, 0.5])
def test_absorbing_glass_takes_all_that_gets_inside(lean):
    """Glass that is black inside shows what it reflects; a path astray would bring light through."""
    black = wf.Material(wf.Dielectric(1.5, reflectance=0.0), interior=wf.Medium(1e4))
    scene = wf.Scene(ball(2, black, lean), [wf.Environment(1.0)], CAMERA)
    center = render(scene, 16).rgb[6:18, 6:18]
    assert center.max() < 1e-3
