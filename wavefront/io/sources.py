"""The files that a scene file may read: where they may be, and how large."""

from __future__ import annotations

import gzip
import os
import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, fields
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from ..codecs.archive import PIECE
from ..codecs.budget import MEMORY_BYTES, Budget
from ..codecs.images import decode_codes, read_codes
from ..core.errors import LimitError, SceneError, passed_limit
from ..core.files import MAX_BYTES, MAX_PIXELS, check_regular, path_name, read_bytes
from ..core.references import GZIPPED, Listed, elsewhere, followed
from ..textures.image import StoredImage, checked
from .losses import Losses

PathLike = str | os.PathLike[str]
MISSING = "missing"
GRAY = StoredImage(np.full((1, 1, 3), 0.5, np.float32), "gray")  # in place of an image that is missing

MOST_DEFLATED = 1032  # bytes that a byte of deflate stands for at most
MAX_TRIANGLES = 2**26  # of all meshes of a file by default


@dataclass(frozen=True)
class LoadLimits:
    """Limits of the demands of a scene file. A file of a few bytes can claim any size.

    Each limit is a whole number of at least 1. Larger limits accept larger files; smaller ones protect
    better.

    Parameters
    ----------
    file_bytes
        Size of the file, and of each file that it refers to.
    pixels
        Pixels of one image. All images of a glTF file together may have four times as many.
    triangles
        Triangles of all meshes of a file, before they are placed.
    meshes
        Meshes of a file, one for each of its materials or primitives, before they are placed.
    instances
        Meshes that the nodes of a glTF file, or the instances of a Mitsuba or pbrt scene, place.
    includes
        Files that a Mitsuba or pbrt scene includes, each counted as often as it is included.
    unpacked_bytes
        Size of the unpacked members of a 3mf file, and of each packed file of a pbrt scene (.ply.gz).
    memory_bytes
        Memory for all arrays and images, in bytes; 128 bytes for each byte of the files are added. It is
        compared with what headers claim, before any is allocated.
    seconds
        How long a file of USD may take to read, by a process that is ended then.

    Raises
    ------
    SceneError
        If one is not a whole number of at least 1.

    Examples
    --------
    >>> small = wf.LoadLimits(file_bytes=100)
    >>> with open("big.off", "w") as file:
    ...     _ = file.write("OFF\\n" + "0 0 0\\n" * 100)
    >>> wf.load("big.off", limits=small)
    Traceback (most recent call last):
        ...
    wavefront.core.errors.LimitError: ...
    """

    file_bytes: int = MAX_BYTES
    pixels: int = MAX_PIXELS
    triangles: int = MAX_TRIANGLES
    meshes: int = 2**17
    instances: int = 2**20
    includes: int = 1024
    unpacked_bytes: int = 2**30
    memory_bytes: int = MEMORY_BYTES
    seconds: int = 600

    def __post_init__(self) -> None:
        for limit in fields(self):
            value = getattr(self, limit.name)
            if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < 1:
                raise SceneError(
                    f"LoadLimits {limit.name} is {value!r}; it must be a whole number of at least 1"
                )

    def check_meshes(self, name: str, count: int) -> None:
        """Refuse a file of more meshes with a SceneError."""
        if count > self.meshes:
            raise LimitError(f"{name}: has {count} meshes; the limit is {self.meshes} (LoadLimits.meshes)")

    def check_triangles(self, name: str, count: int) -> None:
        """Refuse a file of more triangles with a SceneError."""
        if count > self.triangles:
            raise LimitError(
                f"{name}: has {count} triangles; the limit is {self.triangles} (LoadLimits.triangles)"
            )


def checked_limits(limits: LoadLimits | None) -> LoadLimits:
    """Return the limits, by default those of `LoadLimits`, or raise a SceneError if they are none."""
    if limits is not None and not isinstance(limits, LoadLimits):
        raise SceneError(f"limits is {limits!r}; it must be a wf.LoadLimits")
    return limits or LoadLimits()


