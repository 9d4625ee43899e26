"""Colors and opacities of instances, which their placements have and their meshes do not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from ...arrays.vec import Ints
from ...core.plural import plural

Tint: TypeAlias = dict[str, tuple[float, ...]]  # values by the names of primvars
DISPLAYED = {"displayColor": 3, "displayOpacity": 1}  # primvars that are read without a material


def outside(prim: Any, name: str, time: Any) -> tuple[float, ...] | None:
    """Return the value of a primvar that an instance inherits from above its prototype; None without one."""
    from pxr import UsdGeom

    if not prim.IsInstanceProxy():
        return None
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    if not primvar or primvar.GetAttr().GetPrim().IsInstanceProxy():
        return None
    values = np.asarray(primvar.ComputeFlattened(time), float)
    return tuple(np.ravel(values[0]).tolist()) if values.ndim and len(values) else None


def has_own(prim: Any, name: str) -> bool:
    """Return whether a prim has a primvar, perhaps from above."""
    from pxr import UsdGeom

    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    return bool(primvar) and primvar.HasValue()


def grouped(
    prim: Any, time: Any, count: int, shown: Ints, lose: Callable[..., None]
) -> list[tuple[Tint, Ints]]:
    """Return groups of instances of an instancer that look alike: their tint, and their numbers.

    Parameters
    ----------
    prim, time
        The instancer, and when.
    count
        How many instances it has.
    shown
        Numbers (n,) of those that are shown; the results are places in it.
    lose
        Takes the prim, what of it is not honored, and what is done.
    """
    from pxr import UsdGeom

    names, columns = [], []
    for name, width in DISPLAYED.items():
        primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar(name)
        values = primvar.ComputeFlattened(time) if primvar and primvar.HasValue() else None
        if values is None:
            continue
        table = np.asarray(values, float).reshape(len(values), -1)[:, :width]
        if table.shape != (count, width) and table.shape != (1, width):
            lose(
                prim, f"{name} has {plural(len(table), 'value')} for {plural(count, 'instance')}", "left out"
            )
            continue
        names.append(name)
        columns.append(np.broadcast_to(table, (count, width))[shown])
    if not names:
        return [({}, np.arange(len(shown)))]
    rows, group = np.unique(np.hstack(columns), axis=0, return_inverse=True)
    order = np.argsort(group.ravel(), kind="stable")
    groups = np.split(order, np.cumsum(np.bincount(group.ravel()))[:-1])
    return [(_named(names, row), members) for row, members in zip(rows.tolist(), groups, strict=True)]


def _named(names: list[str], row: list[float]) -> Tint:
    tint: Tint = {}
    for name in names:
        tint[name], row = tuple(row[: DISPLAYED[name]]), row[DISPLAYED[name] :]
    return tint
