"""Cameras: rays through points of the film and of the lens."""

from .base import Camera, ImageSize, check_camera, field_of_view, image_size, register_framing, upward
from .fisheye import Fisheye
from .projection import Orthographic, Panorama, Perspective, Projection
from .sensors import Sensors
from .surface_sensors import SurfaceSensors

__all__ = [
    "Camera",
    "Fisheye",
    "ImageSize",
    "Orthographic",
    "Panorama",
    "Perspective",
    "Projection",
    "Sensors",
    "SurfaceSensors",
    "check_camera",
    "field_of_view",
    "image_size",
    "register_framing",
    "upward",
]
