"""Files of luminaires, written here by the standards: every variant, and what is damaged."""

import random
import warnings
from pathlib import Path

import numpy as np
import pytest
from inside import Photometry, luminaire_texts, parsed_luminaire
from luminaires import GAMMA, SYMMETRIES, intensity, lm63

import wavefront as wf

DOWN, C0, C90 = -np.eye(3)[1], np.eye(3)[0], -np.eye(3)[2]  # of IESLight(..., (0, 0, 0)) in the scene


def read(path) -> Photometry:
    return parsed_luminaire(*luminaire_texts(path))


def eulumdat(symmetry: int, planes, gamma, candela, *, factor="1", flux=(2000,), comma=".") -> str:
    """The text of a file, with the candela (k, rows) of the planes that it has, which become cd/klm."""
    head = ["Maker", 3, symmetry, len(planes), 0, len(gamma), 0, "", "Lamp", "", "", ""]
    head += [100, 100, 0, 90, 90, 0, 0, 0, 0, 100, 100, factor, 0, len(flux)]
    for each in flux:
        head += [1, "LED", each, "", "", 20]
    values = np.asarray(candela).ravel() / (flux[0] / 1000) / float(factor)
    rows = [*[0.5] * 10, *planes, *gamma, *values]
    numbers = [f"{x:.9g}".replace(".", comma) for x in rows]
    return "\r\n".join([*map(str, head), *numbers, ""])


def seen(path, directions, **options):
    """Candela in directions (n, 3) of the scene, at distance 1, by the light itself."""
    light = wf.IESLight(path, (0, 0, 0), **options)
    points = np.asarray(directions, float).T.astype(np.float32)
    sample = light.record(np.zeros(3)).sample_li(points, np.zeros((2, points.shape[1]), np.float32))
    assert np.isfinite(sample.radiance).all()
    return 683 * sample.radiance[1].astype(float) * sample.pdf


def by_c_gamma(c, gamma):
    """Directions (n, 3): counterclockwise seen from above, from straight down."""
    c, gamma = np.radians(c), np.radians(gamma)
    across = np.multiply.outer(np.cos(c), C0) + np.multiply.outer(np.sin(c), C90)
    return np.sin(gamma)[:, None] * across + np.multiply.outer(np.cos(gamma), DOWN)


ANYWHERE = np.random.default_rng(0).uniform((0, 0.5), (360, 179.5), (400, 2)).T


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_symmetries_of_type_c(tmp_path: Path, symmetry: str) -> None:
    planes = np.array(SYMMETRIES[symmetry], float)
    path = tmp_path / "lamp.IES"
    path.write_text(lm63(GAMMA, planes, intensity(symmetry, planes[:, None], GAMMA)))
    assert seen(path, by_c_gamma(*ANYWHERE)) == pytest.approx(intensity(symmetry, *ANYWHERE), rel=1e-3)
    if symmetry == "none":  # the plane at 360° is left out
        planes = np.arange(0, 360, 30.0)
        path.write_text(lm63(GAMMA, planes, intensity(symmetry, planes[:, None], GAMMA)))
        assert seen(path, by_c_gamma(*ANYWHERE)) == pytest.approx(intensity(symmetry, *ANYWHERE), rel=1e-3)


@pytest.mark.parametrize("number", range(5))
def test_symmetries_of_eulumdat(tmp_path: Path, number: int) -> None:
    symmetry = ["none", "axis", "0-180", "90-270", "quadrants"][number]
    planes = np.arange(0, 360, 30.0)
    kept = {0: planes, 1: planes[:1], 2: planes[:7], 3: np.r_[planes[9:], planes[:4]], 4: planes[:4]}[number]
    path = tmp_path / "lamp.ldt"
    for options in ({}, {"factor": "0.8", "comma": ","}, {"flux": (2500,)}):
        path.write_text(eulumdat(number, planes, GAMMA, intensity(symmetry, kept[:, None], GAMMA), **options))
        assert seen(path, by_c_gamma(*ANYWHERE)) == pytest.approx(intensity(symmetry, *ANYWHERE), rel=1e-3)


def test_the_first_of_several_sets_of_lamps_is_lit(tmp_path: Path) -> None:
    path = tmp_path / "lamp.ldt"
    path.write_text(eulumdat(1, [0.0], GAMMA, intensity("axis", 0, GAMMA), flux=(2000, 900)))
    with pytest.warns(UserWarning, match="lamp.ldt: has 2 sets of lamps; the first is lit, with 2000 lm"):
        assert seen(path, [DOWN]) == pytest.approx(intensity("axis", 0, 0))


