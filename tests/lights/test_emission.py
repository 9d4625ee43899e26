"""Light from meshes that shine by a texture, by vertex colors, or from both sides."""

import imageio.v3 as iio
import numpy as np
import pytest
from gltf_builder import Builder
from hypothesis import given, settings
from hypothesis import strategies as st
from inside import (
    BaseTexture,
    LightTable,
    RectangleLights,
    TriangleLights,
    TwoSidedRectangleLights,
    TwoSidedTexturedTriangleLights,
    TwoSidedTriangleLights,
    compile_scene,
    f4,
    make_accelerator,
    textured_emission,
)
from scenes import ALBEDO, ALL, BLACK, EYE, HERE, MET_AND_SAMPLED, floor, polygon_irradiance, probe
from significance import SIDE, assert_mean, assert_same_images, measure, render, repeat

import wavefront as wf
from wavefront import testing

RNG = np.random.default_rng(0)
LOW, HIGH, Y = (-0.5, -0.4), (0.6, 0.7), 2.0


def area_light(emission, **rest) -> wf.Mesh:
    """A rectangle above the origin that faces down; u runs along x and v along z."""
    (x, z), u, v = LOW, HIGH[0] - LOW[0], HIGH[1] - LOW[1]
    return wf.Rectangle((x, Y, z), (u, 0, 0), (0, 0, v), emission=emission, **{"material": BLACK, **rest})


def irradiance(low: tuple[float, float] = LOW, high: tuple[float, float] = HIGH) -> float:
    """From a radiance of 1 on a rectangle at Y, (x, z) from low to high."""
    (x0, z0), (x1, z1) = low, high
    return polygon_irradiance([(x0, Y, z0), (x0, Y, z1), (x1, Y, z1), (x1, Y, z0)])


def lit(*things: wf.Mesh) -> wf.Scene:
    """A floor and things above it, seen at the origin."""
    return wf.Scene([floor(), *things], camera=probe(HERE, EYE))


def texture(values, **arguments) -> wf.Texture:
    """A texture with hard edges."""
    return wf.Texture(np.asarray(values, f4), filter="nearest", **arguments)


def compiled(*shapes: wf.Mesh | wf.Sphere):
    """The scene as arrays."""
    return compile_scene(wf.Scene(shapes), lambda geometry: make_accelerator(geometry, "numpy"))


# --- Textures --------------------------------------------------------------------------------------

QUARTERS = np.array([[[4, 0, 0], [0, 0, 0]], [[1, 2, 3], [0, 8, 0]]], f4)  # rows from v = 1 down
MIDDLE = ((LOW[0] + HIGH[0]) / 2, (LOW[1] + HIGH[1]) / 2)
PARTS = {  # (row, column) -> corners
    (0, 0): ((LOW[0], MIDDLE[1]), (MIDDLE[0], HIGH[1])),
    (0, 1): (MIDDLE, HIGH),
    (1, 0): (LOW, MIDDLE),
    (1, 1): ((MIDDLE[0], LOW[1]), (HIGH[0], MIDDLE[1])),
}


@pytest.mark.parametrize("integrator", ALL)
def test_quarters_of_a_light(integrator: str) -> None:
    """The sum of what four lights of one color each would give, by all ways to find light."""
    expected = sum(np.mean(QUARTERS[cell]) * irradiance(*corners) for cell, corners in PARTS.items())
    spp = 2048 if integrator == "naive" else 512
    mean = measure(lit(area_light(texture(QUARTERS))), spp, integrator=integrator, max_bounces=1)
    assert_mean(mean, expected * ALBEDO / np.pi, 0.02)


def test_colors_stay_where_they_are() -> None:
    whole = repeat(lit(area_light(texture(QUARTERS))), 16, max_bounces=1)
    parts = [
        wf.Rectangle(
            (x0, Y, z0), (x1 - x0, 0, 0), (0, 0, z1 - z0), material=BLACK, emission=QUARTERS[cell].tolist()
        )
        for cell, ((x0, z0), (x1, z1)) in PARTS.items()
    ]
    assert_same_images(whole, repeat(lit(*parts), 16, max_bounces=1, first_seed=50), 0.02)


