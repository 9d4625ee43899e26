"""A stage of USD as the contents of a file, at one time."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...bsdfs import Diffuse
from ...camera import Camera
from ...camera.projection import Orthographic, Perspective, Projection
from ...core.errors import LimitError, SceneError, hear_warnings, number, passed_limit
from ...lights import Light
from ...materials import Material
from ...scene.loss import Loss
from ...shapes import Shape, Sphere
from ...shapes.transform import Matrix
from ..contents import Contents
from ..conversion import placed
from ..placing import Places
from ..repair import RawMesh
from ..sources import LoadLimits, SceneFiles
from ..xml_checks import MAX_DEPTH
from .child import CHILD, limited_memory
from .gprims import GPRIMS
from .layers import MOST_PRIMS, Layers, said
from .lights import LAMPS, Lamp
from .materials import Materials
from .meshes import Meshes
from .values import is_even, mean_scale, value_of

HEIGHT = 512  # pixels of the picture of a camera
HARMLESS = ("Scope", "Xform", "Material", "Shader", "NodeGraph", "GeomSubset", "RenderSettings", "")


def read_usd(files: SceneFiles, time: float | None = None) -> Contents:
    """Return the contents of a file of USD (.usd, .usda, .usdc, .usdz) at a time code, by default the first.

    It is read by a process of its own.

    Raises
    ------
    SceneError
        If usd-core is not installed, the file is malformed, or beyond a limit.
    """
    name = files.name
    try:
        import pxr  # noqa: F401
    except ImportError as error:
        raise SceneError(f"{name}: files of USD need usd-core: pip install usd-core") from error
    arguments = name, files.search_paths, files.limits, time
    found: _Found = CHILD.call(name, files.limits.seconds, _in_child, *arguments)
    files.losses.take(found.losses)
    if found.error is not None:
        raise found.error
    assert found.contents is not None
    return found.contents


@dataclass
class _Found:
    contents: Contents | None
    error: SceneError | None  # in their place
    losses: tuple[Loss, ...]


def _in_child(name: str, search_paths: tuple[Path, ...], limits: LoadLimits, time: float | None) -> _Found:
    """Return what a file holds, within the limits of its load."""
    from pxr import Pcp, Usd, UsdGeom, UsdLux, UsdShade, UsdUtils  # noqa: F401 (they are not in the limit)

    files = SceneFiles(name, search_paths, limits)
    files.budget.add_file(os.path.getsize(name))
    contents, error = None, None
    with hear_warnings(files.losses.hear), limited_memory(files.budget):
        try:
            contents = _read(files, time)
        except SceneError as wrong:
            message = str(wrong) if str(wrong).startswith(name) else f"{name}: {wrong}"
            error = (LimitError if passed_limit(wrong) else SceneError)(message)
    return _Found(contents, error, files.losses.found)


def _read(files: SceneFiles, time: float | None) -> Contents:
    from pxr import Usd

    try:
        layers = Layers(files)
        layers.check_size()
        stage = Usd.Stage.Open(layers.open[layers.root])
        return _Reader(files, stage, time).contents()
    except (SceneError, MemoryError):
        raise
    except Exception as error:  # of pxr.Tf, and of any type where values are of others than the schema has
        raise SceneError(f"{files.name}: cannot be read: {said(error)}") from error


class _Reader:
    def __init__(self, files: SceneFiles, stage: Any, time: float | None) -> None:
        from pxr import Usd, UsdGeom

        start = stage.GetStartTimeCode() if time is None and stage.HasAuthoredTimeCodeRange() else time
        self.time = Usd.TimeCode.Default() if start is None else Usd.TimeCode(start)
        self.files, self.stage, self.cache = files, stage, UsdGeom.XformCache(self.time)
        self.materials = Materials(files, self.time, self.lose)
        self.meshes = Meshes(self.materials)
        self.raws: list[RawMesh] = []
        self.of_prim: dict[Any, list[int]] = {}
        self.placed: list[tuple[int, Matrix]] = []  # of a mesh, and its places (n, 4, 4)
        self._instancers: dict[str, list[tuple[Any, Matrix]]] = {}
        self._found: dict[str, list[tuple[Any, str, Matrix, bool]]] = {}
        self._sizes: dict[str, int] = {}
        self.shapes: list[Shape] = []
        self.lights: list[Light] = []
        self.camera: Camera | None = None

    def lose(self, prim: Any, what: str) -> None:
        """Note what is not honored."""
        self.files.losses.note(what, str(prim.GetPath()))

    def contents(self) -> Contents:
        """Return what the stage holds."""
        from pxr import UsdGeom

        unit = float(UsdGeom.GetStageMetersPerUnit(self.stage))
        self.unit = number("metersPerUnit", unit, lambda x: x > 0, "above 0")
        for error in self.stage.GetCompositionErrors():
            self.files.losses.note(said(error), "composition")
        self.root = np.diag([self.unit] * 3 + [1.0])  # from the stage to the scene
        self._count(self.stage.GetPseudoRoot(), ())
        self._place(self.stage.GetPseudoRoot(), self.root[None])
        counts = [len(matrices) for _, matrices in self.placed]
        numbers = np.repeat(np.array([index for index, _ in self.placed], np.intp), counts)
        places = Places(numbers, np.concatenate([np.zeros((0, 4, 4)), *(each for _, each in self.placed)]))
        up = str(UsdGeom.GetStageUpAxis(self.stage)).lower()
        return Contents(self.raws, places, self.lights, self.camera, self.shapes, up=up)

    def _count(self, top: Any, above: tuple[str, ...]) -> int:
        """Return how much is placed with a prim, before any is: instancers may place instancers.

        Raises
        ------
        SceneError
            If it is too much, or places itself.
        """
        key = str(top.GetPath())
        if key in above:
            raise SceneError(f"{key}: places itself")
        if len(above) > MAX_DEPTH:
            raise SceneError(f"{key}: is placed by instancers that are nested deeper than {MAX_DEPTH}")
        if key not in self._sizes:
            count = 0
            for prim, kind, *_ in self._leaves(top):
                count += 1
                if kind == "PointInstancer":
                    parts = self._prototypes(prim)
                    count += sum(len(places) * self._count(each, (*above, key)) for each, places in parts)
                if count > self.files.limits.instances:
                    raise LimitError(f"{prim.GetPath()}: is beyond the limit LoadLimits.instances")
            self._sizes[key] = count
        return self._sizes[key]

    def _place(self, top: Any, matrices: Matrix) -> None:
        """Read a prim that stands at several places (n, 4, 4), and all below it."""
        for prim, kind, matrix, resets in self._leaves(top):
            below = np.tile(self.root, (len(matrices), 1, 1)) if resets else matrices
            where = str(prim.GetPath())
            with np.errstate(all="ignore"), placed(where, where):  # what is not finite is refused
                self._read(prim, kind, below @ matrix)

    def _leaves(self, top: Any) -> list[tuple[Any, str, Matrix, bool]]:
        """Return what is to be read of a prim and all below it, found once."""
        key = str(top.GetPath())
        if key not in self._found:
            self._found[key] = self._find_leaves(top)
        return self._found[key]

    def _find_leaves(self, top: Any) -> list[tuple[Any, str, Matrix, bool]]:
        """Return what is to be read of a prim and all below it.

        Each has its type, the matrix to the space around the prim, and whether it is that to the stage.
        """
        from pxr import Usd

        found = []
        waiting, count = [(top, np.eye(4), False)], 0
        while waiting:
            prim, above, resets = waiting.pop()
            count += 1
            if count > MOST_PRIMS:
                raise LimitError(f"{prim.GetPath()}: is beyond the limit of {MOST_PRIMS} prims")
            if self._value(prim, "visibility") == "invisible":
                continue
            if self._value(prim, "purpose") in ("proxy", "guide"):
                continue
            own, alone = self.cache.GetLocalTransformation(prim)
            below = (np.eye(4) if alone else above) @ np.array(own).T
            kind = str(prim.GetTypeName())
            if kind not in HARMLESS:
                found.append((prim, kind, below, alone or resets))
            if kind != "PointInstancer":
                children = prim.GetFilteredChildren(Usd.TraverseInstanceProxies())
                waiting += [(child, below, alone or resets) for child in reversed(children)]
        return found

    def _read(self, prim: Any, kind: str, matrices: Matrix) -> None:
        """Read a prim at each of its places (n, 4, 4)."""
        if kind == "PointInstancer":
            for matrix in matrices:
                self._instancer(prim, matrix)
        elif kind == "Mesh" or (kind in GPRIMS and not self._is_ball(prim, kind, matrices)):
            self.placed += [(index, matrices) for index in self._meshes(prim)]
        elif kind in GPRIMS:
            self.shapes += [self._ball(prim, matrix) for matrix in matrices]
        elif kind in LAMPS:
            lamps = (Lamp(self.materials, prim, matrix, self.unit).light() for matrix in matrices)
            for made in lamps:
                if isinstance(made, Light):
                    self.lights.append(made)
                elif made is not None:
                    self.shapes.append(made)
        elif kind == "Camera":
            self._camera(prim, matrices[0])
        else:
            self.lose(prim, f"a {kind}; left out")

    def _is_ball(self, prim: Any, kind: str, matrices: Matrix) -> bool:
        """Return whether a prim needs no mesh."""
        return kind == "Sphere" and not self.materials.of(prim).primvars and all(map(is_even, matrices))

    def _ball(self, prim: Any, matrix: Matrix) -> Sphere:
        look = self.materials.of(prim)
        color = self.meshes.one_color(prim, "displayColor") if look.material is None else None
        material = look.material if color is None else Material(Diffuse(color))
        radius = float(self._value(prim, "radius", 1.0)) * mean_scale(matrix)
        name = str(prim.GetName())
        return Sphere(matrix[:3, 3], radius, material=material, emission=look.emission, name=name)

    def _value(self, prim: Any, name: str, default: Any = None) -> Any:
        return value_of(prim, self.time, name, default)

    def _instancer(self, prim: Any, matrix: Matrix) -> None:
        for target, found in self._prototypes(prim):
            self._place(target, matrix @ found)

    def _prototypes(self, prim: Any) -> list[tuple[Any, Matrix]]:
        """Return what an instancer places, and where: (n, 4, 4), relative to it."""
        key = str(prim.GetPath())
        if key not in self._instancers:
            self._instancers[key] = list(self._read_prototypes(prim))
        return self._instancers[key]

    def _read_prototypes(self, prim: Any) -> Iterator[tuple[Any, Matrix]]:
        from pxr import UsdGeom

        instancer = UsdGeom.PointInstancer(prim)
        prototypes = instancer.GetPrototypesRel().GetForwardedTargets()
        which = self._value(prim, "protoIndices", [])
        found = instancer.ComputeInstanceTransformsAtTime(
            self.time, self.time, UsdGeom.PointInstancer.ExcludeProtoXform
        )
        if len(found) != len(which):  # by a mask, or as the arrays differ
            mask = np.asarray(instancer.ComputeMaskAtTime(self.time), bool)
            which = np.asarray(which)[mask] if len(mask) == len(which) else which
        which = np.asarray(which, np.intp)
        bad = which[(which < 0) | (which >= len(prototypes))]
        if len(bad):
            raise SceneError(f"{prim.GetPath()}: protoIndices has {bad[0]}; there are {len(prototypes)}")
        if len(which) != len(found):
            raise SceneError(f"{prim.GetPath()}: has {len(which)} protoIndices and {len(found)} positions")
        matrices = np.array(found, float).reshape(-1, 4, 4).transpose(0, 2, 1)
        for index in np.unique(which).tolist():
            target = self.stage.GetPrimAtPath(prototypes[index])
            if not target or prim.GetPath().HasPrefix(target.GetPath()):
                raise SceneError(f"{prim.GetPath()}: its prototype {prototypes[index]} cannot be placed")
            yield target, matrices[which == index]

    def _meshes(self, prim: Any) -> list[int]:
        """Return the numbers of the meshes of a prim, one for each material; instances share them.

        Instances of one prototype may have several materials, by what is bound above them.
        """
        path = prim.GetPrimInPrototype().GetPath() if prim.IsInstanceProxy() else prim.GetPath()
        key = path, id(self.materials.of(prim))
        if key not in self.of_prim:
            first = len(self.raws)
            with np.errstate(all="ignore"):
                self.raws += self.meshes.of(prim)
            self.of_prim[key] = list(range(first, len(self.raws)))
        return self.of_prim[key]

    def _camera(self, prim: Any, matrix: Matrix) -> None:
        if self.camera is not None:
            return
        across, high = (
            float(self._value(prim, f"{name}Aperture", usual))
            for name, usual in (("horizontal", 20.955), ("vertical", 15.2908))
        )
        focal = float(self._value(prim, "focalLength", 50.0))
        if not (across > 0 and high > 0 and focal > 0 and across < 100 * high):
            raise SceneError(f"{prim.GetPath()}: its apertures and focalLength must be above 0")
        for name in ("horizontalApertureOffset", "verticalApertureOffset"):
            if self._value(prim, name, 0.0):
                self.lose(prim, name)
        lens: Projection
        if self._value(prim, "projection", "perspective") == "orthographic":
            lens = Orthographic(high / 10 * self.unit)  # apertures are in tenths of units
        else:
            stop, focus = (float(self._value(prim, name, 0.0)) for name in ("fStop", "focusDistance"))
            opened = stop > 0 and focus > 0
            lens = Perspective(
                math.degrees(2 * math.atan(high / (2 * focal))),
                aperture=focal / 10 / stop * self.unit if opened else 0.0,
                focus=focus * self.unit if opened else None,
            )
        axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
        size = (max(round(HEIGHT * across / high), 1), HEIGHT)
        self.camera = Camera(matrix[:3, 3], axes, lens, size)
