"""Motion blur: pictures of an open shutter are means of pictures of its moments, and closed forms."""

from itertools import pairwise

import numpy as np
import pytest
from inside import Shutter, compile_scene, generate, make_accelerator, make_sampler, seen_by, seen_with
from scipy import integrate, stats
from significance import ALPHA, render
from stills import OPTIONS, assert_mean_of_stills

import wavefront as wf

ASKED = {"shutter": Shutter(0, 1)}  # of a compiled scene


def placed(shift=(0, 0, 0), degrees=0.0, axis=1):
    """A turn about an axis, and then a shift, as a matrix (4, 4)."""
    turn, (i, j) = np.radians(degrees), [each for each in range(3) if each != axis]
    matrix = np.eye(4)
    matrix[i, i] = matrix[j, j] = np.cos(turn)
    matrix[i, j], matrix[j, i] = np.sin(turn), -np.sin(turn)
    matrix[:3, 3] = shift
    return matrix


SLIDE = wf.Keyframes([0, 1], [placed(), placed((1, 0, 0))])
TURN = wf.Keyframes([0, 0.4, 1], [placed(), placed((0.5, 0.2, 0), 60), placed((1.5, 0, 0.5), 170)])


def view(size=16, **changes):
    return wf.Camera.look_at(**{"origin": (0, 2, 6), "target": (0, 0, 0), "fov": 40, "size": size, **changes})


def blob(rings=12):
    """A mesh that deforms: vertices (3, n, 3) at three times, and faces."""
    polar, around = np.linspace(0.01, np.pi - 0.01, rings), np.linspace(0, 2 * np.pi, 2 * rings)
    p, a = (each.ravel() for each in np.meshgrid(polar, around, indexing="ij"))
    v = 0.6 * np.stack([np.sin(p) * np.cos(a), np.cos(p), np.sin(p) * np.sin(a)], 1)
    row, column = (x.ravel() for x in np.indices((rings - 1, 2 * rings - 1)))
    first = row * 2 * rings + column
    next_row = first + 2 * rings
    faces = [
        np.stack(each, 1) for each in ((first, first + 1, next_row), (first + 1, next_row + 1, next_row))
    ]
    return np.stack([v, v * (1, 0.6, 1) + (0.4, 0, 0), v * (0.8, 1.3, 0.8) + (1.2, 0.2, 0)]), np.concatenate(
        faces
    )


def floor():
    return wf.Rectangle((-3, -0.6, 3), (6, 0, 0), (0, 0, -6), material=wf.Diffuse(0.6))


def lights():
    return [wf.PointLight((1, 4, 2), 60), wf.Environment(0.3)]


def turning_skies():
    """An image, a sky with its sun, and a disk of light; the disk is still."""
    pixels = np.random.default_rng(3).random((8, 16, 3)) ** 3
    return [
        wf.Environment(pixels, transform=TURN, backdrop=pixels[::-1]),
        wf.Sky.cie(12, (1, 1, 0.5), horizontal=1, direct_normal=0.5).transformed(TURN),
        wf.DirectionalLight((0.4, -1, 0.3), 1, angle=25),
    ]


