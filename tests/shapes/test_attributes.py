"""Vertex colors, texture coordinates and textures: from the mesh to the picture."""

import numpy as np
import pytest
from inside import BaseTexture, compile_scene, make_accelerator
from significance import render

import wavefront as wf

SQUARE = {"vertices": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "faces": [[0, 1, 2], [0, 2, 3]]}
CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
N = 8  # pixels along a side of the picture of the unit square


def unlit(*shapes):
    """Picture the unit square z = 0 in even light, where a matte flat patch shows its own color.

    Every ray that leaves it finds radiance 1, and its weight is the reflectance: no noise.
    """
    camera = wf.Camera.orthographic((0.5, 0.5, 1), (0.5, 0.5, 0), height=1, size=(N, N))
    scene = wf.Scene(shapes, lights=[wf.Environment(1.0)], camera=camera)
    return render(scene, 4, integrator="naive", max_bounces=1).rgb


def square(**arguments):
    return wf.Mesh(**SQUARE, **arguments)


def compiled(*shapes):
    scene = wf.Scene(shapes, lights=[wf.Environment(1.0)])
    return compile_scene(scene, lambda geometry: make_accelerator(geometry, "numpy"))


def centers():
    """x and y of the centers of the pixels, (N, N) each; row 0 is the top."""
    along = (np.arange(N) + 0.5) / N
    return np.meshgrid(along, along[::-1])


def test_a_textured_patch_in_even_light_shows_its_texels():
    codes = np.random.default_rng(0).integers(0, 256, (N, N, 3), np.uint8)
    texture = wf.Texture(codes, filter="nearest")
    texels = texture.lookup(np.stack([c.ravel() for c in centers()]).astype(np.float32)).T.reshape(N, N, 3)
    image = unlit(square(uvs=CORNERS, material=wf.Diffuse(texture)))
    assert image == pytest.approx(texels, rel=1e-5)
    # the same by the definition of sRGB, so that lookup and test cannot both be wrong
    c = codes / 255
    expected = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    assert image == pytest.approx(expected, rel=1e-4, abs=1e-7)


def test_vertex_colors_are_interpolated():
    colors = np.column_stack([CORNERS, 1 - CORNERS[:, 0]])
    image = unlit(square(colors=colors, material=wf.Diffuse(wf.VertexColors())))
    x, y = centers()
    # samples lie anywhere in their pixel
    assert image == pytest.approx(np.stack([x, y, 1 - x], -1), abs=0.5 / N)
    assert image.mean((0, 1)) == pytest.approx([0.5, 0.5, 0.5], abs=0.1 / N)


def test_vertex_colors_multiply_a_color_and_a_texture():
    colors = [[0.5, 1, 0.25]] * 4
    gray = np.full((1, 1, 3), 0.5, np.float32)
    for times, expected in (((0.2, 0.5, 1), [0.1, 0.5, 0.25]), (wf.Texture(gray), [0.25, 0.5, 0.125])):
        image = unlit(square(colors=colors, uvs=CORNERS, material=wf.Diffuse(wf.VertexColors(times))))
        assert image == pytest.approx(np.broadcast_to(expected, image.shape), rel=1e-5)


def test_a_channel_of_the_colors_is_a_number():
    weight = wf.VertexColors(0.5, channel=3)
    mixed = wf.Mix(wf.Diffuse(0.0), wf.Diffuse(1.0), weight)
    # by the expected value: a cosine-weighted sample of either part weighs 0.5 · 0.4
    image = unlit(square(colors=[[0, 0, 0, 0.4]] * 4, material=mixed))
    assert image == pytest.approx(0.2, rel=1e-5)
    red = wf.Diffuse(wf.VertexColors(channel=0))  # and serves as a gray color
    assert unlit(square(colors=[[0.3, 0, 0]] * 4, material=red)) == pytest.approx(0.3, rel=1e-5)


def test_what_has_no_colors_is_white():
    material = wf.Diffuse(wf.VertexColors(0.7))
    with pytest.warns(UserWarning, match=r"1 mesh lacks the vertex colors .* reads, first: 'plain'"):
        image = unlit(square(material=material, name="plain"))
    assert image == pytest.approx(0.7, rel=1e-5)
    ball = wf.Sphere((0.5, 0.5, -9), 8, material=material)
    assert unlit(ball) == pytest.approx(0.7, rel=1e-5)
    beside = square(colors=[[0, 0, 0]] * 4, material=wf.Diffuse(wf.VertexColors()))
    assert unlit(ball, beside).max() == 0


