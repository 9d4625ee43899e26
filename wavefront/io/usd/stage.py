"""A stage of USD as the contents of a file, at one time."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from ...bsdfs import Diffuse
from ...camera import Camera
from ...camera.projection import Orthographic, Perspective, Projection
from ...core.errors import LimitError, SceneError, number
from ...lights import Light
from ...materials import Material
from ...shapes import Shape, Sphere
from ...shapes.transform import Matrix
from ..contents import Contents
from ..conversion import placed
from ..placing import Places
from ..repair import RawMesh
from ..sources import SceneFiles
from .gprims import GPRIMS
from .lights import LAMPS, Lamp
from .materials import Materials
from .meshes import Meshes
from .values import is_even, mean_scale, value_of

HEIGHT = 512  # pixels of the picture of a camera
MOST_PRIMS = 2**20
HARMLESS = ("Scope", "Xform", "Material", "Shader", "NodeGraph", "GeomSubset", "RenderSettings", "")


def read_usd(files: SceneFiles, time: float | None = None) -> Contents:
    """Return the contents of a file of USD (.usd, .usda, .usdc, .usdz) at a time code, by default the first.

    Raises
    ------
    SceneError
        If usd-core is not installed, the file is malformed, or it refers to files elsewhere.
    """
    name = files.name
    try:
        from pxr import Sdf, Usd
    except ImportError as error:
        raise SceneError(f"{name}: files of USD need usd-core: pip install usd-core") from error
    try:
        known = Sdf.Layer.Find(os.path.abspath(name))
        stage = Usd.Stage.Open(os.path.abspath(name))
        for layer in stage.GetUsedLayers() if known else ():  # its files may have changed since
            layer.Reload(force=True)
        _check_layers(files, stage)
        return _Reader(files, stage, time).contents()
    except SceneError as error:
        raise error if str(error).startswith(name) else SceneError(f"{name}: {error}") from error
    except (RuntimeError, TypeError, ValueError, IndexError) as error:  # also those of pxr.Tf
        raise SceneError(f"{name}: cannot be read: {' '.join(str(error).split())[:300]}") from error


def _check_layers(files: SceneFiles, stage: Any) -> None:
    """Check that all layers are in the folders that the scene may read."""
    roots = [Path(files.name).resolve().parent, *(each.resolve() for each in files.search_paths)]
    for layer in stage.GetUsedLayers():
        path = layer.realPath.partition("[")[0]
        if path and not any(Path(path).resolve().is_relative_to(root) for root in roots):
            raise SceneError(f"refers to {path}, which is outside its folder and the search paths")


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
        self.placements = 0
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
            self.files.losses.note(" ".join(str(error).split())[:200], "composition")
        self.root = np.diag([self.unit] * 3 + [1.0])  # from the stage to the scene
        self._place(self.stage.GetPseudoRoot(), self.root[None])
        counts = [len(matrices) for _, matrices in self.placed]
        numbers = np.repeat(np.array([index for index, _ in self.placed], np.intp), counts)
        places = Places(numbers, np.concatenate([np.zeros((0, 4, 4)), *(each for _, each in self.placed)]))
        up = str(UsdGeom.GetStageUpAxis(self.stage)).lower()
        return Contents(self.raws, places, self.lights, self.camera, self.shapes, up=up)

    def _place(self, top: Any, matrices: Matrix) -> None:
        """Read a prim that stands at several places (n, 4, 4), and all below it."""
        for prim, kind, matrix, resets in self._leaves(top):
            below = np.tile(self.root, (len(matrices), 1, 1)) if resets else matrices
            where = str(prim.GetPath())
            self.placements += len(matrices)
            if self.placements > self.files.limits.instances:
                raise LimitError(f"{where}: is beyond the limit LoadLimits.instances")
            with np.errstate(all="ignore"), placed(where, where):  # what is not finite is refused
                self._read(prim, kind, below @ matrix)

    def _leaves(self, top: Any) -> list[tuple[Any, str, Matrix, bool]]:
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
        matrices = matrix @ np.array(found, float).reshape(-1, 4, 4).transpose(0, 2, 1)
        for index in np.unique(which).tolist():
            target = self.stage.GetPrimAtPath(prototypes[index])
            if not target or prim.GetPath().HasPrefix(target.GetPath()):
                raise SceneError(f"{prim.GetPath()}: its prototype {prototypes[index]} cannot be placed")
            self._place(target, matrices[which == index])

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
