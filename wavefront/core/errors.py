"""Error types, and checks of arguments."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .plural import plural
from .suggestions import did_you_mean

PACKAGE = os.path.join(os.path.dirname(os.path.dirname(__file__)), "")
MOST_LETTERS = 120  # of a value in a message
_listener: ContextVar[Callable[[str], None] | None] = ContextVar("listener", default=None)
BEGIN, END = 1500, 500  # letters that are kept at both ends of a longer message


def printable(text: str) -> str:
    """Return text with control characters, which could steer a terminal, as escapes such as \\x1b."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def plain(message: str) -> str:
    """Return a message as it is shown: printable, and without the middle where a value in it is very long."""
    if len(message) > BEGIN + END:
        message = f"{message[:BEGIN]} … {message[-END:]}"
    return "\n".join(map(printable, message.split("\n")))


class SceneError(ValueError):
    """A scene, file or argument that cannot be rendered.

    The message names what is wrong, where it is, the value found and the limit.

    Examples
    --------
    >>> try:
    ...     wf.Diffuse((0.2, 1.5, 0.1))
    ... except wf.SceneError as error:
    ...     print(error)
    Diffuse reflectance[1] is 1.5; it must be in [0, 1]
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(plain(message))


class LimitError(SceneError):
    """A limit is exceeded, such as one of `LoadLimits`: no part of a file is left out for it."""


def passed_limit(error: BaseException | None) -> bool:
    """Return whether an error, or one that it follows from, is a `LimitError`."""
    while error is not None and not isinstance(error, LimitError):
        error = error.__cause__
    return error is not None


class SaveError(SceneError, OSError):
    """A file that cannot be written. The old file, if there was one, is intact.

    Examples
    --------
    >>> image = wf.Image(np.zeros((4, 4, 3), np.float32))
    >>> try:
    ...     image.save("no_such_folder/picture.png")
    ... except wf.SaveError as error:
    ...     print("the picture is not saved")
    the picture is not saved
    """

    def __new__(cls, *args: Any) -> SaveError:
        """Make one as OSError does."""
        return OSError.__new__(cls, *args)  # that of ValueError, which comes first, refuses an OSError


class _WithImage(BaseException):
    """An error that may hold the picture so far."""

    def __init__(self, message: str, image: Any = None) -> None:
        super().__init__(plain(message))
        self.image = image


class RenderError(_WithImage, RuntimeError):
    """A render that failed after it had begun.

    Attributes
    ----------
    image
        The picture so far, an `Image`; None if there is none.

    Examples
    --------
    >>> class Broken(wf.Bsdf):
    ...     def f(self, wo, wi):
    ...         return np.full_like(wo, np.nan)
    >>> try:
    ...     wf.render([wf.Sphere((0, 0, 0), 1, material=Broken()), wf.Environment(1)], 1, size=(8, 8))
    ... except wf.RenderError as error:
    ...     print(error.image.shape)
    (8, 8, 3)
    """


class Interrupted(_WithImage, KeyboardInterrupt):
    """A render that Ctrl-C stopped.

    It is a KeyboardInterrupt, so a script stops unless it catches it.

    Attributes
    ----------
    image
        The picture so far, an `Image`; None if there is none.

    Examples
    --------
    >>> def press_ctrl_c(done, total):
    ...     raise KeyboardInterrupt
    >>> try:
    ...     wf.render([wf.Sphere((0, 0, 0), 1), wf.Environment(1)], 4, size=(8, 8), progress=press_ctrl_c)
    ... except wf.Interrupted as stop:
    ...     image = stop.image
    """

    _displayed = False

    def _render_traceback_(self) -> list[str]:
        """Show the picture in a notebook: IPython calls this in place of printing a traceback.

        Kernels call it once for the notebook and once more for their reply.
        """
        if self.image is not None and not self._displayed:
            self._displayed = True
            with suppress(Exception):  # a message without its picture still informs
                from IPython.display import display  # IPython is installed: it called this method

                display(self.image)
        where = [] if self.image is None else ["the picture so far: import sys; sys.last_value.image"]
        return [f"{type(self).__name__}: {self}", *where]


def warn_caller(message: str) -> None:
    """Warn, at the line of the user's program that called into this package.

    A warning that cannot be shown, as standard error is closed, is lost.
    """
    listener = _listener.get()
    if listener is not None:
        listener(message)
        return
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_code.co_filename.startswith(PACKAGE):
        frame, level = frame.f_back, level + 1
    with suppress(OSError, ValueError, AttributeError):
        warnings.warn(plain(message), stacklevel=level)


@contextmanager
def hear_warnings(listener: Callable[[str], None]) -> Iterator[None]:
    """Give a function the messages of `warn_caller` in this thread, in place of warnings."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


@contextmanager
def collect_warnings() -> Iterator[dict[str, None]]:
    """Collect the messages of `warn_caller` in this thread, each once, in place of warnings."""
    messages: dict[str, None] = {}
    with hear_warnings(lambda message: messages.update({message: None})):
        yield messages


def in_brief(value: Any) -> str:
    """Return a wrong value for a message: its repr on one line, cut off where it is long."""
    if isinstance(value, np.ndarray) and value.ndim:
        return f"an array of shape {value.shape}"
    text = " ".join(repr(value).split())
    return text if len(text) <= MOST_LETTERS else f"{text[:MOST_LETTERS]}…"


def exact(value: Any) -> str:
    """Return a number with the fewest digits that tell it from all others of its type."""
    text = f"{value:g}"
    return text if np.asarray(value).dtype.type(float(text)) == value else str(value)


def iterable(name: str, value: Any, of: str) -> Iterator[Any]:
    """Return an iterator over several things.

    Raises
    ------
    SceneError
        If `value` is a single thing.
    """
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise SceneError(f"{name} must be a list of {of}, got {in_brief(value)}")
    return iter(value)


