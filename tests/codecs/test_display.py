"""From radiance to codes: tone curves, white balance, and one set of settings for all ways to show it."""

import hashlib

import numpy as np
import pytest
from inside import (
    AGX_IN,
    AGX_OUT,
    NEUTRAL,
    TONES,
    XYZ_OF_RGB,
    aces,
    agx,
    agx_punchy,
    reinhard,
    white_balance_matrix,
)
from pictures import with_everything

import wavefront as wf

CURVES = {"reinhard": reinhard, "aces": aces, "agx": agx, "agx_punchy": agx_punchy}
SETTINGS = [
    {},
    {"gamma": "srgb", "tone": "agx"},
    {"gamma": 1.8, "exposure": 1.5, "tone": "aces", "white_balance": 3200},
    {"tone": "reinhard", "white_balance": (0.5, 0.4, 0.3)},
]


@pytest.fixture
def image():
    """A picture from black to far above white, with gray and colors."""
    rng = np.random.default_rng(0)
    rgb = (rng.random((16, 16, 3)) ** 3 * 20).astype(np.float32)
    rgb[0] = 0
    rgb[1] = np.geomspace(1e-4, 1e4, 16)[:, None]
    return wf.Image(rgb)


def gray(values):
    return np.repeat(np.asarray(values, np.float64)[..., None], 3, axis=-1)


def test_the_names_of_curves():
    assert set(TONES) == {"none", *CURVES}
    with pytest.raises(
        wf.SceneError, match=r"tone is 'filmic'; it must be one of none, reinhard, aces, agx, agx_punchy"
    ):
        wf.Image(np.ones((1, 1, 3), np.float32)).to_uint8(tone="filmic")


@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES)
def test_curves_rise_from_black_to_white(curve):
    """Gray stays gray within the rounding of the matrices, and no value leaves [0, 1]."""
    shown = curve(gray(np.geomspace(1e-5, 1e6, 500)))
    assert (np.diff(shown.mean(-1)) >= -1e-6).all()
    assert shown.min() >= 0
    assert shown.max() <= 1
    assert np.ptp(shown, axis=-1).max() < 1e-3  # a fourth of a code of 8 bits
    assert shown[0].max() < 2e-3
    assert shown[-1].min() > 0.95
    assert (curve(np.zeros((1, 3))) < 2e-3).all()
    odd = np.array([[np.nan, -5, 1], [np.inf, np.inf, np.inf], [-np.inf, 0, 1e38]])
    assert np.isfinite(curve(odd)).all()
    assert curve(odd)[1].min() > 0.95


def test_reinhard_by_hand():
    assert reinhard(gray([1.0, 3.0])) == pytest.approx(gray([0.5, 0.75]))
    assert reinhard(np.array([2.0, 0, 0])) == pytest.approx([1, 0, 0])  # 2/(1 + 0.4252), clipped
    assert reinhard(np.array([0.5, 0, 0])) == pytest.approx([0.5 / (1 + 0.1063), 0, 0])


def test_aces_by_hand():
    """The curve of 0.18 and of 1, whose rows of both matrices sum to 1 for gray."""
    for x in (0.18, 1.0):
        expected = (x * (x + 0.0245786) - 0.000090537) / (x * (0.983729 * x + 0.4329510) + 0.238081)
        assert aces(gray([x])) == pytest.approx(gray([expected]), abs=2e-4)


def test_agx_by_hand():
    """Middle gray, the ends of the range, and matrices that undo each other."""
    stops = (np.log2(0.18) + 12.47393) / 16.5
    powers = stops ** np.arange(6, -1, -1)
    value = float(np.dot([15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232], powers))
    assert agx(gray([0.18])) == pytest.approx(gray([value**2.2]), abs=1e-4)
    assert 0.16 < agx(gray([0.18])).mean() < 0.24
    assert agx(gray([2.0**4.026069])) == pytest.approx(agx(gray([1e9])), abs=1e-4)
    published = [  # the outset of the source, by rows
        [1.19687900512017, -0.0980208811401368, -0.0990297440797205],
        [-0.0528968517574562, 1.15190312990417, -0.0989611768448433],
        [-0.0529716355144438, -0.0980434501171241, 1.15107367264116],
    ]
    assert pytest.approx(np.asarray(published), abs=1e-12) == AGX_OUT
    assert AGX_IN.sum(1) == pytest.approx(1, abs=2e-4)


def test_a_gray_thing_becomes_gray_of_the_same_luminance():
    color = np.array([0.5, 0.4, 0.2])
    shown = white_balance_matrix(color) @ color
    luminance = XYZ_OF_RGB[1] @ color
    assert shown == pytest.approx(np.full(3, luminance / XYZ_OF_RGB[1].sum()), abs=1e-3)
    assert np.ptp(shown) < 1e-6


def test_the_bradford_matrix_of_illuminant_a():
    """From A to D65, as B. Lindbloom's page on chromatic adaptation lists it."""
    published = [
        [0.8446965, -0.1179225, 0.3948108],
        [-0.1366303, 1.1041226, 0.1291718],
        [0.0798489, -0.1348999, 3.1924009],
    ]
    color = np.linalg.inv(XYZ_OF_RGB) @ [1.09850, 1, 0.35585]
    found = XYZ_OF_RGB @ white_balance_matrix(color) @ np.linalg.inv(XYZ_OF_RGB)
    assert found == pytest.approx(np.array(published), abs=2e-4)


