"""Things of a user's own, by public names alone, rendered beside their built-in twins.

They are the examples of docs/extending.md: each test runs the document's own code.
"""

import re
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import wavefront as wf

PAGE = (Path(__file__).parents[2] / "docs" / "extending.md").read_text("utf-8")
SIZE = (32, 24)
pytestmark = pytest.mark.usefixtures("tables_restored")
everywhere = pytest.mark.parametrize("integrator", ["naive", "direct_simple", "direct_mis", "full"])


@cache
def example(title: str, name: str):
    """Return what the example under a heading of the document defines, without the picture it renders."""
    section = PAGE.split(f"\n## {title}\n")[1].split("\n## ")[0]
    code = re.search(r"^```python\n(.*?)^```$", section, re.MULTILINE | re.DOTALL)[1]
    definitions = re.split(r"\n\n\n(?!class |def )", code)
    space = {"__name__": "own"}
    exec(compile("\n\n\n".join(definitions[:1]), title, "exec"), space)
    return space[name]


def room(material=None, lights=(), *, shape=None):
    """A floor, a light of two triangles and a thing on the floor."""
    floor = wf.Rectangle((-3, 0, 3), (6, 0, 0), (0, 0, -6), material=wf.Diffuse(0.5))
    area_light = wf.Rectangle((-1, 3, -1), (2, 0, 0), (0, 0, 2), emission=(9, 8, 6))
    thing = wf.Rectangle((-1, 0, 0), (2, 0, 0), (0, 1.5, -1), material=material or wf.Diffuse(0.7))
    camera = wf.Camera.look_at((0, 1.5, 5), (0, 0.7, 0), size=SIZE)
    return wf.Scene([floor, area_light, shape or thing], list(lights), camera)


def picture(scene, spp=8, **settings):
    settings = {"accel": "numpy", "workers": 1, "lighting": None, "progress": False, **settings}
    return wf.render(scene, spp, **settings)


def same(a: wf.Image, b: wf.Image) -> None:
    assert a.rgb.max() > 0.1
    np.testing.assert_array_equal(a.rgb, b.rgb)


def alike(a: wf.Image, b: wf.Image) -> None:
    """Compare by the mean of the picture, in standard errors."""
    error = np.sqrt(sum((each.standard_error**2).sum((0, 1)) for each in (a, b))) / a.rgb[..., 0].size
    assert (error > 0).all()
    assert (np.abs(a.rgb.mean((0, 1)) - b.rgb.mean((0, 1))) < 4 * error).all()
    assert (a.rgb != b.rgb).any()


@everywhere
def test_a_bsdf(integrator):
    own = picture(room(example("BSDF", "Lambert")(0.6)), integrator=integrator)
    same(own, picture(room(wf.Diffuse(0.6)), integrator=integrator))


@everywhere
def test_a_texture(integrator):
    light, dark = (0.8, 0.7, 0.6), (0.1, 0.2, 0.3)
    pixels = np.array([[light, dark], [dark, light]], np.float32)
    twin = wf.Texture(np.tile(pixels, (4, 4, 1))[::-1], srgb=False, filter="nearest")
    own = example("Texture", "Checkers")(light, dark, 4)
    same(
        picture(room(wf.Diffuse(own)), integrator=integrator),
        picture(room(wf.Diffuse(twin)), integrator=integrator),
    )


@everywhere
def test_a_sampler(integrator):
    own = picture(room(), 64, integrator=integrator, sampler=example("Sampler", "R2Sampler"))
    assert own.metadata["sampler"] == "R2Sampler"
    alike(own, picture(room(), 64, integrator=integrator, sampler="independent"))


@everywhere
def test_a_filter(integrator):
    def tent(u):
        return np.stack([np.float32(0.5) + wf.warp.tent(row, 1.0) for row in u])

    same(
        picture(room(), integrator=integrator, filter=tent),
        picture(room(), integrator=integrator, filter="tent"),
    )
    u = np.random.default_rng(0).random((2, 10_000), np.float32)
    positions = example("Filter", "narrow_tent")(u)
    assert np.abs(positions - 0.5).max() < 0.75
    assert np.abs(positions - 0.5).max() > 0.7
    alike(
        picture(room(), 64, integrator=integrator, filter=example("Filter", "narrow_tent")),
        picture(room(), 64, integrator=integrator, filter="box", seed=1),
    )


@pytest.mark.parametrize("integrator", ["direct_simple", "direct_mis", "full"])
def test_a_light_sampler(integrator):
    lights = [wf.PointLight((x, 3, 3), 8) for x in (-2, -1, 2)]
    own = picture(
        room(None, lights), integrator=integrator, light_sampler=example("Light sampler", "EveryLight")
    )
    same(own, picture(room(None, lights), integrator=integrator, light_sampler="uniform"))


