"""Paths shared among pixels: the same means, less noise, the same bits however a render is cut."""

import importlib.util

import numpy as np
import pytest
import scenes
from inside import (
    PictureTiles,
    SobolSampler,
    compile_scene,
    generate,
    li_reuse,
    make_accelerator,
    others_in_tile,
    place_in_tiles,
    reuse,
)
from scipy import stats
from significance import Mean, assert_mean, assert_same_images, render, repeat

import wavefront as wf

# --- Tiles ----------------------------------------------------------------------------------------


def test_tiles_divide_a_picture() -> None:
    """Each tile has a pixel in each of the sixteen cells of its block, but for the edges of the picture."""
    width, height = 59, 57
    pixels = np.arange(width * height, dtype=np.uint32)
    tile, member = place_in_tiles(pixels, width)
    pairs = set(zip(tile.tolist(), member.tolist(), strict=True))
    assert len(pairs) == width * height
    inside = tile.reshape(height, width)[:56, :56]
    assert (np.bincount(inside.ravel())[np.unique(inside)] == 16).all()
    assert np.bincount(tile).max() == 16
    for number in np.unique(inside[28:, :28]):
        rows, columns = np.nonzero(inside == number)
        cells = sorted(zip(rows // 7, columns // 7, strict=True))
        assert cells == [(row, column) for row in range(4, 8) for column in range(4)]
    one = 8 * width + 10
    others = others_in_tile(pixels, one, PictureTiles(width, 1))
    assert sorted([one, *others.tolist()]) == np.flatnonzero(tile == tile[one]).tolist()


def autocorrelation(error: np.ndarray, lag: int, axis: int) -> float:
    """Return the correlation of errors (H, W) of pixels so far apart."""
    size = error.shape[axis]
    one, other = np.take(error, range(lag, size), axis), np.take(error, range(size - lag), axis)
    return float((one * other).mean() / np.square(error).mean())


@pytest.mark.parametrize("spp", [4, pytest.param(16, marks=pytest.mark.slow)])
def test_errors_of_pixels_do_not_repeat(spp: int) -> None:
    """In a room whose pixels share paths: at no distance is the correlation of errors above 0.05."""
    scene = scenes.cornell_box((84, 84))
    runs = repeat(scene, spp, 4, reuse=True, max_bounces=2).mean(-1)
    error = (runs - runs.mean(0)) / (runs.mean(0) + 0.1 * runs.mean())
    worst = np.quantile(np.abs(error), 0.99)
    error = error.clip(-worst, worst)
    for axis in (0, 1):
        found = [np.mean([autocorrelation(e, lag, axis) for e in error]) for lag in range(1, 15)]
        assert np.abs(found).max() < 0.05


# --- Means ----------------------------------------------------------------------------------------


def matte_corner() -> wf.Scene:
    """Walls of pure colors: what one cannot reflect counts for the other."""
    red, blue = wf.Diffuse((0.9, 0, 0)), wf.Diffuse((0, 0.1, 0.9))
    shapes = [
        scenes.floor(wf.Diffuse(0.7), half=2),
        wf.Rectangle((-2, 0, -2), (4, 0, 0), (0, 3, 0), material=blue),
        wf.Rectangle((-2, 0, -2), (0, 3, 0), (0, 0, 4), material=red),
    ]
    camera = wf.Camera.look_at((2, 2, 3), (-1, 0.5, -1), fov=40, size=(16, 16))
    return wf.Scene(shapes, [wf.PointLight((0, 2, 0), 5)], camera)


def smooth() -> wf.Scene:
    """Balls with interpolated normals, beside each other and far from the camera's plane."""
    scene = scenes.cornell_box((16, 16))
    theta = np.linspace(0, np.pi, 7)
    phi = np.arange(8) * np.pi / 4
    points = np.array([[np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)] for t in theta for p in phi])
    faces = [
        face
        for i in range(6)
        for j in range(8)
        for face in (
            *[(8 * i + j, 8 * i + (j + 1) % 8, 8 * i + 8 + j)] * (i > 0),  # without an area at the pole
            (8 * i + (j + 1) % 8, 8 * i + 8 + (j + 1) % 8, 8 * i + 8 + j),
        )
    ]
    balls = [
        wf.Mesh(
            points * 0.4 + (x, -0.5, 0.2),
            faces,
            normals=points,
            material=wf.Principled((0.8, 0.5, 0.2), roughness=0.3) if x > 0 else wf.Diffuse((0.2, 0.8, 0.6)),
        )
        for x in (-0.45, 0.45)
    ]
    return wf.Scene([*scene.shapes[:6], *balls], camera=scene.camera)


def veiled() -> wf.Scene:
    """Half-transparent panes, a texture, and glass that absorbs nothing."""
    scene = scenes.cornell_box((16, 16))
    checks = wf.Texture(np.array([[[0.9, 0.2, 0.1], [0.1, 0.3, 0.8]], [[0.2, 0.7, 0.2], [0.9, 0.9, 0.9]]]))
    pane = wf.Material(wf.Diffuse(0.6), alpha=0.4)
    uv = [[0, 0], [4, 0], [4, 4], [0, 4]]
    back = wf.Mesh(
        [[-1, -1, -0.9], [1, -1, -0.9], [1, 1, -0.9], [-1, 1, -0.9]],
        [[0, 1, 2], [0, 2, 3]],
        uvs=uv,
        material=wf.Diffuse(checks),
    )
    shapes = [
        wf.Rectangle((-0.2, -1, -0.9), (0, 1.5, 0), (0, 0, 1.5), material=pane),
        wf.Rectangle((-0.9, -0.4, -0.5), (0.8, 0, 0), (0, 0, 0.8), material=pane),
        wf.Sphere((0.5, -0.6, 0.2), 0.35, material=wf.Dielectric(1.5)),
    ]
    return wf.Scene([*scene.shapes[:6], back, *shapes], camera=scene.camera)


def blended() -> wf.Scene:
    """Rough and delta lobes together, rough glass, an absorbing medium, instances and an environment."""
    scene = scenes.cornell_box((16, 16))
    plates = wf.Mix(wf.Diffuse(0.7), wf.Mirror(0.9), 0.4)
    amber = wf.Material(wf.Dielectric(1.4, roughness=0.4), interior=wf.Medium((0.3, 1, 2)))
    ball = scenes.box((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2), wf.Diffuse(0.5))
    shapes = [
        wf.Rectangle((-0.9, -0.95, 0.9), (1.8, 0, 0), (0, 0, -1.8), material=plates),
        wf.Sphere((0.4, -0.55, 0.2), 0.35, material=amber),
        wf.Instance(ball, [[1, 0, 0, -0.5], [0, 1, 0, -0.6], [0, 0, 2, 0], [0, 0, 0, 1]]),
    ]
    return wf.Scene([*scene.shapes[:6], *shapes], [wf.Environment(0.3)], scene.camera)


def divided() -> wf.Scene:
    """A lit and a dark half with a screen between them: pixels of one tile do not see the same."""
    sides = [wf.Rectangle((x, 0, -1), (0, 0, 2), (0, 1.5, 0), material=wf.Diffuse(0.8)) for x in (-1, 0, 1)]
    camera = wf.Camera.look_at((0.22, 4, 0.01), (0.22, 0, 0), fov=25, size=(16, 16))
    return wf.Scene([scenes.floor(half=1), *sides], [wf.PointLight((-0.5, 1, 0), 3)], camera)


def balcony() -> wf.Scene:
    """A balcony whose shading normals lean over its edge, to a lit ground below that it must not see."""
    matte = wf.Diffuse(0.8)
    corners = [[-1, 0, -1], [0, 0, -1], [0, 0, 1], [-1, 0, 1]]
    normals = [[0.9, 0.44, 0]] * 4
    shapes = [
        wf.Mesh(corners, [[0, 2, 1], [0, 3, 2]], normals=normals, material=matte),
        wf.Rectangle((-1, -1, -1), (0, 0, 2), (3, 0, 0), material=matte),
        wf.Rectangle((1, -1, -1), (0, 0, 2), (0, 2, 0), material=matte),
    ]
    camera = wf.Camera.look_at((-0.5, 3, 0.01), (0, 0, 0), fov=40, size=(16, 16))
    return wf.Scene(shapes, [wf.PointLight((0.5, -0.5, 0), 3)], camera)


def brushed() -> wf.Scene:
    """A floor of brushed metal, varnish beside a mirror, and an environment that BSDF samples meet."""
    scene = scenes.cornell_box((16, 16))
    varnish = wf.Mix(wf.Principled((0.2, 0.4, 0.8), roughness=0.4), wf.Mirror(0.9), 0.3)
    shapes = [
        wf.Rectangle((-1, -0.98, 1), (2, 0, 0), (0, 0, -2), material=wf.Conductor.named("gold", 0.3)),
        wf.Rectangle((-0.98, -1, 1), (0, 0, -2), (0, 2, 0), material=wf.Principled(0.6, roughness=0.3)),
        wf.Sphere((0.3, -0.5, 0.2), 0.4, material=varnish),
    ]
    return wf.Scene([*scene.shapes[:6], *shapes], [wf.Environment(0.5)], scene.camera)


SCENES = [matte_corner, smooth, veiled, blended, divided, balcony, brushed]


@pytest.mark.parametrize("build", SCENES)
@pytest.mark.parametrize(
    ("spp", "error"), [(16, 0.015), pytest.param(1024, 0.001, marks=pytest.mark.slow)], ids=["quick", "slow"]
)
@pytest.mark.first(1)
def test_sharing_keeps_the_mean(build, spp, error, close_tiles):
    """Pure colors, smooth shading, alpha, textures, mixed lobes, media and instances."""
    options = {"max_bounces": 5}
    plain = repeat(build(), spp, 12, **options)
    shared = repeat(build(), spp, 12, reuse=True, first_seed=100, **options)
    assert_same_images(plain, shared, error)


@pytest.mark.parametrize(
    "options",
    [
        pytest.param(each, marks=pytest.mark.slow)
        for each in ({"branches": 3, "guide": True}, {"branches": 3}, {"guide": True})
    ],
    ids=str,
)
def test_branches_and_guides_go_with_it(options, close_tiles, short_training):
    plain = repeat(scenes.room(), 32)
    shared = repeat(scenes.room(), 8, runs=10, reuse=True, first_seed=100, **options)
    assert_same_images(plain, shared, 0.01)


def lacquered() -> wf.Scene:
    """A glossy room in front of a shining wall, which BSDF samples and light samples find alike."""
    materials = (
        wf.Conductor.named("gold", 0.35),
        wf.Principled((0.2, 0.4, 0.8), roughness=0.4),
        wf.Mix(wf.Conductor.named("copper", 0.4), wf.Mirror(0.9), 0.3),
    )
    walls = scenes.cornell_box().shapes[:5]
    for k, wall in enumerate(walls):
        wall.material = wf.Material(materials[k % 3])
    lamp = wf.Rectangle((-1, -1, 1), (0, 2, 0), (2, 0, 0), material=wf.Diffuse(0.5), emission=1)
    camera = wf.Camera.look_at((0, 0, 0.95), (0.1, -0.2, -1), fov=90, size=(28, 28))
    return wf.Scene([*walls, lamp], camera=camera)


@pytest.mark.parametrize(
    ("spp", "error"), [(4, 0.008), pytest.param(512, 0.0004, marks=pytest.mark.slow)], ids=["quick", "slow"]
)
def test_glossy_points_keep_the_mean(spp: int, error: float) -> None:
    """Each pixel sees their BSDF from elsewhere, and weighs light samples by its own density."""
    plain = repeat(lacquered(), spp, 12, max_bounces=3)
    shared = repeat(lacquered(), spp, 12, reuse=True, first_seed=100, max_bounces=3)
    assert_same_images(plain[:, :24, :24], shared[:, :24, :24], error)


@pytest.mark.slow
def test_glossy_points_that_nobody_reaches_stay_with_their_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing_arrives(scene, first, points, lights, number_in, glossy):
        left = [number.compress(number >= 0) for numbers in number_in for number in numbers]
        return [np.zeros((3, *first.present.shape), np.float32) for _ in lights], left

    plain = repeat(lacquered(), 8, max_bounces=3)
    monkeypatch.setattr(reuse, "_arriving", nothing_arrives)
    own = repeat(lacquered(), 8, reuse=True, first_seed=100, max_bounces=3)
    assert_same_images(plain[:, :24, :24], own[:, :24, :24], 0.004)


def test_no_light_is_lost_or_won(close_tiles: None) -> None:
    """In a closed white room of radiance 1 each sample is 1, whichever pixels it comes from."""
    inside = scenes.box((-1, -1, -1), (1, 1, 1), wf.Diffuse(0.5), emission=0.5, inward=True)
    scene = wf.Scene([inside], camera=wf.Camera.look_at((0, 0, 0), (1, 0.3, 0.2), fov=70, size=(16, 16)))
    runs = repeat(scene, 4, 12, max_bounces=40, reuse=True)
    assert_mean(Mean.of(runs.mean((1, 2, 3))), 1.0, 0.003)


def test_noise_falls() -> None:
    scene = scenes.cornell_box((56, 56))
    plain, shared = (render(scene, 16, reuse=reuse) for reuse in (False, True))
    assert shared.metadata["noise"] < 0.8 * plain.metadata["noise"]
    assert shared.metadata["reuse"] is True


# --- Bits -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "cut",
    [{"wave_size": 500, "workers": 3}, {"workers": 2, "executor": "processes"}, {"wave_size": 100}],
    ids=str,
)
@pytest.mark.first(1)
def test_waves_and_workers_change_no_bit(cut: dict) -> None:
    scene = scenes.everything((31, 25))
    options = {"reuse": True, "branches": 2}
    whole = render(scene, 2, **options)
    assert render(scene, 2, **options, **cut).rgb.tobytes() == whole.rgb.tobytes()


