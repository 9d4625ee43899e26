"""Lines of text files: lines of the same form are checked once, and no line makes a file slow or large."""

import pytest
from inside import NUMBER, Losses, obj


@pytest.mark.parametrize(
    "word", ["1", "1.", ".5", "+1.5", "-1e5", "1.e-3", ".5E+2", "nan", "-inf", "Infinity"]
)
def test_numbers(word):
    assert NUMBER.fullmatch(word)
    float(word)


@pytest.mark.parametrize("word", ["", ".", "e5", "1e", "1e+", "1_0", "0x1", "infin", "+-1", "1.5.2", "١"])
def test_other_words_are_not_numbers(word):
    assert not NUMBER.fullmatch(word)


def test_a_long_word_is_checked_in_linear_time():
    """In quadratic time this takes minutes."""
    for word in ("1" * 300_000 + "x", "1" * 300_000 + "." + "1" * 300_000 + "x"):
        assert not NUMBER.fullmatch(word)


def test_one_wide_line_does_not_widen_all_lines():
    rows = "v 0 0 0\nvt 0 0\nvn 0 0 1\n" * 5000
    wide = "".join(f"{keyword} 1 1{' 1' * 50_000}\n" for keyword in ("v", "vt", "vn"))
    (raw,) = obj.parse(Losses("a.obj"), rows + wide + "f 1/1/1 2/2/2 5001/5001/5001\n").raws
    assert raw.vertices.tolist() == [[0, 0, 0], [0, 0, 0], [1, 1, 1]]
    assert raw.uvs.tolist() == [[0, 0], [0, 0], [1, 1]]
    assert raw.normals.tolist() == [[0, 0, 1], [0, 0, 1], [1, 1, 1]]


@pytest.mark.parametrize("blank", ["\x0b", "\x0c", "\x85", "\u2003"])
def test_only_blanks_and_tabs_separate_words_of_obj(blank):
    for line in (f"v 0{blank}0 0 0", f"v{blank}0 0 0", f"f 1 2{blank}3 4"):
        losses = Losses("a.obj")
        (raw,) = obj.parse(losses, f"v 0 0 0\nv 1 0 0\nv 0 1 0\n{line}\nf 1 2 3\n").raws
        assert raw.faces.tolist() == [[0, 1, 2]]
        assert [loss.place for loss in losses.found] == ["a.obj: line 4"]
