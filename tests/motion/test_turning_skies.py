"""Lights at infinity that turn while the shutter is open: each path meets them as they are at its time."""

import numpy as np
import pytest
from inside import Receiver, brightest_emitter, compile_scene, make_accelerator
from scipy import stats
from significance import assert_mean, measure, render
from test_motion_blur import ASKED, OPTIONS, placed

import wavefront as wf

PIXELS = np.random.default_rng(3).random((8, 16, 3)) ** 3
SPIN = wf.Keyframes([0, 1], [placed((0, 0, 0), 10), placed((90, 2, 3), 130)])  # its ways have no effect
TIP = wf.Keyframes([0, 1], [np.eye(4), placed(degrees=50, axis=0)])
TURNED = wf.Keyframes([0, 0.5, 1], [placed(degrees=-each, axis=2) for each in (0, 90, 180)])
CLEAR = wf.Sky.cie(12, (1, 1, 0.5), horizontal=1)
SUN = wf.DirectionalLight((0.4, -1, 0.3), 1.5, angle=25)
SHOWN = {
    "image": [wf.Environment(PIXELS, transform=SPIN, filter="nearest")],
    "backdrop": [wf.Environment(1, transform=SPIN, backdrop=PIXELS)],
    "sky": [CLEAR.transformed(TIP)],
    "sum": [wf.Environment(PIXELS, transform=SPIN), CLEAR, SUN.transformed(TIP)],
}


def compiled(shapes, lights):
    """A scene while the shutter is open from 0 to 1 s."""
    make = lambda geometry: make_accelerator(geometry, "numpy")  # noqa: E731
    return compile_scene(wf.Scene(shapes, lights), make, asked=ASKED, mis=True)


def radiance_from(light, direction):
    """What a light that is still sends from a direction (3,)."""
    return light.record(np.zeros(3)).le(direction[:, None])[:, 0]


@pytest.mark.parametrize("name", SHOWN)
def test_each_ray_sees_the_sky_of_its_time(name):
    """Those of the camera, which see a backdrop, and those that a mirror has sent on."""
    ball = wf.Sphere((0, 0, 0), 1, material=wf.Mirror())
    view = wf.Camera.look_at((0, 0.5, 4), (0, 0.3, 0), fov=45, size=8).replace(rolling_shutter=0.1)
    steps = list(wf.trace(wf.Scene([ball], SHOWN[name], view), shutter=(0.2, 0.7)))
    due, reflected = np.zeros_like(steps[-1].light), 0
    for step in (each for each in steps if each.stage == "intersect"):
        missed = np.flatnonzero(step.hits.prim < 0)
        reflected += missed.size * step.bounce
        for lane in missed.tolist():
            for light in (light.at(step.paths.time[lane]) for light in SHOWN[name]):
                shown = light.backdrop if name == "backdrop" and step.bounce == 0 else light
                due[:, step.paths.slot[lane]] += radiance_from(shown, step.paths.direction[:, lane])
    assert reflected > 5
    np.testing.assert_allclose(steps[-1].light, due, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("name", ["image", "in texels", "sky", "sum"])
def test_samples_have_the_density_of_their_time(name):
    """Chi-square over parts of the sphere, in which the density is integrated by evenly spread directions."""
    shown = [in_texels()] if name == "in texels" else SHOWN[name]
    lights, count, at = compiled([PLANE], shown).lights, 1 << 15, (0.0, 0.7)
    number = np.arange(1 << 17) + 0.5
    y, turns = 1 - 2 * number / number.size, number * (5**0.5 - 1) / 2
    level = np.sqrt(1 - y * y)
    every = np.stack([level * np.cos(2 * np.pi * turns), y, level * np.sin(2 * np.pi * turns)]).astype(
        np.float32
    )
    for time in at:
        u = np.random.default_rng(3).random((3, count), np.float32)
        drawn, _ = lights.sample_li(np.zeros((3, count), np.float32), u[0], u[1:], facing(count, time))
        place = np.zeros((3, number.size), np.float32)
        pdf = lights.pdf_li(np.zeros(number.size, np.intp), place, every, facing(number.size, time))
        due = np.bincount(part_of(every), pdf, 64) * 4 * np.pi / number.size
        assert due.sum() == pytest.approx(1, abs=3e-3)
        found = np.bincount(part_of(drawn.wi), minlength=64)
        assert stats.chisquare(found[due > 0], count * due[due > 0] / due.sum()).pvalue > 1e-4
        seen = lights.turning.le_at(drawn.wi, np.full(count, time))
        differs = np.abs(seen - drawn.radiance).max(0) > 1e-3 * seen.max(0)
        assert differs.mean() < 1e-3  # at edges of pixels


def in_texels():
    """An image that a light that is still would be sampled from by means over texels."""
    light = wf.Environment(np.kron(PIXELS, np.ones((4, 4, 1))))
    light.sample_in_texels()
    return light.transformed(SPIN)


def facing(n, time):
    """Surfaces that face up, at a time."""
    return Receiver(np.float32([[0], [1], [0]]).repeat(n, 1), np.ones(n, bool), time=np.full(n, time))


def part_of(wi):
    """The parts (n,) of the sphere in which directions lie, eight by eight of equal size."""
    row = np.minimum(4 * (wi[1] + 1), 7).astype(np.intp)
    return 8 * row + np.minimum((np.arctan2(wi[0], wi[2]) / np.pi + 1) * 4, 7).astype(np.intp)


def test_samples_are_drawn_for_the_side_that_a_surface_faces_then():
    lights = compiled([PLANE], [wf.Environment(PIXELS, transform=TURNED)]).lights
    for time in (0.0, 0.5, 1.0):
        u = np.random.default_rng(3).random((3, 4096), np.float32)
        drawn, _ = lights.sample_li(np.zeros((3, 4096), np.float32), u[0], u[1:], facing(4096, time))
        assert (drawn.wi[1] > 0).mean() > 0.8


def test_a_small_sun_is_on_its_way_however_far_its_motion_carries_it():
    keys = wf.Keyframes([0, 1], [np.eye(4), placed((1e6, 0, -1e5), 150, axis=0)])
    sun = wf.DirectionalLight((0.1, -1, 0.2), 1, angle=0.05).transformed(keys)
    times = np.linspace(0, 1, 57)
    toward = np.stack([-sun.at(time).direction for time in times.tolist()], 1).astype(np.float32)
    assert (compiled([PLANE], [sun]).lights.turning.le_at(toward, times) > 0).all()


# --- A sky of which one half is bright, above a plane --------------------------------------------------

HALF = np.ones((2, 4, 3)) * np.array([1.0, 1, 0, 0])[:, None]  # bright towards +x
PLANE = wf.Rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2), material=wf.Diffuse(0.5))
ABOVE = wf.Camera.orthographic((0, 1, 0), (0, 0, 0), up=(0, 0, 1), height=0.5, size=8)


