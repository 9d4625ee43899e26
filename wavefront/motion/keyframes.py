"""Motions by keys: translation, rotation and stretch, each over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import Doubles
from ..core.errors import SceneError, as_array, finite_array
from ..core.plural import plural
from ..core.suggestions import suggests_keywords
from .motion import Motion
from .quaternions import determinants, polar, quaternions_of, rotation_of
from .track import Track

AT_ONCE = 1 << 12  # matrices that are composed at once, so that temporary arrays fit the cache
SINGULAR = 1e-12  # least scale of a matrix along an axis, relative to the greatest


def rising(name: str, values: ArrayLike, least: int = 1) -> Doubles:
    """Return times (n,), seconds, each after the one before.

    Raises
    ------
    SceneError
        If they are malformed, fewer than `least`, or do not rise.
    """
    keys = finite_array(name, values, (None,))
    if len(keys) < least:
        raise SceneError(f"{name} has {plural(len(keys), 'time')}; it must have at least {least}")
    late = np.flatnonzero(np.diff(keys) <= 0)
    if late.size:
        at = int(late[0])
        raise SceneError(
            f"{name}[{at + 1}] is {keys[at + 1]:g}, after {name}[{at}] = {keys[at]:g}; times must rise"
        )
    return keys


class Trs(Motion):
    """Translation · rotation · scale, each of them given over time.

    Parameters
    ----------
    translation
        (k, 3) over time.
    rotation
        Quaternions (k, 4) over time.
    scale
        (k, 3) factors along the axes, or (k, 3, 3) matrices, over time.
    """

    def __init__(self, translation: Track, rotation: Track, scale: Track) -> None:
        self.translation, self.rotation, self.scale = translation, rotation, scale
        # a track of one key is a constant, and says nothing of when the motion is
        tracks = [each for each in self.tracks if len(each.times) > 1] or list(self.tracks)
        self.start, self.end = min(each.start for each in tracks), max(each.end for each in tracks)

    @property
    def tracks(self) -> tuple[Track, Track, Track]:
        """Translation, rotation and scale."""
        return self.translation, self.rotation, self.scale

    @property
    def keys(self) -> Doubles:
        """The times of all keys."""
        return np.unique(np.concatenate([track.times for track in self.tracks]))

    def at_times(self, times: Doubles) -> Doubles:
        """Return the matrices (n, 4, 4) at times (n,)."""
        moments = np.asarray(times, np.float64)
        return composed(*(track.at_times(moments) for track in self.tracks))


def composed(translation: Doubles, rotation: Doubles, scale: Doubles) -> Doubles:
    """Return matrices (n, 4, 4): translation (n, 3) · quaternion (n, 4) · scale (n, 3) or (n, 3, 3)."""
    matrix = np.empty((len(translation), 4, 4))
    for begin in range(0, len(matrix), AT_ONCE):
        some = slice(begin, begin + AT_ONCE)
        _compose(matrix[some], translation[some], rotation[some], scale[some])
    return matrix


def _compose(matrix: Doubles, translation: Doubles, rotation: Doubles, scale: Doubles) -> None:
    """Write what `composed` returns."""
    turn = np.ascontiguousarray(rotation_of(rotation).transpose(1, 2, 0))
    factors = np.ascontiguousarray(np.moveaxis(scale, 0, -1))
    with np.errstate(over="ignore", invalid="ignore"):
        for i in range(3):  # element by element, each contiguous over the matrices
            for j in range(3):
                matrix[:, i, j] = turn[i, j] * factors[j] if scale.ndim == 2 else _row(turn[i], factors[:, j])
    matrix[:, :3, 3] = translation
    matrix[:, 3] = 0, 0, 0, 1


def _row(a: Doubles, b: Doubles) -> Doubles:
    """Return the sums (n,) of products of rows (3, n), in order."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


