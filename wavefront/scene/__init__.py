"""Scenes, as users put them together, and ready-made light."""

from .scene import Scene

__all__ = ["Scene"]
