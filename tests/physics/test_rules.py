"""Fast rules that are chosen by what a scene holds, in scenes that break their condition by the least.

docs/testing.md lists all of them, with the test of each. Here are those that have no place elsewhere.
"""

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from inside import (
    FEW,
    LEAST_VARIANCE,
    MAX_DISTANCE,
    SMALL,
    BlackLights,
    BruteForceTriangles,
    CompiledScene,
    PatchedEnvironment,
    SkyPatches,
    compile_scene,
    luminance,
    make_accelerator,
)
from scenes import ALBEDO, BLACK, HERE, SAMPLING_LIGHTS, box, floor, polygon_irradiance, probe
from significance import Mean, assert_mean, channels, measure, render

import wavefront as wf

f4 = np.float32
CENTER = np.array((0.9, 0.4, 0.3))  # of what is in a closed box, where no ray gets
NOISE = np.random.default_rng(1).uniform(0.1, 0.9, (4, 4, 3)).astype(f4)


def compiled(scene: wf.Scene, **options) -> CompiledScene:
    return compile_scene(scene, lambda geometry: make_accelerator(geometry, "numpy"), **options)


# --- What no ray meets ------------------------------------------------------------------------------


def cube(material: wf.Material | wf.Bsdf, at: np.ndarray = CENTER, side: float = 0.2) -> wf.Mesh:
    return wf.Box(at, (side,) * 3, material=material)


def with_attributes(mesh: wf.Mesh, normals: bool = False) -> wf.Mesh:
    away = mesh.vertices - CENTER
    more = {"normals": away / np.linalg.norm(away, axis=1)[:, None]} if normals else {"uvs": away[:, :2] * 3}
    return wf.Mesh(mesh.vertices, mesh.faces, material=mesh.material, **more)


def instances() -> list[wf.Instance]:
    one, other = np.diag([0.5, 0.5, 0.5, 1]), np.diag([0.5, 0.5, 0.5, 1])
    one[:3, 3], other[:3, 3] = CENTER / 2, CENTER / 2 + (0, 0.11, 0)
    mesh = cube(wf.Diffuse(0.5))
    return [wf.Instance(mesh, one), wf.Instance(mesh, other, material=wf.Diffuse(0.2))]


def inside(medium: wf.Medium | wf.GridMedium, **more) -> list[wf.Mesh]:
    return [cube(wf.Material(wf.NullSurface(), interior=medium, **more))]


BUMPS = wf.BumpMap(wf.Texture(NOISE[:, :, 0], srgb=False, channel=0), height=0.1)
HIDDEN: dict[str, Callable[[], list[wf.Shape]]] = {
    "a triangle more than are tested without a tree": lambda: [
        cube(wf.Diffuse(0.5), CENTER + np.array((0.02 * k, 0, 0)), 0.01) for k in range(SMALL // 12)
    ],
    "a sphere": lambda: [wf.Sphere(CENTER, 0.1)],
    "two kinds of curved shapes": lambda: [
        wf.Sphere(CENTER, 0.1),
        wf.Cylinders([CENTER], [CENTER + 0.1], 0.05),
    ],
    "more curved shapes than are tested without a tree": lambda: [
        wf.Spheres(CENTER + np.random.default_rng(0).uniform(-0.1, 0.1, (SMALL + 1, 3)), 0.01)
    ],
    "interpolated normals": lambda: [with_attributes(cube(wf.Diffuse(0.5)), normals=True)],
    "a texture": lambda: [with_attributes(cube(wf.Diffuse(wf.Texture(NOISE))))],
    "a material that depends on the view": lambda: [cube(wf.OrenNayar(0.5, sigma=0.0))],
    "a delta lobe": lambda: [cube(wf.Mirror(0.9))],
    "a lobe that takes a third number": lambda: [cube(wf.Dielectric(1.5))],
    "dispersion": lambda: [cube(wf.Dielectric((1.5, 1.5, 1.5001)))],
    "an alpha": lambda: [cube(wf.Material(wf.Diffuse(0.5), alpha=0.999))],
    "what cameras pass": lambda: [cube(wf.Material(wf.Diffuse(0.5), visible_to_camera=False))],
    "a shadow catcher": lambda: [cube(wf.ShadowCatcher(0.5))],
    "a bump map": lambda: [with_attributes(cube(wf.Material(wf.Diffuse(0.5), normal_map=BUMPS)))],
    "faces that overlap in a plane": lambda: [
        cube(wf.Diffuse(0.5)),
        cube(wf.Diffuse(0.5), CENTER + np.array((0.1, 0, 0))),
    ],
    "a medium that absorbs": lambda: [cube(wf.Material(wf.Dielectric(1.5), interior=wf.Medium(1e-3)))],
    "a medium that scatters": lambda: inside(wf.Medium(0, 1e-3)),
    "a medium that glows": lambda: inside(wf.Medium(0, 0, emission=1e-3)),
    "a grid": lambda: inside(
        wf.GridMedium(np.ones((2, 2, 2)), [CENTER - 0.1, CENTER + 0.1], scattering=1e-3)
    ),
    "a priority": lambda: [cube(wf.Material(wf.Dielectric(1.5), priority=1))],
    "instances": instances,
}


def around_a_box(hidden: list[wf.Shape]) -> wf.Scene:
    """A scene of plain things, one of which is a closed box with other things inside."""
    shapes = [
        wf.Rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4), material=wf.Diffuse(0.6)),
        wf.Rectangle((-2, 0, -2), (4, 0, 0), (0, 3, 0), material=wf.Diffuse((0.7, 0.4, 0.3))),
        wf.Rectangle((-0.5, 2.9, -0.5), (1, 0, 0), (0, 0, 1), emission=5, material=BLACK),
        cube(wf.Diffuse(0.5), side=0.8),
    ]
    camera = wf.Camera.look_at((0, 1.6, 5.5), (0, 1, 0), fov=40, size=(12, 12))
    return wf.Scene([*shapes, *hidden], [wf.PointLight((1, 2, 1.5), 4), wf.Environment(0.3)], camera)


