"""Archives of NumPy: others read them, and no damage goes unnoticed."""

from __future__ import annotations

import io
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pytest
from inside import npz_chunks, open_npz, read_array

import wavefront as wf

ARRAYS = {
    "text": np.array("a text: \u00e4\u4e16"),
    "none": np.zeros((0, 3)),
    "float": np.random.default_rng(1).random((3, 2, 4)),
    "view": np.arange(24, dtype=np.int32).reshape(4, 6)[::2, 1:].T,
    "flags": np.array([True, False]),
    "n\u00e4me.with/parts": np.arange(3, dtype=np.uint8),
}


def packed() -> bytes:
    """Return an archive of all arrays."""
    return b"".join(npz_chunks(ARRAYS))


def test_others_read_what_is_written(tmp_path: Path) -> None:
    """NumPy and zipfile, which finds all checksums right; the same arrays give the same bytes."""
    with np.load(io.BytesIO(packed())) as found:
        assert list(found) == list(ARRAYS)
        for name, array in ARRAYS.items():
            assert found[name].dtype == array.dtype
            np.testing.assert_array_equal(found[name], array)
    assert zipfile.ZipFile(io.BytesIO(packed())).testzip() is None
    assert packed() == packed()


def read_all(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays of a file."""
    with open(path, "rb") as file:
        archive = open_npz(file)
        return {name: read_array(archive, name) for name in ARRAYS}


def test_arrays_are_read_into_their_places(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(packed())
    for name, array in read_all(tmp_path / "a").items():
        np.testing.assert_array_equal(array, ARRAYS[name])
    right, wrong = np.empty((3, 2, 4)), np.empty((3, 2, 4), np.float32)
    with open(tmp_path / "a", "rb") as file:
        archive = open_npz(file)
        assert read_array(archive, "float", right) is right
        assert read_array(archive, "float", wrong) is not wrong
    assert (right == ARRAYS["float"]).all()


def test_every_flipped_bit_is_noticed(tmp_path: Path) -> None:
    """Of every byte one, and what is cut off or added."""
    whole = packed()
    flipped = [whole[:at] + bytes([byte ^ 1 << at % 8]) + whole[at + 1 :] for at, byte in enumerate(whole)]
    cut = [whole[:length] for length in range(0, len(whole), 97)]
    with open(tmp_path / "a", "w+b") as file:
        for damaged in (whole + b"\0", *flipped, *reversed(cut)):
            file.seek(0)
            file.write(damaged)
            file.truncate()
            file.seek(0)
            with pytest.raises(wf.SceneError, match="is damaged: delete it"):
                open_npz(file)


def test_what_would_take_more_memory_than_the_file_is_refused(tmp_path: Path) -> None:
    """Members that are compressed, and those that claim more bytes than there are."""
    found = [io.BytesIO(), io.BytesIO()]
    for whole, method in zip(found, (zipfile.ZIP_BZIP2, zipfile.ZIP_STORED), strict=True):
        with zipfile.ZipFile(whole, "w", method) as archive:
            archive.comment = bytes(4)
            archive.writestr("a.npy", bytes(1000))
    at = found[1].getvalue().index(b"PK\1\2") + 20
    for whole, change in zip(found, (b"", (2**31).to_bytes(4, "little")), strict=True):
        content = bytearray(whole.getvalue()[:-4])
        content[at : at + len(change)] = change
        (tmp_path / "a").write_bytes(content + zlib.crc32(content).to_bytes(4, "little"))
        with open(tmp_path / "a", "rb") as file, pytest.raises(wf.SceneError, match="is damaged"):
            open_npz(file)
