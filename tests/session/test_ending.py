"""When a picture ends by itself."""

import numpy as np
import pytest

import wavefront as wf
from wavefront.scheduling.adaptive import QUICK_SPP
from wavefront.settings.settings import DEFAULT_SPP, LITTLE_NOISE

BALL = wf.Sphere((0, 0, 0), 1)
LIT = [BALL, wf.PointLight((2, 3, 4), 50), wf.Environment(0.2)]
SMALL = {"size": (32, 24), "progress": False, "workers": 1, "accel": "numpy"}


def render(scene, *given, **settings) -> wf.Image:
    return wf.render(scene, *given, **{**SMALL, **settings})


def test_a_picture_in_chosen_light_is_denoised_and_ends_once_it_is_clean() -> None:
    image = render(BALL)
    assert image.metadata["denoiser"]
    assert image.metadata["quick"]
    assert image.metadata["branches"] == 4
    assert QUICK_SPP <= image.spp < 32
    assert image.standard_error is None
    assert np.isfinite(image.noisy.standard_error).all()


def test_it_has_the_samples_that_such_a_picture_would_have() -> None:
    """The bits of samples are those of as many that are asked for, and the same for any workers and waves."""
    image = render(BALL)
    asked = render(BALL, image.spp, branches=4, denoise=True)
    np.testing.assert_array_equal(image.noisy.rgb, asked.noisy.rgb)
    for more in ({"workers": 2, "executor": "threads"}, {"wave_size": 300}):
        np.testing.assert_array_equal(render(BALL, **more).noisy.rgb, image.noisy.rgb)


def test_noisier_pictures_get_more_samples() -> None:
    smooth = render(BALL, ground=False)
    rough = render(wf.Sphere((0, 0, 0), 1, material=wf.Principled(0.8, 1, 0.3)), ground=False)
    assert rough.spp != smooth.spp


def test_a_picture_in_light_of_its_own_ends_by_its_noise() -> None:
    image = render(LIT)
    assert image.noisy is None
    assert not image.metadata["quick"]
    assert image.spp <= DEFAULT_SPP
    asked = render(LIT, DEFAULT_SPP, noise=LITTLE_NOISE)
    np.testing.assert_array_equal(image.rgb, asked.rgb)


@pytest.mark.parametrize(
    "given",
    [{"spp": 3}, {"noise": 0.3}, {"seconds": 0.2}, {"samples": range(3)}, {"quality": "reference"}],
    ids=str,
)
@pytest.mark.parametrize("scene", [BALL, LIT], ids=["chosen light", "own light"])
def test_what_is_asked_for_is_done(scene, given) -> None:
    image = render(scene, **given)
    assert image.noisy is None
    assert not image.metadata["quick"]
    if given == {"quality": "reference"}:
        assert (image.counts == 100).all()


def test_denoising_can_be_refused_and_asked_for() -> None:
    plain, wanted = render(BALL, denoise=False), render(LIT, denoise=True)
    assert plain.noisy is None
    assert plain.spp >= 32
    assert wanted.metadata["denoiser"]


def test_measurements_and_data_sets_are_as_before(tmp_path) -> None:
    found = wf.measure(wf.Scene([BALL], wf.Environment(1)), [(0, 2, 0)], (0, 1, 0), progress=False)
    assert (found.image.counts == DEFAULT_SPP).all()
    wf.write_dataset(tmp_path / "set", BALL, wf.turntable(BALL, 1, size=(16, 16)), progress=False)
    names = [path.name for path in (tmp_path / "set").rglob("*") if path.is_file()]
    assert names
    about = next((tmp_path / "set").rglob("*.json"))
    assert '"denoise": true' not in about.read_text()


def test_what_was_done_is_said(capsys, monkeypatch) -> None:
    monkeypatch.setattr("wavefront.session.hints.NOTICED", 0.0)
    render(BALL, progress=None)
    assert 'quality="reference"' in capsys.readouterr().err


def test_mistakes_are_named() -> None:
    with pytest.raises(wf.SceneError, match=r"quality.*auto.*reference"):
        render(BALL, quality="best")
