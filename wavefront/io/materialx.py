"""Materials of MaterialX documents, by the library of that name.

A shading node of another kind than OpenPBR's is translated: standard surface by the graph that the library
brings, those of glTF, USD and Disney's model by tables. Graphs of constants and images are evaluated; of
others, the input has its default.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..arrays.vec import f4
from ..core.errors import SceneError, hear_warnings
from ..core.files import path_name
from ..core.suggestions import suggests_keywords
from ..materials import Material, OpenPBR
from ..textures.base import BaseTexture
from ..textures.image import Texture
from ..textures.normal_map import NormalMap
from .description.computed import computed
from .losses import Losses
from .sources import GRAY, LoadLimits, PathLike, SceneFiles, checked_limits, folders
from .xml_checks import look_through

Value = Any  # a number, a color (3,), a text, a texture, or a normal map
MAX_LINKS = 100  # from an input to an image
MAX_NODES = 10_000  # of a material, each counted as often as it is referred to
LEAST_INDEX = 1e-3
MAX_DEPTH = 32  # of elements in elements
WRAPS = {"periodic": "repeat", "clamp": "clamp", "mirror": "mirror"}
IMAGES = ("image", "tiledimage", "gltf_image", "gltf_colorimage")
# inputs of OpenPBR that `wf.OpenPBR` does not have
UNSUPPORTED = (
    "coat_roughness_anisotropy",
    "geometry_coat_normal",
    "geometry_tangent",
    "geometry_coat_tangent",
)
WITHOUT_EFFECT = (
    "subsurface_radius",
    "subsurface_radius_scale",
    "subsurface_scatter_anisotropy",
)
GLTF = {
    "base_color": "base_color",
    "metallic": "base_metalness",
    "roughness": "specular_roughness",
    "ior": "specular_ior",
    "specular": "specular_weight",
    "specular_color": "specular_color",
    "transmission": "transmission_weight",
    "clearcoat": "coat_weight",
    "clearcoat_roughness": "coat_roughness",
    "sheen_color": "fuzz_color",
    "sheen_roughness": "fuzz_roughness",
    "emissive": "emission_color",
    "emissive_strength": "emission_luminance",
    "alpha": "geometry_opacity",
    "normal": "geometry_normal",
}
USD = {  # of UsdPreviewSurface
    "diffuseColor": "base_color",
    "emissiveColor": "emission_color",
    "metallic": "base_metalness",
    "roughness": "specular_roughness",
    "ior": "specular_ior",
    "clearcoat": "coat_weight",
    "clearcoatRoughness": "coat_roughness",
    "opacity": "geometry_opacity",
    "normal": "geometry_normal",
}
DISNEY = {
    "baseColor": "base_color",
    "metallic": "base_metalness",
    "roughness": "specular_roughness",
    "anisotropic": "specular_roughness_anisotropy",
    "sheen": "fuzz_weight",
    "clearcoat": "coat_weight",
    "specTrans": "transmission_weight",
    "ior": "specular_ior",
    "subsurface": "subsurface_weight",
}
GLOSSY = (0.1, 0.001)  # α of the clear coat where its gloss is 0 and 1 (Burley 2012)


def _coat_roughness(gloss: Any) -> Any:
    """Return √α of the clear coat of Disney's model by its gloss."""
    rough, smooth = GLOSSY
    return np.sqrt(rough + (smooth - rough) * gloss)


def _doubled(value: Any) -> Any:
    return np.clip(2 * value, 0, 1)


def _power(a: Any, b: Any) -> Any:
    return np.power(np.maximum(a, 0), b)


def _mix(fg: Any, bg: Any, amount: Any) -> Any:
    return bg + (fg - bg) * amount


def _if_greater(a: Any, b: Any, yes: Any, no: Any) -> Any:
    return np.where(a > b, yes, no)


def _if_equal(a: Any, b: Any, yes: Any, no: Any) -> Any:
    return np.where(a == b, yes, no)


def _same(value: Any) -> Any:
    return value