def test_a_wave_of_many_paths_is_as_several_of_few() -> None:
    """Each point that is shared gets light along several ways, in the same order in any wave."""
    red, gold = wf.OrenNayar((0.8, 0.3, 0.3)), wf.Conductor.named("gold", roughness=0.5)
    shapes = [
        scenes.box((-1, -1, -1), (1, 1, 1), wf.Diffuse(0.7), inward=True),
        wf.Rectangle((-0.9, -1, -0.9), (1.8, 0, 0), (0, 1.8, 0), material=red),
        wf.Rectangle((-0.9, -0.9, 0.9), (0, 0, -1.8), (0, 1.8, 0), material=gold),
        scenes.panel((-0.3, -0.3), (0.3, 0.3), 0.99, 8.0),
    ]
    camera = wf.Camera.look_at((0, 0, 0.9), (0, 0, 0), fov=90, size=(56, 56))
    scene = compile_scene(wf.Scene(shapes), lambda geometry: make_accelerator(geometry, "numpy"), mis=True)
    view, sampler = scene.view(camera), SobolSampler(0, 56)
    pixels = np.arange(56 * 56, dtype=np.uint32)

    def traced(samples: range) -> np.ndarray:
        sample = np.repeat(np.array(samples, np.uint32), pixels.size)
        paths = generate(scene, view, sampler, np.tile(pixels, len(samples)), sample)
        return li_reuse(scene, paths, sampler, 4, tiles=view.tiles)

    part, whole = traced(range(1)), traced(range(6))
    assert part.tobytes() == whole[:, : pixels.size].tobytes()


