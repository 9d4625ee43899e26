"""The contract of every light.

A `Light` is an object of a scene. For a render it gives a `LightRecord`, which holds k lights of one kind,
a column each (`SoA`). The methods of a record work on n lanes: on a record with one column that is shared
by all lanes, or on one that `take` gathered to a column per lane. Positions are relative to the scene's
center. Every pdf is in solid angle.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.soa import soa
from ..arrays.state import SoA, SurfaceInteraction
from ..arrays.vec import Bools, Doubles, Floats, Ints, Lanes, f4
from ..colors import EFFICACY
from ..core.errors import SceneError, exact, finite_array, number
from ..film.aov_names import DEFAULT_GROUP
from ..motion import Motion, Moving, product
from ..shapes import Shape
from ..shapes.transform import affine


@soa
class LightSample(SoA):
    """The light that arrives at a point from one sampled direction. A pdf of 0 means no sample.

    Examples
    --------
    >>> record = wf.PointLight((0, 2, 0), 8).record(np.zeros(3))
    >>> sample = record.sample_li(np.zeros((3, 1), np.float32), np.full((2, 1), 0.5, np.float32))
    >>> isinstance(sample, wf.LightSample), float(sample.distance[0])
    (True, 2.0)
    """

    wi: Floats  # (3, n) unit direction from the point to the light
    radiance: Floats  # (3, n) W·sr⁻¹·m⁻² (of a delta light: irradiance per unit cosine)
    pdf: Floats  # (n,) solid-angle density, 1/sr (of a delta light: 1)
    distance: Floats  # (n,) to the sampled point, scene units; inf for a light at infinity
    cos_light: Floats  # (n,) cosine between the ray and the light's normal; 1 where it has none
    # of lights whose radiance is looked up on the surface, with `le`, instead of being given here:
    prim: Ints | None = None  # (n,) triangle of the sampled point; -1 for a sample with its own radiance
    b1: Floats | None = None  # (n,) barycentric weight of its second vertex there
    b2: Floats | None = None  # (n,) barycentric weight of its third vertex


@soa
class Receiver(SoA):
    """The surfaces that lights shine on, for lights that are sampled by the irradiance there.

    Examples
    --------
    >>> up, yes = np.array([[0], [1], [0]], np.float32), np.array([True])
    >>> receiver = wf.Receiver(normal=up, opaque=yes)
    >>> sky = wf.Environment(np.random.default_rng(0).random((8, 16, 3))).record(np.zeros(3)).compensated()
    >>> point, u = np.zeros((3, 1), np.float32), np.full((2, 1), 0.5, np.float32)
    >>> sample = sky.lighting(receiver).sample_li(point, u)
    >>> bool(sample.wi[1, 0] > 0)
    True
    """

    normal: Floats  # (3, n) unit shading normal
    opaque: Bools  # (n,) light from behind the normal does not count
    bins: Ints | None = None  # (n,) bins of normals to draw images for; None where not known yet
    time: Doubles | None = None  # (n,) at which the light comes, s; None where no light moves


@soa
class Emitters(SoA):
    """Positions and directions of k lights, for the choice of one among very many.

    Examples
    --------
    >>> record = wf.PointLight((0, 2, 0), 8).record(np.zeros(3))
    >>> where = record.emitters()
    >>> isinstance(where, wf.Emitters), where.middle[:, 0].tolist(), float(where.extent2[0])
    (True, [0.0, 2.0, 0.0], 0.0)
    """

    middle: Doubles  # (3, k) relative to the scene's center, scene units
    facing: Doubles  # (3, k) unit normal of a surface that shines on one side, or unit axis of a spot; else 0
    # (k,) square of the size, such as the area of a surface; inf of lights at infinity, along `facing`
    extent2: Doubles


class Light(Moving, ABC):
    """Base class of lights: an element of `Scene(lights=...)`. Shapes with an emission need none.

    Examples
    --------
    >>> isinstance(wf.PointLight((0, 1, 0), 5), wf.Light)
    True
    """

    __slots__ = ()
    shape: Shape | None = None  # the mesh or sphere of the scene whose surface shines; None for no surface
    group: str = DEFAULT_GROUP  # for which layer of radiance the light counts
    efficacy: float = EFFICACY  # lm/W: by which `Measurement.lux` converts its watts, see docs/luminaires.md
    hint: ClassVar[str | None] = None  # how to turn the light to a shape that it misses, for messages
    _points: ClassVar[tuple[str, ...]] = ()  # attributes that are positions (3,) or (n, 3)
    _directions: ClassVar[tuple[str, ...]] = ()  # attributes that are directions (3,), None where not given

    @abstractmethod
    def record(self, center: Doubles) -> LightRecord:
        """Return the light as a record, with positions relative to `center` (3,).

        It has one column; that of a light with a `shape` may have one for each of its faces.
        """

    @property
    def _handed(self) -> bool:
        """Whether it differs from its mirror image."""
        return False

    @property
    def delta(self) -> bool:
        """Whether the light is a delta light: no ray can meet it, so only light samples find it."""
        return self.record(np.zeros(3)).delta

    @property
    def bounds(self) -> Doubles | None:
        """Lower and upper corner (2, 3) of the light, scene units; None if it has no position."""
        return None

    def transformed(self, matrix: ArrayLike | Motion) -> Self:
        """Return a copy that is moved and turned by an affine matrix, or by a motion that carries it.

        Intensities stay, also where the matrix has a scale.

        Parameters
        ----------
        matrix
            (4, 4), for column vectors; or a motion, such as `Keyframes`.

        Raises
        ------
        SceneError
            If it is malformed, the light has no place or direction, or one that is not round would be
            mirrored.

        Examples
        --------
        >>> aside = wf.Keyframes([0, 1], [(0, 0, 0), (2, 0, 0)])
        >>> lamp = wf.PointLight((0, 3, 0), 40).transformed(aside)
        >>> lamp.at(0.5).position.tolist(), lamp.moves
        ([1.0, 3.0, 0.0], True)
        """
        if not isinstance(matrix, Motion) and not self.moves:
            return self._transformed(affine(f"{type(self).__name__} transform", matrix))
        transform = (
            matrix if isinstance(matrix, Motion) else affine(f"{type(self).__name__} transform", matrix)
        )
        placing = transform if self.motion is None else product(transform, self.motion)
        assert isinstance(placing, Motion)
        rest = vars(self).get("_rest", self)
        rest._transformed(placing.at(placing.end))  # raises where the motion cannot carry it
        light = self._placed_as(rest._transformed(placing.at(placing.start)))
        vars(light).update(motion=placing, _rest=rest)
        return light

    def at(self, time: float) -> Self:
        """Return the light at a time, seconds; one that is still returns itself."""
        if self.motion is None:
            return self
        light = self._placed_as(vars(self)["_rest"]._transformed(self.motion.at(number("time", time))))
        vars(light).pop("motion")
        vars(light).pop("_rest")
        return light

    def _transformed(self, matrix: Doubles) -> Self:
        """Return a copy that is transformed by an affine matrix (4, 4)."""
        if not self._points and not self._directions:
            raise SceneError(
                f"{type(self).__name__} cannot be moved: it has neither a position nor a direction"
            )
        if self._handed and np.linalg.det(matrix[:3, :3]) < 0:
            raise SceneError(f"{type(self).__name__} transform mirrors; its light would have to be mirrored")
        light = copy(self)
        for name in self._points:
            points = getattr(self, name) @ matrix[:3, :3].T + matrix[:3, 3]
            setattr(light, name, points)
        for name in self._directions:
            vector = getattr(self, name)
            setattr(light, name, None if vector is None else matrix[:3, :3] @ vector)
        return light

    def _placed_as(self, other: Self) -> Self:
        """Return a copy with the place and the directions of another light."""
        light = copy(self)
        for name in (*self._points, *self._directions):
            setattr(light, name, getattr(other, name))
        return light

    def scaled(self, factor: float) -> Light:
        """Return the light for a scene whose lengths were multiplied by `factor`, with the same irradiance.

        Only scenes of extreme size are scaled.

        Raises
        ------
        SceneError
            If the light does not define how.
        """
        raise SceneError(
            f"{type(self).__name__} has no scaled(factor), which a scene as large or small as this needs"
        )


class FarLight(Light):
    """Base class of lights that are infinitely far away, so that they have no length."""

    __slots__ = ()

    def scaled(self, factor: float) -> Self:
        """Return the light itself."""
        return self


class LightRecord(SoA, Light):
    """The k lights of one kind in a scene. A light that is its own record holds one.

    A subclass is a dataclass. Each field is an array with a column per light, or a value that the
    lights share.

    Examples
    --------
    >>> record = wf.PointLight((0, 2, 0), 8).record(np.zeros(3))
    >>> point, u = np.zeros((3, 1), np.float32), np.full((2, 1), 0.5, np.float32)
    >>> record.sample_li(point, u).radiance[0]  # 8 W/sr at a distance of 2
    array([2.], dtype=float32)
    """

    __slots__ = ()
    delta: ClassVar[bool] = False  # no BSDF sample meets it: its samples take no MIS weight
    varies: ClassVar[bool | Bools] = False  # whether, or (k,) which lights, shine by `le(wi, surface)`
    reads: ClassVar[tuple[str, ...]] = ()  # attributes of the surface that `le` reads, such as "uv"
    takes_receiver: ClassVar[bool] = False  # whether `lighting` is another light

    def record(self, center: Doubles) -> LightRecord:
        """Return the light relative to `center` (3,); a light that is its own record defines how."""
        raise SceneError(
            f"{type(self).__name__} has no record(center), which returns the light relative to the center"
        )

    @abstractmethod
    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Sample a direction from points (3, n) to the light with u (2, n)."""

    @abstractmethod
    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return the density (n,) with which `sample_li` draws wi (3, n); 0 where a ray misses the light."""

    @abstractmethod
    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return the radiance (3, n) carried against wi by rays that meet the light; 0 from a dark side.

        `surface` (n columns) is where they meet it, for lights that vary; others get None.
        """

    @abstractmethod
    def power(self, scene_radius: float) -> Doubles:
        """Estimate the emitted power of each light, (k,), the mean of the channels, W.

        A light without power gets no samples.
        """

    def lighting(self, receiver: Receiver) -> LightRecord:
        """Return the light as it is sampled from n points on surfaces; here: as it is.

        Its `sample_li` and `pdf_li` may draw directions by the irradiance of each surface. Such a light says
        it by `takes_receiver`.
        """
        return self

    def irradiance(self, center: Doubles, radius: float, scene_radius: float) -> Doubles:
        """Estimate the irradiance by each light in spheres of space, W/m²; it guides the choice of a light.

        Parameters
        ----------
        center
            (3, c) centers of the spheres.
        radius
            Their radius, scene units.
        scene_radius
            Radius of the scene's bounding sphere.

        Returns
        -------
        (c, k) irradiance, the mean of the channels. Here: that of a light which illuminates the whole
        scene equally.
        """
        broadcast = self.power(scene_radius) / (4 * np.pi * max(scene_radius, 1e-30) ** 2)
        return np.broadcast_to(broadcast, (center.shape[1], len(broadcast)))

    def emitters(self) -> Emitters | None:
        """Return the positions of the lights, for the choice among more than 65 536; None if they have none.

        Lights without a position are chosen by power; together they get half of the samples. A wrong position
        causes noise, but no error of the mean.
        """
        return None


