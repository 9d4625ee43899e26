"""Checkpoints: a render that was stopped goes on with the same bits, and damage is always noticed."""

from __future__ import annotations

import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
import warnings
import zipfile
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scenes
from inside import HEADER, IndependentSampler, Sensors, checkpoint, npz_chunks, read_header
from scripts import write_mesh

import wavefront as wf
from wavefront import cli

SIZE = (24, 18)
BLOBS = [(-1.2, 0.3, 0), (1.1, -0.2, 0.4), (0, 0.9, -0.5)]


def scene(**options: Any) -> wf.Scene:
    """Build a scene anew, as another process would."""
    shapes = [wf.Sphere(center, 0.7, material=wf.Diffuse((0.8, 0.4, 0.2))) for center in BLOBS]
    shapes.append(wf.Sphere((0, -50, 0), 49, material=options.get("ground", wf.Diffuse(0.5))))
    camera = wf.Camera.look_at((0, 1, options.get("distance", 5)), (0, 0, 0), size=SIZE)
    return wf.Scene(shapes, [wf.Environment((0.4, 0.6, 1.0)), wf.PointLight((2, 4, 3), 30)], camera)


POINTS = np.random.default_rng(0).uniform((-2, -1, -1), (2, 2, 2), (SIZE[0] * SIZE[1], 3))
VIEWS: dict[str, dict[str, Any]] = {"picture": {}, "sensors": {"camera": Sensors(POINTS, (0, 1, 0.5))}}


def digest(image: wf.Image) -> str:
    """SHA-256 of all that an image holds."""
    parts = [image.rgb, image.variance, image.standard_error, image.counts]
    parts += [image.layers[name] for name in sorted(image.layers)]
    return hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in parts)).hexdigest()


def stopped_after(number: int, path: Path, **settings: Any) -> wf.Image:
    """Render until so many samples are done, then as at Ctrl-C; return the picture so far."""

    def progress(done: float, total: float) -> None:
        if done >= number:
            raise KeyboardInterrupt

    with pytest.raises(wf.Interrupted) as stop:
        wf.render(scene(), checkpoint=path, progress=progress, **settings)
    assert stop.value.image is not None
    return stop.value.image


# --- The same bits ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("seed", "view"),
    [
        pytest.param(seed, view, marks=[] if seed == number else pytest.mark.slow)
        for seed in range(2)
        for number, view in enumerate(VIEWS)
    ],
)
def test_a_render_that_is_stopped_goes_on_with_the_same_bits(tmp_path: Path, seed: int, view: str) -> None:
    rng, path, spp = random.Random(seed), tmp_path / "out.wfck", 23
    aovs = ("direct", "indirect", *(("alpha", "albedo", "depth") if view == "picture" else ()))
    settings: dict[str, Any] = {"spp": spp, "aovs": aovs, **VIEWS[view]}
    whole = wf.render(scene(), **settings)
    pixels = SIZE[0] * SIZE[1]
    for _ in range(2):
        stopped_after(
            rng.randrange(1, spp * pixels // 2),
            path,
            workers=rng.choice([1, 2, 3]),
            executor="threads",
            wave_size=rng.choice([100, 333, 700]),
            **settings,
        )
    resumed = wf.render(scene(), checkpoint=path, wave_size=rng.choice([50, 1000]), **settings)
    assert digest(resumed) == digest(whole)
    assert resumed.metadata["samples"] == whole.metadata["samples"]
    assert resumed.metadata["sample_ranges"] == [[0, spp]]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="workers that are forked")
@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.first(1)
def test_worker_processes_go_on_with_the_same_bits(tmp_path: Path, view: str) -> None:
    camera: dict[str, Any] = VIEWS[view]
    stopped_after(900, tmp_path / "a", spp=12, workers=2, executor="processes", wave_size=400, **camera)
    resumed = wf.render(scene(), 12, checkpoint=tmp_path / "a", workers=3, executor="processes", **camera)
    assert digest(resumed) == digest(wf.render(scene(), 12, **camera))


