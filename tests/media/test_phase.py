"""Phase functions: samples against densities, known values, mistakes."""

import numpy as np
import pytest
from inside import deflected

import wavefront as wf

PHASES = [
    wf.Isotropic(),
    wf.HenyeyGreenstein(0.0),
    wf.HenyeyGreenstein(0.8),
    wf.HenyeyGreenstein(-0.5),
    wf.HenyeyGreenstein(0.99),
    wf.Rayleigh(),
    wf.PhaseMix(wf.HenyeyGreenstein(0.9), wf.Rayleigh(), 0.3),
    wf.PhaseMix(wf.HenyeyGreenstein(0.5), wf.PhaseMix(wf.Isotropic(), wf.HenyeyGreenstein(-0.5)), 0.6),
]


@pytest.mark.parametrize("phase", PHASES, ids=repr)
def test_samples_follow_the_density(phase: wf.PhaseFunction) -> None:
    wf.testing.check_phase(phase, samples=100_000)


@pytest.mark.parametrize("g", [-0.7, 0.0, 0.3, 0.95])
def test_the_mean_cosine_is_g(g: float) -> None:
    """Of samples at midpoints, and of the density."""
    phase = wf.HenyeyGreenstein(g)
    u = ((np.arange(1 << 16) + 0.5) / (1 << 16)).astype(np.float32)
    assert phase.mean_cosine == g
    assert phase.sample(u).mean(dtype=float) == pytest.approx(g, abs=2e-5)
    assert wf.PhaseFunction.mean_cosine.fget(phase) == pytest.approx(g, abs=2e-4)


def test_known_values() -> None:
    """Henyey and Greenstein 1941; Rayleigh 1871: twice as much forward and backward as to the side."""
    cos = np.float32([1, 0, -1])
    g = 0.5
    due = (1 - g * g) / (4 * np.pi) / np.array([(1 - g) ** 3, (1 + g * g) ** 1.5, (1 + g) ** 3])
    np.testing.assert_allclose(wf.HenyeyGreenstein(g).p(cos), due, rtol=1e-6)
    np.testing.assert_allclose(wf.Rayleigh().p(cos), 3 / (16 * np.pi) * np.array([2, 1, 2]), rtol=1e-6)
    np.testing.assert_allclose(wf.Isotropic().p(cos), 1 / (4 * np.pi), rtol=1e-6)


@pytest.mark.parametrize("phase", PHASES, ids=repr)
def test_the_ends_of_the_numbers_give_directions(phase: wf.PhaseFunction) -> None:
    u = np.float32([0, 2**-24, 0.3, 1 - 2**-24])
    w = deflected(phase.sample(u), u)
    assert np.linalg.norm(w.astype(float), axis=0) == pytest.approx(1, abs=1e-6)


def test_a_wrong_density_fails() -> None:
    class Wrong(wf.HenyeyGreenstein):
        def p(self, cos):
            return super().p(cos) * np.float32(1.02)

    with pytest.raises(AssertionError, match="integral of pdf"):
        wf.testing.check_phase(Wrong(0.5), samples=20_000)


def test_wrong_samples_fail() -> None:
    class Wrong(wf.HenyeyGreenstein):
        def sample(self, u):
            return wf.HenyeyGreenstein(self.g * 1.02).sample(u)

    with pytest.raises(AssertionError, match=r"chi-square|mean cosine"):
        wf.testing.check_phase(Wrong(0.8), samples=200_000)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: wf.HenyeyGreenstein(1.0), "HenyeyGreenstein g is 1.0; it must be in"),
        (lambda: wf.HenyeyGreenstein("x"), "HenyeyGreenstein g"),
        (lambda: wf.PhaseMix(wf.Isotropic(), 3), "PhaseMix second must be a phase function"),
        (lambda: wf.PhaseMix(wf.Isotropic(), wf.Rayleigh(), 2), "PhaseMix weight is 2; it must be in"),
    ],
)
def test_mistakes_are_named(make, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        make()
