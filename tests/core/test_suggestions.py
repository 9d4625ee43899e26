"""Unknown keywords and names are answered with those that are meant."""

import inspect
import pickle

import numpy as np
import pytest
from inside import SYNONYMS, meant, suggests_keywords

import wavefront as wf

BALL = wf.Sphere((0, 0, 0), 1)
TRIANGLE = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
HERE = (0, 0, 5), (0, 0, 0)
KEYWORDS = [
    (lambda: wf.render(BALL, sample_count=4), "render", "sample_count", "spp"),
    (lambda: wf.render(BALL, ssp=4), "render", "ssp", "spp"),
    (lambda: wf.render(BALL, integrater="full"), "render", "integrater", "integrator"),
    (lambda: wf.render(BALL, xyzzy="full"), "render", "xyzzy", None),
    (lambda: wf.Camera.look_at(eye=(0, 0, 5), target=(0, 0, 0)), "Camera.look_at", "eye", "origin"),
    (lambda: wf.Camera.from_matrix(np.eye(4), yfov=30), "Camera.from_matrix", "yfov", "fov"),
    (lambda: wf.Camera.orthographic(*HERE, hight=3), "Camera.orthographic", "hight", "height"),
    (lambda: wf.Camera.panorama(eye=HERE[0]), "Camera.panorama", "eye", "origin"),
    (lambda: wf.Diffuse(albedo=0.5), "Diffuse", "albedo", "reflectance"),
    (lambda: wf.Principled(albedo=0.5), "Principled", "albedo", "base_color"),
    (lambda: wf.Dielectric(index_of_refraction=1.5), "Dielectric", "index_of_refraction", "ior"),
    (lambda: wf.Mix(wf.Mirror(), wf.Mirror(), wieght=1), "Mix", "wieght", "weight"),
    (lambda: wf.Conductor.named("gold", rough=0.1), "Conductor.named", "rough", "roughness"),
    (lambda: wf.Sphere(centre=(0, 0, 0), radius=1), "Sphere", "centre", "center"),
    (lambda: wf.Mesh(verts=1, tris=2), "Mesh", "verts", "vertices"),
    (lambda: wf.Instance(wf.Mesh(*TRIANGLE), matrices=1), "Instance", "matrices", None),
    (lambda: wf.PointLight((0, 0, 0), strength=1), "PointLight", "strength", "intensity"),
    (lambda: wf.DirectionalLight((0, 0, 1), intensity=1), "DirectionalLight", "intensity", "irradiance"),
    (lambda: wf.Environment(color=1), "Environment", "color", "radiance"),
    (lambda: wf.Scene(BALL, light=[]), "Scene", "light", "lights"),
    (lambda: wf.Scene(BALL).framing_camera(fovy=30), "Scene.framing_camera", "fovy", "fov"),
]


@pytest.mark.parametrize(
    ("call", "function", "name", "known"), KEYWORDS, ids=[f"{k[1]}-{k[2]}" for k in KEYWORDS]
)
def test_unknown_keywords(call, function: str, name: str, known: str | None) -> None:
    with pytest.raises(TypeError) as caught:
        call()
    hint = "" if known is None else f"; did you mean {known!r}?"
    assert str(caught.value) == f"{function}() got an unexpected keyword argument {name!r}{hint}"


def test_keywords_are_looked_at_after_an_error_alone(calls_of) -> None:
    calls = calls_of("wavefront.core.suggestions.unknown_keyword")
    wf.Sphere((0, 0, 0), radius=1)
    assert not calls


def test_other_errors_of_types_are_left_as_they_are() -> None:
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'radius'"):
        wf.Sphere((0, 0, 0))
    with pytest.raises(TypeError) as caught:
        wf.Sphere(centre=(0, 0, 0), radius=1)
    assert caught.value.__context__ is None


@pytest.mark.parametrize(
    ("call", "hint"),
    [
        (lambda: wf.Diffuse(0.5, alpha=0.3), "wf.Material(bsdf, alpha=...)"),
        (lambda: wf.Mirror(alpha_cutoff=0.3), "wf.Material(bsdf, alpha=..., alpha_cutoff=...)"),
        (lambda: wf.Principled(emission=1), "wf.Material(bsdf, emission=...)"),
        (lambda: wf.Dielectric(absorption=1), "wf.Material(bsdf, interior=wf.Medium(absorption=...))"),
        (lambda: wf.Conductor.named("gold", normal_map=1), "wf.Material(bsdf, normal_map=...)"),
    ],
)
def test_keywords_of_materials_are_told_on_bsdfs(call, hint: str) -> None:
    """A BSDF only scatters; what to write for the rest is in the message."""
    with pytest.raises(TypeError) as caught:
        call()
    assert str(caught.value).endswith(f"; write {hint}")


