"""Materials of MaterialX documents."""

import numpy as np
import pytest
from inside import Texture

import wavefront as wf

pytest.importorskip("MaterialX")
HEAD = '<?xml version="1.0"?><materialx version="1.39" colorspace="lin_rec709">'
TYPES = {str: "filename", bool: "boolean", float: "float", tuple: "color3"}


def text(value) -> str:
    return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value).lower()


def inputs(values: dict) -> str:
    """Inputs with constants, or as they are."""
    return "".join(
        value
        if isinstance(value, str) and value.startswith("<")
        else f'<input name="{name}" type="{TYPES[type(value)]}" value="{text(value)}"/>'
        for name, value in values.items()
    )


def link(name: str, kind: str, node: str, output: str = "") -> str:
    by = f' output="{output}"' if output else ""
    return f'<input name="{name}" type="{kind}" nodename="{node}"{by}/>'


def document(shader: str = "open_pbr_surface", nodes: str = "", **values) -> str:
    return (
        f'{HEAD}{nodes}<{shader} name="S" type="surfaceshader">{inputs(values)}</{shader}>'
        '<surfacematerial name="M" type="material">'
        '<input name="surfaceshader" type="surfaceshader" nodename="S"/></surfacematerial></materialx>'
    )


@pytest.fixture
def load(tmp_path):
    def load(content: str | bytes, **options) -> dict:
        path = tmp_path / "a.mtlx"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return wf.load_materialx(path, **options)

    return load


@pytest.fixture
def image(tmp_path):
    colors = np.array([[[10, 100, 200], [60, 120, 240]], [[0, 30, 90], [255, 200, 128]]], np.uint8)
    wf.Image(np.zeros((2, 2, 3))).save(tmp_path / "a.png")
    import imageio.v3 as iio

    iio.imwrite(tmp_path / "a.png", colors)
    return colors


def node(category: str, kind: str, name: str, extra: str = "", space: str = "") -> str:
    space = f' colorspace="{space}"' if space else ""
    return (
        f'<{category} name="{name}" type="{kind}">'
        f'<input name="file" type="filename" value="a.png"{space}/>{extra}</{category}>'
    )


def test_constants_of_openpbr(load):
    values = {"base_color": (0.1, 0.2, 0.3), "specular_ior": 1.3, "coat_weight": 0.5, "fuzz_roughness": 0.2}
    ((name, material),) = load(document(**values, transmission_weight=0.5, geometry_thin_walled=True)).items()
    assert name == material.name == "M"
    for key, value in values.items():
        assert getattr(material.bsdf, key).ravel() == pytest.approx(np.ravel(value))
    assert material.bsdf.thin
    plain = load(document())["M"].bsdf
    assert repr(plain._layers) == repr(wf.OpenPBR().bsdf._layers)
    lamp = load(document(emission_luminance=2.0, geometry_opacity=0.5))["M"]
    assert lamp.emission.ravel() == pytest.approx(2)
    assert lamp.opacity.constant == 0.5


def test_standard_surface_is_translated(load):
    given = {"base": 0.5, "base_color": (0.2, 0.4, 0.6), "metalness": 0.3, "specular_IOR": 1.7}
    given |= {"coat": 0.4, "coat_color": (0.5, 1.0, 1.0), "thin_film_thickness": 300.0, "sheen": 0.2}
    bsdf = load(document("standard_surface", **given, opacity=(0.3, 0.3, 0.3)))["M"].bsdf
    assert bsdf.base_weight == pytest.approx(0.5)
    assert bsdf.base_color.ravel() == pytest.approx([0.2 * (1 - 0.4 * 0.5), 0.4, 0.6])  # by the coat's color
    assert bsdf.coat_weight == 0  # of a metal
    assert bsdf.specular_ior == pytest.approx(1.7)
    assert bsdf.specular_roughness == pytest.approx(0.2)
    assert (bsdf.thin_film_weight, bsdf.thin_film_thickness) == (1, pytest.approx(0.3))
    assert bsdf.fuzz_roughness == pytest.approx(0.3**0.4)
    assert load(document("standard_surface", specular_IOR=0.0))["M"].bsdf.specular_ior == pytest.approx(1e-3)


def test_gltf_is_translated(load):
    given = {"base_color": (0.2, 0.4, 0.6), "metallic": 0.0, "roughness": 0.3, "transmission": 1.0}
    material = load(document("gltf_pbr", **given, alpha=0.3, clearcoat=0.5, emissive=(1.0, 2.0, 3.0)))["M"]
    bsdf = material.bsdf
    assert bsdf.transmission_color.ravel() == pytest.approx([0.2, 0.4, 0.6])
    assert (bsdf.base_metalness, bsdf.coat_weight, bsdf.fuzz_weight) == (0, 0.5, 0)
    assert material.emission.ravel() == pytest.approx([1, 2, 3])
    assert material.opacity is None  # its mode is opaque


