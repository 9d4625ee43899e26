"""One scene under six skies: overcast, the same all around, clear; by measured irradiances; a low sun.

python examples/skies.py [out.png] [--spp 32] [--size 320]
"""

from __future__ import annotations

import argparse

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import wavefront as wf

SUN = -0.45, 0.5, -0.6
SKIES = {
    "CIE 1, overcast": wf.Sky.cie(1, horizontal=3),
    "CIE 5, the same all around": wf.Sky.cie(5, horizontal=3),
    "CIE 12, clear": wf.Sky.cie(12, SUN, horizontal=1, direct_normal=4.5),
    "Perez, hazy": wf.Sky.perez(180, 260, SUN, illuminance=(900, 1300)),
    "Perez, clear": wf.Sky.perez(750, 100, SUN, illuminance=(3100, 500)),
    "CIE 13, low sun, in color": wf.Sky.cie(
        13, (-0.6, 0.15, -1), horizontal=(0.8, 0.95, 1.4), direct_normal=(4.5, 2.6, 1.2)
    ),
}


def scene(sky: wf.Sky, size: int) -> wf.Scene:
    """Return a few shapes on a level ground."""
    shapes = [
        wf.Disk((0, 0, 0), (0, 1, 0), 500, material=wf.Diffuse(0.25), name="ground"),
        wf.Sphere((0, 1, 0), 1, material=wf.Plastic((0.75, 0.2, 0.08), roughness=0.2)),
        wf.Sphere((2.2, 0.7, 0.5), 0.7, material=wf.Mirror(0.9)),
        wf.Box((-2.1, 0.8, -0.4), (1.3, 1.6, 1.3), material=wf.Diffuse((0.2, 0.4, 0.6))),
    ]
    camera = wf.Camera.look_at((2.5, 1.7, 7.5), (0.1, 1.1, 0), fov=38, size=(size, size * 2 // 3))
    return wf.Scene(shapes, [sky], camera)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="One scene under six skies.")
    parser.add_argument("output", nargs="?", default="skies.png")
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--size", type=int, default=320, help="width of each of the six pictures")
    options = parser.parse_args()
    pictures = []
    for name, sky in SKIES.items():
        codes = wf.render(scene(sky, options.size), options.spp).to_uint8(gamma="srgb", tone="agx_punchy")
        picture = Image.fromarray(codes)
        draw, at = ImageDraw.Draw(picture), options.size // 40
        font = ImageFont.load_default(max(options.size // 20, 8))
        draw.text((at, at), name, "white", font, stroke_width=2, stroke_fill="black")
        pictures.append(np.asarray(picture))
    rows = [np.concatenate(pictures[first : first + 3], axis=1) for first in (0, 3)]
    Image.fromarray(np.concatenate(rows)).save(options.output)
    print(f"wrote {options.output}")
