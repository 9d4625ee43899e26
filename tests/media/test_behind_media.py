"""What media leave of backgrounds, of alpha, and of the light on shadow catchers: by Beer and Lambert."""

import numpy as np
import pytest

import wavefront as wf

RGB = np.array([0.3, 1.0, 2.0])
WHITE = (1.0, 1.0, 1.0)
UP = wf.Camera.look_at((0, 0, 4), (0, 0, 0), fov=2, size=(4, 4))
QUIET = {"workers": 1, "progress": False}


def slab(kind: str, color=RGB, thickness: float = 1.0, place=(0, 0, 0)) -> wf.Shape:
    """A slab of extinction `color` across the view."""
    color = np.broadcast_to(np.asarray(color, float), 3)
    half = np.array([3, 3, thickness / 2])
    low, high = place - half, place + half
    medium = {
        "absorption": lambda: wf.Medium(color),
        "table": lambda: wf.Medium(color),
        "a little scattering": lambda: wf.Medium(color, 1e-7),
        "scattering": lambda: wf.Medium(0, color),
        "both": lambda: wf.Medium(color / 2, color / 2),
        "grid": lambda: wf.GridMedium(np.ones((2, 2, 2)), [low, high], color / 2, color / 2),
        "absorbing grid": lambda: wf.GridMedium(np.ones((2, 2, 2)), [low, high], color),
    }[kind]()
    material = wf.Material(wf.NullSurface(), interior=medium, priority=1 if kind == "table" else None)
    return wf.Box(place, high - low, material=material)


KINDS = ["absorption", "table", "a little scattering", "scattering", "both", "grid", "absorbing grid"]


def seen(shapes, lights=(), spp: int = 256, **settings) -> wf.Image:
    given = {"camera": UP, "lighting": None, "background": "transparent", **QUIET, **settings}
    return wf.render(wf.Scene(list(shapes), list(lights)), spp=spp, **given)


def agrees(image: wf.Image, value, due) -> None:
    """The mean over the picture within 4.5 standard errors; rays are up to 1.4° aslant, 0.03 % longer."""
    mean = np.asarray(value, float).mean((0, 1))
    spread = np.asarray(value, float).std((0, 1)) / np.sqrt(image.rgb[..., 0].size)
    assert (np.abs(mean - due) <= 4.5 * spread + 1e-4).all(), (mean, due, spread)
    assert (spread < 0.02).all()


