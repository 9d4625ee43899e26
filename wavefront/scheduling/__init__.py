"""Jobs, in which order they are done, and who does them."""

__all__ = []
