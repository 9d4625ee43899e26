"""Surfaces that are only partly there, for paths and for shadow rays alike."""

import imageio.v3 as iio
import numpy as np
import pytest
from gltf_builder import Builder
from inside import Principled, installed, sampler
from scenes import ALBEDO, ALL, BLACK, EYE, HERE, MET_AND_SAMPLED, floor, panel, polygon_irradiance, probe
from significance import SIDE, assert_mean, assert_same_images, measure, render, repeat

import wavefront as wf

NO_EMBREE = pytest.mark.skipif(not installed(), reason="no embreex")
ACCELERATORS = ["numpy", pytest.param("embree", marks=NO_EMBREE)]
PAIRS = [*((integrator, "numpy") for integrator in ALL), pytest.param("full", "embree", marks=NO_EMBREE)]
UP = (0, 0, 1)  # of cameras that look along y
HALF = np.array([[0.0, 1.0]], np.float32)  # nothing at u < ½, all there at u > ½


def veil(alpha, y: float = 1.0, half: float = 20.0, cutoff: float | None = None, **rest) -> wf.Mesh:
    """A square that faces down, only partly there; u runs along x."""
    material = wf.Material(rest.pop("material", BLACK), alpha=alpha, alpha_cutoff=cutoff)
    return wf.Rectangle(
        (-half, y, -half), (2 * half, 0, 0), (0, 0, 2 * half), material=material, name="veil", **rest
    )


def mask(values, **arguments) -> wf.Texture:
    """A texture of opacities, with hard edges."""
    return wf.Texture(np.asarray(values, np.float32), filter="nearest", channel=0, **arguments)


AREA_LIGHT = panel((-0.5, -0.4), (0.6, 0.7), 2.0)
UNSHADED = polygon_irradiance([(-0.5, 2, -0.4), (-0.5, 2, 0.7), (0.6, 2, 0.7), (0.6, 2, -0.4)])


def lit(*things, area_light: wf.Mesh = AREA_LIGHT) -> wf.Scene:
    """A floor under a light and other things, seen at the origin from close by."""
    return wf.Scene([floor(), area_light, *things], camera=probe(HERE, 0.1 * EYE))


# --- In front of things ----------------------------------------------------------------------------


def before_a_wall(alpha: float) -> wf.Scene:
    """A sheet that reflects 0.5 before a wall of 2, seen head on."""
    sheet = wf.Rectangle(
        (-9, -9, 0), (18, 0, 0), (0, 18, 0), material=wf.Material(wf.Diffuse(0.5), alpha=alpha)
    )
    wall = wf.Rectangle((-9, -9, -1), (18, 0, 0), (0, 18, 0), material=BLACK, emission=2.0)
    camera = wf.Camera.look_at((0.3, 0.2, 5), (0.3, 0.2, 0), fov=1e-6, size=(SIDE, SIDE))
    return wf.Scene([sheet, wall], [wf.Environment(1.0)], camera)


@pytest.mark.parametrize(("integrator", "accel"), PAIRS)
def test_a_sheet_before_a_wall(integrator: str, accel: str) -> None:
    for alpha in (0.0, 0.3, 1.0):
        mean = measure(before_a_wall(alpha), 1024, integrator=integrator, accel=accel, max_bounces=1)
        unseen = 10 / (64 * 1024)  # numbers may be spread so evenly that the batches show no difference
        assert_mean(mean, (1 - alpha) * 2 + alpha * 0.5, 0.006, rounding=unseen)


@pytest.mark.parametrize("sampler", ["sobol", "independent", "bluenoise"])
def test_each_sheet_decides_for_itself(sampler: str) -> None:
    """Three sheets let (1 - alpha)³ through; one random number for all of them would let more."""
    wall = before_a_wall(0.0).shapes[1]
    sheets = [
        wf.Rectangle((-9, -9, z), (18, 0, 0), (0, 18, 0), material=wf.Material(BLACK, alpha=0.4))
        for z in range(3)
    ]
    scene = wf.Scene([*sheets, wall], camera=before_a_wall(0.0).camera)
    mean = measure(scene, 4096, integrator="naive", max_bounces=0, sampler=sampler)
    assert_mean(mean, 2 * 0.6**3, 0.005, rounding=10 / (64 * 4096 * 0.6**3))


def test_a_sphere_is_passed_twice() -> None:
    """Its near and its far side, by the camera and within the wall's light."""
    ball = wf.Sphere((0.3, 0.2, 2), 0.7, material=wf.Material(BLACK, alpha=0.3))
    scene = before_a_wall(0.0)
    scene.shapes[0] = ball
    assert_mean(measure(scene, 4096, max_bounces=1), 2 * 0.7**2, 0.003, rounding=10 / (64 * 4096 * 0.49))


