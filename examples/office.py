"""An office at noon: as a camera sees it, and its luminance in false color with a scale in cd/m².

python examples/office.py [out.png] [--spp 64] [--size 400]
"""

from __future__ import annotations

import argparse

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image as Picture

import wavefront as wf

WHITE, WALL, FLOOR = wf.Diffuse(0.8), wf.Diffuse(0.6), wf.Diffuse((0.25, 0.22, 0.2))
WOOD, DARK, PAPER = wf.Diffuse((0.45, 0.3, 0.18)), wf.Diffuse(0.08), wf.Diffuse(0.85)
SUN = 0.45, 0.85, 0.5  # noon in summer; the window is in the wall x = 5


def office(size: int) -> wf.Scene:
    """Return a room of 5 × 2.8 × 4 m with a window, two desks, screens and paper; meters, y is up."""
    shapes = [
        wf.Rectangle((0, 0, 4), (5, 0, 0), (0, 0, -4), material=FLOOR),
        wf.Rectangle((0, 2.8, 0), (5, 0, 0), (0, 0, 4), material=WHITE),
        wf.Rectangle((0, 0, 0), (5, 0, 0), (0, 2.8, 0), material=WALL),
        wf.Rectangle((0, 0, 4), (0, 0, -4), (0, 2.8, 0), material=WALL),
        wf.Rectangle((0, 0, 4), (0, 2.8, 0), (5, 0, 0), material=WALL),
        wf.Box((5.1, 0.4, 2), (0.2, 0.8, 4), material=WALL),  # the wall below the window, above and beside it
        wf.Box((5.1, 2.6, 2), (0.2, 0.4, 4), material=WALL),
        wf.Box((5.1, 1.6, 0.2), (0.2, 1.6, 0.4), material=WALL),
        wf.Box((5.1, 1.6, 3.8), (0.2, 1.6, 0.4), material=WALL),
        wf.Box((5.1, 1.6, 2), (0.08, 1.6, 0.06), material=WHITE),
    ]
    shapes += [
        wf.Rectangle((5.2, 0, 60), (200, 0, 0), (0, 0, -120), material=wf.Diffuse((0.12, 0.2, 0.06))),  # lawn
        wf.Box((70, 3, 2), (10, 6, 90), material=wf.Diffuse((0.09, 0.14, 0.05))),  # trees at its end
    ]
    for x in (1.5, 3.6):
        shapes += [
            wf.Box((x, 0.73, 0.9), (1.5, 0.04, 0.8), material=WOOD),
            wf.Box((x, 1.08, 0.65), (0.6, 0.36, 0.03), material=DARK),
            wf.Box((x, 0.83, 0.65), (0.06, 0.16, 0.03), material=DARK),
            wf.Box((x, 0.752, 1.1), (0.21, 0.004, 0.3), material=PAPER),
            *(wf.Box((x + dx, 0.36, 0.9), (0.05, 0.7, 0.7), material=DARK) for dx in (-0.7, 0.7)),
            wf.Rectangle((x - 0.28, 0.92, 0.67), (0.56, 0, 0), (0, 0.32, 0), material=DARK,
                         emission=wf.from_photometric(150, (0.8, 0.9, 1))),
        ]  # fmt: skip
    sky = wf.Sky.cie(
        12,
        SUN,
        horizontal=wf.from_photometric(15_000, (0.8, 0.95, 1.3)),
        direct_normal=wf.from_photometric(80_000, (1, 0.95, 0.85)),
    )
    camera = wf.Camera.look_at((0.5, 1.6, 3.7), (3.3, 1.1, 0.6), fov=60, size=(size, size * 3 // 4))
    return wf.Scene(shapes, [sky], camera)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="An office at noon, and its luminance.")
    parser.add_argument("output", nargs="?", default="office.png")
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--size", type=int, default=400, help="width of each of the two pictures")
    options = parser.parse_args()
    image = wf.render(office(options.size), options.spp)
    figure = Figure(figsize=(12, 4.4), layout="constrained")
    canvas = FigureCanvasAgg(figure)
    seen, coded = figure.subplots(1, 2)
    seen.imshow(image.to_uint8(exposure=wf.exposure(ev100=11.3), gamma="srgb", tone="agx"))
    image.false_color((10, 30_000), axes=coded)
    for axes in (seen, coded):
        axes.set_axis_off()
    canvas.draw()
    Picture.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]).save(options.output)
    print(f"wrote {options.output}")
