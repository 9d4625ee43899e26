"""Denoising of pictures: by Open Image Denoise where it is installed, else by non-local means."""

from .denoisers import DENOISERS, denoise, is_quick
from .noisy import NoisyPicture, noisy_picture
from .open_image_denoise import FEW

__all__ = ["DENOISERS", "FEW", "NoisyPicture", "denoise", "is_quick", "noisy_picture"]