@pytest.mark.parametrize("hidden", HIDDEN)
def test_what_no_ray_meets_changes_no_bit(hidden: str) -> None:
    """Each of these ends a rule that holds for all of a scene; the other way of computing is the same."""
    plain, other = (
        render(around_a_box(shapes), 1, reuse=False, branches=1, max_bounces=4).rgb
        for shapes in ([], HIDDEN[hidden]())
    )
    if hidden == "instances":  # error bounds have a term more
        np.testing.assert_allclose(plain, other, rtol=1e-4)
    else:
        np.testing.assert_array_equal(plain, other)


NOW = {("reuse", "an alpha"), ("reuse", "a texture"), ("caustics", "a delta lobe")}
REFUSED = {"a medium that scatters", "a medium that glows", "a grid", "a priority"}  # by both
# points seen at a grazing angle are not shared then: another estimate of the same mean
OTHERWISE = {("reuse", "interpolated normals")}


@pytest.mark.parametrize(
    ("setting", "hidden"),
    [
        pytest.param(*pair, marks=() if pair in NOW else pytest.mark.slow)
        for pair in itertools.product(("reuse", "caustics"), HIDDEN)
        if pair[1] not in REFUSED and pair not in OTHERWISE
    ],
)
def test_what_no_ray_meets_changes_no_bit_of_paths_that_are_shared_or_come_from_lights(
    setting: str, hidden: str, close_tiles: None
) -> None:
    options = {"branches": 1, "max_bounces": 4, setting: True}
    plain, other = (render(around_a_box(shapes), 1, **options).rgb for shapes in ([], HIDDEN[hidden]()))
    np.testing.assert_allclose(plain, other, rtol=1e-4 if hidden == "instances" else 1e-6)


def test_first_points_that_are_not_all_lambertian(close_tiles: None) -> None:
    """Where all are, their BSDF is an albedo; a black one that is another model is as black."""
    pictures = []
    for black in (wf.Diffuse(0.0), wf.OrenNayar(0.0)):
        scene = around_a_box([wf.Rectangle((-2, 0, 2.01), (0.4, 0, 0), (0, 0.4, 0), material=black)])
        pictures.append(render(scene, 1, branches=1, max_bounces=4, reuse=True).rgb)
    np.testing.assert_allclose(*pictures, rtol=1e-4)
    assert (pictures[0] > 0).mean() > 0.9


# --- Triangles, instances and sizes -------------------------------------------------------------------