def scenes():
    """Scenes in which something moves from 0 to 1 s, by name."""
    box = wf.Box((0, 0, 0), 0.8, material=wf.Diffuse((0.3, 0.7, 0.2)))
    ball = wf.Sphere((0, 0, 0), 0.5, material=wf.Diffuse((0.7, 0.3, 0.2)))
    vertices, faces = blob()
    lamp = wf.Rectangle((-0.4, 1.2, -0.4), (0.8, 0, 0), (0, 0, 0.8), emission=8)
    many = np.array([[(0, 0, 0), (-1, 0.3, 0)], [(1, 0, 0), (-1, 0.3, 1)]])
    moving = view().transformed(wf.Keyframes([0, 1], [np.eye(4), placed((0.3, -0.1, -0.2), 4)]))
    spot = wf.SpotLight((0, 3, 0), 50, direction=(0, -1, 0.2))
    return {
        "instance": wf.Scene([floor(), box.transformed(TURN)], lights(), view()),
        "sphere": wf.Scene([floor(), ball.transformed(TURN)], lights(), view()),
        "deforming": wf.Scene([floor(), wf.Mesh(vertices, faces, times=[0, 0.3, 1])], lights(), view()),
        "smooth": wf.Scene(
            [floor(), wf.Mesh(vertices, faces, times=[0, 0.3, 1], smooth=True).transformed(SLIDE)],
            lights(),
            view(),
        ),
        "spheres": wf.Scene(
            [floor(), wf.Spheres(many, 0.4, times=[0, 1]).transformed(TURN)], lights(), view()
        ),
        "point": wf.Scene([floor(), box], [wf.PointLight((-1.5, 1.5, 0.5), 10).transformed(TURN)], view()),
        "spot": wf.Scene([floor(), box], [spot.transformed(TURN)], view()),
        "lamp": wf.Scene([floor(), ball, lamp.transformed(TURN)], [], view()),
        "bulb": wf.Scene([floor(), box, wf.Sphere((0, 1, 0), 0.3, emission=9).transformed(TURN)], [], view()),
        "glowing blob": wf.Scene(
            [floor(), wf.Mesh(vertices + np.array([0, 0.6, 0]), faces, times=[0, 0.3, 1], emission=2)],
            [],
            view(),
        ),
        "camera": wf.Scene([floor(), box, ball.translated((1, 0, 0))], lights(), moving),
        "sky": wf.Scene([floor(), box], turning_skies(), view()),
    }


SCENES = scenes()


@pytest.mark.parametrize("name", ["instance", "deforming", "camera", "lamp"])
@pytest.mark.first(2)
def test_blurred_picture_is_the_mean_of_stills(name):
    assert_mean_of_stills(SCENES[name], runs=4, strata=3, spp=6)


@pytest.mark.slow
@pytest.mark.parametrize("accel", ["numpy", "embree"])
@pytest.mark.parametrize("name", SCENES)
def test_blurred_pictures_are_means_of_stills(name, accel):
    assert_mean_of_stills(SCENES[name], runs=6, strata=64, spp=64, still_spp=1, accel=accel)


def coverage(edges, width, way):
    """What a bar of a width, which goes a way at constant speed from 0, covers between edges (k + 1,)."""

    def covered(x):
        """The part of the time for which the bar is over x: a trapezoid."""
        return max(min(x, way) - max(x - width, 0), 0) / way

    kinks = [0, width, way, width + way]
    return [
        integrate.quad(covered, a, b, points=[x for x in kinks if a < x < b] or None)[0] / (b - a)
        for a, b in pairwise(edges)
    ]


def columns_of_alpha(shape, width, samples=128, **options):
    """The mean alpha of columns of pixels that see a shape from above, and its standard errors at most."""
    camera = wf.Camera.orthographic((0, 0, 5), (0, 0, 0), height=width * 4, size=(16, 64))
    image = render(wf.Scene([shape], wf.Environment(1), camera), samples, aovs="alpha", **OPTIONS, **options)
    alpha = image.layers["alpha"].astype(float).reshape(64, 16)
    return alpha.mean(0), alpha.std(0, ddof=1) / 8


def assert_columns(found, expected, batches=64):
    """Test the means of columns, of some batches, against exact ones."""
    mean, error = found
    assert error.max() < 0.008
    off = np.abs(mean - expected)
    assert (off <= stats.t.ppf(1 - ALPHA / 2 / 16, batches - 1) * error + 1e-4).all(), (mean, expected, error)


def test_alpha_of_a_bar_that_crosses_pixels_is_a_trapezoid():
    bar = wf.Rectangle((0, -99, 0), (1.1, 0, 0), (0, 198, 0))
    slide = wf.Keyframes([2, 4], [placed((-3, 0, 0)), placed((0.7, 0, 0))])
    found = columns_of_alpha(bar.transformed(slide), 8, shutter=(2, 4))
    assert_columns(found, coverage(np.linspace(-1, 7, 17), 1.1, 3.7))


