"""What of a file is not honored, in one warning."""

from __future__ import annotations

import pytest

import wavefront as wf
from wavefront.io.losses import Losses


def test_all_is_named_once() -> None:
    lost = Losses()
    for line in (3, 3, 9):
        lost.note("shape 'cone': left out", f"a.pbrt line {line}")
    lost.note("a.pbrt, light (spot): scale")
    with pytest.warns(UserWarning, match=r"line 3: shape 'cone': left out \(1 more\); light \(spot\): scale"):
        lost.report("a.pbrt", strict=False)
    with pytest.raises(wf.SceneError, match=r"^a\.pbrt: not honored: line 3"):
        lost.report("a.pbrt", strict=True)
    Losses().report("a.pbrt", strict=True)
