"""Path guiding: directions are chosen by the light that was found to come from them."""

from .cells import GuideCells
from .guide_table import GuideTable

__all__ = ["GuideCells", "GuideTable"]
