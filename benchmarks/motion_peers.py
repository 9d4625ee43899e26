"""What moves while a shutter is open, beside Cycles, LuxCore and the mean of Mitsuba's stills.

python benchmarks/motion_peers.py [--python PATH] [--seeds 8] [--spp 256] [--picture motion_peers.png]

`--python` names a Python that has `bpy` and `pyluxcore`. The shutter is open from 0 to 1 s. Each scene is
drawn with several seeds; a profile is the mean of a band of rows. The table says how far the profiles are
apart, and how probable it is that noise alone makes one of 64 columns differ so much (Welch's t-test, Šidák's
correction).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import wavefront as wf

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from significance import smallest_p

SIZE, FOV = (64, 32), 40.0
KEYS = 33  # at which others are told where something is
BAND = slice(12, 20)  # rows of a profile
ROLLING = 0.7  # s, in which all rows are read
OPEN = 1 - ROLLING  # s for which each row is exposed
STRATA = 64
PEERS = {"Cycles": "motion_cycles.py", "LuxCore": "motion_luxcore.py"}
COLORS = {"Mitsuba's stills": "C0", "Cycles": "C1", "LuxCore": "C2"}
LACKS = {"LuxCore": ("deforming mesh", "rolling shutter")}


@dataclass
class Trial:
    """A scene, when its shutter is open, and what of its pictures is compared."""

    scene: wf.Scene
    channel: int = 3  # alpha; 0 is radiance
    shutter: tuple[float, float] = (0.0, 1.0)


def placed(shift: tuple[float, float, float], degrees: float = 0.0, axis: int = 2) -> np.ndarray:
    """Return a turn about an axis and then a shift, as a matrix (4, 4)."""
    turn, (i, j) = np.radians(degrees), [each for each in range(3) if each != axis]
    matrix = np.eye(4)
    matrix[i, i] = matrix[j, j] = np.cos(turn)
    matrix[i, j], matrix[j, i] = -np.sin(turn), np.sin(turn)
    matrix[:3, 3] = shift
    return matrix


def card(width: float, height: float, **look: Any) -> wf.Mesh:
    """Return a rectangle around the origin that faces +z."""
    x, y = width / 2, height / 2
    corners = [(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)]
    return wf.Mesh(corners, [(0, 1, 2), (0, 2, 3)], **look)


def trials() -> dict[str, Trial]:
    """Return the scenes by name."""
    camera = wf.Camera.look_at((0, 0, 6), (0, 0, 0), fov=FOV, size=SIZE)
    frames = [placed((0.8, 0.1, 6), 8, 1), placed((-0.9, -0.1, 5), -12, 1)]
    going = wf.Camera.from_matrix(wf.Keyframes([0, 1], frames), FOV, size=SIZE)
    turning = wf.Keyframes([0, 1], [placed((-2, 0.2, 0), -20), placed((1.5, -0.3, 0.8), 100)])
    sliding = wf.Keyframes([0, 1], [placed((-3, 0, 0)), placed((2.2, 0, 0))])
    bar = card(1, 3, material=wf.Diffuse(0), emission=1)
    bent = bar.vertices * (0.4, 1, 1) + ((2, 0, 1), (3, 0, 0), (2, 0, 0.5), (-0.5, 0, 1))
    forms = np.stack([bar.vertices - (2.5, 0, 0), bent])
    form = wf.Mesh(forms, bar.faces, times=[0, 1], material=wf.Diffuse(0), emission=1)
    lamp = card(0.8, 0.8, material=wf.Diffuse(0), emission=6).transformed(placed((0, 0, 0), 180, 0))
    lamp = lamp.transformed(wf.Keyframes([0, 1], [placed((-2, 0, 1.2)), placed((2, 0.2, 0.6), 35, 1)]))
    floor = card(30, 30, material=wf.Diffuse(0.5))
    above = wf.Camera.look_at((0, -7, 3), (0, 0, 0), up=(0, 0, 1), fov=FOV, size=SIZE)
    rolling = camera.replace(rolling_shutter=ROLLING)
    begin = ROLLING / SIZE[1]  # so that Cycles, which reads row r at (r + 1)/h, has the same times
    return {
        "moving camera": Trial(wf.Scene([bar], [], going)),
        "moving instance": Trial(wf.Scene([bar.transformed(turning)], [], camera)),
        "deforming mesh": Trial(wf.Scene([form], [], camera)),
        "moving light": Trial(wf.Scene([floor, lamp], [], above), 0),
        "rolling shutter": Trial(wf.Scene([bar.transformed(sliding)], [], rolling), 3, (begin, begin + OPEN)),
    }


# --- Each renderer's pictures (seeds, H, W, 4) ----------------------------------------------------------


def ours(trial: Trial, seeds: int, spp: int, accel: str = "auto") -> np.ndarray:
    """Return pictures of wavefront."""
    found = []
    for seed in range(seeds):
        image = wf.render(
            trial.scene,
            spp,
            seed=seed,
            shutter=trial.shutter,
            accel=accel,
            aovs="alpha",
            max_bounces=1,
            lighting=None,
            ground=False,
            branches=1,
            reuse=False,
            progress=False,
        )
        found.append(np.dstack([image.rgb, image.layers["alpha"]]))
    return np.stack(found).astype(float)


def described(trial: Trial) -> dict[str, Any]:
    """Return a scene as plain lists and numbers."""
    times, camera = np.linspace(0, 1, KEYS), trial.scene.camera
    assert camera is not None
    moments = times.tolist() if camera.moves else [0.0]
    frames = []
    for time in moments:
        then, frame = camera.at(time), np.eye(4)
        frame[:3, :3], frame[:3, 3] = then.rotation, then.origin
        frames.append(frame.tolist())
    return {
        "size": list(SIZE),
        "fov": float(np.radians(FOV)),
        "camera": frames,
        "rolling": OPEN if camera.rolling_shutter else None,
        "meshes": [_mesh(shape, times) for shape in trial.scene.shapes],
    }


def _mesh(shape: Any, times: np.ndarray) -> dict[str, Any]:
    """Return a mesh, its forms at 0 and 1 s, and its matrices."""
    mesh, matrices = shape, [np.eye(4).tolist()]
    if isinstance(shape, wf.Instance):
        mesh, matrices = shape.mesh, shape.motion.at_times(times).tolist()
    forms = [np.asarray(mesh.at(time).vertices).tolist() for time in ((0, 1) if mesh.moves else (0,))]
    shines = None if shape.emission is None else float(np.ravel(shape.emission)[0])
    return {"forms": forms, "faces": mesh.faces.tolist(), "matrices": matrices, "emission": shines}


def peer(python: str, script: str, trial: Trial, seeds: int, spp: int) -> np.ndarray:
    """Return pictures of another renderer, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        file = f"{folder}/found.npy"
        job = {**described(trial), "seeds": seeds, "spp": spp, "threads": os.cpu_count(), "file": file}
        path = str(Path(__file__).with_name(script))
        subprocess.run([python, path], input=json.dumps(job), text=True, check=True, capture_output=True)
        return np.asarray(np.load(file), float)


