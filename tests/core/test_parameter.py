"""Parameters are checked when they are assigned, as they are in the constructor, and shown."""

import copy
import inspect
import pickle
from typing import Literal, get_type_hints

import numpy as np
import pytest
from significance import render

import wavefront as wf

CAMERA = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=30, size=(8, 8))
ROUGH = {"roughness": 0.5}
MATERIALS = {  # a material, and for each of its parameters a new value
    "Diffuse": (wf.Diffuse(0.8), {"reflectance": (0.1, 0.2, 0.3)}),
    "Mirror": (wf.Mirror(), {"reflectance": 0.25}),
    "Conductor": (
        wf.Conductor.named("gold"),
        {"eta": 2.0, "k": (1, 2, 3), **ROUGH, "roughness_v": 0.2, "shadowing": "separable"},
    ),
    "Dielectric": (
        wf.Dielectric(),
        {"ior": (1.3, 1.4, 1.6), **ROUGH, "reflectance": 0.5, "transmittance": 0.6, "film_thickness": 300},
    ),
    "ThinDielectric": (wf.ThinDielectric(), {"ior": 1.3, **ROUGH, "reflectance": 0.5, "transmittance": 0.6}),
    "Plastic": (
        wf.Plastic(),
        {"reflectance": 0.3, **ROUGH, "ior": 1.8, "specular_reflectance": 0.6, "distribution": "beckmann"},
    ),
    "OrenNayar": (wf.OrenNayar(), {"reflectance": 0.7, "sigma": 0.1}),
    "Mix": (
        wf.Mix(wf.Diffuse(0.3), wf.Diffuse(0.6)),
        {"first": wf.Mirror(0.5), "second": wf.Dielectric(1.5), "weight": 0.25},
    ),
    "Disney": (
        wf.Disney(),
        {
            "base_color": 0.3,
            "metallic": 0.2,
            "transmission": 0.3,
            "flatness": 0.4,
            "clearcoat": 0.5,
            "sheen": 0.2,
        },
    ),
    "Sides": (wf.Sides(wf.Diffuse(0.3)), {"front": wf.Mirror(0.5), "back": wf.Diffuse(0.2)}),
    "Material": (
        wf.Material(wf.Dielectric()),
        {
            "bsdf": wf.Diffuse(0.3),
            "alpha": 0.75,
            "normal_map": wf.NormalMap(np.full((1, 1, 3), 0.6)),
            "interior": wf.Medium(0.5),
        },
    ),
    "shining Material": (wf.Material(wf.Diffuse()), {"emission": 0.5}),
    "Principled": (
        wf.Principled(),
        {
            "base_color": (0.2, 0.3, 0.4),
            "metallic": 0.5,
            **ROUGH,
            "ior": 1.3,
            "transmission": 0.5,
            "clearcoat": 1.0,
            "sheen": 0.5,
        },
    ),
}


def seen(material: wf.Bsdf | None, *lights) -> bytes:
    ball = wf.Sphere((0, 0, 0), 1, material=material)
    return render(wf.Scene(ball, lights or [wf.Environment()], CAMERA), 4).rgb.tobytes()


@pytest.mark.parametrize("kind", MATERIALS)
def test_an_assigned_parameter_is_as_a_given_one(kind: str) -> None:
    """The picture is that of a material made with it: what follows from it changes, too."""
    material, changes = copy.deepcopy(MATERIALS[kind])
    before = seen(material)
    for name, value in changes.items():
        setattr(material, name, value)
    assert seen(material) != before
    given = {
        name: value
        for name, value in {**vars(MATERIALS[kind][0]), **changes}.items()
        if name in wf_parameters(type(material))
    }
    assert seen(material) == seen(type(material)(**given))


def wf_parameters(kind: type) -> list[str]:
    import inspect

    return list(inspect.signature(kind).parameters)


