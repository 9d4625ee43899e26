"""MaterialX documents without its library."""

import pytest

import wavefront as wf


def test_without_the_library(tmp_path, missing):
    missing("MaterialX")
    with pytest.raises(ImportError, match="pip install materialx"):
        wf.load_materialx(tmp_path / "a.mtlx")
