"""The analytical cases of CIE 171:2006, 5.2 to 5.14: scenes, exact values, and what is printed.

Lengths are meters, z is up, and the room is x 0…4, y 0…4, z 0…3, the window in the wall y = 0.
Values of daylight are % of the illuminance of a level plane under the free sky.

Sources: J. J. Thompson's restatement of the report (github.com/jjathompson4/CyclesCIEtest), and the
closed forms below. How the masks of 5.13 and 5.14 shine, and the glass of 5.10 and 5.12, are not told
there: they were found from the printed values, of which they explain all but misprints.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import scenes
from scipy import stats
from sky_values import dome, standard

import wavefront as wf

Doubles = np.ndarray
BLACK = wf.Diffuse(0)
QUIET: dict[str, Any] = {"progress": False, "workers": 1}
TYPES = tuple(range(1, 17))
WALL = [(2, 0, z) for z in np.arange(2.75, 0, -0.5)]  # A to F, on the wall y = 0
FLOOR = [(2, y, 0) for y in np.arange(0.25, 4, 0.5)]  # G to N
INDOORS = np.array(WALL + FLOOR, float), np.repeat([(0, 1, 0), (0, 0, 1)], (6, 8), 0).astype(float)
IOR, THICK, ABSORPTION = 1.52, 0.006, 0.0412  # of a pane of glass; absorption is that over its thickness


@dataclass
class Found:
    """What was measured at the points of a case, and what is due."""

    value: Doubles
    error: Doubles  # standard error
    freedom: int  # of Student's t
    exact: Doubles
    published: Doubles | None = None
    wrong: Doubles | None = None  # what is known to be wrong in print

    @property
    def sigmas(self) -> Doubles:
        """Differences in standard errors, of which rounding does not count."""
        off = np.abs(self.value - self.exact)
        off = np.maximum(off - 2e-5 * np.abs(self.exact) - 1e-9, 0)
        return off / np.maximum(self.error, 1e-300) * np.sign(self.value - self.exact)

    @property
    def chance(self) -> float:
        """Probability of a difference as large as the largest one, by chance (Šidák)."""
        p = 2 * stats.t.sf(np.abs(self.sigmas).max(), self.freedom)
        return float(-np.expm1(self.sigmas.size * np.log1p(-min(p, 0.5))))

    @property
    def chance_of_all(self) -> float:
        """Probability of a mean of all differences, in standard errors, as large as theirs."""
        spread = np.sqrt(self.freedom / (self.freedom - 2) / np.count_nonzero(self.error))
        return float(2 * stats.norm.sf(abs(self.sigmas.sum() / np.count_nonzero(self.error)) / spread))


def measured(
    scene: wf.Scene, points: Any, normals: Any, spp: int, copies: int = 4, **settings: Any
) -> tuple[Doubles, Doubles, int]:
    """Return values and standard errors at points, each of some sensors, and the degrees of freedom.

    Sensors share no paths, so that all errors are independent.
    """
    points, normals = np.repeat(points, copies, 0), np.repeat(normals, copies, 0)
    found = wf.measure(
        scene, points, normals, spp=max(spp // copies, 8), reuse=False, **{**QUIET, **settings}
    )
    value, error = (
        each[:, 1].reshape(-1, copies).astype(float) for each in (found.value, found.standard_error)
    )
    freedom = copies * int(found.image.freedom().min())
    return value.mean(1), np.sqrt((error**2).sum(1)) / copies, freedom


def factor(corners: Any, point: Any, normal: Any) -> float:
    """Configuration factor of a polygon at a point whose normal is along an axis."""
    axis = int(np.argmax(np.abs(normal)))
    return scenes.polygon_irradiance(np.roll(np.asarray(corners, float) - point, 1 - axis, 1)) / np.pi


# --- 5.2 to 5.8 -----------------------------------------------------------------------------------------


def point_source(spp: int) -> Found:
    """5.2: a luminaire of 1000·cos γ cd, from its file, 3 m above a plane (table 11)."""
    angles = np.arange(0, 90.1, 0.5)
    text = f"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 {angles.size} 1 1 2 0 0 0\n1 1 1\n"
    rows = (angles, [0], 1000 * np.cos(np.radians(angles)))
    with TemporaryDirectory() as folder:
        file = Path(folder) / "cosine.ies"
        file.write_text(text + "\n".join(" ".join(f"{each:.6f}" for each in row) for row in rows))
        light = wf.IESLight(file, (0, 0, 3), direction=(0, 0, -1), c0=(1, 0, 0), efficacy=1)
    xy = [(0, 0), (0.5, 0), (1, 0), (1.5, 0), (0.5, 0.5), (1, 0.5), (1.5, 0.5), (1, 1), (1.5, 1), (1.5, 1.5)]
    points = np.array([(*each, 0) for each in xy])
    plane = wf.Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0), material=BLACK)
    exact = 1000 * 9 / ((points**2).sum(1) + 9) ** 2
    published = np.array([111.11, 105.21, 90.02, 71.11, 99.73, 85.64, 68.06, 74.36, 59.98, 49.39])
    up = np.tile((0.0, 0, 1), (10, 1))
    return Found(*measured(wf.Scene([plane], [light]), points, up, 64), exact, published)


def area_source(spp: int) -> Found:
    """5.3: a panel of 1 × 1 m and 1000 cd/m² in the ceiling (table 12)."""
    panel = wf.Rectangle((1.5, 1.5, 3), (0, 1, 0), (1, 0, 0), material=BLACK, emission=1000)
    corners = [(1.5, 1.5, 3), (2.5, 1.5, 3), (2.5, 2.5, 3), (1.5, 2.5, 3)]
    exact = [1000 * np.pi * factor(corners, *each) for each in zip(*INDOORS, strict=True)]
    half = [61.27, 79.18, 95.52, 105.89]
    published = [32.68, 75.09, 81.38, 69.12, 53.41, 39.90, *half, *half[::-1]]
    found = measured(wf.Scene([*walls("1x1"), panel]), *INDOORS, spp)
    return Found(*found, np.array(exact), np.array(published))


def lamp_flux(spp: int) -> Found:
    """5.4: a source of 10 000 lm in a black room: what arrives, % of what leaves."""
    light = wf.with_flux(wf.PointLight((1.1, 2.3, 1.7), 1), lumens=10_000, efficacy=1)
    return flux(wf.Scene(walls("closed"), [light]), spp, 10_000)


def daylight_flux(case: Daylight, type: int) -> Callable[[int], Found]:
    """5.4: daylight through an opening into a black room: what arrives, % of what enters."""

    def run(spp: int) -> Found:
        width, height = case.bounds[1] - case.bounds[0], case.bounds[3] - case.bounds[2]
        entering = 100.0 if case.roof else vertical(type, 1) + 15
        return flux(case.scene(type), spp, entering * width * height)

    return run


def flux(scene: wf.Scene, spp: int, power: float, copies: int = 4) -> Found:
    """Measure what arrives at all surfaces of a scene, % of a power."""
    found = wf.measure_flux(scene, list(scene.shapes) * copies, spp=spp // copies, **QUIET)
    value, error = found.value[:, 1].astype(float), found.standard_error[:, 1].astype(float)
    total = np.array([[value.sum()], [np.sqrt((error**2).sum())]]) * 100 / power / copies
    return Found(*total, int(found.image.freedom().min()) * copies, np.array([100.0]))


def transmittance(cos: Any, absorption: float = ABSORPTION, polarized: bool = True) -> Any:
    """Transmittance of a pane, reflections between its faces included (Fresnel; e.g. Hecht, Optics, §9.6).

    It is the mean of both polarizations. Renderers without polarization take the mean at each face.
    """
    inside = np.sqrt(1 - (1 - np.square(cos)) / IOR**2)
    s = ((cos - IOR * inside) / (cos + IOR * inside)) ** 2
    p = ((inside - IOR * cos) / (inside + IOR * cos)) ** 2
    once = np.exp(-absorption / inside)
    faces = (s, p) if polarized else ((s + p) / 2,)
    return sum((1 - face) ** 2 * once / (1 - (face * once) ** 2) for face in faces) / len(faces)


class Pane(wf.Bsdf):
    """Clear glass whose transmittance depends on the angle; what it reflects is left out."""

    specular = transmissive = True

    def f(self, wo: Any, wi: Any) -> Any:
        return np.zeros_like(wi)

    def pdf(self, wo: Any, wi: Any) -> Any:
        return np.zeros_like(wi[2])

    def sample_f(self, wo: Any, u: Any) -> wf.BsdfSample:
        weight = np.broadcast_to(transmittance(wo[2]).astype(np.float32), wo.shape)
        return wf.BsdfSample(-wo, weight, np.ones_like(wo[2]), np.ones(wo.shape[1], bool))


def glass(kind: str) -> Callable[[int], Found]:
    """5.5: light through a pane by the angle of incidence, 0° to 80°, %."""

    def run(spp: int) -> Found:
        materials = {
            "own": Pane(),
            "thin": wf.ThinDielectric(IOR),
            "slab": wf.Material(wf.Dielectric(IOR), interior=wf.Medium(absorption=ABSORPTION / THICK)),
        }
        flat = wf.Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))
        pane = wf.Box((0, 0, 0), (2, 2, THICK)) if kind == "slab" else flat
        pane.material = materials[kind]
        sky = wf.Sky.cie(5, horizontal=100 * np.pi, up="z", ground=0)
        angle = np.radians(np.arange(0, 81, 10))
        along = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], 1)
        found = measured(wf.Scene([pane], [sky]), -0.1 * along, along, spp, kind="radiance", max_bounces=64)
        absorption = 0 if kind == "thin" else ABSORPTION
        return Found(*found, 100 * transmittance(np.cos(angle), absorption, polarized=kind != "slab"))

    return run


def first_reflection(spp: int) -> Found:
    """5.6: light that a floor of reflectance 0.3, in parallel light, sends to wall and ceiling (table 17)."""
    points, normals = INDOORS[0].copy(), INDOORS[1].copy()
    points[:6] = points[5::-1]  # A is the lowest
    points[6:, 2], normals[6:] = 3, (0, 0, -1)
    shapes = [
        wf.Rectangle((0, 0, 0), (4, 0, 0), (0, 4, 0), material=wf.Diffuse(0.3)),
        wf.Rectangle((0, 0, 0.5), (0, 0, 2.5), (4, 0, 0), material=BLACK),
        wf.Rectangle((0, 0, 3), (4, 0, 0), (0, 4, 0), material=BLACK),
    ]
    light = wf.DirectionalLight((-4.5, 0, -3), 100 / 0.3 * np.hypot(4.5, 3) / 3)
    corners = [(0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0)]
    exact = [100 * factor(corners, *each) for each in zip(points, normals, strict=True)]
    half = [26.80, 30.94, 33.98, 35.57]
    published = [np.nan, 35.901, 27.992, 21.639, 16.716, 12.967, *half, *half[::-1]]
    found = measured(wf.Scene(shapes, [light]), points, normals, spp)
    return Found(*found, np.array(exact), np.array(published))


def obstructed(spp: int) -> Found:
    """5.7: a wall that shines evenly, behind a black box; all of table 19 is wrong, below its correction."""
    box = wf.Box((2, 2.6, 0.5), (4, 0.2, 1), material=BLACK)
    shining = wf.Rectangle((0, 4, 0), (4, 0, 0), (0, 0, 3), material=BLACK, emission=100 / np.pi)
    points, normals = INDOORS[0][:11], INDOORS[1][:11]
    exact = []
    for point, normal in zip(points, normals, strict=True):
        edge = 2.5 if point[2] < 1 else 2.7  # of the box
        low = point[2] + (1 - point[2]) * (4 - point[1]) / (edge - point[1])
        corners = [(0, 4, low), (4, 4, low), (4, 4, 3), (0, 4, 3)]
        exact.append(100 * factor(corners, point, normal) if low < 3 else 0.0)
    corrected = [16.07, 16.33, 15.40, 13.32, 10.32, 7.08, 3.38, 3.63, 3.01, 0, 0]
    return Found(
        *measured(wf.Scene([box, shining]), points, normals, spp), np.array(exact), np.array(corrected)
    )


def reflected(spp: int) -> Found:
    """5.8: mean indirect illuminance in a closed cube of 4 m with a source of 10 000 lm (table 20)."""
    albedos = np.array([0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95])
    published = np.array([5.48, 11.6, 26, 44.6, 69.4, 104, 156, 243, 417, 937, 1979])
    found = []
    for seed, albedo in enumerate(albedos):
        cube = wf.Box((0, 0, 0), 4, material=wf.Diffuse(albedo))
        light = wf.with_flux(wf.PointLight((0, 0, 0), 1), lumens=10_000, efficacy=1)
        each = wf.measure_flux(
            wf.Scene([cube], [light]),
            [cube] * 4,
            side="back",
            spp=spp // 4,
            max_bounces=512,
            aovs="indirect",
            seed=seed,
            **QUIET,
        )
        value, error = each.part("indirect")
        found.append((value[:, 1].mean(), np.sqrt((error[:, 1].astype(float) ** 2).sum()) / 4))
    value, error = np.array(found, float).T / 96
    return Found(value, error, 28, albedos * 10_000 / ((1 - albedos) * 96), published)


# --- Daylight: 5.9 to 5.14 ------------------------------------------------------------------------------

BOUNDS = {"1x1": (1.5, 2.5, 1.5, 2.5), "4x4": (0, 4, 0, 4), "2x1": (1, 3, 1, 2), "4x3": (0, 4, 0, 3)}


def frame(place: Callable[[float, float], Any], size: tuple[float, float], hole: Any) -> list[wf.Shape]:
    """Return four rectangles around a hole in one, or none where it is as large."""
    (u, v), (u0, u1, v0, v1) = size, hole
    parts = [(0, u, 0, v0), (0, u, v1, v), (0, u0, v0, v1), (u1, u, v0, v1)]
    shapes: list[wf.Shape] = []
    for a, b, c, d in parts:
        if b > a and d > c:
            corner, along, across = (np.array(place(*each), float) for each in ((a, c), (b, c), (a, d)))
            shapes.append(wf.Rectangle(corner, along - corner, across - corner, material=BLACK))
    return shapes


def walls(opening: str) -> list[wf.Shape]:
    """Return the inside of the black room, its fronts inward, with an opening."""
    none = (4, 4, 4, 4)
    hole = BOUNDS.get(opening, none)
    roof, facade = (hole if opening in each else none for each in (("1x1", "4x4"), ("2x1", "4x3")))
    return [
        wf.Rectangle((0, 0, 0), (4, 0, 0), (0, 4, 0), material=BLACK),
        wf.Rectangle((0, 4, 0), (4, 0, 0), (0, 0, 3), material=BLACK),
        wf.Rectangle((0, 0, 0), (0, 4, 0), (0, 0, 3), material=BLACK),
        wf.Rectangle((4, 0, 0), (0, 0, 3), (0, 4, 0), material=BLACK),
        *frame(lambda v, u: (u, v, 3), (4, 4), (*roof[2:], *roof[:2])),
        *frame(lambda v, u: (u, 0, v), (3, 4), (*facade[2:], *facade[:2])),
    ]


@cache
def scale(type: int) -> float:
    """What makes the relative luminance of a sky one whose level illuminance is 100."""
    directions, weight = dome(512, 1024)
    sun = np.array([0, np.sqrt(0.75), 0.5])
    return 100 / float((standard(type, sun, directions) * weight).sum())


@cache
def vertical(type: int, toward: int) -> float:
    """Illuminance of a vertical plane that faces the sun (1), or away from it (-1), under the sky."""
    (z, wz), (around, wa) = gauss(0, np.pi / 2, 32), gauss(-np.pi / 2, np.pi / 2, 32)
    z, around = z[:, None], around[None]
    directions = np.stack(
        np.broadcast_arrays(np.sin(z) * np.sin(around), np.cos(z), np.sin(z) * np.cos(around)), -1
    )
    relative = standard(type, np.array([0, np.sqrt(0.75), 0.5 * toward]), directions)
    return scale(type) * float((relative * np.sin(z) ** 2 * np.cos(around) * wz[:, None] * wa).sum())


def gauss(low: float, high: float, panels: int) -> tuple[Doubles, Doubles]:
    """Nodes and weights of Gauss's rule on each of some parts."""
    x, w = np.polynomial.legendre.leggauss(5)
    width = (high - low) / panels
    return (low + width * (np.arange(panels)[:, None] + (x + 1) / 2)).ravel(), np.tile(w * width / 2, panels)


