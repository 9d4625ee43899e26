"""The ranges of the samples of a picture, and those that two pictures share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def sample_ranges(metadata: Mapping[str, Any]) -> list[tuple[int, int]]:
    """Return the ranges [first, last) of the samples of each pixel, from the metadata of a picture.

    Without `sample_ranges` in the metadata they are those of one render, from 0 to its samples per pixel.
    """
    if "sample_ranges" in metadata:
        return [(int(first), int(last)) for first, last in metadata["sample_ranges"]]
    return [(0, max(1, round(metadata.get("spp", 1))))]


def shared_samples(a: Mapping[str, Any], b: Mapping[str, Any]) -> tuple[int, int] | None:
    """Return a range [first, last) of samples that two pictures share, by their metadata; None for none.

    Pictures share samples if their seeds and samplers are the same and their sample ranges overlap. Their
    errors then depend on each other. Pictures without a seed in their metadata count as independent.
    """
    for name in ("seed", "sampler"):
        if name not in a or a[name] != b.get(name):
            return None
    for first_a, last_a in sample_ranges(a):
        for first_b, last_b in sample_ranges(b):
            first, last = max(first_a, first_b), min(last_a, last_b)
            if first < last:
                return first, last
    return None
