"""Fingerprints: the same for what computes the same, in any process; another one for anything else."""

from __future__ import annotations

import subprocess
import sys
import threading
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from inside import fingerprint

import wavefront as wf


def of(thing: Any) -> str:
    """Return the fingerprint of a thing."""
    return fingerprint("the scene", thing)


def scaled(factor: float) -> Any:
    """Return a function that holds a number."""
    return lambda x: x * factor


class Stripes(wf.BaseTexture):
    """A texture as a user writes one."""

    def __init__(self, count: float = 8.0) -> None:
        self.count = count

    def at(self, surface: Any) -> Any:
        """Return the values."""
        return (surface.uv[0] * self.count % 1 < 0.5).astype(np.float32)


LETTERS = set("abcdefghijklmnopqrstuvwxyz")


def of_all_kinds() -> list[Any]:
    """Return a material of a user's texture, a set, a function and an array."""
    return [wf.Diffuse(Stripes()), LETTERS, {"x": scaled(2)}, np.arange(3)]


def of_source(source: str, name: str = "f") -> str:
    """Return the fingerprint of what a module of the user's defines."""
    variables: dict[str, Any] = {"__name__": "their_module", "np": np}
    exec(source, variables)
    return of(variables[name])


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (np.arange(3), np.arange(3, dtype=np.float64)),
        (np.zeros((2, 3)), np.zeros((3, 2))),
        (np.array([0.0]), np.array([-0.0])),
        (1, 1.0),
        (1, True),
        ([1, 2], (1, 2)),
        ([[1], 2], [[1, 2]]),
        ({"a": 1}, {"b": 1}),
        (scaled(2), scaled(3)),
        (partial(scaled, 2), partial(scaled, 3)),
        (Stripes(8), Stripes(9)),
        (wf.Diffuse(0.5), wf.Diffuse(0.25)),
        (wf.Diffuse(0.5), wf.Mirror(0.5)),
        (np.random.default_rng(1), np.random.default_rng(2)),
    ],
)
def test_what_differs_has_another_fingerprint(a: Any, b: Any) -> None:
    assert of(a) != of(b)


def test_what_is_alike_has_the_same_fingerprint() -> None:
    array = np.arange(5)
    assert of([array, array]) == of([array.copy(), array.copy()])
    assert of({"a": 1, "b": 2}) == of({"b": 2, "a": 1})
    assert of(Stripes(8)) == of(Stripes(8))
    assert of(scaled(2)) == of(scaled(2))
    assert of(array[::2]) == of(array[::2].copy())
    assert of({1, 2, 3}) == of({3, 2, 1})


def test_functions_are_known_by_what_they_compute() -> None:
    """Code, constants, defaults, variables outside; not by their comments or lines."""
    source = "def f(x, y=1):\n    return x * K + y\nK = 2"
    assert of_source(source) == of_source("\n\n# a comment\n" + source)
    assert of_source(source) != of_source(source.replace("*", "/"))
    assert of_source(source) != of_source(source.replace("y=1", "y=2"))
    assert of_source(source) != of_source(source.replace("K = 2", "K = 3"))
    helped = "def f(x):\n    return g(x)\ndef g(x):\n    return x + 1"
    assert of_source(helped) == of_source(helped)
    assert of_source(helped) != of_source(helped.replace("+ 1", "+ 2"))
    assert of_source("f = [lambda x: x]") != of_source("f = [lambda x: 2 * x]")


def test_classes_are_known_by_their_methods_and_bases() -> None:
    source = "class A:\n    k = 1\n    def f(self):\n        return self.f() or A\nclass C(A):\n    pass"
    assert of_source(source, "C") == of_source(source, "C")
    assert of_source(source, "C") != of_source(source.replace("k = 1", "k = 2"), "C")
    assert of_source(source, "C") != of_source(source.replace("or A", "and A"), "C")


def test_values_that_are_kept_from_calls_do_not_count() -> None:
    @lru_cache
    def square(x: int) -> int:
        return x * x

    before = of(square)
    square(3)
    assert of(square) == before


@pytest.mark.parametrize("part", ["lock", "file", "generator"])
def test_what_cannot_be_compared_is_refused(part: str, tmp_path: Path) -> None:
    texture = Stripes()
    with open(tmp_path / "file", "w") as file:
        texture.extra = {"lock": threading.Lock(), "file": file, "generator": (x for x in "ab")}[part]  # type: ignore[attr-defined]
        with pytest.raises(wf.SceneError, match=r"the scene\.reflectance\.extra is a .*"):
            of(wf.Diffuse(texture))


def test_what_contains_itself_has_a_fingerprint() -> None:
    """And so does what is nested deep; deeper than Python's stack is an error."""
    loop: list[Any] = [1]
    loop.append(loop)
    assert of(loop) == of(loop)
    deep: list[Any] = []
    for _ in range(100_000):
        deep = [deep]
    with pytest.raises(wf.SceneError, match="nested too deep"):
        of(deep)


def test_another_process_has_the_same_fingerprints() -> None:
    """In which sets have another order."""
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "import test_fingerprint as t\n"
        "print(t.of(t.of_all_kinds()), *t.LETTERS)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(Path(__file__).parent)],
        capture_output=True,
        text=True,
        check=True,
        env={"PYTHONHASHSEED": "1", "PYTHONPATH": ":".join(sys.path)},
    )
    found, *letters = done.stdout.split()
    assert letters != list(LETTERS)
    assert found == of(of_all_kinds())
