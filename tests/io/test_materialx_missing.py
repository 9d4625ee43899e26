"""MaterialX documents without its library."""

import sys

import pytest

import wavefront as wf


def test_without_the_library(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "MaterialX", None)
    with pytest.raises(ImportError, match="pip install materialx"):
        wf.load_materialx(tmp_path / "a.mtlx")