class DeltaLight(LightRecord):
    """Base class of delta lights: lights without a surface, such as points, which no ray can meet.

    Examples
    --------
    >>> isinstance(wf.PointLight((0, 1, 0), 5).record(np.zeros(3)), wf.DeltaLight)
    True
    """

    __slots__ = ()
    delta: ClassVar[bool] = True

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return 0: no sampled direction meets the light."""
        return np.zeros(wi.shape[1], f4)

    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return 0: the light is never seen."""
        return np.zeros_like(wi)


def position(name: str, value: ArrayLike) -> Doubles:
    """Return where a light stands, (3,) scene units."""
    return finite_array(name, value, (3,))


def lit_for(light: LightRecord, receiver: Receiver | None, lanes: Lanes) -> LightRecord:
    """Return a light as it is sampled for some of the surfaces, if these are known."""
    if receiver is None or not light.takes_receiver:
        return light
    return light.lighting(receiver.take(lanes))


def sampled_li(light: LightRecord, point: Floats, u: Floats) -> LightSample:
    """Return the samples of a light from points (3, n) with u (2, n).

    Raises
    ------
    SceneError
        If the light returns arrays of other shapes than `LightSample` has.
    """
    sample = light.sample_li(point, u)
    n = point.shape[1]
    if (
        np.shape(sample.wi) != (3, n)
        or np.shape(sample.radiance) != (3, n)
        or not np.shape(sample.pdf) == np.shape(sample.distance) == np.shape(sample.cos_light) == (n,)
    ):
        fields: dict[str, tuple[Any, tuple[int, ...]]] = {
            "wi": (sample.wi, (3, n)),
            "radiance": (sample.radiance, (3, n)),
            "pdf": (sample.pdf, (n,)),
            "distance": (sample.distance, (n,)),
            "cos_light": (sample.cos_light, (n,)),
        }
        for name, (array, due) in fields.items():
            if np.shape(array) != due:
                raise SceneError(
                    f"{type(light).__name__}: sample_li's {name} has the shape {np.shape(array)}; "
                    f"it must have {'(3, n)' if len(due) == 2 else '(n,)'} = {due}"
                )
    return sample


