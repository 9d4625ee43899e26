"""The sky by day: standard distributions of its light, and the sun in it."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.elementary import arcsin, sin_cos_turns
from ..arrays.frame import Frame
from ..arrays.soa import soa
from ..arrays.state import SurfaceInteraction
from ..arrays.vec import Doubles, Floats, column, dot, f4
from ..camera import upward
from ..colors import DAYLIGHT, EFFICACY, Photometric, from_photometric, rgb
from ..colors.photometry import photometric
from ..core.errors import SceneError, finite_array, flag, number, rotation_matrix
from ..core.parameter import Parameter, Parametrized, brief, instance_of, optional, parametrized
from ..core.suggestions import suggests_keywords
from ..film.aov_names import DEFAULT_GROUP, group_name
from .base import FarLight, LightSample, Receiver
from .directional import DirectionalLight, unit
from .hosek_wilkie import hosek_wilkie_sky
from .image import ImageEnvironment
from .infinite import EnvironmentSum, InfiniteLight, at_infinity, turned
from .sky_functions import WITHOUT_SUN, SkyFunction, cie_function, perez_function

ROWS, COLUMNS = 128, 256  # of the table by which directions are drawn, and of the quadrature
SUN_DIAMETER = 0.533  # degrees
SOLAR_CONSTANT = 1367.0  # W·m⁻², that of Perez et al.


@soa
class SkyLight(InfiniteLight):
    """A function of direction above the horizon, and even ground below it; drawn by a table of its values."""

    function: SkyFunction
    scale: Floats  # (3, 1) W·sr⁻¹·m⁻² for each unit of the function
    ground: Floats  # (3, 1) W·sr⁻¹·m⁻²
    up: Floats  # (3,) unit
    sun: Floats  # (3,) unit
    table: ImageEnvironment
    takes_receiver: ClassVar[bool] = True

    def compensated(self) -> Self:
        """Draw directions by how much brighter than the mean they are."""
        return replace(self, table=self.table.compensated())

    def sample_li(self, point: Floats, u: Floats) -> LightSample:
        """Draw a direction from the table."""
        drawn = self.table.sample_li(point, u)
        return at_infinity(drawn.wi, self.le(drawn.wi), drawn.pdf)

    def pdf_li(self, point: Floats, wi: Floats) -> Floats:
        """Return the density of the table."""
        return self.table.pdf_li(point, wi)

    def lighting(self, receiver: Receiver) -> Self:
        """Return the light as it is sampled for the normals of opaque surfaces."""
        return replace(self, table=self.table.lighting(receiver))

    def le(self, wi: Floats, surface: SurfaceInteraction | None = None) -> Floats:
        """Return the radiance in direction wi, (3, n)."""
        height = dot(wi, column(self.up))
        above = self.scale * relative_radiance(self.function, wi, np.maximum(height, f4(0)), self.sun)
        return np.where(height >= 0, above, self.ground)

    def power(self, scene_radius: float) -> Doubles:
        """4π times the mean radiance, through the disk of the scene: the share of light samples."""
        return self.table.power(scene_radius)


def relative_radiance(function: SkyFunction, wi: Floats, height: Floats, sun: Floats) -> Floats:
    """Return a sky's function (k, n) in directions (3, n) of this height, the cosine to the zenith (n,)."""
    away = wi - column(sun)
    half = f4(0.5) * np.sqrt(dot(away, away))  # sin(γ/2): accurate close to the sun
    return function.at(height, f4(2) * arcsin(np.minimum(half, f4(1))), f4(1) - f4(2) * half * half)


def _zenith(name: str, up: ArrayLike) -> Doubles:
    return unit(name, upward(name, up))


def _horizontal(name: str, value: ArrayLike) -> Floats:
    return _marked_as(value, rgb(name, value))


def _irradiance(name: str, value: ArrayLike) -> Doubles:
    return _marked_as(value, rgb(name, value).astype(float).ravel())