def test_alpha_of_a_disk_that_crosses_pixels_is_a_trapezoid():
    """The disk of a sphere, seen by parallel rays, is at each height a bar as wide as the chord there."""
    camera = wf.Camera.orthographic((0, 0.3, 5), (0, 0.3, 0), height=0.25, size=(16, 1))
    slide = wf.Keyframes([0, 1], [placed((-1.3, 0, 0)), placed((0.4, 0, 0))])
    scene = wf.Scene([wf.Sphere((0, 0, 0), 0.5).transformed(slide)], wf.Environment(1), camera)
    runs = np.stack(
        [
            render(scene, 128, shutter=(0, 1), aovs="alpha", seed=seed, **OPTIONS).layers["alpha"].ravel()
            for seed in range(16)
        ]
    ).astype(float)
    heights = 0.3 + (np.arange(64) + 0.5) / 256 - 0.125
    chords = 2 * np.sqrt(0.25 - heights**2)
    edges = np.linspace(-2, 2, 17) + 1.3
    expected = np.mean([coverage(edges + chord / 2, chord, 1.7) for chord in chords], 0)
    assert_columns((runs.mean(0), runs.std(0, ddof=1) / 4), expected, 16)


def mean_of_floor(scene, spp, **options):
    """The mean and the standard error of batches of a picture, by rows of pixels."""
    image = render(scene, spp, **OPTIONS, **options).rgb.astype(float).mean(2)
    rows = image.mean(1)
    return rows.mean(), rows.std(ddof=1) / np.sqrt(rows.size)


def test_lamp_that_moves_over_a_table():
    """The irradiance is the mean of I cosθ / d² over the way, by quadrature; and that of a small sphere."""
    table = wf.Rectangle((-0.01, 0, 0.01), (0.02, 0, 0), (0, 0, -0.02), material=wf.Diffuse(0.5))
    camera = wf.Camera.orthographic((0, 1, 0), (0, 0, 0), up=(0, 0, 1), height=0.01, size=(4, 32))
    slide = wf.Keyframes([0, 1], [placed((-1, 0, 0)), placed((2, 0, 0))])
    lamp = wf.PointLight((0, 1.5, 0.5), 4).transformed(slide)
    bulb = wf.Sphere((0, 1.5, 0.5), 0.1, emission=4 / (np.pi * 0.01)).transformed(slide)
    exact = integrate.quad(lambda x: 4 * 1.5 / (x * x + 1.5**2 + 0.25) ** 1.5, -1, 2)[0] / 3 * 0.5 / np.pi
    for scene in (wf.Scene([table], lamp, camera), wf.Scene([table, bulb], [], camera)):
        mean, error = mean_of_floor(scene, 64, shutter=(0, 1), max_bounces=1)
        assert error < 0.01 * exact
        assert abs(mean - exact) < 4 * error


def test_mirror_that_turns_shows_a_bar_as_long_as_it_does():
    """A ray comes back turned by twice the angle: it meets the bar for a part of the time."""
    mirror = wf.Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0), material=wf.Mirror())
    turn = wf.Keyframes([0, 1], [placed(degrees=-20), placed(degrees=25)])
    low, high = np.tan(np.radians([10, 40]))  # of the bar, seen from the middle of the mirror
    bar = wf.Rectangle((low * 3, -9, 3), (0, 18, 0), (high * 3 - low * 3, 0, 0), emission=1, two_sided=True)
    camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), fov=0.01, size=(4, 64))
    scene = wf.Scene([mirror.transformed(turn), bar], [], camera)
    mean, error = mean_of_floor(scene, 64, shutter=(0, 1), max_bounces=1)
    assert error < 0.01
    assert abs(mean - 15 / 45) < 4 * error


def test_shutter_curve_weighs_times():
    bar = wf.Rectangle((-24, -99, 0), (20, 0, 0), (0, 198, 0))  # its edge crosses the picture
    slide = wf.Keyframes([0, 1], [placed(), placed((8, 0, 0))])
    found = columns_of_alpha(bar.transformed(slide), 8, shutter=(0, 1), shutter_curve="triangle")
    until = [2 * u * u if u < 0.5 else 1 - 2 * (1 - u) ** 2 for u in np.linspace(0, 1, 1601)]
    # the edge comes to u at the time u: the mean over a pixel of the part of the light after that
    cells = (np.add.accumulate(until) - 0.5 * np.array(until))[::100] / 1600
    assert_columns(found, 1 - np.diff(cells) * 16)


