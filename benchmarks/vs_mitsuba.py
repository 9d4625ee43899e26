"""Nori's Cornell box with a mirror and a glass sphere, beside the same scene in Mitsuba 3.

python benchmarks/vs_mitsuba.py --data DATA [--spp 256] [--size 400x300] [--out vs_mitsuba.png]

Needs `pip install -e '.[bench]'` and the scene's obj files in DATA/cornell. Prints the mean of
each channel on both sides, and writes ours, Mitsuba's and ten times their difference, in a row.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np

import wavefront as wf

ORIGIN, TARGET = (0, 0.919769, 5.41159), (0, 0.893051, 4.41198)
FOV_ACROSS = 27.7856  # degrees
RADIANCE = (40.0, 40.0, 40.0)
DIFFUSE = {
    "walls": (0.725, 0.71, 0.68),
    "leftwall": (0.630, 0.065, 0.05),
    "rightwall": (0.161, 0.133, 0.427),
    "light": (0.5, 0.5, 0.5),
}


def our_scene(folder: Path, size: tuple[int, int]) -> wf.Scene:
    """Load the parts with wavefront."""
    shapes = [wf.load_mesh(folder / f"{name}.obj", wf.Diffuse(color)) for name, color in DIFFUSE.items()]
    shapes[-1].emission = np.array(RADIANCE, np.float32).reshape(3, 1)
    shapes.append(wf.load_mesh(folder / "sphere1.obj", wf.Mirror()))
    shapes.append(wf.load_mesh(folder / "sphere2.obj", wf.Dielectric(1.5)))
    half = np.tan(np.radians(FOV_ACROSS) / 2) * size[1] / size[0]
    camera = wf.Camera.look_at(ORIGIN, TARGET, fov=float(np.degrees(2 * np.arctan(half))), size=size)
    return wf.Scene(shapes, camera=camera)


def mitsuba_scene(mi: Any, folder: Path, size: tuple[int, int], max_depth: int) -> Any:
    """Describe the same parts to Mitsuba as a dict."""
    scene: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": max_depth},
        "sensor": {
            "type": "perspective",
            "fov": FOV_ACROSS,
            "fov_axis": "x",
            "to_world": mi.ScalarTransform4f().look_at(origin=ORIGIN, target=TARGET, up=(0, 1, 0)),
            "film": {
                "type": "hdrfilm",
                "width": size[0],
                "height": size[1],
                "rfilter": {"type": "box"},
                "pixel_format": "rgb",
            },
        },
    }
    for name, color in DIFFUSE.items():
        diffuse = {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(color)}}
        scene[name] = {
            "type": "obj",
            "filename": str(folder / f"{name}.obj"),
            "bsdf": {"type": "twosided", "bsdf": diffuse},
        }
    scene["light"]["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": list(RADIANCE)}}
    scene["mirror"] = {"type": "obj", "filename": str(folder / "sphere1.obj"), "bsdf": {"type": "conductor"}}
    glass = {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0}
    scene["glass"] = {"type": "obj", "filename": str(folder / "sphere2.obj"), "bsdf": glass}
    return mi.load_dict(scene)


def compare(
    folder: Path, size: tuple[int, int], spp: int, max_bounces: int, variant: str, accel: str
) -> tuple[wf.Image, np.ndarray]:
    """Render both sides, print means and times, and return the pictures."""
    import mitsuba as mi

    mi.set_variant(variant)
    begin = time.perf_counter()
    ours = wf.render(our_scene(folder, size), spp, max_bounces=max_bounces, accel=accel, branches=1)
    middle = time.perf_counter()
    theirs = np.array(mi.render(mitsuba_scene(mi, folder, size, max_bounces + 1), spp=spp))
    end = time.perf_counter()
    print(f"{size[0]}x{size[1]}, {spp} spp, max_bounces {max_bounces}")
    print(
        f"wavefront ({ours.metadata['accelerator']}) {middle - begin:.1f} s; {variant} {end - middle:.1f} s"
    )
    print("channel  wavefront   mitsuba     ratio")
    for channel, a, b in zip("RGB", ours.rgb.mean((0, 1)), theirs.mean((0, 1)), strict=True):
        print(f"{channel}        {a:.6f}   {b:.6f}   {a / b:.5f}")
    return ours, theirs


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="folder that holds cornell/*.obj")
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--size", default="400x300")
    parser.add_argument("--max-bounces", type=int, default=12)
    parser.add_argument("--variant", default="scalar_rgb")
    parser.add_argument("--accel", default="auto")
    parser.add_argument("--out", default="vs_mitsuba.png")
    options = parser.parse_args()
    width, height = (int(part) for part in options.size.split("x"))
    mine, other = compare(
        options.data / "cornell",
        (width, height),
        options.spp,
        options.max_bounces,
        options.variant,
        options.accel,
    )
    difference = np.abs(mine.rgb - other) * 10
    wf.Image(np.concatenate([mine.rgb, other, difference], 1).astype(np.float32), options.spp).save(
        options.out
    )
    print(f"wrote {options.out}: wavefront, mitsuba, ten times the difference")
