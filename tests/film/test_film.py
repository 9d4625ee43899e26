"""The film: samples become pixels in one fixed order; an Image is the result as data."""

import numpy as np
import pytest
from inside import Film, f4

import wavefront as wf


def pixels(first: int, end: int) -> np.ndarray:
    """Indices of consecutive pixels."""
    return np.arange(first, end, dtype=np.uint32)


def test_pixels_are_means_in_row_major_order() -> None:
    """Row 0 first, left to right; a pixel without samples is black."""
    film = Film(3, 2)
    film.add(pixels(0, 5), np.arange(30, dtype=f4).reshape(3, 2, 5))
    rgb = film.estimates().mean.reshape(2, 3, 3)
    assert rgb.shape == (2, 3, 3)
    assert rgb.dtype == np.float32
    assert rgb[0, 1].tolist() == [(1 + 6) / 2, (11 + 16) / 2, (21 + 26) / 2]
    assert rgb[1, 1].tolist() == [(4 + 9) / 2, (14 + 19) / 2, (24 + 29) / 2]
    assert rgb[1, 2].tolist() == [0, 0, 0]


def test_float64_sums_lose_nothing() -> None:
    film = Film(1, 1)
    film.add(pixels(0, 1), np.full((3, 1, 1), 2.0**24, f4))
    film.add(pixels(0, 1), np.ones((3, 3, 1), f4))
    assert (film.mean() == (2.0**24 + 3) / 4).all()


def test_image_is_data(tmp_path) -> None:
    image = wf.Image(np.full((2, 3, 3), 0.25, f4), 7, {"seed": 3})
    assert np.asarray(image) is not None
    assert (np.asarray(image) == 0.25).all()
    assert np.asarray(image, np.float64).dtype == np.float64
    assert repr(image) == "<Image 3x2, 7 spp>"
    assert (image.spp, image.metadata) == (7, {"seed": 3})
    assert image._repr_png_().startswith(b"\x89PNG")
    image.save(tmp_path / "x.npy")
    assert (np.load(tmp_path / "x.npy") == image.rgb).all()


def test_unknown_extension_is_named(tmp_path) -> None:
    with pytest.raises(wf.SceneError, match="bmpx"):
        wf.Image(np.zeros((1, 1, 3), f4), 1).save(tmp_path / "x.bmpx")
    assert not list(tmp_path.iterdir())
