"""Reconstruction filters: how samples are spread over a pixel, and what that does to an edge."""

import math

import numpy as np
import pytest
from significance import render

import wavefront as wf
from wavefront.arrays.vec import f4
from wavefront.sampling.filters import FILTERS, GAUSSIAN_RADIUS, GAUSSIAN_SIGMA, TENT_RADIUS

REACH = {"box": 0.5, "tent": TENT_RADIUS, "gaussian": GAUSSIAN_RADIUS}


def beyond(name: str, x: float) -> float:
    """Exact part of the samples of a pixel that lie further than x pixels to one side of its center."""
    x = min(max(x, -REACH[name]), REACH[name])
    if name == "box":
        return 0.5 - x
    if name == "tent":
        return (1 - abs(x)) ** 2 / 2 if x > 0 else 1 - (1 - abs(x)) ** 2 / 2
    back_facing = math.erf(GAUSSIAN_RADIUS / (GAUSSIAN_SIGMA * math.sqrt(2)))
    return 0.5 - 0.5 * math.erf(x / (GAUSSIAN_SIGMA * math.sqrt(2))) / back_facing


@pytest.mark.parametrize("name", FILTERS)
def test_offsets_have_the_density(name: str) -> None:
    """Stay within reach, lie around the pixel's center, and follow the distribution, in x and y."""
    u = (np.arange(4096, dtype=f4) + f4(0.5)) / f4(4096)
    for row, other in ((0, 1), (1, 0)):
        pair = np.full((2, u.size), 0.5, f4)
        pair[row] = u
        offset = FILTERS[name](pair)
        assert offset.dtype == f4
        assert offset[other] == pytest.approx(0.5, abs=1e-6)
        assert np.abs(offset[row] - 0.5).max() <= REACH[name]
        for x in np.linspace(-1.4, 1.4, 15):
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
    assert render(scene, 1, filter="tent").metadata["filter"] == "tent"


def test_unknown_filters_are_named() -> None:
    with pytest.raises(wf.SceneError, match="filter is 'lanczos'; it must be one of box, tent, gaussian"):
        render(edge((0, 1, 0)), 1, filter="lanczos")
