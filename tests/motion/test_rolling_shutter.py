"""Rolling shutters: each row has its own time, and what moves sideways leans."""

import numpy as np
import pytest
from significance import ALPHA, render, smallest_p

import wavefront as wf

SIZE = 16
READ = 0.6  # s


def way(*shift):
    """A motion along a line from 0 to 1 s."""
    there = np.eye(4)
    there[:3, 3] = shift
    return wf.Keyframes([0, 1], [np.eye(4), there])


def rod():
    """A scene of an upright rod, one unit wide, that goes three units to the right in a second."""
    return wf.Rectangle(
        (-3, -5, 0),
        (1, 0, 0),
        (0, 10, 0),
    )


FLAT = wf.Camera.orthographic((0, 0, 4), (0, 0, 0), height=8, size=(32, SIZE))


@pytest.mark.parametrize(("read", "moving"), [(READ, "rod"), (-READ, "camera")])
def test_a_rod_leans_by_its_way_while_the_sensor_is_read(read, moving):
    """Its middle in each row is that of the row's time, and its width that of the exposure."""
    camera, shape = FLAT.replace(rolling_shutter=read), rod()
    if moving == "rod":
        shape = shape.transformed(way(3, 0, 0))
    else:
        camera = camera.transformed(way(-3, 0, 0))
    scene = wf.Scene([shape], [wf.Environment(1)], camera)
    image = render(scene, 1024, shutter=(0.1, 0.2), max_bounces=1, aovs="alpha")
    row = np.arange(SIZE)
    delay = READ * (row if read > 0 else SIZE - 1 - row) / SIZE
    x = (np.arange(32) + 0.5) / 2 - 8
    middle = (image.alpha * x).sum(1) / image.alpha.sum(1)
    assert np.abs(middle - (-2.5 + 3 * (0.15 + delay))).max() < 0.02
    assert np.abs(image.alpha.sum(1) / 2 - 1).max() < 0.04
    assert np.ptp(middle) == pytest.approx(3 * READ * (SIZE - 1) / SIZE, abs=0.03)


def test_a_crop_has_the_times_of_the_whole_picture():
    camera, shape = FLAT.replace(rolling_shutter=READ), rod().transformed(way(3, 0, 0))
    scene, options = wf.Scene([shape], [wf.Environment(1)], camera), {"shutter": (0.1, 0.2), "max_bounces": 1}
    whole = render(scene, 4, **options)
    part = render(scene, 4, camera=scene.camera.cropped((4, 9, 28, 15)), **options)
    assert np.array_equal(part.rgb, whole.rgb[9:15, 4:28])
    assert whole.metadata["rolling_shutter"] == READ


VIEW = wf.Camera.look_at((0, 2, 6), (0, 0, 0), size=8)


def scenes():
    box = wf.Box((-0.5, 0, 0), 1.2, material=wf.Diffuse((0.3, 0.7, 0.2)))
    floor = wf.Rectangle((-3, -0.6, 3), (6, 0, 0), (0, 0, -6), material=wf.Diffuse(0.6))
    lights = [wf.PointLight((1, 4, 2), 60), wf.Environment(0.3)]
    forms = np.stack([box.vertices, box.vertices * (1, 0.5, 1) + (1, 0, 0)])
    melting = wf.Mesh(forms, box.faces, times=[0, 1], material=box.material)
    moving_light = wf.PointLight((-1.5, 1.5, 1.5), 10).transformed(way(3, 0, 0))
    return {
        "instance": wf.Scene([floor, box.transformed(way(1, 0, 0.5))], lights, VIEW),
        "deforming": wf.Scene([floor, melting], lights, VIEW),
        "camera": wf.Scene([floor, box], lights, VIEW.transformed(way(0.5, 0.2, 0))),
        "light": wf.Scene([floor, box], [moving_light], VIEW),
        "glass": wf.Scene(
            [
                floor,
                box.transformed(way(1, 0, 0.5)),
                wf.Sphere((0, 0.3, 1), 0.6, material=wf.Dielectric(1.5)),
            ],
            lights,
            VIEW,
        ),
    }


def assert_mean_of_stills(scene, runs, spp, stills, rows=(0, 3, 4, 7), **options):
    """Test that rows have the mean of stills at random times in strata of the exposure of each row."""
    plain = {"max_bounces": 3, "ground": False, "branches": 1, "reuse": False}
    options = {**plain, **options}
    rolling = scene.camera.replace(rolling_shutter=0.8)
    rolled, means = [], []
    for run in range(runs):
        rolled.append(
            render(scene, spp, seed=run, camera=rolling, shutter=(0, 0.2), **options).rgb.astype(float)
        )
        rng, found = np.random.default_rng(run), []
        for row in rows:
            times = 0.8 * row / 8 + 0.2 * (np.arange(stills) + rng.random(stills)) / stills
            pictures = [
                render(
                    scene.at(time),
                    4,
                    seed=1000 * run + 100 * row + at + 1,
                    camera=scene.camera.at(time).cropped((0, row, 8, row + 1)),
                    **plain,
                ).rgb.astype(float)
                for at, time in enumerate(times.tolist())
            ]
            found.append(np.mean(pictures, 0)[0])
        means.append(np.stack(found))
    one, other = np.stack(rolled)[:, list(rows)], np.stack(means)
    assert smallest_p(*(each.reshape(runs, len(rows), 2, 4, 3).mean(3) for each in (one, other))) > ALPHA
    assert np.abs(one.mean((0, 2)) - other.mean((0, 2))).max() < 0.2 * other.mean()


@pytest.mark.parametrize("name", ["instance", "camera"])
def test_rows_are_means_of_stills_at_their_times(name):
    assert_mean_of_stills(scenes()[name], 4, 8, 2)


