"""How often intervals hold the truth, how large errors of means are, and what `compare` sees.

    python benchmarks/intervals.py [--runs 200] [--seeds 80] [scene ...]

Three tables, as docs/record/benchmarks.md and docs/convergence.md have them; some minutes on an idle machine.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import wavefront as wf

UP = (0.0, 1.0, 0.0)
QUIET: dict[str, Any] = {"progress": False, "reuse": False}
BLACK, SIDE = wf.Diffuse(0), 48
Parts = tuple[list[Any], list[Any]]  # shapes and lights


# --- Scenes -------------------------------------------------------------------------------------------


def lamp(x: float, y: float, z: float, width: float, depth: float, emission: float) -> wf.Shape:
    """A panel that shines downwards."""
    return wf.Rectangle((x, y, z), (width, 0, 0), (0, 0, depth), material=BLACK, emission=emission)


def room(*balls: wf.Shape) -> Parts:
    """A floor and a wall below a panel lamp, a box, and balls."""
    shapes = [
        wf.Rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4), material=wf.Diffuse(0.6)),
        wf.Rectangle((-2, 0, -2), (4, 0, 0), (0, 2.5, 0), material=wf.Diffuse((0.7, 0.4, 0.3))),
        lamp(-0.3, 2.4, -0.3, 0.6, 0.6, 20),
        wf.Box((-1.2, 0.7, -1), (0.7, 1.4, 0.7)),
        *balls,
    ]
    return shapes, [wf.Environment(0.05)]


def matte() -> Parts:
    return room(wf.Sphere((0.8, 0.5, 0.3), 0.5, material=wf.Diffuse(0.5)))


def glossy() -> Parts:
    ball = wf.Sphere((0.8, 0.5, 0.3), 0.5, material=wf.Plastic((0.2, 0.3, 0.6), roughness=0.15))
    return room(ball, wf.Sphere((-0.7, 0.4, 0.5), 0.4, material=wf.Diffuse(0.5)))


def glass() -> Parts:
    ball = wf.Sphere((0.8, 0.5, 0.3), 0.5, material=wf.Plastic((0.2, 0.3, 0.6), roughness=0.15))
    return room(ball, wf.Sphere((-0.7, 0.4, 0.5), 0.4, material=wf.Dielectric(1.5)))


def awning() -> Parts:
    shapes = [
        wf.Rectangle((-4, 0, 4), (8, 0, 0), (0, 0, -8), material=wf.Diffuse(0.4)),
        wf.Rectangle((-4, 0, -2), (8, 0, 0), (0, 4, 0), material=wf.Diffuse(0.6)),
        wf.Rectangle((-2, 2.5, -2), (4, 0, 0), (0, 0, 2.5), material=wf.Diffuse(0.5)),
        wf.Box((0.5, 0.5, -1), (0.8, 1, 0.8)),
    ]
    return shapes, [wf.Sky.cie(12, (0.4, 0.7, 0.5), horizontal=1.0, direct_normal=3.0)]


def furnace() -> Parts:
    """The inside of a cube of which every side shines."""
    shines: dict[str, Any] = {"material": wf.Diffuse(0.5), "emission": 1.0}
    sides = [
        ((-1, -1, 1), (2, 0, 0), (0, 0, -2)),
        ((-1, 1, -1), (2, 0, 0), (0, 0, 2)),
        ((-1, -1, -1), (2, 0, 0), (0, 2, 0)),
        ((1, -1, 1), (-2, 0, 0), (0, 2, 0)),
        ((-1, -1, 1), (0, 0, -2), (0, 2, 0)),
        ((1, -1, -1), (0, 0, 2), (0, 2, 0)),
    ]
    return [wf.Rectangle(*side, **shines) for side in sides], []


def closed(*more: wf.Shape, right: Any = None) -> list[wf.Shape]:
    """A room without a window."""
    white, gray = wf.Diffuse(0.7), wf.Diffuse(0.3)
    return [
        wf.Rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4), material=gray),
        wf.Rectangle((-2, 2.5, -2), (4, 0, 0), (0, 0, 4), material=white),
        wf.Rectangle((-2, 0, -2), (4, 0, 0), (0, 2.5, 0), material=white),
        wf.Rectangle((-2, 0, 2), (0, 0, -4), (0, 2.5, 0), material=white),
        wf.Rectangle((2, 0, -2), (0, 0, 4), (0, 2.5, 0), material=right or white),
        wf.Rectangle((2, 0, 2), (-4, 0, 0), (0, 2.5, 0), material=white),
        *more,
    ]


def slats() -> Parts:
    """A panel lamp above slats."""
    at = np.linspace(-1.2, 1.2, 9)
    grid = [wf.Box((float(x), 2.25, 0), (0.02, 0.3, 1.4), material=wf.Diffuse(0.5)) for x in at]
    return closed(lamp(-1, 2.45, -0.3, 2, 0.6, 10), *grid), []


def points() -> Parts:
    """Seven small lamps, a box and a ball."""
    lights = [wf.PointLight((x, 2.3, z), 3) for x in (-1.3, 0, 1.3) for z in (-1.2, 1.2)]
    box = wf.Box((0, 0.4, 0), (1.2, 0.8, 0.6), material=wf.Diffuse(0.4))
    ball = wf.Sphere((-1, 0.5, 1), 0.3, material=wf.Diffuse(0.2))
    return closed(box, ball), [*lights, wf.PointLight((0, 0.9, 0.8), 0.5)]


def mirror() -> Parts:
    """A room with a wall that is a mirror."""
    box = wf.Box((-0.9, 0.5, 0.5), (0.6, 1, 0.6), material=wf.Diffuse(0.5))
    return closed(lamp(-0.3, 2.4, -0.3, 0.6, 0.6, 20), box, right=wf.Mirror(0.9)), []


def tree() -> Parts:
    """The shade of leaves in the sun."""
    places = np.random.default_rng(7).uniform((-1.5, 1.2, -1.5), (1.5, 2.6, 1.5), (150, 3))
    leaves = [wf.Sphere(tuple(p), 0.12, material=wf.Diffuse((0.2, 0.4, 0.1))) for p in places]
    ground = wf.Rectangle((-6, 0, 6), (12, 0, 0), (0, 0, -12), material=wf.Diffuse(0.25))
    return [ground, *leaves], [wf.Sky.cie(12, (0.2, 0.9, 0.3), horizontal=1.0, direct_normal=2.0)]


def corridor() -> Parts:
    """A lamp around a corner."""
    white = wf.Diffuse(0.7)
    sides = [
        ((-4, 2.5, -4), (8, 0, 0), (0, 0, 8)),
        ((-4, 0, -4), (8, 0, 0), (0, 2.5, 0)),
        ((-4, 0, 4), (0, 0, -8), (0, 2.5, 0)),
        ((4, 0, -4), (0, 0, 8), (0, 2.5, 0)),
        ((4, 0, 4), (-8, 0, 0), (0, 2.5, 0)),
    ]
    floor = wf.Rectangle((-4, 0, 4), (8, 0, 0), (0, 0, -8), material=wf.Diffuse(0.5))
    walls = [wf.Rectangle(*side, material=white) for side in sides]
    block = wf.Box((1, 1.25, 1), (5.9, 2.5, 5.9), material=white)
    return [floor, *walls, block, lamp(-3.8, 2.4, 3, 0.8, 0.4, 30)], []


def grid(xs: Any, zs: Any, y: float = 0.001) -> np.ndarray:
    return np.array([(x, y, z) for x in xs for z in zs], float)


def scattered(seed: int, size: float = 1.9) -> np.ndarray:
    at = np.random.default_rng(seed).uniform(-size, size, (16, 2))
    return np.stack([at[:, 0], np.full(16, 0.001), at[:, 1]], 1)


FOUR = (-1.8, -0.6, 0.6, 1.8)
BY_THE_GLASS = np.array([(-0.7, 0.001, 1.15), (-0.7, 0.001, 0.95), *grid(FOUR, FOUR)[:14]])
AROUND = [(-3.5, 3.5), (-3.5, 2), (-3, 0), (-3, -1), (-3.5, -2.5), (-3, -3), (-2.2, -2.5), (-1, -3)]
AROUND += [(0, -3.2), (0, -2.4), (1, -3), (2, -2.5), (2, -3.5), (3, -3), (3.5, -3.5), (3.8, -2.2)]
SENSORS: dict[str, tuple[Callable[[], Parts], np.ndarray]] = {
    "matte": (matte, grid(FOUR, FOUR)),
    "glass": (glass, BY_THE_GLASS),
    "awning": (awning, grid((-1.8, -0.6, 0, 1.6), (-1.9, -1.2, -0.3, 0.8))),
    "furnace": (furnace, grid((-0.9, -0.3, 0.3, 0.9), (-0.9, -0.3, 0.3, 0.9), -0.999)),
    "slats": (slats, scattered(12)),
    "points": (points, scattered(13)),
    "mirror": (mirror, scattered(14)),
    "tree": (tree, scattered(15)),
    "corridor": (corridor, np.array([(x, 0.001, z) for x, z in AROUND])),
}
PICTURES = {"matte": matte, "glossy": glossy, "awning": awning}


# --- Sensors ------------------------------------------------------------------------------------------


def part(found: wf.Measurement, start: int, stop: int) -> wf.Measurement:
    """Return the measurement of some of the points alone."""
    image, some = found.image, np.s_[:, start:stop]
    return wf.Measurement(
        wf.Image(
            image.rgb[some],
            image.spp,
            {**image.metadata, "points": stop - start},
            counts=image.counts[some],
            variance=image.variance[some],
            standard_error=image.standard_error[some],
            layers={name: layer[some] for name, layer in image.layers.items()},
        )
    )


def exact(scene: wf.Scene, at: np.ndarray, spp: int) -> np.ndarray:
    """Return the converged values (64, n), each row by itself."""
    found = wf.measure(scene, np.tile(at, (64, 1)), UP, spp=spp, seed=90000, **QUIET)
    return found.value[:, 1].astype(float).reshape(64, -1)


def sensors(name: str, runs: int) -> None:
    """Print a row for each number of samples."""
    make, at = SENSORS[name]
    scene = wf.Scene(*make())
    converged = exact(scene, at, 2048)
    truth = converged.mean(0)
    seen = truth > 1e-3 * truth.mean()  # not inside of something
    at, truth = at[seen], truth[seen]
    for spp in (16, 64, 256):
        found = wf.measure(scene, np.tile(at, (runs, 1)), UP, spp=spp, seed=21, **QUIET)
        each = [part(found, run * len(at), (run + 1) * len(at)) for run in range(runs)]
        low, high = (np.array(limit)[..., 1] for limit in zip(*(one.interval() for one in each), strict=True))
        trusted = np.array([one.reliable for one in each])
        value = found.value[:, 1].reshape(runs, -1)
        scatter, held = value.std(0, ddof=1), (low <= truth) & (truth <= high)
        before = np.abs(value - truth) <= _students(found, runs)
        width = np.median((high - low).mean(0) / 3.92 / scatter)
        print(
            f"| {name} {spp} | {before.mean():.3f}/{before.mean(0).min():.3f} "
            f"| {held.mean():.3f}/{held.mean(0).min():.3f} ({width:.1f}) | {1 - trusted.mean():.2f} "
            f"| {1 - trusted[:, 0].mean():.2f} | {_of_trusted(held, trusted)} |",
            flush=True,
        )


def _students(found: wf.Measurement, runs: int) -> np.ndarray:
    """Return half the widths (runs, n) of Student's intervals of the scatter of batches."""
    freedom = found.image.freedom().ravel()[: len(found.points), None]
    means = wf.RegionMean(found.value.astype(float), found.standard_error.astype(float), freedom, 1)
    low, high = means.interval()
    return (high - low)[:, 1].reshape(runs, -1) / 2


