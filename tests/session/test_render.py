"""render(): the same bits however the work is cut, arguments, warnings, faults and stops."""

import sys
from functools import cache

import numpy as np
import pytest
import scenes
import trimesh
from inside import SAMPLERS
from significance import render

import wavefront as wf

BALL = wf.Sphere((0, 0, 0), 1)
SPP = 5


def small(size: tuple[int, int] = (4, 3)) -> wf.Scene:
    """A ball in an environment."""
    camera = wf.Camera.look_at((0, 0, 4), (0, 0, 0), size=size)
    return wf.Scene([BALL], [wf.Environment()], camera)


# --- Same bits ------------------------------------------------------------------------------------


@cache
def whole(integrator: str, sampler: str) -> bytes:
    """The picture of everything, rendered in one wave by one worker."""
    return render(scenes.everything(), SPP, integrator=integrator, sampler=sampler).rgb.tobytes()


@pytest.mark.filterwarnings("ignore:the naive integrator")
@pytest.mark.parametrize(
    ("integrator", "sampler"),
    [
        *((integrator, "sobol") for integrator in scenes.ALL),
        *(("full", sampler) for sampler in SAMPLERS if sampler != "sobol"),
    ],
)
@pytest.mark.first(4)
def test_waves_and_workers_change_no_bit(integrator: str, sampler: str) -> None:
    """Results are added in the order of the work, not of its completion."""
    cuts = [{"wave_size": 17}, {"wave_size": 64, "workers": 2}, {"wave_size": 50, "workers": 8}]
    for cut in cuts if (integrator, sampler) == ("full", "sobol") else cuts[1:2]:
        image = render(scenes.everything(), SPP, integrator=integrator, sampler=sampler, **cut)
        assert image.rgb.tobytes() == whole(integrator, sampler)


def many_triangles() -> wf.Scene:
    """5 120 triangles of glass and metal in a lit room of quadrilaterals."""
    ball = trimesh.creation.icosphere(subdivisions=4)
    faces = np.array_split(ball.faces, 2)
    glass = wf.Mesh(ball.vertices * 0.6, faces[0], material=wf.Dielectric(1.5))
    metal = wf.Mesh(ball.vertices * 0.6, faces[1], material=wf.Conductor.named("gold", roughness=0.3))
    light = wf.Rectangle((-0.5, 0.99, -0.5), (1, 0, 0), (0, 0, 1), emission=8.0)
    floor = wf.Rectangle((-1, -1, 1), (2, 0, 0), (0, 0, -2))
    camera = wf.Camera.look_at((0, 0.3, 3), (0, 0, 0), fov=45, size=(10, 8))
    return wf.Scene([glass, metal, light, floor], [wf.Environment(0.1)], camera=camera)


def test_a_mesh_has_the_same_bits_in_any_wave_on_any_worker() -> None:
    """The tree sorts rays into blocks, and none of them sees its neighbors."""
    expected = render(many_triangles(), 2, accel="numpy").rgb.tobytes()
    for workers, wave_size in ((1, 7), (2, 64), (8, 50)):
        executor = "processes" if workers == 2 and sys.platform == "linux" else "threads"
        cut = {"workers": workers, "executor": executor, "wave_size": wave_size}
        assert render(many_triangles(), 2, accel="numpy", **cut).rgb.tobytes() == expected


def test_seeds_change_the_picture() -> None:
    first, again, other = (render(small(), 4, seed=seed).rgb for seed in (1, 1, 2))
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != other.tobytes()


# --- Scale ----------------------------------------------------------------------------------------


# --- Input ----------------------------------------------------------------------------------------

