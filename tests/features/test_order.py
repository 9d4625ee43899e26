"""The order in which features act, and that the absence of each is seen in a picture.

For each order that matters there is a scene whose picture is another one when two features change places.
Others may change places without a change of a bit, which is tested, too.
"""

from typing import Any

import numpy as np
import pytest
from inside import (
    Absorption,
    Alpha,
    Backdrop,
    Background,
    BlackLights,
    Caustics,
    Deformations,
    Dispersion,
    Feature,
    Glow,
    Instances,
    Interpolation,
    Media,
    Moments,
    Motion,
    Nested,
    NormalMaps,
    Passing,
    Program,
    Receivers,
    ShadowCatchers,
    ShadowTerminator,
    SmoothNormals,
    Unseen,
    compile_scene,
    compiling,
    generate,
    intersect,
    intersect_and_compact,
    make_accelerator,
    make_sampler,
    training,
)

import wavefront as wf

CAMERA = wf.Camera.look_at((0, 3, 4), (0, 0, 0), fov=40, size=(10, 10))
WAVES = wf.Texture((np.indices((16, 16)).sum(0) % 5 / 5)[..., None].astype(np.float32), srgb=False, channel=0)
GRADIENT = np.linspace(0, 1, 8 * 16 * 3).reshape(8, 16, 3)
SKY, LAMP = wf.Environment(0.5), wf.PointLight((1, 3, 2), 9)
OPTIONS = {"spp": 4, "max_bounces": 4, "workers": 1, "progress": False, "branches": 1, "reuse": False}


def floor(material: Any) -> wf.Mesh:
    corners = [(-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3)]
    uvs = [(0, 0), (1, 0), (1, 1), (0, 1)]
    return wf.Mesh(corners, [[0, 1, 2], [0, 2, 3]], uvs=uvs, material=material)


def screen(material: Any) -> wf.Rectangle:
    """Between the camera and the ball."""
    return wf.Rectangle((-3, 0, 2.2), (6, 0, 0), (0, 3, 0), material=material)


def ball(material: Any, at: Any = (0, 0.8, 0)) -> wf.Sphere:
    return wf.Sphere(at, 0.7, material=material)


def filled(bsdf: wf.Bsdf, **medium: Any) -> wf.Material:
    return wf.Material(bsdf, interior=wf.Medium(**medium))


CAUSTIC = {"caustics": True, "spp": 32}
BULB = wf.Sphere((0, 4, 0), 1.5, emission=2)
GLASS, GRAY = wf.Dielectric(1.5), wf.Diffuse(0.6)
BUMPS = wf.Material(wf.Plastic(0.5), normal_map=wf.BumpMap(WAVES, 0.3))
AMBER = filled(GLASS, absorption=(0.2, 1, 3))
TRIANGLE = wf.Mesh([(-1, 0.5, 0), (1, 0.5, 0), (0, 2, 0)], [[0, 1, 2]], material=GRAY)
TURNED = np.array([[0, 0, 1, 0.5], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]])
BENT = wf.Mesh(
    TRIANGLE.vertices, TRIANGLE.faces, normals=[(-0.6, 0, 0.8), (0.6, 0, 0.8), (0, 0.6, 0.8)], material=GRAY
)
# for each feature a scene that has it, and settings
SCENES: dict[type[Feature], tuple[list[Any], dict[str, Any]]] = {
    Instances: ([wf.Instance(TRIANGLE, np.eye(4)), wf.Instance(TRIANGLE, TURNED), LAMP], {"accel": "numpy"}),
    Interpolation: ([floor(wf.Diffuse(WAVES)), LAMP], {}),
    SmoothNormals: ([BENT, LAMP], {}),
    ShadowTerminator: ([BENT, LAMP], {}),
    Alpha: ([floor(GRAY), ball(wf.Material(GRAY, alpha=0.5)), SKY], {}),
    Nested: (
        [
            ball(wf.Material(GLASS, priority=2)),
            ball(wf.Material(wf.Dielectric(1.3), priority=1), (0.5, 0.8, 0)),
            SKY,
            floor(GRAY),
        ],
        {},
    ),
    Unseen: ([floor(GRAY), ball(wf.Material(GRAY, visible_to_camera=False)), SKY], {}),
    ShadowCatchers: ([floor(wf.ShadowCatcher()), ball(GRAY), LAMP], {}),
    NormalMaps: ([floor(BUMPS), LAMP], {}),
    Dispersion: ([ball(wf.Dielectric((1.4, 1.5, 1.6))), floor(GRAY), SKY, LAMP], {}),
    Absorption: ([ball(AMBER), SKY], {}),
    Media: ([ball(filled(wf.NullSurface(), scattering=2)), floor(GRAY), SKY], {}),
    Glow: ([ball(filled(wf.NullSurface(), absorption=1, emission=1)), floor(GRAY)], {"lighting": None}),
    Caustics: (
        [ball(GLASS), floor(GRAY), wf.Sphere((0, 4, 0), 1.5, emission=2)],
        {"caustics": True, "spp": 32},
    ),
    Backdrop: ([ball(GRAY), wf.Environment(0.5, backdrop=0.2)], {}),
    Background: ([ball(GRAY), SKY], {"background": (0.9, 0.1, 0.2)}),
}
RISE = np.stack([np.eye(4), TURNED])
OPEN = {"shutter": (0, 1)}
SCENES[Motion] = [TRIANGLE.transformed(wf.Keyframes([0, 1], RISE)), floor(GRAY), LAMP], OPEN
SCENES[Moments] = SCENES[Motion]
FORMS = np.stack([TRIANGLE.vertices, TRIANGLE.vertices + np.diag([0, 0, 1])[[2, 0, 0]]])
SCENES[Deformations] = [wf.Mesh(FORMS, TRIANGLE.faces, times=[0, 1], material=GRAY), floor(GRAY), LAMP], OPEN
SCENES[Receivers] = [ball(wf.Plastic(0.5)), floor(GRAY), wf.Environment(GRADIENT)], {}
SCENES[Passing] = SCENES[Alpha]
RELIED_ON = {Interpolation, Instances}  # others stop without them


