"""Light samples of every kind of light, given the surface that is lit."""

import pkgutil
from collections.abc import Callable
from importlib import import_module
from inspect import isabstract

import luminaires
import numpy as np
import pytest
from inside import (
    ConstantEnvironment,
    DeformingLights,
    DirectionalLights,
    EnvironmentSum,
    GlowLights,
    IESLights,
    ImageEnvironment,
    LightRecord,
    MovingLights,
    OctahedralEnvironment,
    PatchedEnvironment,
    Photometry,
    PicturedLights,
    PointLightRecord,
    RectangleLights,
    SkyLight,
    SkyPatches,
    SphereLights,
    SpotLights,
    SunLight,
    TexturedSphereLights,
    TexturedTriangleLights,
    TriangleLights,
    TurningLight,
    TwoSidedRectangleLights,
    TwoSidedTexturedTriangleLights,
    TwoSidedTriangleLights,
    Web,
    f4,
)
from significance import render
from test_panels import NORMALS, WHITE, receiver, rectangle, sphere, triangle

import wavefront as wf
from wavefront import lights, testing

ORIGIN = np.zeros(3)


def recorded(light: wf.Light) -> LightRecord:
    return light.record(ORIGIN)


def turned_over(kind: type[LightRecord], even: RectangleLights | TriangleLights, **more) -> LightRecord:
    """A light in the place of another one, whose front it has at its back."""
    edges = even.edge_v, even.edge_u, -even.normal
    return kind(even.corner, *edges, even.area, even.radiance, **more)


def textured() -> dict:
    """The fields of a light whose emission is a texture; its mean is 1."""
    return {"prim": np.array([3]), "source": np.array([0]), "emissions": (WHITE,)}


def image() -> LightRecord:
    return recorded(wf.Environment(np.random.default_rng(5).random((5, 8, 3)) ** 3)).compensated()


class Texels(OctahedralEnvironment):
    """As the rays meet it that light samples could replace."""

    def le(self, wi: np.ndarray, surface: object = None) -> np.ndarray:
        return self.le_of_texels(wi, np.zeros(wi.shape[1], f4))


def texels() -> LightRecord:
    light = recorded(wf.studio()[0]).compensated()
    return Texels(light.image, light.means, light.product, light.share)


def sun() -> LightRecord:
    return recorded(wf.DirectionalLight((-0.3, -1, -0.2), 2, angle=50))


def sky() -> LightRecord:
    return recorded(wf.Sky.cie(15, (1, 0.8, 0.3))).compensated()


def luminaire() -> IESLights:
    planes = np.array([0, 90, 210, 240, 330, 360.0])
    candela = luminaires.intensity("none", planes[:, None], luminaires.GAMMA)
    axes = f4([[0], [-1], [0]]), f4([[1], [0], [0]]), f4([[0], [0], [-1]])
    return IESLights(f4([[0], [2], [0]]), *axes, WHITE, Web(Photometry(planes, luminaires.GAMMA, candela)))


LIGHTS: dict[type[LightRecord], Callable[[], LightRecord]] = {
    RectangleLights: rectangle,
    TwoSidedRectangleLights: lambda: turned_over(TwoSidedRectangleLights, rectangle()),
    TriangleLights: triangle,
    TwoSidedTriangleLights: lambda: turned_over(TwoSidedTriangleLights, triangle()),
    TexturedTriangleLights: lambda: TexturedTriangleLights(
        *(getattr(triangle(), name) for name in ("corner", "edge_u", "edge_v", "normal", "area", "radiance")),
        **textured(),
    ),
    TwoSidedTexturedTriangleLights: lambda: turned_over(
        TwoSidedTexturedTriangleLights, triangle(), **textured()
    ),
    SphereLights: sphere,
    TexturedSphereLights: lambda: TexturedSphereLights(
        sphere().center, sphere().radius, sphere().radiance, **textured()
    ),
    ImageEnvironment: image,
    OctahedralEnvironment: texels,
    SkyLight: sky,
    SunLight: sun,
    ConstantEnvironment: lambda: recorded(wf.Environment(1)),
    PatchedEnvironment: lambda: PatchedEnvironment(WHITE, patches=SkyPatches.of(1, np.eye(3))),
    EnvironmentSum: lambda: EnvironmentSum.of([image(), sun()]),
    DirectionalLights: lambda: recorded(wf.DirectionalLight((0, -1, 0), 2)),
    PointLightRecord: lambda: recorded(wf.PointLight((0, 2, 0), 2)),
    SpotLights: lambda: recorded(wf.SpotLight((0, 2, 0), 2, target=(0, 0, 0), angle=120)),
    PicturedLights: lambda: recorded(wf.Projector((0, 2, 0), np.ones((2, 3, 3)), target=(0.1, 0, 0), fov=90)),
    IESLights: luminaire,
}
kinds = pytest.mark.parametrize("kind", LIGHTS, ids=lambda kind: kind.__name__)