def test_pixels_that_need_more_samples_share_them_in_any_wave() -> None:
    scene = scenes.room((33, 25))
    options = {"reuse": True, "noise": 0.09, "max_bounces": 3}
    whole = render(scene, 64, **options)
    again = render(scene, 64, **options, wave_size=3000, workers=2)
    assert np.unique(whole.counts).size > 1
    assert again.rgb.tobytes() == whole.rgb.tobytes()
    assert np.array_equal(again.counts, whole.counts)


def test_parts_of_the_samples_make_the_whole() -> None:
    scene = scenes.everything((25, 9))
    parts = [render(scene, None, reuse=True, samples=part) for part in (range(0, 3), range(3, 8))]
    whole = render(scene, None, reuse=True, samples=range(0, 8))
    assert wf.Image.merge(*parts).rgb.tobytes() == whole.rgb.tobytes()


@pytest.mark.parametrize("noise", [None, 0.1])
@pytest.mark.first(1)
def test_sessions_go_on_with_the_same_bits(noise: float | None, tmp_path) -> None:
    scene, path = scenes.room((33, 25)), tmp_path / "render.wfck"
    options = {"reuse": True, "wave_size": 2000, "noise": noise, "max_bounces": 3}
    spp = 24 if noise is None else 64
    whole = render(scene, spp, **options)
    done = 0

    def stop(now: float, most: float) -> None:
        nonlocal done
        done = now
        if now > 0.52 * most:
            session.stop()

    session = wf.Session(
        scene, spp, checkpoint=path, workers=1, accel="numpy", **{**options, "progress": stop}
    )
    with session:
        session.run()
    assert 0 < done < whole.metadata["samples"]
    assert render(scene, spp, checkpoint=path, **options).rgb.tobytes() == whole.rgb.tobytes()