def picture(shapes: list[Any], **options: Any) -> Any:
    return wf.render(shapes, camera=CAMERA, **{**OPTIONS, **options}).rgb


def test_each_feature_has_a_scene() -> None:
    assert {*SCENES, BlackLights} == set(compiling.FEATURES)


@pytest.mark.parametrize("kind", SCENES, ids=lambda kind: kind.__name__)
def test_the_absence_of_a_feature_is_seen(kind: type[Feature], monkeypatch: pytest.MonkeyPatch) -> None:
    shapes, options = SCENES[kind]
    seen = picture(shapes, **options)
    left = tuple(each for each in compiling.FEATURES if each is not kind)
    monkeypatch.setattr(compiling, "FEATURES", left)
    if kind in RELIED_ON:
        with pytest.raises((AssertionError, IndexError)):
            picture(shapes, **options)
    else:
        assert not np.array_equal(seen, picture(shapes, **options))


def test_paths_end_on_black_lights() -> None:
    """They would find nothing, so no picture shows whether they do."""
    shapes = [floor(GRAY), wf.Sphere((0, 1, 0), 0.5, material=wf.Diffuse(0.0), emission=3.0)]
    scene = compile_scene(wf.Scene(shapes), lambda geometry: make_accelerator(geometry, "numpy"))
    pixel, sampler = np.arange(100, dtype=np.uint32), make_sampler("independent")
    paths = generate(scene, CAMERA, sampler, pixel, np.zeros(100, np.uint32))
    on_ball = intersect(scene, paths).prim == 2
    kept, _ = intersect_and_compact(scene, paths, sampler, 0, np.zeros((3, 100), np.float32), mis=True)
    assert 5 < on_ball.sum() < 50
    assert not on_ball[kept.slot].any()
    assert BlackLights in [type(each) for each in scene.program.features]


def swapped(one: type[Feature], other: type[Feature]) -> tuple[type[Feature], ...]:
    """The features in their order, but for two that change places."""
    places = {one: other, other: one}
    return tuple(places.get(each, each) for each in compiling.FEATURES)


CATCHER = wf.Material(wf.ShadowCatcher(), visible_to_camera=False)
VEILED = wf.Material(wf.ShadowCatcher(), alpha=0.5)
ORDERS = [
    ((Unseen, ShadowCatchers), [floor(GRAY), screen(CATCHER), ball(GLASS), BULB], CAUSTIC, True),
    ((Alpha, ShadowCatchers), [floor(GRAY), screen(VEILED), ball(GLASS), BULB], CAUSTIC, True),
    ((Absorption, NormalMaps), [floor(BUMPS), ball(AMBER), LAMP, SKY], {}, False),
    ((Caustics, Background), SCENES[Caustics][0], {**CAUSTIC, "background": "white"}, False),
]


@pytest.mark.parametrize(
    ("pair", "shapes", "options", "matters"),
    ORDERS,
    ids=lambda each: "" if not isinstance(each, tuple) else " and ".join(kind.__name__ for kind in each),
)
def test_which_orders_matter(
    pair: tuple[type[Feature], type[Feature]],
    shapes: list[Any],
    options: dict[str, Any],
    matters: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen = picture(shapes, **options)
    monkeypatch.setattr(compiling, "FEATURES", swapped(*pair))
    assert np.array_equal(seen, picture(shapes, **options)) == (not matters)


def test_media_are_left_before_their_light_is_added(monkeypatch: pytest.MonkeyPatch) -> None:
    shapes, options = SCENES[Glow]
    monkeypatch.setattr(compiling, "FEATURES", swapped(Passing, Glow))
    with pytest.raises(AssertionError):
        picture(shapes, **options)


def test_a_guide_chooses_among_folded_directions(monkeypatch: pytest.MonkeyPatch) -> None:
    shapes, options = [floor(BUMPS), wf.Rectangle((-1, 0, 0), (2, 0, 0), (0, 2, -0.5)), LAMP], {"guide": True}
    monkeypatch.setattr(training, "PATHS", 1 << 12)
    seen = picture(shapes, **options)
    monkeypatch.setattr(Program, "plus", lambda self, *features: Program([*features, *self.features]))
    assert not np.array_equal(seen, picture(shapes, **options))
