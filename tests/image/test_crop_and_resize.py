"""Parts of pictures, pictures of other sizes, cameras that frame a scene and differ in some things."""

import numpy as np
import pytest
from significance import render

import wavefront as wf

BALL = wf.Sphere((0, 0, 0), 1)
SIZE = (24, 18)


@pytest.fixture(scope="module")
def image() -> wf.Image:
    return render([BALL, wf.PointLight((3, 3, 3), 50)], 4, size=SIZE, aovs=("depth", "shape_id"))


def test_a_part_has_all_that_is_known_of_its_pixels(image) -> None:
    part = image.crop((3, 2, 20, 12))
    rows, columns = slice(2, 12), slice(3, 20)
    for name in ("rgb", "counts", "variance", "standard_error"):
        assert np.array_equal(getattr(part, name), getattr(image, name)[rows, columns])
    for name, layer in image.layers.items():
        assert np.array_equal(part.layers[name], layer[rows, columns], equal_nan=True)
    assert part.names == image.names
    assert part.metadata["window"] == [3, 2, 20, 12]
    assert part.crop((1, 1, 3, 3)).metadata["window"] == [4, 3, 6, 5]
    part.rgb[:] = 0
    assert image.rgb.any()


def test_a_part_compares_with_a_render_of_the_part(image) -> None:
    camera = wf.Scene(BALL).framing_camera(size=SIZE).replace(crop=(3, 2, 20, 12))
    alone = render([BALL, wf.PointLight((3, 3, 3), 50)], 4, camera=camera, aovs=("depth", "shape_id"))
    assert np.array_equal(alone.rgb, image.crop((3, 2, 20, 12)).rgb)
    assert wf.compare(alone, image.crop((3, 2, 20, 12))).p_value == 1


def test_the_scatter_of_a_part_is_kept() -> None:
    shared = render([BALL, wf.PointLight((3, 3, 3), 50)], 16, size=(32, 32), reuse=True)
    part = shared.crop((8, 0, 24, 32))
    whole = shared.mean((slice(None), slice(8, 24)))
    assert part.mean().standard_error == pytest.approx(whole.standard_error)


@pytest.mark.parametrize(
    "window", [(0, 0, 25, 4), (3, 3, 3, 4), (-1, 0, 3, 3), (0, 0, 1.5, 3), (1, 2, 3), "ab", 3]
)
def test_wrong_windows_are_named(image, window) -> None:
    with pytest.raises(wf.SceneError, match=r"crop is .*four whole numbers .* within 24x18, and not empty"):
        image.crop(window)


@pytest.mark.parametrize("size", [(12, 9), (7, 5), (48, 36), (24, 18), (1, 1)])
def test_another_size_keeps_the_light(image, size) -> None:
    small = image.resize(size)
    assert small.shape == (size[1], size[0], 3)
    assert small.rgb.mean((0, 1)) == pytest.approx(image.rgb.mean((0, 1)), rel=1e-5)
    assert small.standard_error is None


def test_pixels_of_half_the_size_are_means_of_four(image) -> None:
    blocks = image.rgb.reshape(9, 2, 12, 2, 3).mean((1, 3))
    assert image.resize((12, 9)).rgb == pytest.approx(blocks, rel=1e-5)
    assert np.array_equal(image.resize((24, 18)).rgb, image.rgb) or np.allclose(
        image.resize((24, 18)).rgb, image.rgb
    )
    assert image.resize(3).shape == (3, 3, 3)


def test_the_framing_camera_is_that_of_render(image) -> None:
    camera = wf.Camera.framing(BALL, size=SIZE)
    lamp = wf.PointLight((3, 3, 3), 50)
    assert np.array_equal(render([BALL, lamp], 4, camera=camera).rgb, image.rgb)
    own = wf.Camera.look_at((0, 0, 9), (0, 0, 0))
    assert wf.Camera.framing(wf.Scene(BALL, camera=own)).origin.tolist() == [0, 0, 9]
    top = wf.Camera.framing(wf.Scene(BALL, camera=own), view="top")
    assert top.rotation[:, 2] == pytest.approx([0, 1, 0])


def test_a_framing_camera_has_depth_of_field() -> None:
    """What is in the middle is in focus, and what is before and behind is not."""
    camera = wf.Camera.framing(BALL, view="front", aperture=0.3)
    assert camera.projection.aperture == 0.3
    assert camera.projection.focus == pytest.approx(camera.origin[2], rel=1e-6)
    assert wf.Camera.framing(BALL, aperture=0.3, focus=2).projection.focus == 2
    assert not wf.Camera.framing(BALL).projection.uses_lens


def test_what_is_not_replaced_stays() -> None:
    camera = wf.Camera.look_at(
        (0, 0, 5), (0, 0, 0), fov=30, size=(64, 48), crop=(1, 2, 30, 40), shift=(0.1, 0)
    )
    wide = camera.replace(fov=60)
    assert wide.projection.fov == 60
    assert wide.projection.shift.tolist() == [0.1, 0]
    assert wide.window == (1, 2, 30, 40)
    assert camera.projection.fov == 30
    assert camera.replace(size=32).window == (0, 0, 32, 32)
    moved = camera.replace(origin=(1, 0, 5))
    assert np.array_equal(moved.rotation, camera.rotation)
    turned = camera.replace(target=(5, 0, 5))
    assert -turned.rotation[:, 2] == pytest.approx([1, 0, 0])
    assert turned.projection.focus == pytest.approx(5)
    assert camera.replace(up="x").rotation[:, 1] == pytest.approx([1, 0, 0])
    assert wf.Camera.orthographic((0, 0, 5), (0, 0, 0), height=2).replace(height=4).projection.height == 4
    for other, change in (
        (wf.Camera.panorama((0, 0, 0)), {"fov": 40}),
        (camera, {"height": 3}),
        (wf.Camera.orthographic((0, 0, 5), (0, 0, 0), height=2), {"aperture": 0.1}),
    ):
        with pytest.raises(wf.SceneError, match="camera has none"):
            other.replace(**change)


def test_numbers_are_colors_with_a_colormap() -> None:
    """Of vertices, spheres, cylinders and capsules."""
    import matplotlib

    ends = np.eye(3)
    numbers = np.array([1.0, 2.0, 3.0])
    due = wf.srgb(matplotlib.colormaps["plasma"](np.array([0, 128, 255])))
    for shape in (
        wf.Mesh(ends, [[0, 1, 2]], colors=numbers, cmap="plasma"),
        wf.Points(ends, 0.1, numbers, cmap="plasma"),
        wf.Spheres(ends, 0.1, numbers, cmap="plasma"),
        wf.Cylinders(ends, ends + 1, 0.1, numbers, cmap="plasma"),
        wf.Capsules(ends, ends + 1, 0.1, numbers, cmap="plasma", clim=(1, 3)),
    ):
        assert shape.colors == pytest.approx(due, abs=5e-3)
    bounded = wf.Points(ends, 0.1, numbers, cmap="plasma", clim=(3, 5))
    assert bounded.colors == pytest.approx(np.tile(due[0], (3, 1)), abs=5e-3)
    for wrong in ({"colors": np.eye(3)}, {}):
        with pytest.raises(wf.SceneError, match="one number each"):
            wf.Spheres(ends, 0.1, cmap="plasma", **wrong)


def test_plots_take_a_colormap(image) -> None:
    from matplotlib import pyplot

    for axes in (image.plot("depth", cmap="magma"), image.false_color(cmap="magma")):
        assert axes.images[0].get_cmap().name == "magma"
    assert image.plot("depth").images[0].get_cmap().name == "viridis"
    pyplot.close("all")