def test_a_part_of_a_picture_has_the_same_tiles() -> None:
    """Blocks that lie in a window whole have the bits of the whole picture."""
    scene = scenes.everything((56, 56))
    whole = render(scene, 2, reuse=True).rgb
    part = render(scene, 2, reuse=True, camera=scene.camera.cropped((28, 0, 56, 56))).rgb
    assert part.tobytes() == np.ascontiguousarray(whole[:, 28:]).tobytes()


# --- With other settings --------------------------------------------------------------------------


def test_layers_of_light() -> None:
    """Direct light is that of a plain render, and what is left is indirect."""
    scene = scenes.room((21, 21))
    plain, shared = (render(scene, 4, reuse=reuse, aovs=["direct", "indirect"]) for reuse in (False, True))
    assert np.allclose(shared.direct, plain.direct, atol=1e-5)
    assert np.allclose(shared.direct + shared.indirect, shared.rgb, atol=1e-5)


def test_nothing_to_share() -> None:
    """Pictures of one bounce, and of scenes without matte surfaces, are the plain ones."""
    for scene, bounces in ((scenes.room((21, 21)), 1), (scenes.glass_ball(), 4)):
        one, other = (render(scene, 4, reuse=reuse, max_bounces=bounces) for reuse in (True, False))
        assert one.rgb.tobytes() == other.rgb.tobytes()


# --- Samples by noise -----------------------------------------------------------------------------


