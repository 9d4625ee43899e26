"""How much sooner, or later, settings of a render come to the same error: variance times CPU time.

python benchmarks/equal_error.py [--scenes NAME ...] [--settings "branches=4" ...] [--size 192] [--spp 16]

Scenes are those of the examples, of hard_scenes.py, random_rooms.py and many_lights.py, some of the tests,
and meshes; `--list` prints their names. Each is rendered by one thread with several seeds, plain
(`branches=1, reuse=False`) and with each of the given settings in turn; without `--settings` with the
default ones. Printed are, relative to plain: variance of a pixel over the seeds, CPU time of the whole call,
and gain, which is plain variance times CPU time over the other: 1.00 is neither sooner nor later. The gain
is given for pixels and for the picture after a blur of 1.5 and of 4 pixels, since pixels may share their
noise. Variance is relative to the squared mean around a pixel, plus a hundredth of the picture's; the
noisiest thousandth of the pixels count as the one next to them. The error of the gain of pixels is that by
the jackknife over 36 parts of the picture. CPU times are the least of all seeds, as other work on the
machine only adds to them. What training a guide, and finding out what pays, takes is part of the time. What
pays is found out with the first seed for all renders, since a mean over renders of different kinds would say
nothing; `--decide` is another seed for that.
"""

from __future__ import annotations

import argparse
import ast
import runpy
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from copy import copy
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from hard_scenes import HARD_SCENES
from many_lights import lit
from random_rooms import ROOMS
from scipy.ndimage import gaussian_filter

import wavefront as wf
from wavefront.drive import plan
from wavefront.drive.choice import Choice
from wavefront.settings import Settings

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))
import scenes
from cornell_box import cornell_box

ROOT = Path(__file__).resolve().parents[1]
PLAIN = {"branches": 1, "reuse": False}
BLURS = (0, 1.5, 4)  # pixels
PARTS = 6  # of the picture, in each direction
EXAMPLES = (
    "course_spheres",
    "cuboids",
    "default_look",
    "depth_of_field",
    "environment",
    "gltf_scene",
    "layers",
    "material_sheet",
    "molecule",
    "own_material",
    "spheres",
    "terrace",
)
Subject = tuple[Any, dict[str, Any]]  # a scene, and the settings that it is rendered with


class _CalledError(Exception):
    """An example has come to its first render."""


def example(name: str, size: int) -> Subject:
    """Return what an example renders first, and how."""
    found: list[Subject] = []

    def note(scene: Any, spp: int | None = None, **settings: Any) -> None:
        found.append((scene, settings))
        raise _CalledError

    render, argv = wf.render, sys.argv
    with tempfile.TemporaryDirectory() as folder:
        wf.render, sys.argv = note, [name, f"{folder}/out.png", "--size", str(size)]
        try:
            runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")
        except _CalledError:
            pass
        finally:
            wf.render, sys.argv = render, argv
    scene, settings = found[0]
    return scene, {key: value for key, value in settings.items() if key not in ("aovs", "denoise")}


def room_with(size: int, *shapes: Any) -> wf.Scene:
    """Return the Cornell box of the tests with other things in it."""
    box = scenes.cornell_box((size, size))
    return wf.Scene([*box.shapes[:6], *shapes], camera=box.camera)


def five_materials(size: int) -> wf.Scene:
    """Return the Cornell box with balls of five materials."""
    materials = (
        wf.Principled((0.8, 0.3, 0.2), roughness=0.3),
        wf.Conductor.named("gold", roughness=0.3),
        wf.Diffuse(0.6),
        wf.Principled((0.2, 0.4, 0.8), roughness=0.6),
        wf.Dielectric(1.5),
    )
    balls = [
        wf.Sphere((-0.7 + 0.35 * i, -0.8 + 0.25 * (i % 2), 0.3 - 0.5 * (i % 2)), 0.18, material=material)
        for i, material in enumerate(materials)
    ]
    return room_with(size, *balls)


