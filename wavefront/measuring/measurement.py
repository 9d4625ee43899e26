"""Measurements by sensors, with their errors."""

from __future__ import annotations

import os
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..arrays.vec import Bools, Doubles
from ..core.errors import SaveError, SceneError, number, one_of
from ..core.files import check_target, write_bytes
from ..core.plural import plural
from ..core.suggestions import Answers, suggests_keywords
from ..film.aov_names import BRIGHTEST, BRIGHTEST_LUX, LUX, NARROW, STANDARD_ERROR, VARIANCE
from ..image import Image
from ..sampling.tiles import MEMBERS, nearby_ranks
from ..statistics import event_of, light_limits, moderated_variance, rule_of_three
from .units import PHOTOMETRIC

COLORS = ("r", "g", "b")
PLACES = ("position", "normal", "scale", NARROW)  # layers that belong to the sensors
KINDS_OF_LIGHT = ("broadband", "visible")
SCATTERED = 0.25  # relative error of a value, or of those near it, that is still called reliable
DOUBT = 0.1  # part of the value that may be unseen where it is


class Measurement(Answers):
    """Light at points, from `measure`.

    Parameters
    ----------
    image
        The picture with a pixel for each sensor.

    Attributes
    ----------
    value
        (n, 3) mean of each channel: W·m⁻² (irradiance, fluence), W·sr⁻¹·m⁻² (radiance) or W (flux).
    standard_error
        (n, 3) of `value`; NaN for fewer than two samples.
    lux, lux_error
        (n,) the photometric light, and its standard error.
    samples
        (n,) of each point.
    points, normals
        (n, 3) of the sensors, scene units. For radiance the normals are the directions.
    kind
        "irradiance", "fluence", "radiance", "arriving flux" or "leaving flux".
    metadata
        The settings and results of the render.
    image
        As given.

    Raises
    ------
    SceneError
        If the picture is not one of sensors.

    Examples
    --------
    >>> scene = [wf.Plane((0, 0, 0), (0, 0, 1), material=wf.Diffuse(0)), wf.Environment(1)]
    >>> found = wf.measure(scene, [(0, 0, 1)], kind="fluence", spp=16)
    >>> isinstance(found, wf.Measurement), found.kind
    (True, 'fluence')
    >>> np.allclose(found.value, 2 * np.pi, rtol=0.02)
    True
    >>> np.allclose(found.lux, 683 * 2 * np.pi, rtol=0.02)
    True
    """

    def __init__(self, image: Image) -> None:
        if not isinstance(image, Image) or "sensor" not in image.metadata or "position" not in image.layers:
            raise SceneError("is no measurement: that is an npz file, or a picture, of wf.measure")
        self.image = image
        self.metadata = image.metadata
        self.kind: str = image.metadata["sensor"]
        self._count: int = image.metadata["points"]
        self.value = self._light(image.rgb)
        self.standard_error = self._light(image.standard_error)
        self.samples = self._rows(image.counts)
        self.points = self._rows(image.layers["position"])
        self.normals = self._rows(image.layers["normal"])

    def __repr__(self) -> str:
        """Return the summary."""
        return f"<Measurement: {self}>"

    def __str__(self) -> str:
        """Return the kind of light, the number of points, the largest relative error and the range of lux."""
        places = plural(self._count, "point")
        known = f"{self.kind} at {places}, estimated error {self.metadata['noise']:.2%} at most"
        if LUX not in self.image.layers:
            return known
        least, most = (f"{x:.0f}" if x >= 1e3 else f"{x:.3g}" for x in (self.lux.min(), self.lux.max()))
        return f"{known}, {least} to {most} {PHOTOMETRIC[self.kind][1]}"

    def _rows(self, values: Any) -> NDArray[Any]:
        """Return the values of pixels (rows, columns, ...) as those of the points (n, ...)."""
        return np.ascontiguousarray(values.reshape(-1, *values.shape[2:])[: self._count])

    def _light(self, values: Any) -> NDArray[np.float32]:
        """Return the light (n, 3) in pixels (rows, columns, 3), as power where the sensors are surfaces."""
        scale = self.image.layers.get("scale")
        return self._rows(values if scale is None else (values * scale[..., None]).astype(np.float32))

    @suggests_keywords
    def interval(self, confidence: float = 0.95) -> tuple[Doubles, Doubles]:
        """Return the confidence interval of each value: lower and upper limits, (n, 3) each.

        The limits are those of gamma distributions, since sums of few samples are skewed, and of an error
        that includes what those samples may have missed, so they are wider than two standard errors; the
        upper one the more. Light that only smooth surfaces and very narrow reflections can find, such as a
        caustic, widens the upper limit until samples are so many that it is hardly missed. Formulas and
        sources are in `wavefront/statistics/limits.py`, what was found is in docs/measuring.md.

        Parameters
        ----------
        confidence
            The probability that it contains the true value, above 0 and below 1. `reliable` says where that
            can be trusted.

        Raises
        ------
        SceneError
            If the confidence is out of range.
        """
        confidence = number("interval: confidence", confidence, lambda x: 0 < x < 1, "above 0 and below 1")
        mean, variance, freedom = self._moderated()
        event = event_of(mean, variance)
        event = np.maximum(event, self._near(event, mean > 0))
        low, high = light_limits(mean, variance, freedom, event, confidence)
        return self._scaled(low), self._scaled(high + self._unseen(confidence))

    @property
    def reliable(self) -> NDArray[np.bool_]:
        """(n,) whether an interval can be trusted: enough of the light was met, at the point and near it.

        It is where the relative error is at most 25 %, light that smooth surfaces and narrow reflections may
        bring unseen is at most a tenth of the value at 95 %, and samples of the sixteen points that lie
        nearest scatter by at most a quarter of √n in the mean, relative to their values. False for fewer
        than two samples, for points without light, and for files of versions that did not record narrow
        reflections.

        Examples
        --------
        >>> lamp = wf.Sphere((0, 0, 3), 0.5, emission=2)
        >>> wf.measure([lamp], [(0, 0, 0)], (0, 0, 1), spp=16).reliable
        array([ True])
        """
        mean, variance, _ = self._moderated()
        samples = self.samples[:, None].astype(np.float64)
        lit = np.where(mean > 0, mean, 1)
        with np.errstate(invalid="ignore"):  # of fewer than two samples
            known = np.sqrt(variance) <= SCATTERED * lit
            deviation = np.sqrt(self._rows(self.image.variance).astype(np.float64))
            known &= self._near(deviation / lit / np.sqrt(samples), mean > 0) <= SCATTERED
        known &= self._unseen(0.95) <= DOUBT * mean
        return np.asarray(known.all(1) & (mean > 0).any(1) & (BRIGHTEST in self.metadata))

    def _moderated(self) -> tuple[Doubles, Doubles, Doubles]:
        """Return means, their variances and the degrees of freedom of these, (n, 3) each, in radiance."""
        rows = (self.image.rgb, self.image.variance, self.image.standard_error)
        mean, single, error = (self._rows(array).astype(np.float64) for array in rows)
        samples = np.broadcast_to(np.maximum(self.samples, 2)[:, None].astype(np.float64), mean.shape)
        freedom = np.broadcast_to(self._rows(self.image.freedom())[:, None], mean.shape)
        return mean, *moderated_variance(samples, mean, single / samples, np.square(error), freedom)

    def _near(self, values: Doubles, lit: Bools) -> Doubles:
        """Return the means (n, 3) of values over those of the sixteen points near each other that are lit."""
        tile = nearby_ranks(self.points.astype(np.float64), self.normals) // MEMBERS
        counted = [np.where(lit, values, 0), lit.astype(np.float64)]
        sums, count = (np.stack([np.bincount(tile, row) for row in channels.T], 1) for channels in counted)
        return (sums / np.maximum(count, 1)).take(tile, 0)

    def _unseen(self, confidence: float) -> Doubles:
        """Return the light (n, 3) that narrow lobes may bring, and that no sample has met, as radiance.

        A point of which no path has met such a lobe may still have as much as those near it.
        """
        narrow = self.image.layers.get(NARROW)
        if narrow is None:
            return np.zeros(self.value.shape)
        lobes = self._rows(narrow).astype(np.float64)[:, None]
        typical = np.maximum(lobes, self._near(lobes, np.ones_like(lobes, np.bool_)))
        chance = rule_of_three(confidence, self.samples)[:, None]
        return np.asarray(chance * typical * np.array(self.metadata[BRIGHTEST]))

    def _scaled(self, values: Doubles) -> Doubles:
        """Return values (n, 3) of pixels as power where the sensors are surfaces."""
        scale = self.image.layers.get("scale")
        return values if scale is None else values * self._rows(scale)[:, None]

    @property
    def direct(self) -> NDArray[np.float32]:
        """(n, 3) the part that comes straight from lights; measure with aovs="direct"."""
        return self.part("direct")[0]

    @property
    def indirect(self) -> NDArray[np.float32]:
        """(n, 3) the part that comes from surfaces; measure with aovs="indirect"."""
        return self.part("indirect")[0]

    def part(self, name: str) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return a part of the light and its standard error, (n, 3) each.

        Parameters
        ----------
        name
            "direct", "indirect", or a group of lights: "light_groups.sun".

        Raises
        ------
        SceneError
            If it was not asked for.
        """
        if name not in self.image.errors:
            names = ", ".join(self.image.errors) or "no part"
            raise SceneError(f"{name!r} was not measured; there is {names}: measure(aovs=...) asks for parts")
        return self._light(self.image.layers[name]), self._light(self.image.errors[name])

    def merge(self, other: Measurement) -> Measurement:
        """Return the measurement of the samples of both, which `measure(samples=...)` took.

        Parameters
        ----------
        other
            A measurement of other samples of the same points.

        Raises
        ------
        SceneError
            As `Image.merge`.
        """
        return Measurement(self.image.merge(other.image))

    @property
    def lux(self) -> NDArray[np.float32]:
        """(n,) the photometric light: each light by its own efficacy (docs/measuring.md).

        Lux of irradiance and fluence, cd·m⁻² of radiance, lumens of flux.
        """
        return self._photometric.value[:, 0]

    @property
    def lux_error(self) -> NDArray[np.float32]:
        """(n,) standard error of `lux`; NaN for fewer than two samples."""
        return self._photometric.standard_error[:, 0]

    def lux_interval(self, confidence: float = 0.95) -> tuple[Doubles, Doubles]:
        """Return the confidence interval of each `lux`, as `interval`: lower and upper limits, (n,) each."""
        low, high = self._photometric.interval(confidence)
        return low[:, 0], high[:, 0]

    def lux_of(self, kind: str) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the part of `lux` by one kind of light, and its standard error, (n,) each.

        Parameters
        ----------
        kind
            "broadband": lights whose watts are those of a whole spectrum, with less than 179 lm/W, such as a
            sky in W·m⁻²; "visible": all others.

        Raises
        ------
        SceneError
            If there is no such kind.
        """
        column = 1 + KINDS_OF_LIGHT.index(one_of("kind", kind, KINDS_OF_LIGHT))
        photometric = self._photometric
        return photometric.value[:, column], photometric.standard_error[:, column]

    @cached_property
    def _photometric(self) -> Measurement:
        """The measurement whose channels are `lux`, and its parts by the kinds of light."""
        image = self.image
        if LUX not in image.layers:
            raise SceneError("lux is not known: the file was made before measurements kept it")
        layers = {name: image.layers[name] for name in PLACES if name in image.layers}
        metadata = {name: value for name, value in image.metadata.items() if name != BRIGHTEST}
        if BRIGHTEST_LUX in metadata:
            metadata[BRIGHTEST] = metadata[BRIGHTEST_LUX]
        return Measurement(
            Image(
                image.layers[LUX],
                image.spp,
                metadata,
                counts=image.counts,
                variance=image.measured[LUX + VARIANCE],
                standard_error=image.measured[LUX + STANDARD_ERROR],
                layers=layers,
            )
        )

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return arrays (n,) by name, as tables have them: `pandas.DataFrame(found.columns())`.

        They are x, y, z, nx, ny, nz, r, g, b, the standard errors r_error, g_error, b_error, lux, lux_error,
        and samples; for parts that were measured also "direct.r" and so on. Of radiance `lux` is called
        luminance, of flux lumens.
        """
        axes = ("x", "y", "z")
        tables = [(axes, self.points), (tuple(f"n{axis}" for axis in axes), self.normals)]
        tables += [(COLORS, self.value), (tuple(f"{color}_error" for color in COLORS), self.standard_error)]
        if LUX in self.image.layers:
            name = PHOTOMETRIC[self.kind][0]
            tables.append(((name, f"{name}_error"), np.stack([self.lux, self.lux_error], 1)))
        for name in self.image.errors:
            value, error = self.part(name)
            tables.append((tuple(f"{name}.{color}" for color in COLORS), value))
            tables.append((tuple(f"{name}.{color}_error" for color in COLORS), error))
        columns = {
            name: column for names, table in tables for name, column in zip(names, table.T, strict=True)
        }
        return {**columns, "samples": self.samples}

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the measurement by the extension: npz holds all of it, csv the table of `columns`.

        Parameters
        ----------
        path
            Where to write.

        Raises
        ------
        SaveError
            If the file cannot be written.
        """
        if file_kind(path) == ".npz":
            self.image.save(path)
            return
        table = self.columns()
        rows = zip(*(column.astype(str).tolist() for column in table.values()), strict=True)
        lines = (",".join(row) + "\n" for row in ((*table,), *rows))
        write_bytes(path, "".join(lines).encode())

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read an npz file of `save`.

        Parameters
        ----------
        path
            The file.

        Raises
        ------
        SceneError
            If it is missing, damaged, or something else.
        """
        image = Image.load(path)
        try:
            return cls(image)
        except SceneError as error:
            raise SceneError(f"{os.fspath(path)}: {error}") from None

    @suggests_keywords
    def plot(
        self,
        levels: int = 8,
        axes: Any = None,
        label: str | None = None,
        *,
        unit: str = "watts",
        cmap: Any = "viridis",
    ) -> Any:
        """Plot the values with matplotlib: false color and isolines over a plane of points.

        Parameters
        ----------
        levels
            Number of isolines, about.
        axes
            Axes of matplotlib to draw into; by default those of a new figure.
        label
            What the scale of colors says; by default what is measured, and its unit.
        unit
            "watts" for the luminance of the values, 0.2126 R + 0.7152 G + 0.0722 B; "lux" for `lux`.
        cmap
            A colormap of matplotlib, or its name.

        Returns
        -------
        Any
            The axes.

        Raises
        ------
        SceneError
            If the points are on one line, or the unit is unknown.
        ImportError
            If matplotlib is not installed. The message says how to install it.
        """
        from .plot import draw

        return draw(self, levels, axes, label, unit, cmap)


def file_kind(path: str | os.PathLike[str]) -> str:
    """Return the extension of a file to write a measurement to, ".npz" or ".csv".

    Raises
    ------
    SaveError
        If it is another, or the file cannot be written.
    """
    kind = check_target(path).suffix.lower()
    if kind not in (".npz", ".csv"):
        raise SaveError(f"{os.fspath(path)}: a measurement is saved as npz or csv")
    return kind