@dataclass(frozen=True)
class SceneFiles:
    """The files that a scene file may read: those in its own folder and in the search paths, and below them.

    A scene file from elsewhere must not make the program read arbitrary files. So the target of each
    reference must be inside one of these folders, also after symbolic links are followed.
    """

    scene: PathLike
    search_paths: tuple[Path, ...] = ()
    limits: LoadLimits = field(default_factory=LoadLimits)
    losses: Losses = None  # type: ignore[assignment]  # of the load; by default of these files alone
    budget: Budget = field(init=False)  # of all these files together
    _images: dict[Path, NDArray[Any]] = field(init=False, default_factory=dict)
    _listed: Listed = field(init=False, default_factory=dict)  # of folders where files were looked for

    def __post_init__(self) -> None:
        object.__setattr__(self, "budget", Budget(self.limits.pixels, self.limits.memory_bytes))
        if self.losses is None:
            object.__setattr__(self, "losses", Losses(self.name))

    @property
    def name(self) -> str:
        """The path of the scene file, for messages."""
        return os.fspath(self.scene)

    def find(
        self, reference: str, base: PathLike | None = None, folders: Sequence[Path] | None = None
    ) -> Path:
        """Return the path of a file that the scene refers to.

        It is looked for in the folder of `base`, by default the scene file, and then in the search paths; the
        path is that of the first place where it exists. If there is none, the last parts of the name are
        looked for in these folders, as names may be those of the author's disk; this is noted. Else it is the
        first allowed path.

        Parameters
        ----------
        reference
            The name in the file.
        base
            The file that has it.
        folders
            In place of the folder of `base`.

        Raises
        ------
        SceneError
            If there is none and the name is a URI, absolute, or leads out of all folders; or if the file is
            too large or not a regular one.
        """
        refused: SceneError | None = None
        try:
            named = self.named(reference, base, folders)
            if os.path.exists(named):
                return named
        except SceneError as error:
            if passed_limit(error):
                raise
            refused = error
        source, places, roots = self._places(base, folders)
        path = elsewhere(source, reference, places, roots, self._listed)
        if path is not None:
            self._note_found(reference, source, path)
            check_regular(path, self.limits.file_bytes)
            return path
        if refused is not None:
            raise refused
        return named

    def named(
        self, reference: str, base: PathLike | None = None, folders: Sequence[Path] | None = None
    ) -> Path:
        """Return the path of a file by its exact name, by which a library opens it.

        It is that of the first place where the file exists, or else the first allowed one.

        Raises
        ------
        SceneError
            If the name is a URI, absolute, or leads out of all folders, or the file is too large or not a
            regular one.
        """
        allowed = followed(self.scene if base is None else base, reference, *self._places(base, folders)[1:])
        existing = next((path for path in allowed if os.path.exists(path)), None)
        if existing is not None:
            check_regular(existing, self.limits.file_bytes)
        return existing or allowed[0]

    def existing(self, reference: str, folders: Sequence[Path] | None = None) -> Path:
        """Return the path of a file that the scene refers to and that must be there; as `find` otherwise."""
        path = self.find(reference, folders=folders)
        if not os.path.exists(path):  # also False for invalid names
            raise SceneError(f"file {reference!r} is missing")
        return path

    def _places(
        self, base: PathLike | None, folders: Sequence[Path] | None
    ) -> tuple[PathLike, list[Path], list[Path]]:
        """Return the file that refers to another one, where that is looked for, and where it must be."""
        source = self.scene if base is None else base
        roots = [_folder(self.scene), *(folder.resolve() for folder in self.search_paths)]
        first = [_folder(source)] if folders is None else [folder.resolve() for folder in folders]
        return source, [*first, *roots[1:]], roots

    def _note_found(self, reference: str, source: PathLike, found: Path) -> None:
        """Note that a file was found under another name, unless the name is only written as in a URI."""
        name = unquote(reference.replace("\\", "/")).removeprefix("./")
        if not os.fspath(found).endswith(f"/{name}"):
            place = "" if source == self.scene else os.fspath(source)
            self.losses.note(f"the file {reference!r}", place, "missing", f"{found.name!r} in its place")

    def picture(
        self,
        reference: str,
        base: PathLike | None = None,
        place: str = "",
        instead: StoredImage | None = None,
    ) -> StoredImage | None:
        """Return an image that the scene refers to; arguments as of `find` and `shown`."""
        return self.shown(reference, lambda: self.stored(self.find(reference, base)), place, instead)

    def shown(
        self,
        reference: str,
        read: Callable[[], StoredImage],
        place: str = "",
        instead: StoredImage | None = None,
    ) -> StoredImage | None:
        """Return an image, or `instead` if it is missing or damaged, which is noted.

        Parameters
        ----------
        reference
            Its name in the scene.
        read
            Returns it, or raises a SceneError.
        place
            Where the scene refers to it, for the note of the loss.
        instead
            Returned in its place; None for nothing.

        Raises
        ------
        SceneError
            If a limit is passed.
        """
        try:
            return checked(read())
        except SceneError as error:
            if passed_limit(error):
                raise
            what, why = f"texture {reference!r}", self.brief(error)
            part, value = (what, why) if why == MISSING else (f"{what}: {why}", "")
            done = "left out" if instead is None else "gray in its place"
            self.losses.note(part, place, value, done)
        return instead

    def brief(self, error: SceneError) -> str:
        """Return the message of an error, without the folder of the scene."""
        folder = os.path.join(os.path.dirname(self.name), "")
        return str(error).replace(folder, "") if folder else str(error)

    def stored(self, path: Path) -> StoredImage:
        """Return the image in a file."""
        if not os.path.exists(path):  # also False for invalid names
            raise SceneError(MISSING)
        return StoredImage(self.image(path), path.name)

    def decoded(self, name: str, data: bytes) -> StoredImage:
        """Return the image in a part of a file."""
        return StoredImage(decode_codes(data, name, self.budget), name)

    def seen_from(self, path: PathLike) -> SceneFiles:
        """Return the files that a file of the scene may read; budget and losses are those of the scene."""
        files = SceneFiles(path, self.search_paths, self.limits, self.losses)
        object.__setattr__(files, "budget", self.budget)
        object.__setattr__(files, "_listed", self._listed)
        return files

    def read(self, path: PathLike) -> bytes:
        """Return the content of a regular file of at most `limits.file_bytes`, unpacked if it is one of pbrt.

        Raises
        ------
        SceneError
            If it cannot be read, or a packed file is damaged or larger than `limits.unpacked_bytes`.
        """
        data = read_bytes(path, self.limits.file_bytes)
        self.budget.add_file(len(data), path)
        return self._unpacked(path, data) if os.fspath(path).lower().endswith(GZIPPED) else data

    def _unpacked(self, path: PathLike, data: bytes) -> bytes:
        """Return the content of a gzip file, unpacked in pieces that are charged to the budget."""
        name, content = os.fspath(path), BytesIO()
        size, most = _claimed(data), self.limits.unpacked_bytes
        try:
            with gzip.GzipFile(fileobj=BytesIO(data)) as packed:
                while size <= most and (piece := packed.read(PIECE)):
                    size = max(size, content.tell() + len(piece))
                    self.budget.charge(f"{name}: what it holds", 2 * len(piece))  # also what becomes of it
                    content.write(piece)
        except EOFError as error:
            raise SceneError(f"{name}: ends before its gzip stream does") from error
        except (OSError, zlib.error) as error:
            raise SceneError(f"{name}: is no gzip file: {error}") from error
        if size > most:
            raise LimitError(f"{name}: has more than {most} bytes unpacked (LoadLimits.unpacked_bytes)")
        return content.getvalue()

    def image(self, path: Path) -> NDArray[Any]:
        """Return the pixels of an image as stored, (H, W, C); each file is read once."""
        if path not in self._images:
            check_regular(path, self.limits.file_bytes)
            self._images[path] = read_codes(path, self.budget)
        return self._images[path]


def _claimed(data: bytes) -> int:
    """Return the unpacked size that a gzip file claims in its last bytes, 0 if it cannot have it."""
    claimed = int.from_bytes(data[-4:], "little")
    return claimed if claimed <= MOST_DEFLATED * len(data) else 0


def _folder(path: PathLike) -> Path:
    return Path(os.fspath(path)).resolve().parent


def folders(search_paths: PathLike | Iterable[PathLike]) -> tuple[Path, ...]:
    """Return search paths as a tuple, after checking that each is a folder.

    Raises
    ------
    SceneError
        If one is not.
    """
    if isinstance(search_paths, str | os.PathLike):
        search_paths = (search_paths,)
    paths = tuple(Path(path_name(path)) for path in search_paths)
    for path in paths:
        if not path.is_dir():
            raise SceneError(f"search_paths: {path} is not a folder")
    return paths