def test_every_light_is_here() -> None:
    """`GlowLights` are points in a volume, which no ray meets: their samples are in `test_glow.py`.

    Lights that move or turn are those that stand still at a time: tests/motion/test_moving_lights.py and
    test_turning_skies.py.
    """
    modules = [
        import_module(f"{lights.__name__}.{each.name}") for each in pkgutil.iter_modules(lights.__path__)
    ]
    found = {
        each
        for module in modules
        for each in vars(module).values()
        if isinstance(each, type) and issubclass(each, LightRecord) and not isabstract(each)
    }
    assert found == {*LIGHTS, GlowLights, MovingLights, DeformingLights, TurningLight}


@kinds
@pytest.mark.parametrize(
    ("normal", "opaque"), [*((each, True) for each in NORMALS[::-1]), ((0, 1, 0), False)]
)
@pytest.mark.parametrize(
    "point",
    [(0.2, 0, 0.1), (0.9, 0.97, -0.3), (3, -2, 1), (0.4, 0.5, 5)],
    ids=["below", "close", "far", "beside"],
)
@pytest.mark.first(len(LIGHTS))
def test_the_contract_holds_for_each_normal(
    kind: type[LightRecord], point: tuple[float, ...], normal: tuple[float, ...], opaque: bool
) -> None:
    """χ² of directions, and the densities and radiance that rays along them find."""
    light = LIGHTS[kind]().lighting(receiver(normal, opaque=opaque))
    testing.check_light(light, points=[point], samples=30_000)


@kinds
def test_what_has_no_normal_is_lit_alike(kind: type[LightRecord]) -> None:
    """Points in a volume, and surfaces that light crosses."""
    n = 200
    point = np.repeat(f4([[0.2], [0], [0.1]]), n, 1)
    u = np.random.default_rng(1).random((2, n), f4)
    lit = [LIGHTS[kind]().lighting(receiver(normal, n, opaque=False)) for normal in NORMALS[:2]]
    one, other = (light.sample_li(point, u) for light in lit)
    assert (one.wi == other.wi).all()
    assert (one.pdf == other.pdf).all()
    assert (lit[0].pdf_li(point, one.wi) == lit[1].pdf_li(point, one.wi)).all()


def test_points_in_a_volume_are_receivers_without_a_normal(calls_of) -> None:
    """They are not opaque, so their normal, which is only a frame for the phase function, has no effect."""
    calls = calls_of("wavefront.features.receivers.receiver_of")
    mist = wf.Material(wf.NullSurface(), interior=wf.Medium(0.1, 2.0))
    shapes = [
        wf.Sphere((0, 0.5, 0), 0.4, material=mist),
        wf.Rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4)),
        wf.Rectangle((-1, 3, -1), (2, 0, 0), (0, 0, 2), emission=3),
    ]
    render(wf.Scene(shapes, camera=wf.Camera.look_at((0, 1, 3), (0, 0.5, 0), size=(16, 16))), 2)
    in_volume, on_surface = [], []
    for call in calls:
        inside = call.args[0].prim < 0
        in_volume.append(call.result.opaque[inside])
        on_surface.append(call.result.opaque[~inside])
    assert np.concatenate(in_volume).size > 50
    assert not np.concatenate(in_volume).any()
    assert np.concatenate(on_surface).all()
