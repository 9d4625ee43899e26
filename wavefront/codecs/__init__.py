"""Pixels in and out: one file for each format, and the encodings between linear and display values."""

__all__ = []
