"""Reading and writing of files: regular files only, whole files only."""

from __future__ import annotations

import contextlib
import math
import os
import stat
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import IO, Any

from .errors import LimitError, SaveError, SceneError
from .plural import plural

MAX_BYTES = 2**31  # larger files are refused before they are read
MAX_PIXELS = 2**27  # 16384 × 8192; larger images are refused before they are decoded
OPEN_FILES = "/proc/self/fd"  # Linux: the open files of the process, by number


def read_bytes(path: str | os.PathLike[str], limit: int = MAX_BYTES) -> bytes:
    """Return the whole content of a regular file.

    Raises
    ------
    SceneError
        If the file is missing, unreadable, not a regular file, or larger than `limit` bytes.
    """
    name = path_name(path)
    check_regular(name, limit)
    try:
        return Path(name).read_bytes()
    except OSError as error:
        raise SceneError(f"{name}: cannot be read: {error}") from error


def check_regular(path: str | os.PathLike[str], limit: float = math.inf) -> None:
    """Check that there is a regular file of at most `limit` bytes.

    Raises
    ------
    SceneError
        If there is not.
    """
    name = path_name(path)
    try:
        info = os.stat(name)
    except FileNotFoundError as error:
        raise SceneError(f"{name}: there is no such file") from error
    except (OSError, ValueError) as error:
        raise SceneError(f"{name}: cannot be read: {error}") from error
    if stat.S_ISDIR(info.st_mode):
        raise SceneError(f"{name}: is a folder, not a file")
    if not stat.S_ISREG(info.st_mode):
        raise SceneError(f"{name}: is a device or pipe; only regular files are read")
    if info.st_size > limit:
        raise LimitError(f"{name}: has {plural(info.st_size, 'byte')}; the limit is {limit}")


def decode_text(data: bytes) -> str:
    """Return text from UTF-8 or UTF-16 (by its byte order mark), else Latin-1.

    Line ends become \\n. The end of a file of DOS, Ctrl-Z and zeros, is left out.
    """
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
    return text.rstrip("\x1a\0").replace("\r\n", "\n").replace("\r", "\n")


def check_size(height: int, width: int, most: float = MAX_PIXELS) -> None:
    """Refuse images that are empty or have more than `most` pixels, with a SceneError."""
    if height < 1 or width < 1:
        raise SceneError(f"image has {width} × {height} pixels; it must have at least one")
    if height * width > most:
        raise LimitError(f"image has {width} × {height} pixels; the limit is {most}")


def path_name(path: str | os.PathLike[str], error: type[SceneError] = SceneError) -> str:
    """Return a path as text.

    Raises
    ------
    SceneError
        Or the subclass `error`, if it is neither text nor a path made of text.
    """
    name = os.fspath(path) if isinstance(path, os.PathLike) else path
    if not isinstance(name, str):
        raise error(f"path is {path!r}; it must be text or a path such as pathlib.Path")
    return name


def extension_of(
    path: str | os.PathLike[str], known: Iterable[str], error: type[SceneError] = SceneError
) -> str:
    """Return the extension of a path, such as ".png", in lower case.

    Raises
    ------
    SceneError
        Or the subclass `error`, if there is none; the message names those that are known.
    """
    name = path_name(path, error)
    extension = Path(name).suffix.lower()
    if extension:
        return extension
    if os.path.isdir(name):
        raise error(f"{name}: is a folder, not a file")
    raise error(f"{name or repr(name)}: has no extension; it must be one of {', '.join(known)}")


def check_target(path: str | os.PathLike[str]) -> Path:
    """Return the target of `path` after checking that a file can be written there.

    Raises
    ------
    SaveError
        If the name is not usable, the folder is missing or not writable, or something other than a
        regular file is there.
    """
    name = path_name(path, SaveError)
    try:
        target = Path(os.path.realpath(name))
        if not target.parent.is_dir():
            raise SaveError(f"{name}: the folder {target.parent} does not exist")
        _mode(target)
        if not os.access(target.parent, os.W_OK | os.X_OK):
            raise SaveError(f"{name}: the folder {target.parent} is not writable")
    except SaveError:
        raise
    except (OSError, ValueError) as error:
        raise SaveError(f"{name!r}: cannot be written: {error}") from error
    return target