@pytest.mark.parametrize("integrator", ALL)
def test_a_light_is_seen_as_its_texture(integrator: str) -> None:
    """By the camera, from below and through a mirror; from behind it is dark."""
    scene = wf.Scene([area_light(texture(QUARTERS))])
    for (row, column), (low, high) in PARTS.items():
        at = ((low[0] + high[0]) / 2, Y, (low[1] + high[1]) / 2)
        for eye, seen in ((-3, QUARTERS[row, column]), (7, np.zeros(3))):
            scene.camera = wf.Camera.look_at((at[0], eye, at[2]), at, (0, 0, 1), fov=0.1, size=(2, 2))
            image = render(scene, 1, integrator=integrator, max_bounces=1).rgb
            assert image == pytest.approx(np.broadcast_to(seen, image.shape))


@pytest.mark.parametrize("integrator", ["naive", "full"])
def test_vertex_colors_shine(integrator: str) -> None:
    """A linear ramp of radiance on a light far away gives the mean's irradiance."""
    corners = [(-1, 100, -1), (1, 100, -1), (1, 100, 1), (-1, 100, 1)]
    mesh = wf.Mesh(
        corners,
        [[0, 1, 2], [0, 2, 3]],
        colors=[[0, 0, 0], [1, 0.5, 0.25], [1, 0.5, 0.25], [0, 0, 0]],
        material=BLACK,
        emission=wf.VertexColors(),
    )
    expected = polygon_irradiance([corners[i] for i in (0, 3, 2, 1)]) * (1.75 / 3) / 2
    if integrator == "naive":  # would find it once in 8000 samples
        mesh.vertices[:, 1] = 1
        naive = repeat(lit(mesh), 256, runs=8, integrator="naive", max_bounces=1)
        assert_same_images(naive, repeat(lit(mesh), 64, runs=8, first_seed=90, max_bounces=1), 0.02)
    else:
        mean = measure(lit(mesh), 1024, integrator=integrator, max_bounces=1)
        assert_mean(mean, expected * ALBEDO / np.pi, 0.005)


def test_what_the_estimate_misses_is_found_by_chance(monkeypatch) -> None:
    """A stripe between the points that are looked up: no light samples, and no light lost."""
    monkeypatch.setattr(textured_emission, "MOST", 4)  # the points are at 8/3 and 16/3 of every 8 texels
    stripe = np.zeros((1, 32), f4)
    stripe[0, 3:5] = 10
    low, high = (LOW[0] + 3 / 32 * 1.1, LOW[1]), (LOW[0] + 5 / 32 * 1.1, HIGH[1])
    expected = 10 * irradiance(low, high) * ALBEDO / np.pi
    striped = area_light(texture(stripe))
    assert compiled(floor(), striped).lights.choice is None
    behind = wf.Sphere((0, 12, 0), 0.01, material=BLACK, emission=1.0)  # so that there is a choice
    for things in ((), (behind,)):
        scene = lit(striped, *things)
        for integrator in ("naive", "full"):
            mean = measure(scene, 2048, integrator=integrator, max_bounces=1)
            assert_mean(mean, expected, 0.04)


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(1, 6))
def test_the_mean_of_a_face(seed: int, width: int, height: int) -> None:
    """Over a rectangle it is the image's mean, as near as 1024 points come."""
    image = np.random.default_rng(seed).random((height, width, 3), f4)
    mesh = area_light(texture(image, wrap="clamp"))
    mean = textured_emission.mean_radiance(mesh, mesh.vertices[mesh.faces])
    assert mean.mean(1) == pytest.approx(image.mean((0, 1)), abs=0.05)