def test_one_triangle_more_than_are_tested_without_a_tree() -> None:
    random = np.random.default_rng(3)
    soup = (random.normal(size=(SMALL + 1, 1, 3)) + random.normal(size=(SMALL + 1, 3, 3)) * 0.3).astype(f4)
    soup[-1] += 100
    origin = (random.normal(size=(3, 1024)) * 3).astype(f4)
    toward = random.normal(size=(3, 1024)).astype(f4) - origin
    rays = origin, toward / np.sqrt((toward**2).sum(0)), np.full(1024, -1)
    few, many = (make_accelerator(wf.Geometry(some), "numpy") for some in (soup[:-1], soup))
    assert isinstance(few._triangles, BruteForceTriangles) != isinstance(many._triangles, BruteForceTriangles)
    for name in ("t", "prim", "b1", "b2"):
        np.testing.assert_array_equal(getattr(few.closest(*rays), name), getattr(many.closest(*rays), name))


def test_coordinates_of_quadrilaterals_whose_halves_look_alike() -> None:
    """Where no material reads coordinates, either half of a quadrilateral is reported for both."""
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], float)
    uvs = np.array([(0, 0), (1, 0), (1, 1), (0.2, 0.7)])  # not those of a parallelogram
    quad = wf.Mesh(corners, [(0, 1, 2), (0, 2, 3)], uvs=uvs)
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=20, size=(16, 16))
    image = render(wf.Scene([quad], [wf.Environment(1)], camera), 1, aovs=("uv", "position"))
    x, y = np.moveaxis(image.layers["position"][..., :2], -1, 0)
    b1, b2 = np.where(x > y, (x - y) / 2, 0), np.where(x > y, (1 + y) / 2, (1 + x) / 2)
    b3 = np.where(x > y, 0, (y - x) / 2)
    found = b1[..., None] * uvs[1] + b2[..., None] * uvs[2] + b3[..., None] * uvs[3]
    np.testing.assert_allclose(image.layers["uv"], found, atol=1e-6)


@pytest.mark.usefixtures("shared_instances")
def test_light_is_scattered_before_instances_with_materials_of_their_own() -> None:
    """Where a medium scatters light there is no surface, and so no material of an instance."""
    mesh = cube(wf.Diffuse(0.5), np.zeros(3), 1.0)
    placed = []
    for x in (-1.0, 1.0):
        matrix = np.eye(4)
        matrix[0, 3] = x
        placed.append(wf.Instance(mesh, matrix, material=wf.Diffuse((0.9, 0.1, 0.1))))
    camera = wf.Camera.look_at((0, 1, 6), (0, 0, 0), fov=40, size=(16, 16))
    one, other = (
        render(
            wf.Scene(shapes, wf.PointLight((0, 3, 3), 60), camera, medium=wf.Medium(scattering=0.3)),
            4,
            branches=1,
            max_bounces=3,
        ).rgb
        for shapes in (placed, [each.to_mesh() for each in placed])
    )
    assert np.isclose(one, other, rtol=1e-3).mean() > 0.98


@pytest.mark.parametrize("exponent", [-30, 30])
def test_materials_of_scaled_scenes_share_their_medium(exponent: int) -> None:
    """Boxes of one grid may overlap, and its paths do not know where one ends, in a scene of any size."""
    pictures = []
    for scale in (1.0, 2.0**exponent):
        grid = wf.GridMedium(np.ones((2, 2, 2)), [(-scale,) * 3, (scale,) * 3], absorption=0.5 / scale)
        shapes = [
            wf.Box(
                (x * scale, 0, 0),
                (scale,) * 3,
                material=wf.Material(wf.NullSurface(), name=name, interior=grid),
            )
            for x, name in ((-0.25, "left"), (0.25, None))
        ]
        shapes[1].material.visible_to_camera = False
        camera = wf.Camera.look_at((0, scale, 4 * scale), (0, 0, 0), fov=30, size=(8, 8))
        pictures.append(render(wf.Scene(shapes, [wf.Environment(1)], camera), 4).rgb)
    np.testing.assert_array_equal(*pictures)


# --- Lights -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("integrator", SAMPLING_LIGHTS)
def test_a_second_light_of_hardly_any_power(integrator: str) -> None:
    """With one light there is no choice."""
    lamp, other = wf.PointLight((0, 2, 0), 10), wf.PointLight((1, 2, 0), 1e-20)
    for lights in ([lamp], [lamp, other], [other, lamp]):
        scene = wf.Scene([floor()], lights, probe(HERE, (0.31, 0.17, 0.23)))
        assert_mean(measure(scene, 4, integrator=integrator), 2.5 * ALBEDO / np.pi, 1e-6)


