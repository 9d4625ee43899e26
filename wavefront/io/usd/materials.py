"""UsdPreviewSurface as materials."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ...arrays.elementary import sin_cos_turns
from ...bsdfs import Diffuse, Principled
from ...codecs.images import decode_codes
from ...core.errors import SceneError
from ...materials import Material
from ...textures import NormalMap, Texture, VertexColors
from ...textures.base import BaseTexture
from ..sources import SceneFiles

WRAPS = {"repeat": "repeat", "clamp": "clamp", "mirror": "mirror", "useMetadata": "repeat"}
NUMBERS = {  # theirs, ours and the default
    "metallic": ("metallic", 0.0),
    "roughness": ("roughness", 0.5),
    "ior": ("ior", 1.5),
    "clearcoat": ("clearcoat", 0.0),
    "clearcoatRoughness": ("clearcoat_roughness", 0.01),
}
IGNORED = ("displacement", "useSpecularWorkflow", "specularColor")  # where they are not their default
CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3}
COLORED = Material(Diffuse(VertexColors()))


class Materials:
    """The materials of a stage, each converted once, with the light that they emit."""

    def __init__(self, files: SceneFiles, time: Any, lose: Callable[[Any, str], None]) -> None:
        self.files, self.time, self.lose = files, time, lose
        self._made: dict[str, tuple[Material, Any]] = {}
        self._images: dict[str, Any] = {}

    def of(self, prim: Any) -> tuple[Material | None, Any]:
        """Return the material bound to a prim, None if there is none, and its emission."""
        from pxr import UsdShade

        bound = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
        if not bound:
            return None, None
        key = str(bound.GetPath())
        if key not in self._made:
            self._made[key] = self._converted(bound)
        return self._made[key]

    def _converted(self, bound: Any) -> tuple[Material, Any]:
        shader, *_ = bound.ComputeSurfaceSource()
        if not shader or shader.GetIdAttr().Get() != "UsdPreviewSurface":
            self.lose(bound.GetPrim(), "its surface shader; a gray Diffuse in its place")
            return Material(Diffuse(0.5), name=bound.GetPrim().GetName()), None
        for name in IGNORED:
            if self._value(shader, name, 0, color=name == "specularColor") not in (0, (0.0, 0.0, 0.0)):
                self.lose(shader.GetPrim(), name)
        numbers = {ours: self._value(shader, name, default) for name, (ours, default) in NUMBERS.items()}
        base = self._value(shader, "diffuseColor", (0.18, 0.18, 0.18), color=True)
        opacity, cut = self._value(shader, "opacity", 1.0), self._value(shader, "opacityThreshold", 0.0)
        normal = self._value(shader, "normal", None, color=True, normal=True)
        glow = self._value(shader, "emissiveColor", (0.0, 0.0, 0.0), color=True)
        material = Material(
            Principled(base, **numbers),
            alpha=None if isinstance(opacity, float) and opacity >= 1 else opacity,
            alpha_cutoff=float(cut) if isinstance(cut, float) and cut > 0 else None,
            normal_map=NormalMap(normal) if isinstance(normal, Texture) else None,
            name=bound.GetPrim().GetName(),
        )
        return material, glow if isinstance(glow, BaseTexture) or any(glow) else None

    def _value(self, shader: Any, name: str, default: Any, color: bool = False, normal: bool = False) -> Any:
        """Return an input: a float, a color as a tuple, or a texture."""
        sources = _sources(shader, name)
        if not sources:
            return default
        from pxr import UsdShade

        source = UsdShade.Shader(sources[0].GetPrim())
        if UsdShade.Output.IsOutput(sources[0]) and source:
            return self._texture(source, sources[0].GetBaseName(), default, color, normal)
        value = sources[0].Get(self.time)
        if value is None:
            return default
        return tuple(float(part) for part in value) if color else float(value)

    def _texture(self, source: Any, output: str, default: Any, color: bool, normal: bool) -> Any:
        kind = str(source.GetIdAttr().Get() or "")
        if kind.startswith("UsdPrimvarReader_float3") and color:
            return VertexColors()
        path = self._get(source, "file")
        if kind != "UsdUVTexture" or path is None:
            self.lose(source.GetPrim(), f"the shader {kind!r}" if kind != "UsdUVTexture" else "file")
            return default
        pixels = self.pixels(source.GetPrim(), path)
        if pixels is None:
            return default
        scale, bias = self._get(source, "scale", (1, 1, 1, 1)), self._get(source, "bias", (0, 0, 0, 0))
        space = self._get(source, "sourceColorSpace", "auto")
        wraps = [str(self._get(source, name, "useMetadata")) for name in ("wrapS", "wrapT")]
        for wrap in set(wraps) - WRAPS.keys():
            self.lose(source.GetPrim(), f"wrap {wrap!r}; 'clamp' in its place")
        channel = None if color else CHANNELS.get(output, 0)
        part = slice(0, 3) if color else channel
        return Texture(
            pixels,
            srgb=not normal and (space == "sRGB" or (space == "auto" and color)),
            wrap=tuple(WRAPS.get(wrap, "clamp") for wrap in wraps),  # type: ignore[arg-type]
            transform=self._transform(source),
            channel=channel,
            scale=1.0 if normal else np.asarray(scale, float)[part],
            offset=0.0 if normal else np.asarray(bias, float)[part],
        )

    def _get(self, source: Any, name: str, default: Any = None) -> Any:
        sources = _sources(source, name)
        value = sources[0].Get(self.time) if sources else None
        return default if value is None else value

    def _transform(self, source: Any) -> Any:
        """Return the matrix (3, 3) of a UsdTransform2d of texture coordinates, if there is one."""
        from pxr import UsdShade

        sources = _sources(source, "st")
        reader = UsdShade.Shader(sources[0].GetPrim()) if sources else None
        if not reader or reader.GetIdAttr().Get() != "UsdTransform2d":
            return None
        turns = np.array(float(self._get(reader, "rotation", 0.0)) / 360)
        sin, cos = sin_cos_turns(turns)
        turn = np.array([[cos, -sin], [sin, cos]])
        out = np.eye(3)
        out[:2, :2] = turn * np.asarray(self._get(reader, "scale", (1, 1)), float)
        out[:2, 2] = np.asarray(self._get(reader, "translation", (0, 0)), float)
        return out

    def pixels(self, prim: Any, file: Any) -> Any:
        """Return the values of an image, which may be in a usdz archive, or None if it is missing."""
        if not hasattr(file, "resolvedPath"):  # a value of another type than the schema has
            raise SceneError(f"{prim.GetPath()}: file is {str(file)[:60]!r}; it must be an asset path")
        name = file.resolvedPath or file.path
        if name not in self._images:
            self._images[name] = self._read(name)
        if self._images[name] is None:
            self.lose(prim, f"the image {file.path!r}, which is missing")
        return self._images[name]

    def _read(self, name: str) -> Any:
        if name.endswith("]"):  # in a usdz archive
            from pxr import Ar

            asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(name))
            if not asset:
                return None
            if asset.GetSize() > self.files.limits.file_bytes:
                raise SceneError(f"{name}: has {asset.GetSize()} bytes; the limit is LoadLimits.file_bytes")
            return decode_codes(bytes(asset.GetBuffer()), name[:-1], self.files.budget)
        folder = Path(self.files.name).resolve().parent
        path = self.files.find(os.path.relpath(name, folder) if os.path.isabs(name) else name)
        return self.files.image(path) if path.exists() else None


def _sources(shader: Any, name: str) -> Any:
    """Return the attributes that give the value of an input."""
    given = shader.GetInput(name)
    return given.GetValueProducingAttributes() if given else []