@pytest.mark.parametrize(
    ("thing", "name", "value", "message"),
    [
        (wf.Diffuse(), "reflectance", 5.0, r"Diffuse reflectance is 5; it must be in \[0, 1\]"),
        (wf.Diffuse(), "reflectance", "rde", r"Diffuse reflectance is 'rde', which is no color"),
        (wf.Diffuse(), "reflectance", None, r"Diffuse reflectance "),
        (wf.Mirror(), "reflectance", (0, -1, 0), r"Mirror reflectance\[1\] is -1"),
        (wf.Conductor(1, 1), "roughness", 2, r"Conductor roughness is 2; it must be in \[0, 1\]"),
        (wf.Conductor(1, 1), "eta", 0, r"Conductor eta is 0; it must be more than 0"),
        (wf.Dielectric(), "ior", -1, r"Dielectric ior is -1; it must be more than 0"),
        (wf.OrenNayar(0.5, 1, energy_preserving=True), "sigma", 1.5, r"sigma is .*1.5.*to preserve energy"),
        (wf.Mix(wf.Mirror(), wf.Mirror()), "first", 3, r"Mix first must be a Bsdf such as .*, got 3"),
        (wf.Principled(), "metallic", np.nan, r"Principled metallic is nan"),
        (wf.PointLight((0, 0, 0), 1), "intensity", -1, r"PointLight intensity is -1; it must be at least 0"),
        (wf.PointLight((0, 0, 0), 1), "position", (0, 1), r"PointLight position must have shape \(3,\)"),
        (wf.SpotLight((0, 0, 0), 1, target=(0, 0, 1)), "angle", 200, r"SpotLight angle is 200"),
        (wf.SpotLight((0, 0, 0), 1, target=(0, 0, 1)), "blend", 2, r"SpotLight blend is 2"),
        (wf.DirectionalLight((0, 0, 1), 1), "direction", (0, 0, 0), r"direction is \[0.0, 0.0, 0.0\]"),
        (wf.DirectionalLight((0, 0, 1), 1), "angle", -3, r"DirectionalLight angle is -3"),
        (wf.Environment(), "radiance", -1, r"Environment radiance is -1; it must be at least 0"),
        (wf.Sphere((0, 0, 0), 1, name="sun"), "emission", -1, r"sun: emission is -1"),
        (
            wf.Sphere((0, 0, 0), 1, name="sun"),
            "material",
            "reed",
            r"sun: material is 'reed'; it must be one of",
        ),
        (wf.Mesh(np.eye(3), [[0, 1, 2]], name="roof"), "emission", "x", r"roof: emission is 'x'"),
        (wf.Mesh(np.eye(3), [[0, 1, 2]], name="roof"), "material", 1, r"roof: material must be a material"),
    ],
)
def test_wrong_values_are_refused_and_change_nothing(thing, name: str, value, message: str) -> None:
    thing = copy.deepcopy(thing)
    before = getattr(thing, name)
    with pytest.raises(wf.SceneError, match=message):
        setattr(thing, name, value)
    after = getattr(thing, name)
    assert after is before or np.array_equal(after, before)


def test_lights_change_as_they_are_assigned() -> None:
    sky = wf.Environment(0.5)
    first = seen(None, sky)
    sky.radiance = np.random.default_rng(0).random((4, 8, 3))
    assert seen(None, sky) != first
    sky.radiance = 0.5
    assert seen(None, sky) == first
    spot = wf.SpotLight((0, 0, 4), 10, target=(0, 0, 0))
    spot.intensity, spot.direction = (1, 2, 3), (0, 0.1, -2)
    assert seen(None, spot) == seen(None, wf.SpotLight((0, 0, 4), (1, 2, 3), direction=(0, 0.1, -2)))


def test_none_brings_the_default_back() -> None:
    ball = wf.Sphere((0, 0, 0), 1, material=wf.Mirror())
    ball.material = None
    assert type(ball.material.bsdf) is wf.Diffuse


