"""What `trace` shows is the loop of `render`, and a path's table has all that makes its light."""

import threading
from itertools import pairwise

import numpy as np
import pytest

import wavefront as wf

FLOOR = wf.Rectangle((-4, -1, 4), (8, 0, 0), (0, 0, -8), material=wf.Diffuse(0.6))
PANEL = wf.Rectangle((-1, 3, -1), (2, 0, 0), (0, 0, 2), emission=(9, 8, 6))
BALL = wf.Sphere((0, 0, 0), 1, name="ball")
INK = wf.Material(wf.Dielectric(1.5), interior=wf.Medium(absorption=(0.2, 0.9, 2)))


class Half(wf.Bsdf):
    def f(self, wo, wi):
        return np.where(wi[2] > 0, np.float32(0.5 / np.pi), np.float32(0)) * np.ones_like(wi)


def trees():
    mesh = wf.Mesh(np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    return [wf.Instance(mesh, np.eye(4) + np.diag([0.2, 0, 0, 0])), wf.Instance(mesh, np.diag([1, -1, 1, 1]))]


SCENES = {
    "sky": wf.Scene([BALL], [wf.Environment(1)]),
    "ink": wf.Scene([wf.Sphere((9, 5, 7), 1, material=INK), FLOOR, PANEL]),
    "alpha": wf.Scene([wf.Sphere((0, 0, 0), 1, material=wf.Material(Half(), alpha=0.4)), FLOOR, PANEL]),
    "fog": wf.Scene([BALL, FLOOR, PANEL], medium=wf.Medium(absorption=0.1, scattering=0.1)),
    "instances": wf.Scene([*trees(), FLOOR, PANEL]),
    "far and small": wf.Scene(
        [wf.Sphere((1e-9, 0, 0), 1e-9), wf.Sphere((1e-9, 3e-9, 0), 1e-9, emission=3)],
        [wf.PointLight((0, 4e-9, 4e-9), 1e-16)],
    ),
}
RENDER = {"spp": 1, "branches": 1, "reuse": False, "progress": False}


@pytest.mark.parametrize("integrator", ["naive", "direct_simple", "direct_mis", "full"])
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.filterwarnings("ignore:the naive integrator")
def test_the_last_step_is_the_picture(name, integrator):
    steps = list(wf.trace(SCENES[name], (12, 12), seed=3, integrator=integrator))
    image = wf.render(SCENES[name], size=(12, 12), seed=3, integrator=integrator, **RENDER)
    assert steps[0].stage == "generate"
    assert steps[-1].stage == "end"
    np.testing.assert_array_equal(steps[-1].light.T.reshape(12, 12, 3), image.rgb)


@pytest.mark.parametrize("integrator", ["naive", "direct_simple", "direct_mis", "full"])
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.filterwarnings("ignore:the naive integrator")
def test_the_factors_of_a_path_give_its_light(name, integrator):
    trace = wf.trace(SCENES[name], (12, 12), integrator=integrator)
    image = wf.render(SCENES[name], size=(12, 12), integrator=integrator, **RENDER)
    for pixel in ((5, 6), (6, 9), (2, 10), (11, 0)):
        path = trace.path(pixel)
        np.testing.assert_array_equal(path.radiance, image.rgb[pixel[1], pixel[0]])
        total = sum((vertex.light for vertex in path), np.zeros(3))
        np.testing.assert_allclose(
            total, path.radiance, rtol=1e-6, atol=1e-7 * max(1e-12, path.radiance.max())
        )


def test_a_vertex_has_the_factors_of_its_direction():
    """f·cos/pdf is the factor, and throughputs follow from factors and roulette."""
    trace = wf.trace(SCENES["alpha"], (12, 12))
    paths = [trace.path((x, y)) for y in range(5, 9) for x in range(12)]
    pairs = [pair for path in paths for pair in pairwise(path)]
    assert len(pairs) > 15
    for vertex, following in pairs:
        np.testing.assert_allclose(vertex.f * vertex.cos / vertex.pdf, vertex.factor, rtol=1e-5)
        np.testing.assert_allclose(
            vertex.throughput * vertex.factor / vertex.survival, following.throughput, rtol=1e-5
        )
        np.testing.assert_allclose(-following.wo, vertex.wi, atol=1e-6)
        if following.point is None:
            continue
        away = following.point - vertex.point
        np.testing.assert_allclose(away / np.linalg.norm(away), vertex.wi, atol=1e-4)


def test_a_light_sample_has_its_weight():
    """The weights of both densities add up to 1, by the power heuristic (Veach 1997, eq. 9.13)."""
    floor = wf.trace(wf.Scene([FLOOR, PANEL]), (12, 12)).path((6, 7))[0].sampled
    squares = floor.pdf_light**2, floor.pdf_bsdf**2
    assert floor.weight == pytest.approx(squares[0] / sum(squares), rel=1e-5)
    np.testing.assert_allclose(floor.radiance, (9, 8, 6), rtol=1e-5)
    np.testing.assert_allclose(floor.f, 0.6 / np.pi, rtol=1e-6)


def test_steps_are_in_the_coordinates_of_the_scene():
    scene = wf.Scene([wf.Sphere((100, 200, 300), 2)], [wf.Environment(1)])
    steps = {(step.stage, step.bounce): step for step in wf.trace(scene, (8, 8))}
    surface, paths = steps["shade", 0].surface, steps["bounce-sample", 0].paths
    away = surface.point - np.array([[100], [200], [300]], np.float32)
    np.testing.assert_allclose(np.sqrt((away**2).sum(0)), 2, rtol=1e-4)
    np.testing.assert_allclose(paths.origin, surface.point, atol=1e-2)
    hit = steps["intersect", 0]
    ends = hit.paths.origin + hit.paths.direction * hit.hits.t
    met = hit.hits.found
    np.testing.assert_allclose(ends[:, met], surface.point, atol=1e-2)


def test_steps_are_read_only_and_keep_their_light():
    steps = list(wf.trace(SCENES["ink"], (8, 8)))
    for step in steps:
        for array in (step.light, step.paths.throughput, step.paths.pixel):
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0
    assert not steps[0].light.any()
    assert all((after.light >= before.light).all() for before, after in pairwise(steps))
    assert steps[-1].light.any()


def test_features_are_steps_and_a_lane_is_found_by_its_pixel():
    stages = [step.stage for step in wf.trace(SCENES["alpha"], (8, 8))]
    assert stages[:4] == ["generate", "intersect", "Passing", "compact"]
    steps = list(wf.trace(SCENES["sky"], (8, 8), pixels=[(4, 4), (0, 0), (3, 5)]))
    assert steps[0].paths.pixel.tolist() == [36, 0, 43]
    assert next(step.paths.pixel.tolist() for step in steps if step.stage == "compact") == [36, 43]


def test_a_trace_that_is_left_ends_its_thread():
    before = threading.active_count()
    steps = wf.trace(SCENES["fog"], (8, 8))
    next(steps)
    assert threading.active_count() == before + 1
    steps.close()
    assert threading.active_count() == before
    assert list(steps) == []


def test_errors_of_the_loop_reach_the_caller():
    class Broken(wf.Bsdf):
        def f(self, wo, wi):
            raise RuntimeError("no value here")

    with pytest.raises(RuntimeError, match="no value here"):
        list(wf.trace(wf.Scene([wf.Sphere((0, 0, 0), 1, material=Broken())], [wf.Environment(1)]), (8, 8)))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"pixels": [(8, 0)]}, r"pixel \(8, 0\) is outside of the picture of 8x8"),
        ({"pixels": 3}, "pixels must be pairs"),
        ({"pixels": [(0.5, 1.0)]}, "pixels must be pairs"),
        ({"sample": -1}, "sample is -1"),
        ({"sample": 0.5}, "sample is 0.5"),
        ({"max_bounces": -1}, "max_bounces"),
    ],
)
def test_wrong_arguments(given, message):
    with pytest.raises(wf.SceneError, match=message):
        wf.trace(SCENES["sky"], (8, 8), **given)


