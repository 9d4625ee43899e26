"""The scene of a first ray tracing course: a room whose walls are enormous spheres.

Six spheres so large that they look flat are the floor, the ceiling and the walls. Between them
stand a matte, a mirror and a glass sphere, lit by one point light.

python examples/course_spheres.py [out.png] [--spp 100] [--size 512]
"""

from __future__ import annotations

import argparse

import wavefront as wf

FAR = 1000.0  # from the middle of the room to the center of each wall


def wall(axis: int, side: int, distance: float, color: tuple[float, float, float]) -> wf.Sphere:
    """Return a sphere that touches the plane at `distance` along an axis, on one side of the room."""
    center = [0.0, 0.0, 0.0]
    center[axis] = side * FAR
    return wf.Sphere(center, FAR - distance, material=wf.Diffuse(color))


def course_spheres(size: int = 512) -> wf.Scene:
    """Return the room: balls of radius 10 on a floor at y = -10, seen from z = 55."""
    walls = [
        wall(1, -1, 10, (0.60, 0.60, 0.60)),  # floor
        wall(1, +1, 50, (0.85, 0.85, 0.85)),  # ceiling
        wall(0, -1, 45, (0.75, 0.25, 0.25)),  # left
        wall(0, +1, 45, (0.25, 0.35, 0.75)),  # right
        wall(2, -1, 50, (0.35, 0.70, 0.40)),  # back
        wall(2, +1, 75, (0.70, 0.70, 0.70)),  # behind the camera
    ]
    balls = [
        wf.Sphere((-21, 0, -4), 10, material=wf.Diffuse((0.9, 0.6, 0.2)), name="matte"),
        wf.Sphere((0, 0, -18), 10, material=wf.Mirror(0.95), name="mirror"),
        wf.Sphere((20, 0, -4), 10, material=wf.Dielectric(1.5), name="glass"),
    ]
    light = wf.PointLight((-15, 35, 25), intensity=3500)
    camera = wf.Camera.look_at((0, 8, 55), (0, 5, 0), fov=60, size=(size, size))
    return wf.Scene([*walls, *balls], [light], camera)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="A room whose walls are spheres.")
    parser.add_argument("output", nargs="?", default="course_spheres.png")
    parser.add_argument("--spp", type=int, default=100)
    parser.add_argument("--size", type=int, default=512)
    options = parser.parse_args()
    wf.render(course_spheres(options.size), options.spp).save(options.output, tone="agx", exposure=-0.4)
    print(f"wrote {options.output}")
