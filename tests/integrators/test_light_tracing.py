"""Paths from lights: with the paths from the camera that leave out their light, they find the light that
plain paths find.

Point and directional lights, which plain paths never meet behind glass or in a mirror, are compared with
closed forms. Printed are all differences: `pytest -s tests/integrators/test_light_tracing.py`.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import trimesh
from inside import (
    Background,
    CompiledScene,
    Program,
    Sampler,
    SobolSampler,
    SpecularSurfaces,
    Splats,
    compile_scene,
    f4,
    generate,
    li_full,
    trace_light,
)
from scenes import box, fresnel
from scipy import stats
from significance import ALPHA, smallest_p

import wavefront as wf

WHITE = wf.Diffuse(0.7)
GLASS = wf.Dielectric(1.5)
PANE = wf.ThinDielectric(1.5)
COLORED = wf.Material(GLASS, interior=wf.Medium(absorption=(0.3, 1.0, 2.5)))
COPPER = wf.Conductor.named("copper", roughness=0.5)
PANEL = wf.Rectangle((-1.5, 2.6, -1.5), (3, 0, 0), (0, 0, 3), emission=3.0)
VIEW = (0.0, 1.6, 3.0), (0.0, 0.1, 0.0)
SIZE = 16, 16
CAMERA = wf.Camera.look_at(*VIEW, fov=40, size=SIZE)
RNG = np.random.default_rng(4)
NOISE = RNG.random((8, 8, 3)).astype(f4)
WAVES = wf.NormalMap(np.dstack([NOISE[..., :2] * 0.4 + 0.3, np.full((8, 8), 0.95, f4)]))
TILT = wf.NormalMap(np.full((2, 2, 3), (0.8, 0.5, 0.9), f4))
PARTS = 2  # of the picture, along each side
RUNS = 8

# --- Means of eye paths and paths from lights against plain paths ----------------------------------------


@dataclass(frozen=True)
class Tracer:
    """A scene compiled with or without paths from lights."""

    scene: CompiledScene
    camera: wf.Camera

    @classmethod
    def of(cls, scene, caustics=True, accel="numpy", most_copies=0):
        compiled = compile_scene(
            scene, scene.accelerators.maker(accel), most_copies=most_copies, mis=True, caustics=caustics
        )
        return cls(compiled, compiled.view(scene.camera))

    @property
    def pixels(self) -> int:
        width, height = self.camera.size
        return width * height

    def sampler(self, seed: int) -> Sampler:
        return SobolSampler(seed, self.camera.resolution[0])

    def lanes(self, first: int, last: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the pixel and the sample of each path of the samples from first to before last."""
        samples = np.repeat(np.arange(first, last, dtype=np.uint32), self.pixels)
        return np.tile(np.arange(self.pixels, dtype=np.uint32), last - first), samples

    def eye(self, seed: int, spp: int, max_bounces: int) -> np.ndarray:
        """Return the picture (H, W, 3) of paths from the camera."""
        pixel, sample = self.lanes(0, spp)
        sampler = self.sampler(seed)
        paths = generate(self.scene, self.camera, sampler, pixel, sample)
        return self.picture(pixel, li_full(self.scene, paths, sampler, max_bounces)) / spp

    def splats(self, seed: int, spp: int, max_bounces: int) -> Splats:
        return trace_light(self.scene, self.camera, self.sampler(seed), *self.lanes(0, spp), max_bounces)

    def light(self, seed: int, spp: int, max_bounces: int) -> np.ndarray:
        """Return the picture (H, W, 3) of paths from lights."""
        splats = self.splats(seed, spp, max_bounces)
        return self.picture(splats.pixel, splats.radiance) / (spp * self.pixels)

    def picture(self, pixel: np.ndarray, radiance: np.ndarray) -> np.ndarray:
        width, height = self.camera.size
        rows = [np.bincount(pixel, row.astype(float), self.pixels) for row in radiance]
        return np.stack(rows, 1).reshape(height, width, 3)


