"""Ready-made light: what a scene without lights looks like, each preset, and the ground."""

import tracemalloc
import warnings
from typing import Any

import numpy as np
import pytest
from inside import LIGHTINGS, PRESETS, lighted, lighting

import wavefront as wf

CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
SIDES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
CUBE_PARTS = [np.s_[34:44, 18:34], np.s_[24:40, 48:49], np.s_[16:17, 38:46], np.s_[24:40, 54:60]]
Z_UP = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float)  # takes y to z, and z to -y


def in_front(scene: wf.Scene, size: tuple[int, int]) -> wf.Camera:
    """A camera of one's own: the picture has no ground by itself, and the light is where it is by default."""
    low, high = scene.bounds
    view = np.array(lighting.FRONT) / np.linalg.norm(lighting.FRONT)
    distance = np.linalg.norm(high - low) / 2 / np.sin(np.radians(20))
    return wf.Camera.look_at((low + high) / 2 + view * distance, (low + high) / 2, size=size)


def cube(material: wf.Bsdf | None = None) -> wf.Mesh:
    faces = [corner for a, b, c, d in SIDES for corner in ([a, b, c], [a, c, d])]
    return wf.Mesh(CUBE, faces, material=material)


def ball(material: wf.Bsdf | None = None) -> wf.Scene:
    scene = wf.Scene([wf.Sphere((0, 0, 0), 1, material=material)])
    scene.camera = in_front(scene, (48, 48))
    return scene


def render(scene: wf.Scene, spp: int = 32, **options) -> np.ndarray:
    return wf.render(scene, spp, accel="numpy", workers=1, progress=False, **options).rgb


def arriving(lights: list, directions: np.ndarray) -> np.ndarray:
    """Radiance (3, n) of a preset's environment from directions (3, n)."""
    (environment,) = lights
    return environment.record(np.zeros(3)).le(directions.astype(np.float32))


def around(n: int, seed: int = 1) -> np.ndarray:
    d = np.random.default_rng(seed).normal(size=(3, n))
    return d / np.linalg.norm(d, axis=0)


def test_presets_are_prepared_once_and_belong_to_their_caller() -> None:
    """The tables of a preset are shared, the lights are not: changes to one stay with it."""
    one, other = wf.studio()[0], wf.studio()[0]
    tables = [light.record(np.zeros(3)).texels for light in (one, other)]
    assert tables[0] is tables[1]
    one.radiance, one.backdrop.radiance = 3.0, 4.0
    one.group = "mine"
    for light in (other, *wf.studio()):
        assert light.radiance.max() < 1.5
        assert light.backdrop.radiance.max() < 1
        assert light.group != "mine"


@pytest.mark.parametrize("preset", LIGHTINGS)
def test_a_preset_takes_at_most_4_mb(preset: str) -> None:
    """With the tables that a render makes of it."""
    lighting._directions.cache_clear()
    tracemalloc.start()
    lights = wf.studio(preset, up=(1, 2, 3))
    shown = [getattr(light, "backdrop", None) or light for light in lights]
    kept = lights, [light.record(np.zeros(3)).compensated() for light in lights], shown
    size, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert size < 4e6, kept


def test_three_sides_of_a_cube_can_be_told_apart_and_from_the_background() -> None:
    """What an even environment shows as a hexagon."""
    scene = wf.Scene([cube()])
    scene.camera = in_front(scene, (64, 64))
    picture = render(scene).mean(2)
    front, right, top, behind = (picture[rows, columns].mean() for rows, columns in CUBE_PARTS)
    assert top > 1.15 * front
    assert front > 1.5 * right
    assert right > 1.5 * behind
    even = render(scene, lighting="even").mean(2)
    assert np.ptp([even[rows, columns].mean() for rows, columns in CUBE_PARTS[:3]]) < 0.02


def lightness(codes: np.ndarray) -> np.ndarray:
    """L* of sRGB codes."""
    color = codes / 255
    linear = np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)
    y = linear @ np.array([0.2126, 0.7152, 0.0722])
    return np.where(y > 0.008856, 116 * np.cbrt(y) - 16, 903.3 * y)


