"""Textures: lookup against a direct formula, wrap modes, decoding, and every complaint."""

import imageio.v3 as iio
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from inside import SceneError, Texture, srgb_to_linear
from near import assert_near

WRAPS = ("repeat", "mirror", "clamp")


def uv(*pairs):
    return np.array(pairs, np.float32).T


def reference(image, u, v, wrap, filter):
    """Look one point up in (H, W, C), written out texel by texel, in float64."""
    height, width = image.shape[:2]

    def index(i, size, mode):
        if mode == "repeat":
            return i % size
        if mode == "clamp":
            return min(max(i, 0), size - 1)
        i %= 2 * size
        return i if i < size else 2 * size - 1 - i

    x, y = u * width, (1 - v) * height
    if filter == "nearest":
        return image[index(int(np.floor(y)), height, wrap[1]), index(int(np.floor(x)), width, wrap[0])]
    x, y = x - 0.5, y - 0.5
    i, j = int(np.floor(x)), int(np.floor(y))
    total = 0.0
    for di, wx in ((0, i + 1 - x), (1, x - i)):
        for dj, wy in ((0, j + 1 - y), (1, y - j)):
            total = total + wx * wy * image[index(j + dj, height, wrap[1]), index(i + di, width, wrap[0])]
    return total


@settings(max_examples=200, deadline=None)
@given(
    st.integers(1, 5),
    st.integers(1, 5),
    st.sampled_from(WRAPS),
    st.sampled_from(WRAPS),
    st.sampled_from(["bilinear", "nearest"]),
    st.integers(0, 2**32 - 1),
)
def test_lookup_equals_the_formula(width, height, wrap_u, wrap_v, filter, seed):
    rng = np.random.default_rng(seed)
    image = rng.random((height, width, 3), np.float32)
    points = rng.uniform(-2.3, 3.3, (2, 20)).astype(np.float32)
    texture = Texture(image, wrap=(wrap_u, wrap_v), filter=filter)
    found = texture.lookup(points)
    assert found.dtype == np.float32
    assert found.shape == (3, 20)
    # stay clear of texel borders, where rounding may choose either side
    inner = np.ones(20, bool)
    if filter == "nearest":
        cell = points * np.array([[width], [height]])
        inner = (np.abs(cell - np.round(cell)) > 1e-4).all(axis=0)
    expected = [reference(image, u, v, (wrap_u, wrap_v), filter) for u, v in points.T.astype(float)]
    assert_near(found.T[inner], np.array(expected)[inner], abs=2e-5)


def test_the_top_row_is_at_v_1():
    image = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 1]]], np.float32)
    corners = uv((0.25, 0.75), (0.75, 0.75), (0.25, 0.25), (0.75, 0.25))
    for filter in ("nearest", "bilinear"):
        assert np.array_equal(Texture(image, filter=filter).lookup(corners).T, image.reshape(4, 3))


def test_colors_are_decoded_before_they_are_mixed():
    image = np.array([[[0, 0, 0], [255, 255, 255]]], np.uint8)
    middle = uv((0.5, 0.5))
    assert Texture(image).lookup(middle).ravel() == pytest.approx([0.5] * 3)
    image = np.full((1, 1, 3), 188, np.uint8)
    assert Texture(image).lookup(middle)[0, 0] == pytest.approx(float(srgb_to_linear(np.float32(188 / 255))))
    assert Texture(image, srgb=False).lookup(middle)[0, 0] == pytest.approx(188 / 255)
    deep = np.full((1, 1, 3), 188 * 257, np.uint16)
    assert np.array_equal(Texture(deep).lookup(middle), Texture(image).lookup(middle))
    assert Texture(np.full((1, 1, 3), 0.7, np.float32)).lookup(middle)[0, 0] == np.float32(0.7)


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_channels(channels):
    codes = np.arange(10, 10 + channels, dtype=np.uint8).reshape(1, 1, channels)
    middle = uv((0.5, 0.5))
    linear = srgb_to_linear(codes.ravel() / np.float32(255))
    color = linear[:3] if channels >= 3 else linear[[0, 0, 0]]
    assert np.array_equal(Texture(codes).lookup(middle)[:, 0], color)
    for k in range(channels):
        found = Texture(codes, channel=k).lookup(middle)
        assert found.shape == (1,)
        alpha = channels in (2, 4) and k == channels - 1
        assert found[0] == pytest.approx(codes[0, 0, k] / 255 if alpha else linear[k])
    gray = Texture(codes, channel="luminance").lookup(middle)
    assert gray == pytest.approx([color @ [0.2126, 0.7152, 0.0722]])