def test_light_samples_follow_the_texture() -> None:
    """Of a thousand quads the ten that shine are chosen, each by its power; the rest cost no choice."""
    n = 1000
    x = np.repeat(np.arange(n), 4).reshape(n, 4) + np.array([0, 0.9, 0.9, 0])
    z = np.tile([0, 0, 0.9, 0.9], (n, 1))
    vertices = np.stack([x, np.full_like(x, 2.0), z], 2).reshape(-1, 3)
    quads = np.arange(4 * n).reshape(n, 4)
    uvs = np.repeat((np.arange(n) + 0.5) / n, 4)
    image = np.zeros((1, n), f4)
    image[0, ::100] = np.arange(1, 11)
    mesh = wf.Mesh(
        vertices,
        np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]),
        uvs=np.stack([uvs, uvs], 1),
        material=BLACK,
        emission=texture(image),
    )
    scene = compile_scene(
        wf.Scene([floor(), mesh]), lambda geometry: make_accelerator(geometry, "numpy"), "power"
    )
    assert len(scene.lights) == 2 * n
    chance = scene.lights.choice.pmf(np.arange(2 * n), np.zeros((3, 2 * n), f4))
    assert np.flatnonzero(chance[:n]).tolist() == list(range(0, n, 100))
    assert chance[: 2 * n].reshape(2, n)[:, ::100] == pytest.approx(np.tile(np.arange(1, 11) / 110, (2, 1)))
    light, probability = scene.lights.choice.sample(np.zeros((3, 1000), f4), RNG.random(1000, f4))
    assert (probability == chance[light]).all()
    assert (light % 100 == 0).all()


# --- Both sides ------------------------------------------------------------------------------------


def test_both_sides_are_seen() -> None:
    for emission in (3.0, texture(np.full((2, 2), 3.0))):
        for both in (False, True):
            scene = wf.Scene([area_light(emission, two_sided=both)])
            for eye in (-3, 7):
                scene.camera = wf.Camera.look_at((0, eye, 0), (0, Y, 0), (0, 0, 1), fov=1, size=(2, 2))
                assert (render(scene, 1).rgb == (3 if both or eye < 0 else 0)).all()


@pytest.mark.parametrize("shape", ["rectangle", "triangles", "texture"])
@pytest.mark.parametrize("integrator", ["naive", "full"])
def test_a_light_lights_on_both_sides(integrator: str, shape: str) -> None:
    """A floor that it faces, and one that it looks away from, with the same closed form."""
    emission = texture(np.ones((2, 2))) if shape == "texture" else 1.0
    up = wf.Rectangle(
        (LOW[0], Y, LOW[1]), (0, 0, 1.1), (1.1, 0, 0), material=BLACK, emission=emission, two_sided=True
    )
    if shape == "triangles":
        up = wf.Mesh(up.vertices, up.faces[::-1], material=BLACK, emission=1.0, two_sided=True)
    kinds = {
        "rectangle": TwoSidedRectangleLights,
        "triangles": TwoSidedTriangleLights,
        "texture": TwoSidedTexturedTriangleLights,
    }
    assert type(compiled(floor(), up).lights.kinds[0]) is kinds[shape]
    spp = 4096 if integrator == "naive" else 512
    mean = measure(lit(up), spp, integrator=integrator, max_bounces=1)
    assert_mean(mean, irradiance() * ALBEDO / np.pi, 0.02)


def column(*values: float) -> np.ndarray:
    """Three numbers as a (3, 1) column."""
    return np.array(values, f4).reshape(3, 1)


def lights(kind: type) -> TriangleLights | RectangleLights:
    """Two of a kind, seen from both sides by the default points of `check_light`."""
    corners = np.array([[[-1, 1.5, -1], [0.4, 1.3, -1], [0.4, 1.3, 0.6]], [[2, -2, 0], [2, 1, 4], [5, 1, 4]]])
    corners[:, 2] = corners[:, 1] + np.cross(corners[:, 1] - corners[:, 0], [[0.3, 0.2, 1], [1, 0, 0.5]])
    if issubclass(kind, TriangleLights):
        return kind.from_triangles(corners, column(3, 2, 1))
    return kind.from_pairs(corners, column(3, 2, 1))