# --- What does not change ----------------------------------------------------------------------------


def test_still_scene_pays_nothing_for_a_shutter():
    box, fall = wf.Box((0, 0, 0), 0.8), wf.Keyframes([2, 3], [placed(), placed((0, 1, 0))])
    for shape in (box, box.transformed(fall)):  # the latter moves when the shutter is closed
        scene = wf.Scene([floor(), shape], lights(), view())
        expected = render(scene, 2, **OPTIONS).rgb
        assert np.array_equal(render(scene, 2, shutter=(0, 1), **OPTIONS).rgb, expected)
    assert "Exposure" not in str(wf.program(wf.Scene([floor(), box], lights(), view()), shutter=(0, 1)))


@pytest.mark.parametrize("name", ["instance", "deforming"])
def test_same_bits_for_any_waves(name):
    scene = SCENES[name]
    expected = render(scene, 4, shutter=(0, 1), **OPTIONS).rgb
    for changes in ({"wave_size": 100}, {"workers": 2, "executor": "threads", "wave_size": 300}):
        assert np.array_equal(render(scene, 4, shutter=(0, 1), **OPTIONS, **changes).rgb, expected)


def test_checkpoint_goes_on_with_the_same_bits(tmp_path):
    scene, path = SCENES["lamp"], tmp_path / "blur.wfck"
    whole = render(scene, 8, shutter=(0, 1), **OPTIONS).rgb
    render(scene, 3, shutter=(0, 1), checkpoint=path, **OPTIONS)
    assert np.array_equal(render(scene, 8, shutter=(0, 1), checkpoint=path, **OPTIONS).rgb, whole)
    with pytest.raises(wf.SceneError, match="shutter was"):
        render(scene, 9, shutter=(0, 0.5), checkpoint=path, **OPTIONS)


@pytest.mark.parametrize("shutter", [(1, 1), (2, 1), (0,), (0, np.inf), 3])
def test_malformed_shutter_is_refused(shutter):
    with pytest.raises(wf.SceneError, match="shutter"):
        render(SCENES["instance"], 1, shutter=shutter)


def test_shared_paths_are_refused_where_a_sensor_is_read_in_turn():
    """Pixels of different rows see the scene at different times."""
    options = {**OPTIONS, "reuse": True, "shutter": (0, 0.5)}
    for name in ("instance", "point"):
        scene = SCENES[name]
        with pytest.raises(wf.SceneError, match="must see the scene at one time"):
            render(scene, 1, camera=scene.camera.replace(rolling_shutter=0.5), **options)
    render(SCENES["camera"], 1, camera=SCENES["camera"].camera.replace(rolling_shutter=0.5), **options)


def under_a_ceiling(*shapes, lamps):
    """A floor seen from above, which gets the light of a ceiling that lamps shine at."""
    above = wf.Rectangle((-3, 2, -3), (6, 0, 0), (0, 0, 6), material=wf.Diffuse(0.8))
    camera = wf.Camera.orthographic((0, 0.5, 0), (0, 0, 0), up=(0, 0, -1), height=4, size=28)
    return wf.Scene([floor(), above, *shapes], [*lamps], camera)


def at_two_places(first, then, moment, thing):
    """A thing that is away by `first`, and from a moment on by `then`."""
    times = [0, moment - 1e-3, moment + 1e-3, 1]
    return thing.transformed(wf.Keyframes(times, [placed(each) for each in (first, first, then, then)]))


UPWARDS = wf.SpotLight((1.5, 0.9, 0), 10, direction=(-0.3, 1, 0), angle=60)


def test_shared_paths_do_not_mix_times():
    """The lamp is on from 0.5 s on, when a black plate covers the left half: nothing lights that ever."""
    plate = wf.Rectangle((-3, 0, 3), (3, 0, 0), (0, 0, -6), material=wf.Diffuse(0), two_sided=True)
    plate = at_two_places((0, -50, 0), (0, -0.5, 0), 0.5, plate)
    scene = under_a_ceiling(plate, lamps=[at_two_places((0, -50, 0), (0, 0, 0), 0.5, UPWARDS)])
    rgb = render(scene, 16, shutter=(0, 1), **{**OPTIONS, "reuse": True}).rgb
    assert (rgb[:, :14] == 0).all()
    assert rgb[:, 14:].mean() > 0.01