def test_copies_keep_their_parameters() -> None:
    """Balls of all materials, in a row, look the same with copies of them."""
    camera = wf.Camera.orthographic((0, 0, 5), (0, 0, 0), height=1, size=(8 * len(MATERIALS), 8))

    def row(copied):
        balls = [
            wf.Sphere((k - (len(MATERIALS) - 1) / 2, 0, 0), 0.5, material=copied(material))
            for k, (material, _) in enumerate(MATERIALS.values())
        ]
        return render(
            wf.Scene(balls, [wf.Environment(np.linspace(0, 1, 96).reshape(4, 8, 3))], camera), 4
        ).rgb

    plain = row(lambda material: material)
    assert all(ball.std() > 0 for ball in np.split(plain, len(MATERIALS), 1))
    for copied in (copy.copy, copy.deepcopy, lambda material: pickle.loads(pickle.dumps(material))):
        assert row(copied).tobytes() == plain.tobytes()


@pytest.mark.parametrize(
    ("thing", "text"),
    [
        (wf.Diffuse(0.8), "Diffuse(reflectance=0.8)"),
        (
            wf.Material(wf.Diffuse((0.8, 0.2, 0.1)), alpha=0.5),
            "Material(bsdf=Diffuse(reflectance=(0.8, 0.2, 0.1)), alpha=0.5)",
        ),
        (wf.Diffuse(wf.VertexColors()), "Diffuse(reflectance=VertexColors("),
        (wf.Dielectric(1.5), "Dielectric(ior=1.5, roughness=0)"),
        (
            wf.Material(wf.Dielectric(), interior=wf.Medium((1, 0, 0))),
            "Material(bsdf=Dielectric(ior=1.5, roughness=0), interior=Medium(absorption=(1, 0, 0), scatt",
        ),
        (
            wf.Mix(wf.Mirror(), wf.Diffuse()),
            "Mix(first=Mirror(reflectance=1), second=Diffuse(reflectance=0.5), weight",
        ),
        (wf.Principled(0.5, clearcoat=1.0), "transmission=0, clearcoat=1"),
        (wf.PointLight((0, 1, 2.5), 3), "PointLight(position=(0, 1, 2.5), intensity=3)"),
        (
            wf.SpotLight((0, 0, 0), 3, target=(0, 0, -2)),
            "SpotLight(position=(0, 0, 0), intensity=3, direction=(0, 0, -1))",
        ),
        (
            wf.DirectionalLight((0, -2, 0), 3, angle=0.5),
            "DirectionalLight(direction=(0, -1, 0), irradiance=3, angle=0.5)",
        ),
        (wf.Environment((1, 2, 3)), "Environment(radiance=(1, 2, 3))"),
        (wf.Texture(np.ones((2, 4))), "<Texture 'array': 4 × 2>"),
        (CAMERA, "<Camera: Perspective(fov=30, focus=5) at (0, 0, 5) towards (0, 0, -1), 8 × 8>"),
        (wf.Camera.orthographic((0, 0, 5), (0, 0, 0), height=3), "<Camera: Orthographic(height=3) at"),
        (wf.Camera.panorama((0, 0, 0), crop=(0, 0, 3, 2)), "<Camera: Panorama() at"),
    ],
)
def test_repr_shows_the_parameters(thing, text: str) -> None:
    assert text in repr(thing)


def test_an_own_material_is_shown() -> None:
    class Phong(wf.Bsdf):
        def __init__(self, exponent: float) -> None:
            self.exponent = exponent

        def f(self, wo, wi):
            return np.zeros_like(wi)

    assert repr(Phong(3.0)) == "Phong(exponent=3)"


def test_a_large_array_is_shown_by_its_shape() -> None:
    lights = wf.PointLights(np.zeros((1000, 3)), np.ones(3))
    assert repr(lights) == "PointLights(positions=<array (1000, 3)>, intensities=(1, 1, 1))"