def test_a_light_just_near_enough() -> None:
    """Its distance squared is within float32, and the light is as strong as its distance says."""
    distance, intensity = 0.999 * MAX_DISTANCE, 1e35
    scene = wf.Scene([floor()], wf.PointLight((0, distance, 0), intensity), probe(HERE, (0.31, 0.17, 0.23)))
    assert_mean(measure(scene, 1), intensity / distance**2 * ALBEDO / np.pi, 1e-6)
    scene.lights = [wf.PointLight((0, 1.001 * MAX_DISTANCE, 0), intensity)]
    with pytest.raises(wf.SceneError, match="PointLight position"):
        render(scene, 1)


@pytest.mark.parametrize("albedo", [0.0, 1e-3])
@pytest.mark.parametrize("integrator", ["naive", "full"])
def test_lights_that_scatter_hardly_anything(integrator: str, albedo: float) -> None:
    """Paths end on black lights alone."""
    walls = box((-0.5,) * 3, (0.5,) * 3, wf.Diffuse(albedo), emission=1.0, inward=True)
    scene = wf.Scene([walls], camera=probe((0.5, 0.11, 0.07), (-0.2, 0.1, -0.3)))
    assert (compiled(scene).program.find(BlackLights) is None) == (albedo > 0)
    assert_mean(measure(scene, 16, integrator=integrator), 1 / (1 - albedo), 4e-5)


@pytest.mark.parametrize("excess", [-0.01, 0.01])
@pytest.mark.parametrize("integrator", SAMPLING_LIGHTS)
def test_an_environment_that_varies_just_enough_for_light_samples(integrator: str, excess: float) -> None:
    contrast = np.sqrt(LEAST_VARIANCE) + excess
    pixels = np.stack([np.full((4, 3), 1 + contrast), np.full((4, 3), 1 - contrast)]).astype(f4)
    sky = wf.Environment(pixels, filter="nearest")
    scene = wf.Scene([floor(half=1e3)], sky, probe(HERE, (0.31, 0.17, 0.23)))
    table = compiled(scene, mis=integrator != "direct_simple").lights
    assert table.chosen_from[-1] == (integrator == "direct_simple" or excess > 0)
    assert_mean(measure(scene, 128, integrator=integrator), (1 + contrast) * ALBEDO, 0.01)


def test_groups_of_the_sky_beside_a_medium_that_glows() -> None:
    """Light of media is in the default group, and that of the sky still in those of its patches."""
    patches = SkyPatches.of(1, np.eye(3))
    sky = PatchedEnvironment(np.ones((3, 1), f4), patches=patches)
    ball = wf.Sphere(
        (0, 0, 0), 1, material=wf.Material(wf.NullSurface(), interior=wf.Medium(0.5, emission=1))
    )
    scene = wf.Scene([ball], sky, wf.Camera.look_at((0, 0, -5), (0, 0, 0), size=(8, 8)))
    image = render(scene, 4, aovs=("light_groups",))
    parts = {name: layer for name, layer in image.layers.items() if name.startswith("light_groups.")}
    np.testing.assert_allclose(sum(parts.values()), image.rgb, rtol=1e-5)
    assert parts["light_groups.default"].max() > 0.5
    assert sum(layer.any() for name, layer in parts.items() if ".patch" in name) > 3


def test_a_medium_that_glows_is_a_light() -> None:
    """A scene with any light gets no other."""
    for emission in (0.0, 1e-3):
        flame = wf.Material(wf.NullSurface(), interior=wf.Medium(1, emission=emission))
        for scene in (
            wf.Scene([wf.Sphere((0, 0, 0), 1, material=flame)]),
            wf.Scene([wf.Sphere((0, 0, 0), 1)], medium=flame.interior),
        ):
            assert scene.emits == (emission > 0)
    dim = wf.Scene([wf.Sphere((0, 0, 0), 1, material=flame)])
    with pytest.warns(UserWarning, match="almost black"):
        assert render(dim, 1, size=(16, 16)).metadata["lighting"] is None
    with pytest.raises(wf.SceneError, match="or a medium; daylight coefficients"):
        wf.daylight_coefficients(dim, [(0, -2, 0)], normals=(0, 1, 0), spp=8)


