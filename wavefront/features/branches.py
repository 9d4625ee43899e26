"""Branches: each path goes on in several ways from its first surface."""

from __future__ import annotations

from ..compile.program import Feature


class Branches(Feature):
    """Splits each path at its first surface. A view has it, not a scene."""

    def __init__(self, ways: int) -> None:
        self.ways = ways