def half_lit(size: tuple[int, int] = (63, 31)) -> wf.Scene:
    """A calm plain, and a corner with indirect light: blocks of pixels need different numbers of samples."""
    scene = matte_corner()
    scene.camera = wf.Camera.look_at((2, 2, 3), (0.5, 0.5, -1), fov=75, size=size)
    return scene


@pytest.mark.filterwarnings("ignore:noise=")  # is not reached by so few samples
@pytest.mark.parametrize("window", [None, (20, 2, 63, 31)])
@pytest.mark.first(1)
def test_pixels_of_a_tile_get_their_samples_together(window: tuple[int, int, int, int] | None) -> None:
    """So a pixel's samples are the first that it has where all pixels have as many."""
    scene = half_lit()
    scene.camera = scene.camera if window is None else scene.camera.cropped(window)
    image = render(scene, 64, reuse=True, noise=0.02)
    assert np.unique(image.counts).size > 1
    for count in np.unique(image.counts):
        plain = render(scene, int(count), reuse=True)
        there = image.counts == count
        assert (image.rgb[there] == plain.rgb[there]).all()
        assert (image.standard_error[there] == plain.standard_error[there]).all()


@pytest.mark.slow
def test_noise_is_the_true_error_where_pixels_share(close_tiles: None) -> None:
    """Pictures of several seeds are as far from the converged one as they say, and as was asked for."""
    scene = scenes.cornell_box((16, 16))
    options = {"reuse": True, "accel": "auto", "max_bounces": 3}
    converged = render(scene, 1024, seed=99, **options)
    images = [render(scene, None, seed=seed, noise=0.06, **options) for seed in range(6)]
    assert all(image.metadata["noise"] <= 0.06 for image in images)
    found = np.mean([wf.compare(image, converged).relative_mse for image in images]) ** 0.5
    assert 0.7 < found / np.mean([image.metadata["noise"] for image in images]) < 1.15


# --- Groups of lights -----------------------------------------------------------------------------


def grouped(size: tuple[int, int] = (16, 16)) -> wf.Scene:
    """Light of four groups, two of them of the environment, on matte walls, a mirror and glass."""
    scene = scenes.room(size)
    shapes = [*scene.shapes[:2], *scene.shapes[3:5], *scene.shapes[6:]]  # light comes in
    lamp = wf.Material(wf.Diffuse(0.7), emission=(6, 5, 4), group="lamp")
    lights = [
        wf.Environment((0.2, 0.3, 0.5), group="sky"),
        wf.DirectionalLight((0.3, -1, -0.5), 3, angle=30, group="sun"),
        wf.PointLight((0.6, 0.5, 0.6), 0.4),
    ]
    panel = wf.Rectangle((-0.4, 0.9, -0.4), (0.8, 0, 0), (0, 0, 0.8), material=lamp)
    return wf.Scene([*shapes, panel], lights, scene.camera)


@pytest.mark.filterwarnings("ignore:noise=")  # is not reached by so few samples
@pytest.mark.parametrize(
    "options", [{"spp": 3}, {"spp": 2, "branches": 2}, {"spp": 33, "noise": 0.1}], ids=str
)
@pytest.mark.first(1)
def test_groups_sum_to_the_picture(options: dict) -> None:
    """To rounding; the picture is that without them, whatever the waves."""
    scene, options = grouped((33, 30)), {**options, "reuse": True, "max_bounces": 3}
    image = render(scene, aovs=("light_groups", "direct"), **options)
    plain = render(scene, **options)
    assert image.rgb.tobytes() == plain.rgb.tobytes()
    groups = image.light_groups
    assert set(groups) == {"lamp", "sky", "sun", "default"}
    total = sum(each.astype(float) for each in groups.values())
    np.testing.assert_allclose(total, image.rgb, rtol=3e-6, atol=1e-7)
    again = render(scene, aovs="light_groups", **options, wave_size=500, workers=2)
    for name, values in again.light_groups.items():
        assert values.tobytes() == groups[name].tobytes()


@pytest.mark.parametrize(
    ("spp", "error"), [(4, 0.05), pytest.param(512, 0.005, marks=pytest.mark.slow)], ids=["quick", "slow"]
)
def test_groups_keep_their_means(spp: int, error: float, close_tiles: None) -> None:
    """Each has the mean of plain paths, by a significance test."""
    runs: list[list[wf.Image]] = [
        [
            render(grouped(), spp, seed=first + seed, reuse=reuse, max_bounces=4, aovs="light_groups")
            for seed in range(12)
        ]
        for first, reuse in ((0, False), (100, True))
    ]
    for name in ("lamp", "sky", "sun", "default"):
        plain, shared = (np.stack([each.light_groups[name] for each in images]) for images in runs)
        assert_same_images(plain.astype(float), shared.astype(float), error)


