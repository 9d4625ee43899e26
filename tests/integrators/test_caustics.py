"""The setting caustics: the same bits however a picture is made, honest errors, and clear refusals.

What paths from lights find is the subject of test_light_tracing.py.
"""

from __future__ import annotations

import hashlib
import itertools
import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from hypothesis import given
from hypothesis import strategies as st
from inside import LightSums, PointLightRecord, f4, tracing
from significance import assert_same_images, repeat

import wavefront as wf
from wavefront import cli

SIZE = (24, 18)
PIXELS = SIZE[0] * SIZE[1]
GLASS = wf.Dielectric(1.5)
EVERY: dict[str, Any] = {"caustics": True, "aovs": "all", "progress": False}
ALONE: dict[str, Any] = {"workers": 1, "executor": "threads", "progress": False}


def scene(material: Any = GLASS, lights: Any = None, **camera: Any) -> wf.Scene:
    """Return a ball on a floor before a wall, lit by a point, built anew as another process would."""
    matte = wf.Diffuse(0.7)
    shapes = [
        wf.Rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4), material=matte),
        wf.Rectangle((-2, 0, -2), (4, 0, 0), (0, 3, 0), material=matte),
        wf.Sphere((0, 0.8, 0), 0.5, material=material),
    ]
    lights = [wf.PointLight((0.5, 2.5, 0.5), 20)] if lights is None else lights
    view = wf.Camera.look_at((0, 2, 5), (0, 0.7, 0), fov=40, size=SIZE, **camera)
    return wf.Scene(shapes, lights, view)


def arrays(image: wf.Image) -> dict[str, np.ndarray]:
    """Return all arrays of a picture by name."""
    found = {name: getattr(image, name) for name in ("rgb", "variance", "standard_error", "counts")}
    return {**found, **image.layers, **{f"error of {name}": error for name, error in image.errors.items()}}


def digest(image: wf.Image) -> dict[str, str]:
    """SHA-256 of each array of a picture."""
    return {
        name: hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()
        for name, array in arrays(image).items()
    }


@cache
def whole(spp: int = 8) -> dict[str, str]:
    """Return the digest of a render in one go."""
    return digest(wf.render(scene(), spp, **EVERY, workers=1, executor="threads"))


def ends_at(number: int) -> Callable[[float, float], None]:
    """Return what is called with the progress, and presses Ctrl-C after so many samples."""

    def progress(done: float, total: float) -> None:
        if done >= number:
            raise KeyboardInterrupt

    return progress


def stopped_after(number: int, **settings: Any) -> wf.Image:
    """Render until so many samples are done; return the picture so far."""
    with pytest.raises(wf.Interrupted) as stop:
        wf.render(scene(), **{**EVERY, **settings, "progress": ends_at(number)})
    assert stop.value.image is not None
    return stop.value.image


def part(first: int, end: int, **settings: Any) -> wf.Image:
    """Return the picture of some samples."""
    return wf.render(scene(), samples=range(first, end), **{**EVERY, **settings})


# --- The same bits ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "settings",
    [
        {"workers": 3, "executor": "threads", "wave_size": 1000},
        {"workers": 2, "executor": "processes", "wave_size": 500},
        pytest.param({"workers": 2, "executor": "spawn"}, marks=pytest.mark.slow),
        pytest.param({"workers": 2, "executor": "forkserver"}, marks=pytest.mark.slow),
        pytest.param({"max_memory": "4GB"}, marks=pytest.mark.slow),
        pytest.param({"workers": 1, "executor": "threads", "wave_size": 97}, marks=pytest.mark.slow),
    ],
)
@pytest.mark.first(1)
def test_no_bit_depends_on_workers_executor_or_waves(settings: dict[str, Any]) -> None:
    """Of the picture, its errors and all layers; and one call gives the same as another."""
    assert digest(wf.render(scene(), 8, **EVERY, **settings)) == whole()


def test_light_tracing_changes_the_picture() -> None:
    plain, seeded = (
        wf.render(scene(), 8, **{**EVERY, **other}) for other in ({"caustics": False}, {"seed": 1})
    )
    for image in (plain, seeded):
        assert digest(image)["rgb"] != whole()["rgb"]
        assert digest(image)["standard_error"] != whole()["standard_error"]


