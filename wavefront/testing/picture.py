"""A check that a picture is as before, up to noise."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from ..core.errors import SceneError, number
from ..core.suggestions import suggests_keywords
from ..film.aov_names import BEFORE_DENOISING
from ..image import Image
from ..image.comparison import Comparison, compare

LIMIT = 1e-3  # p-value: the part of alarms among pictures that differ by noise alone
SIDE = 32  # pixels along the side of the part that a message names


@suggests_keywords
def assert_same_picture(
    a: Image | str | os.PathLike[str], b: Image | str | os.PathLike[str], *, p: float = LIMIT
) -> Comparison:
    """Check that two renders show the same picture, up to the noise of both.

    Their samples are compared, as by `wf.compare`. Of a denoised picture it is the noisy one: what a denoiser
    makes of noise has no known error.

    Parameters
    ----------
    a, b
        The picture, and the reference: rendered images, or paths of .npz or .exr files of such.
    p
        The p-value below which they differ: as often as that there is an alarm of noise alone.

    Returns
    -------
    Comparison
        All measures; `print` it.

    Raises
    ------
    AssertionError
        If noise hardly explains the difference. The message has all measures, and the place of the most.
    SceneError
        If one of them has no samples to compare: no standard error, or only one sample in a pixel.

    Examples
    --------
    >>> scene = [wf.Sphere((0, 0, 0), 1), wf.Environment(1)]
    >>> wf.render(scene, 16, size=(32, 24)).save("ball.npz")
    >>> comparison = wf.testing.assert_same_picture(wf.render(scene, 16, size=(32, 24)), "ball.npz")
    >>> comparison.p_value
    1.0
    """
    limit = number("p", p, lambda x: 0 < x < 1, "above 0 and below 1")
    samples = _samples(a), _samples(b)
    comparison = compare(*samples)
    if comparison.p_value is None:
        raise SceneError(f"the pictures cannot be compared by their samples: {comparison.p_absent}")
    if comparison.p_value < limit:
        denoised = any(image.metadata.get(BEFORE_DENOISING) for image in samples if isinstance(image, Image))
        what = "samples of the pictures, before denoising," if denoised else "pictures"
        raise AssertionError(
            f"the {what} differ by more than noise, most at {_most(comparison)}:\n{comparison}"
        )
    return comparison


def _samples(picture: Any) -> Any:
    """Return a picture, read if it is a path, before it was denoised."""
    if isinstance(picture, str | os.PathLike):
        picture = Image.load(picture)
    noisy = picture.noisy if isinstance(picture, Image) else None
    return picture if noisy is None else noisy


def _most(comparison: Comparison) -> str:
    """Return the part of the picture whose mean differs most."""
    sums = np.asarray(comparison.difference.rgb, np.float64).sum(2)
    height, width = sums.shape
    for axis in (0, 1):
        sums = np.add.reduceat(sums, np.arange(0, sums.shape[axis], SIDE), axis=axis)
    row, column = (int(at) * SIDE for at in np.unravel_index(sums.argmax(), sums.shape))
    return f"x={column} to {min(column + SIDE, width) - 1}, y={row} to {min(row + SIDE, height) - 1}"
