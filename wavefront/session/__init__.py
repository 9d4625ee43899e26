"""A session: a render that can be watched, stopped and pointed at another view."""

from .session import Session

__all__ = ["Session"]