def test_no_bit_depends_on_embree_where_numpy_traces(missing: Callable[..., None]) -> None:
    expected = digest(wf.render(scene(), 8, **EVERY, accel="numpy"))
    missing("embreex")
    image = wf.render(scene(), 8, **EVERY)
    assert image.metadata["accelerator"] == "numpy"
    assert digest(image) == expected


@pytest.mark.parametrize("workers", [2, pytest.param(1, marks=pytest.mark.slow)])
def test_no_bit_depends_on_a_lack_of_memory(workers: int, fails: Callable[..., Any]) -> None:
    lack = MemoryError("no room")
    calls = fails("wavefront.drive.tracing.trace_light", lack, lambda *given: given[3].size > 300)
    image = wf.render(scene(), 8, **EVERY, workers=workers, executor="threads", wave_size=2000)
    assert max(call.args[3].size for call in calls) > 300
    assert digest(image) == whole()


def test_sessions_show_the_pictures_of_fewer_samples() -> None:
    other = wf.Camera.look_at((1, 2, 5), (0, 0.7, 0), fov=40, size=(20, 14))
    with wf.Session(scene(), 8, **EVERY) as session:
        found = {image.spp: digest(image) for image in session}
        session.set_camera(other)
        second = session.run()
    assert list(found) == [1, 2, 4, 8]
    for spp, parts in found.items():
        assert parts == whole(spp)
    assert digest(second) == digest(wf.render(scene(), 8, camera=other, **EVERY))


def test_views_are_single_renders() -> None:
    cameras = wf.turntable(scene(), 3, size=(16, 12))
    for camera, image in zip(cameras, wf.render_many(scene(), cameras, 4, **EVERY), strict=True):
        assert digest(image) == digest(wf.render(scene(), 4, camera=camera, **EVERY))


# --- Parts --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.first(1)
def test_a_render_that_is_stopped_goes_on_with_the_same_bits(tmp_path: Path, seed: int) -> None:
    """At random moments, each part with other workers and waves; then with more samples."""
    rng, path = random.Random(seed), tmp_path / "out.wfck"
    for _ in range(2):
        settings = {"workers": rng.choice([1, 2, 3]), "wave_size": rng.choice([100, 333, 700])}
        number = rng.randrange(1, 4 * PIXELS)
        image = stopped_after(number, spp=8, checkpoint=path, executor="threads", **settings)
        kept = wf.Image.load(path)
        assert digest(kept)["rgb"] == digest(image)["rgb"]
        assert kept.metadata["caustics"] is True
    assert digest(wf.render(scene(), 8, **EVERY, checkpoint=path)) == whole()
    assert digest(wf.render(scene(), 16, **EVERY, checkpoint=path)) == whole(16)


@pytest.mark.parametrize("kept", ["memory", "npz", "checkpoint"])
def test_parts_merge_to_the_whole(kept: str, tmp_path: Path) -> None:
    """In any order, bit for bit but for the errors, whose batches differ."""
    parts = []
    for number, (first, end) in enumerate([(0, 3), (3, 4), (4, 8)]):
        if kept == "checkpoint":
            file = tmp_path / f"{number}.wfck"
            part(first, end, checkpoint=file)
        else:
            image, file = part(first, end), tmp_path / f"{number}.npz"
            image.save(file)
        loaded = wf.Image.load(file)
        if kept == "npz":
            assert digest(loaded) == digest(image)
        parts.append(image if kept == "memory" else loaded)
    same = [name for name in arrays(parts[0]) if name != "standard_error" and not name.startswith("error")]
    assert {"rgb", "indirect", "counts"} <= set(same)
    for order in itertools.permutations(parts):
        merged = digest(order[0].merge(order[1]).merge(order[2]))
        for name in set(same) - {"variance"}:
            assert name not in whole() or merged[name] == whole()[name], name


def test_parts_of_equal_length_have_the_errors_of_the_whole() -> None:
    merged, image = part(0, 16).merge(part(16, 32)), wf.render(scene(), 32, **EVERY)
    assert digest(merged)["rgb"] == digest(image)["rgb"]
    np.testing.assert_allclose(merged.standard_error, image.standard_error, rtol=1e-3, atol=1e-6)
    np.testing.assert_allclose(merged.variance, image.variance, rtol=1e-4, atol=1e-7)


