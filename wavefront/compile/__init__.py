"""From a scene to the flat arrays that a render works on."""

__all__ = []
