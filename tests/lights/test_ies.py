"""Luminaires: their contract, flux, place in a scene, and what a floor gets of them."""

import pickle
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from inside import IESLights, compile_scene, f4, make_accelerator
from luminaires import GAMMA, intensity, lm63, write
from scenes import ALBEDO, EYE, floor, probe
from significance import measure, render

import wavefront as wf
from wavefront import testing

ORIGIN = np.zeros(3)


def sphere(rows: int, columns: int) -> np.ndarray:
    """Directions (3, n), each for the same part of the sphere."""
    z = (np.arange(rows) + 0.5) / rows * 2 - 1
    z, phi = np.meshgrid(z, 2 * np.pi * (np.arange(columns) + 0.5) / columns)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(phi), z, r * np.sin(phi)]).reshape(3, -1).astype(f4)


def arriving(light: wf.Light, points) -> np.ndarray:
    """I/d² (3, n) at points (3, n)."""
    sample = light.record(ORIGIN).sample_li(points.astype(f4), np.zeros((2, points.shape[1]), f4))
    return sample.radiance.astype(float) * sample.pdf


@pytest.mark.parametrize("symmetry", ["axis", "90-270", "none"])
def test_flux_through_a_sphere(tmp_path: Path, symmetry: str) -> None:
    """The lumens of the light are those that reach a sphere around it, within 0.1 %."""
    path, w = write(tmp_path, symmetry), sphere(400, 200)
    axes = {"direction": (1, -2, 3), "c0": (0, 0.2, 1)}
    for options in ({}, {"lumens": 800}, {"dimming": 0.3, "color": "moccasin"}, {"efficacy": 179}):
        light = wf.IESLight(path, (0, 0, 0), **axes, **options)
        seen = wf.to_photometric(arriving(light, w).T, efficacy=options.get("efficacy", 683))
        assert seen.mean() * 4 * np.pi == pytest.approx(light.lumens, rel=1e-3)
        watts = arriving(light, w).mean() * 4 * np.pi
        assert light.record(ORIGIN).power(1.0) == pytest.approx([watts], rel=1e-3)
    assert wf.IESLight(path, (0, 0, 0), lumens=800).lumens == pytest.approx(800)
    assert wf.with_flux(wf.IESLight(path, (0, 0, 0)), lumens=70).lumens == pytest.approx(70)
    full = wf.IESLight(path, (0, 0, 0)).lumens
    assert wf.IESLight(path, (0, 0, 0), dimming=0.3, color="moccasin").lumens == pytest.approx(0.3 * full)


@pytest.mark.slow
def test_flux_that_is_measured_on_a_sphere(tmp_path: Path) -> None:
    """All lumens of sources of several kinds arrive at a sphere around them, within 0.1 %."""
    around = wf.Sphere((0, 0, 0), 1, material=wf.Diffuse(0))
    sources = [
        wf.IESLight(write(tmp_path), (0.1, 0, 0.05), lumens=800, direction=(1, 1, 0)),
        wf.with_flux(wf.PointLight((0.1, 0.05, 0), "moccasin"), lumens=800),
        wf.with_flux(wf.SpotLight((0, 0, 0), 1, direction=(1, 2, 3), angle=120), lumens=800),
        wf.with_flux(wf.Sphere((0.1, 0, 0), 0.2, emission=1, material=wf.Diffuse(0)), lumens=800),
    ]
    for source in sources:
        found = wf.measure_flux(
            [around, source], around, side="back", spp=1 << 18, max_bounces=0, progress=False
        )
        error = float(wf.to_photometric(found.standard_error)[0])
        seen = float(wf.to_photometric(found.value)[0])
        assert error < 0.5, source
        assert seen == pytest.approx(800, abs=4 * error + 800e-5), source  # and float32
        assert seen == pytest.approx(800, rel=1e-3), source


def test_flux_of_a_cosine(tmp_path: Path) -> None:
    """I₀·cosγ in fine steps is π·I₀ lumens."""
    gamma = np.arange(0, 90.5, 0.5)
    path = tmp_path / "lambert.ies"
    path.write_text(lm63(gamma, [0], [100 * np.maximum(np.cos(np.radians(gamma)), 0)]))
    assert wf.IESLight(path, (0, 0, 0)).lumens == pytest.approx(100 * np.pi, rel=2e-5)


