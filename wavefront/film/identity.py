"""The identity of a render: two renders with the same one have the same samples."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

SCENE = "scene"
CAUSTICS = "caustics"
CODE = "code of the "  # before the names of settings that may be functions or classes of the user's
HASH = 64  # characters of a fingerprint
COMPILED_FOR = ("accelerator", "integrator", "light_sampler")  # settings on which the compiled scene depends


def differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Return the differences between the identities of two renders, in words.

    A difference that follows from another one is left out.
    """
    changed = {key for key in {**before, **now} if before.get(key) != now.get(key)}
    follows = {CODE + key for key in changed}
    follows |= {SCENE} if changed.intersection(COMPILED_FOR) else set()
    follows |= {"camera"} if "size" in changed else set()
    return [
        _in_words(key, before.get(key), now.get(key)) for key in {**before, **now} if key in changed - follows
    ]


def _in_words(key: str, before: Any, now: Any) -> str:
    if any(isinstance(value, str) and len(value) == HASH for value in (before, now)):
        return f"the {key} differs"
    return f"{key} was {before!r} and is {now!r}"