def middles(low: float, high: float) -> tuple[Doubles, Doubles]:
    """Nodes and weights of the report's rule."""
    return low + (np.arange(20) + 0.5) * (high - low) / 20, np.full(20, (high - low) / 20)


@dataclass(frozen=True)
class Daylight:
    """A room under the standard skies, with the sun 60° high, whose own light does not count.

    The opening may have a pane, a canopy of some depth along the facade at z = 3 (5.13), or a wall of some
    height, 6 m before it (5.14).
    """

    opening: str
    glazed: bool = False
    canopy: float = 0
    wall: float = 0

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        return BOUNDS[self.opening]

    @property
    def roof(self) -> bool:
        return self.opening in ("1x1", "4x4")

    @property
    def sun(self) -> Doubles:
        return np.array([0, 0.5 if self.roof else -0.5, np.sqrt(0.75)])

    def points(self) -> tuple[Doubles, Doubles]:
        """Return points and normals in the order of the tables, the ceiling's last."""
        points, normals = INDOORS[0].copy(), INDOORS[1].copy()
        if self.roof:
            return points, normals
        points[:6, 1], normals[:6, 1] = 4, -1
        points[6:, 1] = 4 - points[6:, 1]
        if self.canopy or self.wall:
            return points[6:], normals[6:]
        ceiling = points[6:] + np.array((0, 0, 3))
        return np.concatenate([points, ceiling]), np.concatenate([normals, -normals[6:]])

    def shining(self, type: int) -> float:
        """Exitance of what is below the sky: the canopy, the wall, or the ground; % of the free sky's."""
        if self.canopy:
            return 5.0
        return 0.5 * (vertical(type, -1) + 10) if self.wall else 30.0

    def scene(self, type: int) -> wf.Scene:
        shapes, low = walls(self.opening), self.shining(type) / np.pi
        if self.glazed:  # wider than the opening, and close to it
            edge, gap = ((0, 8, 0), 3.0001) if self.roof else ((0, 0, 8), -0.0001)
            corner = (-2, -2, gap) if self.roof else (-2, gap, -2)
            shapes.append(wf.Rectangle(corner, (8, 0, 0), edge, material=Pane()))
        if self.canopy:
            edge = (0, -self.canopy, 0)
            shapes.append(wf.Rectangle((-100, 0, 3), (200, 0, 0), edge, material=BLACK, emission=low))
        if self.wall:
            edge = (0, 0, self.wall)
            shapes.append(wf.Rectangle((-100, -6, 0), edge, (200, 0, 0), material=BLACK, emission=low))
        ground = 0 if self.roof or self.canopy or self.wall else 0.3
        sky = wf.Sky.cie(type, self.sun, horizontal=100, direct_normal=0, ground=ground, up="z")
        return wf.Scene(shapes, [sky])

    def edge(self, point: Doubles) -> float:
        """Height in the facade at which a point sees the sky begin, or end."""
        if self.canopy:
            return 3 * point[1] / (point[1] + self.canopy)
        if self.wall:
            return self.wall * point[1] / (point[1] + 6)
        return float(point[2])

    def value(self, type: int, point: Doubles, normal: Doubles, printed: bool = False) -> float:
        """Illuminance at a point: the integral over the opening, or the sum that the report has for it.

        The report adds up 20 × 20 parts of an opening. Where there are masks, its parts end where they do.
        """
        printed = printed and not (self.canopy or self.wall)
        x0, x1, v0, v1 = self.bounds
        edge = -1.0 if self.roof else float(np.clip(self.edge(point), v0, v1))
        split = not (self.roof or printed)
        rule = middles if printed else partial(gauss, panels=32 if self.roof else 10)
        pieces = [(v0, edge), (edge, v1)] if split else [(v0, v1)]
        total = 0.0
        for low, high in pieces:
            if high <= low:
                continue
            (u, wu), (v, wv) = rule(x0, x1), rule(low, high)
            u, v = np.meshgrid(u, v)
            at = np.stack([u, v, 3 + 0 * u] if self.roof else [u, 0 * u, v], -1)
            d = at - point
            square = (d**2).sum(-1)
            d = d / np.sqrt(square)[..., None]
            through = d[..., 2] if self.roof else -d[..., 1]
            sky = (v < edge) if self.canopy else (v > edge)
            light = np.full(u.shape, self.shining(type) / np.pi)
            swap = d[..., (0, 2, 1)]
            light[sky] = scale(type) * standard(type, self.sun[[0, 2, 1]], swap[sky])
            cos = (d @ normal).clip(0)
            part = transmittance(through) if self.glazed else 1.0
            total += float((light * part * cos * through / square * wv[:, None] * wu).sum())
        return total

    def values(self, types: Iterable[int], printed: bool = False) -> Doubles:
        """Return the values of tables (skies, points)."""
        return np.array(
            [[self.value(t, *each, printed) for each in zip(*self.points(), strict=True)] for t in types]
        )

    def run(self, spp: int, types: Iterable[int] = TYPES) -> Found:
        """Measure all points under some skies."""
        points, normals = self.points()
        each = [measured(self.scene(t), points, normals, spp, seed=t) for t in types]
        value, error = (np.stack([found[k] for found in each]) for k in (0, 1))
        return Found(value, error, each[0][2], self.values(types))