def test_what_is_not_there_is_no_event() -> None:
    sheets = [veil(0.0, y) for y in np.linspace(0.1, 1.9, 50)]
    scene = wf.Scene([*sheets, AREA_LIGHT], camera=probe((0, 2, 0), HERE))
    for integrator in ALL:
        assert (render(scene, 1, integrator=integrator, max_bounces=0).rgb == 1).all()


@pytest.mark.parametrize("integrator", ["naive", "full"])
def test_the_environment_behind(integrator: str) -> None:
    """What passes everything meets the light at infinity, weighted as from where it scattered."""
    scene = wf.Scene([floor(), veil(0.25, half=1e4)], [wf.Environment(1.0)], probe(HERE, 0.1 * EYE))
    assert_mean(measure(scene, 1024, integrator=integrator, max_bounces=1), 0.75 * ALBEDO, 0.003)


# --- Shadows ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("integrator", "accel"), PAIRS)
def test_shadow_of_sheets(integrator: str, accel: str) -> None:
    """Two sheets, and a light seen through them by both kinds of samples."""
    scene = lit(veil(0.3, 0.5), veil(0.5, 1.0))
    spp = 4096 if integrator == "naive" else 1024
    mean = measure(scene, spp, integrator=integrator, accel=accel, max_bounces=1)
    assert_mean(mean, 0.7 * 0.5 * UNSHADED * ALBEDO / np.pi, 0.02 if integrator == "naive" else 0.004)


@pytest.mark.parametrize("integrator", ["naive", "full"])
def test_shadow_of_a_sphere(integrator: str) -> None:
    ball = wf.Sphere((0, 1, 0), 0.7, material=wf.Material(BLACK, alpha=0.3))
    area_light = panel((-0.3, -0.3), (0.3, 0.3), 2.0)
    whole = polygon_irradiance([(-0.3, 2, -0.3), (-0.3, 2, 0.3), (0.3, 2, 0.3), (0.3, 2, -0.3)])
    spp = 8192 if integrator == "naive" else 256
    mean = measure(lit(ball, area_light=area_light), spp, integrator=integrator, max_bounces=1)
    assert_mean(mean, 0.49 * whole * ALBEDO / np.pi, 0.04)


@pytest.mark.parametrize("integrator", ["naive", "full"])
def test_half_of_a_light_through_a_cut_out(integrator: str) -> None:
    """A sheet that is not there where x < 0 hides the other half exactly."""
    left = polygon_irradiance([(-0.5, 2, -0.4), (-0.5, 2, 0.7), (0, 2, 0.7), (0, 2, -0.4)])
    spp = 4096 if integrator == "naive" else 1024
    mean = measure(lit(veil(mask(HALF))), spp, integrator=integrator, max_bounces=1)
    assert_mean(mean, left * ALBEDO / np.pi, 0.02)


def test_a_wall_behind_a_veil_still_hides() -> None:
    for y in (0.5, 1.5):
        scene = lit(veil(0.3, 1.0), veil(1.0, y))
        assert not render(scene, 16, max_bounces=1, integrator="direct_simple").rgb.any()


@pytest.mark.parametrize("accel", ACCELERATORS)
@pytest.mark.parametrize("cutoff", [None, 0.5])
def test_shadow_of_a_checkerboard(cutoff: float | None, accel: str) -> None:
    """Parallel light through 4 × 4 squares of 0.2 and 0.7 draws them on the floor."""
    squares = np.where(np.indices((4, 4)).sum(0) % 2, 0.2, 0.7)
    sheet = veil(mask(squares), half=2.0, cutoff=cutoff)
    camera = wf.Camera.orthographic((0, 0.5, 0), HERE, UP, height=4, size=(32, 32))
    scene = wf.Scene([floor(), sheet], [wf.DirectionalLight((0, -1, 0), np.pi)], camera)
    image = render(scene, 4, max_bounces=1, accel=accel).rgb
    passed = 1 - (squares if cutoff is None else squares >= cutoff)
    # the camera looks down with z up in the picture: u grows with x, to the left; v with z, upwards
    assert image[..., 0] == pytest.approx(np.kron(passed[:, ::-1], np.ones((8, 8))) * ALBEDO, rel=1e-5)