BYTES = np.full((4, 4), 200, np.uint8)


def floats(value: float, **options) -> wf.Texture:
    return wf.Texture(np.full((4, 4, 3), float(value)), **options)


RANGE = r"; it must be in \[0, 1\]"
OUT_OF_RANGE = {
    "bytes as floats": (
        lambda: wf.Diffuse(floats(255)),
        rf"Diffuse reflectance: <Texture 'array'.* 255{RANGE}",
    ),
    "what to do": (lambda: wf.Diffuse(floats(255)), r"Values from 0 to 255 are passed as uint8"),
    "below 0": (lambda: wf.Diffuse(floats(-1)), rf"Diffuse reflectance: <Texture 'array'.* -1{RANGE}"),
    "scaled bytes": (lambda: wf.Diffuse(wf.Texture(BYTES, srgb=False, scale=3)), r"has the value 2.35"),
    "offset": (lambda: wf.Diffuse(wf.Texture(BYTES * 0, offset=-0.5)), r"has the value -0.5"),
    "roughness": (lambda: wf.Conductor(1, 1, floats(1.5, channel=0)), rf"Conductor roughness.* 1.5{RANGE}"),
    "eta": (lambda: wf.Conductor(floats(-1), 1), r"Conductor eta.* -1; it must be"),
    "ior": (lambda: wf.Dielectric(floats(0, channel=0)), r"Dielectric ior.* 0; it must be more than 0"),
    "alpha": (lambda: wf.Material(wf.Diffuse(), alpha=floats(3, channel=0)), rf"Material alpha.* 3{RANGE}"),
    "times": (lambda: wf.VertexColors(floats(3)), rf"VertexColors times.* 3{RANGE}"),
    "emission": (
        lambda: wf.Mesh(np.eye(3), [[0, 1, 2]], emission=floats(-3)),
        r"mesh: emission.* -3; it must be at least 0",
    ),
    "assigned": (lambda: setattr(wf.Mirror(), "reflectance", floats(9)), rf"Mirror reflectance.* 9{RANGE}"),
}


@pytest.mark.parametrize("name", OUT_OF_RANGE)
def test_textures_out_of_range_are_refused(name: str) -> None:
    """Naming what they are used as, the texture, the value, the limit, and what to do."""
    make, message = OUT_OF_RANGE[name]
    with pytest.raises(wf.SceneError, match=message):
        make()


def test_textures_in_range_are_taken() -> None:
    """an emission may be above 1; scale and offset count; one channel of several too."""
    codes = np.random.default_rng(0).integers(0, 256, (4, 4, 3), np.uint8)
    wf.Diffuse(wf.Texture(codes))
    wf.Diffuse(wf.Texture(codes.astype(np.uint16) * 257))
    wf.Diffuse(wf.Texture(codes.astype(np.float32), scale=1 / 255))
    wf.Diffuse(wf.Texture(np.full((2, 2, 3), 3.0), scale=-1, offset=3.5))
    wf.Diffuse(wf.Texture(np.array([[[0.5, 7.0, 0.1]]]), channel=0))
    wf.Mesh(np.eye(3), [[0, 1, 2]], emission=wf.Texture(np.full((2, 2, 3), 300.0)))
    assert wf.Texture(np.array([[[0.25, 0.5, 2.0]]]), scale=2).limits() == (0.5, 4.0)


def test_faces_are_checked_again() -> None:
    """They may have been changed before the vertices were."""
    mesh = wf.Mesh(np.eye(3), [[0, 1, 2]], name="roof")
    scene = wf.Scene(mesh, wf.Environment())
    mesh.faces = mesh.faces + 100
    with pytest.raises(wf.SceneError, match=r"roof: faces\[0\]\[0\] is 100; it must be in \[0, 2\]"):
        render(scene, 1)
    mesh.faces, mesh.vertices = mesh.faces - 99, np.eye(4)[:, :3]
    render(scene, 1, size=(4, 4))


