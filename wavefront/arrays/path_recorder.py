"""The base of recorders, which travel with paths and look on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .vec import Floats, Ints

if TYPE_CHECKING:
    from .state import Contribution, Paths


class PathRecorder:
    """Is told of each step of the paths that carry it (`Paths.recorder`), whatever their integrator.

    Each method does nothing by itself. Surfaces that are shaded are a `Shading`.

    Attributes
    ----------
    needs_directions
        Whether contributions of light samples must have their directions.
    """

    needs_directions = False

    def prepare(self, paths: Paths) -> None:
        """Have paths that start at the camera carry the recorder."""
        paths.recorder = self

    def branched(self, ways: int) -> None:
        """Note that each path goes on in several ways."""

    def of_shared(self, count: int) -> PathRecorder:
        """Return the recorder of paths that begin anew at `count` shared points."""
        return NOBODY

    def parts_of_shared(self) -> list[tuple[Floats, Floats]]:
        """Return parts of the light, (3, n) of the samples, and (3, count) of the shared points."""
        return []

    def record_hits(self, leg: Any) -> None:
        """Record the hits of paths at the end of a `Leg`, after the light there."""

    def record_surfaces(self, scene: Any, paths: Paths, shade: Any) -> None:
        """Record the surfaces that paths have met, which are ready to shade."""

    def record_scattering(self, paths: Paths, shade: Any, left: Paths) -> None:
        """Record how `paths` leave their surfaces, before any of them ends."""

    def clamped(self, paths: Paths, contribution: Contribution, slot: Ints, arriving: Floats) -> Floats:
        """Return light `arriving` (3, k) at slots (k,) as it is to be added."""
        return arriving

    def record_light(
        self, picture: Floats, paths: Paths, contribution: Contribution, slot: Ints, arriving: Floats
    ) -> None:
        """Record light `arriving` (3, k) that has been added to slots (k,) of the `picture` (3, n)."""

    def note(self, name: str, paths: Paths, values: Floats) -> None:
        """Record numbers (n,) or (3, n) of a user's own about paths."""

    def record_background(self, slot: Ints, color: Floats) -> None:
        """Record light (3, k) of a background that has been added to slots (k,)."""


NOBODY = PathRecorder()  # where nothing else looks on