def parts(picture: np.ndarray) -> np.ndarray:
    """Return the means (PARTS, PARTS, 3) of parts of a picture (H, W, 3)."""
    height, width, _ = picture.shape
    return picture.reshape(PARTS, height // PARTS, PARTS, width // PARTS, 3).mean((1, 3))


def assert_same_light(name, scene, spp, max_error, max_bounces, accel="numpy"):
    """Compare the means of the whole picture and of its parts, run by run with the same seed.

    `max_error` bounds the standard error relative to the light that paths from lights find.
    """
    split, plain = Tracer.of(scene, accel=accel), Tracer.of(scene, caustics=False, accel=accel)
    off, found = np.empty((RUNS, PARTS, PARTS, 3)), 0.0
    for seed in range(RUNS):
        light = split.light(seed, spp, max_bounces)
        both = split.eye(seed, spp, max_bounces) + light
        off[seed] = parts(both - plain.eye(seed, spp, max_bounces))
        found += light.mean() / RUNS
    whole = off.mean((1, 2, 3))
    error = whole.std(ddof=1) / np.sqrt(RUNS)
    z = whole.mean() / error
    print(
        f"{name}: light {found:.4g}, off by {whole.mean() / found:+.4f} ± {error / found:.4f}, z = {z:+.2f}"
    )
    assert found > 0
    assert error <= max_error * found, f"too noisy: {error / found:.1%}"
    assert smallest_p(whole[:, None], 0.0) > ALPHA
    assert smallest_p(off, 0.0) > ALPHA


# --- Scenes ---------------------------------------------------------------------------------------


def world(*specular: wf.Shape, lights=(PANEL,), others=(), camera=CAMERA, floor=WHITE) -> wf.Scene:
    """Return a floor, lights with surfaces above it, and what is between."""
    ground = wf.Rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4), material=floor)
    return wf.Scene([ground, *specular, *lights], others, camera)


def ball(material=GLASS, center=(0, 0.8, 0), radius=0.75, **kw) -> wf.Sphere:
    return wf.Sphere(center, radius, material=material, **kw)


def icosphere(subdivisions, material=GLASS, center=(0, 0.8, 0), radius=0.75, smooth=False, **kw):
    mesh = trimesh.creation.icosphere(subdivisions, radius)
    away = np.asarray(mesh.vertices)
    normals = away / radius if smooth else None
    return wf.Mesh(away + center, np.asarray(mesh.faces), normals=normals, material=material, **kw)


def sheet(material=PANE, y=1.2) -> wf.Mesh:
    return wf.Rectangle((-1.2, y, -1.2), (2.4, 0, 0), (0, 0, 2.4), material=material)


def wall(material=WHITE) -> wf.Mesh:
    """The left wall."""
    return wf.Rectangle((-1.5, 0, 1), (0, 0, -3), (0, 2, 0), material=material)


def placed(size: float, *at: float) -> np.ndarray:
    matrix = np.diag([size, size, size, 1.0])
    matrix[:3, 3] = at
    return matrix


def textured(**kw) -> wf.Texture:
    return wf.Texture(NOISE, filter="nearest", **kw)


def instances() -> wf.Scene:
    """Glass and diffuse instances, which do not count as specular surfaces, beside glass that does."""
    clear, white = icosphere(1, center=(0, 0, 0), radius=1), icosphere(1, WHITE, center=(0, 0, 0), radius=1)
    return world(
        ball(),
        *(wf.Instance(clear, placed(0.3, x, 0.5, 0.5)) for x in (-1, 1)),
        *(wf.Instance(white, placed(0.2, x, 0.3, 1)) for x in (-0.6, 0.6)),
        icosphere(0, center=(0.9, 0.4, -0.6), radius=0.3),
    )


def two_faced(alternating: bool) -> wf.Mesh:
    """A pane whose faces are there twice, from the front and from the back."""
    pane = sheet()
    front = np.asarray(pane.faces)
    both = np.stack([front, front[:, ::-1]], 1 if alternating else 0).reshape(-1, 3)
    return wf.Mesh(pane.vertices, both, material=PANE)


def calibrated(**kw) -> wf.Camera:
    """A camera with skew, oblong pixels, a shift and lens distortion."""
    at = CAMERA.extrinsics()
    k = [[20, 1.5, 7], [0, 24, 9], [0, 0, 1]]
    return wf.Camera.from_intrinsics(
        k, at[:3, :3], at[:3, 3], SIZE, distortion=(-0.1, 0.02, 0.01, -0.01), **kw
    )


@dataclass(frozen=True)
class Case:
    """A scene, and how noisy it is."""

    build: Callable[[], wf.Scene]
    spp: int = 20
    max_error: float = 0.035  # bound on the standard error relative to the light that paths from lights find
    max_bounces: int = 7


