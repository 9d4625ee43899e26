"""Materials and textures of glTF: metallic-roughness, specular-glossiness and the KHR extensions.

Their numbers are those of the JSON, unrounded.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ...arrays.elementary import arctan2, log, sin_cos_turns
from ...arrays.vec import FLOAT32_MAX, Doubles, f4
from ...core.errors import LimitError, SceneError, printable
from ...textures.image import StoredImage, Texture
from ...textures.normal_map import NormalMap
from ...textures.parameter import MAX_INDEX
from ..description.appearance import F0, MaterialSpec, build_material
from ..description.computed import FLIP, Computed
from ..description.numbers import SHOWN, floats, shown
from ..description.parameters import METALLIC_ROUGHNESS, Parameter, fill
from ..sources import GRAY
from .compression import DRACO, MESHOPT
from .document import OF_CANDELA, Document
from .nodes import INSTANCING

WEBP = "EXT_texture_webp"
WRAPS = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
NEAREST, LINEAR = 9728, 9729
IMAGES = 4  # all images of a file may have this many times the pixels of the largest
BESIDE = frozenset(  # extensions that may occur with specular-glossiness; the others exclude it
    ("KHR_materials_pbrSpecularGlossiness", "KHR_materials_emissive_strength", "KHR_texture_transform")
)


class GltfMaterials:
    """The materials of a document, each built once."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._specs: dict[int, MaterialSpec] = {}
        self._images: dict[int, StoredImage | None] = {}
        self._pixels = 0  # of these images
        self._default = _Reader(self, {}, "").spec() if document.items("materials") else None
        _check_extensions(document)

    def spec(self, index: Any) -> MaterialSpec | None:
        """Return the appearance of material `index`; without one that of the default material.

        It is None where the file has no materials: as in formats without them, the mesh is then gray.
        """
        if index is not None and (not isinstance(index, int) or index not in self._specs):
            with self._document.part(f"materials[{shown(index)}]", "the default material in its place"):
                material = self._document.get("materials", index)
                where = f"materials[{index}]" + (f" {material['name']!r}" if "name" in material else "")
                spec = self._specs[index] = _Reader(self, material, where).spec()
                for what in spec.lost:
                    self._document.lose(what, where)
        return self._specs.get(index, self._default) if isinstance(index, int) else self._default

    def texture(
        self, info: Any, where: str, instead: StoredImage | None = None, **arguments: Any
    ) -> Texture | None:
        """Return a texture for a texture-info object of the JSON.

        If its image cannot be read, the texture has that of `instead`, or is None.
        """
        document = self._document
        if not isinstance(info, dict):
            raise SceneError(f"{document.name}: {where} is {shown(info)}; it must be an object")
        texture = document.get("textures", info.get("index"))
        image = self._image(_source(texture), where, instead)
        if image is None:
            return None
        move = info.get("extensions", {}).get("KHR_texture_transform", {})
        uv_set = move.get("texCoord", info.get("texCoord", 0))
        if uv_set not in (0, 1):
            document.lose(f"TEXCOORD_{uv_set}", where)
        sampler, transform = {}, None
        with document.part(f"{where}: its sampler"):
            sampler = document.get("samplers", texture["sampler"]) if "sampler" in texture else {}
        with document.part(f"{where}: KHR_texture_transform"):
            transform = _uv_matrix(move) if move else None
        return Texture(
            image,
            wrap=(_wrap(sampler, "wrapS"), _wrap(sampler, "wrapT")),
            filter=self._filter(sampler, where),
            transform=transform,
            uv_set=1 if uv_set == 1 else 0,
            **arguments,
        )

    def _filter(self, sampler: dict[str, Any], where: str) -> Any:
        """Return the filter for all distances; samples of a pixel replace mipmaps."""
        near, far = sampler.get("magFilter"), sampler.get("minFilter")
        if {near, far} == {NEAREST, LINEAR}:
            self._document.lose("minFilter (magFilter counts at all distances)", where)
        return "nearest" if NEAREST in ((far,) if near is None else (near,)) else "bilinear"

    def _image(self, index: int, where: str, instead: StoredImage | None) -> StoredImage | None:
        """Return an image, decoded once, or `instead`, which is noted, if it cannot be read."""
        element = self._document.get("images", index)
        if index not in self._images:
            read = lambda: self._decoded(element, f"images[{index}]")  # noqa: E731
            image = self._document.files.shown(_called(element, index), read, where, instead)
            self._images[index] = None if image is instead else image
        return self._images[index] or instead

    def _decoded(self, element: dict[str, Any], place: str) -> StoredImage:
        document = self._document
        files, uri = document.files, element.get("uri")
        name = f"{document.name}: {place}" + (f" {element['name']!r}" if "name" in element else "")
        if "bufferView" in element:
            data, start, end, _ = document.view(element["bufferView"])
            image = files.decoded(name, data[start:end])
        elif not isinstance(uri, str):
            raise SceneError(f"{name} has neither a uri nor a bufferView")
        elif uri.startswith("data:"):
            image = files.decoded(name, document.uri(uri, place))
        else:
            image = files.stored(files.find(uri))
        self._pixels += image.codes.shape[0] * image.codes.shape[1]
        if self._pixels > IMAGES * files.limits.pixels:
            raise LimitError(
                f"{name} brings the images to {self._pixels} pixels in all; "
                f"the limit is {IMAGES * files.limits.pixels}"
            )
        return image


