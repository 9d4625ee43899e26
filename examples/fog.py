"""A street lamp in fog: posts cut shafts of shadow into its light.

python examples/fog.py [out.png] [--spp 64] [--size 640]
"""

from __future__ import annotations

import argparse

import wavefront as wf

FOG = wf.Medium(absorption=0.01, scattering=0.05, phase=wf.HenyeyGreenstein(0.6))
IRON = wf.Conductor.named("iron", roughness=0.4)
STONE = wf.Diffuse(0.25)


def street(width: int) -> wf.Scene:
    """Return a lamp on a post, a fence before it, and a house with a window that is lit."""
    road = wf.Rectangle((-40, 0, 40), (80, 0, 0), (0, 0, -80), material=STONE)
    post = wf.Capsules([(0, 0, 0), (0, 4, 0)], [(0, 4, 0), (0, 4.2, 0.8)], 0.06, material=IRON)
    lamp = wf.Sphere((0, 3.95, 0.8), 0.16, emission=(230, 150, 70), material=wf.Diffuse(0))
    shade = wf.Disk((0, 4.13, 0.8), (0, 1, 0), 0.45, material=IRON)
    fence = [wf.Box((-2.4 + 0.6 * k, 1, 2.4), (0.25, 2, 0.06), material=STONE) for k in range(9)]
    house = wf.Box((-5, 3, -6), (5, 6, 2), material=STONE)
    window = wf.Rectangle(
        (-5.5, 2.4, -4.99), (1, 0, 0), (0, 1.4, 0), emission=(4, 2.4, 1), material=wf.Diffuse(0)
    )
    camera = wf.Camera.look_at((3.2, 1.2, 9.5), (-0.4, 2.3, 0), fov=40, size=(width, width * 3 // 4))
    return wf.Scene([road, post, lamp, shade, *fence, house, window], camera=camera, medium=FOG)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", nargs="?", default="fog.png")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--size", type=int, default=640)
    options = parser.parse_args()
    wf.render(street(options.size), options.spp, max_bounces=8).save(options.output, exposure=1.5)
    print(f"wrote {options.output}")
