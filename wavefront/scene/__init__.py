"""What a user puts together: the scene, and ready-made light."""

from .scene import Scene

__all__ = ["Scene"]