def test_kelvin():
    """6504 changes nothing. Light of a lamp becomes white, so a picture gets bluer."""
    assert white_balance_matrix(NEUTRAL) == pytest.approx(np.eye(3), abs=1e-12)
    for kelvin, xy in ((2856, (0.44758, 0.40745)), (1800, (0.5493, 0.4082)), (10000, (0.2807, 0.2884))):
        # the chromaticity of CIE illuminant A and of black bodies, G. Wyszecki and W. Stiles, Color Science
        x, y = xy
        light = np.linalg.inv(XYZ_OF_RGB) @ [x / y, 1, (1 - x - y) / y]
        shown = white_balance_matrix(kelvin) @ light
        assert shown == pytest.approx(shown.mean(), rel=0.04)
    warm, cold = (white_balance_matrix(k) @ np.ones(3) for k in (3000, 12000))
    assert warm[2] > 1.5 > 1 > warm[0]
    assert cold[2] < 1 < cold[0]
    steps = [white_balance_matrix(k) for k in (2221.9, 2222.1, 3999.9, 4000.1)]
    assert steps[0] == pytest.approx(steps[1], abs=2e-3)
    assert steps[2] == pytest.approx(steps[3], abs=2e-3)


@pytest.mark.parametrize(
    ("white", "message"),
    [
        (1000, "white_balance is 1000; it must be 1667 to 25000 kelvin, or a linear RGB"),
        ("warm", "white_balance must be a number"),
        ((1, 2), r"white_balance must have shape \(3,\)"),
        ((1, 0, 1), "each component must be above 0"),
        ((1, -1, 1), r"white_balance\[1\] is -1"),
        ((1, np.nan, 1), r"white_balance\[1\] is nan"),
    ],
)
def test_wrong_whites_are_named(image, white, message):
    with pytest.raises(wf.SceneError, match=message):
        image.to_uint8(white_balance=white)


@pytest.mark.parametrize("settings", SETTINGS)
@pytest.mark.parametrize("transparent", [False, True])
def test_all_ways_to_show_a_picture_agree(tmp_path, image, settings, transparent):
    if transparent:
        image = with_everything()
    codes = image.to_uint8(**settings)
    assert (np.asarray(image.to_pil(**settings)) == codes).all()
    from PIL import Image as PillowImage

    image.save(tmp_path / "a.png", **settings)
    with PillowImage.open(tmp_path / "a.png") as file:
        assert (np.asarray(file) == codes).all()
    deep = image.to_uint16(**settings)
    assert deep.dtype == np.uint16
    assert np.abs(deep / 257 - codes).max() <= 0.501


def test_a_picture_without_a_tone_is_what_it_was(image):
    """The bits are those before there were tone curves."""
    found = [image.to_uint8(), image.to_uint8("srgb"), image.to_uint8(1.8, -1.5)]
    hashes = [hashlib.sha256(codes.tobytes()).hexdigest()[:16] for codes in found]
    assert hashes == ["3ad4df8350b0bd4a", "3aa582e4564d4fc0", "22586025fdfa6209"]


def test_white_balance_in_linear_files(tmp_path, image):
    """As in display, but for the clipping."""
    white = (0.9, 0.7, 0.5)
    for name in ("a.exr", "a.npy", "a.npz"):
        image.save(tmp_path / name, exposure=1, white_balance=white)
        found = wf.Image.load(tmp_path / name).rgb
        expected = 2 * image.rgb.astype(np.float64) @ white_balance_matrix(white).T
        assert found == pytest.approx(expected, rel=1e-5, abs=1e-5)
        assert (wf.Image(found).to_uint8() == image.to_uint8(exposure=1, white_balance=white)).all()


def test_show_uses_the_viewer_of_the_system(image, calls_of):
    shown = calls_of("PIL.Image.Image.show", np.asarray)
    image.show(tone="agx", exposure=1)
    assert (shown[0].result == image.to_uint8(tone="agx", exposure=1)).all()


def test_show_in_a_notebook(image, monkeypatch):
    import sys
    from types import ModuleType

    shown = []
    ipython, display = ModuleType("IPython"), ModuleType("IPython.display")
    ipython.get_ipython, display.display = lambda: object(), shown.append
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    image.show()
    assert (np.asarray(shown[0]) == image.to_uint8()).all()


def test_punchy_is_agx_with_more_contrast_and_color():
    """By the formula of its look, on codes that the plain curve gives."""
    rgb = np.array([[[0.6, 0.1, 0.05], [0.18, 0.18, 0.18], [3.0, 2.0, 0.4]]])
    codes = (agx(rgb) ** (1 / 2.2)) @ np.array(AGX_IN).T
    steep = codes**1.35
    luminance = steep @ np.array([0.2126, 0.7152, 0.0722])
    mixed = luminance[..., None] + 1.4 * (steep - luminance[..., None])
    expected = np.clip(mixed @ np.array(AGX_OUT).T, 0, 1) ** 2.2
    np.testing.assert_allclose(agx_punchy(rgb), expected, atol=1e-6)
