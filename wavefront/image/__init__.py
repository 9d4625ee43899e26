"""Finished pictures, as a render returns them, and their comparison."""

from .image import Image

__all__ = ["Image"]