# --- Errors of regions, and comparisons -----------------------------------------------------------


def without_scatter(image: wf.Image) -> wf.Image:
    """Return a picture as if its pixels were independent."""
    metadata = {**image.metadata, "reuse": False}
    return wf.Image(
        image.rgb,
        image.spp,
        metadata,
        counts=image.counts,
        variance=image.variance,
        standard_error=image.standard_error,
    )


@pytest.mark.slow
def test_comparisons_allow_for_shared_noise(close_tiles: None) -> None:
    """Blocks of pixels that share noise differ by more than their standard errors say."""
    scene = scenes.cornell_box((32, 32))
    p, blind = [], []
    for seed in range(8):
        a, b = (render(scene, 16, reuse=True, seed=2 * seed + k, max_bounces=4) for k in (0, 1))
        p.append(wf.compare(a, b).p_value)
        blind.append(wf.compare(without_scatter(a), without_scatter(b)).p_blocks)
    assert min(p) > 0.01
    assert min(blind) < 1e-4


def below_the_lamp(size: int) -> wf.Scene:
    """The Cornell box without the lamp in view, whose edges are most of the noise of a mean."""
    camera = wf.Camera.look_at((0, -0.2, 3.8), (0, -0.35, 0), fov=27, size=(size, size))
    return wf.Scene(scenes.cornell_box().shapes, camera=camera)


def test_small_changes_are_found() -> None:
    """Two percent in nearly all pairs, and nothing where there is no change."""
    scene = below_the_lamp(56)
    images = [render(scene, 16, reuse=True, seed=seed, max_bounces=3) for seed in range(4)]
    pairs = list(zip(images[::2], images[1::2], strict=True))
    assert min(wf.compare(a, b).p_value for a, b in pairs) > 0.01
    assert max(wf.compare(1.02 * a, b).p_value for a, b in pairs) < 1e-3


@pytest.mark.slow
def test_the_error_of_a_mean_of_few_samples_is_not_overestimated() -> None:
    """The squares of differences over their errors are 1 in the mean; batches of one sample would say 0.1."""
    scene = scenes.cornell_box((28, 28))
    for shape in scene.shapes:
        if shape.emission is None:
            shape.material = wf.Material(wf.Diffuse(0.6))  # so that the three channels are alike
    images = [render(scene, 4, reuse=True, seed=seed, max_bounces=2) for seed in range(90)]
    pairs = list(zip(images[::2], images[1::2], strict=True))
    p = 1 - (1 - np.array([wf.compare(a, b).p_mean for a, b in pairs])) ** (1 / 3)
    squares = stats.norm.isf(p / 2) ** 2
    assert stats.chi2.ppf(0.01, len(p)) < squares.sum() < stats.chi2.isf(0.01, len(p))


@pytest.mark.parametrize(("spp", "reuse"), [(16, True), (4, False)])
@pytest.mark.first(1)
def test_pictures_of_different_kinds_are_compared(spp: int, reuse: bool) -> None:
    """With four times the samples, or without shared paths."""
    scene = below_the_lamp(56)
    a = render(scene, 4, reuse=True, seed=1, max_bounces=3)
    b = render(scene, spp, reuse=reuse, seed=2, max_bounces=3)
    assert wf.compare(a, b).p_mean > 0.01
    assert wf.compare(1.2 * a, b).p_mean < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scene", "max_bounces", "share"),
    [(scenes.cornell_box((56, 56)), 8, 1.5), (below_the_lamp(56), 3, 0.75)],
    ids=["lamp", "below the lamp"],
)
def test_false_alarms_and_power(scene: wf.Scene, max_bounces: int, share: float) -> None:
    """Alarms are as rare as they say, and changes are found nearly as often as the noise of means allows.

    With the lamp in view, whose edges are most of that noise, blocks without it tell more than means.
    """
    runs, changes = 100, np.array([1, 1.02, 1.03])
    found, ratios = np.zeros(3), []
    for seed in range(0, 2 * runs, 2):
        a, b = (render(scene, 4, reuse=True, seed=seed + k, max_bounces=max_bounces) for k in (0, 1))
        found += [wf.compare(float(by) * a, b).p_value < 0.01 for by in changes]
        ratios.append(np.log(a.rgb.mean() / b.rgb.mean()))
    assert found[0] <= stats.binom.isf(1e-4, runs, 0.01)
    # the power of a test of the ratio of both means that knows its standard deviation
    best = stats.norm.sf(stats.norm.isf(0.005) - np.log(changes) / np.std(ratios))
    assert (found[1:] >= share * best[1:] * runs).all()


REGIONS = [(slice(0, 28), slice(0, 28)), (slice(9, 33), slice(14, 40)), (slice(30, 38), slice(6, 20)), None]


