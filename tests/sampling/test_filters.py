"""Reconstruction filters: how samples are spread over a pixel, and what that does to an edge."""

import math
import pickle
from typing import Any

import numpy as np
import pytest
from inside import FILTERS, f4
from significance import render

import wavefront as wf

OWN: dict[str, Any] = {  # those of Mitsuba and pbrt among them
    "box": wf.BoxFilter(),
    "tent": wf.TentFilter(),
    "gaussian": wf.GaussianFilter(),
    "small box": wf.BoxFilter(0.25),
    "tent of pbrt": wf.TentFilter(2.0),
    "wide gaussian": wf.GaussianFilter(2.0, 0.75),
    "gaussian of mitsuba": wf.GaussianFilter(2.0, windowed=True),
    "gaussian of pbrt": wf.GaussianFilter(windowed=True),
    "parabola": wf.GaussianFilter(1.0, 16.0, windowed=True),
}


def beyond(name: str, x: float) -> float:
    """Exact part of the samples of a pixel that lie further than x pixels to one side of its center."""
    filter = OWN[name]
    reach = filter.radius
    x = min(max(x, -reach), reach)
    if isinstance(filter, wf.BoxFilter):
        return 0.5 - 0.5 * x / reach
    if isinstance(filter, wf.TentFilter):
        side = (1 - abs(x) / reach) ** 2 / 2
        return side if x > 0 else 1 - side
    scale = filter.stddev * math.sqrt(2)
    lower = math.exp(-((reach / scale) ** 2)) * 2 / (scale * math.sqrt(math.pi)) if filter.windowed else 0
    below, whole = (math.erf(each / scale) - lower * each for each in (x, reach))
    return 0.5 - 0.5 * below / whole


@pytest.mark.parametrize("name", OWN)
def test_offsets_have_the_density(name: str) -> None:
    """Stay within reach, lie around the pixel's center, and follow the distribution, in x and y."""
    filter = FILTERS.get(name, OWN[name])
    u = (np.arange(4096, dtype=f4) + f4(0.5)) / f4(4096)
    for row, other in ((0, 1), (1, 0)):
        pair = np.full((2, u.size), 0.5, f4)
        pair[row] = u
        offset = filter(pair)
        assert offset.dtype == f4
        assert offset[other] == pytest.approx(0.5, abs=1e-6)
        assert np.abs(offset[row] - 0.5).max() <= OWN[name].radius
        for x in np.linspace(-1.9, 1.9, 20):
            assert (offset[row] - 0.5 > x).mean() == pytest.approx(beyond(name, x), abs=1e-3)


def edge(up: tuple[float, float, float]) -> wf.Scene:
    """A shining half-plane whose edge runs through the middle of the picture, 8 × 8 pixels of size 1."""
    light = wf.Rectangle((0, -9, 0), (9, 0, 0), (0, 18, 0), emission=1.0, material=wf.Diffuse(0))
    fov = 2 * math.degrees(math.atan(4 / 10))
    return wf.Scene([light], camera=wf.Camera.look_at((0, 0, 10), (0, 0, 0), up, fov=fov, size=(8, 8)))


@pytest.mark.parametrize("sampler", ["sobol", "bluenoise"])
@pytest.mark.parametrize("up", [(0, 1, 0), (1, 0, 0)])
@pytest.mark.parametrize("name", FILTERS)
def test_an_edge_is_blurred_by_the_filter(name: str, up: tuple[float, float, float], sampler: str) -> None:
    """Each row of pixels beside the edge sees as much light as the filter has beyond it."""
    image = render(edge(up), 256, filter=name, max_bounces=0, sampler=sampler)
    profile = image.rgb.mean((0, 2)) if up[1] else image.rgb.mean((1, 2))[::-1]
    expected = [beyond(name, 3.5 - k) for k in range(8)]
    assert profile == pytest.approx(expected, abs=2e-3)


def test_each_filter_is_its_own_picture() -> None:
    scene = edge((0, 1, 0))
    pictures = {name: render(scene, 16, filter=name).rgb.tobytes() for name in FILTERS}
    assert pictures["box"] == render(scene, 16).rgb.tobytes()
    assert len(set(pictures.values())) == 3
    assert pictures["tent"] == render(scene, 16, filter=wf.TentFilter()).rgb.tobytes()
    assert pictures["gaussian"] == render(scene, 16, filter=wf.GaussianFilter()).rgb.tobytes()
    assert render(scene, 1, filter="tent").metadata["filter"] == "tent"
    known = render(scene, 1, filter=wf.TentFilter(1.25)).metadata["filter"]
    assert known == "TentFilter(radius=1.25)"


def test_filters_travel_to_processes() -> None:
    assert pickle.loads(pickle.dumps(OWN)) == OWN


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: wf.BoxFilter(0), "BoxFilter radius is 0; it must be above 0 and at most 64 pixels"),
        (lambda: wf.TentFilter(65), "TentFilter radius is 65"),
        (lambda: wf.GaussianFilter(-1), "GaussianFilter radius is -1"),
        (
            lambda: wf.GaussianFilter(stddev=0),
            "GaussianFilter stddev is 0; it must be above 0 and at most 24",
        ),
        (lambda: wf.GaussianFilter(1, 17), "GaussianFilter stddev is 17; .*16 times the radius"),
    ],
)
def test_malformed_filters_are_refused(make: Any, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        make()


def test_unknown_filters_are_named() -> None:
    with pytest.raises(wf.SceneError, match="filter is 'lanczos'; it must be one of box, tent, gaussian"):
        render(edge((0, 1, 0)), 1, filter="lanczos")