def test_shared_paths_see_what_is_between_them_at_their_times():
    """A plate hides the ceiling from the left of the floor at all times, but not in the very middle.

    With this seed no path comes then.
    """
    plate = wf.Rectangle((-3, -0.2, 3), (3, 0, 0), (0, 0, -6), material=wf.Diffuse(0), two_sided=True)
    away = [placed((0, 50 * (k in (2, 3)), 0)) for k in range(6)]
    plate = plate.transformed(wf.Keyframes([0, 0.49998, 0.49999, 0.50001, 0.50002, 1], away))
    scene = under_a_ceiling(plate, lamps=[UPWARDS])
    camera = wf.Camera.orthographic((0, -0.3, 0), (0, -0.6, 0), up=(0, 0, -1), height=4, size=28)
    rgb = render(scene, 16, camera=camera, seed=2, shutter=(0, 1), **{**OPTIONS, "reuse": True}).rgb
    assert (rgb[:, :9] == 0).all()
    assert rgb[:, 14:].mean() > 0.01


def test_paths_that_are_shared_have_one_time():
    camera, sampler = view(28), make_sampler("sobol", 3, 28)
    tiles, pixel = camera.tiles, np.arange(28 * 28, dtype=np.uint32)
    scene = SCENES["instance"]
    scene = compile_scene(scene, lambda geometry: make_accelerator(geometry, "numpy"), asked=ASKED)
    seen = seen_with(seen_by(scene, camera, Shutter(0, 1)), tiles=tiles)
    time = generate(seen, camera, sampler, pixel, np.zeros(pixel.size, np.uint32)).time
    tile, _ = tiles.place(pixel)
    assert np.unique(time).size == 49 == np.unique(tile).size
    assert np.unique(np.stack([tile, time]), axis=1).shape[1] == 49


def test_trace_shows_the_time_of_each_path():
    trace = wf.trace(SCENES["instance"], shutter=(0.2, 0.4))
    step = next(each for each in trace if each.stage == "generate")
    time = step.paths.time
    assert time.dtype == np.float64
    assert 0.2 <= time.min() < 0.21 < 0.39 < time.max() <= 0.4
    path = wf.trace(SCENES["instance"], shutter=(0.2, 0.4)).path((3, 2))
    assert path.time == time[2 * 16 + 3]
    assert f"at {path.time:.6g} s" in repr(path)


def test_times_of_a_pixel_are_stratified():
    camera = view(4)
    sampler = make_sampler("sobol", 3, 4)
    compiled = compile_scene(wf.Scene([floor()]), lambda geometry: make_accelerator(geometry, "numpy"))
    seen = seen_by(compiled, SCENES["camera"].camera, Shutter(0, 1))
    paths = generate(seen, camera, sampler, np.full(64, 5, np.uint32), np.arange(64, dtype=np.uint32))
    assert sorted(np.floor(paths.time * 64)) == list(range(64))


def test_shape_that_shrinks_to_nothing():
    """It is seen for a part of the time that falls with the distance from the middle."""

    class Shrink(wf.Motion):
        start, end = 0.0, 1.0

        def at_times(self, times):
            scale = np.tile(np.eye(4), (len(times), 1, 1))
            scale[:, :3, :3] *= (1 - np.clip(times, 0, 1))[:, None, None]
            return scale

    plate = wf.Rectangle((-4, -99, 0), (8, 0, 0), (0, 198, 0))
    camera = wf.Camera.orthographic((0, 0, 5), (0, 0, 0), height=0.5, size=(16, 1))
    image = render(
        wf.Scene([plate.transformed(Shrink()), wf.Sphere((0, 9, 0), 0.1)], wf.Environment(1), camera),
        4096,
        shutter=(0, 1),
        aovs="alpha",
        **OPTIONS,
    )
    middle = np.abs((np.arange(16) - 7.5) / 2)
    np.testing.assert_allclose(image.layers["alpha"].ravel(), 1 - middle / 4, atol=0.03)


