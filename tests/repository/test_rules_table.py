"""The table of fast rules in docs/testing.md: its files and tests are there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs/testing.md").read_text().partition("## Fast rules")[2].partition("\n## ")[0]
ROWS = [line.strip("| ").split(" | ") for line in TEXT.splitlines() if line.startswith("| ")][1:]


def test_the_table_has_rows_of_four_cells() -> None:
    assert len(ROWS) > 80
    assert {len(row) for row in ROWS} == {4}


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_files_and_tests_of_the_table_are_there(row: list[str]) -> None:
    where, tests = re.findall(r"`([\w/]+\.py)`", row[1]), re.findall(r"`([\w/]*(?:\.py)?)::(\w+)`", row[3])
    assert where
    assert tests
    for path in where:
        assert (ROOT / "wavefront" / path).is_file(), path
    file = ""
    for path, name in tests:
        file = path or file
        assert f"\ndef {name}(" in (ROOT / "tests" / file).read_text(), f"{file}::{name}"