def _source(texture: dict[str, Any]) -> Any:
    """Return the number of the image of a texture."""
    extensions = texture.get("extensions", {})
    if WEBP in extensions:
        return extensions[WEBP].get("source")
    if "source" not in texture:
        raise SceneError(f"its image is given by {', '.join(extensions) or 'nothing'}, which is not read")
    return texture["source"]


def _called(element: dict[str, Any], index: int) -> str:
    """Return the name of an image in messages."""
    uri = element.get("uri")
    known = uri if isinstance(uri, str) and not uri.startswith("data:") else element.get("name")
    return f"images[{index}]" if known is None else str(known)


class _Reader:
    """Reads one material."""

    def __init__(self, materials: GltfMaterials, material: dict[str, Any], where: str) -> None:
        self._materials, self._json, self._where = materials, material, where
        self._document = materials._document
        self._file, self._losses = self._document.name, self._document.files.losses
        self._wanted: dict[str, Any] = {}
        self._lost: list[str] = []
        self._alpha_given: Any = None
        self._cutoff: float | None = None

    def spec(self) -> MaterialSpec:
        """Return the appearance of the material."""
        extensions = self._json.get("extensions", {})
        normal_map = self._normal_map()
        if "KHR_materials_pbrSpecularGlossiness" in extensions:
            self._specular_glossiness(extensions["KHR_materials_pbrSpecularGlossiness"])
            self._lost += [
                f"{name} beside KHR_materials_pbrSpecularGlossiness"
                for name in extensions
                if name not in BESIDE
            ]
        else:
            self._metallic_roughness(self._json.get("pbrMetallicRoughness", {}))
            self._extended(extensions)
        radiance = self._emission(extensions.get("KHR_materials_emissive_strength", {}))
        material, lost = build_material(self._wanted, normal_map)
        if radiance is not None:
            material.efficacy = OF_CANDELA
        material.name = printable(str(self._json["name"])) if self._json.get("name") else None
        two_sided = bool(self._json.get("doubleSided"))
        return MaterialSpec(material, radiance, two_sided, self._lost + lost, self._alpha_given, self._cutoff)

    def _extended(self, extensions: dict[str, Any]) -> None:
        """Read the extensions of metallic-roughness."""
        for name, rows in EXTENSIONS.items():
            if extensions.get(name) is not None:
                with self._document.part(f"{self._where}: {name}"):
                    self._fill(extensions[name], rows)
                    if name in MORE:
                        MORE[name](self, extensions[name])
        self._lost += [name for name in extensions if name not in KNOWN]

    def _fill(self, group: dict[str, Any], rows: tuple[Parameter, ...]) -> None:
        """Read the parameters of a table."""
        fill(self._wanted, rows, partial(self._factor, group), partial(self._varying, group))

    def _factor(self, group: dict[str, Any], row: Parameter) -> Any:
        """Return a number or a color (3,)."""
        if row.is_color:
            return self._color(group, row.theirs, list(row.default), row.high)
        return self._number(group, row.theirs, row.default, row.high)

    def _varying(self, group: dict[str, Any], row: Parameter, factor: Any) -> Texture | None:
        """Return the texture that a factor multiplies, None without one; it is not read where that is 0."""
        if not np.any(factor):
            return None
        return self._texture(group, row.image, srgb=row.channel is None, channel=row.channel, scale=factor)

    def _number(self, group: dict[str, Any], key: str, default: float, high: float = 1.0) -> float:
        return float(self._numbers(group, key, [default], high)[0])

    def _color(self, group: dict[str, Any], key: str, default: list[float], high: float = 1.0) -> Doubles:
        return self._numbers(group, key, default, high)

    def _numbers(self, group: dict[str, Any], key: str, default: list[float], high: float) -> Doubles:
        """Return numbers, clamped to [0, high], or their defaults, where they are malformed."""
        place, value = f"{self._where}.{key}", group.get(key, default)
        numbers = np.array(default)
        with self._document.part(place, "the default in its place"):
            numbers = floats(place, [value] if len(default) == 1 and key in group else value, len(default))
        return self._losses.within(place, numbers, 0, high)

    def _texture(
        self, group: dict[str, Any], key: str, instead: StoredImage | None = None, **arguments: Any
    ) -> Texture | None:
        place = f"{self._where}.{key}"
        if key not in group:
            return None
        with self._document.part(place, "left out" if instead is None else "gray in its place"):
            return self._materials.texture(group[key], place, instead, **arguments)
        return None if instead is None else Texture(instead, **arguments)

    def _metallic_roughness(self, group: dict[str, Any]) -> None:
        factor = self._color(group, "baseColorFactor", [1.0, 1.0, 1.0, 1.0])
        base = self._texture(group, "baseColorTexture", GRAY, scale=factor[:3])
        self._wanted["base_color"] = factor[:3] if base is None else base
        self._alpha(group, "baseColorTexture", float(factor[3]), base)
        self._fill(group, METALLIC_ROUGHNESS)

    def _specular_glossiness(self, group: dict[str, Any]) -> None:
        """Read the parameters of KHR_materials_pbrSpecularGlossiness, which replace metallic-roughness.

        The base is diffuse·(1 − max(specular)), the reflectance along the normal is specular, and the
        roughness is 1 − glossiness. A dielectric of index 1.5 with a tinted reflectance of 0.04 equals it.
        """
        diffuse = self._color(group, "diffuseFactor", [1.0, 1.0, 1.0, 1.0])
        specular = self._color(group, "specularFactor", [1.0, 1.0, 1.0])
        glossiness = self._number(group, "glossinessFactor", 1.0)
        map_key = "specularGlossinessTexture"
        varying = self._texture(group, map_key, scale=specular)
        if varying is None:
            diffuse[:3] *= 1 - specular.max()
        base = self._texture(group, "diffuseTexture", GRAY, scale=diffuse[:3])
        self._alpha(group, "diffuseTexture", float(diffuse[3]), base)
        color: Any = diffuse[:3] if base is None else base
        self._wanted["base_color"] = color if varying is None else Computed(beside_specular, color, varying)
        self._wanted["specular_color"] = specular / F0
        self._wanted["roughness"] = 1 - glossiness
        if varying is not None:
            self._wanted["specular_color"] = self._texture(group, map_key, scale=specular / F0)
            if varying.has_alpha:
                self._wanted["roughness"] = self._texture(
                    group, map_key, srgb=False, channel=3, scale=-glossiness, offset=1.0
                )

    def _alpha(self, group: dict[str, Any], key: str, factor: float, base: Texture | None) -> None:
        """Read the opacity of a base color: a factor, and the fourth channel of the texture `key`."""
        mode = self._json.get("alphaMode", "OPAQUE")
        if mode not in ("OPAQUE", "MASK", "BLEND"):
            place = f"{self._where}.alphaMode"
            self._losses.note(
                place, value=shown(mode), done="OPAQUE in its place, as it must be OPAQUE, MASK or BLEND"
            )
        if mode not in ("MASK", "BLEND"):
            return
        if mode == "MASK":
            self._cutoff = self._number(self._json, "alphaCutoff", 0.5, high=np.inf)
        alpha: Any = factor
        if base is not None and base.has_alpha:
            alpha = self._texture(group, key, srgb=False, channel=3, scale=factor)
        self._alpha_given = alpha
        if isinstance(alpha, Texture) or alpha != 1:
            self._wanted |= {"alpha": alpha} | ({"alpha_cutoff": self._cutoff} if mode == "MASK" else {})

    def _normal_map(self) -> NormalMap | None:
        if "occlusionTexture" in self._json:
            self._lost.append("occlusionTexture")
        texture = self._texture(self._json, "normalTexture", srgb=False)
        if texture is None:
            return None
        where = f"{self._where}.normalTexture"
        with self._document.part(where):
            scale = floats(f"{where}.scale", [self._json["normalTexture"].get("scale", 1)], 1)[0]
            return NormalMap(texture, scale)
        return None

    def _index(self, group: dict[str, Any]) -> None:
        if self._wanted.get("ior", 1.5) < 1:  # 0 means an infinite index: everything is reflected
            self._lost.append(f"ior {self._wanted.pop('ior'):g}")

    def _wall(self, group: dict[str, Any]) -> None:
        """Make a transmissive material thin, unless it has a volume."""
        volume = self._json["extensions"].get("KHR_materials_volume")
        thick = volume is not None and self._number(volume, "thicknessFactor", 0.0, high=np.inf) > 0
        if "transmission" in self._wanted and not thick:
            self._wanted["thin"] = True

    def _coat(self, group: dict[str, Any]) -> None:
        if "clearcoat" in self._wanted and "clearcoatNormalTexture" in group:
            self._lost.append("clearcoatNormalTexture")

    def _anisotropy(self, group: dict[str, Any]) -> None:
        strength = self._wanted.pop("anisotropy", None)
        if strength is None:
            return
        where = f"{self._where}.anisotropyRotation"
        degrees = np.degrees(floats(where, [group.get("anisotropyRotation", 0.0)], 1)[0])
        vectors = self._texture(group, "anisotropyTexture", srgb=False)
        across = self._wanted["roughness"]
        self._wanted["roughness_v"] = across
        self._wanted["rotation"] = (
            float(degrees) if vectors is None else Computed(direction, vectors, degrees, scalar=True)
        )
        if isinstance(across, Texture) or isinstance(strength, Texture):
            self._wanted["roughness"] = Computed(roughness_along, across, strength)
        else:
            self._wanted["roughness"] = float(np.sqrt(across**2 + (1 - across**2) * strength**2))

    def _cloth(self, group: dict[str, Any]) -> None:
        if "sheen_color" in self._wanted:
            self._wanted["sheen"] = 1.0

    def _iridescence(self, group: dict[str, Any]) -> None:
        factor = self._number(group, "iridescenceFactor", 0.0)
        if factor == 0:
            return
        if factor < 1 or "iridescenceTexture" in group:
            self._lost.append("iridescenceFactor or a texture of it (a film is everywhere)")
        thick = self._number(group, "iridescenceThicknessMaximum", 400.0, high=1e5)
        thin = self._number(group, "iridescenceThicknessMinimum", 100.0, high=1e5)
        spread: dict[str, Any] = {"srgb": False, "channel": 1, "scale": thick - thin, "offset": thin}
        texture = self._texture(group, "iridescenceThicknessTexture", **spread)
        if texture is not None or thick:
            self._wanted["film_thickness"] = thick if texture is None else texture
            self._wanted["film_ior"] = self._number(group, "iridescenceIor", 1.3, high=MAX_INDEX)

    def _volume(self, group: dict[str, Any]) -> None:
        """Beer–Lambert: `attenuationColor` is the transmittance over `attenuationDistance`."""
        if "thicknessTexture" in group:
            self._lost.append("thicknessTexture (light goes through the volume that the mesh encloses)")
        color = self._color(group, "attenuationColor", [1.0, 1.0, 1.0])
        if "attenuationDistance" in group and (color < 1).any():
            distance = self._number(group, "attenuationDistance", 1.0, high=np.inf)
            if distance == 0:
                raise SceneError("attenuationDistance is 0; it must be above 0")
            distance = max(distance, float(np.finfo(np.float32).tiny))  # not 0, as float32 divides by it
            with np.errstate(over="ignore"):
                self._wanted["absorption"] = -log(np.maximum(color, 1e-6).astype(np.float32)) / distance

    def _emission(self, strength: dict[str, Any]) -> Doubles | Texture | None:
        factor = self._color(self._json, "emissiveFactor", [0.0, 0.0, 0.0], high=FLOAT32_MAX)
        if (factor > 1).any():
            place = f"{self._where}.emissiveFactor"
            self._losses.note(place, value=f"{factor.tolist()}, above 1", done="taken as it is")
        factor = factor * self._number(strength, "emissiveStrength", 1.0, high=FLOAT32_MAX)
        if not factor.any():
            return None
        texture = self._texture(self._json, "emissiveTexture", scale=factor)
        if texture is None and "emissiveTexture" in self._json:  # most such images are dark
            return None
        return factor if texture is None else texture