# --- With all else -----------------------------------------------------------------------------------


def filled(bsdf, **medium):
    return wf.Material(bsdf, interior=wf.Medium(**medium))


def mixed_scene():
    """What moves, and what light does beside it, by name: scenes and settings."""
    box, ball = wf.Box((0, 0, 0), 0.8), wf.Sphere((0, 0, 0), 0.5)
    glass, gold = wf.Dielectric(1.5), wf.Conductor("gold", roughness=0.3)
    amber, fog = filled(glass, absorption=(0.2, 1, 3)), filled(wf.NullSurface(), scattering=2)
    lamp = wf.Rectangle((-0.6, 2, -0.6), (1.2, 0, 0), (0, 0, 1.2), emission=6)
    walls = wf.Box((0, 1.4, 0), 4, material=wf.Diffuse(0.7))
    leaf = wf.Material(wf.Diffuse(0.5), alpha=0.5)
    catcher = wf.Rectangle((-3, -0.6, 3), (6, 0, 0), (0, 0, -6), material=wf.ShadowCatcher())

    def of(*shapes, **settings):
        return wf.Scene([floor(), lamp, *shapes], [], view()), settings

    def carried(shape, material):
        shape = shape.transformed(TURN)
        shape.material = material
        return shape

    return {
        "glass": of(carried(box, glass)),
        "gold": of(carried(ball, gold)),
        "absorbing": of(carried(box, amber)),
        "fog": of(carried(ball, fog)),
        "in fog": (
            wf.Scene([floor(), lamp, carried(box, gold)], [], view(), medium=wf.Medium(scattering=0.1)),
            {},
        ),
        "alpha": of(carried(box, leaf)),
        "catcher": (wf.Scene([catcher, carried(box, gold)], lights(), view()), {}),
        "guide": of(carried(box, gold), guide=True),
        "branches": of(carried(box, gold), branches=4),
        "caustics": of(carried(box, gold), wf.Sphere((-1, 0.3, 0), 0.5, material=glass), caustics=True),
        "camera in glass": (
            wf.Scene([floor(), lamp, carried(ball, fog)], [], view(origin=(0.4, 0.1, 0.2))),
            {},
        ),
        "lamp in a room": (wf.Scene([walls, lamp.transformed(SLIDE)], [], view(origin=(0, 1, 1.8))), {}),
        "shared": (
            wf.Scene([walls, lamp, carried(box, gold)], [], view(origin=(0, 1, 1.8))),
            {"reuse": True},
        ),
        "shared in glass": of(carried(box, gold), carried(ball, amber).translated((1, 0.5, 0)), reuse=True),
        "direct": of(carried(box, gold), integrator="direct_mis"),
        "naive": (
            wf.Scene([floor(), lamp, carried(box, gold)], lights()[1:], view()),
            {"integrator": "naive"},
        ),
    }


MIXED = mixed_scene()


@pytest.mark.slow
@pytest.mark.parametrize("accel", ["numpy", "embree"])
@pytest.mark.parametrize("name", MIXED)
def test_blurred_pictures_are_means_of_stills_with_all_else(name, accel):
    scene, settings = MIXED[name]
    strata = 16 if "guide" in settings else 64  # each still has a training of its own
    assert_mean_of_stills(
        scene, runs=6, strata=strata, spp=64, still_spp=64 // strata, accel=accel, max_error=0.05, **settings
    )


