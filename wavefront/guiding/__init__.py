"""Path guiding: directions are chosen by the light that was found to come from them."""

from .cells import Cells
from .table import GuideTable

__all__ = ["Cells", "GuideTable"]
