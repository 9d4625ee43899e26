"""Bytes from files and to files: regular files only, whole files only, nothing outside a scene's folder."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from ..errors import SceneError

MAX_BYTES = 2**31  # larger files are refused before they are read
MAX_PIXELS = 2**27  # 16384 × 8192; larger images are refused before they are decoded


def read_bytes(path: str | os.PathLike[str], limit: int = MAX_BYTES) -> bytes:
    """Return the whole content of a regular file.

    Raises
    ------
    SceneError
        If the file is missing, unreadable, not a regular file, or larger than `limit` bytes.
    """
    name = os.fspath(path)
    try:
        info = os.stat(name)
        if stat.S_ISDIR(info.st_mode):
            raise SceneError(f"{name}: is a folder, not a file")
        if not stat.S_ISREG(info.st_mode):
            raise SceneError(f"{name}: is a device or pipe; only regular files are read")
        if info.st_size > limit:
            raise SceneError(f"{name}: has {info.st_size} bytes; the limit is {limit}")
        return Path(name).read_bytes()
    except FileNotFoundError as error:
        raise SceneError(f"{name}: there is no such file") from error
    except (OSError, ValueError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"{name}: cannot be read: {error}") from error


def decode(data: bytes) -> str:
    """Return text from UTF-8 or UTF-16 (by its byte order mark), else Latin-1; line ends become \\n."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def beside(scene: str | os.PathLike[str], reference: str) -> Path:
    """Return the path of a file that `scene` refers to by a relative name.

    A scene file from elsewhere must not make the program read any file it likes, so the name has
    to stay inside the scene's folder, also after symbolic links are followed.

    Raises
    ------
    SceneError
        If the name is a URI, absolute, or leads out of the folder.
    """
    folder = Path(os.fspath(scene)).resolve().parent
    name = reference.replace("\\", "/")
    if "://" in name or name.lower().startswith(("http:", "https:", "file:", "ftp:")):
        raise SceneError(f"{scene}: refers to {reference!r}; only files in its own folder are read")
    if name.startswith("/") or name[1:2] == ":":
        raise SceneError(f"{scene}: refers to {reference!r}; an absolute path is not followed")
    try:
        target = (folder / name).resolve()
    except (OSError, RuntimeError, ValueError) as error:
        raise SceneError(f"{scene}: refers to {reference!r}: {error}") from error
    if not target.is_relative_to(folder):
        raise SceneError(f"{scene}: refers to {reference!r}, which is outside its folder")
    return folder / name


def check_size(height: int, width: int) -> None:
    """Refuse images that are empty or have more than `MAX_PIXELS` pixels, with a SceneError."""
    if height < 1 or width < 1:
        raise SceneError(f"image has {width} × {height} pixels; it must have at least one")
    if height * width > MAX_PIXELS:
        raise SceneError(f"image has {width} × {height} pixels; the limit is {MAX_PIXELS}")


def check_folder(path: str | os.PathLike[str]) -> Path:
    """Return `path`, after making sure that a file can be written there.

    Raises
    ------
    SceneError
        If the folder is missing or not writable, or the path is itself a folder.
    """
    target = Path(os.path.realpath(path))
    folder = target.parent
    if target.is_dir():
        raise SceneError(f"{path}: is a folder, not a file name")
    if not folder.is_dir():
        raise SceneError(f"{path}: the folder {folder} does not exist")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise SceneError(f"{path}: the folder {folder} is not writable")
    return target


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a file so that, whatever happens, it holds either its old content or all of the new.

    Raises
    ------
    SceneError
        If it cannot be written; the old content is intact and nothing is left behind.
    """
    target = check_folder(path)
    scratch = target.with_name(f".{target.name[:200]}.{os.urandom(6).hex()}.tmp")
    try:
        with open(scratch, "xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(scratch, target)
    except OSError as error:
        raise SceneError(f"{path}: cannot be written: {error}") from error
    finally:
        scratch.unlink(missing_ok=True)
    _sync_folder(target.parent)


def _sync_folder(folder: Path) -> None:
    """Make the new name itself durable, where the system can."""
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
