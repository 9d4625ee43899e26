"""The sums of a picture, which checkpoints keep and merging adds up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays.soa import soa
from ..core.errors import SceneError
from .aov_sums import AovSums
from .film import Film
from .identity import CAUSTICS, differences
from .samples import sample_ranges
from .sums import Sums

# errors of values of JSON of another form: a list in place of a number, text in place of a list
MALFORMED = (TypeError, KeyError, AttributeError, IndexError, ValueError, OverflowError, RecursionError)
ADDED = ("seconds", "spp", "samples", "rays", "bad_samples")  # metadata of parts that add up


@soa
class PictureSums(Sums):
    """Sums of the samples of a picture and its AOVs."""

    film: Film
    layers: AovSums | None
    identity: dict[str, Any]  # of the render, see film/identity.py


def empty_sums(size: Sequence[int], layers: Sequence[str] = (), light_tracing: bool = False) -> PictureSums:
    """Return the sums of no samples for a picture of a size (width, height)."""
    width, height = size
    film = Film(width, height, light_tracing)
    return PictureSums(film, AovSums(layers, width * height) if layers else None, {})


def identified_sums(identity: dict[str, Any]) -> PictureSums:
    """Return the sums of no samples for the picture of a render with an identity."""
    sums = empty_sums(identity["size"], identity["aovs"], identity.get(CAUSTICS, False))
    sums.identity = identity
    return sums


def restored_sums(
    name: str, shape: Sequence[int], identity: Any, arrays: Mapping[str, NDArray[Any]]
) -> PictureSums | None:
    """Return the sums of a picture (H, W, 3) in the file `name` from the identity of its render and arrays.

    None if the file has none.

    Raises
    ------
    SceneError
        If they are not those of such a picture.
    """
    if not arrays:
        return None
    try:
        if identity["size"] != [shape[1], shape[0]]:
            raise SceneError(f"they are of a picture of size {identity['size']}")
        sums = identified_sums(identity)
        sums.restore(arrays)
    except (SceneError, *MALFORMED) as error:
        raise SceneError(f"{name}: the sums of its samples are damaged: {error}") from error
    return sums


def merged_sums(a: PictureSums | None, b: PictureSums | None) -> PictureSums:
    """Return the sums of all samples of two pictures of one scene.

    Raises
    ------
    SceneError
        If one has no sums, or its pixels have different numbers of samples, or they are of different
        renders.
    """
    if a is None or b is None:
        raise SceneError(
            "pictures without the sums of their samples cannot be merged: render with samples=range(...) and "
            "save as npz, or merge checkpoints"
        )
    for picture in (a, b):
        _check_counts(picture.film.count)
    changed = differences(a.identity, b.identity)
    if changed:
        raise SceneError(f"pictures of different renders cannot be merged: {', '.join(changed)}")
    merged = deepcopy(a)
    merged.merge(b)
    return merged


def _check_counts(count: NDArray[np.int64]) -> None:
    least, most = int(count.min()), int(count.max())
    if least != most or not most:
        raise SceneError(
            f"a picture whose pixels have {least} to {most} samples cannot be merged: all must have equally "
            "many; finish it first"
        )


def merged_metadata(a: Mapping[str, Any], b: Mapping[str, Any]) -> dict[str, Any]:
    """Return the metadata of the picture of all samples of two others.

    Raises
    ------
    SceneError
        If they share samples.
    """
    ranges = sorted([*sample_ranges(a), *sample_ranges(b)])
    for (_, end), (first, last) in pairwise(ranges):
        if first < end:
            raise SceneError(
                f"pictures that share samples cannot be merged: {first} to {min(end, last) - 1} are in both"
            )
    totals = {name: a[name] + b[name] for name in ADDED}
    return {**a, **totals, "sample_ranges": _joined(ranges)}


def _joined(ranges: list[tuple[int, int]]) -> list[list[int]]:
    """Join ranges of which one ends where the next begins."""
    joined: list[list[int]] = []
    for first, last in ranges:
        if joined and joined[-1][1] == first:
            joined[-1][1] = last
        else:
            joined.append([first, last])
    return joined
