"""Backgrounds hide the environment and keep its light; transparent pictures can be put over any other."""

import numpy as np
import pytest
from inside import li_full

import wavefront as wf

CAMERA = wf.Camera.look_at((0, 0.5, 4), (0, 0, 0), fov=40, size=(32, 24))
VEIL = wf.Material(wf.Diffuse((0.2, 0.7, 0.3)), alpha=0.4)
COLOR = np.array([0.2, 0.5, 1.0], np.float32)


def subject() -> wf.Scene:
    """A ball, a mirror that shows the environment, and a veil before the environment."""
    shapes = [
        wf.Sphere((0, 0, 0), 0.7, material=wf.Diffuse((0.8, 0.4, 0.2))),
        wf.Sphere((-1.2, 0, 0), 0.5, material=wf.Mirror()),
        wf.Rectangle((0.6, -0.8, 0.5), (1, 0, 0), (0, 1.2, 0), material=VEIL),
        wf.Sphere((0.2, 1, 0), 0.2, emission=(3, 2, 1)),
    ]
    return wf.Scene(shapes, [wf.Environment((0.9, 1.1, 1.4))], CAMERA)


@pytest.mark.parametrize("integrator", ["naive", "direct_simple", "direct_mis", "full"])
def test_a_transparent_picture_over_a_color_is_the_picture_with_that_background(integrator: str) -> None:
    settings = {"spp": 16, "integrator": integrator, "max_bounces": 3}
    clear = wf.render(subject(), background="transparent", **settings)
    colored = wf.render(subject(), background=COLOR, **settings)
    over = clear.rgb + (1 - clear.alpha[..., None]) * COLOR
    assert np.abs(over - colored.rgb).max() <= 4e-7 * max(1, colored.rgb.max())
    assert np.unique(clear.alpha).size > 5
    assert clear.alpha.tobytes() == colored.alpha.tobytes()
    assert clear.metadata["background"] == "transparent"
    assert colored.metadata["background"] == pytest.approx(COLOR.tolist())


def test_a_background_of_the_environments_color_changes_nothing() -> None:
    """Which shows that only what the camera sees directly is replaced, and that its light stays."""
    plain = wf.render(subject(), spp=16)
    same = wf.render(subject(), spp=16, background=(0.9, 1.1, 1.4))
    assert same.rgb == pytest.approx(plain.rgb, rel=1e-5)
    assert plain.metadata["background"] is None
    assert "alpha" not in plain.layers


def test_layers_of_light_sum_to_the_transparent_picture() -> None:
    names = ("direct", "indirect", "light_groups")
    image = wf.render(subject(), spp=8, background="transparent", aovs=names)
    assert image.direct + image.indirect == pytest.approx(image.rgb, abs=1e-6)
    groups = sum(layer for name, layer in image.layers.items() if name.startswith("light_groups."))
    assert groups == pytest.approx(image.rgb, rel=1e-5, abs=1e-6)
    colored = wf.render(subject(), spp=8, background=COLOR, aovs=names)
    assert colored.indirect == pytest.approx(image.indirect, abs=1e-6)
    assert colored.direct == pytest.approx(image.direct + (1 - image.alpha[..., None]) * COLOR, abs=1e-6)
    empty = image.alpha == 0
    assert empty.any()
    assert (image.rgb[empty] == 0).all()


def test_integrators_of_users_have_backgrounds_if_they_are_made_of_the_stages() -> None:
    def own(scene, paths, sampler, max_bounces):
        return li_full(scene, paths, sampler, max_bounces)

    clear, mine = (
        wf.render(subject(), spp=4, background="transparent", integrator=each, executor="threads")
        for each in ("full", own)
    )
    assert clear.alpha.tobytes() == mine.alpha.tobytes()
    assert (mine.rgb[mine.alpha == 0] == 0).all()
    assert mine.rgb.mean() == pytest.approx(clear.rgb.mean(), rel=0.05)

    def foreign(scene, paths, sampler, max_bounces):
        return np.ones((3, len(paths)), np.float32)

    with pytest.raises(wf.SceneError, match="alpha"):
        wf.render(subject(), spp=1, background="transparent", integrator=foreign, executor="threads")


@pytest.mark.parametrize("bad", ["clear", (1, 2), -1, "rde"])
def test_malformed_backgrounds_are_errors(bad) -> None:
    with pytest.raises(wf.SceneError, match="background"):
        wf.render(subject(), spp=1, background=bad)


@pytest.mark.parametrize("integrator", ["naive", "direct_simple", "direct_mis", "full"])
def test_a_backdrop_is_what_the_camera_sees_of_an_environment(integrator: str) -> None:
    """Directly and through veils, as a background; its light and its reflections stay."""
    settings = {"spp": 16, "integrator": integrator, "max_bounces": 3}
    scene = subject()
    scene.lights = [wf.Environment((0.9, 1.1, 1.4), backdrop=COLOR)]
    image = wf.render(scene, aovs=("direct", "indirect", "light_groups"), **settings)
    expected = wf.render(subject(), background=COLOR, **settings)
    assert image.rgb == pytest.approx(expected.rgb, rel=1e-5, abs=1e-6)
    assert image.direct + image.indirect == pytest.approx(image.rgb, rel=1e-5, abs=1e-6)
    assert "alpha" not in image.layers
    assert scene.lights[0].backdrop.radiance.ravel() == pytest.approx(COLOR)


def test_a_backdrop_may_be_an_image_and_hides_no_sun() -> None:
    rows = np.linspace(1, 0, 8)[:, None, None] * np.ones((8, 16, 3))
    sun = wf.DirectionalLight((0, -1, -1), 2, angle=20)
    turn = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    camera = wf.Camera.look_at((0, 0, 4), (0, 1, 4.9), fov=90, size=(32, 24))
    ball = wf.Sphere((0, 0, 0), 1)
    settings = {"spp": 4, "camera": camera}
    shown = wf.render([ball, wf.Environment(rows, transform=turn), sun], **settings)
    backdrop = wf.Environment(0.3, transform=turn, backdrop=rows)
    assert wf.render([ball, backdrop, sun], **settings).rgb == pytest.approx(shown.rgb, rel=1e-5)
    colored = wf.render([ball, backdrop], background=COLOR, **settings)
    assert colored.rgb[0, 0] == pytest.approx(COLOR)


def test_a_malformed_backdrop_is_refused() -> None:
    with pytest.raises(wf.SceneError, match=r"^Environment backdrop"):
        wf.Environment(1, backdrop=(1, 2))