CHANCES = (0.6827, 0.9545)  # of one and of two standard deviations of a normal distribution


def coverage(images: list[wf.Image]) -> tuple[np.ndarray, np.ndarray]:
    """Return how often means of regions lie within intervals of two confidences: (2,), with errors (2,).

    The converged mean is that of the other pictures, for which intervals are widened.
    """
    inside: list[np.ndarray] = []
    wider = np.sqrt(1 + 1 / (len(images) - 1))
    for region in REGIONS:
        found = [image.mean(region) for image in images]
        values = np.array([each.value for each in found])
        others = (values.sum(0) - values) / (len(images) - 1)
        away = np.abs(values - others) / wider
        freedom, error = (
            np.array([getattr(each, name) for each in found]) for name in ("freedom", "standard_error")
        )
        limits = [stats.t.ppf((1 + chance) / 2, freedom) * error for chance in CHANCES]
        inside.append(np.array([(away < limit).mean(1) for limit in limits]))  # channels go together
    kept = np.array(inside)  # (regions, 2, images)
    return kept.mean((0, 2)), kept.mean(0).std(1, ddof=1) / np.sqrt(len(images))


def caustic(size: int) -> wf.Scene:
    """A glass ball below a small bright lamp, in a room."""
    scene = scenes.cornell_box((size, size))
    ball = wf.Sphere((0.1, -0.5, 0.2), 0.35, material=wf.Dielectric(1.5))
    return wf.Scene([*scene.shapes[:5], ball], [wf.PointLight((0, 0.8, 0.1), 2)], scene.camera)


@pytest.mark.parametrize(
    ("runs", "options"),
    [
        pytest.param(16, {"reuse": True, "sampler": "independent"}, id="shared", marks=pytest.mark.slow),
        pytest.param(16, {"sampler": "independent"}, id="plain", marks=pytest.mark.slow),
        pytest.param(10, {"caustics": True}, id="caustic"),
        pytest.param(
            200, {"reuse": True, "sampler": "independent"}, id="shared, alone", marks=pytest.mark.slow
        ),
        pytest.param(100, {"reuse": True}, id="shared, many", marks=pytest.mark.slow),
        pytest.param(100, {}, id="plain, many", marks=pytest.mark.slow),
        pytest.param(100, {"caustics": True}, id="caustic, many", marks=pytest.mark.slow),
        pytest.param(40, {"reuse": True, "guide": True}, id="guided", marks=pytest.mark.slow),
    ],
)
def test_errors_of_regions(runs: int, options: dict, short_training: None) -> None:
    """Intervals hold the converged mean as often as they say; stratified samples more often."""
    scene = caustic(42) if "caustics" in options else below_the_lamp(42)
    images = [render(scene, 4, seed=seed, max_bounces=3, **options) for seed in range(runs)]
    found, error = coverage(images)
    off = (found - CHANCES) / np.maximum(error, 0.01)
    assert (off > -4).all(), (found, error)
    if "sampler" in options:
        assert (off < 4).all(), (found, error)
    if "reuse" in options:
        block = REGIONS[0]
        known, blind = (
            np.mean([each(image).mean(block).standard_error for image in images])
            for each in (lambda image: image, without_scatter)
        )
        assert blind < 0.9 * known


def test_intervals_are_those_of_student() -> None:
    found = render(scenes.room((21, 21)), 4, reuse=True).mean()
    for confidence in (0.1, 0.68, 0.95, 0.9999):
        away = stats.t.ppf((1 + confidence) / 2, found.freedom) * found.standard_error
        low, high = found.interval(confidence)
        assert low == pytest.approx(found.value - away, rel=1e-6)
        assert high == pytest.approx(found.value + away, rel=1e-6)
    with pytest.raises(wf.SceneError, match="confidence is 95; it must be above 0 and below 1"):
        found.interval(95)


@pytest.mark.slow
def test_regions_of_shared_pictures_with_different_counts() -> None:
    """The error is that of the scatter over seeds."""
    scene = below_the_lamp(42)
    options = {"reuse": True, "noise": 0.1, "max_bounces": 2, "sampler": "independent"}
    images = [render(scene, 192, seed=seed, accel="auto", **options) for seed in range(8)]
    assert np.unique(images[0].counts).size > 1
    means = [image.mean() for image in images]
    scatter = np.std([each.value for each in means], axis=0, ddof=1).mean()
    assert 0.6 * scatter < np.mean([each.standard_error for each in means]) < 1.8 * scatter