@pytest.mark.parametrize(
    ("after", "view"),
    [
        pytest.param(after, view, marks=[] if first == second else pytest.mark.slow)
        for first, after in enumerate((40, 10))
        for second, view in enumerate(VIEWS)
    ],
)
@pytest.mark.filterwarnings("ignore:noise=0.07 was not reached")
@pytest.mark.first(1)
def test_adaptive_renders_go_on_with_the_same_decisions(tmp_path: Path, after: int, view: str) -> None:
    """Whether they are stopped before, within or after a pass over some of the pixels."""
    enough = {"noise": 0.03, "spp": 200} if view == "picture" else {"noise": 0.07, "spp": 64}
    settings: dict[str, Any] = {**enough, **VIEWS[view]}
    whole = wf.render(scene(), **settings)
    assert whole.counts is not None
    assert whole.counts.min() < whole.counts.max()
    pixels = SIZE[0] * SIZE[1]
    wave_size = 101 if view == "picture" else 401
    stopped_after(after * pixels - 57, tmp_path / "a", wave_size=wave_size, **settings)
    resumed = wf.render(scene(), checkpoint=tmp_path / "a", **settings)
    assert digest(resumed) == digest(whole)


@pytest.mark.parametrize(("before", "after"), [(50, 64), (32, 48)])
def test_adaptive_renders_can_be_given_more_samples(tmp_path: Path, before: int, after: int) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that the noise was not reached
        wf.render(scene(), before, noise=0.02, checkpoint=tmp_path / "a")
        resumed = wf.render(scene(), after, noise=0.02, checkpoint=tmp_path / "a")
        assert digest(resumed) == digest(wf.render(scene(), after, noise=0.02))


def test_more_samples_go_on_and_equal_a_fresh_render(tmp_path: Path) -> None:
    """64 → 128."""
    wf.render(scene(), 64, checkpoint=tmp_path / "a")
    assert digest(wf.render(scene(), 128, checkpoint=tmp_path / "a")) == digest(wf.render(scene(), 128))


def test_a_finished_render_returns_at_once(tmp_path: Path) -> None:
    path, calls = tmp_path / "a", []
    first = wf.render(scene(), 8, checkpoint=path)
    content, changed = path.read_bytes(), path.stat().st_mtime_ns
    again = wf.render(scene(), 8, checkpoint=path, progress=lambda done, total: calls.append(done))
    assert digest(again) == digest(first)
    assert set(calls) == {8 * SIZE[0] * SIZE[1]}
    assert (path.read_bytes(), path.stat().st_mtime_ns) == (content, changed)


class Clock:
    """Stands for `time.perf_counter`; it goes on with each job of a render that has it for `progress`."""

    def __init__(self, set_clock: Any, step: float) -> None:
        self.now, self.step = 1000.0, step
        set_clock(lambda: self.now)

    def __call__(self, done: float, total: float) -> None:
        self.now += self.step


def test_seconds_are_those_of_all_parts(tmp_path: Path, set_clock: Any) -> None:
    clock = Clock(set_clock, 0.02)
    settings: dict[str, Any] = {
        "checkpoint": tmp_path / "a",
        "progress": clock,
        "workers": 1,
        "wave_size": 432,
    }
    first = wf.render(scene(), seconds=0.3, **settings)
    again = wf.render(scene(), seconds=0.3, **settings)
    assert digest(again) == digest(first)
    more = wf.render(scene(), seconds=0.8, **settings)
    assert more.metadata["samples"] > first.metadata["samples"]
    assert first.metadata["seconds"] < more.metadata["seconds"] < 1


def test_sessions_save_what_renders_go_on_with(tmp_path: Path) -> None:
    path = tmp_path / "a.wfck"
    with wf.Session(scene(), 16) as session:
        for image in session:
            if image.spp == 4:
                session.save(path)
                part = wf.Image.load(path)
                assert part.rgb.tobytes() == image.rgb.tobytes()
                assert part.metadata["interrupted"]
                assert (part.spp, part.metadata["samples"]) == (4, 4 * SIZE[0] * SIZE[1])
    assert digest(wf.render(scene(), 16, checkpoint=path)) == digest(wf.render(scene(), 16))


def test_a_session_iterates_from_where_the_checkpoint_is(tmp_path: Path) -> None:
    wf.render(scene(), 6, checkpoint=tmp_path / "a")
    with wf.Session(scene(), 16, checkpoint=tmp_path / "a") as session:
        assert [image.spp for image in session] == [8, 16]
        with pytest.raises(wf.SceneError, match="a session with a checkpoint renders one view"):
            session.set_camera(None)


