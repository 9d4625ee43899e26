"""The densities of all lights, by differentiation at any u: from any point, by any size."""

import luminaires
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from inside import (
    ConstantEnvironment,
    EnvironmentSum,
    LightRecord,
    LightTable,
    PointLightRecord,
    Receiver,
    RectangleLights,
    SphereLights,
    TexturedSphereLights,
    TexturedTriangleLights,
    TriangleLights,
    TwoSidedRectangleLights,
    TwoSidedTexturedTriangleLights,
    TwoSidedTriangleLights,
)
from jacobians import (
    assert_density,
    columns,
    doubles,
    few,
    places,
    points_of_the_square,
    some,
    surfaces,
)

import wavefront as wf

f4 = np.float32
sizes = st.floats(0.125, 2, width=32)
RADIANCE = f4([[1], [2], [3]])
TURNED, _ = np.linalg.qr([[3.0, 1, 2], [-1, 4, 1], [1, -2, 5]])  # an orthogonal matrix of no symmetry


@st.composite
def triangles(draw, kind=TriangleLights):
    """One triangle, not a sliver."""
    corners = np.array([[draw(places) for _ in range(3)]])
    a, b = corners[0, 1] - corners[0, 0], corners[0, 2] - corners[0, 0]
    area = np.linalg.norm(np.cross(a, b))
    assume(area > 0.1 * max(a @ a, b @ b, 0.05))
    return kind.from_triangles(corners, RADIANCE)


@st.composite
def textured_triangles(draw, kind=TexturedTriangleLights):
    flat = draw(triangles())
    fields = flat.corner, flat.edge_u, flat.edge_v, flat.normal, flat.area, flat.radiance
    return kind(*fields, prim=np.array([3]), source=np.array([-1]), emissions=())


@st.composite
def rectangles(draw, kind=RectangleLights):
    """One rectangle in any orientation."""
    turn, corner, a, b = draw(st.floats(0, 6.2)), draw(places), draw(sizes), draw(sizes)
    axes = np.array([[np.cos(turn), np.sin(turn), 0], [-0.6 * np.sin(turn), 0.6 * np.cos(turn), 0.8]])
    u, v = a * axes[0], b * axes[1]
    first = np.array([corner, corner + u, corner + u + v])
    return kind.from_pairs(first[None], RADIANCE)


@st.composite
def spheres(draw):
    center, radius = draw(places), draw(sizes)
    return SphereLights(columns(*center).astype(f4), f4([radius]), RADIANCE)


@st.composite
def textured_spheres(draw):
    even = draw(spheres())
    fields = even.center, even.radius, even.radiance
    return TexturedSphereLights(*fields, prim=np.array([3]), source=np.array([-1]), emissions=())


suns = st.builds(
    lambda x, y, z, angle: wf.DirectionalLight((x, y, z), 2, angle=angle).record(np.zeros(3)),
    *[st.floats(0.1, 1)] * 3,
    st.floats(0.1, 120),
)


@st.composite
def images(draw):
    """A small image, turned, and what is left of it for light samples."""
    pixels = draw(
        arrays(float, (draw(st.integers(1, 5)), draw(st.integers(1, 6))), elements=st.floats(0.01, 1))
    )
    turn = draw(st.floats(0, 6.2))
    rotation = [[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]]
    filter = draw(st.sampled_from(["nearest", "bilinear"]))
    rows = "poles" if len(pixels) > 1 and draw(st.booleans()) else "centers"
    light = wf.Environment(np.repeat(pixels[..., None], 3, 2), transform=rotation, filter=filter, rows=rows)
    record = light.record(np.zeros(3))
    return record.compensated() if draw(st.booleans()) else record


@st.composite
def skies(draw):
    """A sky of the CIE, turned, and what is left of it for light samples."""
    type, up = draw(st.integers(1, 16)), draw(st.sampled_from(["x", "y", "z"]))
    sun = np.eye(3)["xyz".index(up)] + [draw(st.floats(-0.5, 0.5)) for _ in range(3)]
    record = wf.Sky.cie(type, sun, up, horizontal=(1, 2, 3)).record(np.zeros(3))
    left = record.compensated()
    return left if left.table.share and draw(st.booleans()) else record


def lit(light: LightRecord, receiver: Receiver | None) -> LightRecord:
    return light if receiver is None else light.lighting(receiver)


# Whether the direction of a sample is all that its density depends on, and with what tolerance
KINDS = {
    "triangle": (triangles(), 1e-4),
    "two-sided triangle": (triangles(TwoSidedTriangleLights), 1e-4),
    "textured triangle": (textured_triangles(), 1e-4),
    "two-sided textured triangle": (textured_triangles(TwoSidedTexturedTriangleLights), 1e-4),
    "rectangle": (rectangles(), 2e-3),  # a part of it is computed in float32
    "two-sided rectangle": (rectangles(TwoSidedRectangleLights), 2e-3),
    "sphere": (spheres(), 1e-4),
    "textured sphere": (textured_spheres(), 1e-4),
    "sun": (suns, 1e-4),
    "image": (images(), 1e-4),
    "sky": (skies(), 1e-4),
    "constant": (st.just(ConstantEnvironment(RADIANCE)), 1e-4),
}
kinds = pytest.mark.parametrize("kind", KINDS)