@pytest.mark.slow
@pytest.mark.parametrize("kind", [TwoSidedTriangleLights, TwoSidedRectangleLights])
@pytest.mark.first(1)
def test_the_contract(kind: type) -> None:
    """χ², densities and radiance agree, on both sides."""
    record = lights(kind)
    points = np.array([[0, 0, 0], [0.5, 4, 1]], f4)
    testing.check_light(record, points=points, samples=5_000)
    for k in range(2):
        for p in points:
            n, one = 64, record.take(np.array([k]))
            sample = one.sample_li(np.repeat(p[:, None], n, 1), RNG.random((2, n), f4))
            assert (sample.pdf > 0).all()
            assert (sample.cos_light > 0).all()


# --- Everything together -----------------------------------------------------------------------------


def gallery(size: tuple[int, int] = (16, 8)) -> wf.Scene:
    """Screens that shine on one side or both, one with holes, between glossy walls and a matte ball."""
    rng = np.random.default_rng(5)
    image = texture(rng.random((4, 4, 3)) ** 2 * 4)
    leaf = wf.Material(wf.Diffuse(0.5), alpha=texture(rng.random((3, 3)), channel=0), alpha_cutoff=0.4)
    shapes: list[wf.Mesh | wf.Sphere] = [
        floor(half=3),
        wf.Rectangle((-1.6, 0.3, 0.5), (1, 0, -0.7), (0, 1.2, 0), material=BLACK, emission=image),
        wf.Rectangle(
            (0.6, 0.4, -0.6), (1, 0, 1), (0, 1.2, 0.2), material=leaf, emission=image, two_sided=True
        ),
        wf.Rectangle((-0.5, 2.2, 0), (1, 0, 0), (0, 0.3, -1), material=BLACK, emission=image, two_sided=True),
        wf.Rectangle((-3, 0, -1.5), (6, 0, 0), (0, 4, 0), material=wf.Principled(0.5, roughness=0.5)),
        wf.Sphere((0, 0.5, 0.3), 0.5, material=wf.Diffuse(0.6)),
    ]
    camera = wf.Camera.look_at((0.3, 1.6, 6), (0, 1, 0), fov=36, size=size)
    return wf.Scene(shapes, [wf.PointLight((1, 3, 2), 1.0)], camera)


@pytest.mark.slow
def test_estimators_agree() -> None:
    """All light by chance and by light samples; the point light is left to both."""
    scene = gallery()
    scene.lights = []
    naive = repeat(scene, 32, runs=12, integrator="naive", max_bounces=4)
    full = repeat(scene, 8, runs=12, integrator="full", max_bounces=4, first_seed=100)
    assert_same_images(naive, full, 0.03)
    mis = repeat(scene, 4, integrator="direct_mis", max_bounces=1)
    simple = repeat(scene, 12, integrator="direct_simple", max_bounces=1, first_seed=200)
    assert_same_images(mis, simple, 0.02)


@pytest.mark.parametrize("cut", [{"wave_size": 7}, {"wave_size": 50, "workers": 3}])
def test_waves_and_workers_change_no_bit(cut: dict) -> None:
    whole = render(gallery((6, 5)), 3).rgb
    assert render(gallery((6, 5)), 3, **cut).rgb.tobytes() == whole.tobytes()


def test_dark_lights_take_no_part() -> None:
    record = lights(TriangleLights)
    dark = TriangleLights.concatenate([record.take(np.array([0])), record])
    dark.radiance[:, 0] = 0
    point, u, v = RNG.random((3, 100), f4), RNG.random(100, f4), RNG.random((2, 100), f4)
    for choice in ("spatial", "power", "uniform"):
        plain, mixed = LightTable([record], 5.0, choice), LightTable([dark], 5.0, choice)
        (a, first), (b, second) = (table.sample_li(point, u, v) for table in (plain, mixed))
        assert (second == first + 1).all()
        assert (a.wi == b.wi).all()
        assert (a.pdf == b.pdf).all()
        assert (mixed.pdf_li(second, point, b.wi) == plain.pdf_li(first, point, a.wi)).all()
        assert (mixed.pdf_li(np.zeros(100, np.intp), point, b.wi) == 0).all()


