"""Materials: a BSDF and what surrounds it."""

__all__ = []