def bumpy_ball(material: wf.Bsdf) -> wf.Mesh:
    """Return a mesh of 20 480 triangles, one in height."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=5)
    x, y, z = ball.vertices.T
    points = ball.vertices * (0.45 + 0.07 * np.sin(9 * x) * np.sin(7 * y + 1) * np.sin(8 * z))[:, None]
    return wf.Mesh(points - (0, 0.45, 0), ball.faces, material=material)


def mesh_under_sky(size: int) -> wf.Scene:
    """Return a mesh on a floor in the open."""
    floor = wf.Rectangle((-4, -1, 4), (8, 0, 0), (0, 0, -8), material=wf.Diffuse(0.5))
    camera = wf.Camera.look_at((0.6, 0.3, 2), (0, -0.5, 0), fov=40, size=(size, size))
    return wf.Scene([bumpy_ball(wf.Diffuse(0.6)), floor], wf.Environment((0.6, 0.8, 1)), camera)


def lit_by_point(size: int) -> wf.Scene:
    """Return the walls of the Cornell box and a ball, lit by a point light: direct light has no noise."""
    box = scenes.cornell_box((size, size))
    ball = wf.Sphere((0.2, -0.6, 0), 0.4, material=wf.Diffuse(0.7))
    return wf.Scene([*box.shapes[:5], ball], [wf.PointLight((0, 0.7, 0.3), 1)], box.camera)


def meshes(size: int) -> wf.Scene:
    """Return the scene of error_vs_time.py with 40 000 triangles or more."""
    from error_vs_time import mesh_scene

    return mesh_scene(None, size)


def hdri(kind: str, size: int) -> wf.Scene:
    """Return a matte ball and rough gold before an HDRI of 1024x2048 pixels."""
    from error_vs_time import hdri_scene

    return hdri_scene(size, kind, 1024)


def courtyard(size: int) -> wf.Scene:
    """Return the scene of examples/estimators.py."""
    from estimators import courtyard as build

    return build(size)


def gathered(thing: str, size: int) -> wf.Scene:
    """Return a thing of examples/caustics.py on its table, in the light of a small lamp that can be met."""
    import caustics

    lamp = wf.Sphere(caustics.LAMP, 0.15, emission=np.array((60, 54, 45)) / (np.pi * 0.15**2))
    return caustics.table([getattr(caustics, thing)(), lamp], [], (size, size))


def square(build: Callable[[tuple[int, int]], wf.Scene], size: int) -> wf.Scene:
    """Return a scene of the tests in square pictures."""
    return build((size, size))


def changed(name: str, floor: wf.Bsdf | None = None, *things: Any) -> Callable[[int], wf.Scene]:
    """Return what builds one of the hard scenes, or the Cornell box, with another floor and more things."""

    def build(size: int) -> wf.Scene:
        scene = HARD_SCENES[name](size) if name in HARD_SCENES else scenes.cornell_box((size, size))
        if floor is not None:
            scene.shapes[0].material = wf.Material(floor)
        scene.shapes = [*scene.shapes, *things]
        return scene

    return build


def sunny(size: int) -> wf.Scene:
    """Return the room with a window in a sun of 8 degrees, whose light glass and gold balls gather."""
    scene = HARD_SCENES["window"](size)
    scene.lights = [
        wf.Environment((0.5, 0.7, 1)),
        wf.DirectionalLight((1, -0.9, -0.2), (20, 18, 15), angle=8),
    ]
    glass, gold = wf.Dielectric(1.5), wf.Conductor.named("gold", roughness=0.08)
    balls = wf.Sphere((1.3, 1.1, 2.1), 0.25, material=glass), wf.Sphere((2.3, 0.3, 2.2), 0.3, material=gold)
    scene.shapes = [*scene.shapes, *balls]
    return scene


GOLD = wf.Conductor.named("gold", roughness=0.2)
WOOD = wf.Principled((0.5, 0.35, 0.2), roughness=0.35)
SHINY = wf.Mix(wf.Diffuse((0.5, 0.4, 0.3)), wf.Conductor(1, 1000, roughness=0.15), 0.1)
PLASTIC = wf.Principled((0.7, 0.5, 0.4), roughness=0.3)
BESIDE_GLOSS: dict[str, Callable[[int], wf.Scene]] = {
    "box, gold ball": lambda size: room_with(size, wf.Sphere((0.1, -0.6, 0.2), 0.4, material=GOLD)),
    "box, plastic ball": lambda size: room_with(size, wf.Sphere((0.1, -0.6, 0.2), 0.4, material=PLASTIC)),
    "box, small glass ball": lambda size: room_with(
        size, wf.Sphere((0.4, -0.85, 0.5), 0.15, material=wf.Dielectric(1.5))
    ),
    "box, shiny floor": changed("Cornell box", SHINY),
    "ceiling, shiny floor": changed("ceiling", SHINY),
    "ceiling, gold and plastic balls": changed(
        "ceiling",
        None,
        wf.Sphere((1.6, 0.4, 3.6), 0.35, material=GOLD),
        wf.Sphere((2.6, 0.25, 3.9), 0.25, material=PLASTIC),
    ),
    "ajar, wooden floor": changed("ajar", WOOD),
    "ajar, gold ball": changed("ajar", None, wf.Sphere((2.2, 0.4, 3.2), 0.4, material=GOLD)),
    "window, wooden floor": changed("window", WOOD),
    "window, gold floor": changed("window", GOLD),
    "window, glass ball": changed("window", None, wf.Sphere((2, 0.4, 3.2), 0.4, material=wf.Dielectric(1.5))),
    "window, wide sun, glass and gold": sunny,
}
SCENES: dict[str, Callable[[int], Any]] = {
    "Cornell box": cornell_box,
    "mirror and glass balls": partial(square, scenes.room),
    "everything": partial(square, scenes.everything),
    "five materials": five_materials,
    "matte mesh in the box": lambda size: room_with(size, bumpy_ball(wf.Diffuse((0.7, 0.6, 0.5)))),
    "gold mesh in the box": lambda size: room_with(size, bumpy_ball(wf.Conductor.named("gold", 0.3))),
    "box lit by a point": lit_by_point,
    **HARD_SCENES,
    "courtyard": courtyard,
    "mesh under sky": mesh_under_sky,
    "metal and glass meshes": meshes,
    **{f"HDRI, {kind}": partial(hdri, kind) for kind in ("even", "soft sun", "hard sun")},
    **{f"{n} {kind}": partial(lit, kind, n) for kind in ("points", "panels") for n in (10, 1000)},
    **{name: partial(example, name) for name in EXAMPLES},
    **BESIDE_GLOSS,
}
SMALL_LAMPS: dict[str, Callable[[int], Any]] = {  # for caustics; measured where they are named
    "lamp and glass ball": partial(gathered, "ball"),
    "lamp and tumbler": partial(gathered, "tumbler"),
    "lamp and gold ring": partial(gathered, "ring"),
}
ALL_SCENES = SCENES | ROOMS | SMALL_LAMPS


def settings_of(text: str) -> dict[str, Any]:
    """Return settings from text such as "branches=4,reuse=True"; names of values need no quotes."""
    pairs = (each.split("=") for each in text.split(",") if each)
    return {
        name: value if value.isalpha() and value.islower() else ast.literal_eval(value)
        for name, value in pairs
    }


def decide_with(seed: int) -> None:
    """Have all renders decide about what is "auto" as the one with a seed does."""
    choose = plan.choose

    def choose_alike(settings: Settings, *where: Any) -> Choice:
        alike = copy(settings)
        alike.values = {**settings.values, "seed": seed}
        return choose(alike, *where)

    plan.choose = choose_alike


def errors(pictures: list[np.ndarray], mean: np.ndarray) -> list[np.ndarray]:
    """Return the relative variance (36,) of parts of pictures (H, W, 3) after each blur."""
    found = []
    scale = gaussian_filter(mean, (4, 4, 0)) ** 2 + 0.01 * mean.mean() ** 2
    for blur in BLURS:
        smooth = [gaussian_filter(each, (blur, blur, 0)) if blur else each for each in pictures]
        variance = np.var(smooth, axis=0, ddof=1) / scale
        variance = np.minimum(variance, np.quantile(variance, 0.999))
        rows = [part for row in np.array_split(variance, PARTS) for part in np.array_split(row, PARTS, 1)]
        found.append(np.array([part.sum() for part in rows]) / variance.size)
    return found


def ratio_error(above: np.ndarray, below: np.ndarray) -> float:
    """Return the standard error of the ratio of two sums over parts, by the jackknife."""
    without = (above.sum() - above) / (below.sum() - below)
    return float(np.sqrt((above.size - 1) * np.var(without)))


def measure(name: str, options: argparse.Namespace) -> None:
    """Print a row of the table for each of the settings."""
    subject = ALL_SCENES[name](options.size)
    scene, given = subject if isinstance(subject, tuple) else (subject, {})
    sides = {"plain": PLAIN, **{text: settings_of(text) for text in options.settings}}
    pictures: dict[str, list[np.ndarray]] = {side: [] for side in sides}
    seconds: dict[str, list[float]] = {side: [] for side in sides}
    chosen = {}
    how = {"workers": 1, "executor": "threads", "accel": options.accel, "progress": False, **given}
    wf.render(scene, 1, **how)
    for seed in range(1, options.seeds + 1):
        for side, settings in sides.items():
            begin = time.process_time()
            image = wf.render(scene, options.spp, seed=seed, **how, **settings)
            seconds[side].append(time.process_time() - begin)
            pictures[side].append(image.rgb.astype(np.float64))
            chosen[side] = "shared" if image.metadata["reuse"] else str(image.metadata["branches"])
    mean = np.mean([picture for each in pictures.values() for picture in each], axis=0)
    plain = errors(pictures["plain"], mean)
    for side in options.settings:
        found = errors(pictures[side], mean)
        cpu = min(seconds[side]) / min(seconds["plain"])
        gains = [one.sum() / other.sum() / cpu for one, other in zip(plain, found, strict=True)]
        error = ratio_error(plain[0], found[0]) / cpu
        label, variance = f"`{side}`" if side else "default", found[0].sum() / plain[0].sum()
        gain = f"{gains[0]:.2f} ± {error:.2f} | {gains[1]:.2f} | {gains[2]:.2f}"
        print(f"| {name} | {label} | {variance:.2f} | {cpu:.2f} | {gain} | {chosen[side]} |", flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", nargs="*", default=list(SCENES), choices=ALL_SCENES, metavar="NAME")
    parser.add_argument("--settings", nargs="*", default=[""], help='such as "branches=4" or "guide=True"')
    parser.add_argument("--size", type=int, default=192)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--decide", type=int, default=1, help="the seed with which is decided")
    parser.add_argument("--accel", default="auto")
    parser.add_argument("--list", action="store_true", help="print the names of the scenes")
    options = parser.parse_args()
    if options.list:
        print(", ".join(ALL_SCENES))
        return
    warnings.simplefilter("ignore")
    decide_with(options.decide)
    side, spp, seeds = options.size, options.spp, options.seeds
    print(f"{side}x{side} pixels, {spp} spp, {seeds} seeds, accel={options.accel!r}\n")
    print("| scene | settings | variance | CPU time | gain, pixels | blur 1.5 | blur 4 | chosen |")
    print("|---|---|---|---|---|---|---|---|")
    for name in options.scenes:
        measure(name, options)


if __name__ == "__main__":
    main()