@pytest.mark.parametrize("how", ["break", "stop"])
def test_a_session_that_is_left_keeps_its_render(tmp_path: Path, how: str) -> None:
    with wf.Session(scene(), 16, checkpoint=tmp_path / "a") as session:
        for image in session:
            if image.spp == 2 and how == "break":
                break
            if image.spp == 2:
                session.stop()
    assert wf.Image.load(tmp_path / "a").spp >= 2
    assert digest(wf.render(scene(), 16, checkpoint=tmp_path / "a")) == digest(wf.render(scene(), 16))


def test_parts_of_the_samples_have_checkpoints_that_merge(tmp_path: Path) -> None:
    for number, samples in enumerate((range(5), range(5, 11))):
        stopped_after(700, tmp_path / str(number), samples=samples, wave_size=300)
        wf.render(scene(), samples=samples, checkpoint=tmp_path / str(number))
    merged = wf.Image.load(tmp_path / "0").merge(wf.Image.load(tmp_path / "1"))
    assert merged.rgb.tobytes() == wf.render(scene(), 11).rgb.tobytes()


def test_the_file_is_written_at_the_interval(tmp_path: Path, set_clock: Any) -> None:
    """While the render goes on; at first at the end of the first interval."""
    path, seen = tmp_path / "a", []
    clock = Clock(set_clock, 0.02)

    def progress(done: float, total: float) -> None:
        seen.append(path.exists())
        clock(done, total)

    wf.render(scene(), 30, checkpoint=path, checkpoint_interval=0.11, progress=progress, wave_size=432)
    assert seen.index(True) == 6
    assert seen == sorted(seen)


# --- What is refused ----------------------------------------------------------------------------------


class Checks(wf.BaseTexture):
    """A texture of the user's."""

    reads, scalar = ("uv",), True

    def __init__(self, count: float) -> None:
        self.count = count

    def at(self, surface: Any) -> Any:
        """Return the values."""
        return np.where(surface.uv[0] * np.float32(self.count) % 1 < 0.5, np.float32(0.2), np.float32(0.8))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"seed": 1}, "seed was 0 and is 1"),
        ({"max_bounces": 3}, "max_bounces was 12 and is 3"),
        ({"integrator": "direct_mis"}, "integrator was 'full' and is 'direct_mis'"),
        ({"sampler": "independent"}, "sampler was 'sobol' and is 'independent'"),
        ({"filter": "tent"}, "filter was 'box' and is 'tent'"),
        ({"light_sampler": "power"}, "light_sampler was 'spatial' and is 'power'"),
        ({"branches": 2}, "branches was 1 and is 2"),
        ({"noise": 0.5}, "noise was None and is 0.5"),
        ({"size": (8, 8)}, r"size was \[24, 18\] and is \[8, 8\]"),
        ({"aovs": "alpha"}, r"aovs was \[\] and is \['alpha'\]"),
        ({"camera": wf.Camera.look_at((0, 1, 6), (0, 0, 0), size=SIZE)}, "the camera differs"),
        ({"spp": 7}, "has 8 samples per pixel, more than the 7 asked for"),
        ({"spp": None, "samples": range(8, 16)}, "begins at sample 0, not at 8"),
    ],
)
def test_other_settings_are_refused(tmp_path: Path, settings: dict[str, Any], message: str) -> None:
    path = tmp_path / "a"
    wf.render(scene(), 8, checkpoint=path)
    content = path.read_bytes()
    with pytest.raises(wf.SceneError, match=message):
        wf.render(scene(), **{"spp": 8, **settings}, checkpoint=path)
    assert path.read_bytes() == content