def _of_trusted(held: np.ndarray, trusted: np.ndarray) -> str:
    """Return coverage, and that of the worst point, where intervals are reliable."""
    if not trusted.any():
        return "—"
    often = trusted.sum(0) >= 30
    worst = (held & trusted).sum(0)[often] / trusted.sum(0)[often]
    return f"{held[trusted].mean():.3f}/{worst.min() if worst.size else np.nan:.3f}"


# --- Pictures -----------------------------------------------------------------------------------------

REGIONS = {
    "whole": np.s_[:, :],
    "floor": np.s_[34:48, 4:44],
    "wall": np.s_[8:24, 16:32],
    "block": np.s_[20:28, 20:28],
}


def rendered(
    make: Callable[[], Parts], spp: int, seeds: int, size: int = SIDE, **more: Any
) -> list[wf.Image]:
    eye = ((0, 1.6, 6.5), (0, 1.2, 0)) if make is awning else ((0, 1.3, 4.5), (0, 0.9, 0))
    scene = wf.Scene(*make(), wf.Camera.look_at(*eye, fov=42, size=(size, size)))
    settings = {**QUIET, "branches": 1, **more}
    return [wf.render(scene, spp, seed=2900 + seed, **settings) for seed in range(seeds)]


def by_batches(region: Any) -> Callable[[wf.Image], wf.RegionMean]:
    """Return what gives the mean of a region with the error that the scatter of batches alone gives."""

    def mean(image: wf.Image) -> wf.RegionMean:
        kept = {name: getattr(image, name) for name in ("counts", "variance", "standard_error", "scatter")}
        return wf.Image(image.rgb, image.spp, image.metadata, **kept).mean(region)

    return mean