# --- Alpha, catchers and lenses -----------------------------------------------------------------------


def test_a_sheet_that_is_almost_opaque() -> None:
    """Light samples are traced on behind it, whatever little gets through."""
    sheet = wf.Rectangle((-5, 1, -5), (10, 0, 0), (0, 0, 10), material=wf.Material(BLACK, alpha=0.999))
    scene = wf.Scene([floor(), sheet], wf.PointLight((0, 2, 0), 1e4), probe(HERE, (0.31, 0.17, 0.23)))
    assert_mean(measure(scene, 1), 0.001 * 2500 * ALBEDO / np.pi, 1e-6, rounding=1e-4)  # 1 − 0.999 in float32


def caustic_behind(catcher: wf.Material | wf.Bsdf) -> wf.Scene:
    """A glass ball on a floor, which the camera sees through a catcher in full light."""
    shapes = [
        wf.Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0), material=wf.Diffuse(0.8)),
        wf.Sphere((0, 0, 0.6), 0.5, material=wf.Dielectric(1.5)),
        wf.Sphere((0.9, 0.2, 3), 0.8, emission=4),
        wf.Rectangle((-3, -4, 0), (6, 0, 0), (0, 0, 6), material=catcher),
    ]
    camera = wf.Camera.look_at((0, -7, 4), (0, 0, 0), up=(0, 0, 1), fov=20, size=(16, 16))
    return wf.Scene(shapes, camera=camera)


def test_caustics_behind_a_catcher_are_left_to_paths_from_the_camera() -> None:
    """A path from a light cannot tell how well lit a catcher is: it stops there."""
    one, other = (
        render(caustic_behind(wf.ShadowCatcher()), 8, caustics=each, reuse=False, branches=1).rgb
        for each in (False, True)
    )
    np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_caustics_behind_a_catcher_with_holes() -> None:
    """What passes by its alpha meets paths from lights, and what passes as it is lit does not."""
    scene = caustic_behind(wf.Material(wf.ShadowCatcher(), alpha=0.5))
    means = [
        Mean.of(
            np.array(
                [
                    render(scene, 64, seed=seed, caustics=each, reuse=False, branches=1).rgb.mean(dtype=float)
                    for seed in range(24)
                ]
            )
        )
        for each in (False, True)
    ]
    one, other = means
    assert abs(one.value - other.value) < 4 * np.hypot(one.error, other.error)
    assert one.error < 0.02 * one.value


def test_a_lens_of_hardly_any_size_is_a_pinhole() -> None:
    scene = around_a_box([])
    one, other = (
        render(
            scene,
            2,
            camera=wf.Camera.look_at((0, 1.6, 5.5), (0, 1, 0), size=(16, 16), aperture=aperture),
            reuse=False,
            branches=1,
        ).rgb
        for aperture in (0.0, 1e-12)
    )
    np.testing.assert_allclose(one, other, rtol=1e-4)


# --- Media --------------------------------------------------------------------------------------------


def test_a_camera_in_the_box_of_a_medium_but_not_in_the_medium() -> None:
    """Cameras within the box of all that encloses anything ask what they are inside of, and others do not."""
    ball = wf.Sphere(
        (0, 0, 0), 1, material=wf.Material(wf.NullSurface(), interior=wf.Medium(0.5, emission=1e-9))
    )
    wall = wf.Rectangle((-9, -9, -9), (18, 0, 0), (0, 18, 0), material=BLACK, emission=1)
    for origin, chord in (((0, 0, 0.999), 1.999), ((0, 0, 1.001), 2.0), ((0.99, 0.99, 0.99), 2.0)):
        target = (0, 0, -9) if origin[0] == 0 else (-8.9, -8.9, -9)
        toward = np.subtract(target, origin) / np.linalg.norm(np.subtract(target, origin))
        along = -np.dot(origin, toward)
        half = np.sqrt(1 - np.dot(origin, origin) + along**2)
        chord = along + half - max(along - half, 0)
        scene = wf.Scene([ball, wall], camera=probe(target, origin))
        assert_mean(measure(scene, 1), np.exp(-0.5 * chord), 1e-6, rounding=1e-4)


