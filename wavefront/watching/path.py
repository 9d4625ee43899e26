"""One path, vertex by vertex."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..aovs.geometric import ShapeTable
from ..arrays.path_recorder import PathRecorder
from ..arrays.state import Contribution, Hits, Paths
from ..arrays.vec import Doubles, Floats, Ints
from ..bsdfs import Diffuse
from ..compile.program import Leg
from ..compile.scene import CompiledScene
from ..core.html import table_html
from ..materials import Material
from ..sampling.mis import power_heuristic
from ..shapes import Capsules, Shape
from ..stages.shade import Shading
from .step import world_points

PATH_COLOR, LIGHT_COLOR = (0.9, 0.35, 0.05), (1.0, 0.9, 0.2)


@dataclass(frozen=True, slots=True)
class LightFound:
    """Light that a path has found at a vertex.

    It adds to the pixel `throughput` · `radiance` · `weight`, of light samples times
    `f` · `cos` / `pdf_light`.

    Examples
    --------
    >>> path = wf.trace([wf.Sphere((0, 0, 0), 1), wf.Environment(1)], size=(8, 8)).path((0, 0))
    >>> path[0].emitted.radiance, path[0].emitted.weight
    (array([1., 1., 1.]), 1.0)
    """

    throughput: Doubles  # (3,) of the path as far as here
    radiance: Doubles  # (3,) that arrives, W·sr⁻¹·m⁻²; 0 where the light sample is blocked
    weight: float  # of multiple importance sampling
    pdf_light: float  # 1/sr, with which a light sample has this direction; 0 where none can have it
    pdf_bsdf: float  # 1/sr, with which a BSDF sample has it; inf of a delta lobe and of the camera
    wi: Doubles | None = None  # (3,) direction of a light sample; None for light that the ray has met
    f: Doubles | None = None  # (3,) 1/sr, of a light sample
    cos: float = 1.0  # |cosθ| of a light sample


@dataclass(frozen=True, slots=True)
class Vertex:
    """The events at one vertex of a path.

    Directions are those of the user's scene. A value is None where the path did not get so far.

    Examples
    --------
    >>> path = wf.trace([wf.Sphere((0, 0, 0), 1), wf.Environment(1)], size=(8, 8)).path((4, 4))
    >>> path[0].shape, path[0].material, path[0].factor
    ('sphere', 'Diffuse', array([0.5, 0.5, 0.5]))
    """

    point: Doubles | None  # (3,); None where the path has left the scene
    shape: str  # name; "" where there is none
    material: str
    throughput: Doubles  # (3,) of the path as it arrives, weakened by media on the way
    wo: Doubles  # (3,) unit, back along the path
    emitted: LightFound | None = None  # light that the ray has met
    sampled: LightFound | None = None  # the light sample
    wi: Doubles | None = None  # (3,) unit, how the path goes on
    f: Doubles | None = None  # (3,) 1/sr; None for a delta lobe
    cos: float | None = None  # |cosθ| of wi
    pdf: float | None = None  # 1/sr, of wi; of a delta lobe the probability of the lobe
    specular: bool | None = None  # wi is from a delta lobe
    factor: Doubles | None = None  # (3,) of the throughput: f·cos/pdf
    survival: float | None = None  # probability with which Russian roulette let the path go on; 0 at its end

    @property
    def light(self) -> Doubles:
        """Light that the vertex adds to the pixel, (3,)."""
        total = np.zeros(3)
        for light in (self.emitted, self.sampled):
            if light is not None:
                added = light.throughput * light.radiance * light.weight
                total += added if light.f is None else added * light.f * light.cos / light.pdf_light
        return total


class PathVertices(Sequence[Vertex]):
    """The vertices of a path, the first surface first, from `Trace.path` and `explain`.

    Parameters
    ----------
    vertices
        The first surface first.
    pixel, sample
        (x, y), and which sample of it.
    radiance
        (3,) the light of the sample, which is the sum of `Vertex.light`.
    camera
        (3,) where the path starts.
    time
        Of the path, seconds of the scene; None where nothing moves while the shutter is open.

    Examples
    --------
    >>> floor = wf.Rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4), material=wf.Diffuse(0.5))
    >>> lamp = wf.Sphere((0, 3, 0), 0.5, emission=10)
    >>> scene = wf.Scene([floor, lamp], camera=wf.Camera.look_at((0, 2, 5), (0, 0, 0), size=(8, 8)))
    >>> path = wf.trace(scene).path((4, 4))
    >>> path[0].shape, path[0].material
    ('rectangle', 'Diffuse')
    >>> bool(np.allclose(sum(vertex.light for vertex in path), path.radiance))
    True
    """

    def __init__(
        self,
        vertices: Sequence[Vertex],
        pixel: tuple[int, int],
        sample: int,
        radiance: Doubles,
        camera: Doubles,
        time: float | None = None,
    ) -> None:
        self._vertices, self.pixel, self.sample = tuple(vertices), pixel, sample
        self.radiance, self.camera, self.time = radiance, camera, time

    def __len__(self) -> int:
        """Return the number of vertices."""
        return len(self._vertices)

    def __getitem__(self, index: Any) -> Any:
        """Return a vertex, or a tuple of some."""
        return self._vertices[index]

    def __repr__(self) -> str:
        """Return the path as a table."""
        rows = [HEADINGS, *(_row(number, vertex) for number, vertex in enumerate(self))]
        widths = [max(len(row[column]) for row in rows) for column in range(len(HEADINGS))]
        lines = [
            "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows
        ]
        return "\n".join([self._title(), *(line.rstrip() for line in lines)])

    def _repr_html_(self) -> str:
        rows = [HEADINGS, *(_row(number, vertex) for number, vertex in enumerate(self))]
        return table_html(self._title(), rows)

    def _title(self) -> str:
        when = "" if self.time is None else f" at {self.time:.6g} s"
        return f"pixel {self.pixel}, sample {self.sample}{when}: radiance {_numbers(self.radiance)}"

    def shapes(self, radius: float) -> list[Shape]:
        """Return the path as `Capsules` to be added to its scene, and its light samples in another color.

        Parameters
        ----------
        radius
            Of the capsules, scene units.
        """
        corners = [self.camera, *(vertex.point for vertex in self if vertex.point is not None)]
        segments = list(pairwise(corners))
        reached = [
            (vertex.point, vertex.point + 20 * radius * vertex.sampled.wi)
            for vertex in self
            if vertex.point is not None and vertex.sampled is not None and vertex.sampled.wi is not None
        ]
        shown = ((segments, PATH_COLOR, "path"), (reached, LIGHT_COLOR, "light samples"))
        return [
            Capsules(
                np.array([a for a, _ in ends]),
                np.array([b for _, b in ends]),
                radius,
                material=Material(Diffuse(color)),
                name=name,
            )
            for ends, color, name in shown
            if ends
        ]


HEADINGS = ("", "shape", "material", "throughput", "light", "f", "cos", "pdf", "MIS", "roulette")


def _row(number: int, vertex: Vertex) -> tuple[str, ...]:
    weights = [f"{light.weight:.3g}" for light in (vertex.emitted, vertex.sampled) if light is not None]
    delta = "delta" if vertex.specular else ""
    return (
        str(number),
        vertex.shape or "–",
        vertex.material,
        _numbers(vertex.throughput),
        _numbers(vertex.light),
        delta or _numbers(vertex.f),
        _number(vertex.cos),
        _number(vertex.pdf),
        " + ".join(weights),
        _number(vertex.survival),
    )


def _numbers(values: Doubles | None) -> str:
    return "" if values is None else " ".join(f"{value:.4g}" for value in values)


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"


class VertexRecorder(PathRecorder):
    """Records all events of one path. All columns are of its lane."""

    needs_directions = True

    def __init__(self, scene: CompiledScene, shapes: ShapeTable) -> None:
        self._scene, self._shapes = scene, shapes
        self._seen: list[dict[str, Any]] = []
        self._camera = np.zeros(3)
        self._time: float | None = None

    def stage(self, name: str, leg: Leg) -> None:
        """Note how the path has left its last surface, before anything acts on the way."""
        if not self._seen:
            self._camera = _column(world_points(self._scene, leg.paths.origin))
            self._time = None if leg.paths.time is None else float(leg.paths.time[0])
        elif len(leg.paths):
            before = self._seen[-1]
            left, now = before["throughput"] * before["factor"], _column(leg.paths.throughput)
            before["survival"] = float(left.max() / now.max()) if now.max() > 0 else 1.0

    def record_hits(self, leg: Leg) -> None:
        """Note where the path has come to, and the light that its ray has met."""
        if not len(leg.paths):
            return
        prim, paths = int(leg.hits.prim[0]), leg.paths
        shape, material = self._names(leg.hits)
        end = paths.origin + paths.direction * (leg.hits.t if prim != -1 else 0)
        self._seen.append(
            {
                "point": _column(world_points(self._scene, end)) if prim != -1 else None,
                "shape": shape,
                "material": material,
                "throughput": _column(paths.throughput),
                "wo": -_column(paths.direction),
                "emitted": self._light_met(leg),
            }
        )

    def _names(self, hits: Hits) -> tuple[str, str]:
        if hits.prim[0] < 0:
            return "", "medium" if hits.prim[0] < -1 else ""
        shape = self._scene.shape_numbers.of(hits)
        material = self._shapes.ids("material_id", shape)
        return self._scene.shape_names[int(shape[0])], self._shapes.names("material")[int(material[0])]

    def _light_met(self, leg: Leg) -> LightFound | None:
        emission, paths = leg.emission, leg.paths
        if not len(emission.lanes):
            return None
        start = paths.last_vertex
        known = self._scene.lights.chosen_from.take(emission.light)[0] and not paths.specular[0]
        pdf = 0.0
        if known:
            pdf = float(
                self._scene.lights.pdf_li(emission.light, start, paths.direction, paths.left_receiver)[0]
            )
        bsdf = np.inf if paths.specular[0] else float(paths.pdf[0])
        weight = float(power_heuristic(paths.pdf, np.array([pdf], np.float32))[0]) if leg.mis and pdf else 1.0
        return LightFound(_column(paths.throughput), _column(emission.radiance), weight, pdf, bsdf)

    def record_surfaces(self, scene: CompiledScene, paths: Paths, shade: Shading) -> None:
        """Note the throughput, of which absorption may have taken a part."""
        self._arrived = _column(paths.throughput)
        self._shade = shade

    def record_light(
        self, picture: Floats, paths: Paths, contribution: Contribution, slot: Ints, arriving: Floats
    ) -> None:
        """Note a light sample."""
        if not contribution.sampled or not len(contribution.lanes):
            return
        lit, table = self._shade.lit(), self._scene.lights
        assert contribution.wi is not None
        wi = lit.frame.to_local(contribution.wi)
        f, pdf = lit.evaluate(wi)
        cos, _ = lit.cosines(wi, contribution.wi)
        light = table.pdf_li(contribution.light, lit.start, contribution.wi, lit.receiver)
        pdf = lit.density(np.zeros(1, np.intp), contribution.wi, pdf)
        weight = table.mis_weight(contribution.light, light, pdf)
        scale = f * cos * weight / np.where(light > 0, light, 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            radiance = np.where(scale > 0, contribution.radiance / scale, 0)
        self._seen[-1]["sampled"] = LightFound(
            self._arrived,
            _column(radiance),
            float(weight[0]),
            float(light[0]) or 1.0,
            float(pdf[0]),
            _column(contribution.wi),
            _column(f),
            float(cos[0]),
        )

    def record_scattering(self, paths: Paths, shade: Shading, left: Paths) -> None:
        """Note the direction in which the path goes on."""
        wi = shade.frame.to_local(left.direction)
        cos, _ = shade.cosines(wi, left.direction)
        specular = bool(left.specular[0])
        before, after = _column(paths.throughput), _column(left.throughput)
        self._seen[-1].update(
            wi=_column(left.direction),
            f=None if specular else _column(shade.evaluate(wi)[0]),
            cos=float(cos[0]),
            pdf=float(left.pdf[0]),
            specular=specular,
            factor=np.divide(after, before, out=np.zeros(3), where=before > 0),
            survival=0.0,
            throughput=before,
        )

    def vertices(self, pixel: tuple[int, int], sample: int, radiance: Floats) -> PathVertices:
        """Return the vertices that have been noted."""
        return PathVertices(
            [Vertex(**fields) for fields in self._seen],
            pixel,
            sample,
            radiance.astype(np.float64),
            self._camera,
            self._time,
        )


def _column(values: Floats) -> Doubles:
    """Return the first column as (3,) float64."""
    column: Doubles = values[:, 0].astype(np.float64)
    return column
