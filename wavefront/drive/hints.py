"""Hints for a render: in its metadata, and in a line each at its end where it took long."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from ..accel.embree import installed
from ..arrays.vec import Doubles
from ..film.film import MUCH_RARE
from ..image import Image
from ..lights import InfiniteLight
from ..lights.table import IrradianceOf
from ..scene import Scene
from ..settings import AUTO, DEFAULT_SPP, Settings
from ..shapes import Instance
from .prepared_scene import PreparedScene

LONG = 10.0  # seconds of a render, from which on hints are shown
LITTLE_FILLED = 0.15  # of a picture, by its subject
NOTICED = 2.0  # likewise, for choices that were made by themselves
# Solid angle of a lamp at a specular surface, sr; from about 0.015 on, light tracing saves a third at most
SMALL = 0.01
MUCH = 0.1  # part of the light at a specular surface
MOST_PAIRS = 1 << 17  # of specular surfaces and lights that are looked at
MANY_TRIANGLES = 1000  # from which on Embree saves time that matters

LOST_CAUSTICS = (
    "caustics of point, spot and directional lights by smooth glass and mirrors are missing: "
    "caustics=True adds them (docs/caustics.md)"
)
RARE_CAUSTICS = (
    "caustics of small lamps by smooth glass and mirrors are found rarely, as fireflies: "
    "caustics=True finds them (docs/caustics.md)"
)
RARE_PATHS = (
    "much of the noise comes from few bright samples, so errors are underestimated: more samples, "
    "larger lamps, guide=True or caustics=True help (docs/convergence.md#rare-paths)"
)
NO_EMBREE = (
    "Embree is not installed: with `pip install embreex` meshes of {:,} triangles render about {:.0f} times "
    "as fast"
)
CLEAN_NOW = 'the picture is denoised, from {} samples per pixel; quality="reference" takes 100, and does not'
LITTLE_NOW = (
    'the picture ended after {} samples per pixel, at an error of {:.1%}; quality="reference" takes 100'
)
SMALL_SUBJECT = (
    "the subject fills {:.0%} of the picture: view=..., fov=... or another size= frame it more closely"
)
NO_DENOISER = (
    "Open Image Denoise is not installed: with `pip install pyoidn` denoise=True is faster and removes more "
    "noise"
)


def caustics_hint(settings: Settings, prepared: PreparedScene) -> str | None:
    """Return the hint of caustics by paths from lights; None if they matter little, or are traced."""
    if settings.values["caustics"] or not settings.is_full or settings.values["max_bounces"] < 2:
        return None
    compiled = prepared.compiled
    lights, materials = compiled.lights, compiled.materials.groups
    if compiled.media is not None or not any(bsdf.specular for bsdf in materials):
        return None
    if (lights.delta_of & lights.chosen_from).any():
        return LOST_CAUSTICS
    specular = specular_boxes(prepared.lighted) * compiled.scale
    specular[:, :2] -= compiled.center
    kinds = [kind for kind in lights.kinds if not isinstance(kind, InfiniteLight)]
    records = (light.record(compiled.center) for light in prepared.lighted.lights)
    kinds += [
        record for record in records if isinstance(record, InfiniteLight)
    ]  # all their light, not a part
    return RARE_CAUSTICS if lit_by_small_lamps(specular, IrradianceOf(kinds, 1.0)) else None


def specular_boxes(scene: Scene) -> Doubles:
    """Return the lower and upper corner (n, 2, 3) of each shape of smooth glass or mirror, scene units."""
    boxes = [
        shape.bounds
        for shape in scene.shapes
        if (shape.mesh if isinstance(shape, Instance) else shape).material.bsdf.specular
    ]
    return np.array(boxes, np.float64).reshape(-1, 2, 3)


def lit_by_small_lamps(boxes: Doubles, lights: IrradianceOf) -> bool:
    """Return whether much of the light at the middle of some box (n, 2, 3) comes from small lamps."""
    if not lights.kinds or not len(boxes):
        return False
    emitters = lights.emitters
    boxes = boxes[: max(1, MOST_PAIRS // len(emitters))]
    middle, radius = boxes.mean(1), np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1) / 2
    away = np.linalg.norm(emitters.middle.T - middle[:, None], axis=-1)  # NaN for lights that are nowhere
    small = (emitters.extent2 > 0) & (emitters.extent2 < SMALL * np.maximum(away, radius[:, None]) ** 2)
    irradiance = lights(middle.T, 0.0)
    return bool(((irradiance * small).sum(1) > MUCH * irradiance.sum(1)).any())


def embree_gain(triangles: int) -> float:
    """Return how many times as fast Embree renders a mesh, by measurement (docs/performance.md)."""
    return float(2 * (triangles / MANY_TRIANGLES) ** 0.21)


class Hints:
    """The hints of a session, each of which is shown once.

    Parameters
    ----------
    settings, prepared
        Of the session.
    """

    def __init__(self, settings: Settings, prepared: PreparedScene) -> None:
        self._settings, self._prepared = settings, prepared
        self._told: set[str] = set()

    def tell(self, image: Image) -> None:
        """Write choices and hints to stderr, a line each, if the last picture took long."""
        seconds = image.metadata["seconds"]
        hints = [
            *(self._ending(image) if seconds >= NOTICED else ()),
            *(self._after_long_render(image) if seconds >= LONG else ()),
        ]
        lines = [hint for hint in hints if hint not in self._told]
        self._told.update(lines)
        with suppress(OSError, ValueError, AttributeError):  # without a stderr there is none to see it
            for line in lines:
                sys.stderr.write(f"hint: {line}\n")
            sys.stderr.flush()

    def _ending(self, image: Image) -> Iterator[str]:
        prepared = self._prepared
        if prepared.light_is_chosen and prepared.subject_part < LITTLE_FILLED:
            yield SMALL_SUBJECT.format(prepared.subject_part)
        if self._settings.quick:
            yield CLEAN_NOW.format(image.spp)
        elif self._settings.by_itself and image.spp < DEFAULT_SPP:
            yield LITTLE_NOW.format(image.spp, image.metadata["noise"])

    def _after_long_render(self, image: Image) -> Iterator[str]:
        if image.metadata["hint"] is not None:
            yield image.metadata["hint"]
        if (image.metadata["rare"] or 0) > MUCH_RARE:
            yield RARE_PATHS
        triangles = self._prepared.compiled.triangles
        if self._settings.values["accel"] == AUTO and triangles >= MANY_TRIANGLES and not installed():
            yield NO_EMBREE.format(triangles, embree_gain(triangles))
        if self._settings.values["denoise"] and image.metadata.get("denoiser") == "nonlocal_means":
            yield NO_DENOISER