BAD = [
    *(
        ({"spp": v}, r"spp is .*; it must be a whole number from 1 to 67108864")
        for v in (0, -1, 1.5, "9", True)
    ),
    *(({"spp": v}, r"spp is ") for v in (np.nan, 2**26 + 1)),
    ({"spp": np.zeros((320, 3))}, r"spp is an array of shape \(320, 3\); it must be"),
    ({"camera": [[0.0] * 99] * 2}, r"camera must be a wf.Camera, got .{121}; wf.Camera.look_at"),
    *(
        ({name: "yes"}, rf"{name} is 'yes'; it must be True or False")
        for name in ("ground", "denoise", "strict", "caustics")
    ),
    ({"progress": "yes"}, r"progress is 'yes'; it must be True, False, None or a function"),
    ({"seconds": "30"}, r"seconds must be a number, got '30'"),
    ({"max_bounces": -1}, r"max_bounces is -1; it must be a whole number from 0"),
    ({"roulette": True}, r"roulette is True; it must be False or a whole number, by default 2"),
    ({"roulette": -1}, r"roulette is -1; it must be a whole number from 0 to 65536, or False"),
    ({"max_bounces": 2.0}, r"max_bounces is 2.0; it must be a whole number from 0"),
    ({"wave_size": 0}, r"wave_size is 0; it must be a whole number from 1"),
    ({"workers": 0}, r"workers is 0; it must be a whole number of at least 1"),
    ({"workers": 2.5}, r"workers is 2.5; it must be"),
    (
        {"integrator": "path"},
        r"integrator is 'path'; it must be one of naive, direct_simple, direct_mis, full",
    ),
    ({"integrator": None}, r"integrator is None; it must be one of"),
    ({"sampler": "halton"}, r"sampler is 'halton'; it must be one of .*sobol"),
    ({"accel": "cuda"}, r"accel is 'cuda'; it must be one of auto, numpy, embree"),
    ({"seed": -1}, r"seed is -1; it must be an integer in"),
    ({"seed": 2**64}, r"seed is 18446744073709551616; it must be"),
    ({"seed": 0.5}, r"seed is 0.5; it must be"),
    *(({"branches": v}, rf"branches is {v}; it must be a whole number from 1 to 64") for v in (0, 65, 2.0)),
    ({"branches": 64, "spp": 2**26 + 1}, r"spp is 67108865; it must be a whole number from 1 to 67108864"),
    (
        {"branches": 64, "reuse": True, "spp": 2**26},
        r"spp is 67108864; it must be a whole number from 1 to 33554432",
    ),
    *(
        ({"branches": 2, "integrator": name}, rf"branches=2 does not go with integrator='{name}': only")
        for name in ("naive", "direct_simple", "direct_mis")
    ),
]
ARRAYS = [np.zeros((3, 3))] * 4
BAD_SCENES = [
    (None, r"cannot render NoneType: scene must be a wf.Scene, a path"),
    (5, r"cannot render int"),
    ([], r"cannot render an empty list"),
    ([BALL, 5], r"cannot render int"),
    ("https://example.com/a.glb", r"^https://example.com/a.glb: there is no such file$"),
    (ARRAYS, r"cannot render ndarray: scene must be .* \(vertices, faces\)"),
    (([[0, 0, 0]], [[0, 0, 1]]), r"faces\[0\]\[2\] is 1; it must be in \[0, 0\]"),
    (([[0, 0, np.nan]] * 3, [[0, 1, 2]]), r"vertices\[0\]\[2\] is nan"),
    (([], []), r"must have shape \(n, 3\)|no faces"),
    ("missing-file.obj", r"missing-file.obj"),
    (trimesh.Trimesh(), r"no faces|no triangles|empty|has no"),
]


@pytest.mark.parametrize(("change", "message"), BAD, ids=[str(b[0]) for b in BAD])
def test_bad_arguments_are_named_before_any_work(change: dict, message: str) -> None:
    """What, the value and the limit; the file of the scene has not been looked for by then."""
    with pytest.raises(wf.SceneError, match=message):
        wf.render("no such file", **{"progress": False, **change})


def test_an_error_of_the_size_of_the_picture_is_doubted() -> None:
    """Who writes noise=2 for two percent is told."""
    with pytest.warns(UserWarning, match=r"noise is 2, a relative error of 200 %; 2 % is 0\.02$"):
        wf.render(small(), noise=2, progress=False)


@pytest.mark.parametrize(("scene", "message"), BAD_SCENES, ids=range(len(BAD_SCENES)))
def test_bad_scenes_are_named(scene, message: str) -> None:
    with pytest.raises(wf.SceneError, match=message):
        wf.render(scene, 1, progress=False)


TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float), np.array([[0, 1, 2]])


