"""The mean of a region of a picture, and its error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays.vec import Bools, Doubles, Floats
from ..core.errors import SceneError, number
from ..core.suggestions import suggests_keywords
from .scatter import Scatter, sums_by_label
from .student_t import t_quantile


@dataclass(frozen=True, slots=True)
class RegionMean:
    """The mean of the pixels of a region, from `Image.mean`.

    Examples
    --------
    >>> image = wf.render([wf.Sphere((0, 0, 0), 1), wf.PointLight((3, 3, 3), 90)], spp=16, size=(24, 24))
    >>> middle = image.mean((slice(8, 16), slice(8, 16)))
    >>> isinstance(middle, wf.RegionMean), middle.pixels
    (True, 64)
    >>> low, high = middle.interval(0.95)
    >>> bool((low < middle.value).all() and (middle.value < high).all())
    True
    """

    value: Doubles  # (3,) mean of each channel, linear radiance
    standard_error: Doubles | None  # (3,) of `value`; None where it is not known
    freedom: Doubles | None  # (3,) degrees of freedom with which `standard_error` is known
    pixels: int  # in the region
    error_absent: str = ""  # the reason why there is no standard error

    @suggests_keywords
    def interval(self, confidence: float = 0.95) -> tuple[Doubles, Doubles]:
        """Return the confidence interval of the converged mean: lower and upper limit, (3,) each.

        It is that of Student's t distribution.

        Parameters
        ----------
        confidence
            The probability that it contains the converged mean, above 0 and below 1.

        Raises
        ------
        SceneError
            If the confidence is out of range, or the standard error is not known.
        """
        confidence = number("interval: confidence", confidence, lambda x: 0 < x < 1, "above 0 and below 1")
        if self.standard_error is None or self.freedom is None:
            raise SceneError(f"interval: the error is not known: {self.error_absent}")
        away = t_quantile(confidence, self.freedom) * self.standard_error
        return self.value - away, self.value + away


def region_mean(
    rgb: Floats,
    region: Bools,
    standard_error: Floats | None,
    freedom: Doubles,
    scatter: Sequence[Scatter],
    error_absent: str,
) -> RegionMean:
    """Return the mean of the pixels `region` (H, W) of a picture (H, W, 3).

    Parameters
    ----------
    standard_error, freedom, scatter
        As for `sums_by_label`.
    error_absent
        The reason why the error is not known, or nothing.
    """
    pixels = int(np.count_nonzero(region))
    value = rgb[region].mean(0, dtype=np.float64)
    if error_absent or standard_error is None:
        return RegionMean(value, None, None, pixels, error_absent)
    label = np.where(region, 0, -1)
    variance, spread = sums_by_label(standard_error, freedom, scatter, label, 1)
    known = spread > 0
    found = np.square(variance) / np.where(known, spread, 1)
    least = float(freedom[region].min())
    return RegionMean(
        value, np.sqrt(variance[0]) / pixels, np.where(known, np.maximum(found, 1), least)[0], pixels
    )