def half_sky(**changes):
    return wf.Environment(HALF, transform=TURNED, filter="nearest", **changes)


def irradiance(begin, end):
    """π/2·(1 + cos α), where the bright half is α from the zenith: π/2 − π·t at the time t. Its mean."""
    return np.pi / 2 + (np.cos(np.pi * begin) - np.cos(np.pi * end)) / (2 * (end - begin))


@pytest.mark.parametrize("integrator", ["naive", "direct_simple", "direct_mis", "full"])
@pytest.mark.parametrize("shutter", [(0, 1), (0.1, 0.3)])
def test_irradiance_by_a_sky_that_turns(integrator, shutter):
    scene = wf.Scene([PLANE], half_sky(), ABOVE)
    options = {**OPTIONS, "integrator": integrator, "shutter": shutter, "max_bounces": 1}
    assert_mean(measure(scene, 256, **options), irradiance(*shutter) * 0.5 / np.pi, 0.01)


def test_groups_of_light_are_those_of_each_time():
    """Of a sum of lights, each part is divided by what they send at the time of the path."""
    parts = [half_sky(group="half"), wf.DirectionalLight((0, -1, 0), 1, angle=120, group="sun")]
    image = render(wf.Scene([PLANE], parts, ABOVE), 64, shutter=(0, 0.4), aovs="light_groups", **OPTIONS)
    light = image.light_groups
    for name, due in (("half", irradiance(0, 0.4)), ("sun", 1)):
        pixels = light[name].astype(float).mean(2).ravel() * np.pi / 0.5
        error = pixels.std(ddof=1) / np.sqrt(pixels.size)
        assert error < 0.02
        assert abs(pixels.mean() - due) < 4 * error


def test_shadow_catcher_below_a_sky_that_turns():
    """A wall hides one side: of the bright half, 1/(1 + sin θ) of its light at the time θ/π up to 0.5."""
    catcher = wf.Rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2), material=wf.ShadowCatcher())
    wall = wf.Rectangle((0.001, 0, 50), (0, 50, 0), (0, 0, -100), material=wf.Diffuse(0))
    camera = wf.Camera.orthographic((-0.02, 1, 0), (-0.02, 0, 0), up=(0, 0, 1), height=0.01, size=8)
    scene = wf.Scene([catcher, wall], half_sky(), camera)

    alpha = render(scene, 128, aovs="alpha", shutter=(0, 0.5), **OPTIONS).alpha.astype(float)
    error = alpha.std(ddof=1) / 8
    assert error < 0.01
    assert abs(alpha.mean() - 2 / np.pi) < 4 * error


# --- What does not change ------------------------------------------------------------------------------


def test_even_light_pays_nothing_for_a_turn():
    box = wf.Box((0, 0.5, 0), 1)
    turning = wf.Scene([PLANE, box], wf.Environment(0.7, transform=TURNED, backdrop=(1, 0, 0)), ABOVE)
    still = wf.Scene([PLANE, box], wf.Environment(0.7, backdrop=(1, 0, 0)), ABOVE)
    pictures = [render(scene, 4, shutter=(0, 1), **OPTIONS).rgb for scene in (turning, still)]
    pictures.append(render(still, 4, **OPTIONS).rgb)
    np.testing.assert_array_equal(pictures[0], pictures[2])
    np.testing.assert_array_equal(pictures[1], pictures[2])
    assert compiled(turning.shapes, turning.lights).motion is None
    assert compiled([PLANE], SHOWN["backdrop"]).lights.turning is None


def test_brightest_is_what_meets_at_some_time():
    """A disk of the sky passes before the brightest pixel of an image."""
    pixels = np.ones((8, 16, 3)) * 0.01
    pixels[3, 5] = 7, 5, 3
    lights = [wf.Environment(pixels, transform=SPIN, filter="nearest"), SUN.transformed(TIP)]
    disk = 1.5 / (np.pi * np.sin(np.radians(12.5)) ** 2)
    np.testing.assert_allclose(
        brightest_emitter(compiled([PLANE], lights)), np.array([7, 5, 3]) + disk, rtol=1e-4
    )
