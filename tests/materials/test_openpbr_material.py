"""What `OpenPBR` makes of the parameters that are not about scattering."""

import inspect

import numpy as np
import pytest
from inside import OpenPBRBsdf

import wavefront as wf


def test_the_defaults_are_those_of_the_bsdf():
    given = {name: each.default for name, each in inspect.signature(wf.OpenPBR).parameters.items()}
    assert {name: given[name] for name in OpenPBRBsdf.defaults if name in given} == {
        name: value for name, value in OpenPBRBsdf.defaults.items() if name != "multiscatter"
    }
    plain = wf.OpenPBR()
    assert plain.interior is plain.emission is plain.opacity is plain.normal_map is plain.name is None


def test_every_parameter_reaches_the_bsdf():
    for name in OpenPBRBsdf.defaults.keys() - {"multiscatter"}:
        value = True if name == "geometry_thin_walled" else 1.25 if name.endswith("ior") else 0.37
        if name.startswith("subsurface_weight"):
            continue
        assert np.all(getattr(wf.OpenPBR(**{name: value}).bsdf, name) == np.float32(value))


def test_the_color_of_a_depth_is_that_of_the_interior():
    color, depth = np.array([0.9, 0.5, 0.2]), 0.4
    clear = {"transmission_weight": 1, "transmission_color": color, "transmission_depth": depth}
    medium = wf.OpenPBR(**clear).interior
    assert np.exp(-medium.absorption.ravel() * depth) == pytest.approx(color, rel=1e-5)
    assert not medium.scattering.any()
    assert (wf.OpenPBR(**clear).bsdf.transmission_color == 1).all()
    cloudy = wf.OpenPBR(**clear, transmission_scatter=(0.1, 0.4, 3.0), transmission_scatter_anisotropy=0.3)
    medium = cloudy.interior
    assert medium.scattering.ravel() == pytest.approx(np.array([0.1, 0.4, 3.0]) / depth, rel=1e-5)
    absorption = (-np.log(color) - (0.1, 0.4, 3.0)) / depth
    assert medium.absorption.ravel() == pytest.approx(absorption - absorption.min(), rel=1e-4, abs=1e-6)
    assert medium.phase.g == pytest.approx(0.3)
    sheet = wf.OpenPBR(**clear, geometry_thin_walled=True)
    assert sheet.interior is None
    assert sheet.bsdf.transmission_color.ravel() == pytest.approx(color)


@pytest.mark.parametrize("ior", [1.5, 1 / 1.5])
def test_clear_glass_disperses_by_its_abbe_number(ior):
    """V = (n(587.6 nm) − 1)/(n(486.1) − n(656.3)), and what it is divided by; one index with n = A + B/λ²."""
    glass = wf.OpenPBR(
        transmission_weight=1, specular_ior=ior, transmission_dispersion_scale=0.4,
        transmission_dispersion_abbe_number=12, transmission_color=(0.9, 0.5, 0.2), specular_roughness=0,
    ).bsdf  # fmt: skip
    assert isinstance(glass, wf.Dielectric)
    assert glass.dispersive
    assert glass.specular
    indices = glass.ior[:, 0] if ior > 1 else 1 / glass.ior[:, 0]
    b, a = np.polyfit(1 / np.array([0.611, 0.549, 0.464]) ** 2, indices, 1)
    at = {line: a + b / line**2 for line in (0.5876, 0.4861, 0.6563)}
    assert at[0.5876] == pytest.approx(1.5, rel=1e-5)
    assert (at[0.5876] - 1) / (at[0.4861] - at[0.6563]) == pytest.approx(12 / 0.4, rel=1e-3)
    assert glass.transmittance.ravel() == pytest.approx([0.9, 0.5, 0.2])
    for nothing in ({"transmission_weight": 0}, {"transmission_dispersion_abbe_number": 0}):
        given = {"transmission_weight": 1, "transmission_dispersion_scale": 1, **nothing}
        assert isinstance(wf.OpenPBR(**given).bsdf, OpenPBRBsdf)


def test_what_does_not_disperse_is_said():
    given = {"transmission_weight": 1, "transmission_dispersion_scale": 1}
    image = wf.Texture([[0.1, 0.8]])
    for more in (
        {"transmission_weight": 0.5},
        {"coat_weight": 0.1},
        {"geometry_thin_walled": True},
        {"specular_ior": image},
        {"fuzz_weight": image},
    ):
        with pytest.warns(UserWarning, match="transmission_dispersion_scale is left out"):
            assert isinstance(wf.OpenPBR(**{**given, **more}).bsdf, OpenPBRBsdf)
    for name, wrong in (("scale", 1.5), ("abbe_number", -1)):
        with pytest.raises(wf.SceneError, match=f"OpenPBR transmission_dispersion_{name}"):
            wf.OpenPBR(**{f"transmission_dispersion_{name}": wrong})


def test_emission_and_opacity():
    lamp = wf.OpenPBR(emission_luminance=3, emission_color=(1, 0.5, 0.2), geometry_opacity=0.4)
    assert lamp.emission.ravel() == pytest.approx([3, 1.5, 0.6])
    assert lamp.opacity.constant == pytest.approx(0.4)
    image = wf.Texture([[0.1, 0.8], [0.8, 0.1]], filter="nearest")
    glow = wf.OpenPBR(emission_luminance=2, emission_color=image).emission
    assert glow.limits() == pytest.approx((0.2, 1.6))
    quad = wf.Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0), material=wf.OpenPBR(
        base_weight=0, specular_weight=0, emission_luminance=2, emission_color=image
    ))  # fmt: skip
    camera = wf.Camera.look_at((0, 0, 5), (0, 0, 0), fov=10, size=(2, 2))
    seen = wf.render(wf.Scene(quad, camera=camera), spp=4).rgb[..., 0]
    assert sorted(seen.ravel()) == pytest.approx([0.2, 0.2, 1.6, 1.6], rel=1e-4)


def test_subsurface_is_one_warning():
    with pytest.warns(UserWarning, match="subsurface scattering is approximated") as said:
        wf.OpenPBR(subsurface_weight=0.5)
    assert len(said) == 1


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"transmission_depth": -1}, "OpenPBR transmission_depth is -1; it must be at least 0"),
        ({"emission_luminance": -1}, "OpenPBR emission_luminance"),
        ({"emission_luminance": 1, "emission_color": -1}, "OpenPBR emission_color"),
        ({"transmission_depth": 1, "transmission_scatter": -1}, "OpenPBR transmission_scatter"),
        ({"transmission_depth": 1, "transmission_color": wf.Texture([[0.5]])}, "is a texture"),
        ({"base_color": 2}, "base_color"),
    ],
)
def test_wrong_parameters(given, message):
    with pytest.raises(wf.SceneError, match=message):
        wf.OpenPBR(**given)
    with pytest.raises(TypeError, match="base_color"):
        wf.OpenPBR(base_colour=1)
