"""Motion: what has one place or form at each time."""

from .deformation import Deformation, Samples
from .keyframes import Keyframes
from .motion import Motion
from .moving import Moving
from .product import Inverse, Product, Still, product
from .together import Together

__all__ = [
    "Deformation",
    "Inverse",
    "Keyframes",
    "Motion",
    "Moving",
    "Product",
    "Samples",
    "Still",
    "Together",
    "product",
]