def test_files_without_caustics_are_as_before(tmp_path: Path) -> None:
    """No array is of paths from lights, and the scene has the same fingerprint."""
    image = part(0, 2, caustics=False, checkpoint=tmp_path / "a.wfck")
    image.save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as archive, np.load(tmp_path / "a.wfck") as checkpoint:
        names = [*archive, *checkpoint]
    assert not [name for name in names if "light" in name]
    identities = []
    for caustics in (False, True):
        with wf.Session(scene(), 2, **{**EVERY, "caustics": caustics}) as session:
            identities.append(session.identity())
    assert identities[1] == {**identities[0], "caustics": True}


@pytest.mark.parametrize("before", [False, True])
def test_files_of_the_other_kind_are_refused(before: bool, tmp_path: Path) -> None:
    path, words = tmp_path / "a.wfck", f"caustics was {before} and is {not before}"
    image = part(0, 2, caustics=before, checkpoint=path)
    with pytest.raises(wf.SceneError, match=rf"a\.wfck: is the checkpoint of another render: {words};"):
        part(0, 2, caustics=not before, checkpoint=path)
    with pytest.raises(wf.SceneError, match=rf"different renders cannot be merged: {words}$"):
        image.merge(part(2, 4, caustics=not before))


@pytest.mark.parametrize("name", ["paths", "0.high", "3.low"])
@pytest.mark.first(1)
def test_damaged_sums_are_named(name: str, tmp_path: Path) -> None:
    part(0, 2).save(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as archive:
        found = dict(archive)
    key = f"sums.film.light.{name}"
    for spoiled in ({k: v for k, v in found.items() if k != key}, {**found, key: found[key][..., :-1]}):
        np.savez(tmp_path / "b.npz", **spoiled)
        with pytest.raises(
            wf.SceneError, match=rf"b\.npz: the sums of its samples are damaged.*light\.{name}"
        ):
            wf.Image.load(tmp_path / "b.npz")


# --- What is refused ----------------------------------------------------------------------------------


def test_the_metadata_tell_of_it() -> None:
    for given_value in (True, np.True_, False):
        image = wf.render(scene(), 1, caustics=given_value, progress=False)
        assert image.metadata["caustics"] is bool(given_value)


@pytest.mark.parametrize(
    ("arguments", "settings", "missing"),
    [
        ({}, {}, True),
        ({"material": wf.Mirror(0.9)}, {}, True),
        ({"lights": [wf.DirectionalLight((-1, -2, -1), 3)]}, {}, True),
        ({}, {"caustics": True}, False),
        ({}, {"integrator": "direct_mis"}, False),
        ({}, {"max_bounces": 1}, False),
        ({"material": wf.Diffuse(0.5)}, {}, False),
        ({"lights": [wf.Environment(1)]}, {}, False),
        ({"lights": [wf.Environment(1), wf.PointLight((0, 2.5, 0), 0)]}, {}, False),
    ],
)
def test_a_hint_tells_where_light_is_missing(arguments, settings, missing):
    """Where there are lights that no path can meet beside smooth glass or mirrors."""
    hint = wf.render(scene(**arguments), 1, progress=False, **settings).metadata["hint"]
    assert (hint is not None and "caustics=True adds them" in hint) == missing


@pytest.mark.slow
def test_shared_paths_leave_out_the_same_light(close_tiles: None) -> None:
    """A lamp in a glass ball lights a room: what paths from lights find at second points counts once."""
    options: dict[str, Any] = {"caustics": True, "max_bounces": 5, "accel": "auto"}
    room = scenes.cornell_box((16, 16))
    ball, lamp = wf.Sphere((0, 0, 0), 0.5, material=GLASS), wf.Sphere((0, 0, 0), 0.25, emission=5)
    room.shapes = [*room.shapes[:5], ball, lamp]
    alone = repeat(room, 16, **options)
    shared = repeat(room, 8, reuse=True, first_seed=100, **options)
    assert_same_images(alone, shared, 0.01)


def test_noise_ends_all_pixels_together() -> None:
    """The picture is that of as many samples, and its error is what was asked for."""
    image = wf.render(scene(), noise=0.05, caustics=True, **ALONE)
    assert image.metadata["noise"] <= 0.05
    assert image.spp > 32
    assert (image.counts == image.spp).all()
    whole = wf.render(scene(), image.spp, caustics=True, **ALONE)
    assert whole.rgb.tobytes() == image.rgb.tobytes()
    assert whole.standard_error.tobytes() == image.standard_error.tobytes()


# --- Errors -------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("sampler", ["independent", pytest.param("sobol", marks=pytest.mark.slow)])
@pytest.mark.first(1)
def test_the_standard_error_is_honest(sampler: str) -> None:
    """Over 30 seeds, in the caustic and elsewhere: as large as errors are, or larger where paths are even."""
    settings: dict[str, Any] = {"sampler": sampler, **ALONE}
    images = [wf.render(scene(), 8, caustics=True, seed=seed, **settings) for seed in range(30)]
    pictures = np.array([image.rgb for image in images], float)
    plain = np.mean([wf.render(scene(), 8, seed=seed, **settings).rgb for seed in range(8)], axis=0)
    caustic = (pictures.mean(0) - plain).max(2) > 0.05
    assert 3 < caustic.sum() < PIXELS / 4
    happened = pictures.var(0, ddof=1)
    estimated = np.mean([np.square(image.standard_error, dtype=float) for image in images], axis=0)
    for where in (caustic, ~caustic):
        ratio = estimated[where].sum() / happened[where].sum()
        assert 0.8 < ratio < (1.25 if sampler == "independent" else 2)
    if sampler == "independent":  # then that of one sample is as many times as large as there are samples
        variance = np.mean([image.variance for image in images])
        assert 8 * estimated.mean() == pytest.approx(variance, rel=0.1)


def test_the_variance_of_a_sample_has_its_part_of_light_tracing() -> None:
    """So that variance / spp is the squared error of independent samples; noise is that of the whole."""
    image = wf.render(scene(), 8, caustics=True, **ALONE)
    plain = wf.render(scene(), 8, **ALONE)
    kept = part(0, 8).sums.film
    light = kept.light.squared_error().T.reshape(image.shape)
    kept.light = None
    without = kept.estimates()
    np.testing.assert_allclose(image.variance, without.variance.reshape(image.shape) + 8 * light, rtol=1e-5)
    squared = np.square(without.standard_error.reshape(image.shape), dtype=float) + light
    np.testing.assert_allclose(image.standard_error, np.sqrt(squared), rtol=1e-5)
    assert image.metadata["noise"] != plain.metadata["noise"]
    assert 0.01 < image.metadata["noise"] < 0.5


@dataclass(eq=False)
class SpoiledLights(PointLightRecord):
    """Points whose light is not finite at one place of the glass, which only paths from lights ask for."""

    part = 1.0

    def record(self, center: Any) -> Any:
        """Return itself, moved."""
        return type(self)(self.position - np.asarray(center, f4)[:, None], self.intensity)

    def sample_li(self, point: Any, u: Any) -> wf.LightSample:
        """Spoil the radiance above the middle of the scene."""
        sample = super().sample_li(point, u)
        near = np.abs(point).max(0) < 0.75  # the center of the scene is that of its bounds
        spoiled = near & (u[0] < self.part)
        sample.radiance = np.where(spoiled, f4(np.nan), sample.radiance).astype(f4)
        return sample


class SeldomSpoiledLights(SpoiledLights):
    """The same, once in fifty times."""

    part = 0.02


def spoiled_scene(kind: type[SpoiledLights]) -> wf.Scene:
    """Return the ball under such a light, whose light at surfaces that scatter is finite."""
    light = kind(np.array([[0.5], [2.5], [0.5]], f4), np.full((3, 1), 20, f4))
    return scene(lights=[light])


def test_splats_that_are_not_finite_are_dropped_counted_and_named() -> None:
    with pytest.raises(wf.RenderError, match="samples were not finite and were dropped; first: ") as caught:
        wf.render(spoiled_scene(SeldomSpoiledLights), 8, caustics=True, **ALONE)
    assert "of the path from the light" in str(caught.value)
    image = caught.value.image
    assert 0 < image.metadata["bad_samples"] < 0.01 * image.metadata["samples"]
    assert image.counts.sum() == image.metadata["samples"] - image.metadata["bad_samples"]
    assert np.isfinite(image.rgb).all()
    good = wf.render(scene(), 8, caustics=True, **ALONE)
    assert image.rgb.mean() == pytest.approx(good.rgb.mean(), rel=0.02)
    plain = wf.render(spoiled_scene(SpoiledLights), 8, **ALONE)
    assert plain.metadata["bad_samples"] == 0
    assert plain.rgb.tobytes() == wf.render(scene(), 8, **ALONE).rgb.tobytes()


# --- Layers -------------------------------------------------------------------------------------------


def test_direct_light_is_as_without_and_the_rest_is_indirect() -> None:
    found, plain = (wf.render(scene(), 8, **{**EVERY, "caustics": each}) for each in (True, False))
    for name in set(arrays(plain)) - {"rgb", "variance", "standard_error", "indirect", "error of indirect"}:
        assert digest(found)[name] == digest(plain)[name], name
    np.testing.assert_allclose(found.direct + found.indirect, found.rgb, rtol=1e-5, atol=1e-6)
    more = found.indirect.astype(float) - plain.indirect
    assert more.min() > -1e-6
    assert more.max() > 0.1
    errors = found.errors["indirect"], plain.errors["indirect"]
    assert (errors[0] >= errors[1]).all()
    assert (errors[0] > errors[1]).any()


def test_indirect_light_needs_no_other_layer() -> None:
    image = wf.render(scene(), 8, caustics=True, aovs="indirect", progress=False)
    assert digest(image)["indirect"] == whole()["indirect"]
    assert digest(wf.render(scene(), 8, caustics=True, progress=False))["rgb"] == whole()["rgb"]


def test_a_clamp_leaves_light_tracing_alone() -> None:
    """It limits what paths from the camera find; the picture with what it removed is that without."""
    found, plain = (
        wf.render(scene(), 8, clamp=0.3, caustics=each, aovs="indirect", progress=False)
        for each in (True, False)
    )
    assert digest(found)["clamped"] == digest(plain)["clamped"]
    free = wf.render(scene(), 8, caustics=True, progress=False)
    np.testing.assert_allclose(found.rgb + found.clamped, free.rgb, rtol=1e-5, atol=1e-6)
    assert 0 < found.metadata["clamped"] < plain.metadata["clamped"]


def test_denoising_starts_from_the_whole_picture() -> None:
    image = wf.render(scene(), 8, caustics=True, denoise=True, progress=False)
    assert image.layers["noisy"].tobytes() == wf.render(scene(), 8, **EVERY).rgb.tobytes()
    assert np.isfinite(image.rgb).all()


# --- Sums ---------------------------------------------------------------------------------------------

values = st.floats(-(2.0**60), 2.0**60, width=32)
splats = st.lists(st.tuples(st.integers(0, 4), values), max_size=60)


def summed(found: list[tuple[int, float]], paths: int = 7, sample: int = 0) -> LightSums:
    """Return the sums of splats on five pixels."""
    sums = LightSums(5)
    radiance = np.array([value for _, value in found], f4)
    pixels = np.array([pixel for pixel, _ in found], np.uint32)
    sums.add(sample, paths, pixels, radiance * np.array([[1], [2], [-0.5]], f4))
    return sums


def bits(sums: LightSums) -> dict[str, bytes]:
    """Return the bytes of all arrays of sums."""
    return {name: array.tobytes() for name, array in sums.arrays().items()}


@given(splats)
def test_sums_are_those_of_each_pixel(found: list[tuple[int, float]]) -> None:
    """However often one occurs; each term is rounded once, by at most 2^-20 of the largest."""
    sums = summed(found)
    for pixel in range(5):
        terms = [value for at, value in found if at == pixel]
        largest = max(map(abs, terms), default=0)
        bound = 2.0**-20 * len(terms) * max(largest, 1e-45)
        assert abs(sums.batches["0"].value()[0, pixel] - math.fsum(terms)) <= bound
    assert (sums.mean() == sums.batches["0"].value() / 7).all()


@given(splats, st.randoms(use_true_random=False), st.integers(0, 60))
def test_no_bit_of_sums_depends_on_order_or_parts(found, shuffler, cut):
    shuffled = list(found)
    shuffler.shuffle(shuffled)
    expected = bits(summed(found, 14))
    assert bits(summed(shuffled, 14)) == expected
    merged = summed(shuffled[cut:])
    merged.merge(summed(shuffled[:cut], sample=8))  # of the same batch
    assert bits(merged) == expected
    restored = LightSums(5)
    restored.restore({name: array.copy() for name, array in merged.arrays().items()})
    assert bits(restored) == expected


def test_many_splats_of_one_pixel_are_summed() -> None:
    """More than are added at once, beside pixels with one and with none."""
    count = 200_000
    pixels = np.append(np.full(count, 3, np.uint32), np.uint32(1))
    radiance = np.random.default_rng(1).random((3, count + 1), f4)
    sums = LightSums(5)
    sums.add(6, count, pixels, radiance)
    for channel in range(3):
        exact = math.fsum(radiance[channel, :-1].tolist())
        assert sums.batches["2"].value()[channel, 3] == pytest.approx(exact, rel=1e-12)
    assert (sums.batches["2"].value()[:, 1] == radiance[:, -1]).all()
    assert not sums.batches["2"].value()[:, [0, 2, 4]].any()


@pytest.mark.parametrize("value", [1.0, 4095.9, 8191.9, 1e18, 3e38])
def test_a_pixel_may_have_four_billion_splats(value: float) -> None:
    """All paths from lights fall on a few pixels where a small piece of glass is far away."""
    sums = LightSums(1)
    sums.add(0, 1, np.zeros(1, np.uint32), np.full((3, 1), value, f4))
    for _ in range(31):
        sums.merge(sums)
    assert sums.paths[0] == 2**31
    assert sums.batches["0"].value() == pytest.approx(np.full((3, 1), float(f4(value)) * 2.0**31), rel=1e-6)


def test_no_splats_are_no_light() -> None:
    """Neither with paths that bring nothing nor without paths; one batch tells no error."""
    for paths in ([], [5], [5, 7]):
        sums = LightSums(5)
        for sample, number in enumerate(paths):
            sums.add(sample, number, np.zeros(0, np.uint32), np.zeros((3, 0), f4))
        assert sums.paths.sum() == sum(paths)
        assert not sums.mean().any()
        assert np.isnan(sums.squared_error()).all() if len(paths) == 1 else not sums.squared_error().any()


@pytest.mark.slow
def test_errors_are_those_of_the_scatter_of_batches() -> None:
    """Of equal ones the variance of their means over their number; of others as without bias."""
    brought = np.random.default_rng(2).random((4, 3))
    sums = LightSums(1)
    for sample, radiance in enumerate(brought):
        sums.add(sample, 10, np.zeros(1, np.uint32), radiance.astype(f4)[:, None])
    exact = (brought / 10).var(0, ddof=1) / 4
    assert sums.squared_error()[:, 0] == pytest.approx(exact, rel=1e-6)
    generator, found, means = np.random.default_rng(3), [], []
    for _ in range(4000):
        sums = LightSums(1)
        for sample, paths in enumerate((4, 2, 1)):
            values = generator.random((3, paths)).astype(f4)
            sums.add(sample, paths, np.zeros(paths, np.uint32), values)
        found.append(sums.squared_error())
        means.append(sums.mean())
    assert np.mean(found) == pytest.approx(np.var(means), rel=0.05)


# --- Memory, windows, and scenes without caustics -----------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [
        {"material": wf.Diffuse(0.5)},
        {"material": wf.Dielectric(1.5, 0.3)},
        {"lights": [wf.Environment((0.4, 0.6, 1))]},
        {"lights": [wf.DirectionalLight((-1, -2, -1), 3, angle=0.5)]},
    ],
    ids=["nothing smooth", "rough glass", "light all around", "a sun"],
)
def test_scenes_without_specular_surfaces_or_placed_lights_cost_nothing(arguments, monkeypatch):
    monkeypatch.delattr(tracing, "trace_light")
    subject = scene(**arguments)
    found, plain = (wf.render(subject, 4, **{**EVERY, "caustics": each, **ALONE}) for each in (True, False))
    assert digest(found) == digest(plain)
    assert found.metadata["rays"] == plain.metadata["rays"]


