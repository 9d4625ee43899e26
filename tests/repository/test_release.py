"""Version, changelog and citation agree, and stay so in a release."""

import re
import shutil
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest
from inside import VERSION

ROOT = Path(__file__).parents[2]
FILES = ("wavefront/version.py", "CHANGELOG.md", "CITATION.cff")


@pytest.fixture
def release():
    """Return the module of the command `.ci/release`."""
    loader = SourceFileLoader("release", str(ROOT / ".ci" / "release"))
    module = module_from_spec(spec_from_loader("release", loader))
    loader.exec_module(module)
    return module


@pytest.fixture
def copy(tmp_path):
    """Return a folder with copies of the files that name the version."""
    (tmp_path / "wavefront").mkdir()
    for name in FILES:
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


def first_heading(folder):
    """Return the heading of the newest version of the changelog."""
    return re.search(r"^## .*$", (folder / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)[0]


def test_version_changelog_and_citation_agree():
    released = re.escape(VERSION) + r"\] - \d{4}-\d\d-\d\d"
    assert re.fullmatch(rf"## \[(Unreleased\] \({re.escape(VERSION)}\)|{released})", first_heading(ROOT))
    assert f"\nversion: {VERSION}\n" in (ROOT / "CITATION.cff").read_text("utf-8")


def test_a_release_writes_all_three(release, copy):
    release.write_version(copy, "7.8.9", "2030-01-02")
    assert 'VERSION = "7.8.9"\n' in (copy / "wavefront" / "version.py").read_text("utf-8")
    assert first_heading(copy) == "## [7.8.9] - 2030-01-02"
    citation = (copy / "CITATION.cff").read_text("utf-8")
    assert citation.endswith("\nversion: 7.8.9\ndate-released: 2030-01-02\n")


def test_a_release_without_changes_is_refused(release, copy):
    release.write_version(copy, "7.8.9", "2030-01-02")
    with pytest.raises(SystemExit, match=r"CHANGELOG\.md: no line matches"):
        release.write_version(copy, "7.9.0", "2030-01-03")


def test_the_citation_has_what_its_format_requires():
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    for key in ("cff-version", "message", "title", "authors"):
        assert re.search(rf"^{key}:", citation, re.MULTILINE), key