def mitsuba(trial: Trial, seeds: int, spp: int) -> np.ndarray:
    """Return means of stills of Mitsuba at one random time in each of some strata."""
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    found = []
    for seed in range(seeds):
        times = (np.arange(STRATA) + np.random.default_rng(seed).random(STRATA)) / STRATA
        stills = []
        for number, time in enumerate(times.tolist()):
            scene = _to_mitsuba(mi, trial.scene, time)
            picture = mi.render(scene, spp=max(spp // STRATA, 1), seed=STRATA * seed + number)
            stills.append(np.array(picture, float))
        found.append(np.mean(stills, 0))
    return np.stack(found)


def _to_mitsuba(mi: Any, scene: wf.Scene, time: float) -> Any:
    """Return the scene of a moment as Mitsuba loads it."""
    camera, frame = scene.camera.at(time), np.eye(4)
    frame[:3, :3], frame[:3, 3] = camera.rotation, camera.origin
    turned = frame @ np.diag([-1, 1, -1, 1])  # its cameras look along +z
    film = {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1], "pixel_format": "rgba"}
    description: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 2},
        "sensor": {
            "type": "perspective",
            "fov": FOV,
            "fov_axis": "y",
            "to_world": mi.ScalarTransform4f(turned),
            "film": film | {"rfilter": {"type": "box"}},
            "sampler": {"type": "independent"},
        },
    }
    for number, shape in enumerate(scene.shapes):
        then = shape.at(time)
        mesh = then.to_mesh() if isinstance(then, wf.Instance) else then
        description[f"shape{number}"] = _mitsuba_mesh(mi, mesh, number)
    return mi.load_dict(description)


def _mitsuba_mesh(mi: Any, shape: Any, number: int) -> Any:
    """Return a mesh as Mitsuba has it."""
    look = mi.Properties()
    look["bsdf"] = mi.load_dict(
        {
            "type": "diffuse",
            "reflectance": {"type": "rgb", "value": 0.0 if shape.emission is not None else 0.5},
        }
    )
    if shape.emission is not None:
        radiance = float(np.ravel(shape.emission)[0])
        look["emitter"] = mi.load_dict({"type": "area", "radiance": {"type": "rgb", "value": radiance}})
    mesh = mi.Mesh(f"mesh{number}", len(shape.vertices), len(shape.faces), props=look)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ravel(shape.vertices).astype(np.float32)
    parameters["faces"] = np.ravel(shape.faces).astype(np.uint32)
    parameters.update()
    return mesh


