"""Options of several benchmarks."""

from __future__ import annotations

import argparse


def several(text: str) -> int:
    """Return a number of repeats of which there is a variance: a whole number, 2 or more."""
    count = int(text)
    if count < 2:
        raise argparse.ArgumentTypeError(f"{count} has no variance; it must be 2 or more")
    return count