def test_the_checker_takes_materials_with_vertex_colors():
    wf.testing.check_bsdf(wf.OrenNayar(wf.VertexColors((0.3, 0.5, 0.9))), samples=20_000)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: square(colors=[[0, 0, 0]]), r"mesh: colors must have a row for each of 4 vertices, got 1"),
        (lambda: square(colors=[[0, 0]] * 4), r"colors has 2 numbers per vertex; it must have 3 or 4"),
        (
            lambda: square(colors=[*[[0, 0, 0]] * 2, [0, 1.5, 0], [0, 0, 0]]),
            r"colors\[2\]\[1\] is 1\.5; it must be",
        ),
        (lambda: square(colors=[[0, 0, 0, -1]] * 4), r"colors\[0\]\[3\] is -1"),
        (lambda: square(colors=[[0, np.nan, 0]] * 4), r"colors\[0\]\[1\] is nan; it must be finite"),
        (lambda: square(colors=[[0, 0, 0], [0]]), r"colors must have rows of one length"),
        (lambda: square(uvs1=[[0, 0]]), r"mesh: uvs1 must have a row for each of 4 vertices, got 1"),
        (lambda: wf.VertexColors(channel=4), r"VertexColors channel is 4; it must be from 0 to 3, or None"),
        (lambda: wf.VertexColors(2), r"VertexColors times is 2; it must be in \[0, 1\]"),
        (lambda: wf.Texture(np.zeros((1, 1)), uv_set=2), r"uv_set is 2; it must be one of 0, 1"),
    ],
)
def test_bad_colors_and_coordinates(make, message):
    with pytest.raises(wf.SceneError, match=message):
        make()


def test_a_texture_uses_the_second_set():
    image = np.random.default_rng(1).random((N, N, 3), np.float32)
    turned = CORNERS[:, ::-1]
    first = unlit(square(uvs=turned, material=wf.Diffuse(wf.Texture(image))))
    second = wf.Diffuse(wf.Texture(image, uv_set=1))
    assert np.array_equal(unlit(square(uvs=CORNERS, uvs1=turned, material=second)), first)
    both = wf.Mix(wf.Diffuse(0.0), second, wf.Texture(np.ones((1, 1), np.float32), channel=0))
    assert unlit(square(uvs=CORNERS, uvs1=turned, material=both)) == pytest.approx(first, abs=1e-6)


def test_a_mesh_without_the_coordinates_that_its_texture_reads_is_named():
    white = wf.Texture(np.ones((1, 1), np.float32), uv_set=1)
    with pytest.warns(UserWarning, match=r"lacks the second texture coordinates \(uvs1\)"):
        unlit(square(uvs=CORNERS, material=wf.Diffuse(white)))


def test_only_what_is_read_is_compiled():
    plain = square(uvs=CORNERS, uvs1=CORNERS, colors=[[0, 0, 0]] * 4, material=wf.Diffuse(0.5))
    assert compiled(plain).attributes == {}
    plain.material = wf.Diffuse(wf.VertexColors(wf.Texture(np.ones((1, 1)), uv_set=1)))
    assert list(compiled(plain).attributes) == ["color", "uv1"]


def test_a_parameter_that_reads_the_unknown_is_refused():
    class Odd(BaseTexture):
        reads = ("smell",)

        def at(self, surface):
            return surface.smell

    with pytest.raises(wf.SceneError, match=r"mesh: its material reads 'smell'"):
        compiled(square(material=wf.Diffuse(Odd())))


def test_a_texture_of_numbers_serves_as_a_color():
    image = np.random.default_rng(2).random((N, N, 3), np.float32)
    number = wf.Texture(image, channel=1)
    material = wf.Diffuse(number)
    normal = np.array([[0], [0], [1]], np.float32)
    bound = material.bind(_Surface)
    assert (
        bound.reflectance.shape == bound.f(np.repeat(normal, 5, 1), np.repeat(normal, 5, 1)).shape == (3, 5)
    )
    found = unlit(square(uvs=CORNERS, material=material))
    assert np.array_equal(found, unlit(square(uvs=CORNERS, material=wf.Diffuse(wf.Texture(image[..., 1])))))
    assert unlit(square(uvs=CORNERS, material=wf.Principled(number, specular=0))) == pytest.approx(
        found, rel=1e-3
    )


def test_a_texture_of_colors_serves_as_a_number():
    image = np.random.default_rng(3).random((N, N, 3), np.float32)
    bound = wf.Principled(0.5, roughness=wf.Texture(image)).bind(_Surface)
    expected = wf.Texture(image, channel="luminance").lookup(_Surface.uv)
    assert bound.roughness.shape == (5,)
    assert bound.roughness == pytest.approx(expected, rel=1e-6)


class _Surface:
    uv = np.random.default_rng(4).random((2, 5)).astype(np.float32)
    index_around = None