def test_another_scene_is_refused(tmp_path: Path) -> None:
    """Whether its shapes, lights or materials differ, also in code of the user's."""
    wf.render(scene(ground=wf.Diffuse(Checks(8))), 2, checkpoint=tmp_path / "a")
    moved, brighter = scene(ground=wf.Diffuse(Checks(8))), scene(ground=wf.Diffuse(Checks(8)))
    moved.shapes[0] = wf.Sphere((-1.2, 0.3, 1e-6), 0.7, material=wf.Diffuse((0.8, 0.4, 0.2)))
    brighter.lights[1] = wf.PointLight((2, 4, 3), 30.001)
    texture = Checks(8)
    texture.at = lambda surface: surface.uv[0]  # type: ignore[method-assign]
    others = [moved, brighter, *(scene(ground=wf.Diffuse(each)) for each in (Checks(9), texture, 0.5))]
    for other in others:
        with pytest.raises(wf.SceneError, match="another render: the scene differs"):
            wf.render(other, 2, checkpoint=tmp_path / "a")
    wf.render(scene(ground=wf.Diffuse(Checks(8))), 4, checkpoint=tmp_path / "a")


@pytest.mark.parametrize("name", ["filter", "integrator", "sampler"])
def test_other_code_of_the_users_is_refused(tmp_path: Path, name: str) -> None:

    def make(factor: float) -> Any:
        def own_filter(u: Any) -> Any:
            return u * np.float32(factor)

        def own_integrator(scene: Any, paths: Any, sampler: Any, max_bounces: int) -> Any:
            return np.full((3, len(paths)), np.float32(factor))

        class OwnSampler(IndependentSampler):
            def draw_1d(self, *address: Any) -> Any:
                return super().draw_1d(*address) * np.float32(factor)

        return {"filter": own_filter, "integrator": own_integrator, "sampler": OwnSampler}[name]

    wf.render(scene(), 2, **{name: make(0.5)}, checkpoint=tmp_path / "a")
    wf.render(scene(), 3, **{name: make(0.5)}, checkpoint=tmp_path / "a")
    with pytest.raises(wf.SceneError, match=f"the code of the {name} differs"):
        wf.render(scene(), 4, **{name: make(0.25)}, checkpoint=tmp_path / "a")


def test_what_cannot_be_recognized_again_is_refused(tmp_path: Path) -> None:
    texture = Checks(8)
    texture.lock = threading.Lock()  # type: ignore[attr-defined]
    with pytest.raises(wf.SceneError, match=r"the scene\..*\.lock is a lock, which cannot be compared"):
        wf.render(scene(ground=wf.Diffuse(texture)), 2, checkpoint=tmp_path / "a")
    wf.render(scene(ground=wf.Diffuse(texture)), 2)
    assert not (tmp_path / "a").exists()


def test_paths_are_checked_before_work(tmp_path: Path) -> None:
    """Folders, and files that are no checkpoints, which are never replaced."""
    (tmp_path / "text").write_text("a letter")
    for path, message in [
        (tmp_path, "is a folder"),
        (tmp_path / "no" / "a", "does not exist"),
        (3, "checkpoint is 3; it must be a path"),
    ]:
        with pytest.raises(wf.SceneError, match=message):
            wf.render("no such file", checkpoint=path)
    with pytest.raises(wf.SceneError, match="text: is not a checkpoint of wavefront"):
        wf.render(scene(), 2, checkpoint=tmp_path / "text")
    assert (tmp_path / "text").read_text() == "a letter"


def test_another_version_is_a_warning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(checkpoint.VERSIONS, "numpy", "1.0")
    wf.render(scene(), 2, checkpoint=tmp_path / "a")
    monkeypatch.undo()
    with pytest.warns(UserWarning, match=r"a is of numpy 1\.0, now .*: bits of the picture may differ"):
        wf.render(scene(), 3, checkpoint=tmp_path / "a")


# --- Damage -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A checkpoint of all kinds of arrays."""
    path = tmp_path_factory.mktemp("whole") / "a"
    camera = wf.Camera.look_at((0, 1, 5), (0, 0, 0), size=(3, 2))
    wf.render(scene(), 4, camera=camera, noise=0.9, aovs=("alpha", "albedo", "direct"), checkpoint=path)
    return path.read_bytes()


def refused(path: Path, data: bytes) -> bool:
    """Return whether a file is refused by a SceneError with its name."""
    path.write_bytes(data)
    try:
        wf.Image.load(path)
    except wf.SceneError as error:
        return str(path) in str(error)
    return False


def check_flips(content: bytes, path: Path, places: list[int]) -> None:
    """Flip one bit of each of these bytes."""
    rng = random.Random(5)
    assert not refused(path, content)
    for place in places:
        damaged = bytearray(content)
        damaged[place] ^= 1 << rng.randrange(8)
        assert refused(path, bytes(damaged)), place


