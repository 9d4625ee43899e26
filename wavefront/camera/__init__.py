"""Cameras: a point of the film, and of the lens, becomes a ray."""

from .base import Camera, image_size
from .projection import Orthographic, Panorama, Perspective, Projection

__all__ = ["Camera", "Orthographic", "Panorama", "Perspective", "Projection", "image_size"]
