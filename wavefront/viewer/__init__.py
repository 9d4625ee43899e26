"""A viewer: a page in the browser with a picture that refines while one looks and moves."""

from .viewer import Viewer, view

__all__ = ["Viewer", "view"]
