"""Going on with a render that a checkpoint holds: what must be the same, and when the file is written."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any

from ..accel import Geometry, InstanceAccelerator
from ..camera import Camera
from ..compile.scene import CompiledScene
from ..core.errors import SaveError, SceneError, warn_caller
from ..core.fingerprint import fingerprint
from ..film.checkpoint import Checkpoint, check_identity, other_versions, read_checkpoint
from ..film.identity import CODE, SCENE
from ..film.picture_sums import PictureSums
from ..settings import SETTINGS, Settings
from .choice import Choice

OTHERWISE = '; quality="reference" goes on with one of 100 samples that was begun by an earlier version'
WRITING_SHARE = 0.05  # of the time that writing may take, on a slow disk; the interval is then longer


def scene_fingerprint(compiled: CompiledScene, geometries: Sequence[Geometry]) -> str:
    """Return the fingerprint of a compiled scene and of what its accelerators were built from.

    Raises
    ------
    SceneError
        If a part of it, such as an attribute of a user's BSDF, cannot be compared.
    """
    parts = {each.name: getattr(compiled, each.name) for each in fields(compiled)}
    accelerator, program = parts.pop("accelerator"), parts.pop("program")
    parts["features"] = [each for each in program.features if each.compared]
    del parts["specular_surfaces"]  # they follow from the rest, and the setting is compared by itself
    if compiled.media is not None:
        parts["media"] = replace(compiled.media, touching=None)  # likewise
    del parts["roulette_after"]  # a setting, which is compared by itself
    placements = accelerator.placements if isinstance(accelerator, InstanceAccelerator) else None
    return fingerprint("the scene", {**parts, "geometries": list(geometries), "placements": placements})


def render_identity(
    settings: Settings, choice: Choice, scene: str, accelerator: str, camera: Camera, layers: Sequence[str]
) -> dict[str, Any]:
    """Return what two renders must have in common so that their samples are the same.

    Parameters
    ----------
    settings
        Those that the picture depends on are taken.
    choice
        How paths go on, whether that was asked for or decided.
    scene
        Its fingerprint.
    accelerator
        Its name; two may differ in the last bit of a distance.
    camera
        In the unit of the compiled scene.
    layers
        The sampled AOVs.
    """
    given: Any = settings.values
    codes = {
        CODE + name: fingerprint(f"the {name}", each.choices.find(given[name]))
        for name, each in SETTINGS.items()
        if each.identity and each.choices is not None
    }
    return {
        "size": list(camera.size),
        "branches": choice.branches,
        "reuse": choice.reuse,
        **settings.labels(),
        "accelerator": accelerator,
        "aovs": list(layers),
        **codes,
        "camera": fingerprint("the camera", camera),
        SCENE: scene,
    }


class CheckpointFile:
    """The checkpoint of a render: read when the render begins, and written every so often.

    Parameters
    ----------
    path
        The file.
    interval
        Seconds between two writes.
    """

    def __init__(self, path: str | os.PathLike[str], interval: float) -> None:
        self.path = path
        self._interval, self._last, self._warned = interval, time.perf_counter(), False
        self._samples = 0  # in the file, if this render has written it or gone on from it

    def resume(self, sums: PictureSums, settings: Settings) -> Checkpoint | None:
        """Put the samples of the file into the sums of none, if there is a file.

        Raises
        ------
        SceneError
            If the file is damaged, of another render, or has more samples than are asked for.
        """
        if not os.path.lexists(self.path):
            return None

        def checked(header: Any) -> PictureSums:
            otherwise = OTHERWISE if settings.by_itself else ""
            check_identity(self.path, header["identity"], sums.identity, otherwise)
            first = header["metadata"]["sample_ranges"][0][0]
            if first != settings.first_sample:
                raise SceneError(
                    f"{os.fspath(self.path)}: begins at sample {first}, not at {settings.first_sample}"
                )
            versions = other_versions(header)
            if versions:
                warn_caller(f"{os.fspath(self.path)} is of {versions}: bits of the picture may differ")
            return sums

        checkpoint = read_checkpoint(self.path, checked)
        most = int(sums.film.count.max())
        if most > settings.max_spp:
            raise SceneError(
                f"{os.fspath(self.path)}: has {most} samples per pixel, more than the "
                f"{settings.max_spp} asked for"
            )
        self._samples = int(sums.film.count.sum())
        return checkpoint

    def write_if_due(self, make: Callable[[], Checkpoint]) -> None:
        """Write the file if the last write is long ago; warn once if that is not possible."""
        begin = time.perf_counter()
        if begin - self._last < self._interval:
            return
        error = self.write(make)
        spent = time.perf_counter() - begin
        self._last = begin + max(spent, spent / WRITING_SHARE - self._interval)
        if error is not None and not self._warned:
            self._warned = True
            warn_caller(f"the checkpoint was not written, and will be tried again: {error}")

    def write(self, make: Callable[[], Checkpoint]) -> SaveError | MemoryError | None:
        """Write the file if there are new samples; return why it cannot be written, if it cannot."""
        try:
            checkpoint = make()
            samples = int(checkpoint.sums.film.count.sum())
            if samples != self._samples:
                checkpoint.write(self.path)
                self._samples = samples
        except (SaveError, MemoryError) as error:
            return error
        return None