LAMP = wf.Sphere((0, 2.6, 0), 0.8, emission=4.0)
CASES = {
    # lights
    "sphere light": Case(lambda: world(ball(), lights=[LAMP])),
    "mesh light": Case(
        lambda: world(ball(), lights=[icosphere(1, WHITE, (0.3, 2.6, 0), 0.8, emission=(4, 3, 2))]),
        max_error=0.05,
    ),
    "three lights and sky": Case(
        lambda: world(
            ball(),
            lights=[
                PANEL,
                wf.Sphere((1.5, 1, 1), 0.3, emission=(5, 1, 1)),
                wf.Sphere((-1.7, 0.5, -0.5), 0.3, emission=(1, 1, 8)),
            ],
            others=[wf.Environment(0.2)],
        )
    ),
    "light all around": Case(
        lambda: world(ball(), lights=[wf.Sphere((0, 0, 0), 6, emission=0.7, material=wf.Diffuse(0))])
    ),
    "light in colored glass": Case(
        lambda: world(ball(COLORED), lights=[ball(WHITE, (0.1, 0.9, 0), 0.35, emission=4.0)])
    ),
    "textured emission": Case(
        lambda: world(
            ball(), lights=[wf.Rectangle((-1.5, 2.6, -1.5), (3, 0, 0), (0, 0, 3), emission=textured(scale=6))]
        )
    ),
    "light with alpha": Case(
        lambda: world(
            ball(),
            lights=[
                wf.Rectangle(
                    (-1.5, 2.6, -1.5),
                    (3, 0, 0),
                    (0, 0, 3),
                    emission=4.0,
                    material=wf.Material(WHITE, alpha=0.5),
                )
            ],
        )
    ),
    "mirror that shines": Case(
        lambda: world(
            ball(wf.Mirror(0.8), (0, 1.2, -0.5), 0.6, emission=1.0), wall(wf.Mirror(0.9)), lights=[]
        ),
        max_error=0.06,
    ),
    # specular surfaces
    "smooth mesh": Case(lambda: world(icosphere(3, smooth=True))),
    "flat mesh": Case(lambda: world(icosphere(1))),
    "mirrors": Case(lambda: world(ball(wf.Mirror(0.9), (1.2, 1, -0.8)), wall(wf.Mirror((0.9, 0.5, 0.7))))),
    "smooth mesh of a mirror": Case(
        lambda: world(icosphere(2, wf.Mirror(0.9), (0, 1.2, -1.2), 1, smooth=True)), max_error=0.07
    ),
    "ball in colored glass": Case(lambda: world(ball(COLORED), ball(wf.Diffuse(0.8), (0.2, 0.6, 0.3), 0.25))),
    "tinted glass": Case(
        lambda: world(ball(wf.Dielectric(1.4, reflectance=(1, 0.5, 0.2), transmittance=(0.3, 0.9, 0.6))))
    ),
    "bubble in glass": Case(lambda: world(ball(), ball(wf.Dielectric(1 / 1.5), (0.1, 0.85, 0), 0.4))),
    "two glasses side by side": Case(
        lambda: world(
            box((-0.8, 0.3, -0.6), (0, 1.2, 0.6), GLASS),
            box((0, 0.3, -0.6), (0.8, 1.2, 0.6), wf.Dielectric(1.2)),
        )
    ),
    "pane and boundary of index 1": Case(lambda: world(sheet(), sheet(wf.Dielectric(1), 1.6))),
    "panes in a plane": Case(
        lambda: world(
            sheet(),
            wf.Rectangle(
                (-0.7, 1.2, -0.5),
                (1.8, 0, 0.2),
                (0.1, 0, 2),
                material=wf.ThinDielectric(1.8, transmittance=(0.5, 0.8, 1)),
            ),
        )
    ),
    "pane with two faces": Case(lambda: world(two_faced(alternating=True))),
    "pane on the floor": Case(lambda: world(ball(), sheet(y=0))),
    "glass with alpha": Case(lambda: world(ball(wf.Material(GLASS, alpha=0.6)))),
    "pane with texture of alpha": Case(lambda: world(sheet(wf.Material(PANE, alpha=textured(channel=0))))),
    # The light does not graze the mirror: normals are then bent to the camera's or the light's side.
    "mirror with normal map": Case(
        lambda: world(
            wall(wf.Material(wf.Mirror(0.9), normal_map=WAVES)),
            lights=[wf.Rectangle((-0.5, 2.6, -1.5), (2, 0, 0), (0, 0, 3), emission=3.0)],
        )
    ),
    "glass with normal map": Case(
        lambda: world(sheet(wf.Material(GLASS, normal_map=WAVES)), sheet(GLASS, 0.8))
    ),
    "instances": Case(instances),
    "cylinders": Case(
        lambda: world(
            ball(),
            wf.Cylinders([(-1, 0.2, 0.5)], [(1, 0.2, 0.5)], 0.15, material=GLASS),
            wf.Capsules([(-1, 0.2, -0.9)], [(1, 0.2, -0.9)], 0.15, material=wf.Mirror(0.9)),
        ),
        max_error=0.07,
    ),
    # where the light goes
    "rough metal": Case(lambda: world(ball(), floor=COPPER), spp=40),
    "principled": Case(
        lambda: world(
            ball(),
            floor=wf.Principled((0.8, 0.4, 0.2), roughness=0.4, clearcoat=0.5, clearcoat_roughness=0.3),
        )
    ),
    "diffuse and mirror": Case(lambda: world(ball(), floor=wf.Mix(wf.Diffuse(0.7), wf.Mirror(0.9), 0.4))),
    "rough glass below a pane": Case(
        lambda: world(sheet(y=1.7), icosphere(2, wf.Dielectric(1.4, roughness=0.5), smooth=True))
    ),
    "rough pane below a pane": Case(
        lambda: world(sheet(y=1.7), sheet(wf.ThinDielectric(1.5, roughness=0.6), 0.6))
    ),
    "walls below a pane": Case(
        lambda: world(
            sheet(y=1.7),
            wall(wf.Mix(wf.Diffuse(0.9), wf.Mirror(0.9), 0.5)),
            wf.Rectangle((1.5, 0, -1), (0, 0, 2), (0, 1, 0), material=COPPER),
        )
    ),
    "normal maps": Case(
        lambda: world(
            ball(), wall(wf.Material(WHITE, normal_map=WAVES)), floor=wf.Material(WHITE, normal_map=WAVES)
        )
    ),
    "tilted normals": Case(lambda: world(wall(wf.Mirror(0.9)), floor=wf.Material(WHITE, normal_map=TILT))),
    "smooth meshes": Case(
        lambda: world(
            ball(),
            icosphere(1, WHITE, (0.9, 0.5, 0.6), 0.5, smooth=True),
            icosphere(1, COPPER, (-1, 0.5, 0.6), 0.5, smooth=True),
        )
    ),
    "alpha before the specular surface": Case(
        lambda: world(ball(), sheet(wf.Material(WHITE, alpha=0.4), 2.2)), spp=40
    ),
    "alpha after the specular surface": Case(
        lambda: world(sheet(y=1.7), sheet(wf.Material(WHITE, alpha=0.4), 0.6))
    ),
    "alpha before the camera": Case(
        lambda: world(
            ball(),
            wf.Rectangle(
                (-1, 0, 1.2), (2, 0, 0), (0, 2, 0), material=wf.Material(wf.Diffuse(0.3), alpha=0.5)
            ),
        ),
        spp=40,
    ),
    "shadow catcher": Case(
        lambda: world(
            sheet(y=1.7),
            wall(wf.Diffuse(0.9)),
            floor=wf.ShadowCatcher(),
            camera=wf.Camera.look_at((0, 1.2, 0.5), (-1.5, 0.8, -1), fov=40, size=SIZE),
        )
    ),
    # cameras
    "lens with distortion": Case(lambda: world(ball(), camera=calibrated(aperture=0.4, focus=2.5))),
    "panorama": Case(
        lambda: world(ball(), camera=wf.Camera.panorama((0.2, 0.5, 1.3), (0, 0.5, 0), size=(32, 16)))
    ),
    "crop": Case(
        lambda: world(ball(), camera=wf.Camera.look_at(*VIEW, fov=40, size=(40, 36), crop=(8, 14, 32, 30)))
    ),
    # lengths of paths
    "two bounces": Case(lambda: world(sheet()), max_bounces=2),
}


