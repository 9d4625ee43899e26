"""Names and values that newcomers guess: they are taken, or the message names the right thing."""

import inspect
import re

import numpy as np
import pytest
import trimesh
from inside import NAMED_MATERIALS, SYNONYMS, VIEWS, HenyeyGreenstein

import wavefront as wf

BALL = wf.Sphere((0, 0, 0), 1)
SCENE = wf.Scene(BALL)
HERE = (0, 0, 5), (0, 0, 0)
BOX = trimesh.creation.box()
MESH = wf.Mesh(BOX.vertices, BOX.faces)
LAMP = wf.PointLight((0, 0, 3), 1)
IMAGE = wf.Image(np.full((4, 6, 3), 0.5, np.float32))
COMPARISON = wf.compare(IMAGE, IMAGE)
MEASURED = wf.measure([wf.Plane((0, 0, 0)), wf.Environment(1)], [(0, 1, 0)], kind="fluence", spp=1)
PLACES = {  # where the table has answers, and what stands for it
    "wavefront": wf,
    "bsdf": wf.Diffuse(),
    "camera": wf.Camera.look_at(*HERE),
    "comparison": COMPARISON,
    "image": IMAGE,
    "measurement": MEASURED,
    "mesh": MESH,
    "scene": SCENE,
    "shape": BALL,
    "sky": wf.Sky.cie(1),
}


def written(text: str) -> list[tuple[object, str]]:
    """Return each attribute that an answer has someone write, after what it is of."""
    found = re.findall(r"\b(wf|image|scene|camera|comparison|measurement)\.(\w+)(?:\.(\w+))?", text)
    first = [(PLACES["wavefront" if owner == "wf" else owner], name) for owner, name, _ in found]
    return first + [(getattr(wf, name), more) for owner, name, more in found if owner == "wf" and more]


def test_what_the_table_has_someone_write_is_there() -> None:
    answers = {answer for answers in SYNONYMS.values() for answer in answers}
    missing = [text for text in answers for owner, name in written(text) if not hasattr(owner, name)]
    assert not missing


def test_names_of_the_table_are_there() -> None:
    """Keywords, choices, and attributes of the places that they are for."""
    keywords = {"full", "sobol", "independent", *wf.Material.named.__doc__.split()}
    for owner in (wf, wf.Camera, wf.Image, wf.Conductor, wf.Shape, wf.Sky):
        for thing in (getattr(owner, name) for name in dir(owner) if not name.startswith("_")):
            if callable(thing) and not (inspect.isclass(thing) and issubclass(thing, BaseException)):
                keywords.update(inspect.signature(thing).parameters)
    keywords.update(inspect.signature(HenyeyGreenstein).parameters, NAMED_MATERIALS, VIEWS)
    for key, answers in SYNONYMS.items():
        place = key.rpartition(".")[0]
        for answer in (each for each in answers if each.replace(" ", "_").isidentifier()):
            there = hasattr(PLACES[place], answer) if place in PLACES else answer in dir(wf)
            assert there or answer in keywords, (key, answer)


def test_what_the_table_answers_for_is_not_there() -> None:
    for place, _, name in (key.rpartition(".") for key in SYNONYMS):
        if place in PLACES:
            with pytest.raises(AttributeError, match=r"; (did you mean|write) "):
                getattr(PLACES[place], name)


TAKEN = [
    lambda: wf.Sphere((0, 0, 0), 1, material="red"),
    lambda: wf.Sphere((0, 0, 0), 1, material="#ff8800"),
    lambda: wf.Sphere((0, 0, 0), 1, material="Dark Red"),
    lambda: wf.Material.named("red plastic"),
    lambda: wf.Conductor("gold"),
    lambda: wf.Dielectric("glass"),
    lambda: wf.ThinDielectric("glass"),
    lambda: wf.Plastic(ior="acrylic"),
    lambda: wf.Camera.look_at(*HERE, size=16),
    lambda: wf.to_photometric(1.0),
    lambda: wf.grid_points((0, 0, 0), (1, 0, 0), (0, 1, 0), 8),
    lambda: SCENE.framing_camera(direction="isometric"),
    lambda: SCENE.framing_camera(direction="Three-Quarter"),
    lambda: wf.Camera.framing(BALL, view="isometric", size=16),
    lambda: IMAGE["rgb"],
    lambda: wf.Keyframes([0, 1], [(0, 0, 0), (1, 0, 0)]),
]