# functions of each channel, and the names of their arguments
FUNCTIONS: dict[str, tuple[Callable[..., Any], tuple[str, ...]]] = {
    "add": (operator.add, ("in1", "in2")),
    "subtract": (operator.sub, ("in1", "in2")),
    "multiply": (operator.mul, ("in1", "in2")),
    "divide": (operator.truediv, ("in1", "in2")),
    "power": (_power, ("in1", "in2")),
    "min": (np.minimum, ("in1", "in2")),
    "max": (np.maximum, ("in1", "in2")),
    "clamp": (np.clip, ("in", "low", "high")),
    "invert": (operator.sub, ("amount", "in")),
    "mix": (_mix, ("fg", "bg", "mix")),
    "ifgreater": (_if_greater, ("value1", "value2", "in1", "in2")),
    "ifequal": (_if_equal, ("value1", "value2", "in1", "in2")),
    "dot": (_same, ("in",)),
    "constant": (_same, ("value",)),
}


class Lost(Exception):
    """A node that is not supported."""


class Wanted(NamedTuple):
    """A node whose value is wanted."""

    node: Any
    output: str  # which of its outputs
    kind: str  # the type of the input that reads it
    named: str  # the node, for messages
    value: Callable[[str], Value]  # of an input


@suggests_keywords
def load_materialx(
    path: PathLike,
    *,
    strict: bool = False,
    limits: LoadLimits | None = None,
    search_paths: PathLike | Sequence[PathLike] = (),
) -> dict[str, Material]:
    """Read the materials of a MaterialX document (.mtlx). It needs `pip install materialx`.

    Surfaces of OpenPBR, standard surface, glTF, UsdPreviewSurface and disney_principled become `OpenPBR`.
    Their inputs may be constants, images, normal maps, and sums, products and the like of these. What is not
    honored is one warning, which names materials, inputs and nodes.

    Parameters
    ----------
    path
        The file. Images are read only from its own folder, and folders below it.
    strict
        Raise an error in place of the warning.
    limits, search_paths
        As for `load`.

    Returns
    -------
    dict
        The materials by name, in the order of the file.

    Raises
    ------
    SceneError
        If the file or an image cannot be read, or a material has a value out of range.
    ImportError
        If the library is not installed.

    Examples
    --------
    >>> from importlib.util import find_spec
    >>> with open("clay.mtlx", "w") as file:
    ...     _ = file.write('''<materialx version="1.39">
    ...         <open_pbr_surface name="S" type="surfaceshader">
    ...           <input name="base_color" type="color3" value="0.5, 0.2, 0.1"/>
    ...         </open_pbr_surface>
    ...         <surfacematerial name="clay" type="material">
    ...           <input name="surfaceshader" type="surfaceshader" nodename="S"/>
    ...         </surfacematerial>
    ...       </materialx>''')
    >>> if find_spec("MaterialX"):
    ...     ball = wf.Sphere((0, 0, 0), 1, material=wf.load_materialx("clay.mtlx")["clay"])
    """
    with Losses(path_name(path), strict) as losses:
        return _materials(SceneFiles(path, folders(search_paths), checked_limits(limits), losses))


def _materials(files: SceneFiles) -> dict[str, Material]:
    name = files.name
    try:
        import MaterialX
    except ImportError as error:
        raise ImportError("MaterialX documents need materialx: pip install materialx") from error
    data = files.read(name)
    _check(name, data, files.losses)
    document = _Document(MaterialX, name, data, files)
    try:
        materials = {node.getName(): document.material(node) for node in document.materials()}
    except SceneError as error:
        raise error if str(error).startswith(name) else SceneError(f"{name}: {error}") from error
    except (RuntimeError, TypeError, UnicodeDecodeError, LookupError) as error:  # of the library
        raise SceneError(f"{name}: not a readable MaterialX document: {error}") from error
    if not materials:
        lost = [loss.part for loss in files.losses.found]
        raise SceneError(f"{name}: has no materials{'; not followed: ' * bool(lost)}{'; '.join(lost)}")
    return materials