def _as_cycles(trial: Trial) -> Trial:
    """Return a trial whose shutter ends as in Cycles, where a table of 256 entries has the times."""
    begin, end = trial.shutter
    return replace(trial, shutter=(begin, begin + (end - begin) * 255 / 256))


# --- The comparison -------------------------------------------------------------------------------------


def profile(pictures: np.ndarray, channel: int) -> np.ndarray:
    """Return the mean of a band of rows for each seed, (seeds, W)."""
    return np.asarray(pictures[:, BAND, :, channel].mean(1))


def row(name: str, peer_name: str, one: np.ndarray, other: np.ndarray) -> str:
    """Return a row of the table."""
    mean, error = one.mean(0), np.sqrt(one.var(0, ddof=1) / len(one) + other.var(0, ddof=1) / len(other))
    off = other.mean(0) - mean
    ratio = other.mean() / mean.mean()
    ratio_error = np.hypot(*(np.std(x.mean(1), ddof=1) / len(x) ** 0.5 / x.mean() for x in (one, other)))
    p = smallest_p(one, other)
    worst = np.abs(off).max() / mean.max()
    noise = np.sqrt((error**2).mean()) / mean.max()
    return f"| {name} | {peer_name} | {ratio:.5f} ± {ratio_error:.5f} | {worst:.2%} | {noise:.2%} | {p:.2g} |"


def renderers(python: str | None) -> dict[str, Callable[..., np.ndarray]]:
    """Return what draws each trial, by name."""
    found: dict[str, Callable[..., np.ndarray]] = {}
    found["Mitsuba's stills"] = mitsuba
    for name, script in PEERS.items() if python else ():
        found[name] = lambda *rest, script=script: peer(python, script, *rest)
    return found


def draw(path: str, profiles: dict[str, dict[str, np.ndarray]]) -> None:
    """Save a figure of all profiles, and of their differences from ours."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, len(profiles), figsize=(3 * len(profiles), 4.6), sharex=True)
    for (name, found), (above, below) in zip(profiles.items(), axes.T, strict=True):
        own = found.pop("wavefront")
        above.plot(own.mean(0), label="wavefront", color="black")
        for peer_name, each in found.items():
            look = {"color": COLORS[peer_name], "markersize": 3}
            above.plot(each.mean(0), ".", label=peer_name, **look)
            scale, noise = (
                100 / own.mean(0).max(),
                np.hypot(*(np.std(x, 0) / len(x) ** 0.5 for x in (each, own))),
            )
            off = each.mean(0) - own.mean(0)
            below.errorbar(np.arange(SIZE[0]), scale * off, scale * noise, fmt=".", linewidth=0.6, **look)
        above.set_title(name, fontsize=10)
        below.set_xlabel("column")
        below.axhline(0, color="black", linewidth=0.6)
    axes[0, 0].set_ylabel("alpha (light: radiance)")
    axes[1, 0].set_ylabel("difference, % of the greatest")
    axes[0, 0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=96)


def main() -> None:
    """Print the table, and save the figure that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--python", help="a Python that has bpy and pyluxcore")
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--picture", help="file of a figure")
    parser.add_argument("--only", help="names of scenes that are drawn, with commas")
    asked = parser.parse_args()
    profiles: dict[str, dict[str, np.ndarray]] = {}
    print("| scene | beside | ratio of means | greatest difference | its standard error | p |")
    print("|---|---|---|---|---|---|")
    for name, trial in trials().items():
        if asked.only and name not in asked.only.split(","):
            continue
        found = {"wavefront": profile(ours(trial, asked.seeds, asked.spp), trial.channel)}
        for peer_name, render in renderers(asked.python).items():
            if name in LACKS.get(peer_name, ()) or (
                peer_name[:3] == "Mit" and trial.scene.camera.rolling_shutter
            ):
                continue
            found[peer_name] = profile(render(trial, asked.seeds, asked.spp), trial.channel)
            print(row(name, peer_name, found["wavefront"], found[peer_name]), flush=True)
            if peer_name == "Cycles":
                then = profile(ours(_as_cycles(trial), asked.seeds, asked.spp), trial.channel)
                print(row(name, "Cycles, until 255/256", then, found[peer_name]), flush=True)
        profiles[name] = found
    if asked.picture:
        draw(asked.picture, profiles)


if __name__ == "__main__":
    main()
