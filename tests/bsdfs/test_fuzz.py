"""The fuzz of OpenPBR beside random walks in the layer that it stands for."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from inside import OpenPBRBsdf, fuzz_albedo, fuzz_directions, fuzz_lobe
from numpy.polynomial.polynomial import polyval2d

from wavefront.testing import check_bsdf

F4 = np.float32
SCRIPT = Path(__file__).parents[2] / "benchmarks" / "fuzz_fit.py"
PLACES = [(0.1, 0.3), (0.5, 0.5), (0.9, 0.5), (0.3, 0.9), (0.9, 1.0)]  # cosines and roughnesses


# what fuzz_fit.py prints
ALBEDO = [
    [-0.19067, -0.18329, 0.0619, -0.0049256],
    [2.7316, -5.0921, 2.0205, -0.43794],
    [-10.274, 20.084, -12.175, 1.8027],
    [9.5629, -17.516, 9.5007, -1.2566],
]
SCALE = [[0.12737, 0.57026, 0.061271], [0.1972, 4.9787, -4.6225], [1.6904, -8.1379, 5.7874]]
SHIFT = [[-0.19575, -0.16407, 0.34935], [1.8147, -4.6342, 3.0325], [-2.4759, 8.0134, -6.0559]]


@pytest.fixture(scope="module")
def layer():
    spec = importlib.util.spec_from_file_location("fuzz_fit", SCRIPT)
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    return script


def toward(mu: float, n: int = 1, turn: float = 0.0) -> np.ndarray:
    r = np.sqrt(1 - mu * mu)
    return np.repeat(np.array([[r * np.cos(turn)], [r * np.sin(turn)], [mu]], F4), n, 1)


@pytest.mark.parametrize(("mu", "roughness"), PLACES)
def test_the_layer_scatters_so_much_back_and_so(layer, mu, roughness):
    """The albedo, and f·cosθ by the mean difference over directions, which two numbers cannot fit exactly."""
    rng = np.random.default_rng(0)
    albedo, value = layer.simulate(mu, roughness, rng, 16_384, 2048)
    assert fuzz_albedo(F4([mu]), F4([roughness])) == pytest.approx(albedo, abs=0.015)
    wi = layer.angles()
    ours = fuzz_lobe(toward(mu, wi.shape[1]), wi, F4([roughness]))[0] * wi[2]
    weight = np.sqrt(1 - wi[2] ** 2)  # of equal angles in solid angle
    assert (np.abs(ours - value) * weight).sum() < 0.2 * (value * weight).sum()


@pytest.mark.parametrize(("mu", "roughness"), [*PLACES, (0.02, 0.1), (0.1, 0.15), (0.3, 0.2)])
def test_the_lobe_is_that_of_the_fit(mu, roughness):
    near, r = mu / (mu + roughness), np.sqrt(1 - mu * mu)
    albedo = np.exp(polyval2d(mu, 1 / (roughness + 0.1), ALBEDO))
    a = polyval2d(near, roughness, SCALE) * roughness
    inverse = np.array([[a, 0, polyval2d(near, roughness, SHIFT) * r], [0, a, 0], [0, 0, 1]])
    wi = np.array([[0.6], [0.48], [0.64]])
    size = np.linalg.norm(inverse @ wi)
    cosine = wi[2] / size / np.pi
    value, density, seen = fuzz_lobe(toward(mu), wi.astype(F4), F4([roughness]))
    assert density == pytest.approx(cosine * np.linalg.det(inverse) / size**3, rel=1e-4)
    assert value == pytest.approx(albedo * density / wi[2], rel=1e-3)
    assert seen == pytest.approx(albedo, rel=1e-3)


@pytest.mark.parametrize("roughness", [0.0, 0.1, 0.4, 1.0])
def test_the_albedo_is_that_of_the_lobe_and_below_1(roughness):
    """By midpoints in the space of cosine-weighted directions, at any angle."""
    u = (np.indices((64, 64)).reshape(2, -1) + 0.5) / 64
    for mu in (0.0, 0.02, 0.3, 1.0):
        wo = toward(mu, u.shape[1], 0.7)
        wi = fuzz_directions(wo, u.astype(F4), F4([roughness]))
        value, density, albedo = fuzz_lobe(wo, wi, F4([roughness]))
        assert (wi[2] >= 0).all()
        assert (value * wi[2] / density).mean(dtype=float) == pytest.approx(albedo[0], rel=1e-4)
        assert 0 <= albedo[0] < 0.9


def test_light_comes_back_to_where_it_came_from():
    """More of it than goes on: the lobe is turned towards wo, about any azimuth."""
    for turn in (0.0, 2.0):
        wo = toward(0.3, 1, turn)
        back, on = (fuzz_lobe(wo, toward(0.3, 1, turn + by), F4([0.4]))[0] for by in (0, np.pi))
        assert back == pytest.approx(fuzz_lobe(toward(0.3), toward(0.3), F4([0.4]))[0], rel=1e-4)
        assert back > 1.2 * on


@pytest.mark.parametrize("roughness", [0.15, pytest.param(0.5, marks=pytest.mark.slow), 1.0])
@pytest.mark.first(1)
def test_contract(roughness):
    """It is not reciprocal, as in the paper."""
    fuzz = OpenPBRBsdf(base_color=0.0, specular_weight=0.0, fuzz_weight=1.0, fuzz_roughness=roughness)
    check_bsdf(fuzz, samples=40_000, angles=(10.0, 75.0), reciprocal=False)


def test_a_white_base_below_fuzz_loses_nothing():
    fuzzy = OpenPBRBsdf(base_color=1.0, specular_weight=0.0, fuzz_weight=0.8, fuzz_roughness=0.6)
    check_bsdf(fuzzy, samples=40_000, angles=(0.0, 60.0, 85.0), reciprocal=False, albedo=(1, 1))