def nested(outer: wf.Bsdf) -> list[wf.Shape]:
    """A ball within another one, of the same index of refraction, around the origin."""
    inner = wf.Material(wf.Dielectric(1.33), priority=2)
    return [
        wf.Sphere((0, 0, 0), 3, material=wf.Material(outer, priority=1)),
        wf.Sphere((0, 0, 0), 1, material=inner),
    ]


@pytest.mark.parametrize("outer", [wf.Dielectric(1.33), wf.Mix(wf.Dielectric(1.33), wf.Diffuse(0.5), 0.1)])
def test_the_index_around_is_that_of_a_mixture_too(outer: wf.Bsdf) -> None:
    """A ball of the index of what is around it is not there."""
    lamp = wf.Sphere((0, 0, -2), 0.5, material=BLACK, emission=1)
    scene = wf.Scene([*nested(outer), lamp], camera=probe((0, 0, -1.5), HERE))
    for mean in channels(scene, 16):
        assert_mean(mean, 1.0, 1e-6)


def test_a_mixture_of_two_indices_has_no_priority() -> None:
    mixed = wf.Mix(wf.Dielectric(1.33), wf.Dielectric(1.5))
    with pytest.raises(wf.SceneError, match="the ior of its Mix must be one number"):
        render(wf.Scene(nested(mixed), wf.Environment(1)), 1, size=(4, 4))
    varying = wf.Mix(wf.Diffuse(0.5), wf.Dielectric(wf.Texture(1 + NOISE[..., 0], srgb=False, channel=0)))
    with pytest.raises(wf.SceneError, match="the ior of its Mix must be one number"):
        render(wf.Scene(nested(varying), wf.Environment(1)), 1, size=(4, 4))


def test_layers_show_no_surface_that_another_one_hides() -> None:
    """Within something of a higher priority there is no surface of a lower one, for layers neither."""
    water = wf.Sphere((0, 0, 0), 3, material=wf.Material(wf.Dielectric(1.33), priority=2))
    ball = wf.Sphere((0, 0, -1.5), 0.5, material=wf.Material(wf.Dielectric(1.5), priority=1))
    leaf = wf.Rectangle(
        (-1, -1, -0.5),
        (2, 0, 0),
        (0, 2, 0),
        material=wf.Material(wf.Diffuse(0.5), alpha=0.4, visible_to_camera=True),
    )
    camera = wf.Camera.look_at((0, 0, 0), (0, 0, -1), fov=10, size=(4, 4))
    for shapes, inside_water in itertools.product(([water, ball], [water, ball, leaf]), (True, False)):
        placed = camera if inside_water else wf.Camera.look_at((0, 0, 6), (0, 0, 0), fov=5, size=(4, 4))
        image = render(
            wf.Scene(shapes, wf.Environment(0.5), placed), 1, aovs=("shape_id", "distance", "boxes")
        )
        assert (image.layers["shape_id"] == 0).all()
        np.testing.assert_allclose(image.layers["distance"], 3, rtol=0.01)
        seen = {each["name"]: each["visible"] for each in image.metadata["boxes"]}
        assert seen[water.name] == [0, 0, 4, 4]


@pytest.mark.parametrize("count", [FEW, FEW + 1])
def test_one_triangle_more_than_are_sampled_for_surfaces(count: int) -> None:
    """Of many triangles each is small, and they are sampled as they are."""
    edges = np.linspace(-1, 1, count + 1)
    rim = np.stack([edges, np.full(count + 1, 1.0), np.full(count + 1, -1.0)], 1)
    faces = np.stack([np.arange(count), np.arange(1, count + 1), np.full(count, count + 1)], 1)
    fan = wf.Mesh([*rim, (0, 1, 1)], faces, material=BLACK, emission=1.0)
    scene = wf.Scene([floor(), fan], camera=probe(HERE, (0.31, 0.17, 0.23)))
    assert compiled(scene).lights.kinds[0].few == (count == FEW)
    expected = polygon_irradiance([(-1, 1, -1), (1, 1, -1), (0, 1, 1)]) * ALBEDO / np.pi
    assert_mean(measure(scene, 256, max_bounces=1), expected, 0.01)


