"""Image: pictures as arrays, as codes for display, and from files again."""

import struct
import zlib

import imageio.v3 as iio
import numpy as np
import pytest
from inside import srgb_to_linear
from significance import render

import wavefront as wf

GAMMAS = [2.2, 1.8, 1.0, "srgb"]
CURVES = [
    (2.2, lambda code: code**2.2),
    (1.8, lambda code: code**1.8),
    ("srgb", lambda code: np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)),
]


@pytest.fixture
def image():
    """A picture of every code for display, in three channels."""
    ramp = np.linspace(0, 1, 256, dtype=np.float32)
    rgb = np.stack([ramp, ramp[::-1], np.roll(ramp, 100)], axis=-1).reshape(16, 16, 3)
    return wf.Image(rgb)


def steps(image, gamma):
    """How far linear values may be apart that differ by half a code, (H, W, 3)."""
    codes = image.to_uint8(gamma).astype(np.float64)
    curve = dict(CURVES).get(gamma, lambda code: code)
    return curve((codes + 0.501) / 255) - curve(np.maximum(codes - 0.501, 0) / 255)


@pytest.mark.parametrize("gamma", GAMMAS)
def test_a_saved_png_differs_from_the_picture_by_rounding(tmp_path, image, gamma):
    path = tmp_path / "a.png"
    image.save(path, gamma)
    loaded = wf.Image.load(path)
    assert loaded.rgb.dtype == np.float32
    assert (np.abs(loaded.rgb - image.rgb) <= steps(image, gamma)).all()
    found = wf.compare(image, path)
    assert found.relative_mse**0.5 < 0.004
    assert wf.compare(loaded, path).rmse == 0
    assert (loaded.to_uint8(gamma) == image.to_uint8(gamma)).all()


@pytest.mark.parametrize("gamma", GAMMAS)
@pytest.mark.parametrize("extension", ["jpg", "jpeg"])
def test_a_saved_jpg_differs_by_little_more(tmp_path, image, gamma, extension):
    """By up to five codes, and by less than a fourth of one on the mean."""
    path = tmp_path / f"a.{extension}"
    image = wf.Image(image.rgb.repeat(8, 0).repeat(8, 1))  # jpg codes blocks of 8 × 8
    image.save(path, gamma)
    codes = wf.Image.load(path).to_uint8(gamma).astype(int) - image.to_uint8(gamma)
    assert np.abs(codes).max() <= 5
    assert abs(codes.mean()) < 0.25
    assert wf.compare(image, path).relative_mse ** 0.5 < 0.02


@pytest.mark.parametrize(("gamma", "curve"), CURVES)
@pytest.mark.parametrize("extension", ["png", "jpg"])
def test_values_of_files_by_hand(tmp_path, gamma, curve, extension):
    """A gray of code 100, decoded by the gamma that the file names."""
    gray = wf.Image(np.full((16, 16, 3), curve(np.float64(100 / 255)), np.float32))
    gray.save(tmp_path / f"a.{extension}", gamma)
    assert (iio.imread(tmp_path / f"a.{extension}") == 100).all()
    # a png holds 1/gamma to 5 digits
    expected = float(curve(100 / 255))
    assert wf.Image.load(tmp_path / f"a.{extension}").rgb == pytest.approx(expected, rel=3e-5)
    assert wf.compare(gray, tmp_path / f"a.{extension}").relative_mse ** 0.5 < 1e-4


def chunks(data):
    """Return the chunks of a png by name."""
    out, at = {}, 8
    while at < len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        out[data[at + 4 : at + 8]] = data[at + 8 : at + 8 + length]
        at += 12 + length
    return out


def test_pngs_and_jpgs_say_their_gamma(tmp_path, image):
    from PIL import Image

    expected = {2.2: 45455, 1.8: 55556, 1.0: 100000, "srgb": 45455}
    for gamma, gama in expected.items():
        image.save(tmp_path / "a.png", gamma)
        found = chunks((tmp_path / "a.png").read_bytes())
        assert found[b"gAMA"] == struct.pack(">I", gama)
        assert (b"sRGB" in found) == (gamma == "srgb")
        image.save(tmp_path / "a.jpg", gamma)
        with Image.open(tmp_path / "a.jpg") as file:
            tags = file.getexif().get_ifd(0x8769)
        assert tags[0xA001] == (1 if gamma == "srgb" else 0xFFFF)
        assert tags.get(0xA500) == (None if gamma == "srgb" else gamma)