def test_it_is_turned(tmp_path: Path) -> None:
    """γ = 0 along the direction, C = 0 along c0, C = 90° counterclockwise seen from behind."""
    path, (x, y, z) = write(tmp_path), np.linalg.qr([[3.0, 1, 2], [-1, 4, 1], [1, -2, 5]])[0].T
    z = np.cross(x, y)  # up of the luminaire
    light = wf.IESLight(path, (1, 2, 3), target=np.array([1, 2, 3]) - 2 * z, c0=x + 0.5 * z, color=(0, 1, 0))
    for c, gamma in ((0, 60), (75, 20), (200, 130), (310, 80)):
        a, b = np.radians([c, gamma])
        w = np.sin(b) * (np.cos(a) * x + np.sin(a) * y) - np.cos(b) * z
        seen = arriving(light, (light.position + 2 * w)[:, None])[:, 0] * 4 * 683 * 0.7152
        assert seen == pytest.approx([0, intensity("none", c, gamma), 0], rel=1e-3)
    for direction in ((0, -1, 0), (1, 0, 0)):  # c0 along the direction: any that is perpendicular
        assert np.isfinite(arriving(wf.IESLight(path, (0, 0, 0), direction=direction), np.eye(3))).all()


@pytest.mark.parametrize("integrator", ["direct_simple", "direct_mis", "full"])
@pytest.mark.parametrize("offset", [0.3, 0.9])
def test_floor(tmp_path: Path, integrator: str, offset: float) -> None:
    """I·h/d³ lux, on a floor of known albedo."""
    light = wf.IESLight(write(tmp_path), (0, 2, 0), color=1)
    scene = wf.Scene([floor()], [light], probe((offset, 0, 0), np.add((offset, 0, 0), EYE)))
    lux = intensity("none", 0, np.degrees(np.arctan2(offset, 2))) * 2 / np.hypot(2, offset) ** 3
    seen = measure(scene, 4, integrator=integrator, max_bounces=1).value
    assert 683 * seen == pytest.approx(lux * ALBEDO / np.pi, rel=1e-3)


def test_sampling_keeps_the_contract(tmp_path: Path) -> None:
    testing.check_light(wf.IESLight(write(tmp_path), (0.1, 5, 0.2), target=(0, 0, 0)), samples=1000)
    path = tmp_path / "half.ies"
    path.write_text(lm63([0, 90], [0, 90], [[5, 2], [5, 3]], 2))
    testing.check_light(wf.IESLight(path, (0.1, 5, 0.2)), samples=1000)


def test_no_place_is_thought_darker_than_it_is(tmp_path: Path) -> None:
    light, rng = wf.IESLight(write(tmp_path), (0, 0, 0), direction=(1, -1, 0.3)), np.random.default_rng(2)
    record = light.record(ORIGIN)
    for _ in range(100):
        center, radius = rng.normal(size=(3, 1)), rng.uniform(0.01, 0.8)
        if np.linalg.norm(center) < radius:
            continue
        inside = rng.normal(size=(3, 200))
        inside *= radius * rng.random(200) ** (1 / 3) / np.linalg.norm(inside, axis=0)
        points = center + inside
        seen = arriving(light, points).mean(0) * (points**2).sum(0)
        bound = record.irradiance(center, radius, 9.0)[0, 0] * max(float((center**2).sum()), radius**2)
        assert bound >= seen.max() * (1 - 1e-4)
    even, place = wf.IESLight(write(tmp_path, "axis"), (0, 0, 0)), np.array([[1.0], [-1], [0.3]])
    near = even.record(ORIGIN).irradiance(place, 1e-4, 9.0)[0, 0]
    assert near == pytest.approx(arriving(even, place).mean(), rel=0.02)


