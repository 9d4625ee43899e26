"""Denoising of pictures: by Open Image Denoise where it is installed, else by non-local means."""

from .denoisers import DENOISERS, denoise
from .noisy import NoisyPicture, noisy_picture

__all__ = ["DENOISERS", "NoisyPicture", "denoise", "noisy_picture"]