def test_every_light_is_here() -> None:
    checked = {
        *("TriangleLights", "TwoSidedTriangleLights", "TexturedTriangleLights", "RectangleLights"),
        *("TwoSidedTexturedTriangleLights", "TwoSidedRectangleLights", "SphereLights", "SunLight"),
        *("TexturedSphereLights", "ImageEnvironment", "ConstantEnvironment", "EnvironmentSum", "SkyLight"),
        "PatchedEnvironment",
        "OctahedralEnvironment",  # in tests/lights/test_octahedral.py
        *("MovingLights", "DeformingLights"),  # in tests/motion/test_moving_lights.py
        "TurningLight",  # in tests/motion/test_turning_skies.py
        "GlowLights",  # points in a volume, in tests/lights/test_glow.py
        *("DirectionalLights", "PointLightRecord", "SpotLights", "PicturedLights", "IESLights"),
    }
    bases = {"LightRecord", "InfiniteLight", "DeltaLight", "PlanarLights"}
    found = {kind.__name__ for kind in _subclasses(LightRecord) if kind.__module__.startswith("wavefront.")}
    assert found == checked | bases


def _subclasses(kind: type) -> set[type]:
    return {kind}.union(*(_subclasses(each) for each in kind.__subclasses__()))


@kinds
@some
@given(data=st.data(), surface=surfaces, place=places, u=points_of_the_square)
def test_density_of_directions(
    kind: str, data: st.DataObject, surface: Receiver | None, place, u: tuple[float, float]
) -> None:
    strategy, rounding = KINDS[kind]
    light = lit(data.draw(strategy), surface)
    point = columns(*place)

    def direction(v):
        return light.sample_li(np.repeat(point, v.shape[1], 1), v).wi

    with doubles():
        sample = light.sample_li(point, columns(*u))
        assume(sample.pdf[0] > 0)
        assume(sample.pdf[0] < 1e4)
        assume(sample.cos_light[0] > 0.02)  # grazing: area_pdf subtracts a guard, rounding is amplified
        # at an edge of a table's cells the density jumps, by less than a kink that differences see
        steps = 2e-4 * np.minimum(columns(*u), 1 - columns(*u)) * np.array([[1, -1, 0, 0], [0, 0, 1, -1]])
        beside = light.sample_li(np.repeat(point, 4, 1), columns(*u) + steps).pdf / sample.pdf[0]
        assume((np.abs(beside.reshape(2, 2).mean(1) - 1) < rounding / 2).all())
        assert_density(direction, u, sample.pdf[0], rounding)
        # the density at a direction is the one that the sample has, but for edges, which rounding moves
        assume(0.01 < min(u) < max(u) < 0.99)
        assert light.pdf_li(point, sample.wi)[0] == pytest.approx(sample.pdf[0], rel=1e-3)


@kinds
@some
@given(data=st.data(), surface=surfaces, place=places, u=points_of_the_square)
def test_samples_have_their_density(
    kind: str, data: st.DataObject, surface: Receiver | None, place, u: tuple[float, float]
) -> None:
    """In float32, as in a render: the density, and the radiance, that a ray along the sample finds."""
    light = lit(data.draw(KINDS[kind][0]), surface)
    point = columns(*place).astype(f4)
    sample = light.sample_li(point, columns(*u).astype(f4))
    assume(0 < sample.pdf[0] < 1e4)
    assume(sample.cos_light[0] > 0.05)
    assert sample.wi.dtype == sample.pdf.dtype == f4
    assert np.linalg.norm(sample.wi.astype(float)) == pytest.approx(1, abs=2e-6)
    assume(0.01 < min(u) < max(u) < 0.99)
    assert light.pdf_li(point, sample.wi)[0] == pytest.approx(sample.pdf[0], rel=5e-3)
    np.testing.assert_allclose(light.le(sample.wi), sample.radiance, rtol=1e-3)