def test_files_without_gamma_are_srgb(tmp_path):
    """And those whose gamma makes no sense."""
    codes = np.arange(256, dtype=np.uint8).reshape(16, 16)
    expected = srgb_to_linear(codes / np.float32(255))[..., None].repeat(3, 2)
    for name in ("a.png", "a.jpg"):
        iio.imwrite(tmp_path / name, codes, **({"quality": 100} if name == "a.jpg" else {}))
        assert wf.Image.load(tmp_path / name).rgb == pytest.approx(expected, abs=0.01)
    data = (tmp_path / "a.png").read_bytes()
    for gama in (0, 2**31 - 1):
        body = b"gAMA" + struct.pack(">I", gama)
        chunk = struct.pack(">I", 4) + body + struct.pack(">I", zlib.crc32(body))
        (tmp_path / "b.png").write_bytes(data[:33] + chunk + data[33:])
        assert (wf.Image.load(tmp_path / "b.png").rgb == wf.Image.load(tmp_path / "a.png").rgb).all()


def test_damaged_exif_is_passed_over(tmp_path, image):
    image.save(tmp_path / "a.jpg", "srgb")
    data = (tmp_path / "a.jpg").read_bytes()
    at = data.index(b"Exif\0\0") + 6
    for length in (1, 4, 8, 20, 40):
        (tmp_path / "b.jpg").write_bytes(data[:at] + b"\xff" * length + data[at + length :])
        assert (wf.Image.load(tmp_path / "b.jpg").rgb == wf.Image.load(tmp_path / "a.jpg").rgb).all()
    for k in range(at, at + 44):
        (tmp_path / "b.jpg").write_bytes(data[:k] + bytes([data[k] ^ 0xFF]) + data[k + 1 :])
        assert wf.Image.load(tmp_path / "b.jpg").shape == image.shape


