"""UsdPreviewSurface as materials."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...arrays.elementary import sin_cos_turns
from ...arrays.vec import FLOAT32_MAX
from ...bsdfs import Diffuse, Principled
from ...core.errors import LimitError, SceneError
from ...materials import Material
from ...textures import NormalMap, Texture, VertexColors
from ...textures.base import BaseTexture
from ...textures.image import StoredImage
from ..description.appearance import F0
from ..description.computed import texture_within
from ..description.parameters import Parameter
from ..repair import RawMesh
from ..sources import MISSING, SceneFiles
from .layers import typed
from .tints import Tint

WRAPS = {"repeat": "repeat", "clamp": "clamp", "mirror": "mirror", "useMetadata": "repeat"}
LEAST_IOR = 1e-6
GRAY, BLACK, UP = (0.18, 0.18, 0.18), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
# inputs of UsdPreviewSurface, in the order in which they are read
DISPLACEMENT = Parameter("", "displacement")
NUMBERS = (
    Parameter("metallic", "metallic"),
    Parameter("roughness", "roughness", 0.5),
    Parameter("ior", "ior", 1.5, low=LEAST_IOR, high=1 / LEAST_IOR),
    Parameter("clearcoat", "clearcoat"),
    Parameter("clearcoat_roughness", "clearcoatRoughness", 0.01),
)
WORKFLOW = Parameter("", "useSpecularWorkflow")
SPECULAR = (Parameter("specular_color", "specularColor", BLACK, times=1 / F0, high=1 / F0),)
BASE = (
    Parameter("base_color", "diffuseColor", GRAY),
    Parameter("alpha", "opacity", 1.0),
    Parameter("alpha_cutoff", "opacityThreshold"),
)
NORMAL = Parameter("normal_map", "normal", UP)
GLOW = (Parameter("emission", "emissiveColor", BLACK, high=FLOAT32_MAX),)
CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3}
COLORED = Material(Diffuse(VertexColors()))
VEILED = Material(Diffuse(VertexColors()), alpha=VertexColors(channel=3))
PURPOSES = ("preview", "full")  # of a material; one that is bound for all comes after the first
MOST_MOVES = 16  # transforms of texture coordinates one after the other
# the fields of a mesh that primvars become, by their readers
COORDINATES, COLORS = ("uvs", "uvs1"), ("colors",)
UNCOLORED = 0.5  # of prims with an opacity alone
OPACITY = "opacity"  # no field, but the fourth column of the colors


@dataclass(eq=False)
class Look:
    """A material, the light that it emits, and the primvars that it reads, by the field of a mesh."""

    material: Material | None = None
    emission: Any = None
    primvars: dict[str, str] = field(default_factory=dict)
    fallbacks: dict[str, Any] = field(default_factory=dict)  # of their readers, where these have some

    def material_for(self, raw: RawMesh) -> Material | None:
        """Return the material; that of the vertex colors where none is bound."""
        if self.material is not None or raw.colors is None:
            return self.material
        return COLORED if raw.colors.shape[1] == 3 else VEILED


class Materials:
    """The materials of a stage, each converted once."""

    def __init__(self, files: SceneFiles, time: Any, lose: Callable[..., None]) -> None:
        self.files, self.time, self.lose = files, time, lose
        self._none = Look()
        self._made: dict[tuple[str, tuple[Any, ...]], Look] = {}
        self._images: dict[str, Any] = {}

    def of(self, prim: Any, tint: Tint | None = None) -> Look:
        """Return the look of a prim; without a bound material it has none of its own.

        The values of `tint` count in place of primvars that its shaders read.
        """
        from pxr import UsdShade

        binding = UsdShade.MaterialBindingAPI(prim)
        materials = (binding.ComputeBoundMaterial(purpose)[0] for purpose in PURPOSES)
        bound = next((material for material in materials if material), None)
        if bound is None:
            return self._none
        path = str(bound.GetPath())
        key = path, tuple((tint or {}).items())
        if key not in self._made:
            look = Look(Material(Diffuse(0.5), name=str(bound.GetPrim().GetName())))
            with self.files.losses.part(path, "a gray Diffuse in its place"), typed("is damaged"):
                look = self._converted(bound, tint or {})
            self._made[key] = look
        return self._made[key]

    def tinted(self, prim: Any, raw: RawMesh, tint: Tint) -> Material | None:
        """Return the material of an instance of the mesh of a prim, which has values of its own."""
        look = self.of(prim)
        if look.material is not None:
            read = [name for field, name in look.primvars.items() if field in ("colors", OPACITY)]
            return self.of(prim, {name: tint[name] for name in read if name in tint}).material
        return self.plain(tint, raw.colors is not None, raw.colors is not None and raw.colors.shape[1] == 4)

    def plain(self, tint: Tint, colored: bool, veiled: bool) -> Material:
        """Return the material of a color and an opacity, which those of the vertices stand for otherwise."""
        key = "", (*tint.items(), colored, veiled)
        if key not in self._made:
            color: Any = VertexColors() if colored else UNCOLORED
            alpha: Any = VertexColors(channel=3) if veiled else None
            if "displayColor" in tint:
                color = np.clip(tint["displayColor"], 0, 1)
            if "displayOpacity" in tint:
                alpha = _opacity(*tint["displayOpacity"])
            self._made[key] = Look(Material(Diffuse(color), alpha=alpha))
        material = self._made[key].material
        assert material is not None
        return material

    def _converted(self, bound: Any, tint: Tint) -> Look:
        shader, *_ = bound.ComputeSurfaceSource()
        if shader and shader.GetIdAttr().Get() == "UsdPreviewSurface":
            return _Surface(self, shader, tint).look(bound.GetPrim().GetName())
        self.lose(bound.GetPrim(), "its surface shader; a gray Diffuse in its place")
        return Look(Material(Diffuse(0.5), name=bound.GetPrim().GetName()))

    def pixels(self, prim: Any, file: Any) -> StoredImage | None:
        """Return an image, which may be in a usdz archive, or None, which is noted, if it cannot be read."""
        if not hasattr(file, "resolvedPath"):  # a value of another type than the schema has
            raise SceneError(f"{prim.GetPath()}: file is {str(file)[:60]!r}; it must be an asset path")
        name = file.resolvedPath or file.path
        if name not in self._images:
            self._images[name] = self._read(file, str(prim.GetPath()))
        return self._images[name]

    def _read(self, file: Any, place: str) -> StoredImage | None:
        path = file.resolvedPath
        if path.endswith("]"):  # in a usdz archive
            read = lambda: self.files.decoded(path[:-1], self._member(path))  # noqa: E731
            return self.files.shown(file.path, read, place)
        return self.files.picture(self._inside(path) if path else file.path, place=place)

    def _inside(self, path: str) -> str:
        """Return a path as the scene would refer to it."""
        return os.path.relpath(path, Path(self.files.name).resolve().parent)

    def _member(self, name: str) -> bytes:
        """Return the content of an image in an archive, which may be read."""
        from pxr import Ar

        self.files.named(self._inside(name.partition("[")[0]))
        asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(name))
        if not asset:
            raise SceneError(MISSING)
        if asset.GetSize() > self.files.limits.file_bytes:
            raise LimitError(f"{name}: has {asset.GetSize()} bytes; the limit is LoadLimits.file_bytes")
        return bytes(asset.GetBuffer())


def _opacity(alpha: float) -> float | None:
    """Return an opacity, None where it is complete."""
    return None if alpha >= 1 else max(alpha, 0.0)


class _Surface:
    """A UsdPreviewSurface, and the primvars that its textures read."""

    def __init__(self, materials: Materials, shader: Any, tint: Tint) -> None:
        self.materials, self.shader, self.tint = materials, shader, tint
        self.time, self.lose = materials.time, materials.lose
        self.primvars: dict[str, str] = {}
        self.fallbacks: dict[str, Any] = {}

    def look(self, name: str) -> Look:
        """Return the material, which gets a name."""
        if self._value(DISPLACEMENT) != 0:
            self.lose(self.shader.GetPrim(), "displacement")
        wanted = self._inputs(NUMBERS)
        if self._value(WORKFLOW) == 1:
            wanted |= {"metallic": 0.0, "ior": 1.5} | self._inputs(SPECULAR)
        wanted |= self._inputs(BASE)
        alpha, cutoff = wanted.pop("alpha"), wanted.pop("alpha_cutoff")
        normal, glow = self._value(NORMAL), self._inputs(GLOW)["emission"]
        material = Material(
            Principled(**wanted),
            alpha=None if isinstance(alpha, float) and alpha >= 1 else alpha,
            alpha_cutoff=cutoff if isinstance(cutoff, float) and cutoff > 0 else None,
            normal_map=NormalMap(normal) if isinstance(normal, Texture) else None,
            name=name,
        )
        emission = glow if isinstance(glow, BaseTexture) or any(glow) else None
        return Look(material, emission, self.primvars, self.fallbacks)

    def _inputs(self, rows: Iterable[Parameter]) -> dict[str, Any]:
        """Return the inputs of a table, each in its range, by our names."""
        return {row.ours: self._within(row, self._value(row)) for row in rows}

    def _within(self, row: Parameter, value: Any) -> Any:
        """Return the value of an input, clamped to its range where it is outside, which is noted."""
        place, losses = str(self.shader.GetPrim().GetPath()), self.materials.files.losses
        name = f"inputs:{row.theirs}"
        if isinstance(value, BaseTexture):  # those of an index are checked where they are used
            return value if row.low else texture_within(losses, name, value, row.high, place)
        if not isinstance(value, float | tuple):
            return value
        if not np.isfinite(value).all():
            losses.note(name, place, str(value), "its default in its place")
            return row.default
        limited = losses.within(name, value, row.low, row.high, place)
        return tuple(limited.tolist()) if isinstance(value, tuple) else float(limited)

    def _value(self, row: Parameter) -> Any:
        """Return an input, times its factor: a float, a color as a tuple, or a texture.

        It is the default where it is damaged.
        """
        place = str(self.shader.GetPrim().GetPath())
        losses = self.materials.files.losses
        with losses.part(place, f"the default of {row.theirs} in its place"), typed("is damaged"):
            return self._read(row)
        return row.default

    def _read(self, row: Parameter) -> Any:
        sources = _sources(self.shader, row.theirs)
        if not sources:
            return row.default
        from pxr import UsdShade

        source = UsdShade.Shader(sources[0].GetPrim())
        if UsdShade.Output.IsOutput(sources[0]) and source:
            return self._connected(row, source, sources[0].GetBaseName())
        value = sources[0].Get(self.time)
        if value is None:
            return row.default
        return _scaled(row, value) if row.is_color else float(value) * row.times

    def _connected(self, row: Parameter, source: Any, output: str) -> Any:
        """Return the value of an input that is connected to an output of another shader."""
        kind = _kind(source)
        tint = self.tint.get(str(self._get(source, "varname", ""))) if "PrimvarReader" in kind else None
        if tint is not None and row is not NORMAL:
            values = _scaled(row, tint)
            return values if row.is_color and len(values) == 3 else row.default if row.is_color else values[0]
        plain = row.is_color and row is not NORMAL and row.times == 1
        if kind.startswith("UsdPrimvarReader_float3") and plain:
            return row.default if self._primvar(source, COLORS) is None else VertexColors()
        if kind == "UsdPrimvarReader_float" and not row.is_color:
            return row.default if self._primvar(source, (OPACITY,)) is None else VertexColors(channel=3)
        path = self._get(source, "file")
        if kind != "UsdUVTexture":
            self.lose(source.GetPrim(), f"the shader {kind!r}")
        elif path is None and self._get(source, "fallback") is None:
            self.lose(source.GetPrim(), "file")
        readable = kind == "UsdUVTexture" and path is not None
        pixels = self.materials.pixels(source.GetPrim(), path) if readable else None
        if pixels is None:
            return self._fallback(row, source, output)
        return self._texture(row, source, output, pixels)

    def _texture(self, row: Parameter, source: Any, output: str, pixels: StoredImage) -> Texture:
        """Return the texture of a UsdUVTexture."""
        scale, bias = self._get(source, "scale", (1, 1, 1, 1)), self._get(source, "bias", (0, 0, 0, 0))
        space = self._get(source, "sourceColorSpace", "auto")
        wraps = [str(self._get(source, name, "useMetadata")) for name in ("wrapS", "wrapT")]
        for wrap in set(wraps) - WRAPS.keys():
            self.lose(source.GetPrim(), f"wrap {wrap!r}; 'clamp' in its place")
        channel = None if row.is_color else CHANNELS.get(output, 0)
        channels = slice(0, 3) if row.is_color else channel
        transform, field = self._coordinates(source)
        data = row is NORMAL
        return Texture(
            pixels,
            srgb=not data and (space == "sRGB" or (space == "auto" and row.is_color)),
            wrap=tuple(WRAPS.get(wrap, "clamp") for wrap in wraps),  # type: ignore[arg-type]
            transform=transform,
            channel=channel,
            scale=1.0 if data else np.asarray(scale, float)[channels] * row.times,
            offset=0.0 if data else np.asarray(bias, float)[channels] * row.times,
            uv_set=COORDINATES.index(field),  # type: ignore[arg-type]
        )

    def _fallback(self, row: Parameter, source: Any, output: str) -> Any:
        """Return the fallback of a texture, in place of an image that cannot be read."""
        value = self._get(source, "fallback")
        if value is None or row is NORMAL:
            return row.default
        values = np.ravel(value)
        if row.is_color:
            return _scaled(row, np.resize(values, 3))
        return float(values[min(CHANNELS.get(output, 0), len(values) - 1)]) * row.times

    def _get(self, source: Any, name: str, default: Any = None) -> Any:
        sources = _sources(source, name)
        value = sources[0].Get(self.time) if sources else None
        return default if value is None else value

    def _coordinates(self, texture: Any) -> tuple[Any, str]:
        """Return the matrix (3, 3) of a texture's coordinates, None for none, and their field of a mesh."""
        matrix, reader = None, _shader_of(texture, "st")
        for _ in range(MOST_MOVES):
            if reader is None or _kind(reader) != "UsdTransform2d":
                break
            move = self._move(reader)
            matrix, reader = move if matrix is None else matrix @ move, _shader_of(reader, "in")
        if reader is None:
            return matrix, self._field("st", COORDINATES) or "uvs"
        if _kind(reader) != "UsdPrimvarReader_float2":
            self.lose(reader.GetPrim(), f"the shader {_kind(reader)!r}; the first texture coordinates")
            return matrix, "uvs"
        return matrix, self._primvar(reader, COORDINATES) or "uvs"

    def _move(self, shader: Any) -> Any:
        """Return the matrix (3, 3) of a UsdTransform2d."""
        sin, cos = sin_cos_turns(np.array(float(self._get(shader, "rotation", 0.0)) / 360))
        turn = np.array([[cos, -sin], [sin, cos]])
        out = np.eye(3)
        out[:2, :2] = turn * np.asarray(self._get(shader, "scale", (1, 1)), float)
        out[:2, 2] = np.asarray(self._get(shader, "translation", (0, 0)), float)
        return out

    def _primvar(self, reader: Any, fields: tuple[str, ...]) -> str | None:
        """Return the field of a mesh that a primvar becomes, which a shader reads; None if all are taken."""
        name = str(self._get(reader, "varname", ""))
        field = self._field(name, fields) if name else None
        if not name:
            self.lose(reader.GetPrim(), "its varname, which is empty")
        elif field is None:
            self.lose(reader.GetPrim(), f"the primvar {name!r}, as there are {len(fields)} before it")
        fallback = self._get(reader, "fallback")
        if field is not None and fallback is not None:
            self.fallbacks.setdefault(field, fallback)
        return field

    def _field(self, name: str, fields: tuple[str, ...]) -> str | None:
        return next((field for field in fields if self.primvars.setdefault(field, name) == name), None)


def _scaled(row: Parameter, values: Any) -> tuple[float, ...]:
    return tuple(float(value) * row.times for value in values)


def _kind(shader: Any) -> str:
    return str(shader.GetIdAttr().Get() or "")


def _shader_of(shader: Any, name: str) -> Any:
    """Return the shader that an input is connected to, None if it is to none."""
    from pxr import UsdShade

    sources = _sources(shader, name)
    source = UsdShade.Shader(sources[0].GetPrim()) if sources else None
    return source if source and UsdShade.Output.IsOutput(sources[0]) else None


def _sources(shader: Any, name: str) -> Any:
    """Return the attributes that give the value of an input."""
    shader_input = shader.GetInput(name)
    return shader_input.GetValueProducingAttributes() if shader_input else []