# each kind of light, of specular surface, of what is lit and of camera
QUICK = [
    "three lights and sky",
    "light with alpha",
    "mirror that shines",
    "flat mesh",
    "ball in colored glass",
    "two glasses side by side",
    "panes in a plane",
    "pane with texture of alpha",
    "glass with normal map",
    "instances",
    "cylinders",
    "principled",
    "smooth meshes",
    "alpha before the specular surface",
    "alpha after the specular surface",
    "lens with distortion",
    "crop",
    "two bounces",
]


@pytest.mark.parametrize("name", QUICK)
@pytest.mark.first(3)
def test_means(name: str) -> None:
    case = CASES[name]
    assert_same_light(name, case.build(), case.spp, case.max_error, case.max_bounces)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_means_with_less_noise(name: str) -> None:
    case = CASES[name]
    assert_same_light(name, case.build(), 16 * case.spp, case.max_error / 3, case.max_bounces)


# --- Closed forms ---------------------------------------------------------------------------------

ALBEDO = 0.1  # of what is lit, so that hardly any light comes back to the specular surface


def looks_at(x: float, y: float, z: float, height: float) -> wf.Camera:
    """A camera that looks straight down, or up, at a square of a floor or ceiling, from near by."""
    origin = (x, y + 0.5 if y < 1 else y - 0.5, z)
    return wf.Camera.orthographic(origin, (x, y, z), (0, 0, 1), height=height, size=(4, 4))