@everywhere
def test_an_accelerator(integrator):
    """Only rounding differs, so few samples go another way."""
    own = picture(room(), integrator=integrator, accel=example("Accelerator", "EveryTriangle"))
    twin = picture(room(), integrator=integrator, accel="numpy")
    assert own.metadata["accelerator"] == "every triangle"
    assert np.isclose(own.rgb, twin.rgb, rtol=1e-3, atol=1e-4).mean() > 0.99


def test_an_accelerator_is_kept_and_told_from_others_of_its_name():
    scene, built = room(), []

    def kind(label):
        def make(geometry):
            built.append(label)
            return example("Accelerator", "EveryTriangle")(geometry)

        return make

    first, second = kind("first"), kind("second")
    for accel in (first, first, second, second):
        picture(scene, 1, accel=accel)
    assert built == ["first", "second"]


def test_an_integrator():
    """With one bounce it is direct light, with two what `full` does before roulette."""
    own = example("Integrator", "one_bounce")
    for bounces, twin in ((1, "direct_mis"), (2, "full")):
        same(
            picture(room(), integrator=own, max_bounces=bounces),
            picture(room(), integrator=twin, max_bounces=bounces),
        )
    assert picture(room(), 1, integrator=own).metadata["integrator"] == "one_bounce"
    with pytest.raises(wf.SceneError, match=r"branches=2 does not go with integrator='one_bounce': only"):
        picture(room(), 1, integrator=own, branches=2)


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (lambda n: np.zeros((n, 3), np.float32), r"returns the shape \(\d+, 3\); an integrator must return"),
        (lambda n: None, "returns None; an integrator must return"),
    ],
)
def test_an_integrator_must_return_radiance(returned, message):
    def own(scene, paths, sampler, max_bounces):
        return returned(len(paths))

    with pytest.raises(wf.SceneError, match=f"^own {message}"):
        picture(room(), 1, integrator=own)


@everywhere
def test_an_executor(integrator):
    own = picture(
        room(), integrator=integrator, executor=example("Executor", "named_threads"), workers=2, wave_size=300
    )
    assert own.metadata["executor"] == "named_threads"
    same(own, picture(room(), integrator=integrator, workers=1, executor="threads"))
    same(own, picture(room(), integrator=integrator, executor=ThreadPoolExecutor))


def test_a_scene_format(tmp_path):
    wf.register_format(".Outside", load=example("File format", "load_balls"))
    path = tmp_path / "two.outside"
    path.write_text("0 0 0 1\n1.5 0 0 0.5\n")
    balls = [wf.Sphere((0, 0, 0), 1), wf.Sphere((1.5, 0, 0), 0.5)]
    twin = picture(wf.Scene([*balls], [wf.Environment(1.0)]), size=SIZE)
    same(picture([path, wf.Environment(1.0)], size=SIZE), twin)
    assert len(wf.load(path).shapes) == 2
    with pytest.raises(wf.SceneError, match=r"two\.outside: .* is a Sphere, not a mesh; use wf\.load"):
        wf.load_mesh(path)
    with pytest.raises(wf.SceneError, match=r"a\.outsid: extension is '\.outsid'"):
        wf.load("a.outsid")


def test_a_scene_format_gives_meshes(tmp_path):
    square = wf.Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0))
    matrix = np.eye(4)
    matrix[0, 3] = 5
    wf.register_format(".squares", load=lambda path, data: wf.Scene([square, wf.Instance(square, matrix)]))
    (tmp_path / "a.squares").write_bytes(b"PK\x03\x04")  # not taken for an archive under another name
    mesh = wf.load_mesh(tmp_path / "a.squares")
    assert len(mesh.faces) == 4
    assert mesh.vertices[:, 0].max() == 6
    wf.register_format(".nothing", load=lambda path, data: [square])
    (tmp_path / "a.nothing").write_bytes(b"x")
    with pytest.raises(wf.SceneError, match=r"a\.nothing: its reader returned list"):
        wf.load(tmp_path / "a.nothing")


