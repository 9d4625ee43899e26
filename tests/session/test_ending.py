"""When a picture ends by itself."""

import numpy as np
import pytest
from inside import DEFAULT_SPP, LITTLE_NOISE, QUICK_SPP, main, passes_until_clean

import wavefront as wf

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
    more = render(BALL, workers=2, executor="threads", wave_size=300)
    np.testing.assert_array_equal(more.noisy.rgb, image.noisy.rgb)


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
    plain, wanted, same = render(BALL, denoise=False), render(LIT, denoise=True), render(BALL, denoise=True)
    assert same.metadata["quick"]
    assert plain.noisy is None
    assert plain.spp >= 32
    assert wanted.metadata["denoiser"]


def test_measurements_and_data_sets_are_not_denoised(tmp_path, monkeypatch) -> None:
    def refuse(image: wf.Image) -> wf.Image:
        raise AssertionError("it was denoised")

    monkeypatch.setattr(wf.Image, "denoise", refuse)
    found = wf.measure(wf.Scene([BALL], wf.Environment(1)), [(0, 2, 0)], (0, 1, 0), progress=False)
    assert (found.image.counts == DEFAULT_SPP).all()
    wf.write_dataset(tmp_path / "set", BALL, wf.turntable(BALL, 1, size=(16, 16)), progress=False)
    names = [path.name for path in (tmp_path / "set").rglob("*") if path.is_file()]
    assert names
    about = next((tmp_path / "set").rglob("*.json"))
    assert '"denoise": true' not in about.read_text()


@pytest.mark.parametrize("scene", [BALL, LIT], ids=["chosen light", "own light"])
def test_what_was_done_is_said(scene, capsys, monkeypatch) -> None:
    """By the bar, by a line at the end, and in the metadata; and how to have it otherwise."""
    monkeypatch.setattr("wavefront.drive.hints.NOTICED", 0.0)
    monkeypatch.setattr("wavefront.core.progress.DELAY", -1.0)
    image = render(scene, progress=None)
    bar, _, line = capsys.readouterr().err.rpartition("hint: ")
    end = image.metadata["end"]
    assert 'quality="reference"' in end
    assert f"ends {end}" in bar
    assert 'quality="reference"' in line
    assert ("denoised" in end) == ("denoised" in line) == image.metadata["quick"]


def test_nothing_is_said_of_what_was_asked_for(capsys, monkeypatch) -> None:
    monkeypatch.setattr("wavefront.drive.hints.NOTICED", 0.0)
    assert render(BALL, 2, progress=None).metadata["end"] is None
    assert "reference" not in capsys.readouterr().err


def test_info_says_how_a_picture_will_end(tmp_path, capsys) -> None:
    path = tmp_path / "triangle.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    main(["info", str(path)])
    assert "picture: ends once it is clean" in capsys.readouterr().out


def test_a_black_picture_ends_at_once() -> None:
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 10), size=(16, 12))
    assert render(BALL, camera=camera, background=0, size=None).spp == QUICK_SPP


def test_samples_before_denoising_say_so(tmp_path) -> None:
    image = render(BALL, checkpoint=tmp_path / "ball.wfck")
    kept = wf.Image.load(tmp_path / "ball.wfck")
    np.testing.assert_array_equal(kept.rgb, image.noisy.rgb)
    assert kept.metadata["before_denoising"]
    assert image.noisy.metadata["before_denoising"]
    assert image.mean().before_denoising
    assert not image.noisy.mean().before_denoising
    assert "before_denoising" not in image.noisy.denoise().metadata
    assert "before denoising" in wf.compare(image, image.noisy).shared
    with pytest.raises(AssertionError, match="samples of the pictures, before denoising, differ"):
        wf.testing.assert_same_picture(image, 3 * image)


def test_merged_pictures_are_of_samples_and_say_so() -> None:
    parts = [render(BALL, samples=each, denoise=True) for each in (range(2), range(2, 4))]
    plain = render(BALL, samples=range(2, 4), aovs=("denoising_albedo", "denoising_normal"))
    whole = render(BALL, 4)
    for other in (parts[1], plain):
        merged = parts[0].merge(other)
        np.testing.assert_array_equal(merged.rgb, whole.rgb)
        assert merged.metadata["before_denoising"]
    assert "before_denoising" not in plain.metadata
    assert plain.merge(parts[0]).metadata["before_denoising"]


def test_a_checkpoint_that_ended_by_itself_goes_on_by_the_same_call_only(tmp_path) -> None:
    path = tmp_path / "ball.wfck"
    image = render(BALL, checkpoint=path)
    np.testing.assert_array_equal(render(BALL, checkpoint=path).rgb, image.rgb)
    render(BALL, 2, checkpoint=tmp_path / "older.wfck")
    with pytest.raises(wf.SceneError, match='quality="reference" goes on'):
        render(BALL, checkpoint=tmp_path / "older.wfck")
    assert render(BALL, checkpoint=tmp_path / "older.wfck", quality="reference").spp == 100


def test_mistakes_are_named() -> None:
    with pytest.raises(wf.SceneError, match=r"quality.*auto.*reference"):
        render(BALL, quality="best")


class FilmWith:
    """A film whose pixels have given errors, each over the root of the number of samples."""

    def __init__(self, errors, rare=None) -> None:
        self.errors, self.rare, self.count = np.array(errors), rare, np.zeros(len(errors), int)

    def samples_of(self) -> int:
        for step in passes_until_clean(self, 100, 0.04):
            self.samples = step.last
        return self.samples

    def relative_variance(self, outliers: float) -> np.ndarray:
        assert outliers == 0
        return self.errors**2 / self.samples

    def rare_part(self, relative: np.ndarray) -> float | None:
        return self.rare


@pytest.mark.parametrize(
    ("errors", "rare", "samples"),
    [
        ([0.1] * 100, None, 8),  # 3.5 % of 8 samples
        ([0.1] * 100 + [0.0] * 300, None, 8),  # pixels without noise do not hide it
        ([0.1] * 99 + [4.0], None, 16),  # one pixel of a heavy tail counts, by its error
        ([0.1] * 100, 0.9, 64),  # errors that rest on few samples are larger than they look
        ([0.0] * 100, None, 4),
        ([100.0] * 100, None, 100),
    ],
    ids=str,
)
def test_the_mean_error_of_lit_pixels_decides(errors, rare, samples) -> None:
    assert FilmWith(errors, rare).samples_of() == samples