def test_samples_are_those_of_a_longer_render():
    lights = [list(wf.trace(SCENES["sky"], (8, 8), sample=k))[-1].light for k in range(4)]
    image = wf.render(SCENES["sky"], size=(8, 8), **{**RENDER, "spp": 4})
    np.testing.assert_allclose(np.mean(lights, 0).T.reshape(8, 8, 3), image.rgb, rtol=1e-6)


def test_tables_show_fields_and_vertices():
    steps = list(wf.trace(SCENES["sky"], (8, 8)))
    text = repr(steps[3].surface)
    assert text.startswith("SurfaceInteraction: ")
    assert "point" in text
    assert "scene units" in text
    assert "<pre>Paths: " in steps[3]._repr_html_()
    assert repr(steps[0]) == "<Step 'generate', bounce 0: 64 paths>"
    path = wf.trace(SCENES["sky"], (8, 8)).path((4, 4))
    assert "ball" in repr(path)
    assert "Diffuse" in path._repr_html_()


def test_a_path_is_drawn_in_its_scene():
    scene = wf.Scene([FLOOR, PANEL, BALL])
    path = wf.trace(scene, (12, 12)).path((6, 7))
    shapes = path.shapes(0.02)
    assert [shape.name for shape in shapes] == ["path", "light samples"]
    aside = wf.Camera.look_at((7, 4, 7), (0, 0, 0), fov=60, size=(64, 64))
    image = wf.render(wf.Scene([*scene.shapes, *shapes]), 4, camera=aside, aovs="shape_id", progress=False)
    assert {3, 4} <= set(np.unique(image.shape_id).tolist())