@pytest.mark.parametrize(
    "kind", ["triangle", "two-sided rectangle", "sphere", "image", "sky", "sun", "constant"]
)
@few
@given(data=st.data(), surface=surfaces, place=places, height=st.floats(0.2, 1))
def test_densities_integrate_to_one(
    kind: str, data: st.DataObject, surface: Receiver | None, place, height: float
) -> None:
    """The midpoint rule over the sphere; edges of a light cross cells, of which the wrong half is counted."""
    light = lit(data.draw(KINDS[kind][0]), surface)
    point = columns(*place).astype(f4)
    if isinstance(light, TriangleLights | RectangleLights):  # before its front
        middle = light.corner + (light.edge_u + light.edge_v) / light.middle
        point = (middle + light.normal * np.sqrt(light.area) * height).astype(f4)
    probe = light.sample_li(np.repeat(point, 64, 1), np.random.default_rng(0).random((2, 64), f4))
    assume((probe.pdf > 0).all())
    assume((probe.pdf < 10).all())  # it covers enough of the sphere for the cells
    rows, columns_ = 300, 600
    z = (np.arange(rows) + 0.5) / rows * 2 - 1
    z, phi = np.meshgrid(z, 2 * np.pi * (np.arange(columns_) + 0.5) / columns_)
    r = np.sqrt(1 - z * z)
    w = np.stack([r * np.cos(phi), r * np.sin(phi), z]).reshape(3, -1)
    w = (TURNED @ w).astype(f4)  # edges of lights on the axes run across the rows, not along one
    density = light.pdf_li(np.repeat(point, w.shape[1], 1), w)
    assert 4 * np.pi * density.mean(dtype=float) == pytest.approx(1, abs=0.04)


@some
@given(first=images(), second=suns, surface=surfaces, share=st.floats(0.1, 5), u=points_of_the_square)
def test_sums_of_lights_at_infinity(first, second, surface, share: float, u: tuple[float, float]) -> None:
    """The mixture of the parts' densities, by their power; the density and radiance at the sample."""
    parts = [first, second, ConstantEnvironment(RADIANCE * f4(share))]
    whole, point = lit(EnvironmentSum.of(parts), surface), np.zeros((3, 1), f4)
    sample = whole.sample_li(point, columns(*u).astype(f4))
    power = np.array([part.power(1.0)[0] for part in parts])
    each = [float(lit(part, surface).pdf_li(point, sample.wi)[0]) for part in parts]
    due = sum(power / power.sum() * each)
    assert sample.pdf[0] == pytest.approx(due, rel=1e-4)
    assert whole.pdf_li(point, sample.wi)[0] == sample.pdf[0]
    np.testing.assert_allclose(sample.radiance, sum(part.le(sample.wi) for part in parts), rtol=1e-5)


@some
@given(
    first=triangles(),
    second=spheres(),
    surface=surfaces,
    place=places,
    choice=st.floats(0.01, 0.99),
    u=points_of_the_square,
)
def test_tables_of_lights(first, second, surface, place, choice: float, u: tuple[float, float]) -> None:
    parts = [first, second, PointLightRecord(f4([[1], [2], [1]]), RADIANCE)]
    table, point = LightTable(parts, 2.0, "power"), columns(*place).astype(f4)
    sample, light = table.sample_li(point, f4([choice]), columns(*u).astype(f4), surface)
    power = np.concatenate([part.power(2 * 3**0.5) for part in parts])
    chance = (power / power.sum())[light[0]]
    own = lit(parts[light[0]], surface).sample_li(point, columns(*u).astype(f4))
    assert sample.pdf[0] == pytest.approx(chance * own.pdf[0], rel=1e-4)
    assert table.pmf(light, point, surface)[0] == pytest.approx(chance, rel=1e-4)
    assume(light[0] != 2)
    assume(0 < own.pdf[0] < 1e4)
    assume(own.cos_light[0] > 0.05)
    assert table.pdf_li(light, point, sample.wi, surface)[0] == pytest.approx(sample.pdf[0], rel=5e-3)


@pytest.fixture(scope="module")
def ies_file(tmp_path_factory):
    return luminaires.write(tmp_path_factory.mktemp("luminaires"))


@some
@given(place=places, toward=places, u=points_of_the_square)
def test_lights_that_no_ray_meets(ies_file, place, toward, u: tuple[float, float]) -> None:
    """One direction with the density 1, whatever u; no direction has a density."""
    assume(np.linalg.norm(toward) > 0.1)
    assume(np.linalg.norm(np.subtract(place, (3, 3, 3))) > 0.1)
    point = columns(*place).astype(f4)
    some = [
        wf.PointLight((3, 3, 3), 2),
        wf.SpotLight((3, 3, 3), 2, target=(0, 0, 0), angle=120),
        wf.Projector((3, 3, 3), np.ones((2, 3, 3)), target=(0, 0, 0), fov=90),
        wf.DirectionalLight(toward, 2),
        wf.IESLight(ies_file, (3, 3, 3), target=toward),
    ]
    for light in some:
        record = light.record(np.zeros(3))
        sample, other = (record.sample_li(point, columns(*v).astype(f4)) for v in (u, u[::-1]))
        assert sample.pdf[0] in (
            (0, 1) if isinstance(light, wf.SpotLight | wf.Projector | wf.IESLight) else (1,)
        )
        assert (sample.wi == other.wi).all()
        assert not record.pdf_li(point, sample.wi).any()
        assert not record.le(sample.wi).any()
