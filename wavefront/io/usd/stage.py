"""A stage of USD as the contents of a file, at one time."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ...arrays.vec import luminance
from ...camera import Camera
from ...colors.spectrum import blackbody
from ...core.errors import SceneError
from ...lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ...shapes import Disk, Rectangle, Shape, Sphere
from ...shapes.transform import Matrix
from ...textures import Texture
from ..contents import Contents
from ..conversion import placed
from ..placing import Places, moved_raw
from ..repair import RawMesh, warn_of_lost
from ..sources import SceneFiles
from .materials import COLORED, Materials

HEIGHT = 512  # pixels of the picture of a camera
MOST_PRIMS = 2**20
LIGHTS = ("SphereLight", "RectLight", "DiskLight", "DistantLight", "DomeLight")
PLAIN: dict[str, Any] = {"inputs:diffuse": 1.0, "inputs:specular": 1.0, "inputs:shaping:focus": 0.0}
PLAIN |= {"inputs:shaping:ies:file": None}  # by their values where they change nothing
HARMLESS = ("Scope", "Xform", "Material", "Shader", "NodeGraph", "GeomSubset", "RenderSettings", "")


def read_usd(files: SceneFiles, strict: bool, time: float | None = None) -> Contents:
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
        return _Reader(files, stage, time).contents(strict)
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
        self.lost: dict[tuple[str, str], None] = {}
        self.materials = Materials(files, self.time, self.lose)
        self.raws: list[RawMesh] = []
        self.of_prim: dict[Any, list[int]] = {}
        self.placed: list[tuple[int, Matrix]] = []
        self.shapes: list[Shape] = []
        self.lights: list[Light] = []
        self.camera: Camera | None = None

    def lose(self, prim: Any, what: str) -> None:
        """Note what is not honored."""
        self.lost[str(prim.GetPath()), what] = None

    def contents(self, strict: bool) -> Contents:
        """Return what the stage holds."""
        from pxr import UsdGeom

        self.unit = float(UsdGeom.GetStageMetersPerUnit(self.stage))
        for error in self.stage.GetCompositionErrors():
            self.lost["composition", " ".join(str(error).split())[:200]] = None
        self._walk(self.stage.GetPseudoRoot(), np.diag([self.unit] * 3 + [1.0]))
        warn_of_lost(self.files.name, (f"{where} {what}" for where, what in self.lost), strict)
        matrices = np.array([matrix for _, matrix in self.placed]).reshape(-1, 4, 4)
        places = Places(np.array([number for number, _ in self.placed], np.intp), matrices)
        up = str(UsdGeom.GetStageUpAxis(self.stage)).lower()
        return Contents(self.raws, places, self.lights, self.camera, self.shapes, up=up)

    def _walk(self, top: Any, matrix: Matrix) -> None:
        """Read a prim that is placed by a matrix, and all below it."""
        from pxr import Usd

        waiting, count = [(top, matrix)], 0
        while waiting:
            prim, above = waiting.pop()
            count += 1
            if count > MOST_PRIMS or len(self.placed) > self.files.limits.instances:
                raise SceneError(f"{prim.GetPath()}: is beyond the limit of prims or LoadLimits.instances")
            if self._value(prim, "visibility") == "invisible":
                continue
            if self._value(prim, "purpose") in ("proxy", "guide"):
                continue
            own, resets = self.cache.GetLocalTransformation(prim)
            below = (np.diag([self.unit] * 3 + [1.0]) if resets else above) @ np.array(own).T
            kind = str(prim.GetTypeName())
            if kind == "PointInstancer":
                self._instancer(prim, below)
                continue
            where = str(prim.GetPath())
            with np.errstate(all="ignore"), placed(where, where):  # what is not finite is refused
                self._read(prim, kind, below)
            children = prim.GetFilteredChildren(Usd.TraverseInstanceProxies())
            waiting += [(child, below) for child in reversed(children)]

    def _read(self, prim: Any, kind: str, matrix: Matrix) -> None:
        if kind == "Mesh":
            self.placed += [(number, matrix) for number in self._meshes(prim)]
        elif kind == "Sphere":
            self._check_even(prim, matrix)
            radius = float(self._value(prim, "radius", 1.0)) * _scale(matrix)
            material, emission = self.materials.of(prim)
            ball = Sphere(
                matrix[:3, 3], radius, material=material, emission=emission, name=str(prim.GetName())
            )
            self.shapes.append(ball)
        elif kind in LIGHTS:
            self._light(prim, kind, matrix)
        elif kind == "Camera":
            self._camera(prim, matrix)
        elif kind not in HARMLESS:
            self.lose(prim, f"a {kind}; left out")

    def _value(self, prim: Any, name: str, default: Any = None) -> Any:
        attribute = prim.GetAttribute(name)
        value = attribute.Get(self.time) if attribute else None
        return default if value is None else value

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
        for number, place in zip(which, found, strict=True):
            if not 0 <= number < len(prototypes):
                raise SceneError(f"{prim.GetPath()}: protoIndices has {number}; there are {len(prototypes)}")
            target = self.stage.GetPrimAtPath(prototypes[number])
            if not target or prim.GetPath().HasPrefix(target.GetPath()):
                raise SceneError(f"{prim.GetPath()}: its prototype {prototypes[number]} cannot be placed")
            self._walk(target, matrix @ np.array(place).T)

    def _meshes(self, prim: Any) -> list[int]:
        """Return the numbers of the meshes of a prim, one for each material; instances share them."""
        key = prim.GetPrimInPrototype().GetPath() if prim.IsInstanceProxy() else prim.GetPath()
        if key not in self.of_prim:
            first = len(self.raws)
            with np.errstate(all="ignore"):
                self.raws += self._parts(prim)
            self.of_prim[key] = list(range(first, len(self.raws)))
        return self.of_prim[key]

    def _parts(self, prim: Any) -> list[RawMesh]:
        from pxr import UsdShade

        whole, face_of = self._mesh(prim)
        left = np.ones(len(face_of), bool)
        parts = []
        for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
            chosen = np.isin(face_of, np.asarray(subset.GetIndicesAttr().Get(self.time) or [], int)) & left
            left &= ~chosen
            parts.append((subset.GetPrim(), chosen))
        return [
            self._made_of(each, whole, whole.faces[chosen])
            for each, chosen in [*parts, (prim, left)]
            if chosen.any()
        ]

    def _made_of(self, prim: Any, whole: RawMesh, faces: Any) -> RawMesh:
        material, emission = self.materials.of(prim)
        if material is None and whole.colors is not None:
            material = COLORED
        raw = RawMesh(**{**vars(whole), "faces": faces, "material": material, "emission": emission})
        raw.name = str(prim.GetName())
        return moved_raw(raw, np.eye(4))  # with arrays of its own

    def _mesh(self, prim: Any) -> tuple[RawMesh, Any]:
        """Return a mesh of triangles, and the faces of which they are parts."""
        points = np.asarray(self._value(prim, "points", []), float).reshape(-1, 3)
        counts = np.asarray(self._value(prim, "faceVertexCounts", []), np.intp)
        corners = np.asarray(self._value(prim, "faceVertexIndices", []), np.intp)
        if (counts < 3).any() or counts.sum() != len(corners):
            raise SceneError(f"{prim.GetPath()}: faceVertexCounts do not fit the {len(corners)} indices")
        if corners.size and not (corners.min() >= 0 and corners.max() < len(points)):
            raise SceneError(f"{prim.GetPath()}: faceVertexIndices are beyond the {len(points)} points")
        if (
            self._value(prim, "subdivisionScheme") != "none"
            and prim.GetAttribute("subdivisionScheme").IsAuthored()
        ):
            self.lose(prim, "subdivisionScheme; the mesh of its control points in its place")
        triangles = counts - 2
        face_of = np.repeat(np.arange(len(counts)), triangles)
        step = np.arange(len(face_of)) - np.repeat(np.cumsum(triangles) - triangles, triangles)
        start = np.repeat(np.cumsum(counts) - counts, triangles)
        order = (0, 2, 1) if self._value(prim, "orientation") == "leftHanded" else (0, 1, 2)
        corner = np.stack([start, start + step + 1, start + step + 2], 1)[:, order].ravel()
        at = {
            "constant": np.zeros_like(corner),
            "uniform": np.repeat(face_of, 3),
            "vertex": corners[corner],
            "varying": corners[corner],
            "faceVarying": corner,
        }
        faces = np.arange(len(corner)).reshape(-1, 3)
        values = {name: self._primvar(prim, name, at) for name in ("st", "normals", "displayColor")}
        raw = RawMesh("", points[corners[corner]], faces, values["normals"], values["st"], smooth=True)
        raw.colors = values["displayColor"]
        return raw, face_of

    def _primvar(self, prim: Any, name: str, at: dict[str, Any]) -> Any:
        """Return the values of a primvar at corners, None if there is none."""
        from pxr import UsdGeom

        given = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
        if given and given.HasValue():
            values, kind = given.ComputeFlattened(self.time), str(given.GetInterpolation())
        else:
            values = self._value(prim, name) if name == "normals" else None
            kind = str(UsdGeom.Mesh(prim).GetNormalsInterpolation())
        if values is None:
            return None
        table, index = np.asarray(values, float), at.get(kind)
        if index is None or table.ndim != 2 or (index.size and index.max() >= len(table)):
            raise SceneError(f"{prim.GetPath()}: {name} has {len(table)} values, too few for {kind!r}")
        return table[index]

    def _light(self, prim: Any, kind: str, matrix: Matrix) -> None:
        def of(name: str, default: Any) -> Any:
            return self._value(prim, f"inputs:{name}", default)

        for name, usual in PLAIN.items():
            if self._value(prim, name, usual) != usual:
                self.lose(prim, name)
        cone, point = float(of("shaping:cone:angle", 90.0)), bool(self._value(prim, "treatAsPoint", False))
        if kind in ("RectLight", "DiskLight") and cone < 90:
            self.lose(prim, "inputs:shaping:cone:angle")
        bright = np.asarray(of("color", (1, 1, 1)), float) * float(of("intensity", 1.0))
        bright = bright * 2.0 ** float(of("exposure", 0.0))
        if of("enableColorTemperature", False):
            white = blackbody(float(of("colorTemperature", 6500.0)))
            bright = bright * (white / luminance(white))
        size = _scale(matrix) / self.unit
        x, y, z = (matrix[:3, i] / np.linalg.norm(matrix[:3, i]) for i in range(3))
        file = of("texture:file", None)
        if kind == "DistantLight":
            angle = float(of("angle", 0.53))
            spread = math.pi * math.sin(math.radians(angle) / 2) ** 2
            factor = 1.0 if of("normalize", False) or not spread else spread
            self.lights.append(DirectionalLight(-z, bright * factor, angle=angle))
        elif kind == "DomeLight":
            axes = np.stack([x, y, z], 1)
            if of("texture:format", "automatic") not in ("automatic", "latlong"):
                self.lose(prim, "inputs:texture:format; 'latlong' in its place")
            if file is None:
                self.lights.append(Environment(bright))
            else:
                image = self.materials.pixels(prim, file)
                self.lights.append(Environment(1 if image is None else image, transform=axes, scale=bright))
        else:
            radius = float(of("radius", 0.5)) * size
            long = np.linalg.norm(matrix[:3, :3], axis=0) / self.unit
            width, height = (float(of(name, 1.0)) * long[i] for i, name in enumerate(("width", "height")))
            if kind != "RectLight":
                self._check_even(prim, matrix)
            round_area = math.pi * radius**2
            area = {"SphereLight": 4 * round_area, "DiskLight": round_area, "RectLight": width * height}[kind]
            glow = bright / area if of("normalize", False) else bright
            center, name = matrix[:3, 3], str(prim.GetName())
            radius, width, height = radius * self.unit, width * self.unit, height * self.unit
            if kind == "SphereLight" and (point or cone < 90):
                if not point:
                    self.lose(prim, "its radius; a SpotLight in its place")
                self.lights.append(_at_point(center, -z, glow * (math.pi * radius**2), cone, of))
                return
            if kind == "RectLight" and file is not None:
                image = self.materials.pixels(prim, file)
                glow = glow if image is None else Texture(image, wrap="clamp", scale=glow)
            elif file is not None:
                self.lose(prim, "inputs:texture:file")
            self.shapes.append(
                Sphere(center, radius, emission=glow, name=name)
                if kind == "SphereLight"
                else Disk(center, -z, radius, emission=glow, name=name)
                if kind == "DiskLight"
                else Rectangle(
                    center + x * width / 2 - y * height / 2, -x * width, y * height, emission=glow, name=name
                )
            )

    def _check_even(self, prim: Any, matrix: Matrix) -> None:
        scales = np.linalg.svd(matrix[:3, :3], compute_uv=False)
        if scales[0] > 1.001 * scales[2]:
            self.lose(prim, "its stretch along one axis")

    def _camera(self, prim: Any, matrix: Matrix) -> None:
        if self.camera is not None:
            return
        if self._value(prim, "projection", "perspective") != "perspective":
            self.lose(prim, "projection; a perspective camera in its place")
        across, high = (
            float(self._value(prim, f"{name}Aperture", usual))
            for name, usual in (("horizontal", 20.955), ("vertical", 15.2908))
        )
        focal, stop = float(self._value(prim, "focalLength", 50.0)), float(self._value(prim, "fStop", 0.0))
        focus = float(self._value(prim, "focusDistance", 0.0))
        if not (across > 0 and high > 0 and focal > 0 and across < 100 * high):
            raise SceneError(f"{prim.GetPath()}: its apertures and focalLength must be above 0")
        for name in ("horizontalApertureOffset", "verticalApertureOffset"):
            if self._value(prim, name, 0.0):
                self.lose(prim, name)
        axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
        place = np.vstack([np.column_stack([axes, matrix[:3, 3]]), [0, 0, 0, 1]])
        lens = focal / 10 / stop * self.unit if stop > 0 and focus > 0 else 0.0
        self.camera = Camera.from_matrix(
            place,
            math.degrees(2 * math.atan(high / (2 * focal))),
            size=(max(round(HEIGHT * across / high), 1), HEIGHT),
            aperture=lens,
            focus=focus * self.unit if lens else None,
        )


def _at_point(center: Any, axis: Any, intensity: Any, cone: float, of: Callable[[str, Any], Any]) -> Light:
    """Return a light that stands at a point, and shines into a cone of `cone` degrees from its axis."""
    if cone >= 90:
        return PointLight(center, intensity)
    softness = min(max(float(of("shaping:cone:softness", 0.0)), 0.0), 1.0)
    return SpotLight(center, intensity, direction=axis, angle=2 * cone, blend=softness)


def _scale(matrix: Matrix) -> float:
    """Return the mean factor of lengths of a matrix."""
    return float(abs(np.linalg.det(matrix[:3, :3])) ** (1 / 3))
