"""A material of your own in about 20 lines: a retro-reflector, as on road signs and bicycles.

It sends light back to where it came from. The class gives the three methods of the contract, a
checker proves them right, and a picture by the light of a headlight shows what it does.

python examples/own_material.py [out.png] [--spp 64] [--size 400]
"""

from __future__ import annotations

import argparse

import numpy as np

import wavefront as wf
from wavefront.arrays.elementary import exp, log, sin_cos_turns


class RetroReflector(wf.Bsdf):
    """A lobe (n+1)/2π · cosⁿα around the direction `wo` itself, α being the angle between wi and wo."""

    def __init__(self, reflectance: float | tuple[float, float, float], exponent: float = 100.0) -> None:
        self.reflectance = np.broadcast_to(np.float32(reflectance), 3).reshape(3, 1)
        self.exponent = np.float32(exponent)

    def f(self, wo, wi):
        return self.reflectance * self.pdf(wo, wi)

    def pdf(self, wo, wi):
        cos = np.maximum(wf.vec.dot(wo, wi), np.float32(1e-6))
        lobe = (self.exponent + 1) / np.float32(2 * np.pi) * exp(self.exponent * log(cos))
        return np.where(wi[2] > 0, lobe, np.float32(0))

    def sample_f(self, wo, u):
        cos = exp(log(1 - u[0]) / (self.exponent + 1))
        radius = np.sqrt(np.maximum(1 - cos * cos, 0))
        sin_phi, cos_phi = sin_cos_turns(u[1])
        wi = wf.Frame.from_normal(wo).to_world(np.stack([radius * cos_phi, radius * sin_phi, cos]))
        pdf = self.pdf(wo, wi)
        weight = self.reflectance * np.where(pdf > 0, wi[2], np.float32(0))  # f · cosθ / pdf
        return wf.BsdfSample(wi, weight, pdf, np.zeros(len(pdf), bool))


def road_at_night(size: int) -> wf.Scene:
    """Return pairs of balls along a road, matte ones on the left and retro-reflecting on the right."""
    orange = (0.95, 0.35, 0.05)
    shapes = [wf.Rectangle((-20, 0, 2), (40, 0, 0), (0, 0, -80), material=wf.Diffuse(0.2), name="road")]
    for z in (-3, -6, -10, -16):
        shapes += [
            wf.Sphere((-1.7, 0.6, z), 0.6, material=wf.Diffuse(orange)),
            wf.Sphere((1.7, 0.6, z), 0.6, material=RetroReflector(orange, exponent=40)),
        ]
    headlight = wf.PointLight((0, 2, 2.2), intensity=22)
    camera = wf.Camera.look_at((0, 2.4, 2), (0, 0.4, -6), fov=50, size=(size, size * 5 // 8))
    return wf.Scene(shapes, [headlight], camera)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="A retro-reflecting material.")
    parser.add_argument("output", nargs="?", default="own_material.png")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--size", type=int, default=400)
    options = parser.parse_args()
    print(wf.testing.check_bsdf(RetroReflector((0.95, 0.35, 0.05), exponent=40), samples=200_000))
    wf.render(road_at_night(options.size), options.spp).save(options.output)
    print(f"wrote {options.output}")