@pytest.mark.parametrize("integrator", MET_AND_SAMPLED)
def test_a_light_that_is_partly_there(integrator: str) -> None:
    """By light samples and by paths it shines as much as is there of it, evenly or not."""
    left = polygon_irradiance([(-0.5, 2, -0.4), (-0.5, 2, 0.7), (0.05, 2, 0.7), (0.05, 2, -0.4)])
    for alpha, expected in ((0.4, 0.4 * UNSHADED), (mask(1 - HALF), left)):
        area_light = wf.Rectangle(
            (-0.5, 2, -0.4), (1.1, 0, 0), (0, 0, 1.1), material=wf.Material(BLACK, alpha=alpha), emission=1.0
        )
        spp = 4096 if integrator == "naive" else 1024
        mean = measure(lit(area_light=area_light), spp, integrator=integrator, max_bounces=1)
        assert_mean(mean, expected * ALBEDO / np.pi, 0.02)


def test_absorption_goes_on_behind_holes() -> None:
    """What enters colored glass where its surface is not there is weakened like the rest."""
    glass = wf.Material(wf.Dielectric(1.0), alpha=0.5, interior=wf.Medium((0.2, 1.0, 3.0)))
    plate = [
        wf.Rectangle((-50, 1, -50), (0, 0, 100), (100, 0, 0), material=glass),
        wf.Rectangle((-50, 0.5, -50), (100, 0, 0), (0, 0, 100), material=glass),
    ]
    expected = np.exp(-0.5 * np.array([0.2, 1, 3]))
    camera = wf.Camera.look_at((0, 5, 0), HERE, UP, fov=1e-6, size=(2, 2))
    seen = render(wf.Scene(plate, [wf.Environment(1.0)], camera), 64, max_bounces=8).rgb
    assert seen == pytest.approx(np.broadcast_to(expected, seen.shape), rel=1e-4)
    above = wf.Scene([floor(), *plate], [wf.PointLight((0, 2, 0), 4.0)], probe(HERE, 0.1 * EYE))
    shadow = render(above, 4, max_bounces=1).rgb
    assert shadow == pytest.approx(np.broadcast_to(expected * 0.25 * ALBEDO / np.pi, shadow.shape), rel=1e-4)


# --- Estimators, waves and workers -------------------------------------------------------------------


def leaves(size: tuple[int, int] = (16, 8)) -> wf.Scene:
    """A shelf of leaves cut out of squares, a veil and a glass ball, before a light."""
    rng, above = np.random.default_rng(3), np.array([0, 1.2, 0])
    leaf = mask(rng.random((6, 6)))
    shapes: list[wf.Mesh | wf.Sphere] = [floor(), panel((-1, -1), (1, 1), 3.0, emission=4.0)]
    for material in (
        wf.Material(wf.Diffuse((0.3, 0.6, 0.2)), alpha=leaf, alpha_cutoff=0.5),
        wf.Material(wf.Principled((0.6, 0.3, 0.2), roughness=0.4), alpha=leaf),
        wf.Material(wf.Diffuse(0.7), alpha=0.4),
    ):
        for corner, u, v in rng.normal(size=(8, 3, 3)):
            shapes.append(wf.Rectangle(corner + above, u, v, material=material))
    shapes.append(wf.Sphere((0.4, 0.6, 0.8), 0.5, material=wf.Material(wf.Dielectric(1.5), alpha=0.7)))
    camera = wf.Camera.look_at((0, 1.5, 6), (0, 1, 0), fov=40, size=size)
    return wf.Scene(shapes, [wf.Environment(0.2)], camera)


@pytest.mark.slow
def test_estimators_agree() -> None:
    naive = repeat(leaves(), 32, integrator="naive", max_bounces=4)
    full = repeat(leaves(), 8, integrator="full", max_bounces=4, first_seed=100)
    assert_same_images(naive, full, 0.02)


@pytest.mark.parametrize(
    ("integrator", "cut"),
    [("full", {"wave_size": 1}), ("naive", {"wave_size": 64}), ("full", {"wave_size": 50, "workers": 3})],
)
@pytest.mark.first(1)
def test_waves_and_workers_change_no_bit(integrator: str, cut: dict) -> None:
    """Numbers go by surfaces along a ray, not by who asks for them."""
    scene = leaves((6, 5))
    whole = render(scene, 3, integrator=integrator).rgb
    assert render(scene, 3, integrator=integrator, **cut).rgb.tobytes() == whole.tobytes()


@pytest.mark.parametrize(("scale", "shift"), [(1e6, 0.0), (1e-6, 0.0), (1.0, 1e4)])
def test_scale_and_place_change_nothing(scale: float, shift: float) -> None:
    """What lies behind a surface begins at its rounding error, not at a distance."""
    scene = leaves((12, 8))
    moved: list[wf.Mesh | wf.Sphere] = []
    for shape in scene.shapes:
        if isinstance(shape, wf.Mesh):
            shape.vertices = shape.vertices * scale + shift
            moved.append(shape)
        else:
            moved.append(
                wf.Sphere(shape.center * scale + shift, shape.radius * scale, material=shape.material)
            )
    eye, target = (np.array(p) * scale + shift for p in ((0, 1.5, 6), (0, 1, 0)))
    camera = wf.Camera.look_at(eye, target, fov=40, size=(12, 8))
    image, plain = render(wf.Scene(moved, scene.lights, camera), 16).rgb, render(leaves((12, 8)), 16).rgb
    assert np.abs(image - plain).mean() < 1e-3 * plain.mean()