def _marked_as(value: Any, irradiance: Any) -> Any:
    """Return an irradiance with the efficacy of the value that it was read from, if that has one."""
    return photometric(irradiance, value.efficacy) if isinstance(value, Photometric) else irradiance


_lumens_per_watt = partial(number, holds=lambda x: x > 0, limit="above 0 lm/W")


@parametrized
class Sky(Parametrized, FarLight):
    """The light of the sky and the sun; made by `Sky.cie`, `Sky.perez` or `Sky.hosek_wilkie`.

    The sky is infinitely far away. Above the horizon its radiance is the formula of the model, with no table
    in between; below it is a level ground, lit by the sky and the sun. The sun is a disk of 0.533°.

    Parameters
    ----------
    function
        The relative radiance of the sky.
    sun
        (3,) direction from the scene to the sun, of any length.
    up
        Direction to the zenith: (3,), or the name of an axis, such as "z".
    scale
        W·sr⁻¹·m⁻² for each unit of the function; None for the diffuse irradiance of `horizontal`.
    horizontal
        Diffuse irradiance of a horizontal plane under the free sky, W·m⁻², a color.
    direct_normal
        Irradiance by the sun alone of a surface that faces it, W·m⁻², a color; 0 for no disk.
    ground
        Albedo of the ground, a color.
    efficacy
        lm/W, for `Measurement.lux`. None: 683 where the irradiances come from `from_photometric`, and
        else 110, about that of all watts of sun and sky.
    group
        Name of the light group, for `aovs="light_groups"`.

    Attributes
    ----------
    efficacy
        lm/W, never None.
    diffuse_horizontal
        (3,) irradiance of a horizontal plane by the sky alone, W·m⁻².
    direct_normal
        (3,) irradiance by the sun of a surface that faces it, W·m⁻².
    sun, up
        (3,) unit vectors.

    Notes
    -----
    The parameters may be assigned later, too; the function stays that of the sun's first height.

    `from_photometric` turns illuminances in lux into the irradiances of white light that are asked for here.

    Raises
    ------
    SceneError
        If an argument is malformed, the sun must be above the horizon and is not, or one irradiance is given
        in lux and the other one in watts.

    Examples
    --------
    >>> sky = wf.Sky.cie(12, sun=(1, 1, 0.5), horizontal=100, direct_normal=700)
    >>> scene = wf.Scene([wf.Sphere((0, 0, 0), 1)], [sky])
    """

    model: Parameter[SkyFunction] = Parameter(
        instance_of(SkyFunction, "a SkyFunction; wf.Sky.cie(12, sun) is a clear sky"), alias="function"
    )
    sun: Parameter[ArrayLike | None] = Parameter(unit, default=None)
    up: Parameter[ArrayLike] = Parameter(_zenith, default="y")
    scale: Parameter[ArrayLike | None] = Parameter(optional(rgb), default=None, kw_only=True)
    horizontal: Parameter[ArrayLike] = Parameter(_horizontal, default=1.0, kw_only=True)
    direct_normal: Parameter[ArrayLike] = Parameter(_irradiance, default=0.0, kw_only=True)
    ground: Parameter[ArrayLike] = Parameter(partial(rgb, high=1), default=0.2, kw_only=True)
    _efficacy: Parameter[float | None] = Parameter(
        optional(_lumens_per_watt), default=None, kw_only=True, alias="efficacy"
    )
    group: Parameter[str] = Parameter(group_name, default=DEFAULT_GROUP, kw_only=True)

    @property
    def efficacy(self) -> float:
        """lm/W of the watts of sky and sun."""
        inputs = [self.direct_normal] if self.scale is not None else [self.horizontal, self.direct_normal]
        usual = DAYLIGHT if self._efficacy is None else self._efficacy
        efficacies = {getattr(light, "efficacy", usual) for light in inputs if light.any()} or {usual}
        efficacies |= set() if self._efficacy is None else {self._efficacy}
        if len(efficacies) > 1:
            raise SceneError(
                "Sky horizontal, direct_normal and efficacy have "
                f"{' and '.join(map(str, sorted(efficacies)))} lm/W; "
                "give all of its light in watts, or all by from_photometric"
            )
        return float(efficacies.pop())

    @efficacy.setter
    def efficacy(self, value: float | None) -> None:
        self._efficacy = value

    def derive(self) -> None:
        """Set the irradiance of the sky, and the light that is rendered."""
        _ = self.efficacy  # fails if there are several
        direct_normal = np.asarray(self.direct_normal)
        rotation = _rotation(self.up)
        relative = _table(self.model, rotation, self.sun)
        level, shade = _level_irradiance(relative), self.scale
        if shade is None:
            if not (self.horizontal.any() and level.all()):
                raise SceneError(
                    f"Sky horizontal is {brief(self.horizontal)}; it and the model's must be above 0"
                )
            shade = (np.asarray(self.horizontal) / level).astype(f4)
        self.diffuse_horizontal = (shade * level).ravel()
        whole = self.diffuse_horizontal + direct_normal * max(float(self.sun @ self.up), 0.0)
        below = (self.ground * column(whole) / np.pi).astype(f4)
        pixels = np.empty((ROWS, COLUMNS, 3), f4)
        pixels[: ROWS // 2] = np.moveaxis(shade[:, :, None] * relative, 0, -1)
        pixels[ROWS // 2 :] = below.ravel()
        table = ImageEnvironment.of(pixels, "nearest", rotation)
        self._light = SkyLight(self.model, shade, below, self.up.astype(f4), self.sun.astype(f4), table)

    def _transformed(self, matrix: Doubles) -> Self:
        """Return a copy that is turned by an affine matrix (4, 4)."""
        turn = rotation_matrix("Sky transform", matrix[:3, :3])
        return self._turned_to(turn @ self.sun, turn @ self.up)

    def _placed_as(self, other: Self) -> Self:
        """Return a copy that is turned as another sky."""
        return self._turned_to(other.sun, other.up)

    def _turned_to(self, sun: ArrayLike, up: ArrayLike) -> Self:
        """Return a copy with other directions; both are set at once, as each alone may be impossible."""
        light = copy(self)
        vars(light).update(sun=sun, up=up)
        light.derive()
        return light

    @classmethod
    @suggests_keywords
    def cie(
        cls,
        type: int,
        sun: ArrayLike | None = None,
        up: ArrayLike = "y",
        *,
        horizontal: ArrayLike = 1.0,
        direct_normal: ArrayLike = 0.0,
        ground: ArrayLike = 0.2,
        efficacy: float | None = None,
        group: str = DEFAULT_GROUP,
    ) -> Self:
        """Return a standard general sky of the CIE.

        Source: ISO 15469:2004 (CIE S 011/E:2003).

        Parameters
        ----------
        type
            1 to 5: overcast (1: the CIE's standard overcast sky; 5: the same all around), 6 to 10: partly
            cloudy, 11 to 15: clear (12: the CIE's standard clear sky); 16: the traditional overcast sky,
            whose luminance is (1 + 2 sin γ)/3 of that of the zenith at the height γ.
        sun
            (3,) direction to the sun, of any length. Types 1, 3, 5 and 16 do not depend on it.
        up, horizontal, direct_normal, ground, efficacy, group
            As for `Sky`. The standard says nothing of the sun's own light.

        Raises
        ------
        SceneError
            If an argument is malformed, or the sun must be above the horizon and is not.

        Examples
        --------
        >>> overcast = wf.Sky.cie(16, horizontal=1)
        >>> (overcast.radiance([(0, 1, 0), (1, 0, 0)])[:, 0] * np.pi * 7 / 9).round(3)
        array([1.   , 0.333])
        """
        function = cie_function(type)
        if type not in WITHOUT_SUN:
            _height(sun, up)
        return cls(
            function,
            _zenith("Sky up", up) if sun is None else sun,
            up,
            horizontal=horizontal,
            direct_normal=direct_normal,
            ground=ground,
            efficacy=efficacy,
            group=group,
        )

    @classmethod
    @suggests_keywords
    def perez(
        cls,
        direct_normal: float,
        diffuse_horizontal: float,
        sun: ArrayLike,
        up: ArrayLike = "y",
        *,
        illuminance: tuple[float, float] | None = None,
        extraterrestrial: float = SOLAR_CONSTANT,
        disk: bool = True,
        ground: ArrayLike = 0.2,
        efficacy: float | None = None,
        group: str = DEFAULT_GROUP,
    ) -> Self:
        """Return the sky of all weathers, from two measured irradiances, as weather files have them.

        Parameters
        ----------
        direct_normal
            Irradiance by the sun of a surface that faces it, W·m⁻², at least 0.
        diffuse_horizontal
            Irradiance of a horizontal plane by the sky, W·m⁻², above 0.
        sun
            (3,) direction to the sun, of any length, above the horizon.
        illuminance
            The same two in lux, of white light as `from_photometric` has it. Sky and sun are then scaled to
            these; the irradiances give the distribution.
        extraterrestrial
            Irradiance of the sun outside of the atmosphere, W·m⁻²; over the year it varies by 3.3 %.
        disk
            Whether the sun itself is part of the light.
        up, ground, efficacy, group
            As for `Sky`: the irradiances have 110 lm/W by default.

        Raises
        ------
        SceneError
            If an argument is malformed or out of its range.

        Notes
        -----
        Source: R. Perez, R. Seals and J. Michalsky, All-Weather Model for Sky Luminance Distribution, Solar
        Energy 50(3), 1993. For inputs that no weather has, the published coefficients lead to skies that
        are negative or shine without bound: the brightness Δ is held in 0.01 to 0.6, b at -0.05 or below, and
        luminance at 0 or above.

        Examples
        --------
        >>> sky = wf.Sky.perez(650, 120, sun=(0.5, 0.6, 0.2))
        >>> sky.diffuse_horizontal.round(3)
        array([120., 120., 120.])
        """
        direct = number("Sky direct_normal", direct_normal, lambda x: x >= 0, "at least 0")
        diffuse = number("Sky diffuse_horizontal", diffuse_horizontal, lambda x: x > 0, "above 0")
        beyond = number("Sky extraterrestrial", extraterrestrial, lambda x: x > 0, "above 0")
        scaled: list[ArrayLike] = [direct, diffuse]
        if illuminance is not None:
            scaled = [from_photometric(lux) for lux in finite_array("Sky illuminance", illuminance, (2,))]
        return cls(
            perez_function(direct, diffuse, _height(sun, up), beyond),
            sun,
            up,
            horizontal=scaled[1],
            direct_normal=scaled[0] if flag("Sky disk", disk) else 0.0,
            ground=ground,
            efficacy=efficacy,
            group=group,
        )

    @classmethod
    @suggests_keywords
    def hosek_wilkie(
        cls,
        turbidity: float,
        ground_albedo: ArrayLike,
        sun: ArrayLike,
        up: ArrayLike = "y",
        *,
        scale: float = 1.0,
        disk: bool = True,
        ground: ArrayLike | None = None,
        group: str = DEFAULT_GROUP,
    ) -> Self:
        """Return a clear sky in color, with the data that the package `mitsuba` brings.

        Source: L. Hošek and A. Wilkie, An Analytic Model for Full Spectral Sky-Dome Radiance, SIGGRAPH 2012,
        and Adding a Solar-Radiance Function to the Hošek-Wilkie Skylight Model, IEEE CG&A 33(3), 2013.

        Parameters
        ----------
        turbidity
            How hazy the air is, 1 (pure air) to 10; about 3 on a clear day.
        ground_albedo
            Albedo of the ground, a color; the sky is brighter above a bright one.
        sun
            (3,) direction to the sun, of any length, above the horizon.
        scale
            Factor of sky and sun. With 1 they are in W·sr⁻¹·m⁻² of light: 683 times the luminance (Rec. 709)
            of a radiance is cd·m⁻².
        disk
            Whether the sun itself is part of the light. It is even; the model's limb darkening is averaged.
        ground
            Albedo of the ground that is seen below the horizon; None for `ground_albedo`.
        up, group
            As for `Sky`.

        Raises
        ------
        SceneError
            If an argument is malformed or out of its range, or `mitsuba` is not installed.
        """
        albedo = rgb("Sky ground_albedo", ground_albedo, high=1)
        haze = number("Sky turbidity", turbidity, lambda x: 1 <= x <= 10, "from 1 to 10")
        factor = number("Sky scale", scale, lambda x: x > 0, "above 0")
        function, radiance, solar = hosek_wilkie_sky(haze, albedo, _height(sun, up))
        return cls(
            function,
            sun,
            up,
            scale=factor * radiance,
            direct_normal=factor * solar if flag("Sky disk", disk) else 0.0,
            ground=albedo if ground is None else ground,
            efficacy=EFFICACY,
            group=group,
        )

    def radiance(self, directions: ArrayLike) -> Doubles:
        """Return the radiance without the sun's disk, (n, 3), in directions (n, 3) of any length."""
        vectors = finite_array("directions", directions, (None, 3))
        length = np.sqrt((vectors * vectors).sum(1, keepdims=True))
        if not length.all():
            raise SceneError("directions must not be zero")
        return self._light.le(np.ascontiguousarray((vectors / length).T, f4)).T.astype(float)

    def record(self, center: Doubles) -> InfiniteLight:
        """Return the sky, and the sun in it, as a record of one column."""
        if not self.direct_normal.any():
            return self._light
        disk = DirectionalLight(-self.sun, np.asarray(self.direct_normal), angle=SUN_DIAMETER).record(center)
        assert isinstance(disk, InfiniteLight)
        return EnvironmentSum.of([self._light, disk])


def _height(sun: ArrayLike | None, up: ArrayLike) -> float:
    """Return the cosine of the sun's angle from the zenith, above 0."""
    height = 0.0 if sun is None else float(unit("Sky sun", sun) @ _zenith("Sky up", up))
    if not height > 0:
        raise SceneError(f"Sky sun is {sun!r}; such a sky needs one that is above the horizon")
    return min(height, 1.0)


def _rotation(up: Doubles) -> Doubles:
    """Return the axes of the table, columns of (3, 3), of which the second is up."""
    frame = Frame.from_normal(column(up))
    return np.concatenate([frame.y, frame.z, frame.x], axis=1).astype(float)


def _table(function: SkyFunction, rotation: Doubles, sun: Doubles) -> Floats:
    """Return the function (k, rows, COLUMNS) at the middles of the texels above the horizon."""
    rows = ROWS // 2
    level, high = sin_cos_turns((np.arange(rows) + 0.5) / (2 * ROWS))
    across, along = sin_cos_turns(0.5 - (np.arange(COLUMNS) + 0.5) / COLUMNS)
    x, z = (level[:, None] * component for component in (across, along))
    local = np.stack([x, np.broadcast_to(high[:, None], x.shape), z]).reshape(3, -1)
    wi = turned(rotation, local).astype(f4)
    relative = relative_radiance(function, wi, local[1].astype(f4), sun.astype(f4))
    return np.broadcast_to(relative, (len(relative), wi.shape[1])).reshape(-1, rows, COLUMNS)


def _level_irradiance(relative: Floats) -> Doubles:
    """Return ∫ f·cos Z dω of a table (k, rows, COLUMNS): (k, 1)."""
    _, edge = sin_cos_turns(np.arange(ROWS // 2 + 1) / (2 * ROWS))
    weight = np.pi / COLUMNS * (edge[:-1] - edge[1:]) * (edge[:-1] + edge[1:])
    return (relative.astype(float).sum(2) * weight).sum(1).reshape(-1, 1)
