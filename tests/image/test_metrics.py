"""Comparison of pictures: numbers that can be worked out by hand, files, and complaints."""

import numpy as np
import pytest
from inside import linear_to_srgb, main, write_image

import wavefront as wf

A = np.array([[[1.0, 2, 3], [1, 2, 3]], [[0, 0, 0], [4, 0, 1]]])
B = np.array([[[1.0, 2, 3], [2, 2, 3]], [[0, 0, 0], [2, 0, 0]]])


def noisy(seed: int = 0, size: tuple[int, int] = (24, 32)) -> np.ndarray:
    """A picture with values in [0.1, 0.9]."""
    return np.random.default_rng(seed).uniform(0.1, 0.9, (*size, 3)).astype(np.float32)


def test_numbers_by_hand() -> None:
    """Three values of twelve differ: 1 for 2, 4 for 2, and 1 for 0."""
    found = wf.compare(A, B)
    floor = 0.01 * (15 / 12) ** 2
    assert found.rmse == pytest.approx((6 / 12) ** 0.5)
    assert found.relative_mse == pytest.approx((1 / (4 + floor) + 4 / (4 + floor) + 1 / floor) / 12)
    assert found.psnr == pytest.approx(20 * np.log10(3 / found.rmse))
    assert found.mean_a == pytest.approx([6 / 4, 1, 7 / 4])
    assert found.mean_b == pytest.approx([5 / 4, 1, 6 / 4])
    assert (found.difference.rgb == np.abs(A - B)).all()


def test_relative_mse_does_not_depend_on_exposure() -> None:
    a, b = noisy(1), noisy(2)
    plain, bright = wf.compare(a, b), wf.compare(a * 1000, b * 1000)
    assert bright.relative_mse == pytest.approx(plain.relative_mse, rel=1e-5)
    assert bright.psnr == pytest.approx(plain.psnr, rel=1e-5)
    assert bright.rmse == pytest.approx(plain.rmse * 1000, rel=1e-5)


def test_equal_pictures() -> None:
    for picture in (noisy(), np.zeros((3, 4, 3))):
        found = wf.compare(picture, picture)
        assert (found.relative_mse, found.rmse, found.psnr) == (0, 0, np.inf)
        assert not found.difference.rgb.any()
    assert wf.compare(np.ones((3, 4, 3)), np.zeros((3, 4, 3))).psnr == -np.inf


@pytest.mark.parametrize("extension", ["exr", "npy"])
def test_files_images_and_arrays_are_the_same(tmp_path, extension: str) -> None:
    a, b = noisy(1), noisy(2)
    path = tmp_path / f"a.{extension}"
    write_image(path, a)
    expected = wf.compare(a, b)
    for form in (path, str(path), wf.Image(a), a.astype(np.float64)):
        found = wf.compare(form, b)
        assert found.relative_mse == expected.relative_mse
        assert found.mean_a == pytest.approx(expected.mean_a, abs=0)


def test_flip_of_two_pngs_is_that_of_their_codes(tmp_path) -> None:
    """As the evaluator's own command line has it."""
    flip = pytest.importorskip("flip_evaluator")
    a, b = noisy(1), noisy(2)
    for name, picture in (("a", a), ("b", b)):
        wf.Image(picture).save(tmp_path / f"{name}.png", gamma="srgb")
    codes = [np.round(linear_to_srgb(x) * 255).astype(np.float32) / 255 for x in (b, a)]
    expected = flip.evaluate(*codes, "LDR", inputsRGB=True)[1]
    assert wf.compare(tmp_path / "a.png", tmp_path / "b.png").flip == pytest.approx(expected, rel=1e-3)
    hdr = flip.evaluate(b, a, "HDR")[1]
    found = wf.compare(a, b)
    assert found.flip == pytest.approx(hdr, rel=1e-5)
    assert f"{found.flip:.6g}" in str(found)


def test_without_flip(missing) -> None:
    """The reason stands where the number would."""
    missing("flip_evaluator")
    found = wf.compare(A, B)
    assert found.flip is None
    assert "pip install flip-evaluator" in str(found)
    assert wf.compare(A, np.zeros_like(A)).flip is None


@pytest.mark.parametrize(
    ("a", "b", "message"),
    [
        (np.zeros((2, 3, 3)), np.zeros((3, 2, 3)), "different sizes cannot be compared: 3x2 and 2x3"),
        ("missing.exr", A, "missing.exr"),
        (A, "picture.bmpx", "bmpx"),
        (np.zeros(3), A, r"a has shape \(3,\)"),
        (A, np.zeros((0, 2, 3)), r"b has shape \(0, 2, 3\)"),
        (A, np.where(A == 4, np.nan, A), "b has 1 value that is not finite, the first at x=1, y=1"),
        (object(), A, "a is not a picture: object"),
    ],
)
def test_complaints(a, b, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        wf.compare(a, b)


def test_command(tmp_path, capsys) -> None:
    paths = [str(tmp_path / f"{name}.exr") for name in "ab"]
    for path, picture in zip(paths, (A, B), strict=True):
        write_image(path, picture.astype(np.float32))
    out = tmp_path / "difference.npy"
    assert main(["compare", *paths, "-o", str(out)]) == 0
    assert capsys.readouterr().out.strip() == str(wf.compare(A, B))
    assert (np.load(out) == np.abs(A - B)).all()
    assert main(["compare", paths[0], str(tmp_path / "none.exr")]) == 2
    assert "none.exr" in capsys.readouterr().err
    assert main(["compare", *paths, "-o", str(tmp_path / "no" / "x.png")]) == 2
