"""A material of the user's own that returns arrays of the wrong shape is named, with what is due."""

import numpy as np
import pytest
from inside import BsdfSample
from significance import render

import wavefront as wf


class Paint(wf.Bsdf):
    """Diffuse, but for what is spoiled."""

    def __init__(self, spoiled: str) -> None:
        self.spoiled = spoiled
        self.whole = wf.Diffuse(0.5)

    def f(self, wo, wi):
        f = self.whole.f(wo, wi)
        return f[0] if self.spoiled == "f" else f

    def pdf(self, wo, wi):
        pdf = self.whole.pdf(wo, wi)
        return pdf[None] if self.spoiled == "pdf" else pdf

    def sample_f(self, wo, u):
        sample = self.whole.sample_f(wo, u)
        weight = sample.weight[:, :1] if self.spoiled == "weight" else sample.weight
        wi = sample.wi.T if self.spoiled == "wi" else sample.wi
        return BsdfSample(wi, weight, sample.pdf, sample.specular)


@pytest.mark.parametrize(
    ("spoiled", "message"),
    [
        ("f", r"Paint: f has the shape \((\d+),\); it must have \(3, n\) = \(3, \1\)"),
        ("pdf", r"Paint: pdf has the shape \(1, (\d+)\); it must have \(n,\) = \(\1,\)"),
        ("weight", r"Paint: sample_f's weight has the shape \(3, 1\); it must have \(3, n\) = \(3, \d+\)"),
        ("wi", r"Paint: sample_f's wi has the shape \((\d+), 3\); it must have \(3, n\) = \(3, \1\)"),
    ],
)
@pytest.mark.parametrize("alone", [True, False])
def test_wrong_shapes_are_named(spoiled: str, message: str, alone: bool) -> None:
    """Whether it is the only material of the scene or one of several, and with the default sampling too."""
    others = [] if alone else [wf.Sphere((0, 1, 0), 0.5, material=wf.Conductor.named("gold", roughness=0.5))]
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), size=(8, 8))
    lights = [wf.Environment(), wf.PointLight((0, 0, 4), 9)]
    scene = wf.Scene([wf.Sphere((0, 0, 0), 1, material=Paint(spoiled)), *others], lights, camera)
    with pytest.raises(wf.SceneError, match=message):
        render(scene, 1)


def test_the_default_sampling_does_not_hide_it() -> None:

    class Phong(wf.Bsdf):
        def f(self, wo, wi):
            return np.ones(wi.shape[1], np.float32)

    with pytest.raises(wf.SceneError, match=r"Phong: sample_f's weight has the shape \(\d+,\)"):
        render(
            [wf.Sphere((0, 0, 0), 1, material=Phong()), wf.Environment()], 1, integrator="naive", size=(8, 8)
        )


def test_a_bsdf_that_is_a_part_of_itself_is_named() -> None:
    """Not followed until Python gives up; two names for one part are no loop."""
    loop = Paint("nothing")
    loop.same = loop.whole
    scene = [wf.Sphere((0, 0, 0), 1, material=loop), wf.Environment(1)]
    assert render(scene, 1).spp == 1
    loop.again = loop
    with pytest.raises(wf.SceneError, match="Paint: an attribute of it is the BSDF itself"):
        render(scene, 1)
