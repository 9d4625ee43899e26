"""Finished pictures: what a render returns, and how pictures are compared."""

from .image import Image

__all__ = ["Image"]