def as_array(name: str, value: Any) -> NDArray[Any]:
    """Return `value` as an array of real numbers, of whatever type they are; an array is not copied.

    Raises
    ------
    SceneError
        If it is no array, for whatever reason, or has complex numbers, or masked ones.
    """
    try:
        array = np.asanyarray(value)
    except MemoryError:
        raise
    except Exception as error:  # whatever an object's own __array__ raises
        wanted = "have rows of one length" if "inhomogeneous" in str(error) else "be numeric"
        raise SceneError(f"{name} must {wanted}, got {in_brief(value)}") from error
    ma = sys.modules.get("numpy.ma")  # whoever has masked values has imported it
    if ma is not None and ma.is_masked(array):
        masked = plural(int(ma.count_masked(array)), "masked value")
        raise SceneError(f"{name} has {masked}; leave their rows out, or give them numbers with filled(...)")
    if array.dtype.kind == "c":
        raise SceneError(f"{name} must be real numbers, got {array.dtype}")
    return np.asarray(array)


def finite_array(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """Return a copy of `value` as a float64 array of `shape` (None matches any length).

    Raises
    ------
    SceneError
        If the shape differs, the value is not numeric, or an element is not finite.
    """
    try:
        array = np.array(as_array(name, value), dtype=np.float64)
    except SceneError:
        raise
    except (TypeError, ValueError, OverflowError) as error:
        raise SceneError(f"{name} must be numeric, got {in_brief(value)}") from error
    fits = array.ndim == len(shape) and all(
        want is None or have == want for have, want in zip(array.shape, shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("n" if want is None else str(want) for want in shape)
        wanted = f"({wanted},)" if len(shape) == 1 else f"({wanted})"
        raise SceneError(f"{name} must have shape {wanted}, got {array.shape}")
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        where = "".join(f"[{i}]" for i in bad[0])
        raise SceneError(f"{name}{where} is {array[tuple(bad[0])]}; it must be finite")
    return array


def one_of(name: str, value: Any, choices: Collection[Any]) -> Any:
    """Return `value` if it is one of the choices.

    Raises
    ------
    SceneError
        If it is not. The message lists all choices and suggests the nearest.
    """
    if not isinstance(value, str | int) or value not in choices:
        hint = did_you_mean(value, [choice for choice in choices if isinstance(choice, str)])
        listed = ", ".join(map(str, choices))
        raise SceneError(f"{name} is {in_brief(value)}; it must be one of {listed}{hint}")
    return value


def text(name: str, value: Any) -> str:
    """Return `value` if it is a text.

    Raises
    ------
    SceneError
        If it is not.
    """
    if not isinstance(value, str):
        raise SceneError(f"{name} is {in_brief(value)}; it must be text")
    return value


def mapping(name: str, value: Any) -> dict[Any, Any]:
    """Return a mapping as a dict of its own, an empty one for None.

    Raises
    ------
    SceneError
        If it is something else.
    """
    if value is not None and not isinstance(value, Mapping):
        raise SceneError(f"{name} is {in_brief(value)}; it must be a dict")
    return dict(value or {})


def shape_of(value: Any) -> tuple[int, ...]:
    """Return the shape of an array, or of a value that NumPy converts to one; () where it cannot."""
    try:
        return np.shape(value)
    except Exception:  # of rows of several lengths, or whatever an object raises; its check says more
        return ()


@contextmanager
def called(name: str, inner: str) -> Iterator[None]:
    """Have errors of the block name an argument as the caller wrote it, in place of `inner`."""
    try:
        yield
    except SceneError as error:
        message = str(error)
        said = message.replace(inner, name, 1) if inner in message else f"{name}: {message}"
        raise type(error)(said) from error


def flag(name: str, value: Any) -> bool:
    """Return `value` as a bool if it is True or False.

    Raises
    ------
    SceneError
        If it is something else, such as "false", which counts as true.
    """
    if not isinstance(value, bool | np.bool_):
        raise SceneError(f"{name} is {in_brief(value)}; it must be True or False")
    return bool(value)


def number(
    name: str, value: Any, holds: Callable[[float], bool] = lambda x: True, limit: str = "finite"
) -> float:
    """Return `value` as a finite float for which `holds` is true.

    Raises
    ------
    SceneError
        Naming `name`, the value and `limit`.
    """
    try:
        if isinstance(value, str | bytes):  # float reads these
            raise TypeError
        result = float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise SceneError(f"{name} must be a number, got {in_brief(value)}") from error
    if not np.isfinite(result) or not holds(result):
        raise SceneError(f"{name} is {value!r}; it must be {limit}")
    return result


def rotation_matrix(name: str, value: ArrayLike, tolerance: float = 1e-4) -> NDArray[np.float64]:
    """Return a (3, 3) rotation, replaced by the nearest exact rotation if it is inexact by rounding.

    Raises
    ------
    SceneError
        If it scales, shears or mirrors: if an element of MᵀM − 1 exceeds `tolerance`, or det M < 0.
    """
    matrix = finite_array(name, value, (3, 3))
    off = float(np.abs(matrix.T @ matrix - np.eye(3)).max())
    if not off <= tolerance:
        raise SceneError(
            f"{name} must be a rotation, without scale or shear: "
            f"an element of MᵀM − 1 is {off:.3g}, at most {tolerance:g} is rounding"
        )
    if np.linalg.det(matrix) < 0:
        raise SceneError(f"{name} must be a rotation; it mirrors: its determinant is -1")
    left, _, right = np.linalg.svd(matrix)
    return matrix if off < 1e-12 else np.asarray(left @ right)