def caustic():
    lamp = wf.Sphere((0, 3, 0), 0.1, emission=1000)
    glass = wf.Sphere((0, 1, 0), 1, material=wf.Dielectric(1.5))
    floor = wf.Rectangle((-4, 0, 4), (8, 0, 0), (0, 0, -8), material=wf.Diffuse(0.5), name="floor")
    return wf.Scene([lamp, glass, floor], camera=wf.Camera.look_at((0, 4, 6), (0, 0, 0), size=(16, 16)))


def test_a_firefly_of_a_caustic_is_explained():
    image = wf.render(caustic(), **{**RENDER, "spp": 64})
    y, x = np.unravel_index(image.rgb[8:, :, 0].argmax(), (8, 16))
    pixel = int(x), int(y) + 8
    first, second = wf.explain(caustic(), image, pixel, most=2)
    assert first[0].shape == "floor"
    assert sum(vertex.material == "Dielectric" for vertex in first) == 2
    assert first.radiance[0] >= second.radiance[0]
    assert first.radiance[0] > 0.5 * 64 * image.rgb[pixel[1], pixel[0], 0]


def test_what_explain_cannot_tell():
    branched = wf.render(SCENES["sky"], spp=4, size=(8, 8), branches=2, progress=False)
    clamped = wf.render(SCENES["sky"], spp=4, size=(8, 8), branches=1, reuse=False, clamp=2.0, progress=False)
    with pytest.raises(wf.SceneError, match=r"clamp=2\.0"):
        wf.explain(SCENES["sky"], clamped, (4, 4))
    with pytest.raises(wf.SceneError, match="branches=2"):
        wf.explain(SCENES["sky"], branched, (4, 4))
    image = wf.render(SCENES["sky"], size=(8, 8), **RENDER)
    with pytest.raises(wf.SceneError, match="it is not of this scene"):
        wf.explain(SCENES["ink"], image, (4, 4))
    with pytest.raises(wf.SceneError, match="outside of the picture"):
        wf.explain(SCENES["sky"], image, (9, 4))
