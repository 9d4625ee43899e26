"""Statistics of pictures: the errors of means over pixels, also where pixels depend on each other."""

from .limits import event_of, light_limits, moderated_variance, rule_of_three
from .region import PixelErrors, RegionMean, region_mean
from .scatter import (
    Scatter,
    film_scatter,
    restored_scatter,
    scatter_arrays,
    scatter_of_difference,
    sums_by_label,
)

__all__ = [
    "PixelErrors",
    "RegionMean",
    "Scatter",
    "event_of",
    "film_scatter",
    "light_limits",
    "moderated_variance",
    "region_mean",
    "restored_scatter",
    "rule_of_three",
    "scatter_arrays",
    "scatter_of_difference",
    "sums_by_label",
]