@pytest.mark.parametrize("max_bounces", [0, 1])
def test_short_paths_have_no_caustics(max_bounces: int) -> None:
    """One scattering event cannot be at glass and at what the camera sees."""
    settings: dict[str, Any] = {"max_bounces": max_bounces, "progress": False}
    lamp = wf.Sphere((1, 1.5, -1), 0.1, emission=600)  # in the picture
    subject = wf.Scene([*scene().shapes, lamp], camera=scene().camera)
    found, plain = (wf.render(subject, 4, caustics=each, **settings) for each in (True, False))
    assert found.rgb.tobytes() == plain.rgb.tobytes()


@pytest.mark.slow
def test_a_window_has_the_light_of_the_whole_picture() -> None:
    """By paths from lights of its own: not the same bits, but the same expectation."""
    window, spp = (6, 7, 18, 16), 8

    def light(seed: int, **camera: Any) -> Any:
        film = wf.render(
            scene(**camera), samples=range(spp), seed=seed, caustics=True, **ALONE
        ).sums.film.light
        return film.mean().T.reshape(-1, 12 if camera else SIZE[0], 3)

    parts = np.array([light(seed, crop=window) for seed in range(24)])
    wholes = np.array([light(seed)[7:16, 6:18] for seed in range(24)])
    assert parts.shape == wholes.shape
    assert not (parts == wholes).all()
    first, second = (each.sum((1, 2, 3)) for each in (parts, wholes))
    error = math.hypot(first.std(ddof=1), second.std(ddof=1)) / math.sqrt(24)
    assert error < 0.02 * second.mean()
    assert abs(first.mean() - second.mean()) < 3.5 * error


