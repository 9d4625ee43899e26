"""Colors as people write them, and materials by name."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from inside import NAMED_MATERIALS, SETTINGS, Settings, colormaps

import wavefront as wf
from wavefront import cli

ORANGE = [1, 0.2462013, 0]  # ((136/255 + 0.055)/1.055)^2.4 of #ff8800
CORNERS, FACES = [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]


@pytest.mark.parametrize(
    "taken",
    [
        lambda color: wf.Diffuse(color).reflectance,
        lambda color: wf.Principled(color).base_color,
        lambda color: wf.Material(wf.Diffuse(0), emission=color).emission,
        lambda color: wf.Sphere((0, 0, 0), 1, emission=color).emission,
        lambda color: wf.Mesh(CORNERS, FACES, emission=color).emission,
        lambda color: wf.Environment(color).radiance,
        lambda color: wf.PointLight((0, 0, 0), color).intensity,
        lambda color: wf.PointLights([(0, 0, 0)], color).intensities,
        lambda color: wf.DirectionalLight((0, 0, 1), color).irradiance,
        lambda color: wf.VertexColors(times=color).times,
        lambda color: Settings(background=color).values["background"],
        lambda color: wf.Mesh(CORNERS, FACES, colors=[color] * 3).colors[2, :3],  # type: ignore[index]
    ],
)
def test_colors_are_written_as_names_and_digits(taken: Any) -> None:
    """Wherever a color is taken; they are sRGB, and are decoded."""
    assert np.ravel(taken("#ff8800")) == pytest.approx(ORANGE, abs=1e-6)
    assert np.ravel(taken("#F80")) == pytest.approx(ORANGE, abs=1e-6)
    assert np.ravel(taken("Dark Orange")) == pytest.approx([1, 0.26225, 0], abs=1e-5)


@pytest.mark.parametrize("color", ["rde", "#ff", "#gg0000", "", "#ff8800ff"])
def test_unknown_colors_are_an_error(color: str) -> None:
    with pytest.raises(wf.SceneError, match=r'Diffuse reflectance is .*"red", "#rgb" or "#rrggbb"'):
        wf.Diffuse(color)
    with pytest.raises(wf.SceneError, match=r"nearest names are 'steelblue', .*'slateblue'"):
        wf.Diffuse("stealblue")
    with pytest.raises(wf.SceneError, match=r"colors\[1\] is 'bleu'.*'blue'"):
        wf.Spheres(CORNERS, 1, ["red", "bleu", "green"])


def test_a_background_and_an_environment_by_name() -> None:
    """ "transparent" is none; what is no color is a file."""
    image = wf.render([wf.Sphere((0, 0, 0), 1), wf.Environment(1)], 1, size=(8, 8), background="#ff8800")
    assert image.rgb[0, 0] == pytest.approx(ORANGE, abs=1e-6)
    with pytest.raises(wf.SceneError, match=r"background is 'whit', .* 'white', .* or 'transparent'"):
        Settings(background="whit")
    with pytest.raises(wf.SceneError, match=r"sky\.exr"):
        wf.Environment("sky.exr")


def test_srgb_decodes_numbers_codes_and_names() -> None:
    half = ((0.5 + 0.055) / 1.055) ** 2.4
    assert wf.srgb(1, 0.5, 0) == pytest.approx([1, half, 0])
    assert wf.srgb(0.5) == pytest.approx([half] * 3)
    assert wf.srgb("#f80") == pytest.approx(ORANGE)
    assert wf.srgb(["#f80", "black"]) == pytest.approx(np.array([ORANGE, [0, 0, 0]]))
    codes = wf.srgb(np.array([[[255, 136, 0, 51]]], np.uint8))
    assert codes.dtype == np.float32
    assert codes.ravel() == pytest.approx([*ORANGE, 0.2])
    assert wf.srgb(np.full((2, 3, 4), 0.5))[1, 2] == pytest.approx([half, half, half, 0.5])
    for bad, message in (
        ((255, 136, 0), r"srgb color\[0\] is 255; it must be in \[0, 1\].*uint8"),
        ((np.zeros((3, 5)),), r"must have shape \(\.\.\., 3\) or \(\.\.\., 4\), got \(3, 5\)"),
        ((1, 2), "takes three numbers or one array, got 2 values"),
        ((np.nan,), "must be finite"),
        (("orang",), "nearest names are 'orange'"),
    ):
        with pytest.raises(wf.SceneError, match=message):
            wf.srgb(*bad)


class Map:
    """A colormap with three entries."""

    N = 3

    def __call__(self, index: Any) -> Any:
        """Return RGBA."""
        return np.array([[0.25, 0.5, 0.75, 1], [0.3, 0.6, 0.9, 1], [1, 1, 1, 1]])[index]


@pytest.fixture
def maps(monkeypatch: pytest.MonkeyPatch) -> Iterator[Map]:
    """A stand-in for matplotlib, with one map."""
    module: Any = ModuleType("matplotlib")
    module.colormaps = {"three": Map()}
    monkeypatch.setitem(sys.modules, "matplotlib", module)
    monkeypatch.setitem(sys.modules, "matplotlib.colors", SimpleNamespace())
    colormaps._tables.cache_clear()
    yield module.colormaps["three"]
    colormaps._tables.cache_clear()


def test_colors_of_a_colormap_give_a_hint(maps: Map) -> None:
    colors = maps(np.array([0, 1, 2, 1]))
    for given in (colors, colors[:, :3], colors.astype(np.float32)):
        with pytest.warns(UserWarning, match=r"matplotlib's colormap 'three', which are sRGB.*wf\.srgb"):
            wf.Spheres(np.zeros((4, 3)), 1, given)


def test_other_colors_give_no_hint(maps: Map) -> None:
    """Decoded ones, others than entries, those that are the same in both, and one color for all."""
    colors = maps(np.array([0, 1, 2]))
    for given in (
        wf.srgb(colors),
        colors + 1e-3 * (colors < 1),
        np.eye(3),
        colors[[0, 0, 2]],
        colors.tolist(),
    ):
        cloud = wf.Spheres(np.zeros((3, 3)), 1, given)
        cloud.placed(np.eye(4))


@pytest.mark.parametrize("name", NAMED_MATERIALS)
def test_materials_by_name(name: str) -> None:
    """Each renders, has its name, and stands in the document and in the help of the command line."""
    image = wf.render(wf.Sphere((0, 0, 0), 1), 1, size=(8, 8), material=name, lighting="cloudy")
    assert np.isfinite(image.rgb).all()
    assert wf.Sphere((0, 0, 0), 1, material=name.upper()).material.name == name
    table = (Path(__file__).parents[2] / "docs" / "materials.md").read_text("utf-8").partition("by name")[2]
    assert name in table.partition("\n## ")[0]
    assert name in str(SETTINGS["material"].option)


def test_named_materials_take_a_color() -> None:
    assert wf.Material.named("plastic", "#f80").bsdf.base_color.ravel() == pytest.approx(ORANGE)  # type: ignore[attr-defined]
    assert wf.Material.named("frosted_glass").bsdf.roughness == pytest.approx(0.3)  # type: ignore[attr-defined]
    for made, message in (
        (lambda: wf.Material.named("gold", "red"), "whose color is its own; those with a color are glass"),
        (lambda: wf.Sphere((0, 0, 0), 1, material="glas"), "must be one of aluminum, .*did you mean 'glass'"),
        (lambda: wf.Material.named("red gold"), "whose color is its own"),
        (lambda: wf.Sphere((0, 0, 0), 1, material=3), r'such as wf\.Diffuse\(0\.5\) or "gold", got 3'),  # type: ignore[arg-type]
    ):
        with pytest.raises(wf.SceneError, match=message):
            made()


def test_named_dielectrics() -> None:
    for name, index in (("water", 1.333), ("diamond", 2.4173), ("BK7", 1.5168), ("fused silica", 1.45846)):
        assert wf.Dielectric.named(name).ior == pytest.approx(index, abs=5e-5)
    tinted = wf.Dielectric.named("Water", 0.2, transmittance=(0.5, 1, 1))
    assert tinted.roughness == pytest.approx(0.2)
    assert tinted.transmittance[0] == 0.5
    with pytest.raises(wf.SceneError, match=r"Dielectric name is 'watr'; it must be one of .*mean 'water'"):
        wf.Dielectric.named("watr")


def test_the_command_line_takes_materials_and_colors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out = tmp_path / "a.off", tmp_path / "a.npz"
    file.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    common = ["render", str(file), "-o", str(out), "--spp", "1", "--size", "16x16", "--quiet"]
    common += ["--lighting", "cloudy", "--aov", "albedo"]

    def albedo(*options: str) -> Any:
        assert cli.main([*common, *options]) == 0
        return wf.Image.load(out).layers["albedo"].max((0, 1))

    assert albedo("--color", "#ff8800") == pytest.approx(ORANGE, abs=1e-3)
    assert albedo("--material", "gold")[2] < albedo("--material", "silver")[2]
    assert albedo("--material", "clay", "--color", "0.1,0.8,0.1") == pytest.approx([0.1, 0.8, 0.1], abs=0.05)
    assert albedo("--background", "red", "--color", "0.5,0.5,0.5") == pytest.approx([0.5] * 3, abs=1e-3)
    for wrong, message in ((["--material", "glod"], "did you mean 'gold'"), (["--color", "rde"], "'red'")):
        with pytest.raises(SystemExit):
            cli.main([*common, *wrong])
        assert message in capsys.readouterr().err
