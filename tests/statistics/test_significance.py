"""p-values of comparisons: false alarms are as rare as they say, and differences are found."""

import numpy as np
import pytest
from inside import (
    Film,
    PictureSums,
    _around,
    _estimate,
    _p_of_mean,
    film_image,
    log_gamma,
    shared_samples,
    sidak,
    t_tail,
)
from scipy import special, stats
from significance import render

import wavefront as wf

SIZE = 16


def noisy(rng, draw, spp=16, size=SIZE):
    """A picture of which each sample is drawn by draw(rng, (3, spp, pixels))."""
    film = Film(size, size)
    film.add(np.arange(size * size, dtype=np.uint32), draw(rng, (3, spp, size * size)).astype(np.float32))
    return film_image(PictureSums(film, None, {}), {}, keep_sums=False)


def gaussian(rng, shape):
    return rng.normal(3, 1, shape)


def heavy(rng, shape):
    """Log-normal samples: their kurtosis is above 100."""
    return rng.lognormal(0, 1.2, shape)


def fireflies(rng, shape):
    """One sample of a hundred is a hundred times as bright."""
    return np.where(rng.random(shape) < 0.01, 100, 1) * rng.uniform(0.9, 1.1, shape)


def edges(rng, shape):
    """Black or white, as where the edge of a light crosses pixels."""
    return rng.random(shape) < np.linspace(0, 1, shape[2])


def flashes(rng, shape):
    """Bright in a tenth of the samples, which sixteen samples often miss; else almost without noise."""
    return rng.uniform(0.99, 1.01, shape) + 10 * (rng.random(shape) < 0.1)


def most(runs, chance):
    """The number of alarms that is exceeded with a probability of 1e-4."""
    return stats.binom.isf(1e-4, runs, chance)


def flat(value, spp=16):
    return noisy(np.random.default_rng(0), lambda rng, shape: np.full(shape, value), spp)


def levels(found):
    return found.p_value, found.p_pixels, found.p_blocks, found.p_mean


def test_tail_of_student() -> None:
    rng = np.random.default_rng(0)
    t, freedom = np.exp(rng.uniform(-6, 6, 5000)), np.exp(rng.uniform(0, 12, 5000))
    expected = 2 * stats.t.sf(t, freedom)
    seen = expected > 1e-200
    assert t_tail(t[seen], freedom[seen]) == pytest.approx(expected[seen], rel=1e-7)
    assert t_tail(np.zeros(2), np.array([1.0, 9])) == pytest.approx(1)
    x = np.exp(rng.uniform(-2, 12, 1000))
    assert log_gamma(x) == pytest.approx(special.gammaln(x), rel=1e-9, abs=1e-9)


def test_correction() -> None:
    assert sidak(0.01, 1) == pytest.approx(0.01)
    assert sidak(1e-20, 1000) == pytest.approx(1e-17)
    assert sidak(0.5, 2) == pytest.approx(0.75)
    assert sidak(1.0, 5) == 1


@pytest.fixture(autouse=True)
def _without_flip(missing) -> None:
    """It takes longer than the tests."""
    missing("flip_evaluator")


@pytest.mark.parametrize("draw", [flashes, fireflies, gaussian, heavy, edges])
@pytest.mark.parametrize("spp", [(2, 2), (16, 16), pytest.param((16, 2048), marks=pytest.mark.slow)], ids=str)
@pytest.mark.first(4)
def test_false_alarms(draw, spp) -> None:
    """Are at most as frequent as the p-values say, for any distribution of samples."""
    rng, (runs, size) = (
        np.random.default_rng([*spp, len(draw.__name__)]),
        (40, 16) if max(spp) < 100 else (12, 8),
    )
    found = np.array([levels(wf.compare(*(noisy(rng, draw, n, size) for n in spp))) for _ in range(runs)])
    for chance in (0.01, 0.1):
        assert ((found <= chance).sum(0) <= most(runs, chance)).all(), (found <= chance).mean(0)


def p_of_means(rng, first, second, runs):
    """p-values (runs, 2, 3) of the means of pairs of pictures: of pixels alike, and of weighted ones."""
    pairs = ([noisy(rng, draw) for draw in (first, second)] for _ in range(runs))
    return np.array(
        [_p_of_mean(*(_estimate(each, each.rgb.astype(float), 1) for each in pair)) for pair in pairs]
    )


@pytest.mark.slow
def test_p_of_the_mean_is_uniform() -> None:
    """Without noise that is hard to estimate; the three channels are independent here."""
    p = p_of_means(np.random.default_rng(1), gaussian, gaussian, 200)
    for each in (p[:, 0], p[:, 1]):
        assert stats.kstest(each.ravel(), "uniform").pvalue > 1e-4


