"""Lines of text files: lines of the same form are checked once, and no line makes a file slow or large."""

import time

import pytest

from wavefront.core.errors import SceneError
from wavefront.io import obj, stl
from wavefront.io.text_lines import NUMBER, check_lines


def test_lines_that_differ_only_in_their_digits_are_checked_once():
    seen = []

    def check(number, line):
        seen.append((number, line))
        return len(line)

    assert check_lines(["v 1 2", "v 3 0", "", "v 10 2", "v -1 2", "v 9 9"], check) == [5, 5, 0, 6, 6, 5]
    assert seen == [(1, "v 1 2"), (3, ""), (4, "v 10 2"), (5, "v -1 2")]


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
    start = time.process_time()
    for word in ("1" * 300_000 + "x", "1" * 300_000 + "." + "1" * 300_000 + "x"):
        assert not NUMBER.fullmatch(word)
    assert time.process_time() - start < 5  # quadratic: minutes


def test_one_wide_line_does_not_widen_all_lines():
    rows = "v 0 0 0\nvt 0 0\nvn 0 0 1\n" * 5000
    wide = "".join(f"{keyword} 1 1{' 1' * 50_000}\n" for keyword in ("v", "vt", "vn"))
    (raw,) = obj.parse("a.obj", rows + wide + "f 1/1/1 2/2/2 5001/5001/5001\n").raws
    assert raw.vertices.tolist() == [[0, 0, 0], [0, 0, 0], [1, 1, 1]]
    assert raw.uvs.tolist() == [[0, 0], [0, 0], [1, 1]]
    assert raw.normals.tolist() == [[0, 0, 1], [0, 0, 1], [1, 1, 1]]


def test_materials_keep_the_forms_of_their_faces():
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 1 0\nf 1 2 3\nusemtl a\nf 1/1 2/1 3/1\nusemtl\nf -1 -2 -3\n"
    plain, textured = obj.parse("a.obj", text).raws
    assert (plain.name, plain.uvs, plain.lines.tolist()) == ("", None, [5, 9])
    assert (textured.name, textured.uvs.tolist(), textured.lines.tolist()) == ("a", [[1, 0]] * 3, [7])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("solid0\nvertex 0 0 0\n", "a.stl line 1: 'solid0' is not STL"),
        ("solid a\nvertex 0 0 0_1\n", "a.stl line 2: vertex is '0 0 0_1'; it must be 3 numbers"),
    ],
)
def test_damaged_lines_of_stl(text, message):
    with pytest.raises(SceneError) as error:
        stl.parse("a.stl", text.encode())
    assert str(error.value) == message


@pytest.mark.parametrize("blank", ["\x0b", "\x0c", "\x85", "\u2003"])
def test_only_blanks_and_tabs_separate_words_of_obj(blank):
    for line in (f"v 0{blank}0 0 0", f"v{blank}0 0 0", f"f 1 2{blank}3 4"):
        with pytest.raises(SceneError, match=r"a\.obj line 4: "):
            obj.parse("a.obj", f"v 0 0 0\nv 1 0 0\nv 0 1 0\n{line}\nf 1 2 3\n")
