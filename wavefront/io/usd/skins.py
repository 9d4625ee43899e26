"""Meshes with skeletons and blend shapes, in the pose of one time, as UsdSkel computes it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

POSED = ("SkelRoot", "Skeleton", "SkelAnimation", "BlendShape")  # types of prims that this reads


def pose(stage: Any, time: Any, part: Callable[[Any, str], AbstractContextManager[None]]) -> None:
    """Give meshes below skeletons the points and normals of their pose, in the session layer of a stage.

    Parameters
    ----------
    stage, time
        What is posed, and when.
    part
        Takes a prim and what is done without it, and notes errors of a block.
    """
    from pxr import Gf, Usd, UsdSkel

    when = Gf.Interval(0 if time.IsDefault() else time.GetValue())
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        roots = _roots(stage) if _has_roots(stage) else []
        if roots and not time.IsDefault():
            _stop(stage, time)
        for prim in roots:
            with part(prim, "its skins and blend shapes are left as they are stored"):
                if not UsdSkel.BakeSkinning(UsdSkel.Root(prim), when):
                    raise ValueError("its skins cannot be posed")


def _stop(stage: Any, time: Any) -> None:
    """Replace animations by their values at a time, which need not be one of their samples."""
    for prim in stage.Traverse():
        if str(prim.GetTypeName()) == "SkelAnimation":
            for attribute in prim.GetAuthoredAttributes():
                if attribute.ValueMightBeTimeVarying():
                    attribute.Set(attribute.Get(time), time)


def _has_roots(stage: Any) -> bool:
    """Return whether there are skeletons, also in prototypes of instances, which are looked at once."""
    from pxr import Usd

    ranges = [stage.Traverse(), *(Usd.PrimRange(each) for each in stage.GetPrototypes())]
    return any(str(prim.GetTypeName()) == "SkelRoot" for each in ranges for prim in each)


def _roots(stage: Any) -> list[Any]:
    """Return the prims below which meshes have skeletons; those in instances no longer share their meshes."""
    from pxr import Usd

    found = []
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        if str(prim.GetTypeName()) != "SkelRoot":
            continue
        found.append(prim.GetPath())
        above = prim
        while above.IsInstanceProxy():
            above = above.GetParent()
        if above.IsInstance():
            above.SetInstanceable(False)
            return _roots(stage)
    return [stage.GetPrimAtPath(path) for path in found]