# --- From files ------------------------------------------------------------------------------------

CODES = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [188, 188, 188]]], np.uint8)
GREY = ((188 / 255 + 0.055) / 1.055) ** 2.4


def seen(mesh: wf.Mesh, u: float, v: float, eye: float = 1) -> np.ndarray:
    """The color of a mesh in the unit square at z = 0, from before or behind."""
    camera = wf.Camera.look_at((u, v, eye), (u, v, 0), fov=0.01, size=(SIDE, SIDE))
    return render(wf.Scene([mesh], camera=camera), 1, max_bounces=0).rgb.mean((0, 1))


@pytest.mark.parametrize("both", [False, True])
def test_gltf(tmp_path, both: bool) -> None:
    """Factor × strength × decoded texture, from both sides if the material is double-sided."""
    build = Builder()
    info = build.image(CODES)
    build.json["samplers"] = [{"magFilter": 9728}]
    build.json["textures"][0]["sampler"] = 0
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 10}}
    build.material(emissiveFactor=[1, 0.5, 0.25], emissiveTexture=info, doubleSided=both, extensions=strength)
    (mesh,) = wf.load(build.gltf(tmp_path / "a.gltf"), strict=True).shapes
    assert mesh.two_sided is both
    # glTF's v runs downwards, so the image's top row is at y = 0
    assert seen(mesh, 0.1, 0.1) == pytest.approx([10, 0, 0])
    assert seen(mesh, 0.8, 0.1) == pytest.approx([0, 5, 0])
    assert seen(mesh, 0.1, 0.8) == pytest.approx([0, 0, 2.5])
    assert seen(mesh, 0.1, 0.1, -1) == pytest.approx([10 * both, 0, 0])


def test_gltf_without_a_factor_is_dark(tmp_path) -> None:
    build = Builder()
    build.material(emissiveTexture=build.image(CODES))
    (mesh,) = wf.load(build.gltf(tmp_path / "a.gltf"), strict=True).shapes
    assert mesh.emission is None


@pytest.mark.parametrize(
    ("lines", "factor"), [("map_Ke t.png", 1.0), ("Ke 4 4 4\nmap_Ke t.png", 4.0), ("Ke 2 2 2", None)]
)
def test_mtl(tmp_path, lines: str, factor: float | None) -> None:
    """The image, alone or times Ke; its bottom row is at v = 0."""
    iio.imwrite(tmp_path / "t.png", np.kron(CODES, np.ones((8, 8, 1), np.uint8)))
    (tmp_path / "s.mtl").write_text(f"newmtl m\nKd 0 0 0\n{lines}\n")
    text = "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"
    (tmp_path / "a.obj").write_text(text)
    (mesh,) = wf.load(tmp_path / "a.obj", strict=True).shapes
    if factor is None:
        assert seen(mesh, 0.3, 0.3) == pytest.approx([2, 2, 2])
        return
    assert seen(mesh, 0.2, 0.2) == pytest.approx([0, 0, factor])
    assert seen(mesh, 0.7, 0.2) == pytest.approx([GREY * factor] * 3, rel=1e-4)
    assert seen(mesh, 0.2, 0.7) == pytest.approx([factor, 0, 0])


def test_one_mesh_keeps_its_emission(tmp_path) -> None:
    build = Builder()
    build.material(emissiveFactor=[1, 1, 1], emissiveTexture=build.image(CODES), doubleSided=True)
    mesh = wf.load_mesh(build.gltf(tmp_path / "a.gltf"))
    assert isinstance(mesh.emission, wf.Texture)
    assert mesh.two_sided
    assert wf.load_mesh(tmp_path / "a.gltf", material=wf.Diffuse(0.5)).emission is None