@pytest.mark.parametrize("call", TAKEN)
def test_what_is_understood_is_taken(call) -> None:
    call()


GUESSES = [
    ("wf.Cube", "'Box'"),
    ("wf.Material(color='red')", "write wf.Material(wf.Diffuse(color))"),
    ("wf.IES", "'IESLight'"),
    ("wf.Ground", "'Plane'"),
    ("wf.DomeLight", "'Environment'"),
    ("wf.serve", "'view'"),
    ("wf.load_scene", "'load'"),
    ("wf.Text", "pyvista.Text3D"),
    ("wf.save_image", "image.save(path)"),
    ("wf.Volume", "'GridMedium'"),
    ("wf.Smoke", "'GridMedium'"),
    ("wf.PointCloud", "'Points'"),
    ("wf.Line", "'Edges'"),
    ("wf.Tube", "'Capsules'"),
    ("wf.Curve", "'Edges'"),
    ("wf.HDRI", "'Environment'"),
    ("wf.Lambert", "'Diffuse'"),
    ("wf.Checkerboard", "wf.Texture(array)"),
    ("wf.ImageTexture", "'Texture'"),
    ("wf.SunSky", "'Sky'"),
    ("wf.Torus", "trimesh.creation.torus"),
    ("wf.Cone", "trimesh.creation.cone"),
    ("wf.Arrow", "pyvista.Arrow"),
    ("wf.SSIM", "'compare'"),
    ("wf.kelvin", "'blackbody'"),
    ("wf.Sky.clear", "wf.Sky.cie(12, sun)"),
    ("wf.Sky.from_date", "wf.sun_position"),
    ("wf.Sky((1, 1, 0))", "wf.Sky.cie(12, sun) is a clear sky"),
    ("wf.Mesh.from_trimesh(BOX)", "wf.from_trimesh(mesh)"),
    ("wf.Image.open('a.png')", "wf.Image.load(path)"),
    ("wf.render(BALL, hdri='a.hdr')", "wf.Environment("),
    ("wf.render(BALL, env='a.hdr')", "wf.Environment("),
    ("wf.render(BALL, bsdf='gold')", "'material'"),
    ("wf.render(BALL, transparent=True)", 'background="transparent"'),
    ("wf.render(BALL, tone='agx')", "image.save(path, tone=...)"),
    ("wf.render(BALL, focus_distance=3)", "wf.Camera.framing(scene, aperture=..., focus=...)"),
    ("wf.render(BALL, aperture=0.1)", "wf.Camera.framing(scene, aperture=...)"),
    ("wf.render(BALL, f_stop=2)", "aperture="),
    ("wf.render(BALL, fov_x=40)", "fov=..., which is vertical"),
    ("wf.Camera.look_at((0, 0, 5), (0, 0, 0), focus_distance=3)", "'focus'"),
    ("wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov_x=40)", "fov=..., which is vertical"),
    ("wf.Sphere((0, 0, 0), 1, bsdf='gold')", "'material'"),
    ("wf.Principled(anisotropic=0.5)", "roughness_v, or wf.Disney(anisotropic=...)"),
    ("IMAGE.tonemap", "image.save(path, tone="),
    ("IMAGE.to_numpy()", "'rgb'"),
    ("IMAGE.array", "'rgb'"),
    ("IMAGE.data", "'rgb'"),
    ("IMAGE.srgb", "image.to_uint8()"),
    ("IMAGE['depth']", "aovs=('depth',)"),
    ("IMAGE.save('a.png', dpi=300)", "image.to_pil().save(path, dpi=...)"),
    ("IMAGE.save('a.jpg', quality=95)", "image.to_pil().save(path, quality=...)"),
    ("wf.PointLight((0, 0, 0), lumens=800)", "wf.with_flux(light"),
    ("wf.PointLight((0, 0, 0), power=60)", "wf.with_flux(light"),
    ("wf.PointLight((0, 0, 0), 1, kelvin=2700)", "wf.blackbody(2700)"),
    ("wf.Environment(1, rotation=90)", "'transform'"),
    ("wf.IESLight('a.ies', (0, 0, 0), rotation=90)", "'c0'"),
    ("wf.turntable(BALL, frames=8)", "'n'"),
    ("wf.turntable(BALL, elevation=30)", "'view'"),
    ("wf.sun_position('2025-06-21', lat=50, lon=8)", "'latitude'"),
    ("wf.sun_position('2025-06-21', latitude=50, lon=8)", "'longitude'"),
    ("MESH.translate((1, 0, 0))", "'translated'"),
    ("MESH.rotate((1, 0, 0), 90)", "'rotated'"),
    ("MESH.transform(np.eye(4))", "'transformed'"),
    ("SCENE.render()", "wf.render(scene)"),
    ("SCENE.show()", "wf.view(scene)"),
    ("SCENE.view()", "wf.view(scene)"),
    ("SCENE.add_light(LAMP)", "scene.add(light)"),
    ("SCENE.save('a.json')", "pickle.dump(scene, file)"),
    ("COMPARISON.significant", "comparison.p_value < 0.01"),
    ("COMPARISON.passed", "comparison.p_value < 0.01"),
    ("COMPARISON.ssim", "comparison.flip"),
    ("MEASURED.illuminance", "lux"),
    ("wf.Material.named('wood')", 'wf.Diffuse(wf.Texture("wood.png"))'),
    ("wf.Diffuse(0.5, alpha=0.3)", "wf.Material(bsdf, alpha=...)"),
    ("wf.Camera(eye=(0, 0, 5))", "wf.Camera.look_at(origin, target, up"),
    ("wf.Camera.framing(BALL, fovy=30)", "'fov'"),
    ("wf.Camera.fisheye(fov=180)", "camera.replace(projection=wf.Fisheye(180))"),
    ("wf.Camera.equirectangular()", "'panorama'"),
    ("wf.Camera.look_at(*HERE, projection=wf.Fisheye(180))", "camera.replace(projection=...)"),
    ("wf.render(BALL, time=1)", "write wf.load(path, time=...) or scene.at(time)"),
    ("wf.render(BALL, fps=24)", "wf.render_frames(scene, fps=...)"),
    ("wf.render(BALL, animation='Run')", "wf.load(path, animation=...)"),
    ("wf.render(BALL, motion_blur=0.5)", "'shutter'"),
    ("wf.render(BALL, shutter=0.5)", "it must be (from, until), seconds of the scene"),
    ("wf.render_frames(BALL, frames=8)", "'times'"),
    ("wf.load('a.glb', frame=3)", "time=, in seconds"),
    ("SCENE.set_time(1)", "scene.at(time)"),
    ("wf.animate(BALL)", "'render_frames'"),
    ("wf.save_video('a.mp4', [])", "'save_animation'"),
    ("wf.Keyframes([0, 1], translations=[(0, 0, 0), (1, 0, 0)])", "'matrices'"),
    ("wf.Instance('a.obj', np.eye(4))", "write wf.load_mesh(path)"),
    ("wf.Instance.many(BOX, [np.eye(4)])", "write wf.from_trimesh(mesh).shapes[0]"),
]