@pytest.mark.parametrize("integrator", ["full", "naive"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_background_arrives_by_what_media_leave_of_it(kind: str, integrator: str) -> None:
    color = np.array([1.0, 0.5, 2.0])
    image = seen([slab(kind)], background=color, integrator=integrator)
    agrees(image, image.rgb, color * np.exp(-RGB))
    agrees(image, image.alpha, 1 - np.exp(-RGB).mean())


def test_the_numbers_of_a_slab_before_white() -> None:
    """exp(−0.3), exp(−1), exp(−2)."""
    image = seen([slab("absorption")], background=WHITE, spp=4)
    assert image.rgb == pytest.approx(np.broadcast_to([0.741, 0.368, 0.135], (4, 4, 3)), abs=5e-4)
    assert image.alpha == pytest.approx(1 - (0.741 + 0.368 + 0.135) / 3, abs=5e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_means_over_any_gray_are_those_of_the_picture_with_that_background(kind: str) -> None:
    """In light that the medium scatters, too, sample by sample."""
    for gray in (0.3, 2.0):
        sun = [wf.DirectionalLight((1, 0, -1), 0.7)]
        clear = seen([slab(kind)], sun, spp=16)
        over = (clear.rgb + (1 - clear.alpha[..., None]) * gray).mean(2)
        assert over == pytest.approx(seen([slab(kind)], sun, spp=16, background=gray).rgb.mean(2), abs=2e-5)


@pytest.mark.parametrize("kind", ["absorption", "table", "both"])
def test_veils_unseen_surfaces_and_several_media_on_the_way(kind: str) -> None:
    veil = wf.Rectangle((-3, -3, 1.2), (6, 0, 0), (0, 6, 0), material=wf.Material(wf.Diffuse(0), alpha=0.4))
    lamp = wf.Material(wf.Diffuse(0), visible_to_camera=False)
    unseen = wf.Rectangle((-3, -3, 1.4), (6, 0, 0), (0, 6, 0), material=lamp)
    image = seen([slab(kind), slab(kind, thickness=0.5, place=(0, 0, -2)), veil, unseen], background=WHITE)
    due = 0.6 * np.exp(-1.5 * RGB)
    agrees(image, image.rgb, due)
    agrees(image, image.alpha, 1 - due.mean())
    direct = seen([slab(kind), veil], background=WHITE, aovs=("direct", "indirect"), spp=16)
    assert direct.direct + direct.indirect == pytest.approx(direct.rgb, abs=1e-6)
    assert direct.indirect == pytest.approx(0, abs=1e-6)


def test_surfaces_within_media_cover_what_is_behind_them() -> None:
    """A black disk halfway in the slab: alpha is 1 there; the rest is as without it."""
    half = wf.Rectangle((0, -3, 0), (3, 0, 0), (0, 6, 0), material=wf.Diffuse(0), two_sided=True)
    image = seen([slab("both"), half])
    assert (image.alpha[:, 2:] == 1).all()
    agrees(image, image.alpha[:, :1], 1 - np.exp(-RGB).mean())


def test_what_glass_shows_is_no_background() -> None:
    """Behind refraction there is light, or none: the glass covers."""
    ball = wf.Sphere((0, 0, 0), 1, material=wf.Material(wf.Dielectric(1.5), interior=wf.Medium(RGB)))
    image = seen([ball], background=WHITE, spp=8)
    assert (image.alpha == 1).all()
    assert not image.rgb.any()


@pytest.mark.parametrize("kind", ["absorption", "both"])
def test_a_camera_within_a_medium(kind: str) -> None:
    """Half of a slab is before it."""
    camera = wf.Camera.look_at((0, 0, 0), (0, 0, -4), fov=3.2, size=(4, 4))
    image = seen([slab(kind)], background=WHITE, camera=camera)
    agrees(image, image.rgb, np.exp(-RGB / 2))
    agrees(image, image.alpha, 1 - np.exp(-RGB / 2).mean())


def test_endless_media_hide_all_of_a_background() -> None:
    scene = wf.Scene([wf.Sphere((0, 9, 0), 0.1)], medium=wf.Medium(0.1))
    given = {"lighting": None, "background": WHITE, **QUIET}
    image = wf.render(scene, spp=4, camera=UP, **given)
    assert (image.alpha == 1).all()
    assert not image.rgb.any()


def test_alpha_is_the_same_for_any_division_and_in_files(tmp_path) -> None:
    one = seen([slab("grid")], spp=32)
    two = seen([slab("grid")], spp=32, workers=2, executor="threads", wave_size=100)
    parts = [seen([slab("grid")], spp=None, samples=each) for each in (range(20), range(20, 32))]
    for other in (two, parts[0].merge(parts[1])):
        assert one.alpha.tobytes() == other.alpha.tobytes()
        assert one.errors["alpha"].tobytes() == other.errors["alpha"].tobytes()
    one.save(tmp_path / "smoke.png")
    again = wf.Image.load(tmp_path / "smoke.png")
    assert again.alpha == pytest.approx(one.alpha, abs=1 / 255)


# --- Shadow catchers -----------------------------------------------------------------------------------

FLOOR = wf.Rectangle((-9, 0, -9), (0, 0, 18), (18, 0, 0), material=wf.ShadowCatcher())
ASIDE = wf.Camera.look_at((0, 0.5, 1.5), (0, 0, 0), fov=2, size=(4, 4))
DEPTH = 0.99
SUNS = {
    "sun": wf.DirectionalLight((0, -1, 0), 1),
    "disk": wf.DirectionalLight((0, -1, 0), 1, angle=0.5),
    "point": wf.PointLight((0, 40, 0), 1),
    "ball": wf.Sphere((0, 40, 0), 0.2, emission=1),
}


def cloud(kind: str, depth=DEPTH, height: float = 3.0) -> wf.Shape:
    """A slab of optical depth `depth` above the floor, and above the camera."""
    color = np.broadcast_to(np.asarray(depth, float), 3)
    low, high = np.array((-3, height, -3)), np.array((3, height + 1, 3))
    medium = {
        "absorption": lambda: wf.Medium(color),
        "table": lambda: wf.Medium(color),
        "scattering": lambda: wf.Medium(0, color),
        "both": lambda: wf.Medium(color / 3, color * (2 / 3)),
        "grid": lambda: wf.GridMedium(np.ones((2, 2, 2)), [low, high], color / 3, color * (2 / 3)),
        "absorbing grid": lambda: wf.GridMedium(np.ones((2, 2, 2)), [low, high], color),
        "glowing": lambda: wf.Medium(color, emission=1e-6),
    }[kind]()
    material = wf.Material(wf.NullSurface(), interior=medium, priority=1 if kind == "table" else None)
    return wf.Box((low + high) / 2, high - low, material=material)


@pytest.mark.parametrize("light", SUNS)
@pytest.mark.parametrize(
    "kind", ["absorption", "table", "scattering", "both", "grid", "absorbing grid", "glowing"]
)
def test_a_catcher_sees_the_shadow_of_media(kind: str, light: str) -> None:
    lights = [SUNS[light]] if isinstance(SUNS[light], wf.Light) else []
    shapes = [FLOOR, cloud(kind), *([] if lights else [SUNS[light]])]
    image = seen(shapes, lights, spp=64, camera=ASIDE, max_bounces=0)
    agrees(image, image.alpha, 1 - np.exp(-DEPTH))
    assert 1 - np.exp(-DEPTH) == pytest.approx(0.628, abs=5e-4)


def test_light_in_a_medium_and_a_catcher_in_it() -> None:
    """A point light at the height 2 within a room of smoke: exp(−2σ) from it to the floor, and so on back."""
    sigma, reach = 0.3, np.linalg.norm([0.5, 1.5])
    smoke = wf.Material(wf.NullSurface(), interior=wf.Medium(sigma / 2, sigma / 2))
    room = wf.Box((0, 1, 0), (20, 6, 20), material=smoke)
    floor = wf.Rectangle((-5, 0, -5), (0, 0, 10), (10, 0, 0), material=wf.ShadowCatcher())
    pane = wf.Rectangle((-5, -1, -5), (0, 0, 10), (10, 0, 0), material=wf.Diffuse(0))
    image = seen([room, floor], [wf.PointLight((0, 2, 0), 9)], spp=256, camera=ASIDE, max_bounces=0)
    below = 2 / 0.5 * reach  # to the end of the room behind the floor
    due = 1 - np.exp(-2 * sigma) * np.exp(-sigma * (reach + below))
    agrees(image, image.alpha, due)
    behind = seen([room, floor, pane], [wf.PointLight((0, 2, 0), 9)], spp=4, camera=ASIDE, max_bounces=0)
    assert (behind.alpha == 1).all()


@pytest.mark.parametrize("kind", ["absorption", "both"])
def test_a_catcher_below_water(kind: str) -> None:
    """The sun comes through a layer of 2 above the floor, and the camera looks through it."""
    sigma = 0.3
    medium = wf.Medium(sigma) if kind == "absorption" else wf.Medium(sigma / 2, sigma / 2)
    water = wf.Box((0, 0.5, 0), (24, 3, 24), material=wf.Material(wf.NullSurface(), interior=medium))
    floor = wf.Rectangle((-9, 0, -9), (0, 0, 18), (18, 0, 0), material=wf.ShadowCatcher())
    camera = wf.Camera.look_at((0, 9, 0.01), (0, 0, 0), fov=3.2, size=(4, 4))
    image = seen([water, floor], [SUNS["sun"]], spp=512, camera=camera, max_bounces=0)
    agrees(image, image.alpha, 1 - np.exp(-2 * sigma) * np.exp(-3 * sigma))


def test_colored_shadows_count_by_their_luminance() -> None:
    image = seen([FLOOR, cloud("absorption", RGB)], [SUNS["sun"]], spp=256, camera=ASIDE)
    agrees(image, image.alpha, 1 - np.exp(-RGB) @ (0.2126, 0.7152, 0.0722))


def test_smoke_before_a_shadow() -> None:
    """Smoke between camera and floor, and a block above: one minus both transmittances."""
    camera = wf.Camera.look_at((0, 20, 0.01), (0, 0, 0), fov=3.2, size=(4, 4))
    half = wf.Material(wf.Diffuse(0), alpha=0.5, visible_to_camera=False)
    block = wf.Rectangle((-3, 5, -3), (6, 0, 0), (0, 0, 6), material=half)
    image = seen([FLOOR, cloud("both"), block], [SUNS["sun"]], spp=1024, camera=camera, max_bounces=0)
    agrees(image, image.alpha, 1 - np.exp(-DEPTH) * 0.5 * np.exp(-DEPTH))