# --- Emission of materials -------------------------------------------------------------------------


GLOW = wf.Material(wf.Principled(0.3), emission=(1, 2, 3))


def two_pictures(first, second) -> list[np.ndarray]:
    """Pictures of two sets of shapes above a floor."""
    ground = wf.Rectangle((-2, -1, -2), (0, 0, 4), (4, 0, 0))
    camera = wf.Camera.look_at((0, 1, 6), (0, 0, 0), fov=40, size=(16, 16))
    return [render(wf.Scene([ground, *shapes], camera=camera), 4).rgb for shapes in (first, second)]


def test_a_material_makes_a_light_of_its_shape() -> None:
    """It shines as a shape with the same emission does, which goes before it."""
    plain = wf.Principled(0.3)
    square = ((-1, 0, 0), (2, 0, 0), (0, 1, 0))
    by_material = [wf.Rectangle(*square, material=GLOW), wf.Sphere((0, 1.5, 0), 0.3, material=GLOW)]
    by_shape = [
        wf.Rectangle(*square, material=plain, emission=(1, 2, 3)),
        wf.Sphere((0, 1.5, 0), 0.3, material=plain, emission=(1, 2, 3)),
    ]
    a, b = two_pictures(by_material, by_shape)
    assert a.max() > 1
    assert np.array_equal(a, b)
    assert wf.Rectangle(*square, material=GLOW, emission=5.0).emission.ravel().tolist() == [5, 5, 5]
    assert wf.Material(wf.Principled(0.3), emission=0.0).emission is None
    assert wf.Rectangle(*square, material=wf.Material(wf.Principled(0.3), emission=0.0)).emission is None


def test_a_material_may_shine_by_a_texture() -> None:
    """As a mesh with a textured emission does, seen from both sides where it is two-sided."""
    square = ((-1, 0, 0), (2, 0, 0), (0, 1, 0))
    glow = texture(QUARTERS)
    mesh = wf.Rectangle(*square, material=wf.Material(wf.Principled(0.3), emission=glow), two_sided=True)
    same = wf.Rectangle(*square, material=wf.Principled(0.3), emission=glow, two_sided=True)
    a, b = two_pictures([mesh], [same])
    assert a.max() > 0.1
    assert np.array_equal(a, b)


def test_instances_shine_by_the_material_they_have() -> None:
    mesh = wf.Rectangle((-1, 0, 0), (1, 0, 0), (0, 1, 0))
    there, here = np.eye(4), np.eye(4)
    there[0, 3] = 1.5
    pair = [wf.Instance(mesh, here), wf.Instance(mesh, there, material=GLOW)]
    assert [shape.emission is None for shape in pair] == [True, False]
    own = wf.Rectangle((0.5, 0, 0), (1, 0, 0), (0, 1, 0), material=wf.Principled(0.3), emission=(1, 2, 3))
    a, b = two_pictures(pair, [mesh, own])
    assert (
        np.quantile(np.abs(a - b).max(2), 0.95) < 1e-3
    )  # one of the pair may be traced in a frame of its own
    assert a.mean() == pytest.approx(b.mean(), rel=0.01)


# --- Spheres ---------------------------------------------------------------------------------------

TOP, LEFT = texture([[1.0], [0.0]]), texture([[1.0, 0.0]])  # halves of a sphere by latitude and longitude


@pytest.mark.parametrize("integrator", MET_AND_SAMPLED)
@pytest.mark.parametrize(("turned", "share"), [(TOP, 0.0), (texture([[0.0], [1.0]]), 1.0), (LEFT, 0.5)])
def test_a_sphere_shines_by_a_texture(turned: wf.Texture, share: float, integrator: str) -> None:
    """From right below, E = π·L·(r/d)² of the lower half, none of the upper, and half of one beside."""
    lamp = wf.Sphere((0, 2, 0), 0.5, emission=turned, material=BLACK)
    spp = 4096 if integrator == "naive" else 256
    found = measure(lit(lamp), spp, integrator=integrator, max_bounces=1)
    assert_mean(found, share * ALBEDO * (0.5 / 2) ** 2, 0.01 * share, rounding=1e-6)


