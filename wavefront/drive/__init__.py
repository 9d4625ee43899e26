"""The drive of a render: the session, the picture, the work, and the choices that are made for them."""

from .program import program
from .session import Session

__all__ = ["Session", "program"]