def _check(name: str, data: bytes, losses: Losses) -> None:
    """Refuse what is no MaterialX document before the library reads it."""
    depth = 0

    def begin(tag: str, attributes: dict[str, str], at: int) -> None:
        nonlocal depth
        depth += 1
        if depth == 1 and tag != "materialx":
            raise SceneError(f"{name}: its root is <{tag}>, not <materialx>")
        if depth > MAX_DEPTH:
            raise SceneError(f"{name}: its elements are nested deeper than {MAX_DEPTH}")
        if tag == "include":
            losses.note(f"the include of {attributes.get('href', '')!r}")

    def end(tag: str, at: int) -> None:
        nonlocal depth
        depth -= 1

    look_through(name, data, begin, end)


class _Document:
    """A document of the library, and the conversion of its materials."""

    def __init__(self, library: Any, name: str, data: bytes, files: SceneFiles) -> None:
        self.library, self.name, self.files = library, name, files
        self.standard = library.createDocument()
        folder = library.getDefaultDataSearchPath()
        library.loadLibraries(library.getDefaultDataLibraryFolders(), folder, self.standard)
        self.document = library.createDocument()
        options = library.XmlReadOptions()
        options.readXIncludeFunction = None
        try:
            library.readFromXmlString(self.document, data.decode(), readOptions=options)
        except (library.Exception, RuntimeError, UnicodeDecodeError) as error:
            raise SceneError(f"{name}: not a readable MaterialX document: {error}") from error
        self.document.setDataLibrary(self.standard)
        self.nodes = 0

    def materials(self) -> list[Any]:
        """Return the nodes of all materials."""
        return [node for node in self.document.getMaterialNodes() if node.getCategory() == "surfacematerial"]

    def material(self, node: Any) -> Material:
        """Return the material of a node."""
        self.nodes = 0
        title, shaders = node.getName(), self.library.getShaderNodes(node)
        shader: Any = shaders[0] if shaders else None
        kind = None if shader is None else shader.getCategory()
        definition: Any = None if shader is None else shader.getNodeDef()
        if definition is None or kind not in TRANSLATIONS:
            self._lose(title, "surfaceshader", kind or "no node")
            return OpenPBR(name=title)
        if node.getInput("displacementshader") is not None:
            self._lose(title, "displacementshader", "displacement")
        inputs = {
            declared.getName(): self._input(title, shader, declared)
            for declared in definition.getActiveInputs()
        }
        return self._material(title, TRANSLATIONS[kind](self, title, inputs))

    def _material(self, title: str, inputs: dict[str, Value]) -> Material:
        for name in UNSUPPORTED:
            value = inputs.pop(name, None)
            if value is not None and np.any(np.not_equal(value, 0)):
                self._lose(title, name, "")
        values = {name: value for name, value in inputs.items() if value is not None}
        for name in WITHOUT_EFFECT:
            values.pop(name, None)
        if not isinstance(values.get("geometry_normal"), NormalMap):
            values.pop("geometry_normal", None)
        if not isinstance(values["specular_ior"], BaseTexture):  # 0 is allowed there
            values["specular_ior"] = max(float(values["specular_ior"]), LEAST_INDEX)
        if "geometry_thin_walled" in values:
            values["geometry_thin_walled"] = bool(values["geometry_thin_walled"])
        with hear_warnings(lambda message: self.files.losses.note(message, title, done="")):
            try:
                return OpenPBR(**values, name=title)
            except SceneError:
                return self._without_wrong(title, values)

    def _without_wrong(self, title: str, values: dict[str, Any]) -> Material:
        """Return a material of the inputs whose values are valid; the others get their defaults."""
        sound: dict[str, Any] = {}
        for name, value in values.items():
            with self.files.losses.part(f"material {title!r}", f"the default of {name} in its place"):
                OpenPBR(**{name: value})
                sound[name] = value
        try:
            return OpenPBR(**sound, name=title)
        except SceneError as error:  # of values together
            raise SceneError(f"{self.name}: material {title!r}: {error}") from error

    def _of_standard(self, title: str, inputs: dict[str, Value]) -> dict[str, Value]:
        """Return the inputs of OpenPBR for those of standard surface, by the library's graph."""
        graph = self.standard.getNodeGraph("NG_standard_surface_to_open_pbr_surface")
        openpbr = {}
        for output in graph.getOutputs():
            name = output.getName().removesuffix("_out")
            try:
                openpbr[name] = self._node(output.getConnectedNode(), "", inputs, 0)
            except Lost as error:
                self._lose(title, name, str(error))
        openpbr["geometry_normal"] = inputs["normal"]
        for name in ("specular_rotation", "coat_rotation", "transmission_extra_roughness"):
            if np.any(np.not_equal(inputs[name], 0)):
                self._lose(title, name, "")
        return openpbr

    def _of_gltf(self, title: str, inputs: dict[str, Value]) -> dict[str, Value]:
        """Return the inputs of OpenPBR for those of glTF's surface."""
        openpbr = {other: inputs[name] for name, other in GLTF.items()}
        if inputs["alpha_mode"] == 0:
            openpbr["geometry_opacity"] = 1.0
        elif inputs["alpha_mode"] == 1:
            compared = [openpbr["geometry_opacity"], inputs["alpha_cutoff"], 1.0, 0.0]
            openpbr["geometry_opacity"] = _combined(_if_greater, compared)
        cloth = isinstance(openpbr["fuzz_color"], BaseTexture) or np.any(openpbr["fuzz_color"])
        openpbr["fuzz_weight"] = 1.0 if cloth else 0.0
        distance = inputs["attenuation_distance"]
        if inputs["thickness"] and 0 < distance < np.inf:
            openpbr |= {"transmission_depth": distance, "transmission_color": inputs["attenuation_color"]}
        else:
            openpbr["transmission_color"] = openpbr["base_color"]
        for name in ("iridescence", "dispersion", "anisotropy_strength"):
            if np.any(np.not_equal(inputs.get(name, 0) or 0, 0)):
                self._lose(title, name, "")
        return openpbr

    def _of_usd(self, title: str, inputs: dict[str, Value]) -> dict[str, Value]:
        """Return the inputs of OpenPBR for those of USD's preview surface."""
        openpbr = {other: inputs[name] for name, other in USD.items()}
        openpbr["emission_luminance"] = 1.0
        cutoff = inputs["opacityThreshold"]
        if isinstance(cutoff, BaseTexture) or cutoff > 0:
            openpbr["geometry_opacity"] = _combined(
                _if_greater, [cutoff, openpbr["geometry_opacity"], 0.0, 1.0]
            )
        if inputs["useSpecularWorkflow"] == 1:
            self._lose(title, "useSpecularWorkflow", "")
        if np.any(np.not_equal(inputs["displacement"], 0)):
            self._lose(title, "displacement", "")
        return openpbr

    def _of_disney(self, title: str, inputs: dict[str, Value]) -> dict[str, Value]:
        """Return the inputs of OpenPBR for those of Disney's principled surface."""
        openpbr = {other: inputs[name] for name, other in DISNEY.items()}
        openpbr["coat_roughness"] = _combined(_coat_roughness, [inputs["clearcoatGloss"]])
        openpbr["specular_weight"] = _combined(_doubled, [inputs["specular"]])
        openpbr["subsurface_color"] = openpbr["transmission_color"] = openpbr["base_color"]
        tint = _combined(_mix, [inputs["baseColor"], 1.0, inputs["sheenTint"]])
        openpbr["fuzz_color"] = np.broadcast_to(tint, 3) if not isinstance(tint, BaseTexture) else tint
        if np.any(np.not_equal(inputs["specularTint"], 0)):
            self._lose(title, "specularTint", "")
        return openpbr

    def _input(self, title: str, shader: Any, declared: Any) -> Value:
        """Return the value of an input of a shader, by default the declared one; None if it has none."""
        default, port = _plain(declared), shader.getInput(declared.getName())
        if port is None:
            return default
        try:
            return self._value(port, declared.getType(), {}, 0)
        except Lost as error:
            self._lose(title, declared.getName(), str(error))
            return default

    def _value(self, port: Any, kind: str, interface: dict[str, Value], depth: int) -> Value:
        """Return the value of an input: of a node, of the interface of its graph, or its own."""
        if depth > MAX_LINKS:
            raise Lost("nodes that lead to each other")
        if port.getInterfaceName() in interface:
            return interface[port.getInterfaceName()]
        if port.getInterfaceName() and (outer := port.getInterfaceInput()) is not None:
            return self._value(outer, kind, interface, depth + 1)
        node = port.getConnectedNode()
        if node is not None:
            outer = port if port.getNodeName() else port.getConnectedOutput()
            return self._node(node, outer.getOutputString(), interface, depth + 1, kind)
        if port.getNodeName() or port.getNodeGraphString() or port.getOutputString():
            raise Lost("a node that does not exist")
        if (value := _plain(port)) is None:
            raise Lost("an input without a value")
        return value

    def _node(self, node: Any, output: str, interface: dict[str, Value], depth: int, kind: str = "") -> Value:
        """Return the value of a node, of the type `kind` of the input that reads it, by default its own."""
        if node is None:
            raise Lost("a node that does not exist")
        self.nodes += 1
        if self.nodes > MAX_NODES:
            raise SceneError(f"{self.name}: a material refers to nodes more than {MAX_NODES} times")
        kind, category = kind or node.getType(), node.getCategory()
        named = f"{category} {node.getName()!r}"

        def value(name: str) -> Value:
            port, definition = node.getInput(name), node.getNodeDef()
            declared = None if definition is None else definition.getActiveInput(name)
            if port is None and declared is None:
                raise Lost(f"{named} without {name!r}")
            if port is None:
                return _plain(declared)
            return self._value(port, port.getType(), interface, depth)

        try:
            if category in FUNCTIONS:
                function, names = FUNCTIONS[category]
                return _combined(function, [value(name) for name in names])
            if category in NODES:
                return NODES[category](self, Wanted(node, output, kind, named, value))
        except (ValueError, IndexError, TypeError, AttributeError, ArithmeticError) as error:
            if isinstance(error, SceneError):
                raise
            raise Lost(f"{named}: {error}") from error
        raise Lost(named)

    def _colors(self, wanted: Wanted) -> Texture:
        """Return an image, or one channel of it."""
        channel = 3 if wanted.output == "outa" else 0 if wanted.kind == "float" else None
        return self._image(wanted.node, channel, wanted.value)

    def _separated(self, wanted: Wanted) -> Texture:
        """Return a channel of an image."""
        source = wanted.node.getInput("in").getConnectedNode()
        if source is None or source.getCategory() not in IMAGES:
            raise Lost(wanted.named)
        channel = {"outx": 0, "outr": 0, "outy": 1, "outg": 1, "outz": 2, "outb": 2}[wanted.output]
        return self._image(source, channel, lambda name: _plain(source.getInput(name)))

    def _image(self, node: Any, channel: int | None, value: Callable[[str], Value]) -> Texture:
        file = node.getInput("file")
        reference = "" if file is None else file.getResolvedValueString()
        space = "" if file is None else file.getActiveColorSpace()
        if not reference or space not in ("", "none", "raw", "lin_rec709", "srgb_texture", "Utility - Raw"):
            raise Lost(f"{node.getCategory()} {node.getName()!r} of color space {space!r}")
        if (texcoord := node.getInput("texcoord")) is not None and texcoord.getConnectedNode() is not None:
            where = texcoord.getConnectedNode()
            if where.getCategory() != "texcoord" or where.getInput("index") is not None:
                raise Lost(f"{where.getCategory()} {where.getName()!r}")
        instead = GRAY if channel is None else None
        picture = self.files.picture(reference, place=node.getName(), instead=instead)
        if picture is None:
            raise Lost(f"the image {reference!r}, which cannot be read")
        tiled = node.getCategory() == "tiledimage"
        (u, v), (du, dv) = (value("uvtiling"), value("uvoffset")) if tiled else ((1, 1), (0, 0))
        transform = None if (u, v, du, dv) == (1, 1, 0, 0) else [[u, 0, -du], [0, v, -dv], [0, 0, 1]]
        modes = [node.getInput(name) for name in ("uaddressmode", "vaddressmode")]
        wraps = [WRAPS.get("periodic" if mode is None else mode.getValueString()) for mode in modes]
        if None in wraps:
            raise Lost(f"image {node.getName()!r} with a constant outside")
        closest = (mode := node.getInput("filtertype")) is not None and mode.getValueString() == "closest"
        return Texture(
            picture,
            srgb=space == "srgb_texture",
            wrap=tuple(wraps),  # type: ignore[arg-type]
            filter="nearest" if closest else "bilinear",
            transform=transform,
            channel=channel,
        )

    def _normal(self, wanted: Wanted) -> NormalMap:
        whole = wanted.node.getCategory() == "gltf_normalmap"
        image = self._image(wanted.node, None, wanted.value) if whole else wanted.value("in")
        if not isinstance(image, Texture):
            raise Lost(f"normalmap {wanted.node.getName()!r}")
        scale = np.ones(1) if whole else np.ravel(wanted.value("scale"))
        return NormalMap(image, float(scale[0]))

    def _lose(self, material: str, name: str, what: str) -> None:
        self.files.losses.note(f"{name}{f' by {what}' if what else ''}", material)