@pytest.mark.parametrize("kind", [2, 3])
@pytest.mark.parametrize("mirrored", [False, True])
def test_types_a_and_b(tmp_path: Path, kind: int, mirrored: bool) -> None:
    """A: a vertical axis, V from the horizontal. B: the axis along C0, (0, 0) straight down; H clockwise."""
    nodes = np.array([0, 15, 45, 90.0]) if mirrored else np.array([-90, -50, 0, 30, 90.0])

    def candela(h, v):
        h, v = (np.abs(h), np.abs(v)) if mirrored else (h, v)
        return (3 + np.interp(h, nodes, nodes * 0.01 + np.cos(nodes))) * (200 + v)

    path = tmp_path / "flood.ies"
    path.write_text(lm63(nodes, nodes, candela(nodes[:, None], nodes), kind))
    h, v = np.random.default_rng(kind).uniform(-89, 89, (2, 300))
    rh, rv = np.radians(h), np.radians(v)
    if kind == 3:
        x, y, up = np.cos(rv) * np.cos(rh), -np.cos(rv) * np.sin(rh), np.sin(rv)
    else:
        x, y, up = np.sin(rv), -np.cos(rv) * np.sin(rh), -np.cos(rv) * np.cos(rh)
    directions = np.stack([x, y, -up], 1) @ np.stack([C0, C90, DOWN])
    assert seen(path, directions) == pytest.approx(candela(h, v), rel=1e-3)
    behind = -directions if kind == 2 else directions * (1 - 2 * C0**2)
    assert not seen(path, behind).any()


@pytest.mark.parametrize(("low", "high"), [(0, 90), (90, 180), (20, 130)])
def test_it_is_dark_beyond_the_angles_of_the_file(tmp_path: Path, low: float, high: float) -> None:
    path, nodes = tmp_path / "half.ies", GAMMA[(low <= GAMMA) & (high >= GAMMA)]
    path.write_text(lm63(nodes, [0], [intensity("axis", 0, nodes)]))
    c, gamma = ANYWHERE
    within = (gamma >= low) & (gamma <= high)
    expected = np.where(within, intensity("axis", c, gamma), 0)
    assert seen(path, by_c_gamma(c, gamma)) == pytest.approx(expected, rel=1e-3)


FACTOR = {  # the third factor counts in the first two standards only
    "no version": ("Any text", 0.3),
    "1991": ("IESNA91", 0.3),
    "1995": ("IESNA:LM-63-1995", 0.6),
    "2002": ("IESNA:LM-63-2002", 0.6),
    "2019": ("IES:LM-63-2019 ", 0.6),
}


@pytest.mark.parametrize("name", FACTOR)
def test_factors(tmp_path: Path, name: str) -> None:
    version, factor = FACTOR[name]
    path = tmp_path / "lamp.ies"
    options = {"version": version, "multiplier": 2.0, "ballast": "0.3, 0.5"}
    path.write_text(lm63([0, 90], [0], [[50, 50]], **options))
    assert seen(path, [DOWN]) == pytest.approx(factor * 50)
    path.write_bytes(path.read_text().replace("\n", "\r\n").replace("made", "m\xe4de").encode("latin-1"))
    assert seen(path, [DOWN]) == pytest.approx(factor * 50)


def test_tilt(tmp_path: Path) -> None:
    """The lamp's light at the tilt that is given, from a table in the file or beside it."""
    table = "1\n3\n0 60 90\n1.0 0.8\n0.5\n"
    path, beside = tmp_path / "lamp.ies", tmp_path / "LAMP.TLT"
    path.write_text(lm63([0, 90], [0], [[50, 50]], tilt="INCLUDE", included=table))
    beside.write_text(table)
    other = tmp_path / "other.ies"
    other.write_text(lm63([0, 90], [0], [[50, 50]], tilt="LAMP.TLT"))
    for each in (path, other):
        assert seen(each, [DOWN]) == pytest.approx(50)
        assert seen(each, [DOWN], tilt=30) == pytest.approx(45)
        assert seen(each, [DOWN], tilt=75) == pytest.approx(50 * 0.65)
    beside.write_text(table.replace("0.8", "0.4"))
    assert seen(other, [DOWN], tilt=60) == pytest.approx(20)
    beside.unlink()
    with pytest.raises(wf.SceneError, match=r"other\.ies: TILT=LAMP\.TLT: .*: there is no such file"):
        wf.IESLight(other, (0, 0, 0))


PLAIN = lm63([0, 45, 90], [0, 90], np.full((2, 3), 5.0))
BAD = {
    "no tilt": (PLAIN.replace("TILT", "TELT"), r"has no line TILT=\.\.\."),
    "word": (
        PLAIN.replace("45", "4x5"),
        "line 6: vertical angle is '4x5'; it must be a number from 0 to 180",
    ),
    "nan": (PLAIN.replace("45", "nan"), "line 6: vertical angle is 'nan'"),
    "order": (PLAIN.replace("45", "95"), "line 6: vertical angle is 90 after 95; it must increase"),
    "short": (PLAIN[:-3], "line 9: ends within candela value, with 5 of 6 numbers"),
    "negative": (PLAIN.replace("5 5 5", "5 -5 5"), "line 8: candela value is '-5'"),
    "count": (
        PLAIN.replace(" 3 2 1 2 ", " 3.5 2 1 2 "),
        "line 4: number of vertical angles is 3.5; .* whole",
    ),
    "huge": (PLAIN.replace(" 3 2 1 2 ", " 3 900000000 1 2 "), "line 10: ends within horizontal angle"),
    "type": (PLAIN.replace(" 3 2 1 2 ", " 3 2 4 2 "), "line 4: photometric type is '4'"),
    "span": (PLAIN.replace("\n0 90\n", "\n0 91\n"), "horizontal angles are from 0 to 91; they must span"),
    "one plane": (lm63([-90, 90], [0], [[1, 1]], 2), "has one horizontal angle; type B must have two"),
    "tilt": (lm63([0, 90], [0], [[1, 1]], tilt="INCLUDE", included="7\n1\n0\n1\n"), "line 4: lamp-to-lum"),
}