def beside_specular(diffuse: Any, specular: Any) -> Any:
    """Return diffuse · (1 − max(specular)), by KHR_materials_pbrSpecularGlossiness."""
    red, green, blue = specular
    return (f4(1) - np.maximum(np.maximum(red, green), blue)) * diffuse


def roughness_along(across: Any, strength: Any) -> Any:
    """Return the roughness along the tangent: α is mix(across, 1, strength²), and roughness its root."""
    alpha = across * across
    return np.sqrt(alpha + (f4(1) - alpha) * strength * strength)


def direction(vectors: Any, degrees: Any) -> Any:
    """Return the rotation of the vector in red and green, and a further one, in degrees."""
    red, green, _ = vectors
    return arctan2(f4(2) * green - f4(1), f4(2) * red - f4(1)) * f4(180 / np.pi) + degrees


def _textured(ours: str, theirs: str, default: Any, channel: int | None = None, **more: Any) -> Parameter:
    """Return a parameter with the names that most have: `...Factor` and `...Texture`."""
    return Parameter(ours, f"{theirs}Factor", default, f"{theirs}Texture", channel, **more)


BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
# extensions of metallic-roughness, in the order in which they are read, and their parameters
EXTENSIONS: dict[str, tuple[Parameter, ...]] = {
    "KHR_materials_ior": (Parameter("ior", "ior", 1.5, neutral=1.5, high=MAX_INDEX),),
    "KHR_materials_transmission": (_textured("transmission", "transmission", 0.0, 0, neutral=0.0),),
    "KHR_materials_clearcoat": (
        _textured("clearcoat", "clearcoat", 0.0, 0, neutral=0.0),
        _textured("clearcoat_roughness", "clearcoatRoughness", 0.0, 1, beside="clearcoat"),
    ),
    "KHR_materials_sheen": (
        _textured("sheen_color", "sheenColor", BLACK, neutral=0.0),
        _textured("sheen_roughness", "sheenRoughness", 0.0, 3, beside="sheen_color"),
    ),
    "KHR_materials_anisotropy": (
        Parameter("anisotropy", "anisotropyStrength", 0.0, "anisotropyTexture", 2, neutral=0.0),
    ),
    "KHR_materials_specular": (
        _textured("specular", "specular", 1.0, 3, neutral=1.0),
        _textured("specular_color", "specularColor", WHITE, neutral=1.0, high=FLOAT32_MAX),
    ),
    "KHR_materials_iridescence": (),
    "KHR_materials_dispersion": (Parameter("dispersion", "dispersion", 0.0, neutral=0.0, high=np.inf),),
    "KHR_materials_volume": (),
}
# readers of extensions, after their parameters
MORE: dict[str, Callable[[_Reader, dict[str, Any]], None]] = {
    "KHR_materials_ior": _Reader._index,
    "KHR_materials_transmission": _Reader._wall,
    "KHR_materials_clearcoat": _Reader._coat,
    "KHR_materials_sheen": _Reader._cloth,
    "KHR_materials_anisotropy": _Reader._anisotropy,
    "KHR_materials_iridescence": _Reader._iridescence,
    "KHR_materials_volume": _Reader._volume,
}
# extensions whose properties are all read here or in gltf.py
KNOWN = {
    *EXTENSIONS,
    *BESIDE,
    "KHR_lights_punctual",
    "KHR_mesh_quantization",
    INSTANCING,
    DRACO,
    *MESHOPT,
    WEBP,
}
HARMLESS = {"KHR_xmp_json_ld", "KHR_materials_variants"}  # without effect on the picture of the file as it is