def across_the_edge(values: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Differences between both sides of a silhouette, three pixels apart in rows and columns."""
    found = []
    for grid, mask in ((values, inside), (values.T, inside.T)):
        a, b, c, d = (mask[:, k : mask.shape[1] - 3 + k] for k in range(4))
        edge = (a & b & ~c & ~d) | (~a & ~b & c & d)
        found.append(np.abs(grid[:, :-3] - grid[:, 3:])[edge])
    return np.concatenate(found)


@pytest.mark.parametrize("albedo", [0.03, 0.2, 0.5, 0.9])
def test_dark_and_white_things_stand_out(albedo: float) -> None:
    """All around, by their lightness beside that of what is behind them; and white is not cut off."""
    ball = wf.Sphere((0, 0, 0), 1, material=wf.Diffuse(albedo))
    image = wf.render(ball, 8, size=(64, 64), aovs="shape_id", workers=1, progress=False)
    codes = image.to_uint8()
    steps = across_the_edge(lightness(codes), image.layers["shape_id"] == 0)
    assert len(steps) > 100
    assert steps.mean() > 15
    assert np.median(steps) > 15
    assert codes.max() < 250


def test_the_tone_is_chosen_with_the_light() -> None:
    """Shown by AgX, 1.5 stops brighter, also from a file; light of one's own is shown as it is."""
    chosen, own = wf.render(cube(), **CHOSEN), wf.render([cube(), wf.Environment(1)], **CHOSEN)
    assert (chosen.metadata["tone"], own.metadata["tone"]) == ("agx_punchy", "none")
    by_hand = wf.Image(2**1.5 * chosen.rgb).to_uint8(tone="agx_punchy")
    for tone in ("auto", "agx_punchy"):
        np.testing.assert_array_equal(chosen.to_uint8(tone=tone), by_hand)
    np.testing.assert_array_equal(chosen.to_uint8(), by_hand)
    assert (chosen.to_uint8(tone="none") != by_hand).any()
    np.testing.assert_array_equal(own.to_uint8(), own.to_uint8(tone="none"))
    np.testing.assert_array_equal(own.to_uint8(tone="agx"), wf.Image(own.rgb).to_uint8(tone="agx"))
    named = wf.render(cube(), lighting="studio", **CHOSEN)
    np.testing.assert_array_equal(named.to_uint8(), named.to_uint8(tone="none"))


@pytest.mark.parametrize("normal", [(0, 1, 0), (1, 0, 0), (0, 0, 1), (0.6, -0.8, 0.1)])
def test_the_broad_side_of_flat_things_faces_the_camera(normal) -> None:
    """At 40 degrees from its normal at most, and level things from above; a cube is seen as ever."""
    plate = wf.Disk((0, 0, 0), normal, 1.0)
    cosine = wf.Scene([plate]).framing_camera(direction=wf.Scene([plate]).chosen_view()).rotation[:, 2]
    assert abs(cosine @ np.array(normal)) / np.linalg.norm(normal) > 0.76
    assert cosine[1] > 0
    assert wf.Scene([cube()]).chosen_view() == "three_quarter"
    assert wf.Scene([plate], [wf.PointLight((0, 5, 0), 9)]).chosen_view() == "three_quarter"


def test_balls_are_as_thick_as_they_are() -> None:
    """Not as thin as their centers."""
    floor, ball = wf.Rectangle((-4, -1, 4), (8, 0, 0), (0, 0, -8)), wf.Sphere((0, 0, 0), 1)
    assert wf.Scene([floor, ball]).chosen_view() == "three_quarter"
    assert not isinstance(wf.Scene([floor, wf.Sphere((0, -0.9, 0), 0.1)]).chosen_view(), str)


def test_a_small_subject_is_told(monkeypatch, capsys) -> None:
    monkeypatch.setattr("wavefront.drive.hints.NOTICED", 0.0)
    far = wf.Camera.look_at((0, 1, 30), (0, 0, 0))
    wf.render(cube(), **{**CHOSEN, "progress": True}, camera=far)
    assert "hint: the subject fills 1% of the picture" in capsys.readouterr().err
    wf.render(cube(), **{**CHOSEN, "progress": True})
    assert "the subject fills" not in capsys.readouterr().err


def test_the_tone_is_kept_in_files(tmp_path) -> None:
    chosen = wf.render(cube(), **CHOSEN)
    chosen.save(tmp_path / "a.exr")
    read = wf.Image.load(tmp_path / "a.exr")
    np.testing.assert_array_equal(read.to_uint8(), chosen.to_uint8())


@pytest.mark.filterwarnings("error")
def test_no_light_is_no_reason_to_warn() -> None:
    image = wf.render(ball(), 1, progress=False)
    assert (image.metadata["lighting"], image.metadata["ground"]) == ("studio", True)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", LIGHTINGS)
def test_a_preset_that_was_asked_for_gives_no_warning(name: str) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        image = wf.render(ball(), 4, lighting=name, progress=False)
    assert caught == []
    assert image.metadata["lighting"] == name
    assert 0.1 < image.rgb[20:28, 20:28].mean() < 0.6


def test_even_is_an_environment_of_one() -> None:
    """Bit for bit what scenes without lights were rendered in before there were presets."""
    own = ball()
    own.lights = [wf.Environment(1.0)]
    np.testing.assert_array_equal(render(ball(), 4, lighting="even"), render(own, 4))


def test_a_scene_with_light_stays_as_it_is() -> None:
    scene = ball()
    scene.lights = [wf.PointLight((0, 4, 4), 50)]
    assert lighted(scene, lighting.choose_preset(scene, "auto")) is scene
    assert wf.render(scene, 1, progress=False).metadata["lighting"] is None
    shining = wf.Scene([wf.Sphere((0, 0, 0), 1, emission=1.0)])
    assert lighting.choose_preset(shining, "auto") is None


def test_a_preset_is_added_to_the_lights_of_the_scene() -> None:
    """A ball alone is lit by their sum; the scene itself keeps the lights that it had."""
    scene, point = ball(), wf.PointLight((0, 4, 4), 20)
    studio = render(scene, 64, lighting="studio")
    scene.lights = [point]
    alone = render(scene, 64)
    both = render(scene, 64, lighting="studio")
    assert scene.lights == [point]
    np.testing.assert_allclose(both[15:33, 15:33].mean(), (alone + studio)[15:33, 15:33].mean(), rtol=0.01)


def test_two_environments_are_refused() -> None:
    scene = ball()
    scene.lights = [wf.Environment(0.5)]
    with pytest.raises(wf.SceneError, match="lighting='cloudy' brings an Environment, and the scene has"):
        wf.render(scene, 1, lighting="cloudy")


@pytest.mark.parametrize("name", ["Studio", "", 3, ["even"]])
def test_other_names_are_refused(name) -> None:
    known = "studio, softbox, three_point, cloudy, daylight, even"
    with pytest.raises(wf.SceneError, match=f"lighting is .* must be auto, None or one of {known}"):
        wf.render("no such file.obj", 1, lighting=name)
    with pytest.raises(wf.SceneError, match=f"preset is .* one of {known}"):
        wf.studio(name)


@pytest.mark.parametrize("up", [(0, 0, 0), (1, 0), "left", (0, np.nan, 0)])
def test_up_is_checked(up) -> None:
    with pytest.raises(wf.SceneError, match="up"):
        wf.studio(up=up)


@pytest.mark.parametrize("name", PRESETS)
def test_the_brightest_side_is_as_bright_as_in_an_even_environment(name: str) -> None:
    """By quadrature over the image, for 400 sides: white keeps its shading, and no preset is dark."""
    pixels = PRESETS[name].pixels()
    height, width, _ = pixels.shape
    polar = (np.arange(height) + 0.5) * np.pi / height
    longitude = 2 * np.pi * (0.5 - (np.arange(width) + 0.5) / width)
    sin, cos = np.sin(polar)[:, None], np.cos(polar)[:, None] * np.ones(width)
    directions = np.stack([sin * np.sin(longitude), cos, sin * np.cos(longitude)]).reshape(3, -1)
    weight = (sin * np.ones(width)).ravel() * (np.pi / height) * (2 * np.pi / width)
    sides = around(400).T
    level = np.maximum(sides @ directions, 0) @ (pixels.mean(2).ravel() * weight) / np.pi
    assert 0.9 < level.max() < 1.1
    assert level.min() > 0.03
    assert pixels.min() > 0


@pytest.mark.parametrize("name", PRESETS)
def test_a_camera_that_goes_around_sees_no_box(name: str) -> None:
    """But the backdrop, whose brightest part is darker than a lit white surface."""
    scene = ball()
    for angle in np.arange(0, 2 * np.pi, np.pi / 4):
        camera = scene.framing_camera(direction=(np.sin(angle), 0.3, np.cos(angle)), size=(24, 24))
        assert render(scene, 1, camera=camera, max_bounces=0, lighting=name).max() < 0.5


@pytest.mark.parametrize("name", LIGHTINGS)
def test_studio_gives_the_lights_that_render_adds(name: str) -> None:
    scene = ball()
    by_name = render(scene, 2, lighting=name)
    scene.lights = wf.studio(name)
    np.testing.assert_array_equal(by_name, render(scene, 2))


def test_the_light_stays_where_it_is_while_a_camera_goes_around() -> None:
    directions, scene = around(100), ball()
    first = arriving(lighted(scene, "studio").lights, directions)
    scene.camera = wf.Camera.look_at((-3, 1, -2), (0, 0, 0))
    np.testing.assert_array_equal(arriving(lighted(scene, "studio").lights, directions), first)


def test_up_turns_the_light() -> None:
    directions = around(100)
    upright = arriving(wf.studio(), directions)
    turned = arriving(wf.studio(up=(0, 0, 2)), Z_UP @ directions)
    np.testing.assert_allclose(turned, upright, atol=1e-4)


def test_a_z_up_mesh_looks_as_the_same_mesh_with_y_up() -> None:
    y_up = cube()
    z_up = wf.Mesh(y_up.vertices @ Z_UP.T, y_up.faces)
    for ground in (False, True):
        upright, turned = (
            wf.render(mesh, 64, size=(32, 32), up=up, ground=ground, progress=False).rgb
            for mesh, up in ((y_up, "y"), (z_up, "z"))
        )
        assert np.abs(upright - turned).mean() < 0.01


@pytest.mark.parametrize("origin", [(3, 1, 0), (0, 2, -5), (0, 5, 0.0)])
def test_the_key_light_is_left_of_the_camera_that_is_given(origin) -> None:
    """And above; a camera that looks straight down has its front at the lower edge of the picture."""
    up = (0, 1, 0) if origin[0] or origin[2] else (0, 0, -1)
    camera = wf.Camera.look_at(origin, (0, 0, 0), up)
    directions = around(20_000)
    radiance = arriving(wf.studio(camera=camera), directions).mean(0)
    key = (directions * radiance**4).sum(1)
    assert key @ camera.rotation[:, 0] < 0
    assert key[1] > 0
    front = camera.rotation[:, 2] if up[1] else -camera.rotation[:, 1]
    assert key @ front > 0


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.first(2)
def test_the_ground_has_no_edge(name: str) -> None:
    """Where nothing throws a shadow on it, it is as bright as the environment that it hides."""
    scene = wf.Scene([wf.Sphere((x, 0, 0), 0.01) for x in (-1, 1)])
    scene.camera = wf.Camera.look_at((0, 1.5, 1), (0, 0, 0), size=(24, 24))
    bare, grounded = (render(scene, 64, lighting=name, ground=ground) for ground in (False, True))
    assert (grounded != bare).any()
    np.testing.assert_allclose(grounded[14:].mean(0), bare[14:].mean(0), rtol=0.04)


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.first(2)
def test_the_ground_catches_the_shadow(name: str) -> None:
    scene = ball()
    bare, grounded = (render(scene, lighting=name, ground=ground) for ground in (False, True))
    assert grounded[38, 22:27].mean() < 0.75 * bare[38, 22:27].mean()


@pytest.mark.parametrize("background", ["transparent", (0.2, 0.4, 0.8), None])
@pytest.mark.first(2)
def test_of_a_ground_the_shadow_alone_is_seen(background: Any) -> None:
    """Its opacity is that of a catcher: below the ball, and not beside it; the light on the ball stays."""
    settings: dict[str, Any] = {"background": background, "progress": False, "spp": 32, "size": (32, 32)}
    bare, cast = (wf.render(ball(), ground=ground, **settings) for ground in (False, "shadow"))
    assert cast.metadata["ground"] == "shadow"
    beside, lit = (slice(29, 32), slice(28, 32)), (slice(8, 14), slice(13, 19))
    assert cast.rgb[beside] == pytest.approx(bare.rgb[beside], rel=0.8)
    assert cast.rgb[lit].mean() == pytest.approx(bare.rgb[lit].mean(), rel=0.1)
    if background == "transparent":
        assert bare.alpha[31].max() == 0
        assert 0.05 < cast.alpha[31, :16].mean() < 0.9
        assert cast.rgb[31].max() == 0
        assert cast.alpha[2, 2] == 0
        same = wf.render(ball(), ground=True, **settings)
        assert same.rgb.tobytes() == cast.rgb.tobytes()
        assert same.alpha.tobytes() == cast.alpha.tobytes()
    else:
        assert cast.rgb[31, :16].mean() < 0.95 * bare.rgb[31, :16].mean()
        assert wf.render(ball(), ground=True, **settings).metadata["ground"] is True


def test_the_ground_is_no_part_of_the_scene() -> None:
    """Neither of its shapes nor of its bounds; it comes after all shapes of the picture."""
    scene = ball()
    bounds, shapes = scene.bounds, list(scene.shapes)
    complete = lighted(scene, None, ground=True)
    render(scene, 1, ground=True, lighting="even")
    np.testing.assert_array_equal(scene.bounds, bounds)
    assert scene.shapes == shapes
    assert complete.shapes[:-1] == shapes
    assert complete.shapes[-1].name == "ground"


@pytest.mark.parametrize("up", [(0, 1, 0), (0, 0, 1), (-1, 0, 0)])
def test_the_ground_lies_just_below(up) -> None:
    scene = wf.Scene([cube()])
    ground = lighted(scene, "studio", ground=True, up=up).shapes[-1]
    heights = ground.vertices @ np.array(up, float)
    np.testing.assert_allclose(heights, -1, atol=1e-3)
    assert (heights < -1).all()


CHOSEN = {"spp": 1, "size": (8, 8), "progress": False}


@pytest.mark.parametrize(
    ("settings", "there"),
    [
        ({}, True),
        ({"view": "front"}, True),
        ({"view": "top", "up": "z"}, True),
        ({"view": "bottom"}, False),
        ({"view": (0, -1, 2)}, False),
        ({"ground": False}, False),
        ({"lighting": "studio"}, False),
        ({"lighting": "studio", "ground": True}, True),
        ({"background": "transparent"}, False),
        ({"background": (1, 1, 1), "ground": True}, True),
        ({"camera": wf.Camera.look_at((0, 1, 5), (0, 0, 0))}, True),
        ({"camera": wf.Camera.look_at((0, -0.5, 5), (0, 0, 0))}, True),
        ({"camera": wf.Camera.look_at((0, -2, 5), (0, 0, 0))}, False),
    ],
)
def test_the_ground_is_there_where_the_light_is_chosen(settings, there) -> None:
    """Where nobody chose a light, it would hide nothing, and no background is wanted."""
    image = wf.render(cube(), **CHOSEN, **settings)
    assert image.metadata["ground"] is there
    same = wf.render(cube(), **CHOSEN, **{**settings, "ground": there})
    assert image.rgb.tobytes() == same.rgb.tobytes()
    other = wf.render(cube(), **CHOSEN, **{**settings, "ground": not there, "aovs": "shape_id"})
    assert ("ground" in other.names["shape"].values()) is not there


def test_scenes_with_a_light_get_no_ground() -> None:
    lit = wf.Scene([cube()], [wf.Environment(1)])
    assert wf.render(lit, **CHOSEN).metadata["ground"] is False
    assert wf.render(ball(), **CHOSEN).metadata["ground"] is True
    with pytest.raises(
        wf.SceneError, match="ground is 'yes'; it must be True or False, or 'shadow', or 'auto'"
    ):
        wf.render(lit, ground="yes")


def test_the_light_goes_with_a_camera_that_was_chosen() -> None:
    """A ball before a gray backdrop looks the same from each side, and as in the light of `studio`."""
    front, back = (wf.render(cube(), 64, size=(24, 24), view=view).rgb for view in ("front", "back"))
    assert np.abs(front - back).mean() < 0.01
    scene = wf.Scene([cube()])
    camera = scene.framing_camera(size=(24, 24), direction="left")
    scene.lights = wf.studio(camera=camera)
    chosen = wf.render(cube(), 2, size=(24, 24), view="left", ground=False)
    np.testing.assert_array_equal(chosen.rgb, wf.render(scene, 2, camera=camera).rgb)


@pytest.mark.parametrize("name", ["studio", "softbox", "three_point"])
def test_no_camera_sees_a_box(name: str) -> None:
    """Whichever way it looks; a mirror does, as it shows what lights the scene."""
    ball = wf.Sphere((0, 0, 0), 1, material=wf.Mirror())
    around = wf.Camera.panorama((0, 0, 5), (0, 0, 0), size=(64, 32))
    scene = wf.Scene([ball], wf.studio(name))
    seen = wf.render(scene, spp=4, camera=around, aovs="alpha", progress=False)
    brightest = max(level for _, level in PRESETS[name].gradient)
    assert seen.rgb[seen.alpha == 0].max() <= brightest * 1.001
    assert seen.rgb[seen.alpha > 0].max() > 3 * brightest
