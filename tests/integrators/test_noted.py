"""Numbers that an integrator of a user's own notes come back as an AOV."""

import numpy as np
import pytest
from inside import branch

import wavefront as wf
from wavefront import integrators as steps

SCENE = wf.Scene(
    [wf.Sphere((0, 0, 0), 1), wf.Rectangle((-3, -1, 3), (6, 0, 0), (0, 0, -6))],
    [wf.Environment(1)],
    wf.Camera.look_at((0, 1, 4), (0, 0, 0), size=(24, 16)),
)


def counting(scene, paths, sampler, max_bounces):
    """`full` that notes how many surfaces each path has met, and where it first was."""
    L = np.zeros((3, len(paths)), np.float32)
    steps.note(paths, "direction", paths.direction)
    steps.note(paths, "surfaces", np.zeros(len(paths), np.float32))
    for bounce in range(max_bounces + 1):
        paths, hits = steps.intersect_and_compact(scene, paths, sampler, bounce, L, mis=True)
        steps.note(paths, "surfaces", np.ones(len(paths), np.float32))
        if bounce == max_bounces or not len(paths):
            break
        shade = steps.prepare_shading(scene, paths, hits)
        steps.accumulate(L, paths, steps.direct(scene, paths, shade, sampler, bounce, mis=True))
        paths = steps.bounce_sample(paths, shade, sampler, bounce)
        paths = steps.select(paths, steps.roulette(scene, paths, sampler, bounce))
    return L


def rendered(**settings):
    given = {"spp": 8, "integrator": counting, "max_bounces": 3, "progress": False, **settings}
    return wf.render(SCENE, **given)


def test_they_are_means_over_the_samples_with_their_errors():
    image = rendered(aovs=("noted.surfaces", "noted.direction", "alpha"))
    surfaces = image.layers["noted.surfaces"][..., 0]
    traced = [list(wf.trace(SCENE, sample=k, max_bounces=3)) for k in range(8)]
    met = np.zeros(24 * 16)
    for sample in traced:
        for step in sample:
            if step.stage == "compact":
                np.add.at(met, step.paths.pixel.astype(int), 1 / 8)
    np.testing.assert_allclose(surfaces, met.reshape(16, 24), atol=1e-6)
    axis = image.layers["noted.direction"].mean((0, 1))
    assert axis / np.linalg.norm(axis) == pytest.approx(-SCENE.camera.rotation[:, 2], abs=0.01)
    assert (image.errors["noted.surfaces"][surfaces != np.rint(surfaces)] > 0).all()


def test_workers_waves_and_files_keep_their_bits(tmp_path):
    one, two = (
        rendered(aovs="noted.surfaces", **given)
        for given in ({"workers": 1, "wave_size": 100}, {"workers": 2, "executor": "processes"})
    )
    np.testing.assert_array_equal(one.layers["noted.surfaces"], two.layers["noted.surfaces"])
    np.testing.assert_array_equal(one.rgb, rendered().rgb)
    one.save(tmp_path / "a.exr")
    read = wf.Image.load(tmp_path / "a.exr").layers["noted.surfaces"]
    np.testing.assert_array_equal(read, one.layers["noted.surfaces"])


def branching(scene, paths, sampler, max_bounces):
    """Note 1 about each of the ways in which paths go on."""
    L = np.zeros((3, len(paths)), np.float32)
    first, hits = steps.intersect_and_compact(scene, paths, sampler, 0, L, mis=False)
    shade = steps.prepare_shading(scene, first, hits)
    left = branch(first, shade, sampler, 0, 4)
    steps.note(left, "ways", np.ones(len(left), np.float32))
    return L


def test_ways_of_a_path_are_parts_of_its_sample():
    image = rendered(integrator=branching, aovs=("noted.ways", "alpha"), spp=2)
    np.testing.assert_allclose(image.layers["noted.ways"][..., 0], image.layers["alpha"], atol=1e-6)


def wrong(scene, paths, sampler, max_bounces):
    steps.note(paths, "surfaces", np.zeros((2, len(paths)), np.float32))
    return np.zeros((3, len(paths)), np.float32)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"aovs": "noted.surface"},
            r"counting cannot give the AOV 'noted\.surface': it must call .*'surface'",
        ),
        ({"aovs": "noted.x", "integrator": "full"}, r"li_full cannot give the AOV 'noted\.x'"),
        ({"aovs": "noted."}, r"aovs has 'noted\.'"),
        ({"aovs": "noted"}, r"aovs has 'noted'"),
        (
            {"aovs": "noted.surfaces", "integrator": wrong},
            r"values of 'surfaces' have the shape \(2, \d+\); they must have \(n,\) or \(3, n\), with n = ",
        ),
    ],
)
def test_errors_say_what_is_missing(settings, message):
    with pytest.raises(wf.SceneError, match=message):
        rendered(**settings)