# --- From files ------------------------------------------------------------------------------------


def behind(mesh: wf.Mesh) -> float:
    """How much of a light below shows through a mesh at z = 0 in the unit square, away from its edges."""
    area_light = wf.Rectangle((-9, -9, -1), (18, 0, 0), (0, 18, 0), material=BLACK, emission=1.0)
    camera = wf.Camera.orthographic((0.25, 0.25, 1), (0.25, 0.25, 0), height=0.2, size=(SIDE, SIDE))
    return float(render(wf.Scene([mesh, area_light], camera=camera), 256, max_bounces=0).rgb.mean())


@pytest.mark.parametrize(
    ("mode", "factor", "clear"),
    [("BLEND", 1.0, 0.6), ("BLEND", 0.5, 0.8), ("MASK", 1.0, 0.0), ("MASK", 0.5, 1.0)],
)
def test_gltf(tmp_path, mode: str, factor: float, clear: float) -> None:
    """The alpha of the image, 0.4, times the factor; a mask of 0.3."""
    build = Builder()
    info = build.image(np.full((2, 2, 4), (255, 0, 0, 102), np.uint8))
    group = {"baseColorTexture": info, "baseColorFactor": [1, 1, 1, factor]}
    build.material(pbrMetallicRoughness=group, alphaMode=mode, alphaCutoff=0.3)
    (mesh,) = wf.load(build.gltf(tmp_path / "a.gltf"), strict=True).shapes
    assert isinstance(mesh.material.bsdf, Principled)
    assert behind(mesh) == pytest.approx(clear, abs=0.005)


@pytest.mark.parametrize(
    ("lines", "clear"), [("d 0.3", 0.7), ("Tr 0.3", 0.3), ("map_d t.png", 0.6), ("d 0.5\nmap_d t.png", 0.8)]
)
def test_mtl(tmp_path, lines: str, clear: float) -> None:
    iio.imwrite(tmp_path / "t.png", np.full((2, 2), 102, np.uint8))
    (tmp_path / "s.mtl").write_text(f"newmtl m\nKd 0.5 0.5 0.5\n{lines}\n")
    text = "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n"
    (tmp_path / "a.obj").write_text(text)
    (mesh,) = wf.load(tmp_path / "a.obj", strict=True).shapes
    assert behind(mesh) == pytest.approx(clear, abs=0.005)


# --- Complaints ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: wf.Material(wf.Diffuse(0.5), alpha=1.5), r"Material alpha is 1\.5; it must be in \[0, 1\]"),
        (
            lambda: wf.Material(wf.Mirror(), alpha=0.5, alpha_cutoff=-1),
            r"Material alpha_cutoff is -1; it must be at least 0",
        ),
        (
            lambda: wf.Material(wf.Diffuse(0.5), alpha=wf.Texture(np.ones((2, 2, 4), np.float32))),
            r"Material alpha is <Texture 'array': 2 × 2>, which gives colors; choose one channel by channel=",
        ),
        (
            lambda: wf.Mix(wf.Diffuse(0.5), wf.Material(wf.Diffuse(0.1), alpha=0.5)),
            r"Mix second must be a Bsdf such as wf.Diffuse\(0.5\), got Material\(bsdf=",
        ),
        (
            lambda: render(
                wf.Scene([wf.Sphere(HERE, 1, material=wf.Material(BLACK, alpha=0.5), emission=1.0)]), 1
            ),
            "sphere: an emitting sphere must be opaque; its material has an alpha",
        ),
    ],
)
def test_complaints(make, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        make()


def test_a_ray_through_more_veils_than_there_are_numbers_is_an_error(monkeypatch) -> None:
    """Two decisions must never share a random number."""
    monkeypatch.setitem(sampler.REPEATED, sampler.Dimension.OPACITY, 9)
    veils = [
        wf.Rectangle((-2, -2, z), (4, 0, 0), (0, 4, 0), material=wf.Material(wf.Diffuse(0.5), alpha=0.01))
        for z in (1.0, 0.5, 0.0)
    ]
    camera = wf.Camera.look_at((0, 0, 3), (0, 0, 0), size=(4, 4))
    scene = wf.Scene(veils, [wf.Environment(1.0)], camera)
    with pytest.raises(wf.RenderError, match="more than 2 surfaces with an opacity below 1"):
        wf.render(scene, 4, workers=1, progress=False)
