"""Things that are not there, put into a photograph.

The photograph is made here, of a desk before a window: a lens, vignetting, grain and an 8-bit file. In its
place take your own, with the camera and the light of the place. The ground under the new things is a
`ShadowCatcher`, so it shows their shadows alone; their own light is that of the photograph.

python examples/photograph.py [out.png] [--spp 64] [--size 600]
"""

from __future__ import annotations

import argparse
import io

import imageio.v3 as iio
import numpy as np
from fruit import wood
from interior import box, cushion
from terrace import knot, noise

import wavefront as wf

LIGHTS = [
    wf.DirectionalLight((0.8, -1.0, -0.45), (3.6, 3.1, 2.5), angle=4),
    wf.Environment((0.42, 0.47, 0.55)),
]


def camera(size: int) -> wf.Camera:
    """Return the camera of the photograph."""
    shape = (size, size * 2 // 3)
    return wf.Camera.look_at((0.5, 2.9, 7.2), (0.1, 0.55, 0), fov=30, size=shape, aperture=0.09, focus=7.4)


def desk() -> list[wf.Shape]:
    """Return what was photographed: a desk, a wall, two books and a mug."""
    colors, heights = wood()
    top = wf.Material(
        wf.Principled(wf.Texture(colors * 1.3), roughness=0.45),
        normal_map=wf.BumpMap(wf.Texture(heights, srgb=False, channel=0), height=0.01),
    )
    plaster = np.array([0.42, 0.47, 0.44]) * (1 + 0.08 * noise((512, 512), 8, 31))[..., None]
    clay = wf.Principled((0.62, 0.60, 0.55), roughness=0.35, clearcoat=0.5)
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 33)
    rim = np.stack([2.3 + 0.43 * np.cos(2 * turn), 1.05 + 0 * turn, -1.7 + 0.43 * np.sin(2 * turn)], 1)
    handle = np.stack([2.7 + 0.33 * np.cos(turn), 0.55 + 0.29 * np.sin(turn), 0 * turn - 1.7], 1)
    return [
        wf.Rectangle((-7, 0, 5), (14, 0, 0), (0, 0, -8.4), material=top),
        wf.Rectangle((-9, -2, -3.4), (18, 0, 0), (0, 9, 0), material=wf.Diffuse(wf.Texture(plaster))),
        cushion((-1.9, 0.16, -1.6), (1.1, 0.16, 0.75), wf.Diffuse((0.10, 0.16, 0.24)), 0.1),
        cushion((-1.8, 0.45, -1.6), (0.95, 0.13, 0.66), wf.Diffuse((0.45, 0.12, 0.08)), 0.1),
        wf.Cylinders([(2.3, 0, -1.7)], [(2.3, 1.05, -1.7)], 0.45, material=clay),
        wf.Cylinders([(2.3, 0.5, -1.7)], [(2.3, 1.05, -1.7)], 0.41, material=clay),
        wf.Capsules(rim[:-1], rim[1:], 0.02, material=clay),
        wf.Disk((2.3, 0.95, -1.7), (0, 1, 0), 0.41, material=wf.Diffuse((0.05, 0.03, 0.02))),
        wf.Capsules(handle[:-1], handle[1:], 0.065, material=clay),
        box((-5.6, 0, -3.2), (-3.6, 3.4, -2.7), wf.Diffuse((0.16, 0.10, 0.06))),
    ]


def photograph(size: int, spp: int) -> bytes:
    """Return the photograph as a jpg file: sRGB, a little dark in the corners, with the grain of a sensor."""
    seen = wf.render(wf.Scene(desk(), LIGHTS, camera(size)), spp, denoise=True).rgb
    y, x = np.mgrid[-1 : 1 : seen.shape[0] * 1j, -1 : 1 : seen.shape[1] * 1j]
    seen = seen * (1 - 0.22 * (x**2 + y**2) / 2)[..., None]
    electrons = np.random.default_rng(32).poisson(seen * 9000) / 9000
    return iio.imwrite(
        "<bytes>", wf.Image(electrons.astype(np.float32)).to_uint8(), extension=".jpg", quality=95
    )


def composed(file: bytes, size: int, spp: int) -> wf.Image:
    """Return the photograph with a knot of copper, a green ball and a die on the desk."""
    with io.BytesIO(file) as stream:
        codes = iio.imread(stream) / 255.0
    behind = codes**2.2  # linear, as colors of a render are
    reflectance = wf.ShadowCatcher((0.30, 0.17, 0.09))  # of the desk, for what it sends onto the things
    ground = wf.Rectangle((-7, 0, 5), (14, 0, 0), (0, 0, -8.4), material=reflectance)
    white, ink = (
        wf.Principled((0.75, 0.73, 0.68), roughness=0.3),
        wf.Principled((0.02, 0.02, 0.02), roughness=0.3),
    )
    dots = [(0.9, 0.7, 0.9), *((0.9 + x, 0.7, 0.9 + z) for x in (-0.17, 0.17) for z in (-0.17, 0.17))]
    shapes = [
        ground,
        knot((-0.45, 0.83, 0.1), 0.27, 0.14, material=wf.Conductor.named("copper", roughness=0.22)),
        cushion((0.9, 0.36, 0.9), (0.35, 0.35, 0.35), white, 0.16),
        *[wf.Sphere(dot, 0.06, material=ink) for dot in dots],
        wf.Sphere(
            (-1.45, 0.36, 1.25), 0.36, material=wf.Principled((0.03, 0.25, 0.16), roughness=0.15, clearcoat=1)
        ),
    ]
    scene = wf.Scene(shapes, LIGHTS, camera(size))
    image = wf.render(scene, spp, background="transparent", denoise=True)
    alpha = wf.Image(image.alpha[..., None].repeat(3, -1)).denoise().rgb
    return wf.Image((image.rgb + behind * (1 - alpha)).astype(np.float32))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Things put into a photograph.")
    parser.add_argument("output", nargs="?", default="photograph.png")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--size", type=int, default=600)
    options = parser.parse_args()
    file = photograph(options.size, options.spp)
    composed(file, options.size, options.spp).save(options.output)
    print(f"wrote {options.output}")