def pictures(name: str, spp: int, seeds: int, **more: Any) -> None:
    """Print the errors of regions over their scatter across seeds, by batches and as they are."""
    images = rendered(PICTURES[name], spp, seeds, **more)
    row = []
    for region in REGIONS.values():
        means = [image.mean(region) for image in images]
        scatter = np.std([mean.value[1] for mean in means], ddof=1)
        now = np.sqrt(np.mean([mean.standard_error[1] ** 2 for mean in means]))
        old = np.sqrt(np.mean([mean.standard_error[1] ** 2 for mean in map(by_batches(region), images)]))
        row.append(f"{old / scatter:.2f} → {now / scatter:.2f}")
    label = "".join(f", {key}={value}" for key, value in more.items())
    print(f"| {name}{label} {spp} | {' | '.join(row)} |", flush=True)


def alarms(name: str, seeds: int, pairs: int) -> None:
    """Print how often `p_mean` of pairs is small, and of larger ones of which one is 1 % brighter."""
    images, rng = rendered(PICTURES[name], 16, seeds), np.random.default_rng(1)
    chosen = [rng.choice(seeds, 2, replace=False) for _ in range(pairs)]
    same = np.array([wf.compare(images[a], images[b]).p_mean for a, b in chosen])
    large = rendered(PICTURES[name], 16, 12, size=100)
    brighter = [wf.compare(1.01 * large[k], large[k + 1]).p_mean for k in range(0, 12, 2)]
    print(
        f"| {name} | {np.mean(same < 0.01):.4f} | {np.mean(same < 0.05):.4f} "
        f"| {sum(p < 0.01 for p in brighter)} of {len(brighter)} |",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("scenes", nargs="*", help=f"of {', '.join(SENSORS)}; by default all")
    parser.add_argument("--runs", type=int, default=200, help="of the sensors")
    parser.add_argument("--seeds", type=int, default=80, help="of the pictures; 0 for none")
    parser.add_argument("--pairs", type=int, default=700, help="of pictures of each scene that are compared")
    given, begin = parser.parse_args(), time.perf_counter()
    print("| scene, spp | Student: mean/worst | now (width) | flagged | first point flagged | others |")
    for name in given.scenes or SENSORS:
        sensors(name, given.runs)
    if given.seeds:
        print(f"\n| scene, spp | {' | '.join(REGIONS)} |")
        for name in PICTURES:
            for spp in (16, 64):
                pictures(name, spp, given.seeds)
        pictures("glossy", 16, given.seeds, reuse=True)
        pictures("glossy", 16, given.seeds, sampler="bluenoise")
        print("\n| scene | p_mean < 0.01 | p_mean < 0.05 | +1 % seen |")
        for name in PICTURES:
            alarms(name, given.seeds, given.pairs)
    print(f"{time.perf_counter() - begin:.0f} s")


if __name__ == "__main__":
    main()