@pytest.mark.parametrize("number", [200, 700])
def test_ctrl_c_keeps_a_picture_of_the_right_brightness(number: int, tmp_path: Path) -> None:
    """Also in the middle of the first pass over the pixels: the light is that of the paths so far."""
    image = stopped_after(number, spp=8, checkpoint=tmp_path / "a", **{**ALONE, "wave_size": 50})
    film = wf.Image.load(tmp_path / "a").sums.film
    paths = film.light.paths.sum()
    assert number <= paths == image.metadata["samples"] < 8 * PIXELS
    light = part(0, 64).sums.film.light.mean()
    assert film.light.mean().mean() == pytest.approx(light.mean(), rel=5 / math.sqrt(paths))


# --- Command line -------------------------------------------------------------------------------------

GLASS_BOX = """mtllib m.mtl
v -2 0 2\nv 2 0 2\nv 2 0 -2\nv -2 0 -2
usemtl white\nf 1 2 3 4
v -.5 .5 .5\nv .5 .5 .5\nv 0 .5 -.5\nv 0 1.2 0
usemtl glass\nf 5 6 8\nf 6 7 8\nf 7 5 8\nf 5 7 6
v -.1 2 .1\nv .1 2 .1\nv .1 2 -.1\nv -.1 2 -.1
usemtl lamp\nf 12 11 10 9
"""
MATERIALS = """newmtl white\nKd .7 .7 .7
newmtl glass\nKd 0 0 0\nillum 7\nNi 1.5\nTf 1 1 1
newmtl lamp\nKd 0 0 0\nKe 90 90 90
"""


