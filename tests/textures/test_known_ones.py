"""Where a texture is known to be 1, so that faces with an alpha are opaque there."""

from __future__ import annotations

import numpy as np
import pytest
from inside import plate

import wavefront as wf

HOLE = np.ones((8, 16))
HOLE[2, 5] = 0.999  # from u = 5/16 to 6/16, from v = 5/8 to 6/8


def is_one(low: tuple[float, float], high: tuple[float, float], **settings: object) -> bool:
    texture = wf.Texture(HOLE, channel=0, **settings)
    found = texture.is_one_within(np.array(low)[:, None], np.array(high)[:, None])
    uv = np.random.default_rng(0).uniform(low, high, (4000, 2)).T.astype(np.float32)
    exact = bool((texture.lookup(uv) == 1).all())
    assert exact or not found[0]
    return bool(found[0])


# bilinear lookups read the texel from half a texel before it to half a texel behind it
@pytest.mark.parametrize(
    ("low", "high", "one"),
    [
        ((0.4, 0.1), (0.9, 0.9), False),  # u up to 6.5/16 reads it
        ((6.6 / 16, 0.1), (0.9, 0.9), True),
        ((6.4 / 16, 0.1), (0.9, 0.9), False),
        ((0.1, 0.1), (4.4 / 16, 0.9), True),
        ((0.1, 0.1), (4.6 / 16, 0.9), False),
        ((0.1, 0.1), (0.9, 4.4 / 8), True),
        ((0.1, 0.1), (0.9, 4.6 / 8), False),
        ((0.1, 6.6 / 8), (0.9, 0.9), True),
        ((0.1, 6.4 / 8), (0.9, 0.9), False),
    ],
)
def test_boxes_that_read_other_texels_are_not_one(low: tuple, high: tuple, one: bool) -> None:
    assert is_one(low, high) == one


def test_what_is_beyond_the_image_is_known_only_where_its_edge_continues() -> None:
    low, high = (0.5, 0.0), (1.0, 1.0)
    assert is_one(low, high, wrap="clamp")
    assert is_one(low, high, wrap="mirror")
    assert not is_one(low, high)
    assert not is_one((0.5, 0.0), (1.001, 1.0), wrap="clamp")
    assert not is_one((0.6, 0.1), (0.7, 0.2), scale=0.5)
    assert not is_one((0.6, 0.1), (0.7, 0.2), offset=-0.1)
    assert not is_one((0.6, 0.1), (0.7, 0.2), transform=np.eye(3))


def test_faces_that_are_opaque_all_over_have_no_alpha() -> None:
    texels = np.linspace(-1, 1, 129)
    reach = float(np.hypot(*np.meshgrid(texels, texels)).max())
    alpha = np.clip(1.25 - np.hypot(*np.meshgrid(texels, texels)), 0, 1)
    assert reach > 1.25
    material = wf.Material(wf.Diffuse(0.5), alpha=wf.Texture(alpha, channel=0, wrap="clamp"))
    mesh = plate(np.zeros(3), np.array((0, 1.0, 0)), 1.0, material=material, name="ground")
    opaque = material.opacity.is_one_over(mesh.uvs.take(mesh.faces, 0))
    assert np.array_equal(np.flatnonzero(opaque), [8, 9])  # the middle