def _plain(port: Any) -> Value:
    """Return the constant of an input: a number, a text, or a tuple of numbers; None if it has none."""
    value = port.getValue()
    if value is None or isinstance(value, str | bool | int | float):
        if port.getType() in ("float", "color3") and not isinstance(value, float | None):
            raise Lost(f"a {port.getType()} that is {value!r}")
        return value
    return tuple(float(component) for component in value)


def _number(value: Value) -> Any:
    """Return a constant as an array of numbers."""
    if isinstance(value, BaseTexture):
        raise Lost("images")
    return np.ravel(np.asarray(value, f4))


def _combined(function: Callable[..., Any], arguments: list[Value]) -> Value:
    """Return a function of numbers, colors and textures."""
    textures = [argument for argument in arguments if isinstance(argument, BaseTexture)]
    known = [
        argument if isinstance(argument, BaseTexture) else np.asarray(argument, f4) for argument in arguments
    ]
    ones = all(np.all(argument == 1) for argument in known if not isinstance(argument, BaseTexture))
    if function is operator.mul and len(textures) == 1 and ones:  # a texture stays one, with its limits
        return textures[0]
    return arguments[0] if function is _same else computed(function, *known, rising=False)


def _converted(document: _Document, wanted: Wanted) -> Value:
    """Return a number or a color as a type."""
    value = wanted.value("in")
    if isinstance(value, BaseTexture) or np.ndim(value) or wanted.kind == "float":
        return value
    return np.full(2 if wanted.kind == "vector2" else 3, value, f4)


def _dot(document: _Document, wanted: Wanted) -> float:
    return float(np.dot(_number(wanted.value("in1")), _number(wanted.value("in2"))))


def _extracted(document: _Document, wanted: Wanted) -> float:
    return float(_number(wanted.value("in"))[int(wanted.value("index"))])


# how each kind of surface becomes inputs of OpenPBR
TRANSLATIONS: dict[Any, Callable[[_Document, str, dict[str, Value]], dict[str, Value]]] = {
    "open_pbr_surface": lambda document, title, inputs: inputs,
    "standard_surface": _Document._of_standard,
    "gltf_pbr": _Document._of_gltf,
    "UsdPreviewSurface": _Document._of_usd,
    "disney_principled": _Document._of_disney,
}
# the values of nodes that are no functions of each channel
NODES: dict[str, Callable[[_Document, Wanted], Value]] = {
    **dict.fromkeys(IMAGES, _Document._colors),
    "normalmap": _Document._normal,
    "gltf_normalmap": _Document._normal,
    "separate3": _Document._separated,
    "convert": _converted,
    "dotproduct": _dot,
    "extract": _extracted,
}