def test_arrays_of_shapes_are_converted_when_they_are_assigned() -> None:
    """As in the constructor: lists become arrays, and numbers are checked."""
    ball = wf.Sphere((0, 0, 0), 1)
    ball.center, ball.radius = (0, 1, 2), 3
    assert ball.center.dtype == np.float64
    assert ball.bounds.tolist() == [[-3, -2, -1], [3, 4, 5]]
    triangle = wf.Mesh(np.eye(3), [[0, 1, 2]])
    triangle.vertices = [[0, 0, 0], [2, 0, 0], [0, 2, 0]]
    triangle.uvs = [[0, 0], [1, 0], [0, 1]]
    triangle.colors = np.full((3, 3), 255, np.uint8)
    assert (triangle.colors == 1).all()
    placed = wf.Instance(triangle, np.eye(4))
    placed.transform = np.diag([2, 2, 2, 1]).tolist()
    assert placed.bounds.tolist() == [[0, 0, 0], [4, 4, 0]]


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("center", (0, np.nan, 0), r"ball: center\[1\] is nan; it must be finite"),
        ("center", 1, r"ball: center must have shape \(3,\)"),
        ("radius", -1, r"ball: radius is -1; it must be above 0"),
        ("vertices", [[0, 0]], r"mesh: vertices must have shape \(n, 3\)"),
        ("faces", [[0.5, 1, 2]], r"mesh: faces must be integers of shape \(m, 3\)"),
        ("normals", "up", r"mesh: normals must be numeric"),
        ("uvs", [[0, 1e300]] * 3, r"mesh: uvs\[0\]\[1\] is 1e\+300"),
        ("colors", np.full((3, 3), 7.0), r"mesh: colors\[0\]\[0\] is 7; it must be in \[0, 1\], or uint8"),
        ("transform", np.zeros((4, 4)), r"ball: transform must have shape \(3, 3\)"),
        ("transform", np.zeros((4, 4)), r"mesh: transform has the last row"),
    ],
)
def test_wrong_values_are_refused_when_they_are_assigned(name, value, message) -> None:
    mesh = wf.Mesh(np.eye(3), [[0, 1, 2]])
    shapes = [wf.Sphere((0, 0, 0), 1, name="ball"), mesh, wf.Instance(mesh, np.eye(4))]
    of_ball = message.startswith("ball")
    shape = next(shape for shape in shapes if name in vars(shape) and (shape.name == "ball") == of_ball)
    before = getattr(shape, name)
    with pytest.raises(wf.SceneError, match=message):
        setattr(shape, name, value)
    assert getattr(shape, name) is before


def test_arrays_that_do_not_fit_each_other_are_refused_by_render() -> None:
    """They may be assigned one after the other, so each alone says nothing."""
    mesh = wf.Mesh(np.eye(3), [[0, 1, 2]], normals=np.eye(3))
    mesh.vertices = np.eye(4)[:, :3]
    with pytest.raises(wf.SceneError, match=r"mesh: normals must have a row for each of 4 vertices, got 3"):
        wf.render(mesh, 1)


def test_constructors_are_made_of_the_parameters():
    signature = inspect.signature(wf.Dielectric)
    assert list(signature.parameters)[:3] == ["ior", "roughness", "roughness_v"]  # a base's keywords first
    assert signature.parameters["roughness"].annotation == "Scalar"
    assert signature.parameters["film_ior"].default == wf.Dielectric.defaults["film_ior"] == 1.33
    assert get_type_hints(wf.Conductor.__init__)["distribution"] == Literal["ggx", "beckmann"]
    with pytest.raises(TypeError, match=r"Conductor.__init__\(\) missing .* 'eta'"):
        wf.Conductor()
    with pytest.raises(TypeError, match=r"Principled\(\) got .* 'specular_weight'; did you mean 'specular'"):
        wf.Principled(specular_weight=1)