def test_flipped_bits_are_noticed(content: bytes, tmp_path: Path) -> None:
    """Of the first and last bytes, and of some in every region between."""
    ends = [*range(40), *range(len(content) - 40, len(content))]
    check_flips(content, tmp_path / "a.wfck", [*ends, *range(40, len(content) - 40, len(content) // 200)])


@pytest.mark.slow
def test_a_flipped_bit_of_any_byte_is_noticed(content, tmp_path, capsys):
    check_flips(content, tmp_path / "a.wfck", list(range(len(content))))
    with capsys.disabled():
        print(f"\n{len(content)} flipped bits noticed, one of each byte")


def test_truncation_is_noticed(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.wfck"
    lengths = [*range(0, 64), *range(64, len(content), len(content) // 200), len(content) - 1]
    for length in lengths:
        assert refused(path, content[:length]), length
    assert refused(path, content + b"\0")


def test_a_damaged_file_is_neither_used_nor_replaced(content: bytes, tmp_path: Path) -> None:
    camera = wf.Camera.look_at((0, 1, 5), (0, 0, 0), size=(3, 2))
    settings: dict[str, Any] = {"noise": 0.9, "aovs": ("alpha", "albedo", "direct")}
    for place in (-1, len(content) // 2):
        damaged = bytearray(content)
        damaged[place] ^= 1
        (tmp_path / "a").write_bytes(damaged)
        with pytest.raises(wf.SceneError, match=r"a: is damaged: delete it"):
            wf.render(scene(), 4, camera=camera, checkpoint=tmp_path / "a", **settings)
        assert (tmp_path / "a").read_bytes() == damaged


# --- Faults -------------------------------------------------------------------------------------------


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="open files of Linux")
def test_a_file_is_on_the_disk_before_it_takes_its_place(tmp_path, calls_of):
    """A temporary file is written and flushed, renamed, and then the folder is flushed."""
    steps: list[str] = []
    flush, rename = os.fsync, os.replace

    def fsync(handle: int) -> None:
        steps.append("folder" if os.path.isdir(f"/proc/self/fd/{handle}") else "file")
        flush(handle)

    def replace(source: Any, target: Any) -> None:
        assert (Path(source).parent, Path(target)) == (tmp_path, tmp_path / "a")
        steps.append("replace")
        rename(source, target)

    calls_of("os.fsync", fsync)
    calls_of("os.replace", replace)
    wf.render(scene(), 1, checkpoint=tmp_path / "a")
    assert steps == ["file", "replace", "folder"]


def npy(array: np.ndarray) -> bytes:
    """Return an array as a file."""
    whole = BytesIO()
    np.save(whole, array)
    return whole.getvalue()


def archive(files: list[tuple[str, bytes]], method: int = zipfile.ZIP_STORED) -> bytes:
    """Return a checkpoint with any files in it, and the right checksum."""
    whole = BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(whole, "w", method) as packed:
        warnings.simplefilter("ignore")  # that a name is there twice
        packed.comment = b"\0\0\0\0"
        for name, content in files:
            packed.writestr(f"{name}.npy", content)
    return with_checksum(whole.getvalue())


def with_checksum(whole: bytes) -> bytes:
    """Return a file with the right checksum at its end."""
    return whole[:-4] + zlib.crc32(whole[:-4]).to_bytes(4, "little")


def text(value: str) -> tuple[str, bytes]:
    """Return a text as the header."""
    return HEADER, npy(np.array(value))


FORM = {
    **dict.fromkeys(("wavefront", "numpy", "python"), "1"),
    "identity": {"size": [1, 1], "aovs": []},
    **{name: {} for name in ("metadata", "state")},
    "command": None,
}
GOOD = text(json.dumps(FORM))
COUNT = "sums.film.count"
NPY = b"\x93NUMPY\x01\x00"  # and 2 bytes of length
CLAIMS = [
    b"{'descr': '<i8', 'fortran_order': False, 'shape': (%d,)}" % 10**30,
    b"{'descr': '<i8', 'fortran_order': False, 'shape': (-1,-1)}",
    b"{'descr': '|O', 'fortran_order': False, 'shape': (1,)}",
    b"{'descr': '<i8', 'fortran_order': True, 'shape': (1,)}",
    b"{'descr': [('a', '<i8')], 'fortran_order': False, 'shape': (1,)}",
    b"{'descr': 7, 'fortran_order': False, 'shape': (1,)}",
    b"[]",
    b"{",
    b"('",
    b"__import__('os')",
]
CONTENTS = {
    "no sums": [GOOD],
    "no array": [GOOD, (COUNT, b"")],
    "no header": [GOOD, (COUNT, b"12345678")],
    "header without an end": [GOOD, (COUNT, NPY + b"\xff\xff{")],
    **{
        f"array {number}": [GOOD, (COUNT, NPY + len(claims).to_bytes(2, "little") + claims + b"1" * 8)]
        for number, claims in enumerate(CLAIMS)
    },
    "two of one name": [GOOD, GOOD],
    "empty": [text("{}")],
    "a list": [text("[]")],
    "a number": [text("1")],
    "no JSON": [text("[")],
    "deep": [text("[" * 100_000)],
    "a long number": [text("9" * 5000)],
}
FILES = {
    **{name: archive(files) for name, files in CONTENTS.items()},
    "compressed": archive([GOOD, (COUNT, bytes(1000))], zipfile.ZIP_DEFLATED),
    "no archive": with_checksum(b"PK\3\4" + bytes(26) + b"checkpoint.npy" + bytes(100)),
    "a later version": with_checksum(archive([GOOD]).replace(b"PK\1\2\x14\3\x14", b"PK\1\2\x14\3\xff")),
}


@pytest.mark.parametrize("whole", FILES.values(), ids=FILES)
def test_wrong_contents_with_a_right_checksum_are_refused(whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.wfck"
    path.write_bytes(whole)
    for read in (lambda: wf.Image.load(path), lambda: wf.render(scene(), 2, checkpoint=path, progress=False)):
        with pytest.raises(wf.SceneError, match=r"a\.wfck: "):
            read()
    assert cli.main(["resume", str(path)]) != 0


@pytest.mark.parametrize(
    ("key", "value"),
    [
        *((key, 5) for key in ("identity", "metadata", "state", "command", "wavefront")),
        *(("identity", {"size": size, "aovs": []}) for size in (5, [24.5, 18], [24], [10**9, 10**9])),
        *(("identity", {"size": [24, 18], "aovs": aovs}) for aovs in (5, ["no such layer"], [[]])),
        ("identity", {"size": [16384, 8192], "aovs": []}),  # for which there would be no memory
        ("metadata", {}),
        ("metadata", {"sample_ranges": 5}),
        ("metadata", {"sample_ranges": []}),
        ("state", {}),
        ("state", {"rays": 1, "bad": 0, "first_bad": 5}),
    ],
)
def test_each_wrong_part_of_a_header_is_refused(tmp_path: Path, key: str, value: Any) -> None:
    """By a render; its picture is not begun anew in silence."""
    path = tmp_path / "a.wfck"
    wf.render(scene(), 1, checkpoint=path, progress=False)
    with np.load(path) as file:
        arrays = dict(file)
    header = json.loads(str(arrays[HEADER]))
    assert key in header
    for changed in (header, header | {key: value}):
        path.write_bytes(b"".join(npz_chunks({**arrays, HEADER: np.array(json.dumps(changed))})))
        if changed is header:
            wf.render(scene(), 1, checkpoint=path, progress=False)
            continue
        with pytest.raises(wf.SceneError, match=r"a\.wfck: "):
            wf.render(scene(), 2, checkpoint=path, progress=False)
        if key == "identity":
            with pytest.raises(wf.SceneError, match=r"a\.wfck: "):
                wf.Image.load(path)


def test_a_checkpoint_is_an_archive_of_numpy(tmp_path: Path) -> None:
    """Which other programs read, too: the mean of the samples is in its sums."""
    image = wf.render(scene(), 4, checkpoint=tmp_path / "a.wfck")
    with np.load(tmp_path / "a.wfck") as file:
        assert (file["sums.film.count"] == 4).all()
        batches = file["sums.film.batches"].sum(0).T.reshape(image.shape)
        assert json.loads(str(file["checkpoint"]))["identity"]["size"] == list(SIZE)
    np.testing.assert_allclose(batches / 4, image.rgb, rtol=1e-5)
    assert zipfile.ZipFile(tmp_path / "a.wfck").testzip() is None


def test_nothing_of_a_file_is_unpickled(tmp_path: Path, fails: Any) -> None:
    path, settings = tmp_path / "a", {"workers": 1, "executor": "threads"}
    wf.render(scene(), 1, checkpoint=path, **settings)
    for name in ("load", "loads", "Unpickler"):
        fails(f"pickle.{name}", AssertionError("something was unpickled"))
    assert wf.render(scene(), 2, checkpoint=path, **settings).spp == 2
    assert wf.Image.load(path).spp == 2


def test_a_full_disk_leaves_the_old_file_and_the_picture(tmp_path, monkeypatch, full_disk):
    """An error at the end carries the picture; before, a warning is enough, for there may be space later."""
    path = tmp_path / "a"
    wf.render(scene(), 2, checkpoint=path)
    content = path.read_bytes()
    full_disk()
    settings: dict[str, Any] = {"checkpoint": path, "checkpoint_interval": 1e-3, "wave_size": 200}
    with (
        pytest.warns(UserWarning, match="the checkpoint was not written, and will be tried again") as warned,
        pytest.raises(wf.RenderError, match=r"the checkpoint was not written: .*No space") as error,
    ):
        wf.render(scene(), 8, **settings)
    assert len(warned) == 1
    assert path.read_bytes() == content
    assert os.listdir(tmp_path) == ["a"]
    assert digest(error.value.image) == digest(wf.render(scene(), 8))
    monkeypatch.undo()
    assert digest(wf.render(scene(), 8, checkpoint=path)) == digest(wf.render(scene(), 8))


MESH = ((-1, -1, 0), (1, -1, 0), (0, 1, 0), (0, 0, 2)), ((0, 1, 2), (0, 1, 3), (1, 2, 3))


@pytest.fixture
def command(tmp_path: Path, request: pytest.FixtureRequest) -> list[str]:
    """A command that renders, or measures, for about half a second, with a checkpoint."""
    write_mesh(tmp_path / "scene.ply", *MESH)
    options = ["--spp", "120", "--lighting", "studio", "--quiet", "--workers", "1"]
    interval = ["--checkpoint", "out.wfck", "--checkpoint-interval", "0.02"]
    if getattr(request, "param", "picture") == "sensors":
        grid = ["--grid=-2,-2,2.5:4,0,0:0,4,0:60x40", "--normal", "0,0,-1"]
        return ["measure", "scene.ply", "-o", "out.csv", *grid, *options, *interval]
    return ["render", "scene.ply", "-o", "out.npy", "--size", "64x48", *options, *interval]


def start(arguments: list[str], folder: Path) -> subprocess.Popen[str]:
    """Start the command line in a folder."""
    return subprocess.Popen(
        [sys.executable, "-m", "wavefront", *arguments],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
    )


def written(path: Path) -> int | None:
    """When a file was written, if there is one."""
    return path.stat().st_mtime_ns if path.exists() else None


def wait_for(path: Path, process: subprocess.Popen[str], before: int | None = None) -> None:
    """Wait until a file is written, or the process ends."""
    while written(path) == before and process.poll() is None:
        time.sleep(0.002)


def uninterrupted(command: list[str], folder: Path) -> bytes:
    """Return the file of a render without a checkpoint."""
    plain = command[: command.index("--checkpoint")]
    process = start(plain, folder)
    assert process.communicate()[1] == ""
    assert process.returncode == 0
    output = folder / command[command.index("-o") + 1]
    content = output.read_bytes()
    output.unlink()
    return content


def kill_and_resume(command: list[str], folder: Path, kills: int, seed: int) -> list[int]:
    """Kill a render at random moments; return how many samples the checkpoint then had, kill by kill.

    Most moments are while waves are traced and files are written. At the end the picture is the same as that
    of an uninterrupted render.
    """
    rng, samples, expected = random.Random(seed), [], uninterrupted(command, folder)
    path, output = folder / "out.wfck", folder / command[command.index("-o") + 1]
    while len(samples) < kills:
        before = written(path)
        process = start(command, folder)
        if rng.random() < 0.8:
            wait_for(path, process, before)
        time.sleep(rng.uniform(0, 0.2))
        process.kill()
        process.communicate()
        if process.returncode == 0:  # done: begin anew
            assert output.read_bytes() == expected
            path.unlink()
            continue
        samples.append(wf.Image.load(path).metadata["samples"] if path.exists() else 0)
    process = start(["resume", "out.wfck"] if path.exists() else command, folder)
    assert process.communicate()[1] == ""
    assert process.returncode == 0
    assert output.read_bytes() == expected
    return samples


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize(
    "command", ["picture", pytest.param("sensors", marks=pytest.mark.slow)], indirect=True
)
def test_kill_9_costs_no_bit(command: list[str], tmp_path: Path) -> None:
    assert len(kill_and_resume(command, tmp_path, 1, seed=1)) == 1


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize("command", ["picture", "sensors"], indirect=True)
def test_kill_9_at_fifty_moments_costs_no_bit(command, tmp_path, capsys):
    samples = kill_and_resume(command, tmp_path, 50, seed=2)
    with capsys.disabled():
        print(f"\n{len(samples)} kills survived, with {len(set(samples))} different numbers of samples")


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize(
    ("number", "status", "background"),
    [
        (signal.SIGINT, 130, False),
        (signal.SIGTERM, 143, True),
        (signal.Signals.__members__.get("SIGHUP"), 129, False),
    ],
)
@pytest.mark.first(1)
def test_signals_keep_the_render(command, tmp_path, number, status, background):
    """Ctrl-C, SIGTERM and SIGHUP write the checkpoint and the picture so far; the same command goes on.

    What a script starts in the background ignores Ctrl-C. These tests may run where SIGHUP is ignored.
    """
    command[command.index("120")] = "30000"
    signals = {number: signal.SIG_DFL} | ({signal.SIGINT: signal.SIG_IGN} if background else {})
    before = {each: signal.signal(each, action) for each, action in signals.items()}
    process = start(command, tmp_path)
    for each, action in before.items():
        signal.signal(each, action)
    wait_for(tmp_path / "out.wfck", process)
    process.send_signal(number)
    error = process.communicate()[1]
    assert process.returncode == status, error
    assert "interrupted: the picture so far has" in error
    assert "out.wfck holds it, and wavefront resume" in error
    so_far, kept = wf.Image.load(tmp_path / "out.npy"), wf.Image.load(tmp_path / "out.wfck")
    assert so_far.rgb.tobytes() == kept.rgb.tobytes()


def test_a_full_disk_is_not_status_0(command, tmp_path, monkeypatch, capsys, fails):
    monkeypatch.chdir(tmp_path)
    command[command.index("120")], command[-1] = "4", "3600"
    fails("wavefront.film.checkpoint.write_chunks", wf.SaveError("no space"))
    assert cli.main(command) == 2
    assert "error: the checkpoint was not written: no space" in capsys.readouterr().err
    assert (tmp_path / "out.npy").exists()


def test_resume_gives_the_command_again(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    command[command.index("120")] = "4"
    assert cli.main(command) == 0
    picture = (tmp_path / "out.npy").read_bytes()
    (tmp_path / "out.npy").unlink()
    (tmp_path / "elsewhere").mkdir()
    os.rename("out.wfck", "elsewhere/moved")
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert cli.main(["resume", "moved"]) == 0
    assert (tmp_path / "out.npy").read_bytes() == picture
    assert read_header("moved")["command"]["arguments"] == command
    assert cli.main(["resume", "moved"]) == 0  # there is nothing left to do
    assert (tmp_path / "out.npy").read_bytes() == picture
    wf.render(scene(), 1, checkpoint="of_python")
    assert cli.main(["resume", "of_python"]) == 2
    assert "was not begun by wavefront render" in capsys.readouterr().err


def test_an_interrupted_render_says_how_it_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "ball.wfck"

    def press(done: float, total: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(wf.Interrupted, match=r"ball.wfck holds it, and the same call goes on from there$"):
        wf.render(scenes.everything(), 64, checkpoint=path, progress=press)
    assert path.exists()
    with pytest.raises(wf.Interrupted, match=r"samples per pixel$"):
        wf.render(scenes.everything(), 64, progress=press)