def test_a_region_is_a_mask_slices_an_id_or_a_name() -> None:
    scene = scenes.everything((31, 25))
    image = render(scene, 4, reuse=True, aovs="shape_id")
    ids = image.shape_id
    mask = np.zeros((25, 31), bool)
    mask[3:20:2, -8:] = True
    for region, same in (((slice(3, 20, 2), slice(-8, None)), mask), (slice(2, 4), np.s_[2:4])):
        one, other = image.mean(region), image.mean(same)
        assert one.value.tolist() == other.value.tolist()
        assert one.standard_error.tolist() == other.standard_error.tolist()
    assert image.mean(mask).value == pytest.approx(image.rgb[mask].mean(0), rel=1e-5)
    some = int(np.bincount(ids[ids >= 0]).argmax())
    assert image.mean(some).pixels == image.mean(np.int64(some)).pixels == (ids == some).sum()
    assert image.mean().pixels == 31 * 25
    for region, message in (
        (np.zeros((25, 31), bool), "no pixel"),
        (mask.astype(int), "mask of booleans of shape"),
        (mask[:4], "mask of booleans of shape"),
        ((slice(1), slice(2), slice(3), 4), "no part of 25 rows and 31 columns"),
        ((99, 0), "no part of"),
        ("no such thing", "there is no shape"),
        (True, "mask of booleans"),
        (1.5, "mask of booleans"),
    ):
        with pytest.raises(wf.SceneError, match=message):
            image.mean(region)
    assert np.mean(image) == np.mean(image.rgb)
    assert np.stack([image, image]).shape == (2, 25, 31, 3)


def test_files_and_parts_keep_what_regions_need(tmp_path) -> None:
    """Files of npz, checkpoints, windows and merged parts do, files of exr say that they do not."""
    scene, region = scenes.everything((33, 30)), (slice(4, 20), slice(5, 25))
    options = {"reuse": True, "max_bounces": 3}
    whole = render(scene, 16, checkpoint=tmp_path / "render.wfck", **options)
    found = whole.mean(region)
    whole.save(tmp_path / "a.npz")
    loaded = wf.Image.load(tmp_path / "a.npz")
    assert loaded.mean(region).standard_error.tolist() == found.standard_error.tolist()
    assert wf.compare(loaded, render(scene, 16, seed=1, **options)).p_value > 1e-3
    again = wf.Image.load(tmp_path / "render.wfck")
    assert again.mean(region).standard_error.tolist() == found.standard_error.tolist()
    parts = [render(scene, None, samples=part, **options) for part in (range(8), range(8, 16))]
    merged = wf.Image.merge(*parts)
    assert merged.mean(region).standard_error == pytest.approx(found.standard_error, rel=0.02)
    window = render(scene, 16, camera=scene.camera.cropped((5, 3, 33, 30)), **options)
    assert window.metadata["window"] == [5, 3, 33, 30]
    assert np.array_equal(window.scatter[0].tile, whole.scatter[0].tile[3:, 5:])
    if importlib.util.find_spec("OpenEXR"):
        whole.save(tmp_path / "a.exr")
        absent = wf.Image.load(tmp_path / "a.exr").mean(region)
        assert absent.standard_error is None
        assert "npz files and checkpoints keep it" in absent.error_absent
        assert absent.value.tolist() == found.value.tolist()
        with pytest.raises(wf.SceneError, match="the error is not known: its pixels share paths"):
            absent.interval()


def test_differences_and_multiples_know_what_pixels_share() -> None:
    scene = below_the_lamp(42)
    plain, *shared = (
        render(scene, 16, seed=seed, reuse=seed > 0, max_bounces=3, aovs="direct") for seed in range(3)
    )
    errors = [image.mean().standard_error for image in (plain, *shared)]
    for a, b, parts in ((plain, shared[0], (0, 1)), (shared[1], shared[0], (1, 2)), (plain, plain * 2, ())):
        found = a - b
        assert found.metadata["reuse"] is bool(parts)
        if parts:
            expected, error = np.hypot(*(errors[part] for part in parts)), found.mean().standard_error
            # another estimate: squares of differences, of one degree of freedom for each of 110 tiles
            assert error == pytest.approx(expected, rel=3 * (2 / 110) ** 0.5 / 2)
            assert (-2 * found).mean().standard_error == pytest.approx(2 * error, rel=1e-5)
            chain = found - render(scene, 4, seed=9, max_bounces=3)
            assert (chain.mean().standard_error > found.mean().standard_error).all()
    denoised = shared[0].denoise("nonlocal_means").mean()
    assert (denoised.standard_error == shared[0].mean().standard_error).all()
    noisy = shared[0].denoise("nonlocal_means").noisy
    assert noisy.mean().standard_error.tolist() == errors[1].tolist()
    lost = wf.Image(shared[0].rgb, 16, shared[0].metadata, standard_error=shared[0].standard_error)
    assert (plain - lost).mean().standard_error is None