def test_an_even_texture_on_spheres_is_their_emission() -> None:
    """Beside a sphere that shines evenly, a mesh with a texture, and from inside."""

    def shapes(glow) -> list[wf.Shape]:
        room = wf.Sphere((0, 0, 0), 9, emission=glow(0.25), material=wf.Diffuse(0.3))
        balls = wf.Spheres([(-1, 1, 0), (1, 1, 0)], 0.3, emission=glow(2.0), material=BLACK)
        even = wf.Sphere((0, 1, 1), 0.2, emission=3, material=BLACK)
        return [room, balls, even, area_light(texture(QUARTERS))]

    a, b = two_pictures(shapes(lambda value: value), shapes(lambda value: texture([[value]])))
    assert a == pytest.approx(b, abs=1e-6)


def test_spheres_shine_by_their_colors() -> None:
    """Each by its own, with a factor; what is seen is what light samples bring."""
    colors = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    balls = wf.Spheres(
        [(-1, 1, 0), (0, 1, 0), (1, 1, 0)], 0.3, colors, emission=wf.VertexColors(0.5), material=BLACK
    )
    camera = wf.Camera.look_at((0, 1, 9), (0, 1, 0), size=(30, 10), fov=6)
    seen = render(wf.Scene([balls], camera=camera), 1).rgb
    assert seen[5, [5, 15, 25]].tolist() == (0.5 * np.array(colors)).tolist()
    light = compiled(balls).lights
    assert light.kinds[0].radiance.T.tolist() == (0.5 * np.array(colors)).tolist()
    full, naive = (
        repeat(lit(balls), spp, 10, integrator=name, max_bounces=2)
        for name, spp in (("full", 16), ("naive", 256))
    )
    assert_same_images(full, naive, 0.01)


def test_the_mean_of_a_texture_on_a_sphere_weighs_areas() -> None:
    """The caps by latitude are as large as they are: a band of a quarter of v has (1 − cos 45°)/2."""
    rows = texture([[1.0], [0.0], [0.0], [0.0]])
    ball = wf.Sphere(HERE, 1, emission=rows)
    mean = compiled(ball).lights.kinds[0].radiance
    assert mean[:, 0] == pytest.approx((1 - np.cos(np.pi / 4)) / 2, abs=2e-3)


# --- Complaints ------------------------------------------------------------------------------------


def test_complaints() -> None:
    """A mesh without coordinates is named; a light needs a color or a texture."""
    with pytest.raises(wf.SceneError, match="rectangle: emission"):
        area_light("bright")
    with pytest.raises(wf.SceneError, match=r"Material emission\[1\] is -1; it must be at least 0"):
        wf.Material(wf.Principled(0.5), emission=(0, -1, 0))
    bare = wf.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], emission=texture(QUARTERS))
    with pytest.warns(UserWarning, match=r"1 mesh lacks the texture coordinates \(uvs\).*first: 'mesh'"):
        render(wf.Scene([bare]), 1)


class Negative(BaseTexture):
    """What a user's own class may return."""

    def at(self, surface):
        """Return -5."""
        return np.full((3, len(surface)), -5, f4)


def test_values_below_0_count_as_0() -> None:
    """Those of a user's own class, whose values are not known before; an image that has some is refused."""
    scene = lit(area_light(Negative()))
    assert not render(scene, 4, max_bounces=1).rgb.any()
    with pytest.raises(
        wf.SceneError, match=r"emission: <Texture 'array'.* has the value -5; it must be at least 0"
    ):
        area_light(texture([[-5.0, -5.0]]))
