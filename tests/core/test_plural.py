"""Counts with their nouns."""

import pytest

import wavefront as wf
from wavefront.core.plural import plural


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((0, "face"), "0 faces"),
        ((1, "face"), "1 face"),
        ((2, "face"), "2 faces"),
        ((1, "vertex", "vertices"), "1 vertex"),
        ((3, "vertex", "vertices"), "3 vertices"),
        ((1.0, "sample", "", ".4g"), "1 sample"),
        ((12.3456, "sample", "", ".4g"), "12.35 samples"),
    ],
)
def test_one_takes_no_plural(arguments, text):
    assert plural(*arguments) == text


def test_scenes_and_meshes_count_in_words():
    triangle = wf.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    one, two = wf.Scene(triangle, wf.Environment(1)), wf.Scene([triangle, triangle])
    assert repr(triangle) == "<Mesh 'mesh': 3 vertices, 1 face>"
    assert repr(one).startswith("<Scene: 1 shape, 1 light, ")
    assert repr(two).startswith("<Scene: 2 shapes, 0 lights, ")
    assert "1 shape, 1 triangle, 1 light<" in one._repr_html_()
    assert "2 shapes, 2 triangles, 0 lights<" in two._repr_html_()