def test_the_preview_surface_of_usd_is_translated(load):
    given = {
        "diffuseColor": (0.2, 0.4, 0.6),
        "metallic": 0.25,
        "roughness": 0.3,
        "ior": 1.4,
        "clearcoat": 0.5,
    }
    given |= {"emissiveColor": (1.0, 2.0, 3.0), "clearcoatRoughness": 0.125}
    material = load(document("UsdPreviewSurface", **given, opacity=0.75))["M"]
    bsdf = material.bsdf
    assert bsdf.base_color.ravel() == pytest.approx([0.2, 0.4, 0.6])
    assert (bsdf.base_metalness, bsdf.coat_weight, bsdf.coat_roughness) == (0.25, 0.5, 0.125)
    assert (bsdf.specular_roughness, bsdf.specular_ior) == (pytest.approx(0.3), pytest.approx(1.4))
    assert material.emission.ravel() == pytest.approx([1, 2, 3])
    assert np.ravel(material.alpha) == pytest.approx(0.75)
    cut = load(document("UsdPreviewSurface", opacity=0.25, opacityThreshold=0.5))["M"]
    assert np.ravel(cut.alpha) == pytest.approx(0)
    whole = load(document("UsdPreviewSurface", opacity=0.75, opacityThreshold=0.5))["M"]
    assert whole.opacity is None


def test_the_principled_surface_of_disney_is_translated(load):
    given = {"baseColor": (0.2, 0.4, 0.6), "metallic": 0.25, "roughness": 0.3, "specular": 0.25}
    given |= {"clearcoat": 0.5, "clearcoatGloss": 0.0, "sheen": 0.5, "sheenTint": 1.0, "specTrans": 0.125}
    bsdf = load(document("disney_principled", **given))["M"].bsdf
    assert bsdf.base_color.ravel() == pytest.approx([0.2, 0.4, 0.6])
    assert bsdf.fuzz_color.ravel() == pytest.approx([0.2, 0.4, 0.6])
    assert bsdf.coat_roughness == pytest.approx(0.1**0.5)
    found = (bsdf.specular_weight, bsdf.coat_weight, bsdf.fuzz_weight, bsdf.transmission_weight)
    assert found == (0.5, 0.5, 0.5, 0.125)


def test_images(load, image):
    nodes = (
        node("image", "color3", "color", space="srgb_texture")
        + node("tiledimage", "float", "rough", '<input name="uvtiling" type="vector2" value="2, 3"/>')
        + node("image", "vector3", "normals")
        + f'<normalmap name="bent" type="vector3">{link("in", "vector3", "normals")}'
        '<input name="scale" type="float" value="0.5"/></normalmap>'
    )
    linked = {
        "base_color": link("base_color", "color3", "color"),
        "specular_roughness": link("specular_roughness", "float", "rough"),
        "geometry_normal": link("geometry_normal", "vector3", "bent"),
    }
    material = load(document(nodes=nodes, **linked))["M"]
    color, rough = material.bsdf.base_color, material.bsdf.specular_roughness
    assert color.srgb
    uv = np.array([[0.25], [0.75]], np.float32)
    assert color.lookup(uv).ravel() == pytest.approx(wf.srgb(*image[0, 0] / 255), rel=1e-3)
    assert isinstance(rough.numbers if hasattr(rough, "numbers") else rough, Texture)
    assert (rough.srgb, rough.scalar, rough.transform[0, 0], rough.transform[1, 1]) == (False, True, 2, 3)
    assert material.normal_map.strength == pytest.approx(0.5)


def test_products_of_images(load, image):
    nodes = node("image", "color3", "color") + (
        f'<multiply name="dim" type="color3">{link("in1", "color3", "color")}'
        '<input name="in2" type="color3" value="0.5, 1, 0.25"/></multiply>'
    )
    material = load(document(nodes=nodes, base_color=link("base_color", "color3", "dim")))["M"]
    uv = np.array([[0.25], [0.75]], np.float32)
    quad = wf.Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0), material=material)
    assert quad.material is material
    parts = material.bsdf.base_color.parts
    assert parts[0].lookup(uv).ravel() == pytest.approx(image[0, 0] / 255)
    assert parts[1].ravel() == pytest.approx([0.5, 1, 0.25])


def test_channels_of_gltf(load, image):
    nodes = node("gltf_image", "vector3", "orm") + (
        f'<separate3 name="parts" type="multioutput">{link("in", "vector3", "orm")}</separate3>'
    )
    given = {
        "metallic": link("metallic", "float", "parts", "outz"),
        "roughness": link("roughness", "float", "parts", "outy"),
    }
    bsdf = load(document("gltf_pbr", nodes, **given))["M"].bsdf
    uv = np.array([[0.25], [0.75]], np.float32)
    assert bsdf.base_metalness.lookup(uv) == pytest.approx(200 / 255)
    assert bsdf.specular_roughness.lookup(uv) == pytest.approx(100 / 255)


