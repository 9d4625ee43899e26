"""A stage of USD as the contents of a file, at one time."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...camera import Camera
from ...camera.projection import Orthographic, Perspective, Projection
from ...core.errors import LimitError, SceneError, hear_warnings, passed_limit
from ...lights import Light
from ...materials import Material
from ...scene.loss import NOT_HONORED, Loss
from ...shapes import Shape, Sphere
from ...shapes.transform import Matrix
from ..description.contents import Contents
from ..description.conversion import placed
from ..description.placing import Places, in_range, meters
from ..losses import Losses
from ..repair import RawMesh
from ..sources import LoadLimits, SceneFiles
from ..xml_checks import MAX_DEPTH
from .child import CHILD, limited_memory
from .gprims import GPRIMS
from .layers import MOST_PRIMS, Layers, said, typed
from .lights import LAMPS, Lamp, is_light, light_up
from .materials import OPACITY, Materials
from .meshes import Meshes
from .skins import POSED, pose
from .tints import DISPLAYED, Tint, grouped, has_own, outside
from .values import is_even, mean_scale, value_of

HEIGHT = 512  # pixels of the picture of a camera
HARMLESS = ("Scope", "Xform", "Material", "Shader", "NodeGraph", "GeomSubset", "RenderSettings", "", *POSED)


def read_usd(files: SceneFiles, time: float | None = None) -> Contents:
    """Return the contents of a file of USD (.usd, .usda, .usdc, .usdz) at a time, s; by default the first.

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
    reply: _Found = CHILD.call(name, files.limits.seconds, _in_child, *arguments)
    files.losses.take(reply.losses, reply.notices)
    if reply.error is not None:
        raise reply.error
    assert reply.contents is not None
    return reply.contents


@dataclass
class _Found:
    contents: Contents | None
    error: SceneError | None  # in their place
    losses: tuple[Loss, ...]
    notices: tuple[Loss, ...]


def _in_child(name: str, search_paths: tuple[Path, ...], limits: LoadLimits, time: float | None) -> _Found:
    """Return the contents of a file, within the limits of its load."""
    from pxr import Pcp, Usd, UsdGeom, UsdLux, UsdShade, UsdSkel, UsdUtils  # noqa: F401 (they are not in the limit)

    files = SceneFiles(name, search_paths, limits)
    files.budget.add_file(os.path.getsize(name))
    contents, error = None, None
    with hear_warnings(files.losses.hear), limited_memory(files.budget):
        try:
            contents = _read(files, time)
        except SceneError as wrong:
            message = str(wrong) if str(wrong).startswith(name) else f"{name}: {wrong}"
            error = (LimitError if passed_limit(wrong) else SceneError)(message)
    return _Found(contents, error, files.losses.found, files.losses.notices)


@contextmanager
def _heard(losses: Losses) -> Iterator[None]:
    """Note the messages of usd-core, but for errors of composition, which the stage has."""
    from pxr import UsdUtils

    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    yield
    for diagnostic in delegate.TakeUncoalescedDiagnostics():
        with suppress(UnicodeDecodeError):
            if "_ReportErrors" not in diagnostic.sourceFunction:
                losses.note(said(diagnostic.commentary), "usd-core", done="")


def _read(files: SceneFiles, time: float | None) -> Contents:
    from pxr import Usd

    with typed(f"{files.name}: cannot be read"):
        layers = Layers(files)
        layers.check_size()
        with _heard(files.losses):
            stage = Usd.Stage.Open(layers.open[layers.root])
            return _Reader(files, stage, time).contents()


@dataclass
class _Prototype:
    """A prototype of an instancer, with its places."""

    prim: Any
    matrices: Matrix  # (n, 4, 4) relative to the instancer
    tint: Tint


def _time_codes(stage: Any) -> tuple[float, float] | None:
    """Return the first and the last time code of a stage; None where nothing changes."""
    from pxr import Usd

    ranges = [stage.Traverse(), *(Usd.PrimRange(prototype) for prototype in stage.GetPrototypes())]
    varying = [
        attribute
        for prims in ranges
        for prim in prims
        for attribute in prim.GetAuthoredAttributes()
        if attribute.ValueMightBeTimeVarying()
    ]
    if not varying:
        return None
    if stage.HasAuthoredTimeCodeRange():
        return stage.GetStartTimeCode(), stage.GetEndTimeCode()
    samples = [code for attribute in varying for code in attribute.GetTimeSamples()]
    return (min(samples), max(samples)) if samples else None


