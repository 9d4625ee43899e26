"""Media: what fills the space inside shapes."""

from .medium import Medium

__all__ = ["Medium"]