def test_the_command_line_renders_resumes_and_merges(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("s.obj").write_text(GLASS_BOX)
    Path("m.mtl").write_text(MATERIALS)
    begin = ["render", "s.obj", "--size", "24x18", "--quiet"]
    assert cli.main([*begin, "--spp", "4", "--caustics", "-o", "out.npz", "--checkpoint", "c.wfck"]) == 0
    assert cli.main([*begin, "--spp", "4", "-o", "plain.npy"]) == 0
    picture = wf.Image.load("out.npz")
    assert picture.metadata["caustics"] is True
    assert wf.Image.load("plain.npy").rgb.tobytes() != picture.rgb.tobytes()
    assert wf.Image.load("c.wfck").rgb.tobytes() == picture.rgb.tobytes()
    Path("out.npz").unlink()
    assert cli.main(["resume", "c.wfck"]) == 0
    assert wf.Image.load("out.npz").rgb.tobytes() == picture.rgb.tobytes()
    for samples, name in (("0:1", "a.npz"), ("1:4", "b.wfck")):
        output = ["-o", name] if name == "a.npz" else ["-o", "b.npy", "--checkpoint", name]
        assert cli.main([*begin, "--caustics", "--samples", samples, *output]) == 0
    assert cli.main(["merge", "b.wfck", "a.npz", "-o", "merged.npy"]) == 0
    assert wf.Image.load("merged.npy").rgb.tobytes() == picture.rgb.tobytes()
    capsys.readouterr()
    assert cli.main([*begin, "--spp", "4", "-o", "out.npz", "--checkpoint", "c.wfck"]) == 2
    assert "caustics was True and is False" in capsys.readouterr().err
    assert cli.main([*begin, "--caustics", "--filter", "tent", "-o", "out.npz"]) == 2
    assert "caustics=True does not go with filter='tent': paths" in capsys.readouterr().err