def _mode(target: Path) -> int | None:
    """Return the permissions of the file that is to be replaced, None if there is none."""
    try:
        mode = os.stat(target).st_mode
    except FileNotFoundError:
        return None
    if stat.S_ISDIR(mode):
        raise SaveError(f"{target}: is a folder, not a file name")
    if not stat.S_ISREG(mode):
        raise SaveError(f"{target}: is a device or pipe; only regular files are written")
    return mode & 0o777


def make_folder(path: str | os.PathLike[str]) -> None:
    """Make a folder and those above it, unless it exists.

    Raises
    ------
    SaveError
        If it cannot be made.
    """
    try:
        os.makedirs(path, exist_ok=True)
    except (OSError, ValueError) as error:
        raise SaveError(f"{os.fspath(path)}: the folder cannot be made: {error}") from error


def write_json(path: str | os.PathLike[str], value: Any) -> None:
    """Write values as a file of JSON, as `write_bytes` does."""
    import json  # imported here to keep `import wavefront` quick

    write_bytes(path, json.dumps(value, allow_nan=False).encode())


def read_json(path: str | os.PathLike[str]) -> Any:
    """Return the values of a file of JSON.

    Raises
    ------
    SceneError
        As `read_bytes`, and if the file holds something else.
    """
    import json

    try:
        return json.loads(read_bytes(path))
    except (ValueError, RecursionError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"{os.fspath(path)}: is no JSON: {error}") from error


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a file so that it always holds either its old content or all of the new content.

    Raises
    ------
    SaveError
        If it cannot be written, as for `write_chunks`.
    """
    write_chunks(path, lambda: [data])


def write_chunks(path: str | os.PathLike[str], chunks: Callable[[], Iterable[Any]]) -> None:
    """Write a file so that it always holds either its old content or all of the new content.

    A file that is replaced keeps its permissions. Symbolic links are followed.

    Parameters
    ----------
    path
        Where to write.
    chunks
        Returns the content, bytes or buffers one after the other. It is called again if the file has to be
        begun anew.

    Raises
    ------
    SaveError
        If it cannot be written. The old content is intact, and no other file remains.
    """
    target = check_target(path)
    scratch = target.with_name(f".wavefront-{os.urandom(6).hex()}.tmp")
    try:
        _write_new(scratch, chunks, _mode(target))
        os.replace(scratch, target)
    except SaveError:
        raise
    except OSError as error:
        raise SaveError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            scratch.unlink()
    _sync_folder(target.parent)


def _write_new(path: Path, chunks: Callable[[], Iterable[Any]], mode: int | None) -> None:
    """Write a new file with these permissions, or those of the umask.

    Where the system supports it, the file has no name until it is complete: no partial file remains,
    even when the process is killed.
    """
    nameless = _open_nameless(path.parent)
    if nameless is not None:
        with contextlib.suppress(OSError), open(nameless, "wb") as file:
            _fill(file, chunks, mode)
            # src_dir_fd makes Python follow the link, as it is documented to do without
            os.link(f"{OPEN_FILES}/{nameless}", path, src_dir_fd=nameless)
            return
    named = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
    with open(named, "wb") as file:
        _fill(file, chunks, mode)


def _fill(file: IO[bytes], chunks: Callable[[], Iterable[Any]], mode: int | None) -> None:
    """Set the permissions, write all chunks and flush it to the disk."""
    if mode is not None and hasattr(os, "fchmod"):
        os.fchmod(file.fileno(), mode)
    for chunk in chunks():
        file.write(chunk)
    file.flush()
    os.fsync(file.fileno())


def _open_nameless(folder: Path) -> int | None:
    """Open a new file without a name, to be linked from `OPEN_FILES`; None where that is not possible."""
    if not hasattr(os, "O_TMPFILE") or not os.path.isdir(OPEN_FILES):
        return None
    try:
        return os.open(folder, os.O_WRONLY | os.O_TMPFILE, 0o666)
    except OSError:  # not all file systems support it
        return None


def _sync_folder(folder: Path) -> None:
    """Flush the folder's entry of the new file to the disk, where the system supports it."""
    if os.name != "posix":
        return
    with contextlib.suppress(OSError):  # a folder may be writable and not readable
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