def ground(y: float = 0) -> wf.Mesh:
    return wf.Rectangle((-1, y, 1), (2, 0, 0), (0, 0, -2), material=wf.Diffuse(ALBEDO))


def assert_light(scene: wf.Scene, expected, max_bounces: int, max_error: float = 0.01) -> None:
    """Compare the mean of paths from lights with its exact value (3,)."""
    traced = Tracer.of(scene)
    found = np.stack([traced.light(seed, 2048, max_bounces).mean((0, 1)) for seed in range(8)])
    expected = np.broadcast_to(expected, 3)
    mean, error = found.mean(0), found.std(0, ddof=1) / np.sqrt(len(found))
    print(f"found {mean} ± {error}, must be {expected}")
    assert (error <= max_error * expected).all()
    assert (np.abs(mean - expected) <= 4 * error + 1e-3 * expected).all()


def test_point_light_over_a_mirror_lights_the_ceiling_as_from_its_image() -> None:
    tint, half = np.array([0.9, 0.5, 0.2]), 0.1
    mirror = wf.Rectangle((0, 0, 0.3), (0.3, 0, 0), (0, 0, -0.3), material=wf.Mirror(tint))
    scene = wf.Scene([mirror, ground(2)], [wf.PointLight((0, 1, 0), 10)], looks_at(0.4, 2, 0.3, 2 * half))
    x, z = np.meshgrid(*(middle + (np.arange(64) + 0.5) / 32 * half - half for middle in (0.4, 0.3)))
    irradiance = (10 * 3 / (x**2 + z**2 + 9) ** 1.5).mean()
    assert_light(scene, tint * ALBEDO / np.pi * irradiance, max_bounces=2)


@pytest.mark.parametrize(("opacity", "copies"), [(0.6, 1), (1, 2), (1, 1)])
@pytest.mark.first(1)
def test_directional_light_in_a_mirror_lights_the_floor(opacity: float, copies: int) -> None:
    """Of mirrors at one place only the first reflects."""
    material = wf.Material(wf.Mirror(0.8), alpha=opacity)
    mirror = wf.Rectangle((-1, 1, 0), (0, 0, 0.6), (0, 1, 0), material=material)
    sun = wf.DirectionalLight((-1, -1, 0), 3)
    scene = wf.Scene([*[mirror] * copies, ground()], [sun], looks_at(0.5, 0, 0.3, 0.4))
    assert_light(scene, opacity * 0.8 * ALBEDO / np.pi * 3 / np.sqrt(2), max_bounces=7)


@pytest.mark.slow
@pytest.mark.parametrize(("mirror_tilt", "floor_tilt"), [(0.05, 0.3), (-0.15, 0)])
@pytest.mark.first(1)
def test_directional_light_in_a_mirror_with_tilted_normals(mirror_tilt: float, floor_tilt: float) -> None:
    """From the floor, the sun in the mirror has the radiance of the sun, however the normals are bent."""
    flat, towards = wf.Rectangle((-1, 1, 0), (0, 1, 0), (0, 0, 0.6)), np.array([-1, -1, 0]) / np.sqrt(2)
    normal = np.array([np.cos(mirror_tilt), np.sin(mirror_tilt), 0])
    up = np.array([np.sin(floor_tilt), np.cos(floor_tilt), 0])
    away = towards - 2 * (towards @ normal) * normal
    shapes = [
        wf.Mesh(flat.vertices, flat.faces, normals=np.tile(normal, (4, 1)), material=wf.Mirror(0.8)),
        wf.Mesh(ground().vertices, ground().faces, normals=np.tile(up, (4, 1)), material=wf.Diffuse(ALBEDO)),
    ]
    camera = looks_at(-1 - 1.5 * away[0] / away[1], 0, 0.3, 0.1)
    scene = wf.Scene(shapes, [wf.DirectionalLight(towards, 3)], camera)
    assert_light(scene, 0.8 * ALBEDO / np.pi * 3 * -(away @ up), max_bounces=2)


@pytest.mark.parametrize(("max_bounces", "crossings"), [(3, 1), (12, 6)])
@pytest.mark.first(1)
def test_directional_light_through_a_colored_slab(max_bounces: int, crossings: int) -> None:
    """Each two bounces more let light through that has been reflected twice more inside."""
    absorption, thickness = np.array([0.1, 0.7, 2.0]), 0.2
    glass = wf.Material(GLASS, interior=wf.Medium(absorption))
    slab = box((-1.2, 1, -0.4), (1.2, 1 + thickness, 0.4), glass)
    towards = np.array([0.6, -1, 0.0])
    cos = 1 / np.linalg.norm(towards)
    lost = np.exp(-absorption * thickness / np.sqrt(1 - (1 - cos**2) / 1.5**2))
    reflected = fresnel(float(np.degrees(np.arccos(cos))))
    through = (1 - reflected) ** 2 * lost * sum((reflected * lost) ** (2 * k) for k in range(crossings))
    scene = wf.Scene([slab, ground()], [wf.DirectionalLight(towards, 3)], looks_at(0, 0, 0, 0.5))
    assert_light(scene, ALBEDO / np.pi * 3 * cos * through, max_bounces)