TABLES = {
    "5.9 1x1": Daylight("1x1"),
    "5.9 4x4": Daylight("4x4"),
    "5.10 1x1": Daylight("1x1", glazed=True),
    "5.10 4x4": Daylight("4x4", glazed=True),
    "5.11 2x1": Daylight("2x1"),
    "5.11 4x3": Daylight("4x3"),
    "5.12 2x1": Daylight("2x1", glazed=True),
    "5.12 4x3": Daylight("4x3", glazed=True),
    **{f"5.13 {depth}": Daylight("2x1", canopy=depth) for depth in (0.5, 1.0, 2.0)},
    **{f"5.14 {height}": Daylight("2x1", wall=height) for height in (3, 6, 9)},
}
CASES: dict[str, Callable[[int], Found]] = {
    "5.2": point_source,
    "5.3": area_source,
    "5.4 lamp": lamp_flux,
    **{f"5.4 {opening}": daylight_flux(Daylight(opening), 12) for opening in BOUNDS},
    **{f"5.5 {kind}": glass(kind) for kind in ("own", "slab", "thin")},
    "5.6": first_reflection,
    "5.7": obstructed,
    "5.8": reflected,
}


def printed() -> dict[str, tuple[Doubles, Doubles]]:
    """Return by case the tables that are printed (skies, points), and which values are known to be wrong."""
    rows: dict[str, list[list[str]]] = {}
    for line in (Path(__file__).parent / "data" / "cie171.txt").read_text().splitlines():
        if not line.startswith("#"):
            name, cells = line.split(": ")
            rows.setdefault(name.rsplit(" ", 1)[0], []).append(cells.split())
    found = {}
    for name, table in rows.items():
        if len(table) > len(TYPES):
            table = [[*row, *table[-1]] for row in table[:-1]]
        wrong = np.array([[cell.endswith("!") for cell in row] for row in table])
        found[name] = np.array([[float(cell.rstrip("!")) for cell in row] for row in table]), wrong
    return found
