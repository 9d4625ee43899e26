"""Points to measure at: grids, and tables in files."""

from __future__ import annotations

import math
import os

import numpy as np
from numpy.typing import ArrayLike

from ..arrays.vec import Doubles
from ..core.errors import SceneError, finite_array, in_brief
from ..core.files import decode_text, read_bytes
from ..core.suggestions import suggests_keywords
from ..settings import whole_number

MOST = 2**24  # points along one side


@suggests_keywords
def grid_points(
    corner: ArrayLike, edge_u: ArrayLike, edge_v: ArrayLike, counts: tuple[int, int] | int
) -> tuple[Doubles, Doubles]:
    """Return points in the middle of the cells of a parallelogram, and its normal at each, (n, 3).

    Parameters
    ----------
    corner, edge_u, edge_v
        (3,) as of `Rectangle`, scene units. The normal is that of edge_u × edge_v.
    counts
        How many cells there are along edge_u and along edge_v; one number for both.

    Raises
    ------
    SceneError
        If an argument is malformed, or the edges are parallel.

    Examples
    --------
    >>> points, normals = wf.grid_points((0, 0, 0.8), (4, 0, 0), (0, 3, 0), (8, 6))
    >>> points.shape, points[0].tolist(), normals[0].tolist()
    ((48, 3), [0.25, 0.25, 0.8], [0.0, 0.0, 1.0])
    """
    start, u, v = (
        finite_array(f"grid_points: {name}", value, (3,))
        for name, value in (("corner", corner), ("edge_u", edge_u), ("edge_v", edge_v))
    )
    pair = tuple(counts) if isinstance(counts, list | tuple | np.ndarray) else (counts, counts)
    if len(pair) != 2:
        raise SceneError(
            f"grid_points: counts is {in_brief(counts)}; it must be two whole numbers, or one for both"
        )
    many, rows = (whole_number(1, MOST)("grid_points: counts", count) for count in pair)
    normal = np.cross(u, v)
    length = np.linalg.norm(normal)
    if not length > 0:
        raise SceneError(f"grid_points: edges {u.tolist()} and {v.tolist()} must not be parallel or zero")
    along, across = (
        (np.arange(rows * many) % many + 0.5) / many,
        (np.arange(rows * many) // many + 0.5) / rows,
    )
    points = start + along[:, None] * u + across[:, None] * v
    return points, np.tile(normal / length, (len(points), 1))


@suggests_keywords
def load_points(path: str | os.PathLike[str]) -> tuple[Doubles, Doubles | None]:
    """Read points, and directions where there are any, (n, 3) each, from a table of numbers.

    A line has x, y, z, or x, y, z and a direction, with commas or spaces between them, as in csv files and in
    the point files of Radiance. A first line of names is left out, and lines that begin with "#".

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    SceneError
        If it cannot be read, or a line is something else. The message names it.

    Examples
    --------
    >>> with open("desk.csv", "w") as file:
    ...     print("x,y,z\\n0,0,0.8\\n1,0,0.8", file=file)
    >>> points, normals = wf.load_points("desk.csv")
    >>> points.tolist(), normals
    ([[0.0, 0.0, 0.8], [1.0, 0.0, 0.8]], None)
    """
    rows: list[list[float]] = []
    for at, line in enumerate(decode_text(read_bytes(path)).splitlines(), 1):
        words = line.replace(",", " ").replace(";", " ").split()
        if not words or words[0].startswith("#"):
            continue
        try:
            rows.append([float(word) for word in words])
        except ValueError:
            if rows or at > 1:
                raise SceneError(
                    f"{os.fspath(path)}: line {at} is {in_brief(line)}; it must be numbers"
                ) from None
            continue
        if len(rows[-1]) not in (3, 6) or len(rows[-1]) != len(rows[0]):
            raise SceneError(
                f"{os.fspath(path)}: line {at} has {len(rows[-1])} numbers; all lines must have 3, or all 6"
            )
        if not all(map(math.isfinite, rows[-1])):
            raise SceneError(f"{os.fspath(path)}: line {at} is {in_brief(line)}; its numbers must be finite")
    if not rows:
        raise SceneError(f"{os.fspath(path)}: has no point")
    table = np.array(rows)
    return table[:, :3], table[:, 3:] if table.shape[1] == 6 else None