def test_point_light_through_a_slab() -> None:
    """Straight below, light that comes through a slab of thickness d looks d·(1 − 1/n) nearer."""
    slab = box((-0.06, 1, -0.06), (0.06, 1.1, 0.06), wf.Dielectric(2.0))
    scene = wf.Scene([slab, ground()], [wf.PointLight((0, 3, 0), 10)], looks_at(0, 0, 0, 0.1))
    irradiance = 10 / (3 - 0.1 * (1 - 1 / 2.0)) ** 2
    assert_light(scene, ALBEDO / np.pi * irradiance * (1 - fresnel(0, 2.0)) ** 2, max_bounces=3)


# --- Where paths from lights begin ----------------------------------------------------------------------


def specular_surfaces_of(scene: wf.Scene, most_copies: int = 0) -> tuple[CompiledScene, SpecularSurfaces]:
    compiled = Tracer.of(scene, most_copies=most_copies).scene
    assert compiled.specular_surfaces is not None
    return compiled, compiled.specular_surfaces


def mixed() -> wf.Scene:
    """Specular surfaces of all kinds among others; the first and the last curved primitive are others."""
    clear = icosphere(0, center=(0, 0, 0), radius=1)
    return world(
        wf.Cylinders([(-1, 0.2, 0.5)], [(1, 0.2, 0.5)], 0.15, material=GLASS),
        wf.Instance(clear, placed(0.3, -1, 0.5, 0.5)),
        wf.Instance(clear, placed(0.2, 1, 0.5, 0.5)),
        wf.Capsules([(-1, 0.2, -0.9)], [(1, 0.2, -0.9)], 0.15, material=wf.Mirror(0.9)),
        ball(WHITE, (1.5, 0.3, 0), 0.3),
        wf.Spheres([(0, 1, 0), (1, 1, 1)], [0.4, 0.2], material=GLASS),
        ball(wf.Mirror(1), (-1, 0.5, -1), 0.3),
        ball(wf.Mirror(1), (-1, 1.5, -1), 0.3, emission=1.0),
        icosphere(1, wf.Mirror(0.9), (0, 2, 0), 0.3),
        ball(wf.Dielectric(1.5, roughness=0.4), (1.5, 1.3, 0), 0.3),
    )


def test_points_on_specular_surfaces_are_even() -> None:
    """Counts per primitive go by area, and the moments within each are those of even points."""
    _, specular = specular_surfaces_of(mixed())
    n = 1 << 18
    rng = np.random.default_rng(1)
    points = specular.sample(rng.random(n), rng.random((2, n)).astype(f4))
    flat = len(specular.corners)
    assert flat == 80
    assert specular.prim.size == flat + 3
    a, b, c = specular.corners.astype(float).transpose(1, 0, 2)
    area = np.append(
        np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2, 4 * np.pi * specular.radii.astype(float) ** 2
    )
    assert specular.area == pytest.approx(area.sum())
    which = np.searchsorted(specular.prim, points.prim)
    assert (specular.prim.take(which) == points.prim).all()
    counts = np.bincount(which, minlength=area.size)
    assert stats.chisquare(counts, area / area.sum() * n).pvalue > 1e-3

    on = which < flat
    weights = np.stack([1 - points.b1 - points.b2, points.b1, points.b2])[:, on].astype(float)
    assert (weights >= -1e-6).all()
    corners = np.stack([a, b, c]).take(which[on], 1)
    expected = (weights[..., None] * corners).sum(0)
    np.testing.assert_allclose(points.point[:, on].T, expected, atol=1e-6)
    m = weights.shape[1]
    # of even weights the mean is 1/3, the variance 1/18 and the mean square 1/6
    np.testing.assert_allclose(weights.mean(1), 1 / 3, atol=4 * np.sqrt(1 / 18 / m))
    np.testing.assert_allclose((weights**2).mean(1), 1 / 6, atol=4 * 0.2 / np.sqrt(m))

    ball_of = which[~on] - flat
    away = (points.point[:, ~on] - specular.centers.take(ball_of, 1)) / specular.radii.take(ball_of)
    np.testing.assert_allclose((away**2).sum(0), 1, atol=1e-5)
    for k in range(3):
        assert stats.kstest(away[k], stats.uniform(-1, 2).cdf).pvalue > 1e-3