@pytest.mark.parametrize("name", BAD)
def test_errors_name_the_line(tmp_path: Path, name: str) -> None:
    text, message = BAD[name]
    path = tmp_path / "bad.ies"
    path.write_text(text)
    with pytest.raises(wf.SceneError, match="bad.ies.*" + message):
        read(path)


def test_errors_of_eulumdat_name_the_line(tmp_path: Path) -> None:
    path, planes = tmp_path / "bad.ldt", np.arange(0, 360, 90.0)
    good = eulumdat(4, planes, GAMMA, np.ones((2, 7))).split("\r\n")
    for line, value, message in (
        (3, "5", "line 3: symmetry is '5'; it must be a number from 0 to 4"),
        (4, "3", "line 4: number of C-planes is 3; it must be a multiple of 4 with symmetry 4"),
        (6, "", "line 6: ends within number of angles in a plane, with 0 of 1 number"),
        (24, "x", "line 24: conversion factor is 'x'"),
        (45, "400", "line 45: C-plane is '400'"),
    ):
        path.write_text("\n".join([*good[: line - 1], value, *good[line:]]))
        with pytest.raises(wf.SceneError, match="bad.ldt " + message):
            read(path)


def test_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "lamp.txt").write_text(PLAIN)
    with pytest.raises(wf.SceneError, match=r"lamp\.txt: has another extension than \.ies and \.ldt"):
        read(tmp_path / "lamp.txt")
    with pytest.raises(wf.SceneError, match="there is no such file"):
        read(tmp_path / "lamp.ies")


def damaged(text: bytes, rng: random.Random) -> bytes:
    """Some bytes changed, left out or doubled, or words in the place of others."""
    data = bytearray(text)
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(data))
        end = min(at + rng.randint(0, 6), len(data))
        new = [
            b"",
            bytes([rng.randrange(256)]),
            b"-1",
            b"1e400",
            b"nan",
            b" 0 ",
            b"\n",
            b"9999999999",
            b"1e-9",
        ]
        data[at:end] = rng.choice([*new, bytes(data[at:end]) * 2])
    return bytes(data)


@pytest.mark.parametrize("extension", ["ies", "ldt"])
def test_damaged_files_are_refused_or_read(tmp_path: Path, extension: str) -> None:
    rng, refused, path = random.Random(1), [], tmp_path / f"damaged.{extension}"
    planes = np.array(SYMMETRIES["quadrants"], float)
    candela = intensity("quadrants", planes[:, None], GAMMA)
    texts = {
        "ies": [
            lm63(GAMMA, planes, candela),
            lm63([-90, 0, 90], [0, 90], np.ones((2, 3)), 2, tilt="INCLUDE", included="1\n2\n0 90\n1 .5\n"),
        ],
        "ldt": [eulumdat(4, np.arange(0, 360, 30.0), GAMMA, candela)],
    }[extension]
    for _ in range(120):
        path.write_bytes(damaged(rng.choice(texts).encode(), rng))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # of sets of lamps
                light = wf.IESLight(path, (0, 0, 0), tilt=20)
                found = seen(path, by_c_gamma(*ANYWHERE))
        except wf.SceneError as error:
            refused.append(str(error))
        else:
            assert light.lumens >= 0
            assert (found >= 0).all()
    assert 30 < len(refused) < 120
    assert all(str(path) in message for message in refused)


@pytest.mark.parametrize(
    "name", ["/etc/passwd", "../out.tlt", "link.tlt", "file:///etc/passwd", "a/../../out.tlt"]
)
def test_a_table_of_tilt_elsewhere_is_not_read(tmp_path: Path, name: str) -> None:
    home = tmp_path / "home"
    home.mkdir()
    (tmp_path / "out.tlt").write_text("secret")
    (home / "link.tlt").symlink_to(tmp_path / "out.tlt")
    (home / "a.ies").write_text(PLAIN.replace("TILT=NONE", f"TILT={name}"))
    with pytest.raises(
        wf.SceneError, match=r"refers to .*(outside|absolute|only files in its folder)"
    ) as error:
        wf.IESLight(home / "a.ies", (0, 1, 0))
    assert "secret" not in str(error.value)