UNSUPPORTED = {
    "M: base_color by fractal3d 'f'": document(
        nodes='<fractal3d name="f" type="color3"/>', base_color=link("base_color", "color3", "f")
    ),
    "M: base_color by a node that does not exist": document(base_color=link("base_color", "color3", "g")),
    "M: OpenPBR: transmission_dispersion_scale": document(
        transmission_dispersion_scale=0.5, transmission_weight=0.5
    ),
    "M: OpenPBR: subsurface": document(subsurface_weight=0.5),
    "M: surfaceshader by surface_unlit": document("surface_unlit"),
    "the include of 'b.mtlx'": document(nodes='<xi:include href="b.mtlx" xmlns:xi="http://x"/>'),
    "nodes that lead to each other": document(
        nodes=f'<dot name="a" type="color3">{link("in", "color3", "b")}</dot>'
        f'<dot name="b" type="color3">{link("in", "color3", "a")}</dot>',
        base_color=link("base_color", "color3", "a"),
    ),
}


@pytest.mark.parametrize("message", UNSUPPORTED)
def test_what_is_not_honored_is_one_warning(load, message):
    with pytest.warns(UserWarning, match=message) as said:
        assert list(load(UNSUPPORTED[message])) == ["M"]
    assert len(said) == 1
    with pytest.raises(wf.SceneError, match=message):
        load(UNSUPPORTED[message], strict=True)


def test_inputs_of_a_graph(load):
    graph = (
        '<nodegraph name="G"><input name="a" type="float" value="0.3"/>'
        '<multiply name="m" type="float"><input name="in1" type="float" interfacename="a"/>'
        '<input name="in2" type="float" value="2"/></multiply>'
        '<output name="o" type="float" nodename="m"/></nodegraph>'
    )
    linked = '<input name="coat_weight" type="float" nodegraph="G" output="o"/>'
    assert load(document(nodes=graph, coat_weight=linked))["M"].bsdf.coat_weight == pytest.approx(0.6)


BOMB = "".join(
    f'<add name="n{k + 1}" type="float">{link("in1", "float", f"n{k}")}{link("in2", "float", f"n{k}")}</add>'
    for k in range(40)
)
WRONG = {
    "has no materials": f"{HEAD}</materialx>",
    "its root is <a>": "<a/>",
    "not a readable file": "<materialx",
    "has a document type": '<!DOCTYPE a [<!ENTITY b "c">]><materialx/>',
    "nested deeper than 32": HEAD + "<a>" * 50 + "</a>" * 50 + "</materialx>",
    "refers to nodes more than": document(
        nodes=f'<constant name="n0" type="float"/>{BOMB}', base_weight=link("base_weight", "float", "n40")
    ),
}


@pytest.mark.parametrize("message", WRONG)
def test_wrong_documents(load, message):
    with pytest.raises(wf.SceneError, match=r"a\.mtlx.*" if "file" not in message else ".*") as error:
        load(WRONG[message])
    assert message in str(error.value)


def test_a_wrong_value_costs_that_value(load):
    content = document(base_color=(2.0, 0.0, 0.0), base_metalness=0.5, specular_ior=-3.0)
    with pytest.warns(UserWarning, match="OpenPBRBsdf base_color") as caught:
        found = load(content)["M"].bsdf
    assert len(caught) == 1
    assert found.base_metalness == pytest.approx(0.5)
    assert np.ravel(found.base_color) == pytest.approx(np.ravel(wf.OpenPBR().bsdf.base_color))
    with pytest.raises(wf.SceneError, match="OpenPBRBsdf base_color"):
        load(content, strict=True)


@pytest.mark.parametrize("file", ["a.png", "../../a.png", "C:\\a.png", "broken.png"])
def test_images_that_cannot_be_read_are_gray(load, tmp_path, file):
    """And numbers have their defaults."""
    (tmp_path / "broken.png").write_bytes(b"\x89PNG")
    nodes = (node("image", "color3", "c") + node("image", "float", "f")).replace("a.png", file)
    links = {
        "base_color": link("base_color", "color3", "c"),
        "specular_roughness": link("specular_roughness", "float", "f"),
    }
    with pytest.warns(UserWarning, match=r"c: texture .*; gray in its place"):
        bsdf = load(document(nodes=nodes, **links))["M"].bsdf
    assert bsdf.base_color.mean().tolist() == [0.5, 0.5, 0.5]
    assert bsdf.specular_roughness == pytest.approx(0.3)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("seed", range(2))
def test_mutated_documents_are_materials_or_errors(load, image, seed):
    rng = np.random.default_rng(seed)
    nodes = node("image", "color3", "color") + node("tiledimage", "float", "r")
    whole = document(
        "standard_surface", nodes, base_color=link("base_color", "color3", "color"),
        specular_roughness=link("specular_roughness", "float", "r"), coat=0.5,
    )  # fmt: skip
    words = b'|0|-1|nan|1e99|color3|float|S|r|color|vector3|"|>|gltf_pbr|nodename|interfacename'.split(b"|")
    for _ in range(40):
        content = bytearray(whole.encode())
        for _ in range(rng.integers(1, 4)):
            at = int(rng.integers(len(content)))
            content[at : at + int(rng.integers(0, 6))] = words[rng.integers(len(words))]
        try:
            found = load(bytes(content))
        except wf.SceneError as error:
            message = str(error)
        else:
            assert all(isinstance(each, wf.Material) for each in found.values())
            continue
        assert "a.mtlx" in message