def test_ids_of_specular_surfaces_are_those_of_hits() -> None:
    """A ray that meets one finds its id, and its material has delta lobes alone; so in all scenes."""
    for most_copies in (0, 1000):
        compiled, specular = specular_surfaces_of(mixed(), most_copies)
        rng = np.random.default_rng(2)
        n = 4096
        points = specular.sample(rng.random(n), rng.random((2, n)).astype(f4))
        away = rng.normal(size=(3, n))
        away = (away / np.linalg.norm(away, axis=0)).astype(f4)
        nothing = np.full(n, -1)
        hits = compiled.accelerator.closest(points.point + f4(1e-3) * away, -away, nothing)
        met = hits.t < 2e-3
        # a point within 1e-3 of an edge may be seen through a neighbor
        assert met.mean() > 0.9
        assert (hits.prim[met] == points.prim[met]).mean() > 0.9
        assert specular.includes(points.prim).all()


def test_includes() -> None:
    compiled, specular = specular_surfaces_of(mixed())
    ids = np.arange(-1, 10_000)
    included = ids[specular.includes(ids)]
    assert included.tolist() == specular.prim.tolist()
    assert compiled.instances is not None
    delta_alone = np.array([bsdf.specular for bsdf in compiled.materials.groups])
    rows, _ = compiled.instances.locate(specular.prim)
    assert delta_alone[compiled.materials.group_of.take(compiled.material_of.take(rows))].all()
    assert (compiled.light_of.take(rows) < 0).all()


def test_scenes_without_specular_surfaces_have_none() -> None:
    rough = world(ball(wf.Dielectric(1.5, roughness=0.4)), ball(wf.Mirror(1), (0, 2, 0), 0.3, emission=1.0))
    assert Tracer.of(rough).scene.specular_surfaces is None
    assert Tracer.of(world(ball(), lights=[])).scene.specular_surfaces is None
    assert Tracer.of(world(ball()), caustics=False).scene.specular_surfaces is None


# --- Connections to the camera --------------------------------------------------------------------

CENTER = np.array([0.5, -0.3, 0.2])
CAMERAS = {
    "perspective": wf.Camera.look_at(*VIEW, fov=50, size=(24, 16), shift=(0.2, -0.1)),
    "lens": wf.Camera.look_at(*VIEW, fov=50, size=(24, 16), shift=(0.1, 0.2), aperture=0.8, focus=2.5),
    "distortion": calibrated(),
    "lens with distortion": calibrated(aperture=0.7, focus=2.0),
    "orthographic": wf.Camera.orthographic(*VIEW, height=2, size=(24, 16)),
    "panorama": wf.Camera.panorama(*VIEW, size=(24, 16)),
    "fisheye": wf.Camera.look_at(*VIEW, size=(24, 16)).replace(
        projection=wf.Fisheye(150, distortion=(-0.02, 0.003, 0, 0), skew=0.02)
    ),
    "fisheye with a lens": wf.Camera.look_at(*VIEW, size=(24, 16)).replace(
        projection=wf.Fisheye(110, mapping="equisolid", aperture=0.4, focus=2.0)
    ),
    "crop": wf.Camera.look_at(*VIEW, size=(24, 16), crop=(3, 2, 20, 10)),
}
FISHEYES = "fisheye", "fisheye with a lens"
cameras = pytest.mark.parametrize("camera", CAMERAS.values(), ids=list(CAMERAS))


def some_rays(camera: wf.Camera, n: int = 4000):
    """Return film points, the numbers of lens points, and the camera's rays through them."""
    rng = np.random.default_rng(3)
    margin = 0.02  # of a panorama's height: at its poles one point is seen in all columns
    x = (rng.random(n) * camera.resolution[0]).astype(f4)
    y = (rng.uniform(margin, 1 - margin, n) * camera.resolution[1]).astype(f4)
    lens = rng.random((2, n)).astype(f4) if camera.uses_lens else None
    return x, y, lens, *camera.rays(x, y, CENTER, lens), rng.uniform(0.5, 6, n).astype(f4)


@cameras
def test_connections_invert_the_rays_of_the_camera(camera: wf.Camera) -> None:
    x, y, lens, origin, direction, t = some_rays(camera)
    eye, film, _ = camera.connections(origin + direction * t, CENTER, lens)
    np.testing.assert_allclose(eye, origin, atol=2e-6)
    np.testing.assert_allclose(film, [x, y], atol=5e-4)