def crossed():
    """What else moves than instances, with what light does beside it: scenes and settings by both names."""
    vertices, faces = blob()
    lamp = wf.Rectangle((-0.6, 2, -0.6), (1.2, 0, 0), (0, 0, 1.2), emission=6)
    moving = {
        "camera": wf.Scene([floor(), lamp, wf.Box((0, 0, 0), 0.8)], [], SCENES["camera"].camera),
        "deforming": wf.Scene([floor(), lamp, wf.Mesh(vertices, faces, times=[0, 0.3, 1])], [], view()),
        "lamp": wf.Scene([floor(), lamp.transformed(TURN), wf.Box((0, 0, 0), 0.8)], [], view()),
        "sky": wf.Scene([floor(), wf.Box((0, 0, 0), 0.8)], turning_skies(), view()),
    }
    ball = wf.Sphere((-0.9, 0.1, 1), 0.5, material=wf.Dielectric(1.5))
    cloud = wf.Sphere((-0.9, 0.1, 1), 0.5, material=filled(wf.NullSurface(), scattering=2))
    found = {}
    for name, scene in moving.items():
        fog = wf.Scene(scene.shapes, [], scene.camera, medium=wf.Medium(scattering=0.1))
        if scene.lights:  # at infinity, which no fog around all lets through
            fog = wf.Scene([*scene.shapes, cloud], scene.lights, scene.camera)
        found[f"{name}, glass"] = wf.Scene([*scene.shapes, ball], scene.lights, scene.camera), {}
        found[f"{name}, fog"] = fog, {}
        found[f"{name}, guide"] = scene, {"guide": True}
        found[f"{name}, branches"] = scene, {"branches": 4}
        found[f"{name}, shared"] = scene, {"reuse": True}
    return found


CROSSED = crossed()


@pytest.mark.slow
@pytest.mark.parametrize("name", CROSSED)
def test_each_motion_goes_with_all_else(name):
    scene, settings = CROSSED[name]
    strata = 16 if "guide" in settings else 64
    assert_mean_of_stills(
        scene, runs=4, strata=strata, spp=64, still_spp=64 // strata, max_error=0.05, **settings
    )


def test_file_that_is_read_anew_for_each_time(tmp_path):
    """As of USD: its meshes go along lines between the forms of some times."""
    pytest.importorskip("pxr")
    path = tmp_path / "slide.usda"
    path.write_text(
        """#usda 1.0
(
    metersPerUnit = 1
    timeCodesPerSecond = 1
    startTimeCode = 0
    endTimeCode = 1
)
def Mesh "bar" {
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, -99, 0), (1.1, -99, 0), (1.1, 99, 0), (0, 99, 0)]
    double3 xformOp:translate.timeSamples = { 0: (-3, 0, 0), 1: (0.7, 0, 0) }
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
    )
    camera = wf.Camera.orthographic((0, 0, 5), (0, 0, 0), height=32, size=(16, 64))
    image = render(
        wf.load(path).add(wf.Environment(1)), 64, camera=camera, shutter=(0, 1), aovs="alpha", **OPTIONS
    )
    alpha = image.layers["alpha"].astype(float).reshape(64, 16)
    expected = coverage(np.linspace(-1, 7, 17), 1.1, 3.7)
    assert_columns((alpha.mean(0), alpha.std(0, ddof=1) / 8), expected)


@pytest.mark.parametrize("size", [1e-12, 1e15])
def test_meshes_of_any_size_deform_alike(size):
    """Lengths of very small and very large scenes are traced in another unit."""
    corner = np.array([(-1, 0, 0), (1, 0, 0), (0, 1, 0)], float)

    def alpha(size):
        mesh = wf.Mesh(np.stack([corner, corner + np.array([0.5, 0.3, 0])]) * size, [(0, 1, 2)], times=[0, 1])
        camera = wf.Camera.look_at((0, 0.3 * size, 4 * size), (0, 0.3 * size, 0), fov=40, size=12)
        scene = wf.Scene([mesh], wf.Environment(1), camera)
        return render(scene, 4, shutter=(0, 1), aovs="alpha", **OPTIONS).layers["alpha"]

    np.testing.assert_allclose(alpha(size).mean(), alpha(1).mean(), rtol=0.01)
    assert alpha(size).max() == 1


def test_where_smooth_meshes_are_over_time_needs_no_normals(monkeypatch):
    """These take longer than all else; an instance of the mesh needs none, either."""
    vertices, faces = blob()
    mesh, computed = wf.Mesh(vertices, faces, times=[0, 0.3, 1], smooth=True), []
    scene = wf.Scene([mesh, wf.Instance(mesh, placed((2, 0, 0)))])
    monkeypatch.setattr(wf.Mesh, "compute_normals", lambda *given: computed.append(given))
    np.testing.assert_allclose(scene.reach[1], [1.2 + 0.48 + 2, 0.98, 0.6], atol=0.01)
    assert not computed
