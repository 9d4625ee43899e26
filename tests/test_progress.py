"""The bar: late, so that short renders have none, and right from when it appears."""

import pytest

from wavefront.progress import DELAY, Bar


@pytest.mark.parametrize("progress", [None, True])
def test_a_bar_appears_after_a_while(progress, capsys) -> None:
    """It knows of what was done before, and since when."""
    with Bar(progress, 1000, None) as bar:
        bar.advance(100, DELAY)
        assert capsys.readouterr().err == ""
        bar.advance(200, DELAY + 3)
        assert "30%" in capsys.readouterr().err
        bar.advance(50, DELAY + 4)
        assert bar._bar.n == 350
        assert DELAY + 3 <= bar._bar.format_dict["elapsed"] < DELAY + 3.5
    assert "350/1.00k" in capsys.readouterr().err


def test_a_bar_of_time_counts_seconds(capsys) -> None:
    """Up to the time there is."""
    with Bar(None, 1000, 10.0) as bar:
        bar.advance(100, 4.2)
        assert "4/10 s" in capsys.readouterr().err
        bar.advance(100, 11)
    assert "10/10 s" in capsys.readouterr().err


def test_there_is_no_bar_for_a_function_or_for_false(capsys) -> None:
    """A function is called in its place."""
    calls: list = []
    for progress in (False, lambda *call: calls.append(call)):
        with Bar(progress, 100, None) as bar:
            bar.advance(20, 1)
            bar.advance(30, 60)
    assert calls == [(20, 100), (50, 100)]
    assert capsys.readouterr().err == ""
