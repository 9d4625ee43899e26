"""`wavefront compare`."""

from __future__ import annotations

import argparse

from ..codecs.images import check_writable
from ..metrics import compare


def compare_pictures(options: argparse.Namespace) -> int:
    """Say how far a picture is from a reference; return the exit status."""
    if options.output:
        check_writable(options.output)
    result = compare(options.picture, options.reference)
    print(result)
    if options.output:
        result.difference.save(options.output)
    return 0