@pytest.mark.parametrize(("guess", "right"), GUESSES, ids=[guess for guess, _ in GUESSES])
def test_a_guess_is_answered(guess: str, right: str) -> None:
    with pytest.raises((AttributeError, TypeError, wf.SceneError)) as caught:
        eval(guess)
    assert right in str(caught.value), caught.value


def test_values_that_are_understood_mean_what_they_say() -> None:
    """The same as what would have had to be written."""
    gold = wf.Conductor.named("gold", roughness=0.2)
    assert np.array_equal(wf.Conductor("Gold", roughness=0.2).k, gold.k)
    assert np.array_equal(wf.Conductor("gold").eta, gold.eta)
    assert wf.Dielectric("BK7").ior == wf.Dielectric.named("bk7").ior
    red = wf.Sphere((0, 0, 0), 1, material="red").material.bsdf
    assert isinstance(red, wf.Diffuse)
    assert red.reflectance.ravel().tolist() == [1, 0, 0]
    plastic = wf.Material.named("light blue plastic").bsdf
    assert np.array_equal(plastic.base_color.ravel(), wf.srgb("lightblue"))
    assert wf.Camera.look_at(*HERE, size=np.int64(16)).size == (16, 16)
    assert wf.to_photometric(2.0) == 2 * 683
    moved = np.tile(np.eye(4), (2, 1, 1))
    moved[1, :3, 3] = 1, 2, 3
    assert np.array_equal(wf.Keyframes([0, 1], [(0, 0, 0), (1, 2, 3)]).matrices, moved)
    views = (SCENE.framing_camera(direction=each).origin for each in ("iso", "isometric"))
    assert np.array_equal(*views)


