"""Image.plot: layers drawn with matplotlib."""

import subprocess
import sys

import numpy as np
import pytest
from inside import id_colors
from matplotlib import pyplot
from pictures import with_everything

import wavefront as wf

pytestmark = pytest.mark.usefixtures("closed_figures")


def drawn(axes):
    """Return what the axes show, and how many axes the figure has."""
    axes.figure.canvas.draw()
    return np.ma.filled(axes.images[0].get_array(), np.nan), len(axes.figure.axes)


def test_scalars_have_a_color_bar():
    image = with_everything()
    values, count = drawn(image.plot("depth"))
    assert np.array_equal(values, image.depth, equal_nan=True)
    assert count == 2
    values, count = drawn(image.plot("luminance"))
    assert values == pytest.approx(683 * image.rgb @ np.float32([0.2126, 0.7152, 0.0722]), rel=1e-5, abs=1e-7)
    assert count == 2
    assert drawn(image.plot("counts"))[1] == 2
    assert drawn(image.plot("coverage.a.b"))[1] == 2
    assert drawn(image.plot("error.alpha"))[1] == 2


def test_colors_are_those_of_the_display():
    image = with_everything(None)
    values, count = drawn(image.plot())
    assert (values == image.to_uint8()).all()
    assert count == 1
    group = drawn(image.plot("light_groups.kéy light"))[0]
    assert (group == wf.Image(image.layers["light_groups.kéy light"]).to_uint8()).all()


def test_vectors_become_colors():
    image = with_everything()
    assert drawn(image.plot("normal"))[0] == pytest.approx((image.normal + 1) / 2, abs=1e-6)
    assert drawn(image.plot("uv"))[0][..., :2] == pytest.approx(image.uv, abs=1e-6)
    position = np.full((2, 3, 3), np.nan, np.float32)
    missed = wf.Image(position * 0, layers={"position": position})
    assert (drawn(missed.plot("position"))[0] > 0.8).all()
    position[0] = [[-5, 0, 7], [5, 10, 7], [0, 5, 7]]
    shown = drawn(missed.plot("position"))[0]
    assert shown[0] == pytest.approx(np.float32([[0, 0, 0], [1, 1, 0], [0.5, 0.5, 0]]))


def test_ids_have_distinct_colors_and_names():
    image = with_everything()
    axes = image.plot("shape_id")
    values, count = drawn(axes)
    assert count == 1
    colors = {tuple(color) for color in values.reshape(-1, 3)}
    assert len(colors) == len(np.unique(image.shape_id))
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["ball", "floor ü", "c"]
    many = id_colors(np.arange(60))
    far = np.abs(many[:, None] - many[None]).max(-1)[~np.eye(60, dtype=bool)]
    assert far.min() > 0.05
    assert np.ptp(id_colors(np.array(-1))) == 0


def test_a_layer_goes_into_given_axes():
    _, (left, right) = pyplot.subplots(1, 2)
    image = with_everything()
    assert image.plot("normal", right) is right
    assert len(right.images) == 1
    assert not left.images


def test_unknown_layers_are_named():
    with pytest.raises(wf.SceneError, match=r"layer is 'dept'; it must be one of rgb, counts,.*'depth'"):
        with_everything().plot("dept")


def test_layers_that_were_not_rendered_say_how_to_get_them():
    with pytest.raises(wf.SceneError, match=r"no layer 'depth'; render it with aovs=\('depth',\)"):
        wf.Image(np.zeros((2, 2, 3), np.float32)).plot("depth")


def test_without_matplotlib_the_error_says_what_to_install():
    code = (
        "import sys, numpy as np, wavefront as wf\n"
        "assert 'matplotlib' not in sys.modules\n"
        "sys.modules['matplotlib'] = None\n"
        "try:\n    wf.Image(np.ones((2, 2, 3), np.float32)).plot()\n"
        "except ImportError as error:\n    print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "plotting needs matplotlib: pip install matplotlib\n"