@pytest.mark.parametrize(
    "subject",
    [
        TRIANGLE,
        (TRIANGLE[0].tolist(), TRIANGLE[1].tolist()),
        wf.Mesh(*TRIANGLE),
        BALL,
        trimesh.Trimesh(*TRIANGLE, process=False),
        trimesh.Scene([trimesh.Trimesh(*TRIANGLE, process=False)]),
        wf.Scene([wf.Mesh(*TRIANGLE)]),
        [wf.Mesh(*TRIANGLE)],
        (wf.Mesh(*TRIANGLE), wf.Mesh(*TRIANGLE)),
        [trimesh.Trimesh(*TRIANGLE, process=False), TRIANGLE],
        wf.Scene(trimesh.Trimesh(*TRIANGLE, process=False)),
    ],
    ids=[
        *("arrays", "lists", "mesh", "sphere", "trimesh", "trimesh-scene", "scene"),
        *("list", "tuple", "mixed list", "scene of a trimesh"),
    ],
)
def test_what_can_be_rendered(subject) -> None:
    image = render(subject, 2, size=(6, 5), lighting="even")
    assert image.rgb.shape == (5, 6, 3)
    assert image.rgb.max() == pytest.approx(1)
    assert (image.rgb < 0.99).any()


def test_a_path_can_be_rendered(tmp_path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    for path in (tmp_path / "a.obj", str(tmp_path / "a.obj")):
        assert render(path, 1, size=(6, 5)).rgb.shape == (5, 6, 3)


# --- Result ---------------------------------------------------------------------------------------


def test_the_result_tells_how_it_was_made() -> None:
    image = render(small(), 3, integrator="naive", max_bounces=4, seed=9, sampler="independent", workers=2)
    assert image.spp == 3
    wanted = {
        "integrator": "naive",
        "max_bounces": 4,
        "roulette": 2,
        "seed": 9,
        "sampler": "independent",
        "accelerator": "numpy",
        "workers": 2,
        "bad_samples": 0,
    }
    assert wanted.items() <= image.metadata.items()
    assert image.metadata["seconds"] > 0
    assert image.metadata["version"]


def test_numpy_integers_are_whole_numbers() -> None:
    assert render(small(), np.int64(2), max_bounces=np.uint8(3), seed=np.int32(5)).spp == 2


def test_progress_is_reported() -> None:
    calls = []
    render(small(), 4, wave_size=12, progress=lambda done, total: calls.append((done, total)))
    assert calls == [(12, 48), (24, 48), (36, 48), (48, 48)]


def test_a_point_light_on_a_surface_is_fine() -> None:
    scene = wf.Scene([scenes.floor()], [wf.PointLight((0, 0, 0), 1)], scenes.probe((0, 0, 0), (0, 1, 0)))
    assert np.isfinite(render(scene, 4).rgb).all()


# --- Warnings and faults --------------------------------------------------------------------------


def test_naive_warns_of_point_lights() -> None:
    """It cannot find them."""
    scene = wf.Scene([scenes.floor()], [wf.PointLight((0, 2, 0), 1)], scenes.probe((0, 0, 0), (0.1, 1, 0)))
    with pytest.warns(UserWarning, match=r"naive integrator cannot find lights without size \(PointLight\)"):
        image = render(scene, 1, integrator="naive")
    assert (image.rgb == 0).all()


@pytest.mark.parametrize("workers", [1, 3])
def test_ctrl_c_carries_the_picture_so_far(workers: int) -> None:
    """In an error that is a KeyboardInterrupt and says how much of it there is."""
    scene = small((8, 8))
    calls: list = []

    def stop(done: int, total: int) -> None:
        calls.append(done)
        if done >= 4 * 64:
            raise KeyboardInterrupt

    with pytest.raises(wf.Interrupted, match="has 4 of 16 samples per pixel") as caught:
        render(scene, 16, wave_size=64, workers=workers, progress=stop)
    assert sorted(set(calls)) == [64, 128, 192, 256]
    image = caught.value.image
    assert image.spp == 4
    assert image.metadata["interrupted"]
    assert image.rgb.tobytes() == render(scene, 4, wave_size=64).rgb.tobytes()


def test_ctrl_c_within_a_sample_of_all_pixels() -> None:
    """Pixels that were not reached are black; the others are whole."""

    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(wf.Interrupted, match=r"0\.25 of 1 sample per") as caught:
        render(small((8, 8)), 1, wave_size=16, progress=stop)
    image = caught.value.image
    assert (image.rgb[2:] == 0).all()
    assert (image.rgb[:2] > 0).all()