def test_textures_do_not_follow_the_gamma_of_a_file(tmp_path, image):
    """They are sRGB or data, as their users say."""
    image.save(tmp_path / "a.png", 1.0)
    image.save(tmp_path / "b.png", "srgb")
    by_curve, linear = (wf.Texture(tmp_path / "a.png", srgb=srgb).mean() for srgb in (True, False))
    assert linear == pytest.approx(image.rgb.mean((0, 1)), abs=1e-3)
    assert (by_curve < linear - 0.1).all()
    assert wf.Texture(tmp_path / "b.png").mean() == pytest.approx(image.rgb.mean((0, 1)), abs=1e-3)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_arrays_of_codes_are_compared_as_files_are(tmp_path, image, kind):
    """They count from 0 to 1, by the sRGB curve; alpha does not count."""
    image.save(tmp_path / "a.png", "srgb")
    codes = iio.imread(tmp_path / "a.png").astype(kind) * kind(np.iinfo(kind).max // 255)
    assert wf.compare(codes, tmp_path / "a.png").rmse < 1e-6
    assert wf.compare(codes, image).relative_mse ** 0.5 < 0.004
    white = np.full((2, 2, 3), np.iinfo(kind).max, kind)
    assert wf.compare(white, np.ones((2, 2, 3))).rmse == 0
    with_alpha = np.concatenate([white, np.zeros((2, 2, 1), kind)], axis=2)
    assert wf.compare(with_alpha, np.ones((2, 2, 3))).rmse == 0
    assert wf.compare(white[..., 0], np.ones((2, 2))).rmse == 0


def test_integers_of_other_kinds_are_linear():
    assert wf.compare(np.full((2, 2), 2, np.int64), np.full((2, 2), 2.0)).rmse == 0


@pytest.mark.parametrize("extension", ["exr", "npy"])
def test_linear_files_are_loaded_as_they_are(tmp_path, image, extension):
    image.save(tmp_path / f"a.{extension}", exposure=3)
    assert (wf.Image.load(tmp_path / f"a.{extension}").rgb == 8 * image.rgb).all()


def test_gray_and_alpha_become_three_channels(tmp_path):
    values = np.random.default_rng(0).random((4, 5, 4)).astype(np.float32)
    for pick, expected in ((0, [0, 0, 0]), (slice(0, 2), [0, 0, 0]), (slice(0, 4), [0, 1, 2])):
        np.save(tmp_path / "a.npy", values[..., pick])
        assert (wf.Image.load(tmp_path / "a.npy").rgb == values[..., expected]).all()
    np.save(tmp_path / "a.npy", np.zeros((2, 3, 7)))
    with pytest.raises(wf.SceneError, match=r"a\.npy: has 7 channels; a picture has 1 to 4"):
        wf.Image.load(tmp_path / "a.npy")


def test_shape_and_indexing(image):
    assert image.shape == (16, 16, 3)
    assert (image[3, 7] == image.rgb[3, 7]).all()
    assert image[3, 7].shape == (3,)
    assert (image[10:13, :, 1] == image.rgb[10:13, :, 1]).all()
    assert (image[image.rgb > 0.5] > 0.5).all()


@pytest.mark.parametrize("gamma", GAMMAS)
def test_to_uint8_is_what_save_writes(tmp_path, image, gamma):
    for exposure in (0.0, -1.5):
        image.save(tmp_path / "a.png", gamma, exposure)
        codes = image.to_uint8(gamma, exposure)
        assert codes.dtype == np.uint8
        assert (codes == iio.imread(tmp_path / "a.png")).all()
    with pytest.raises(wf.SceneError, match="gamma is 0"):
        image.to_uint8(gamma=0)
    with pytest.raises(wf.SceneError, match="exposure is 1000"):
        image.to_uint8(exposure=1000)


def picture(seed, **more) -> wf.Image:
    rng = np.random.default_rng(seed)
    rgb, error = rng.random((2, 3, 5, 3)).astype(np.float32)
    return wf.Image(rgb, 8, {"seed": seed, "sampler": "sobol", "spp": 8}, standard_error=error, **more)


def test_difference() -> None:
    a, b = picture(1), picture(2)
    found = a - b
    assert (found.rgb == a.rgb - b.rgb).all()
    assert found.standard_error == pytest.approx(np.sqrt(a.standard_error**2 + b.standard_error**2))
    assert found.spp == 8
    assert not found.layers
    assert (a - picture(1)).standard_error is None  # shares its samples
    assert (a - wf.Image(b.rgb)).standard_error is None


def test_difference_of_renders_is_noise() -> None:
    scene = wf.Scene([wf.Sphere((0, 0, 0), 1)], [wf.Environment(1), wf.PointLight((2, 2, 2), 9)])
    camera = wf.Camera.look_at((0, 0, 1.9), (0, 0, 0), size=(16, 16))
    a, b = (render(scene, 64, seed=seed, camera=camera, sampler="independent") for seed in (1, 2))
    found = a - b
    assert 0.8 < np.sqrt(np.mean(found.rgb**2) / np.mean(found.standard_error**2)) < 1.25


def test_multiple() -> None:
    ones = np.ones((3, 5, 3), np.float32)
    layers = {"direct": ones, "albedo": ones, "light_groups.lamp": ones, "depth": ones[..., 0]}
    errors = {"direct": ones, "albedo": ones, "light_groups.lamp": ones}
    a = picture(1, layers=layers, errors=errors, variance=ones, counts=np.full((3, 5), 8))
    for factor in (-2, 2.5, (1, 2, -3), np.array([1, 0, 2])):
        scale = np.broadcast_to(np.asarray(factor, np.float32), (3,))
        found = a * factor
        assert (found.rgb == a.rgb * scale).all()
        assert (found.standard_error == a.standard_error * abs(scale)).all()
        assert (found.variance == scale**2).all()
        for name in ("direct", "light_groups.lamp"):
            assert (found.layers[name] == scale).all()
            assert (found.errors[name] == abs(scale)).all()
        assert (found.layers["albedo"] == 1).all()
        assert (found.errors["albedo"] == 1).all()
        assert (found.depth == 1).all()
        assert (found.counts == 8).all()
        assert found.metadata == a.metadata
    assert (a.rgb == picture(1).rgb).all()
    assert ((2 * a).rgb == a.rgb * 2).all()


@pytest.mark.parametrize("factor", [(1, 2), np.nan, np.ones((3, 5, 3)), (1, 2, np.inf)])
def test_wrong_factors(factor) -> None:
    with pytest.raises(wf.SceneError, match="number or an rgb triple"):
        picture(1) * factor


def test_wrong_operands() -> None:
    with pytest.raises(wf.SceneError, match="5x3 and 2x2"):
        picture(1) - wf.Image(np.zeros((2, 2, 3), np.float32))
    for wrong in ("2", None, picture(2)):
        with pytest.raises(TypeError):
            picture(1) * wrong
    assert isinstance(picture(1) - np.zeros((3, 5, 3), np.float32), np.ndarray)  # as NumPy has it
