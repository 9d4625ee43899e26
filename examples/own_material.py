"""A material of your own in about 20 lines: a retro-reflector, as on road signs and bicycles.

It sends light back to where it came from. The class gives the three methods of the contract, a
checker proves them right, and a road in the light of a headlight shows what it does.

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


def dusk(rows: int = 64) -> np.ndarray:
    """Return the radiance of the sky after sunset, (rows, 2, 3): orange at the horizon, dark below it."""
    height = np.cos(np.pi * (np.arange(rows) + 0.5) / rows)[:, None]
    blue, orange = np.array([0.03, 0.06, 0.16]), np.array([0.55, 0.24, 0.10])
    colors = np.where(height > 0, blue + orange * np.exp(-7 * height.clip(0)), 0.01)
    return np.repeat(colors[:, None], 2, axis=1)


def road_at_dusk(size: int) -> wf.Scene:
    """Return pairs of balls along a road, matte ones on the left and retro-reflecting on the right."""
    orange = (0.95, 0.35, 0.05)
    ground = wf.Rectangle((-400, 0, 4), (800, 0, 0), (0, 0, -800), material=wf.Diffuse((0.16, 0.2, 0.1)))
    road = wf.Rectangle((-2.9, 0.01, 4), (5.8, 0, 0), (0, 0, -800), material=wf.Diffuse(0.3), name="road")
    shapes = [ground, road]
    paint = wf.Diffuse(0.7)
    shapes += [
        wf.Rectangle((-0.09, 0.02, z), (0.18, 0, 0), (0, 0, -2), material=paint) for z in range(-2, -80, -4)
    ]
    for z in (-3, -6.5, -11, -18, -30):
        shapes += [
            wf.Sphere((-1.9, 0.7, z), 0.7, material=wf.Diffuse(orange)),
            wf.Sphere((1.9, 0.7, z), 0.7, material=RetroReflector(orange, exponent=40)),
        ]
    headlight = wf.PointLight((0, 1.9, 2.2), intensity=16)
    camera = wf.Camera.look_at((0, 2.1, 3), (0, 1.0, -6), fov=46, size=(size, size * 5 // 8))
    return wf.Scene(shapes, [headlight, wf.Environment(dusk())], camera)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="A retro-reflecting material.")
    parser.add_argument("output", nargs="?", default="own_material.png")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--size", type=int, default=400)
    options = parser.parse_args()
    print(wf.testing.check_bsdf(RetroReflector((0.95, 0.35, 0.05), exponent=40), samples=200_000))
    wf.render(road_at_dusk(options.size), options.spp).save(options.output, tone="agx")
    print(f"wrote {options.output}")
