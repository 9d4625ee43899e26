"""Daylight coefficients: the light of each patch of the sky at points, from which any sky follows."""

from __future__ import annotations

from copy import copy
from itertools import pairwise
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ..accel import most_copies
from ..arrays.vec import Doubles, Floats, f4, luminance
from ..camera import Sensors
from ..compile.scene import CompiledScene
from ..core.errors import SceneError, number
from ..core.suggestions import suggests_keywords
from ..features.compiling import compile_scene
from ..io.to_scene import as_scene
from ..lights import PatchedEnvironment, SkyPatches
from ..sampling.sampler import Dimension
from ..sampling.steps import StepNumbers
from ..scene import Scene
from ..scene.sun_position import horizon_axes
from ..settings import AUTO, RenderSettings, takes_settings, whole_number
from ..stages.inside import stacks_at
from ..stages.intersect import ShadowRays
from ..stages.transmittance import transmittance_along
from .measure import measured
from .weather import Weather, product
from .year import Year

BATCHES = 8  # independent parts of the samples, from whose scatter errors follow
WAVE_VALUES = 1 << 22  # values of all groups of light in one wave
PAIRS = 1 << 18  # of points and suns, looked at at once
ALONG = 4  # squared: directions in which the sky is evaluated in each patch


class DaylightCoefficients:
    """The light of each patch of the sky at points, from `daylight_coefficients`.

    Parameters
    ----------
    scene
        With the patched sky as its light.
    points, normals
        (n, 3) of the sensors.
    patches
        The division of the sky.
    batches
        (b, n, p) irradiance of n points by a radiance of 1 of each patch, from b independent parts of the
        samples; the luminance of its color. Patch 0 is the ground, the others are as in Radiance.
    direct
        (b, n, p) the part that no surface has scattered.

    Examples
    --------
    >>> canopy = wf.Scene([wf.Disk((0, 2, 0), (0, -1, 0), 1, material=wf.Diffuse(0.5))])
    >>> found = wf.daylight_coefficients(canopy, [(0, 0, 0)], normals=(0, 1, 0), spp=256)
    >>> isinstance(found, wf.DaylightCoefficients), found.value.shape
    (True, (1, 146))
    """

    def __init__(
        self,
        scene: Scene,
        points: Doubles,
        normals: Doubles,
        patches: SkyPatches,
        batches: Doubles,
        direct: Doubles,
    ) -> None:
        self._scene, self.points, self.normals, self.patches = scene, points, normals, patches
        self.batches, self.direct = batches, direct

    @property
    def value(self) -> Doubles:
        """(n, p) W·m⁻² for each W·sr⁻¹·m⁻² of each patch."""
        return np.asarray(self.batches.mean(0))

    @property
    def standard_error(self) -> Doubles:
        """(n, p) of `value`."""
        return np.asarray(self.batches.std(0, ddof=1) / np.sqrt(len(self.batches)))

    def irradiance(self, radiance: ArrayLike) -> tuple[Doubles, Doubles]:
        """Return the irradiance of each point, and its standard error, under skies.

        Parameters
        ----------
        radiance
            (p,) or (p, m) of each patch, W·sr⁻¹·m⁻², of one sky or of m. `sky_radiance` returns that of a
            `Sky`.

        Returns
        -------
        (n,) or (n, m), twice.

        Raises
        ------
        SceneError
            If it has another shape.
        """
        values = np.asarray(radiance, float)
        if values.shape[:1] != (len(self.patches),) or values.ndim > 2:
            raise SceneError(f"radiance has the shape {values.shape}; it must have a value for each patch")
        irradiances = np.stack([product(batch, values.reshape(len(values), -1)) for batch in self.batches])
        shape = (len(self.points), *values.shape[1:])
        error = irradiances.std(0, ddof=1) / np.sqrt(len(irradiances))
        return irradiances.mean(0).reshape(shape), error.reshape(shape)

    def sky_radiance(self, sky: Any) -> Doubles:
        """Return the mean radiance (p,) of each patch of a `Sky`, without the sun's disk; its luminance.

        Means are weighted as on a horizontal plane, so that its irradiance is kept.
        """
        directions = self.patches.directions(ALONG)
        weights = self.patches.weights(ALONG)
        above = (luminance(sky.radiance(directions.reshape(3, -1).T).T).reshape(weights.shape) * weights).sum(
            1
        )
        below = luminance(sky.radiance([-self.patches.axes[:, 2]]).T)
        return np.concatenate([below, above])

    def lux(self, sky: Any) -> tuple[Doubles, Doubles]:
        """Return the illuminance of each point under a `Sky`, without the sun's disk, and its standard error.

        Both are (n,), lux, by the efficacy of the sky.
        """
        value, error = self.irradiance(self.sky_radiance(sky))
        return value * sky.efficacy, error * sky.efficacy

    @suggests_keywords
    def annual(self, weather: Weather, *, ground: float = 0.2, efficacy: float | None = None) -> Year:
        """Return the light at the points in each hour of a weather file.

        The sky of an hour is that of `Sky.perez`. The direct light of the sun comes from where the sun is, by
        a ray from each point, along which alpha and media take their part. What surfaces and glass make of
        the sun's light is that of the patch around it.

        Parameters
        ----------
        weather
            Irradiances and suns, from `load_weather`.
        ground
            Albedo of the ground beyond the scene.
        efficacy
            Factor of all light, lm/W: all values are lux then. None: values are in W·m⁻², and the year's
            `lux` and its limits in lux take the efficacy of the weather.

        Raises
        ------
        SceneError
            If an argument is out of its range.
        """
        sky, sun = weather.on_patches(self.patches, ground, ALONG)
        scattered = self.batches - self.direct
        factor = 1.0 if efficacy is None else number("efficacy", efficacy, lambda x: x > 0, "above 0 lm/W")
        beam = self.sunlight(weather) * factor
        batches = [
            product(total, sky * factor) + product(indirect, sun * factor) + beam
            for total, indirect in zip(self.batches, scattered, strict=True)
        ]
        return Year(np.stack(batches).astype(f4), weather, weather.efficacy if efficacy is None else 1.0)

    def sunlight(self, weather: Weather) -> Doubles:
        """Return the irradiance (n, hours) of each point by the sun alone, W·m⁻², where nothing hides it."""
        out = np.zeros((len(self.points), len(weather.direct_normal)))
        cosine, height = product(self.normals, weather.sun.T), weather.height(self.patches)
        lit = (cosine > 0) & (height > 0) & (weather.direct_normal > 0)
        at, hour = np.nonzero(lit)
        places = Sensors(self.points, self.normals).above(self._scene.bounds).places
        scene = compile_scene(
            self._scene, self._scene.accelerators.maker(AUTO), most_copies=most_copies(AUTO)
        )
        for start in range(0, at.size, PAIRS):
            i, h = at[start : start + PAIRS], hour[start : start + PAIRS]
            transmitted = _transmittance(scene, places[i], weather.sun[h], start)
            out[i, h] = transmitted * cosine[i, h] * weather.direct_normal[h]
        return out