def test_a_metal_by_name_has_its_own_extinction() -> None:
    metal = wf.Conductor(1.5, 7.0)
    metal.eta = "copper"
    assert np.array_equal(metal.k, wf.Conductor("copper").k)
    metal.k = 3.0
    assert metal.k.ravel().tolist() == [3, 3, 3]
    with pytest.raises(wf.SceneError, match="a named metal has its own"):
        wf.Conductor("gold", 0.2)
    with pytest.raises(wf.SceneError, match="k is missing"):
        wf.Conductor(0.2)
    with pytest.raises(wf.SceneError, match=r"eta is 'blue'; it must be one of aluminum"):
        wf.Conductor("blue")


class Rows(np.ndarray):
    """A class of arrays of another package, as trimesh and PyVista have."""


Rows.__module__ = "pyvista.core.pyvista_ndarray"
VERTICES, FACES = BOX.vertices, BOX.faces  # arrays of a class of trimesh


@pytest.mark.parametrize(
    "subject",
    [
        (VERTICES, FACES),
        [VERTICES, FACES],
        (np.array(VERTICES).view(Rows), np.array(FACES).view(Rows)),
        (np.array(VERTICES).view(Rows), np.insert(np.array(FACES), 0, 3, axis=1).ravel().view(Rows)),
        [VERTICES.tolist(), FACES.tolist()],
        [(VERTICES, FACES)],
        [[VERTICES, FACES]],
        (list(np.array(VERTICES)), list(np.array(FACES))),
    ],
)
def test_a_mesh_as_arrays(subject) -> None:
    found = wf.Camera.framing(subject, size=8)
    assert np.array_equal(found.origin, wf.Camera.framing(MESH, size=8).origin)


def test_a_mesh_as_arrays_with_normals() -> None:
    normals = np.array(BOX.vertex_normals)
    seen = [
        wf.render(subject, 2, size=8, progress=False).rgb.tobytes()
        for subject in (
            (VERTICES, FACES, BOX.vertex_normals),
            wf.Mesh(VERTICES, FACES, normals=normals),
            (VERTICES, FACES),
        )
    ]
    assert seen[0] == seen[1] != seen[2]


def test_a_list_of_two_meshes_is_no_mesh() -> None:
    other = np.array(VERTICES) + 5
    pair = [(VERTICES, FACES), (other, FACES)]
    both = wf.Scene([wf.Mesh(*each) for each in pair])
    assert np.array_equal(wf.Camera.framing(pair).origin, wf.Camera.framing(both).origin)


def test_the_first_samples_by_their_number() -> None:
    few = wf.render(BALL, samples=2, size=8, progress=False)
    assert few.rgb.tobytes() == wf.render(BALL, samples=range(2), size=8, progress=False).rgb.tobytes()
