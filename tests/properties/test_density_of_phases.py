"""The densities of phase functions, by differentiation at any u; integrals."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from jacobians import doubles, inner, jacobian, some

import wavefront as wf
from wavefront import media

lobe = st.floats(-0.95, 0.95)
PLAIN = st.one_of(st.builds(wf.HenyeyGreenstein, lobe), st.builds(wf.Rayleigh), st.builds(wf.Isotropic))
KINDS = {
    wf.Isotropic: st.builds(wf.Isotropic),
    wf.HenyeyGreenstein: st.builds(wf.HenyeyGreenstein, lobe),
    wf.Rayleigh: st.builds(wf.Rayleigh),
    wf.PhaseMix: st.builds(wf.PhaseMix, PLAIN, PLAIN, st.floats(0.05, 0.95)),
}
QUADRATURE = np.polynomial.legendre.leggauss(400)
kinds = pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)


def test_every_phase_function_is_here() -> None:
    own = {each for each in vars(media).values() if isinstance(each, type)}
    assert {each for each in own if issubclass(each, wf.PhaseFunction)} - {wf.PhaseFunction} == set(KINDS)


def density_of_cosines(phase: wf.PhaseFunction, cos: float) -> tuple[float, float]:
    """The density of a cosine from the maps that lead to it, and a bound on its error; each rises."""
    parts = [(0.0, 1.0)]
    if isinstance(phase, wf.PhaseMix):
        parts = [(0.0, phase.weight), (phase.weight, 1.0)]
    total, bound = 0.0, 0.0
    for low, high in parts:
        start, end = low, high
        for _ in range(60):
            middle = (start + end) / 2
            start, end = (start, middle) if phase.sample(np.array([middle]))[0] > cos else (middle, end)

        def of_part(t, low=low, high=high):
            return phase.sample(low + (high - low) * t[0])[None]

        at = (start - low) / (high - low)
        assume(1e-4 < at < 1 - 1e-4)  # there are no differences at the ends
        area, error = jacobian(of_part, (at,))
        total += (high - low) / area
        bound += (high - low) / area * error
    return total, bound


@kinds
@some
@given(data=st.data(), u=inner)
def test_density_of_directions(kind: type[wf.PhaseFunction], data: st.DataObject, u: float) -> None:
    """2π·p is the density of the cosine."""
    phase = data.draw(KINDS[kind])
    with doubles():
        cos = phase.sample(np.array([u]))
        density, bound = density_of_cosines(phase, float(cos[0]))
        assert abs(2 * np.pi * phase.p(cos)[0] - density) <= bound + 2e-5 * density
    single = phase.sample(np.float32([u]))
    assert single.dtype == phase.p(single).dtype == np.float32
    np.testing.assert_allclose(single, cos, atol=1e-4)  # float32 code computes the same


@kinds
@some
@given(data=st.data())
def test_densities_integrate_to_one(kind: type[wf.PhaseFunction], data: st.DataObject) -> None:
    phase = data.draw(KINDS[kind])
    cos, weight = QUADRATURE
    with doubles():
        assert 2 * np.pi * (weight * phase.p(cos)).sum() == pytest.approx(1, abs=1e-5)
        assert 2 * np.pi * (weight * cos * phase.p(cos)).sum() == pytest.approx(phase.mean_cosine, abs=1e-5)