@pytest.mark.slow
@pytest.mark.parametrize("accel", ["numpy", "embree"])
@pytest.mark.parametrize("name", scenes())
def test_all_rows_are_means_of_stills(name, accel):
    assert_mean_of_stills(scenes()[name], 8, 32, 8, rows=(0, 5), accel=accel)


@pytest.mark.slow
@pytest.mark.parametrize("options", [{"branches": 4}, {"guide": True}])
def test_rows_of_guided_and_branching_paths_are_means_of_stills(options):
    assert_mean_of_stills(scenes()["glass"], 8, 32, 8, rows=(0, 5), **options)


@pytest.mark.slow
def test_rows_in_fog_are_means_of_stills():
    scene = scenes()["instance"]
    fog = wf.Material(wf.NullSurface(), interior=wf.Medium(scattering=1))
    ball = wf.Sphere((0.2, 0.3, 1), 0.6, material=fog)  # away from the light, near which fog is noisy
    assert_mean_of_stills(scene.add(ball), 8, 32, 8, rows=(0, 5))


def test_aovs_are_those_of_the_times_of_rows():
    """Ids, depth and texture coordinates of each row are those of the still scene of its time."""
    shape = wf.Rectangle((-1, -2, 0), (2, 0, 0), (0, 4, 0)).transformed(way(1, 0, 1))
    scene = wf.Scene([shape], camera=VIEW.transformed(way(0.3, 0, 0)))
    names = ("shape_id", "depth", "uv")
    camera = scene.camera.replace(rolling_shutter=0.8)
    rolled = render(scene, 1, camera=camera, shutter=(0, 0.2), aovs=names)
    for row in range(8):
        still = render(scene.at(0.1 + 0.8 * row / 8), 1, aovs=names)
        assert np.array_equal(rolled.shape_id[row], still.shape_id[row])
        assert rolled.depth[row] == pytest.approx(still.depth[row], rel=1e-5, nan_ok=True)
        assert rolled.uv[row] == pytest.approx(still.uv[row], abs=1e-4, nan_ok=True)


def test_cameras_keep_it():
    camera = FLAT.replace(rolling_shutter=READ)
    assert camera.resized(8).rolling_shutter == READ
    assert camera.replace(origin=(1, 0, 0)).rolling_shutter == READ
    assert camera.replace(rolling_shutter=0).rolling_shutter == 0
    assert camera.transformed(way(1, 0, 0)).at(0.5).rolling_shutter == READ
    alike = wf.Camera(FLAT.origin, FLAT.rotation, FLAT.projection, FLAT.size, rolling_shutter=READ)
    assert alike.rolling_shutter == READ


def test_where_nothing_moves_it_changes_nothing():
    scene = wf.Scene([wf.Box((0, 0, 0), 1)], camera=VIEW)
    plain = render(scene, 2)
    for options in ({}, {"shutter": (0, 1)}):
        rolled = render(scene, 2, camera=VIEW.replace(rolling_shutter=READ), **options)
        assert np.array_equal(plain.rgb, rolled.rgb)


def test_a_shutter_after_all_motion_shows_its_end():
    scene = wf.Scene([wf.Box((0, 0, 0), 1).transformed(way(1, 0, 0))], camera=VIEW)
    late = render(scene, 2, shutter=(2, 3), aovs="depth")
    assert np.array_equal(late.depth, render(scene.at(1), 2, aovs="depth").depth, equal_nan=True)


def test_a_session_follows_cameras_that_move_in_other_ways():
    scene = wf.Scene([wf.Box((0, 0, 0), 1)], camera=VIEW.transformed(way(0.5, 0, 0)))
    other = VIEW.transformed(way(0, 0.5, 0)).replace(rolling_shutter=0.1)
    options = {"shutter": (0, 0.5), "progress": False, "workers": 1, "spp": 2, "reuse": False, "branches": 1}
    with wf.Session(scene, camera=other, **options) as session:
        session.run()
        session.set_camera(scene.camera)
        assert np.array_equal(session.run().rgb, wf.render(scene, **options).rgb)


def test_turned_cameras_keep_their_way():
    """An orbit turns the way too; cameras between others stay where they are."""
    moving = VIEW.transformed(way(1, 0, 0))
    for degrees in (0, 90):
        turned = wf.orbit(moving, (0, 0, 0), degrees)
        for time in (0, 0.5, 1):
            due = wf.orbit(moving.at(time), (0, 0, 0), degrees)
            assert turned.at(time).origin == pytest.approx(due.origin)
            assert turned.at(time).rotation == pytest.approx(due.rotation)
    between = wf.interpolate_cameras([moving, VIEW.replace(origin=(5, 2, 6))], 3)[1]
    assert not between.moves
    assert between.origin == pytest.approx((2.5, 2, 6))


def test_mistakes_are_named():
    rolling = VIEW.replace(rolling_shutter=READ)
    scene = wf.Scene([wf.Box((0, 0, 0), 1).transformed(way(1, 0, 0))], [wf.PointLight((0, 4, 4), 9)], rolling)
    with pytest.raises(
        wf.SceneError, match=r"rolling_shutter is 0.6, and something moves; shutter=\(open, clo"
    ):
        render(scene, 1)
    with pytest.raises(wf.SceneError, match="Camera rolling_shutter is nan"):
        VIEW.replace(rolling_shutter=np.nan)
    with pytest.raises(wf.SceneError, match="does not go with a camera with a rolling shutter"):
        render(scene, 1, shutter=(0, 0.1), caustics=True)
    with (
        wf.Session(scene, 1, camera=VIEW, shutter=(0, 0.1), progress=False) as session,
        pytest.raises(wf.SceneError, match=r"is 0\.6; this scene was compiled for at most 0 s"),
    ):
        session.set_camera(rolling)