def _transmittance(scene: CompiledScene, places: Doubles, toward: Doubles, first: int) -> Floats:
    """Return the transmittance (n,) from infinity to places (n, 3), along unit vectors (n, 3) to the light.

    Alpha and media count, by the luminance of their transmittance. Grids of media draw random numbers, which
    differ by `first`.
    """
    n, steps = len(places), None
    origin = np.ascontiguousarray((places * scene.scale - scene.center).T, f4)
    if scene.media is not None and scene.media.takes_steps:
        number = np.arange(first, first + n).astype(np.uint32)
        steps = StepNumbers.of(0, number, np.zeros_like(number), 0, Dimension.TRANSMITTANCE)
    rays = ShadowRays(
        origin=origin,
        direction=np.ascontiguousarray(toward.T, f4),
        exclude_prim=np.full(n, -1),
        error=np.zeros(n, f4),
        distance=np.full(n, np.inf, f4),
        cos_light=np.ones(n, f4),
        media=stacks_at(scene, origin),
        steps=steps,
    )
    return luminance(transmittance_along(scene, rays))


@takes_settings
def daylight_coefficients(
    scene: Any,
    points: ArrayLike,
    normals: ArrayLike,
    *,
    subdivision: int = 1,
    north: ArrayLike | None = None,
    spp: int = 1024,
    **settings: Unpack[RenderSettings],
) -> DaylightCoefficients:
    """Measure the light of each patch of the sky at points; any sky is then a product of matrices.

    All patches are measured at once: the sky is an environment of radiance 1, and light counts for the patch
    that it comes from.

    Parameters
    ----------
    scene
        As for `render`. Its lights do not count; shapes and media that emit are refused.
    points, normals
        As for `measure`.
    subdivision
        1 for the 145 patches of Tregenza; n for the finer ones of Reinhart, n × n for each.
    up
        Direction to the zenith: (3,), or the name of an axis, such as "z"; y by default.
    north
        (3,) direction to the north, as for `sun_position`.
    spp
        Samples per point, at least 8.
    {settings}

    Returns
    -------
    DaylightCoefficients

    Raises
    ------
    SceneError
        If an argument or the scene is malformed, or a setting is one that it chooses itself.

    Examples
    --------
    >>> canopy = wf.Scene([wf.Disk((0, 2, 0), (0, -1, 0), 1, material=wf.Diffuse(0.5))])
    >>> found = wf.daylight_coefficients(canopy, [(0, 0, 0)], normals=(0, 1, 0), spp=1024)
    >>> overcast = found.sky_radiance(wf.Sky.cie(16, horizontal=100))
    >>> level, error = found.irradiance(overcast)
    >>> bool(abs(level[0] - 77.2) < 1)  # the disk hides a quarter, and reflects 2 from the ground
    True
    """
    for name in ("samples", "aovs", "noise", "seconds", "checkpoint"):
        if name in settings:
            raise SceneError(f"{name} is {settings[name]!r}; daylight_coefficients chooses it itself")
    count = whole_number(BATCHES, 2**31)("spp", spp)
    up = settings.get("up", AUTO)
    zenith, toward_north, east = horizon_axes("y" if isinstance(up, str) and up == AUTO else up, north)
    patches = SkyPatches.of(
        whole_number(1, 16)("subdivision", subdivision), np.stack([toward_north, east, zenith], 1)
    )
    subject = copy(
        as_scene(scene, settings.get("material"), settings.get("progress"), settings.get("smooth", AUTO))
    )
    subject.lights = []
    if subject.emits:
        raise SceneError(
            "a shape of the scene emits, or a medium; daylight coefficients are those of the sky alone"
        )
    subject.lights = [PatchedEnvironment(np.ones((3, 1), f4), patches=patches)]
    sensors = Sensors(points, normals)
    places = sensors.above(subject.bounds)
    wave = max(256, WAVE_VALUES // (3 * len(patches)))
    bounds = [count * batch // BATCHES for batch in range(BATCHES + 1)]
    fixed = {"wave_size": wave, "reuse": False, **settings, "up": AUTO, "aovs": ("light_groups",)}
    coefficients = [
        np.stack(
            [
                _on_patches(subject, places, {**fixed, **bounces, "samples": range(*samples)}, len(patches))
                for samples in pairwise(bounds)
            ]
        )
        for bounces in ({}, {"max_bounces": 0})
    ]
    return DaylightCoefficients(subject, sensors.points, sensors.directions, patches, *coefficients)


def _on_patches(scene: Scene, sensors: Sensors, settings: dict[str, Any], patches: int) -> Doubles:
    """Return the luminance (n, p) of the light of each patch."""
    measurement = measured(scene, sensors, None, settings)
    colors = [measurement.part(f"light_groups.patch {number}")[0] for number in range(patches)]
    return np.stack([luminance(color.T.astype(float)) for color in colors], 1)