class Keyframes(Trs):
    """A motion by affine matrices at certain times, wherever a transform is taken.

    Between them translation and stretch change linearly, and the rotation turns evenly the shorter way
    (slerp). These are the parts of the polar decomposition: shear belongs to the stretch, and a mirror stays
    one.

    Parameters
    ----------
    times
        (k,) seconds, rising. Before the first and after the last, their matrices hold.
    matrices
        (k, 4, 4) affine matrices, for column vectors; or (k, 3) translations.

    Raises
    ------
    SceneError
        If an argument is malformed, the times do not rise, a matrix is singular, or one mirrors and the next
        one does not.

    Notes
    -----
    A turn by 180° or more between two keys goes the shorter way: give keys between them.

    Source of the polar decomposition: K. Shoemake and T. Duff, "Matrix Animation and Polar Decomposition",
    Graphics Interface 1992.

    Examples
    --------
    >>> slide = wf.Keyframes([0, 1], [(0, 0, 0), (2, 0, 0)])
    >>> slide.at(0.25)[:3, 3].tolist()
    [0.5, 0.0, 0.0]
    >>> scene = wf.Scene([wf.Sphere((0, 0, 0), 1).transformed(slide), wf.Plane((0, -1, 0), (0, 1, 0))])
    >>> scene.at(0.5).shapes[0].center.tolist(), scene.duration
    ([1.0, 0.0, 0.0], 1.0)
    """

    @suggests_keywords
    def __init__(self, times: ArrayLike, matrices: ArrayLike) -> None:
        keys = rising("Keyframes times", times)
        given = _matrices("Keyframes matrices", matrices)
        if len(given) != len(keys):
            raise SceneError(f"Keyframes has {plural(len(keys), 'time')} and {len(given)} matrices")
        _check("Keyframes matrices", given)
        rotation, stretch = polar(given[:, :3, :3])
        self.times, self.matrices = keys, given
        turns = Track(keys, quaternions_of(rotation), turns=True)
        super().__init__(Track(keys, given[:, :3, 3]), turns, Track(keys, stretch))

    def __repr__(self) -> str:
        """Return the number of keys, and the times of the first and the last."""
        return f"<Keyframes: {plural(len(self.times), 'key')} from {self.start:g} to {self.end:g} s>"


def _matrices(name: str, given: ArrayLike) -> Doubles:
    """Return matrices (k, 4, 4), which may be given as translations (k, 3)."""
    values = as_array(name, given)
    if values.ndim != 2 or values.shape[1] != 3:
        return finite_array(name, given, (None, 4, 4))
    matrices = np.tile(np.eye(4), (len(values), 1, 1))
    matrices[:, :3, 3] = finite_array(name, given, (None, 3))
    return matrices


def _check(name: str, matrices: Doubles) -> None:
    """Raise a SceneError if a matrix (n, 4, 4) is not affine, is singular, or alone mirrors."""
    bad = np.flatnonzero((matrices[:, 3] != (0, 0, 0, 1)).any(1))
    if bad.size:
        at = int(bad[0])
        raise SceneError(f"{name}[{at}] has the last row {matrices[at, 3].tolist()}; it must be [0, 0, 0, 1]")
    scales = np.linalg.svd(matrices[:, :3, :3], compute_uv=False)
    bad = np.flatnonzero(~(scales[:, 2] > SINGULAR * scales[:, 0]))
    if bad.size:
        most, _, least = scales[bad[0]]
        raise SceneError(
            f"{name}[{bad[0]}] is singular: it stretches by {least:.3g} along one axis and {most:.3g} along "
            f"another; their ratio must be above {SINGULAR:g}"
        )
    mirrors = determinants(matrices[:, :3, :3] / scales[:, :1, None]) < 0
    bad = np.flatnonzero(mirrors[1:] != mirrors[:-1])
    if bad.size:
        raise SceneError(
            f"{name}[{bad[0]}] and [{bad[0] + 1}]: one mirrors and the other does not; in between it would "
            "be singular"
        )
