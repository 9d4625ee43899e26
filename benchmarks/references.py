"""Converged pictures to compare with, made once and kept in a folder.

The name of a file has the hash of all that its picture was made of: the scene, the side, the number of
samples and bounces, and the versions of both programs. So a picture of something else is never used.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
from renderers import Render, renderer

import wavefront as wf

FIRST_SEED = 1000  # no picture that is compared has it
PASSES = 8  # pictures of which a converged one is the mean, at least
MOST_SAMPLES = 256  # of a pass: Mitsuba takes memory for all of them


@dataclass(frozen=True)
class Converged:
    """The mean of pictures (H, W, 3), its relative MSE, and the standard errors (3,) of its mean."""

    picture: np.ndarray
    noise: float
    error: np.ndarray

    @classmethod
    def of(cls, passes: list[np.ndarray]) -> Converged:
        """Take the noise from how the pictures differ; pixels may depend on each other."""
        mean = np.mean(passes, 0, dtype=float)
        single = float(np.mean([relative_mse(picture, mean) for picture in passes]))
        means = np.mean(passes, (1, 2), dtype=float)
        return cls(mean, single / (len(passes) - 1), means.std(0, ddof=1) / np.sqrt(len(passes)))


def relative_mse(picture: np.ndarray, exact: np.ndarray) -> float:
    """Return the error that `wf.compare` reports."""
    return wf.compare(picture.astype(np.float32), exact.astype(np.float32)).relative_mse


@dataclass(frozen=True)
class References:
    """Makes converged pictures, and keeps them in a folder where one is given."""

    folder: Path | None

    def picture(self, name: str, scene: wf.Scene, side: str, max_bounces: int, spp: int) -> Converged:
        """Return the converged picture of a side, called as `renderers` calls it."""
        passes = max(PASSES, -(-spp // MOST_SAMPLES))
        count = -(-spp // passes)
        make = partial(renderer, side, scene, max_bounces, (count,))
        if self.folder is None:
            return _made(make, passes, count)
        made_of = {
            "scene": hash_of(scene),
            "side": side,
            "max_bounces": max_bounces,
            "samples": [passes, count],
            "versions": [wf.__version__, _version(side)],
        }
        digest = hashlib.sha256(json.dumps(made_of).encode()).hexdigest()[:16]
        path = self.folder / f"{name}_{side.replace(' ', '_').replace('/', '-')}_{spp}_{digest}.npz"
        if path.exists():
            with np.load(path) as kept:
                return Converged(kept["picture"], float(kept["noise"]), kept["error"])
        found = _made(make, passes, count)
        self.folder.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(path, **asdict(found), made_of=json.dumps(made_of))
        print(f"wrote {path}", flush=True)
        return found

    def mean_with_mitsuba(
        self, name: str, scene: wf.Scene, max_bounces: int, spp: int, *, method: str, variant: str
    ) -> np.ndarray:
        """Return the mean of a picture of wavefront and one of Mitsuba, after printing how they compare."""
        both = [
            self.picture(name, scene, side, max_bounces, spp)
            for side in (f"wavefront auto {method}", f"{variant} independent")
        ]
        weights = [1 / each.noise for each in both]
        ratio, chance = ratio_of_means(*both)
        print(
            f"converged at {spp} spp: mean of wavefront / mean of mitsuba = "
            f"{ratio.round(4)} ± {chance.round(4)}"
        )
        if (np.abs(ratio - 1) > 4 * chance + 0.001).any():
            print("the means differ by more than chance and 0.1 %: the figures below are not comparable")
        print(f"relative MSE of the reference itself: {1 / sum(weights):.2g}", flush=True)
        return np.average([each.picture for each in both], axis=0, weights=weights)


def hash_of(scene: wf.Scene) -> str:
    """Return a hash of what a scene shows, which stays while the package keeps it in other ways.

    Shapes are meshes and spheres of one material each.
    """
    camera = scene.camera or scene.framing_camera()
    found = hashlib.sha256(repr([scene.lights, camera.fov, camera.size]).encode())
    arrays = [camera.origin, camera.rotation]
    for shape in scene.shapes:
        found.update(repr([type(shape), shape.material.bsdf]).encode())
        ball = isinstance(shape, wf.Sphere)
        arrays += [shape.center, shape.radius] if ball else [shape.vertices, shape.faces, shape.normals]
        arrays.append(shape.emission)
    for array in arrays:
        found.update(b"none" if array is None else np.asarray(array, float).tobytes())
    return found.hexdigest()


def ratio_of_means(a: Converged, b: Converged) -> tuple[np.ndarray, np.ndarray]:
    """Return the ratio of the means of two pictures, by channel, and its standard error."""
    means = [each.picture.mean((0, 1)) for each in (a, b)]
    relative = [each.error / mean for each, mean in zip((a, b), means, strict=True)]
    return means[0] / means[1], np.hypot(*relative)


def _made(make: Callable[[], Render], passes: int, count: int) -> Converged:
    render = make()
    return Converged.of([render(count, FIRST_SEED + i) for i in range(passes)])


def _version(side: str) -> str:
    """Return the version of the other program of a side."""
    if not side.startswith(("llvm", "scalar")):
        return ""
    import mitsuba

    return mitsuba.__version__
