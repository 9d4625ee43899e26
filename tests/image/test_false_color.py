"""Luminance of pictures, and false color with a scale in cd/m²."""

import numpy as np
import pytest
from matplotlib import pyplot

import wavefront as wf

RGB = np.float32([[[1, 1, 1], [0, 2, 0]], [[0, 0, 0], [0.5, 0, 10]]])
LUMINANCE = 683 * np.array([[1, 2 * 0.7152], [0, 0.5 * 0.2126 + 10 * 0.0722]])


pytestmark = pytest.mark.usefixtures("closed_figures")


def test_luminance() -> None:
    image = wf.Image(RGB)
    assert image.luminance.dtype == np.float32
    assert image.luminance == pytest.approx(LUMINANCE, rel=1e-6)
    lit = wf.render(
        [wf.Sphere((0, 0, 0), 9, emission=wf.from_photometric(250))], spp=2, size=(4, 4), view="top"
    )
    assert lit.luminance.max() == pytest.approx(250, rel=1e-5)


@pytest.mark.parametrize("log", [True, False])
@pytest.mark.parametrize("efficacy", [683, 179])
def test_false_color(log: bool, efficacy: float) -> None:
    axes = wf.Image(RGB).false_color((1, 2000), log=log, efficacy=efficacy)
    axes.figure.canvas.draw()
    shown, scale = axes.images[0].get_array(), axes.images[0].norm
    assert np.asarray(shown) == pytest.approx(np.maximum(LUMINANCE * efficacy / 683, 1), rel=1e-5)
    assert (scale.vmin, scale.vmax) == (1, 2000)
    assert scale(np.sqrt(2000)) == pytest.approx(0.5 if log else (np.sqrt(2000) - 1) / 1999)
    assert axes.figure.axes[1].get_ylabel() == "cd/m²"


def test_limits_by_default() -> None:
    bright = LUMINANCE.max()
    assert wf.Image(RGB).false_color().images[0].get_clim() == pytest.approx(
        (bright / 1000, bright), rel=1e-5
    )
    assert wf.Image(RGB).false_color(log=False).images[0].get_clim() == pytest.approx((0, bright), rel=1e-5)
    assert wf.Image(0 * RGB).false_color().images[0].get_clim() == pytest.approx((1e-3, 1))
    _, axes = pyplot.subplots()
    assert wf.Image(RGB).false_color(axes=axes) is axes


@pytest.mark.parametrize("limits", [(2, 1), (0, 1), (1, 1), (float("nan"), 1), ("a", 1)])
def test_bad_limits_are_named(limits) -> None:
    with pytest.raises(wf.SceneError, match="false_color limit"):
        wf.Image(RGB).false_color(limits)