@pytest.mark.parametrize("name", ["with_alpha", "with_normal_map", "absorption", "emission", "opacity"])
def test_attributes_of_materials_are_told_on_bsdfs(name: str) -> None:
    """Others are unknown as in Python, and nothing is found that is not there."""
    for bsdf in (wf.Diffuse(), wf.Principled(), wf.Mix(wf.Diffuse(), wf.Mirror())):
        with pytest.raises(AttributeError, match=rf"has no attribute '{name}'; write wf\.Material\(bsdf, "):
            getattr(bsdf, name)
        assert not hasattr(bsdf, name)
    with pytest.raises(AttributeError, match=r"'Diffuse' object has no attribute 'shade'$"):
        _ = wf.Diffuse().shade


def test_a_bsdf_may_have_a_parameter_of_such_a_name() -> None:
    class Waxed(wf.Diffuse):
        @suggests_keywords
        def __init__(self, alpha: float) -> None:
            super().__init__(0.5)
            self.alpha = alpha

    assert Waxed(alpha=0.5).alpha == 0.5
    with pytest.raises(TypeError, match=r"unexpected keyword argument 'emission'; write wf\.Material"):
        Waxed(emission=1)


def test_errors_from_within_stay_as_they_are() -> None:
    """Only keywords of the function itself are answered, and Python counts the arguments."""
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'radius'"):
        wf.Sphere((0, 0, 0))
    with pytest.raises(TypeError, match="positional argument"):
        wf.Diffuse(1, 2)


def test_signatures_are_kept() -> None:
    assert list(inspect.signature(wf.Diffuse).parameters) == ["reflectance"]
    assert list(inspect.signature(wf.render).parameters)[:4] == ["scene", "spp", "camera", "size"]
    assert wf.render.__doc__.startswith("Render a picture.")
    assert wf.Camera.look_at.__func__.__qualname__ == "Camera.look_at"
    assert pickle.loads(pickle.dumps(wf.render)) is wf.render

    class Own(wf.Diffuse):
        def __init__(self, shade: float) -> None:
            super().__init__(reflectance=shade)

    assert Own(0.25).reflectance[0, 0] == 0.25


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"integrator": "path"}, r"must be one of naive, direct_simple, direct_mis, full"),
        ({"integrator": "direct"}, r"did you mean 'direct_"),
        ({"sampler": "Sobol"}, r"did you mean 'sobol'\?"),
        ({"filter": "gausian"}, r"did you mean 'gaussian'\?"),
        ({"accel": "embre"}, r"did you mean 'embree'\?"),
        ({"accel": "cuda"}, r"must be one of auto, numpy, embree$"),
    ],
)
def test_unknown_choices(change: dict, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        wf.render(BALL, 1, **change)


@pytest.mark.parametrize("name", ["Gold", "GOLD", "gold"])
def test_metals_in_any_case(name: str) -> None:
    assert np.array_equal(wf.Conductor.named(name).eta, wf.Conductor.named("gold").eta)


def test_metals() -> None:
    assert np.array_equal(wf.Conductor.named("Aluminum").k, wf.Conductor.named("aluminium").k)
    with pytest.raises(wf.SceneError, match=r"must be one of aluminum, .*titanium; did you mean 'silver'\?"):
        wf.Conductor.named("Silvr")
    with pytest.raises(wf.SceneError, match=r"Conductor name is 5; it must be text"):
        wf.Conductor.named(5)


@pytest.mark.parametrize(
    ("name", "known"),
    [("rendr", "render"), ("Lambertian", "Diffuse"), ("Glass", "Dielectric"), ("difuse", "Diffuse")],
)
def test_unknown_attributes(name: str, known: str) -> None:
    with pytest.raises(AttributeError, match=f"module 'wavefront' has no attribute '{name}'"):
        getattr(wf, name)
    assert not hasattr(wf, "Xyzzy")


def test_the_table_is_of_plain_words() -> None:
    assert all(name == name.lower().replace("_", "") for name in SYNONYMS)
    assert meant("samples", ["spp", "sample"]) == "spp"