def emitters_of(light: LightRecord) -> Emitters:
    """Return the places of the k lights of a record; NaN for those at infinity.

    Raises
    ------
    SceneError
        If `emitters` returns something else than `Emitters` has.
    """
    emitters, k = light.emitters(), len(light)
    if emitters is None:
        nowhere = np.full((3, k), np.nan)
        return Emitters(nowhere, nowhere, nowhere[0])
    name = f"{type(light).__name__}: emitters"
    if not isinstance(emitters, Emitters):
        raise SceneError(f"{name} must return wf.Emitters or None, got {emitters!r}")
    middle = finite_array(f"{name}' middle", emitters.middle, (3, k))
    facing = finite_array(f"{name}' facing", emitters.facing, (3, k))
    extent2 = np.asarray(emitters.extent2, float)
    finite_array(f"{name}' extent2", np.where(extent2 == np.inf, 0, extent2), (k,))
    if (extent2 < 0).any():
        at = int(extent2.argmin())
        raise SceneError(f"{name}' extent2[{at}] is {exact(extent2[at])}; it must be at least 0")
    length2 = (facing * facing).sum(0)
    if (length2 > 1 + 1e-3).any():
        at = int(length2.argmax())
        raise SceneError(
            f"{name}' facing[:, {at}] has the length {exact(np.sqrt(length2[at]))}; it must be at most 1"
        )
    return Emitters(middle, facing, extent2)