def _check_extensions(document: Document) -> None:
    """Note the extensions that are not read; their parameters are left out."""
    required = document.items("extensionsRequired")
    for name in dict.fromkeys(map(str, (*required, *document.items("extensionsUsed")))):
        if name not in KNOWN and name not in HARMLESS:
            document.lose(f"{name[:SHOWN]}{', which it requires' if name in required else ''}", "the file")


def _wrap(sampler: dict[str, Any], key: str) -> Any:
    return WRAPS.get(sampler.get(key, 10497), "repeat")


def _uv_matrix(move: dict[str, Any]) -> Doubles:
    """Return KHR_texture_transform as a matrix for v upwards."""
    offset = floats("offset", move.get("offset", [0, 0]), 2)
    scale = floats("scale", move.get("scale", [1, 1]), 2)
    angle = floats("rotation", [move.get("rotation", 0)], 1)[0]
    sin, cos = sin_cos_turns(np.float64(angle / (2 * np.pi)))
    # the signs follow the extension's example (a quarter turn that ends in the lower left), as viewers do;
    # the GLSL beside that example turns in the opposite direction
    moved = np.array(
        [[cos * scale[0], sin * scale[1], offset[0]], [-sin * scale[0], cos * scale[1], offset[1]], [0, 0, 1]]
    )
    matrix = FLIP @ moved @ FLIP
    if not np.abs(matrix).max() <= FLOAT32_MAX:
        raise SceneError("an element of its matrix is beyond float32")
    return matrix
