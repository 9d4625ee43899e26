"""Jobs: how a render is split into them, in which order they are done, and by which workers."""

__all__ = []