@pytest.mark.parametrize("glow", [0.0, 1e-6])
def test_media_of_both_kinds_beside_each_other(glow: float) -> None:
    """Grids take numbers without end, and light samples of grids that glow end within them."""
    slab = wf.Box((0, 0.75, 0), (4, 0.5, 4), material=wf.Material(wf.NullSurface(), interior=wf.Medium(0.5)))
    grid = wf.GridMedium(np.ones((2, 2, 2)), [(-2, 1.2, -2), (2, 1.6, 2)], absorption=1)
    fire = wf.GridMedium(np.ones((2, 2, 2)), [(3, 0.5, 0), (4, 1.5, 1)], absorption=1, emission=glow)
    shapes = [floor(), slab, wf.GridBox(grid), wf.GridBox(fire)]
    scene = wf.Scene(shapes, wf.PointLight((0, 2, 0), 10), probe(HERE, (0.31, 0.17, 0.23)))
    expected = 2.5 * ALBEDO / np.pi * np.exp(-0.5 * 0.5 - 0.4)
    assert_mean(measure(scene, 64, max_bounces=1), expected, 0.01, rounding=1e-4)


# --- Sensors ------------------------------------------------------------------------------------------


def radiance(scene: wf.Scene, direction: tuple[float, float, float]) -> float:
    """What is seen from (0, 1, 0)."""
    found = wf.measure(scene, [(0, 1, 0)], [direction], kind="radiance", spp=1, workers=1, progress=False)
    return float(found.value[0, 0])


def test_sensors_meet_what_cameras_do_not_see() -> None:
    """They measure the light that is there: no rule about what a camera sees is theirs."""
    unseen = wf.Material(BLACK, emission=1, visible_to_camera=False)
    lamp = wf.Sphere((0, 0, 2), 0.5, material=unseen)
    power = wf.measure_flux([lamp], lamp, kind="leaving", spp=4, max_bounces=0, workers=1, progress=False)
    np.testing.assert_allclose(power.value, np.pi * 4 * np.pi * 0.5**2, rtol=1e-5)
    roof = floor(wf.Material(BLACK, visible_to_camera=False), y=3.0)
    assert radiance(wf.Scene([roof], wf.Environment(1)), (0, 1, 0)) == 0
    catcher = wf.Scene([floor(wf.ShadowCatcher(ALBEDO))], wf.PointLight((0, 2, 0), 10))
    assert radiance(catcher, (0, -1, 0)) == pytest.approx(2.5 * ALBEDO / np.pi, rel=1e-5)
    sky = wf.Scene([roof], wf.Environment(1, backdrop=0.1))
    assert radiance(sky, (0, -1, 0)) == pytest.approx(1, rel=1e-5)


def suns(roof: wf.Shape) -> list[float]:
    """What gets of a sun at the zenith, of an irradiance of 1, below a roof and beside it."""
    patches = SkyPatches.of(1, np.eye(3)[:, [2, 0, 1]])
    points, normals = np.array([(0.0, 0, 0), (5, 0, 0)]), np.array([(0.0, 1, 0)] * 2)
    nothing = np.zeros((8, 2, len(patches)))
    scene = wf.Scene([roof], PatchedEnvironment(np.ones((3, 1), f4), patches=patches))
    found = wf.DaylightCoefficients(scene, points, normals, patches, nothing, nothing)
    return found.sunlight(wf.Weather([1], [1], [(0, 1, 0)]))[:, 0].tolist()


@pytest.mark.parametrize("visible", [True, False])
def test_roofs_that_cameras_do_not_see_hide_the_sun(visible: bool) -> None:
    roof = wf.Material(BLACK, visible_to_camera=visible)
    assert suns(floor(roof, half=1.0, y=1.0)) == [0, 1]


def test_the_sun_through_what_lets_a_part_of_it_through() -> None:
    """A ray to the sun is not just blocked or not."""
    assert suns(floor(wf.Material(BLACK, alpha=0.75), half=1.0, y=1.0)) == [0.25, 1]
    assert suns(floor(wf.ShadowCatcher(), half=1.0, y=1.0)) == [0, 1]
    smoke = wf.Medium(absorption=(0.5, 1, 2), scattering=(0.5, 0, 0))
    for medium in (smoke, wf.GridMedium(np.ones((2, 2, 2)), [(-1, 1, -1), (1, 2, 1)], (1, 1, 2))):
        box = wf.Box((0, 1.5, 0), (2, 1, 2), material=wf.Material(wf.NullSurface(), interior=medium))
        np.testing.assert_allclose(suns(box), [luminance(np.exp((-1, -1, -2))), 1], rtol=1e-4)