@cameras
def test_importance_is_how_densely_rays_meet_a_plane(camera: wf.Camera) -> None:
    """By differences of rays through neighboring film points that share the point on the lens."""
    x, y, lens, origin, direction, t = some_rays(camera)
    point, step = origin + direction * t, f4(1 / 64)
    _, _, importance = camera.connections(point, CENTER, lens)

    def met(x, y):
        start, along = (each.astype(float) for each in camera.rays(x, y, CENTER, lens))
        return start + along * (((point - start) * direction).sum(0) / (along * direction).sum(0))

    right, down = met(x + step, y) - met(x - step, y), met(x, y + step) - met(x, y - step)
    area = np.abs((np.cross(right, down, axis=0) * direction).sum(0)) / (4 * step**2)
    np.testing.assert_allclose(importance * area, 1, rtol=5e-3)


@pytest.mark.parametrize("name", [name for name in CAMERAS if name not in ("panorama", *FISHEYES)])
def test_cameras_do_not_see_behind_themselves(name: str) -> None:
    camera = CAMERAS[name]
    _, _, lens, origin, direction, t = some_rays(camera)
    _, film, _ = camera.connections(origin - direction * t, CENTER, lens)
    assert np.isnan(film).any(0).all()


# --- The rest -------------------------------------------------------------------------------------


def test_paths_do_not_depend_on_the_division_into_calls() -> None:
    traced = Tracer.of(
        world(icosphere(1, smooth=True), sheet(wf.Material(WHITE, alpha=0.5), 0.1), camera=CAMERAS["lens"])
    )
    pixel, sample = traced.lanes(0, 8)
    sampler = traced.sampler(1)

    def splats(lanes: np.ndarray) -> np.ndarray:
        found = trace_light(traced.scene, traced.camera, sampler, pixel[lanes], sample[lanes], 7)
        return np.concatenate([lanes[found.path][None], found.pixel[None], found.radiance]).astype(float)

    def in_order(columns: np.ndarray) -> np.ndarray:
        return columns[:, np.lexsort(columns)]

    lanes = np.random.default_rng(0).permutation(pixel.size)
    whole = splats(np.arange(pixel.size))
    assert whole.shape[1] > 1000
    divided = np.concatenate([splats(part) for part in np.array_split(lanes, 7)], 1)
    np.testing.assert_array_equal(in_order(whole), in_order(divided))


@pytest.mark.parametrize("background", [None, np.full((3, 1), 0.2, f4)], ids=["sky", "gray"])
def test_sky_light_stays_as_it_is(background) -> None:
    """Light without a place is found by paths from the camera, with the same bits."""
    ground = wf.Rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4), material=WHITE)
    scene = wf.Scene([ball(), wall(wf.Mirror(0.9)), ground], [wf.Environment(NOISE)], CAMERA)
    assert Tracer.of(scene).scene.specular_surfaces is None  # no light tracing without another light
    hidden = [box((-1, 3, -1), (1, 4, 1), WHITE), wf.Sphere((0, 3.5, 0), 0.2, emission=1.0)]
    scene = wf.Scene([*scene.shapes, *hidden], scene.lights, CAMERA)
    split, plain = (Tracer.of(scene, caustics) for caustics in (True, False))
    if background is not None:
        for tracer in (split, plain):
            tracer.scene.program = Program([*tracer.scene.program.features, Background(background)])
    assert split.scene.specular_surfaces is not None
    np.testing.assert_array_equal(split.eye(1, 8, 7), plain.eye(1, 8, 7))
    assert not len(split.splats(1, 8, 7))


@pytest.mark.parametrize("max_bounces", [0, 1])
def test_caustics_need_two_bounces(max_bounces: int) -> None:
    split, plain = (Tracer.of(world(ball()), caustics) for caustics in (True, False))
    assert not len(split.splats(1, 8, max_bounces))
    np.testing.assert_array_equal(split.eye(1, 8, max_bounces), plain.eye(1, 8, max_bounces))


def test_specular_surfaces_in_the_dark() -> None:
    traced = Tracer.of(world(ball(), box((-1, 0.01, -1), (1, 1.8, 1), WHITE)))
    assert not len(traced.splats(1, 8, 7))


def test_shadow_catchers_show_no_caustics() -> None:
    floor = wf.Rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4), material=WHITE)
    placed_floor = wf.Instance(floor, np.eye(4), material=wf.ShadowCatcher())
    again = wf.Instance(floor, placed(1, 0, -3, 0), material=wf.ShadowCatcher())
    scene = wf.Scene([placed_floor, again, sheet(), PANEL], [], CAMERA)
    traced = Tracer.of(scene)
    assert traced.scene.instances is not None
    assert not len(traced.splats(1, 8, 7))
