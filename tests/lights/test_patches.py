"""The patches of the sky, and the environment whose light counts for them."""

import numpy as np
import pytest
from inside import PatchedEnvironment, SkyPatches

import wavefront as wf
from wavefront import testing

AXES = np.array([[0, 1, 0], [1, 0, 0], [0, 0, 1]], float).T  # y north, x east, z up


def toward(azimuth: float, height: float) -> np.ndarray:
    a, h = np.radians([azimuth, height])
    return np.array([[np.sin(a) * np.cos(h), np.cos(a) * np.cos(h), np.sin(h)]], np.float32).T


@pytest.mark.parametrize(("subdivision", "count"), [(1, 145), (2, 577), (4, 2305), (6, 5185)])
def test_patches_divide_the_sky(subdivision: int, count: int) -> None:
    """Reinhart's numbers; solid angles add up to the sphere, projected ones to π, rows are of one height."""
    patches = SkyPatches.of(subdivision, AXES)
    assert len(patches) == count + 1
    assert patches.solid_angles.sum() == pytest.approx(4 * np.pi)
    assert patches.projected.sum() == pytest.approx(np.pi)
    heights = np.degrees(np.arcsin(patches.sines))
    assert np.diff(heights)[:-1] == pytest.approx(90 / (7 * subdivision + 0.5))
    assert 90 - heights[-2] == pytest.approx(45 / (7 * subdivision + 0.5))


@pytest.mark.parametrize("subdivision", [1, 2, 3])
def test_directions_lie_in_their_patches(subdivision: int) -> None:
    patches = SkyPatches.of(subdivision, AXES)
    directions = patches.directions(27 if subdivision == 1 else 5)  # 27: to 2 % of a patch from its borders
    np.testing.assert_allclose((directions**2).sum(0), 1)
    number = patches.number(directions.reshape(3, -1).astype(np.float32)).reshape(directions.shape[1:])
    assert (number == np.arange(1, len(patches))[:, None]).all()
    assert (patches.number(-directions[:, :, 0].astype(np.float32)) == 0).all()
    cosine = directions[2].mean(1) * patches.solid_angles[1:]
    assert cosine == pytest.approx(patches.projected)
    assert patches.weights(5).sum(1) == pytest.approx(1)


# Azimuth from the north to the east, height; patches in which gendaymtx of pyradiance 1.3.1 has the
# sun, with -m 1, 2, 4
RADIANCE = {
    (-99.2, 8.86): (23, 104, 328),
    (-92.66, 33.51): (79, 325, 1224),
    (-104.99, 44.54): (102, 419, 1605),
    (126.71, 36.32): (93, 306, 1283),
    (-152.66, 39.28): (99, 365, 1400),
}


@pytest.mark.parametrize("place", RADIANCE)
def test_patches_are_numbered_as_in_radiance(place: tuple[float, float]) -> None:
    found = [int(SkyPatches.of(n, AXES).number(toward(*place))[0]) for n in (1, 2, 4)]
    assert tuple(found) == RADIANCE[place]


def test_known_patches() -> None:
    patches = SkyPatches.of(1, AXES)
    places = [(0, 6), (6.1, 6), (-5.9, 6), (90, 0.1), (0, 18), (0, 89), (200, -1)]
    found = [int(patches.number(toward(*place))[0]) for place in places]
    assert found == [1, 2, 1, 1 + 8, 31, 145, 0]


def sky() -> PatchedEnvironment:
    return PatchedEnvironment(np.ones((3, 1), np.float32), patches=SkyPatches.of(1, AXES))


def test_contract() -> None:
    testing.check_light(sky(), samples=5_000, points=[[2, 1, 3]])


def room(*lights: wf.Light) -> wf.Scene:
    """Mirrors, matte surfaces, and a lamp of its own group."""
    lamp = wf.Rectangle((-1, -1, 3), (0, 0.5, 0), (0.5, 0, 0), emission=3)
    shapes = [
        wf.Disk((0, 0, 0), (0, 0, 1), 5, material=wf.Diffuse((0.3, 0.5, 0.7))),
        wf.Sphere((1.5, 0, 1), 0.8, material=wf.Mirror(0.9)),
        wf.Sphere((-1, 1.5, 1), 0.6, material=wf.Dielectric(1.5)),
        lamp,
    ]
    return wf.Scene(shapes, lights)


@pytest.mark.parametrize("integrator", ["naive", "direct_simple", "full"])
@pytest.mark.parametrize("kind", ["irradiance", "radiance"])
def test_groups_add_up_to_all_light(integrator: str, kind: str) -> None:
    found = wf.measure(
        room(sky()),
        *([(0, 0, 1), (1, 2, 0.5)], (0, 0.6, 0.8)),
        kind=kind,
        spp=32,
        aovs="light_groups",
        integrator=integrator,
        progress=False,
    )
    parts = {name: found.part(name)[0].astype(float) for name in found.image.errors}
    assert len(parts) == 147
    np.testing.assert_allclose(sum(parts.values()), found.value, rtol=1e-5)
    assert any((parts[f"light_groups.patch {k}"] > 0).any() for k in range(1, 146))


def test_other_lights_keep_their_groups() -> None:
    points = [(0, 0, 1), (1, 2, 0.5)], (0, 0.6, 0.8)
    found = wf.measure(room(sky()), *points, spp=64, aovs="light_groups", progress=False)
    alone = wf.measure(room(), *points, spp=64, progress=False)
    value, error = found.part("light_groups.default")
    assert (np.abs(value - alone.value) <= 6 * np.hypot(error, alone.standard_error)).all()
    assert (alone.value > 0).all()


def test_each_patch_brings_its_projected_solid_angle() -> None:
    """To a level plane under the free sky, with the errors that are stated: χ²."""
    scene = wf.Scene([wf.Sphere((0, 0, -9), 1)], [sky()])
    found = wf.measure(scene, [(0, 0, 0)], (0, 0, 1), spp=8192, aovs="light_groups", progress=False)
    names = [f"light_groups.patch {k}" for k in range(1, 146)]
    value, error = (np.array([found.part(name)[k][0, 0] for name in names]) for k in (0, 1))
    z = (value - SkyPatches.of(1, AXES).projected) / error
    assert np.abs(z).max() < 5
    assert (z * z).mean() < 1.5  # samples are stratified, so errors are no larger than stated


@pytest.mark.parametrize("given", [{"wave_size": 100}, {"workers": 2}])
def test_the_same_bits_whatever_the_waves(given: dict) -> None:
    def parts(**settings) -> list[np.ndarray]:
        found = wf.measure(
            room(sky()),
            *([(0, 0, 1), (1, 2, 0.5), (2, 2, 2)], (0, 0, 1)),
            spp=16,
            aovs="light_groups",
            progress=False,
            **settings,
        )
        return [found.part(name)[0] for name in found.image.errors]

    for one, other in zip(parts(workers=1), parts(**given), strict=True):
        assert one.tobytes() == other.tobytes()
