"""Zip archives: members are checked before they are unpacked, and while they are.

Only stored and deflated members are read: Python's decoders of other methods unpack a block of any size at
once.
"""

from __future__ import annotations

import zipfile
from collections.abc import Sequence

from ..core.errors import LimitError, SceneError

METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
OTHERS = {zipfile.ZIP_BZIP2: "bzip2", zipfile.ZIP_LZMA: "lzma", 93: "zstd"}
ENCRYPTED = 1  # a flag of members
PIECE = 2**18  # bytes that are unpacked at once


def checked_members(archive: zipfile.ZipFile, most: int) -> Sequence[zipfile.ZipInfo]:
    """Return the members of an archive, none of which is unpacked yet.

    Raises
    ------
    SceneError
        If there are more than `most`, two of one name, one is encrypted or compressed by another method.
    """
    members = archive.infolist()
    if len(members) > most:
        raise LimitError(f"has {len(members)} members; the limit is {most}")
    seen = set()
    for member in members:
        name = member.filename
        if name in seen:
            raise SceneError(f"has two members {name!r}")
        seen.add(name)
        if member.compress_type not in METHODS:
            method = OTHERS.get(member.compress_type, f"method {member.compress_type}")
            raise SceneError(
                f"its member {name!r} is compressed by {method}; only stored and deflate are read"
            )
        if member.flag_bits & ENCRYPTED:
            raise SceneError(f"its member {name!r} is encrypted")
    return members


def unpacked(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> bytearray:
    """Return the content of a member, unpacked in pieces, up to the size that the directory claims."""
    content = bytearray()
    with archive.open(member) as file:
        while piece := file.read(PIECE):
            content += piece
    return content
