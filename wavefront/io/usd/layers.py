"""The layers of a stage: each is checked before it is opened, and so is how many prims they stand for."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ...codecs.budget import PER_BYTE
from ...core.errors import LimitError, SceneError
from ..sources import SceneFiles
from .child import allow_memory

MOST_PRIMS = 2**20
PRIMS = 2**16  # that files of any size may stand for; each of their bytes adds one
MOST_SAID = 300  # letters of a message of usd-core
WHERE = re.compile(r"^Error in '.*?' at line \d+ in file \S+ : ")  # in the source of usd-core
STAGE = re.compile(r",? (?:on stage with rootLayer|sessionLayer) @[^@]*@")  # which is no place in the file
EXTENSIONS = (".usd", ".usda", ".usdc", ".usdz")
VARIABLE = re.compile(r"\$\{\w+\}")


class Layers:
    """All layers that the stage of a file may open, which are open from now on.

    References to files that may not be read, or are missing, are taken out of the layer in memory.

    Parameters
    ----------
    files
        The files that the stage may read.
    """

    def __init__(self, files: SceneFiles) -> None:
        self._files = files
        self.root = os.path.abspath(files.name)
        self.open: dict[str, Any] = {}  # by their identifiers
        self._counted = {Path(self.root): os.path.getsize(self.root)}
        self._waiting = [self.root]
        self._variables: dict[str, Any] = {}
        while self._waiting:
            name = self._waiting.pop()
            if name not in self.open:
                self.open[name] = layer = self._opened(name)
                if layer is not None:
                    self._check(layer)

    def _opened(self, name: str) -> Any:
        """Return a layer, None if it is damaged and not the first one."""
        from pxr import Sdf

        known = Sdf.Layer.Find(name)
        if known:
            known.Reload(force=True)  # the file may have changed since
        layer = None
        try:
            layer = Sdf.Layer.FindOrOpen(name)
        except RuntimeError:
            if name == self.root:
                raise  # of others the stage says why
        if layer is None and name == self.root:
            raise SceneError(f"{self._files.name}: is no file of USD that can be read")
        return layer

    def _check(self, layer: Any) -> None:
        """Take references to files that may not be read out of a layer, and have all others opened."""
        from pxr import UsdUtils

        self._variables = {**layer.expressionVariables, **self._variables}
        composed = set(layer.GetCompositionAssetDependencies())
        layer.SetPermissionToEdit(True)
        wrong: list[SceneError] = []

        def checked(path: str) -> str:
            name = self._evaluated(path)
            if not (path in composed or name != path or "[" in name or name.lower().endswith(EXTENSIONS)):
                return path  # an image, which is opened by way of `SceneFiles.find`
            try:
                return self._packed(layer, name) or self._beside(layer, name)
            except SceneError as error:
                wrong.append(error)
                return ""

        UsdUtils.ModifyAssetPaths(layer, checked)
        for error in wrong:  # they would not come through usd-core
            with self._files.losses.part():
                raise type(error)(str(error).removeprefix(f"{self.root}: ")) from error

    def _evaluated(self, path: str) -> str:
        """Return the path that an expression with variables stands for."""
        from pxr import Sdf

        if not VARIABLE.search(path):
            return path
        result = Sdf.VariableExpression(f'`"{path}"`').Evaluate(self._variables)
        return path if result.errors else str(result.value)

    def _packed(self, layer: Any, path: str) -> str:
        """Return the path of a file in the archive of the layer that refers to it, "" if it is elsewhere."""
        from pxr import Ar, Sdf

        anchored = Sdf.ComputeAssetPathRelativeToLayer(layer, path)
        archive, inner = Ar.SplitPackageRelativePathOuter(anchored)
        if not inner or os.path.realpath(archive) != os.path.realpath(_file_of(layer)):
            return ""
        self._await(anchored)
        return path

    def _beside(self, layer: Any, path: str) -> str:
        """Return the path of a file that may be read, or raise a SceneError."""
        from pxr import Ar, Sdf

        layer_file = _file_of(layer)
        name, arguments = Sdf.Layer.SplitIdentifier(path)
        outer, inner = Ar.SplitPackageRelativePathOuter(name)
        outer = os.path.relpath(outer, os.path.dirname(layer_file)) if os.path.isabs(outer) else outer
        if "#" in os.path.basename(outer):  # clips by their numbers
            for clip in _numbered(layer_file, outer):
                self._await(str(self._files.named(clip, layer_file)))
            return path
        target_file = self._files.named(outer, layer_file)
        if not os.path.exists(target_file):
            raise SceneError(f"{layer_file}: refers to {path!r}, which is missing")
        self._count(target_file)
        target = f"{target_file}[{inner}]" if inner else str(target_file)
        self._await(target)
        return Sdf.Layer.CreateIdentifier(target, arguments) if arguments else target

    def _count(self, file: Path) -> None:
        """Allow for the memory of a file."""
        if file not in self._counted:
            size = file.stat().st_size
            self._counted[file] = size
            self._files.budget.add_file(size)
            allow_memory(PER_BYTE * size)

    def _await(self, name: str) -> None:
        """Have a layer opened; others than layers are not."""
        if name.rstrip("]").lower().endswith(EXTENSIONS):
            self._waiting.append(name)

    def check_size(self) -> None:
        """Count the prims that the layers stand for, as the stage would take memory for each of them.

        Raises
        ------
        SceneError
            If there are too many.
        """
        from pxr import Pcp

        most = min(MOST_PRIMS, PRIMS + sum(self._counted.values()))
        layer = self.open[self.root]
        cache = Pcp.Cache(Pcp.LayerStackIdentifier(layer), "usd", True)
        root, _ = cache.ComputePrimIndex(layer.pseudoRoot.path)
        waiting, count = [(layer.pseudoRoot.path, root)], 0
        while waiting:
            above, index = waiting.pop()
            for name in index.ComputePrimChildNames()[0]:
                path = above.AppendChild(name)
                child, _ = cache.ComputePrimIndex(path)
                if child.hasAnyPayloads and not cache.IsPayloadIncluded(path):
                    cache.RequestPayloads([path], [])
                    child, _ = cache.ComputePrimIndex(path)
                waiting.append((path, child))
                count += 1
                if count > most:
                    raise LimitError(f"{path}: is beyond the limit of {most} prims for files of this size")


@contextmanager
def typed(what: str) -> Iterator[None]:
    """Raise a SceneError in place of what usd-core, or a value of an odd type, raises.

    Parameters
    ----------
    what
        The beginning of its message.
    """
    try:
        yield
    except (SceneError, MemoryError):
        raise
    except Exception as error:  # of pxr.Tf, and of any type where values are of others than the schema has
        if "bad_alloc" in _text(error):
            raise LimitError(f"{what}: it takes more memory than LoadLimits.memory_bytes") from error
        raise SceneError(f"{what}: {said(error)}") from error


def said(error: Any) -> str:
    """Return the message of an error of usd-core on one line."""
    return STAGE.sub("", WHERE.sub("", " ".join(_text(error).split())))[:MOST_SAID]


def _text(error: Any) -> str:
    """Return the message of an error; that of usd-core may have bytes that are not UTF-8."""
    try:
        return str(error)
    except UnicodeDecodeError as wrong:
        return wrong.object.decode("utf-8", errors="replace")


def _file_of(layer: Any) -> str:
    """Return the path of the file that a layer is in."""
    return str(layer.realPath or layer.identifier).partition("[")[0]


def _numbered(layer_file: str, name: str) -> list[str]:
    """Return the files of which # in a name, relative to a layer's, stands for digits."""
    folder, base = os.path.split(name)
    pattern = re.compile(re.sub(r"(\\#)+", r"\\d+", re.escape(base)))
    directory = Path(layer_file).parent / folder
    names = sorted(os.listdir(directory)) if directory.is_dir() else []
    return [os.path.join(folder, entry) for entry in names if pattern.fullmatch(entry)]
