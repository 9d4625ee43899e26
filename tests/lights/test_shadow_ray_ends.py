"""Where shadow rays end: something 1e-5 of the distance before a light blocks it, what is behind does not."""

import pytest
import scenes
from significance import render

import wavefront as wf

CLOSE = 2e-5  # of the distance: rounding takes less than 2e-6


def floor_below(light, *shapes: wf.Shape) -> float:
    """The brightness of the floor at the origin, one unit below the light."""
    camera = scenes.probe((0, 0, 0), scenes.EYE)
    lights = [] if isinstance(light, wf.Mesh) else [light]
    emitting = [light] if isinstance(light, wf.Mesh) else []
    scene = wf.Scene([scenes.floor(), *emitting, *shapes], lights, camera)
    return float(render(scene, 4, max_bounces=1, integrator="direct_simple").rgb.mean())


def sheet(height: float) -> wf.Mesh:
    """A black square above the origin."""
    return wf.Rectangle((-0.5, height, -0.5), (1, 0, 0), (0, 0, 1), material=scenes.BLACK)


LIGHTS = {
    "point": lambda: wf.PointLight((0, 1, 0), 3),
    "spot": lambda: wf.SpotLight((0, 1, 0), 3, target=(0, 0, 0)),
    "rectangle": lambda: scenes.panel((-0.1, -0.1), (0.1, 0.1), 1),
}


@pytest.mark.parametrize("name", LIGHTS)
def test_shadow_rays_reach_the_light(name: str) -> None:
    light = LIGHTS[name]()
    free = floor_below(light)
    assert free > 0
    assert floor_below(light, sheet(1 - CLOSE)) == 0
    assert floor_below(light, sheet(1 - 5e-4)) == 0
    # not behind it; a light with an area has its own surface between
    assert floor_below(light, sheet(1 + CLOSE)) == pytest.approx(free, rel=1e-6)


def test_lights_at_infinity_are_blocked_from_anywhere() -> None:
    sun = wf.DirectionalLight((0, -1, 0), 3)
    assert floor_below(sun) > 0
    assert floor_below(sun, sheet(300.0)) == 0