def test_scale_and_offset():
    image = np.full((1, 1, 3), 0.5, np.float32)
    middle = uv((0.5, 0.5))
    assert Texture(image, scale=[1, 0.5, 0], offset=0.25).lookup(middle).ravel().tolist() == [0.75, 0.5, 0.25]
    assert Texture(image, channel=1, scale=2, offset=-0.5).lookup(middle).tolist() == [0.5]


def test_transform_moves_the_coordinates():
    image = np.random.default_rng(0).random((4, 4, 3), np.float32)
    matrix = np.array([[0, -2, 0.3], [2, 0, 0.1], [0, 0, 1]])
    points = np.random.default_rng(1).random((2, 30), np.float32)
    moved = (matrix @ np.vstack([points, np.ones(30)]))[:2].astype(np.float32)
    assert Texture(image, transform=matrix).lookup(points) == pytest.approx(
        Texture(image).lookup(moved), abs=1e-5
    )


def test_mean_is_the_average_of_linear_values():
    codes = np.random.default_rng(0).integers(0, 256, (7, 5, 3), np.uint8)
    linear = srgb_to_linear(codes / np.float32(255))
    assert Texture(codes).mean() == pytest.approx(linear.mean((0, 1)))
    assert Texture(codes, channel=1, scale=3).mean() == pytest.approx(3 * linear[..., 1].mean())


def test_a_lookup_does_not_depend_on_its_neighbors():
    image = np.random.default_rng(0).integers(0, 256, (16, 16, 3), np.uint8)
    points = np.random.default_rng(1).random((2, 1000), np.float32) * 3
    texture = Texture(image, transform=np.diag([2.0, 3, 1]))
    whole = texture.lookup(points)
    pieces = [texture.lookup(points[:, a:b]) for a, b in ((0, 1), (1, 8), (8, 333), (333, 1000))]
    assert np.array_equal(whole, np.concatenate(pieces, axis=1))


def test_from_a_file(tmp_path):
    codes = np.random.default_rng(0).integers(0, 256, (3, 4, 3), np.uint8)
    iio.imwrite(tmp_path / "a.png", codes)
    points = np.random.default_rng(1).random((2, 50), np.float32)
    texture = Texture(tmp_path / "a.png")
    assert np.array_equal(texture.lookup(points), Texture(codes).lookup(points))
    assert repr(texture) == "<Texture 'a.png': 4 × 3>"


@pytest.mark.parametrize(
    ("source", "arguments", "message"),
    [
        (np.zeros((2, 2, 5)), {}, r"Texture source is float64 of shape \(2, 2, 5\)"),
        (np.zeros(3), {}, r"of shape \(3,\)"),
        (np.zeros((0, 2, 3)), {}, "at least one"),
        (np.zeros((2, 2), np.int64), {}, "is int64; it must be uint8, uint16 or float"),
        (np.array([[0, np.nan]]), {}, "has 1 value that is not finite, first: row 0, column 1"),
        (np.array([["a"]]), {}, "it must be"),
        (np.zeros((2, 2)), {"wrap": "border"}, "wrap is 'border'; it must be one of repeat, mirror, clamp"),
        (np.zeros((2, 2)), {"wrap": ("clamp",)}, "it must be one mode"),
        (np.zeros((2, 2)), {"filter": "cubic"}, "filter is 'cubic'; it must be one of bilinear, nearest"),
        (np.zeros((2, 2)), {"transform": np.eye(2)}, r"transform must have shape \(3, 3\)"),
        (np.zeros((2, 2)), {"channel": 1}, "channel is 1; texture 'array' has the channels 0 to 0"),
        (np.zeros((2, 2)), {"channel": "red"}, "channel is 'red'"),
        (np.zeros((2, 2)), {"scale": np.nan}, "scale is nan|scale.*finite"),
        (np.zeros((2, 2)), {"channel": 0, "scale": [1, 2, 3]}, "with a channel it must be one number"),
        (np.zeros((1, 1)), {"scale": -1e39}, r"scale is -1e\+39; its size must be at most 3\.4e\+38"),
        (np.zeros((1, 1)), {"offset": -1e39}, r"offset is -1e\+39; its size must be at most 3\.4e\+38"),
        ("no.png", {}, r"no\.png: there is no such file"),
    ],
)
def test_complaints(source, arguments, message):
    with pytest.raises(SceneError, match=message):
        Texture(source, **arguments)