def test_luminaires_of_one_file_are_sampled_together(tmp_path: Path) -> None:
    path, other = write(tmp_path), write(tmp_path, "axis")
    lights = [wf.IESLight(path, (k, 2, 0), dimming=1 + k, group=str(k)) for k in range(3)]
    scene = wf.Scene([floor()], [*lights, wf.IESLight(other, (0, 1, 0))], probe((0.2, 0, 0), EYE))
    kinds = compile_scene(scene, partial(make_accelerator, accel="numpy")).lights.kinds
    assert [len(kind) for kind in kinds if isinstance(kind, IESLights)] == [3, 1]
    image = render(scene, 256, aovs="light_groups", integrator="direct_mis", max_bounces=1)
    for k, light in enumerate(lights):
        alone = wf.Scene([floor()], [light], scene.camera)
        expected = measure(alone, 4, integrator="direct_mis", max_bounces=1).value
        layer = image.light_groups[str(k)]
        error = image.errors[f"light_groups.{k}"]
        assert abs(layer.mean() - expected) < 5 * np.sqrt(
            (error.astype(float) ** 2).mean() / error[..., 0].size
        )


def test_it_is_sent_to_workers_and_scaled(tmp_path: Path) -> None:
    light = wf.IESLight(write(tmp_path), (0, 2, 0), tilt=3)
    again = pickle.loads(pickle.dumps(light))
    points = sphere(20, 20)
    assert (arriving(again, points) == arriving(light, points)).all()
    assert arriving(light.scaled(1024), 1024 * points) == pytest.approx(arriving(light, points), rel=1e-6)
    assert light.bounds.tolist() == [[0, 2, 0], [0, 2, 0]]
    assert repr(light).startswith("IESLight(file=")


def test_caustics_of_a_mirror(tmp_path: Path) -> None:
    """Light that a mirror sends past a shade: as bright as that of the luminaire behind the mirror."""
    path = write(tmp_path, "axis")
    ceiling = wf.Rectangle((-9, 3, -9), (18, 0, 0), (0, 0, 18))
    shade = wf.Rectangle((-0.4, 2, -0.4), (0.8, 0, 0), (0, 0, 0.8), material=wf.Diffuse(0))
    mirror = wf.Rectangle((-0.1, 0, -0.2), (0, 0, 0.5), (0.6, 0, 0), material=wf.Mirror(1.0))
    camera = wf.Camera.look_at((1.5, 0.5, 0.4), (0.7, 3, 0.2), fov=12, size=(8, 8))
    scene = wf.Scene([ceiling, shade, mirror], [wf.IESLight(path, (0, 1.5, 0))], camera)
    behind = wf.Scene([ceiling, shade], [wf.IESLight(path, (0, -1.5, 0), direction=(0, 1, 0))], camera)
    seen = render(scene, 400, caustics=True, max_bounces=2).mean()
    expected = render(behind, 16, integrator="direct_mis", max_bounces=1).mean()
    assert not render(scene, 4, max_bounces=2).rgb.any()
    error = np.hypot(seen.standard_error, expected.standard_error)
    assert (error < 0.05 * expected.value).all()
    assert (np.abs(seen.value - expected.value) < 4 * error).all()


PLAIN = lm63(GAMMA, [0], [np.ones(7)])
BAD = {
    "dimming": ({"dimming": -1}, "IESLight dimming is -1; it must be at least 0"),
    "lumens": ({"lumens": -1}, "IESLight lumens is -1; it must be at least 0"),
    "tilt": ({"tilt": 181}, "IESLight tilt is 181; it must be from 0 to 180 degrees"),
    "color": ({"color": "nocolor"}, "photometric color is 'nocolor'"),
    "c0": ({"c0": (0, 0, 0)}, "IESLight c0 is .* must not be zero"),
    "both": ({"target": (0, 0, 0), "direction": (0, -1, 0)}, "a target or a direction, and not both"),
    "file": ({"file": 3}, "path is 3; it must be text"),
    "missing": ({"file": "none.ies"}, "none.ies: there is no such file"),
    "large": ({"dimming": 1e42}, "W/sr; it must be at most 3.4"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_arguments_are_named(tmp_path: Path, name: str) -> None:
    change, message = BAD[name]
    path = tmp_path / "plain.ies"
    path.write_text(PLAIN)
    with pytest.raises(wf.SceneError, match=message):
        wf.IESLight(**{"file": path, "position": (0, 1, 0), **change})
    path.write_text(lm63(GAMMA, [0], [np.zeros(7)]))
    with pytest.raises(wf.SceneError, match=r"plain\.ies: is dark"):
        wf.IESLight(path, (0, 0, 0), lumens=3)
