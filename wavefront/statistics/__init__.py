"""Statistics of pictures: the errors of means over pixels, also where pixels depend on each other."""

from .region import RegionMean, region_mean
from .scatter import (
    Scatter,
    film_scatter,
    restored_scatter,
    scatter_arrays,
    scatter_of_difference,
    sums_by_label,
)

__all__ = [
    "RegionMean",
    "Scatter",
    "film_scatter",
    "region_mean",
    "restored_scatter",
    "scatter_arrays",
    "scatter_of_difference",
    "sums_by_label",
]