def quiet(rng, shape):
    """The mean of `fireflies`, with little noise."""
    return rng.uniform(1.98, 2.0, shape)


def noisy_in_a_corner(rng, shape):
    """A quarter of the pixels has nearly all noise, as where a lamp is half hidden."""
    return rng.normal(3, np.where(np.arange(shape[2]) < shape[2] // 4, 4, 0.05), shape)


@pytest.mark.parametrize(
    "pair", [(heavy, heavy), (fireflies, quiet), (fireflies, fireflies), (flashes, quiet)]
)
@pytest.mark.first(2)
def test_weights_raise_no_false_alarms(pair) -> None:
    """Nor where one picture has another noise than the other, as one of another estimator has."""
    rng, runs = np.random.default_rng(4), 60
    scale = np.mean(pair[0](rng, 10**6)) / np.mean(pair[1](rng, 10**6))
    p = p_of_means(rng, pair[0], lambda *args: scale * pair[1](*args), runs)
    assert ((p[:, 1] <= 0.05).sum(0) <= most(runs, 0.05)).all(), (p[:, 1] <= 0.05).mean(0)


def test_weights_find_what_few_noisy_pixels_hide() -> None:
    """One percent, of pixels of which a quarter has all noise."""
    rng = np.random.default_rng(5)
    a, b = noisy(rng, noisy_in_a_corner, 16, 32), noisy(rng, noisy_in_a_corner, 16, 32)
    assert wf.compare(a, b).p_mean > 0.01
    found = _p_of_mean(*(_estimate(each, each.rgb.astype(float), 1) for each in (1.01 * a, b)))
    assert (found[1] < 1e-6).all()
    assert found[0].min() > 1e-3
    assert wf.compare(1.01 * a, b).p_mean < 1e-5


def test_pictures_with_unequal_samples_have_the_errors_of_batches() -> None:
    rng = np.random.default_rng(6)
    a, b = (
        _estimate(each, each.rgb.astype(float), 1)
        for each in (noisy(rng, gaussian, 64), noisy(rng, gaussian))
    )
    assert _p_of_mean(a, b).shape == (1, 1, 3)


def test_windows_leave_out_their_pixels() -> None:
    values = np.random.default_rng(7).random((7, 4, 3))
    due = [
        [values[max(y - 2, 0) : y + 3, max(x - 2, 0) : x + 3].sum((0, 1)) for x in range(4)] for y in range(7)
    ]
    assert _around(values) == pytest.approx(np.array(due) - values)


@pytest.mark.parametrize(("field", "where"), [("p_pixels", 3), ("p_blocks", 8), ("p_mean", SIZE)])
def test_differences_are_found(field, where) -> None:
    rng = np.random.default_rng(2)
    a, b = noisy(rng, gaussian, 64), noisy(rng, gaussian, 64)
    by = {3: 4.0, 8: 0.2, SIZE: 0.04}[where]
    a.rgb[:where, :where] += np.float32(by)
    found = wf.compare(a, b)
    assert getattr(found, field) < 1e-3
    assert found.p_value < 3e-3
    assert wf.compare(noisy(rng, gaussian, 64), b).p_value > 1e-2


def test_rounding_is_no_difference() -> None:
    a, b = flat(0.5), flat(0.5 * (1 + 3e-7))
    assert levels(wf.compare(a, b)) == (1, 1, 1, 1)
    assert wf.compare(a, flat(0.51)).p_pixels < 1e-3


def test_of_pictures_that_share_samples_the_text_says_so() -> None:
    """Equal ones have p-values of 1, and others cautious ones."""
    scene = wf.Scene([wf.Sphere((0, 0, 0), 1)], [wf.Environment(1)])
    a, same, more = (render(scene, spp, size=(8, 8)) for spp in (4, 4, 8))
    other = render(scene, 4, size=(8, 8), seed=1)
    assert levels(wf.compare(a, same)) == (1,) * 4
    for b, last in ((same, 3), (more, 3), (a * 1.01, 3)):
        found = wf.compare(a, b)
        assert found.p_absent == ""
        assert 1e-3 < found.p_value <= 1
        assert f"share samples 0 to {last} of seed 0" in found.shared
        assert found.shared in str(found)
    assert wf.compare(a, other).p_value > 1e-3
    more.metadata["sample_ranges"] = [[4, 8]]
    assert wf.compare(a, more).shared == ""
    assert wf.compare(a, render(scene, 4, size=(8, 8), sampler="independent")).shared == ""


def test_errors_in_common_add_up_at_worst() -> None:
    """Opposite errors, the worst that pictures can have in common, give no more alarms than p says."""
    rng, alarms = np.random.default_rng(5), []
    for _ in range(80):
        a = noisy(rng, gaussian, size=8)
        a.metadata.update(seed=1, sampler="sobol", spp=a.spp)
        b = a * 1
        b.rgb, b.standard_error, b.variance, b.counts = 6 - a.rgb, a.standard_error, a.variance, a.counts
        found = wf.compare(a, b)
        assert found.shared
        alarms.append(found.p_mean < 0.05)
    assert sum(alarms) <= most(80, 0.05)


@pytest.mark.parametrize("pixels", [np.full((4, 4, 3), 0.5), np.zeros((4, 4))])
def test_equal_pictures_differ_by_nothing(pixels) -> None:
    """Also where nothing is known of their errors."""
    assert levels(wf.compare(pixels, pixels.copy())) == (1,) * 4


@pytest.mark.parametrize(
    ("a", "b", "shared"),
    [
        ({"seed": 1, "sampler": "sobol", "spp": 8}, {"seed": 1, "sampler": "sobol", "spp": 4}, (0, 4)),
        ({"seed": 1, "sampler": "sobol", "spp": 8}, {"seed": 2, "sampler": "sobol", "spp": 4}, None),
        ({"seed": 1, "sampler": "sobol", "spp": 8}, {"seed": 1, "sampler": "independent", "spp": 4}, None),
        ({"sampler": "sobol", "spp": 8}, {"sampler": "sobol", "spp": 8}, None),
        (
            {"seed": 1, "sampler": "sobol", "sample_ranges": [[0, 4], [8, 12]]},
            {"seed": 1, "sampler": "sobol", "sample_ranges": [[4, 8], [11, 16]]},
            (11, 12),
        ),
        (
            {"seed": 1, "sampler": "sobol", "sample_ranges": [[0, 4]]},
            {"seed": 1, "sampler": "sobol", "sample_ranges": [[4, 8]]},
            None,
        ),
    ],
)
def test_shared_samples(a, b, shared) -> None:
    assert shared_samples(a, b) == shared
    assert shared_samples(b, a) == shared


def test_reasons() -> None:
    image = noisy(np.random.default_rng(0), gaussian)
    assert "b has no standard error" in wf.compare(image, 2 * image.rgb).p_absent
    assert "a has no standard error" in wf.compare(2 * image.rgb, image).p_absent
    once = noisy(np.random.default_rng(0), gaussian, spp=1)
    assert "b has pixels with fewer than two samples" in wf.compare(image, once).p_absent


def room(*shapes, size=(32, 32)) -> wf.Scene:
    """A ball and a floor under a panel, and what else is in the scene."""
    shapes = [
        wf.Rectangle((-4, -1, 4), (8, 0, 0), (0, 0, -8)),
        wf.Sphere((1.1, 0, 0), 1),
        wf.Rectangle((-1, 3, -1), (2, 0, 0), (0, 0, 2), emission=6),
        *shapes,
    ]
    return wf.Scene(shapes, camera=wf.Camera.look_at((0, 1, 6), (0, 0, 0), size=size))


@pytest.mark.parametrize("sampler", ["sobol", "independent"])
def test_one_percent_of_brightness(sampler) -> None:
    a, b = (render(room(size=(16, 16)), 512, sampler=sampler, seed=seed) for seed in (1, 2))
    assert wf.compare(a, b).p_value > 1e-3
    assert wf.compare(a * 1.01, b).p_value < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spp", "sampler"), [(4, "sobol"), (16, "sobol"), (16, "independent"), (4, "bluenoise")]
)
def test_false_alarms_of_renders(spp, sampler) -> None:
    """Many pairs of seeds of a scene with edges, soft shadows and glass."""
    scene, pairs = room(wf.Sphere((-0.9, 0, 0), 1, material=wf.Dielectric(1.5))), 200
    images = (render(scene, spp, sampler=sampler, seed=seed) for seed in range(2 * pairs))
    found = np.array([levels(wf.compare(a, next(images))) for a in images])
    for chance in (0.01, 0.1):
        assert ((found <= chance).sum(0) <= most(pairs, chance)).all(), (found <= chance).mean(0)


def test_the_table_says_what_the_p_value_means():
    """For readers who do not remember which way round it is."""
    scene = [wf.Sphere((0, 0, 0), 1), wf.Environment(1), wf.PointLight((2, 2, 2), 20)]
    a, b = (wf.render(scene, 16, size=(32, 32), seed=seed, progress=False) for seed in (1, 2))
    assert "noise alone   may well explain the difference (p_value " in str(wf.compare(a, b))
    assert "noise alone   hardly explains the difference (p_value 0, limit 0.01)" in str(
        wf.compare(a * 1.2, b)
    )