class _Reader:
    def __init__(self, files: SceneFiles, stage: Any, time: float | None) -> None:
        from pxr import Usd, UsdGeom

        self.rate = stage.GetTimeCodesPerSecond() or 24.0
        self.codes = _time_codes(stage)
        start = None if time is None else time * self.rate
        if start is None and stage.HasAuthoredTimeCodeRange():
            start = stage.GetStartTimeCode()
        elif start is None and self.codes is not None:
            start = self.codes[0]
        self.time = Usd.TimeCode.Default() if start is None else Usd.TimeCode(start)
        self.files, self.stage, self.cache = files, stage, UsdGeom.XformCache(self.time)
        self.materials = Materials(files, self.time, self.lose)
        self.meshes = Meshes(self.materials)
        self.raws: list[RawMesh] = []
        self.of_prim: dict[Any, list[tuple[int, Any]]] = {}
        self.placed: list[tuple[int, Matrix, Material | None]] = []  # of a mesh, and its places (n, 4, 4)
        self._instancers: dict[str, list[_Prototype]] = {}
        self._found: dict[str, list[tuple[Any, str, Matrix, bool]]] = {}
        self._sizes: dict[str, int] = {}
        self.shapes: list[Shape] = []
        self.lights: list[Light] = []
        self.camera: Camera | None = None

    def lose(self, prim: Any, what: str, done: str = NOT_HONORED) -> None:
        """Note something that is not honored, or left out."""
        self.files.losses.note(what, str(prim.GetPath()), done=done)

    @contextmanager
    def part(self, prim: Any, done: str = "left out") -> Iterator[None]:
        """Read a part of the stage in a block; it is left out if it is damaged."""
        with self.files.losses.part(str(prim.GetPath()), done), typed("is damaged"):
            yield

    def contents(self) -> Contents:
        """Return the contents of the stage."""
        from pxr import UsdGeom

        self.unit = meters(
            self.files.losses, "metersPerUnit", UsdGeom.GetStageMetersPerUnit(self.stage), 0.01
        )
        for error in self.stage.GetCompositionErrors():
            self.files.losses.note(said(error), "composition")
        pose(self.stage, self.time, self.part)
        self.root = np.diag([self.unit] * 3 + [1.0])  # from the stage to the scene
        self._count(self.stage.GetPseudoRoot(), ())
        self._place(self.stage.GetPseudoRoot(), self.root[None], {})
        counts = [len(matrices) for _, matrices, _ in self.placed]
        numbers = np.repeat(np.array([index for index, *_ in self.placed], np.intp), counts)
        matrices = np.concatenate([np.zeros((0, 4, 4)), *(transforms for _, transforms, _ in self.placed)])
        materials = [material for *_, material in self.placed]
        places = Places(numbers, matrices)
        if any(material is not None for material in materials):
            counted = zip(materials, counts, strict=True)
            places.materials = [material for material, count in counted for _ in range(count)]
        up = str(UsdGeom.GetStageUpAxis(self.stage)).lower()
        span = None if self.codes is None else (self.codes[0] / self.rate, self.codes[1] / self.rate)
        return Contents(self.raws, places, self.lights, self.camera, self.shapes, up=up, span=span)

    def _count(self, top: Any, above: tuple[str, ...]) -> int:
        """Return the number of prims that are placed with a prim, before any is placed.

        Instancers may place instancers.

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
                    count += self._count_prototypes(prim, (*above, key))
                if count > self.files.limits.instances:
                    raise LimitError(f"{prim.GetPath()}: is beyond the limit LoadLimits.instances")
            self._sizes[key] = count
        return self._sizes[key]

    def _count_prototypes(self, prim: Any, above: tuple[str, ...]) -> int:
        """Return the number of prims that an instancer places.

        A prototype that is damaged, or would place the instancer itself, is left out.
        """
        count, sound = 0, []
        with self.part(prim):
            for prototype in self._prototypes(prim):
                with self.part(prim):
                    count += len(prototype.matrices) * self._count(prototype.prim, above)
                    sound.append(prototype)
        self._instancers[str(prim.GetPath())] = sound
        return count

    def _place(self, top: Any, matrices: Matrix, tint: Tint) -> None:
        """Read a prim that stands at several places (n, 4, 4), and all below it."""
        for prim, kind, matrix, resets in self._leaves(top):
            below = np.tile(self.root, (len(matrices), 1, 1)) if resets else matrices
            where = str(prim.GetPath())
            with self.part(prim), np.errstate(all="ignore"), placed(where, where):  # NaN is refused
                at = below @ matrix
                fit = in_range(at)
                if not fit.all():
                    self.lose(prim, "a matrix that is not finite or too large", "left out")
                if fit.any():
                    self._read(prim, kind, at[fit], tint)

    def _leaves(self, top: Any) -> list[tuple[Any, str, Matrix, bool]]:
        """Return the leaves of a prim, found once."""
        key = str(top.GetPath())
        if key not in self._found:
            self._found[key] = self._find_leaves(top)
        return self._found[key]

    def _find_leaves(self, top: Any) -> list[tuple[Any, str, Matrix, bool]]:
        """Return the leaves of a prim: itself and all below it, as far as they are shown.

        Each has its type, the matrix to the space around the prim, and whether it is that to the stage.
        """
        from pxr import Usd

        leaves = []
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
            local, alone = np.eye(4), False
            with self.part(prim, "its transform left out"):
                local, alone = self.cache.GetLocalTransformation(prim)
            below = (np.eye(4) if alone else above) @ np.array(local).T
            kind = str(prim.GetTypeName())
            if kind not in HARMLESS:
                leaves.append((prim, kind, below, alone or resets))
            if kind != "PointInstancer":
                children = prim.GetFilteredChildren(Usd.TraverseInstanceProxies())
                waiting += [(child, below, alone or resets) for child in reversed(children)]
        return leaves

    def _read(self, prim: Any, kind: str, matrices: Matrix, tint: Tint) -> None:
        """Read a prim at each of its places (n, 4, 4)."""
        if kind == "PointInstancer":
            for matrix in matrices:
                self._instancer(prim, matrix, tint)
        elif kind == "Mesh" or (kind in GPRIMS and not self._is_ball(prim, kind, matrices)):
            self._place_meshes(prim, matrices, tint)
        elif kind in GPRIMS:  # balls
            self.shapes += [self._ball(prim, matrix, tint) for matrix in matrices]
        elif kind in LAMPS:
            lamps = (Lamp(self.materials, prim, matrix, self.unit).light() for matrix in matrices)
            for light in lamps:
                if isinstance(light, Light):
                    self.lights.append(light)
                elif light is not None:
                    self.shapes.append(light)
        elif kind == "Camera":
            self._camera(prim, matrices[0])
        else:
            self.lose(prim, f"a {kind}; left out")

    def _is_ball(self, prim: Any, kind: str, matrices: Matrix) -> bool:
        """Return whether a prim needs no mesh."""
        plain = kind == "Sphere" and not is_light(prim) and not self.materials.of(prim).primvars
        return plain and all(map(is_even, matrices))

    def _ball(self, prim: Any, matrix: Matrix, tint: Tint) -> Sphere:
        look = self.materials.of(prim)
        material = look.material or self._plain(prim, tint)
        radius = float(self._value(prim, "radius", 1.0)) * mean_scale(matrix)
        name = str(prim.GetName())
        return Sphere(matrix[:3, 3], radius, material=material, emission=look.emission, name=name)

    def _plain(self, prim: Any, tint: Tint) -> Material | None:
        """Return the material of a prim by its color and opacity alone, None if it has neither."""
        values = dict(tint)
        for name, field in (("displayColor", "colors"), ("displayOpacity", OPACITY)):
            value = self.meshes.one(prim, name, field)
            if value is not None:
                values[name] = tuple(value.tolist())
        return self.materials.plain(values, colored=False, veiled=False) if values else None

    def _value(self, prim: Any, name: str, default: Any = None) -> Any:
        return value_of(prim, self.time, name, default)

    def _instancer(self, prim: Any, matrix: Matrix, tint: Tint) -> None:
        for prototype in self._prototypes(prim):
            self._place(prototype.prim, matrix @ prototype.matrices, tint | prototype.tint)

    def _prototypes(self, prim: Any) -> list[_Prototype]:
        """Return the prototypes of an instancer, with their places."""
        key = str(prim.GetPath())
        if key not in self._instancers:
            self._instancers[key] = list(self._read_prototypes(prim))
        return self._instancers[key]

    def _read_prototypes(self, prim: Any) -> Iterator[_Prototype]:
        from pxr import UsdGeom

        instancer = UsdGeom.PointInstancer(prim)
        prototypes = instancer.GetPrototypesRel().GetForwardedTargets()
        which = self._value(prim, "protoIndices", [])
        transforms = instancer.ComputeInstanceTransformsAtTime(
            self.time, self.time, UsdGeom.PointInstancer.ExcludeProtoXform
        )
        which = np.asarray(which, np.intp)
        numbers = np.arange(len(which))
        if len(transforms) != len(which):  # by a mask, or as the arrays differ
            mask = np.asarray(instancer.ComputeMaskAtTime(self.time), bool)
            numbers = numbers[mask] if len(mask) == len(which) else numbers
        if len(numbers) != len(transforms):
            raise SceneError(f"has {len(which)} protoIndices and {len(transforms)} positions")
        matrices = np.array(transforms, float).reshape(-1, 4, 4).transpose(0, 2, 1)
        groups = grouped(prim, self.time, len(which), numbers, self.lose)
        which = which[numbers]
        bad = which[(which < 0) | (which >= len(prototypes))]
        if len(bad):
            self.lose(prim, f"protoIndices has {bad[0]}; there are {len(prototypes)}", "left out")
        for index in np.unique(which[(which >= 0) & (which < len(prototypes))]).tolist():
            target = self.stage.GetPrimAtPath(prototypes[index])
            if not target or prim.GetPath().HasPrefix(target.GetPath()):
                self.lose(prim, f"its prototype {prototypes[index]} cannot be placed", "left out")
                continue
            for tint, members in groups:
                chosen = members[which[members] == index]
                if len(chosen):
                    yield _Prototype(target, matrices[chosen], tint)

    def _place_meshes(self, prim: Any, matrices: Matrix, tint: Tint) -> None:
        """Place the meshes of a prim, which may have values of primvars from its instance."""
        if is_light(prim):
            self._place_lights(prim, matrices)
            return
        look = self.materials.of(prim)
        values = {name: value for name, value in tint.items() if not has_own(prim, name)}
        read = (name for field, name in look.primvars.items() if field in ("colors", OPACITY))
        for name in (*DISPLAYED, *read):
            value = outside(prim, name, self.time)
            if value is not None:
                values[name] = value
        for index, bound in self._meshes(prim, frozenset(values)):
            material = self.materials.tinted(bound, self.raws[index], values) if values else None
            self.placed.append((index, matrices, material))

    def _place_lights(self, prim: Any, matrices: Matrix) -> None:
        """Place the meshes of a prim that is a light."""
        alike = not self._value(prim, "inputs:normalize", False)  # otherwise the area of each counts
        for places in [matrices] if alike else matrices[:, None]:
            raws = [replace(self.raws[index]) for index, _ in self._meshes(prim)]
            light_up(Lamp(self.materials, prim, places[0], self.unit), raws)
            self.placed += [(len(self.raws) + i, places, None) for i in range(len(raws))]
            self.raws += raws

    def _meshes(self, prim: Any, without: frozenset[str] = frozenset()) -> list[tuple[int, Any]]:
        """Return the numbers of the meshes of a prim, one for each material; instances share them.

        Each is before the prim to which its material is bound. Instances of one prototype may have several
        materials, by those that are bound above them. `without` is as of `Meshes.of`.
        """
        path = prim.GetPrimInPrototype().GetPath() if prim.IsInstanceProxy() else prim.GetPath()
        key = path, id(self.materials.of(prim)), without
        if key not in self.of_prim:
            first = len(self.raws)
            with np.errstate(all="ignore"):
                meshes = self.meshes.of(prim, without)
            self.raws += [raw for _, raw in meshes]
            self.of_prim[key] = [(first + i, bound) for i, (bound, _) in enumerate(meshes)]
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
        offset = np.array(
            [float(self._value(prim, f"{name}ApertureOffset", 0.0)) for name in ("horizontal", "vertical")]
        )
        axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
        origin = matrix[:3, 3]
        lens: Projection
        if self._value(prim, "projection", "perspective") == "orthographic":
            lens = Orthographic(high / 10 * self.unit)  # apertures are in tenths of units
            origin = origin + axes[:, :2] @ (offset / 10 * self.unit)
        else:
            stop, focus = (float(self._value(prim, name, 0.0)) for name in ("fStop", "focusDistance"))
            opened = stop > 0 and focus > 0
            lens = Perspective(
                math.degrees(2 * math.atan(high / (2 * focal))),
                shift=(offset[0] / across, offset[1] / high),
                aperture=focal / 10 / stop * self.unit if opened else 0.0,
                focus=focus * self.unit if opened else None,
            )
        size = (max(round(HEIGHT * across / high), 1), HEIGHT)
        self.camera = Camera(origin, axes, lens, size)