def test_an_image_format(tmp_path):
    wf.register_format(
        ".outpfm",
        read_image=example("File format", "read_pfm"),
        write_image=example("File format", "write_pfm"),
    )
    image = picture(room(), 2)
    image.save(tmp_path / "a.outpfm")
    same(wf.Image.load(tmp_path / "a.outpfm"), image)
    sky = wf.Environment(str(tmp_path / "a.outpfm"))
    ball = wf.Sphere((0, 0, 0), 1)
    same(picture([ball, sky], size=SIZE), picture([ball, wf.Environment(image.rgb)], size=SIZE))
    (tmp_path / "b.outpfm").write_bytes(b"P6 1 1 255 abc")
    with pytest.raises(wf.SceneError, match=r"b\.outpfm: not a readable outpfm image: it is not a PFM"):
        wf.Image.load(tmp_path / "b.outpfm")
    with pytest.raises(wf.SaveError, match=r"a\.outpf: extension is '\.outpf'; .*; did you mean '\.outpfm'"):
        image.save(tmp_path / "a.outpf")
    (tmp_path / "flat.flatpfm").write_bytes(b"x")
    wf.register_format(".flatpfm", read_image=lambda data: np.zeros((3, 3)))
    with pytest.raises(wf.SceneError, match=r"flat\.flatpfm: the reader returned the shape \(3, 3\)"):
        wf.Image.load(tmp_path / "flat.flatpfm")


KINDS = {
    "integrator": (wf.register_integrator, lambda: example("Integrator", "one_bounce")),
    "sampler": (wf.register_sampler, lambda: example("Sampler", "R2Sampler")),
    "filter": (wf.register_filter, lambda: example("Filter", "narrow_tent")),
    "light_sampler": (wf.register_light_sampler, lambda: example("Light sampler", "EveryLight")),
    "accel": (wf.register_accelerator, lambda: example("Accelerator", "EveryTriangle")),
    "executor": (wf.register_executor, lambda: example("Executor", "named_threads")),
}


@pytest.mark.parametrize("setting", KINDS)
def test_names_can_be_registered_once(setting):
    register, thing = KINDS[setting][0], KINDS[setting][1]()
    name = f"outside_{setting}"
    register(name, thing)
    lights = [wf.PointLight((2, 3, 3), 8)]
    named = picture(room(None, lights), 2, **{setting: name})
    same(named, picture(room(None, lights), 2, **{setting: thing}))
    with pytest.raises(wf.SceneError, match=rf"{setting} '{name}' is registered already"):
        register(name, thing)
    with pytest.raises(wf.SceneError, match=rf"{setting} 'outside_number' is 3; it must be "):
        register("outside_number", 3)
    with pytest.raises(wf.SceneError, match="must be a string, got None"):
        register(None, thing)
    wrong = rf"{setting} is '{name}s'; it must be one of .*, {name}; did you mean '{name}'\?"
    with pytest.raises(wf.SceneError, match=wrong):
        picture(room(), 1, **{setting: f"{name}s"})
    with pytest.raises(wf.SceneError, match=rf"{setting} is 3; it must be one of "):
        picture(room(), 1, **{setting: 3})


@pytest.mark.skipif(not hasattr(__import__("os"), "fork"), reason="needs fork")
def test_worker_processes_know_registered_names():
    wf.register_sampler("outside_processes", example("Sampler", "R2Sampler"))
    settings = {"sampler": "outside_processes", "filter": example("Filter", "narrow_tent"), "wave_size": 300}
    same(
        picture(room(), executor="processes", workers=2, **settings),
        picture(room(), executor="threads", workers=1, **settings),
    )


@pytest.mark.parametrize("extension", ["balls", ".", "", None, 3])
def test_extensions_begin_with_a_dot(extension):
    with pytest.raises(wf.SceneError, match="it must begin with a dot"):
        wf.register_format(extension, load=lambda path, data: None)


def test_a_format_needs_a_function_and_a_free_extension():
    with pytest.raises(wf.SceneError, match="needs load, read_image or write_image"):
        wf.register_format(".outside_none")
    for word in ("read_image", "write_image"):
        with pytest.raises(wf.SceneError, match=r"extension '\.png' is registered already"):
            wf.register_format(".PNG", **{word: bytes})
    with pytest.raises(wf.SceneError, match=r"extension '\.obj' is registered already"):
        wf.register_format(".obj", load=lambda path, data: None)


def test_a_feature() -> None:
    """Its twin is a wall that the camera does not see."""

    def from_outside(material):
        wall = wf.Rectangle((-3, 0, 4), (0, 4, 0), (6, 0, 0), material=material)  # faces the room
        return room(lights=[wf.Environment(0.5)], shape=wall)

    own = picture(from_outside(wf.Diffuse(0.5)), features=example("Feature", "SeenFromInside")())
    same(own, picture(from_outside(wf.Material(wf.Diffuse(0.5), visible_to_camera=False))))
