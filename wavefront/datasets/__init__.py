"""Data sets for machine learning: many views of a scene with their annotations, as COCO and BOP have them."""

from .dataset import write_dataset

__all__ = ["write_dataset"]
