"""The figures of a course on path tracing, each made by one call of the library and a few lines around it.

Change a scene, a number or an estimator, and look at what becomes of the figure. It needs matplotlib
(pip install matplotlib). Each takes at most two minutes at the default size.

- paths: direct light alone (n = 0), and 10, 100, 1000 paths for each pixel, without gamma and with it
- estimators: naive, direct and full light at equal time, and how their error falls with samples
- bounces: light by how often it has been scattered
- lobes: BSDFs from diffuse to mirror
- samples: where the samples of a pixel and of a hemisphere lie
- roulette: Russian roulette on and off at equal time
- plates: light samples, BSDF samples, both, and their weights (after E. Veach)

python examples/course_figures.py [out.png] [--spp 1000] [--size 160] [--figure paths]
"""

from __future__ import annotations

import argparse

import imageio.v3 as iio
import matplotlib
import numpy as np
from course_spheres import course_spheres
from estimators import courtyard

import wavefront as wf
from wavefront import integrators
from wavefront.sampling.sampler import make_sampler

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # after the choice of what draws

PLAIN = {"branches": 1, "reuse": False, "denoise": False, "progress": False}  # each path is a sample


def paths(spp: int, size: int) -> plt.Figure:
    """Show the room of spheres with more and more paths; `spp=0` would be direct light, which has a name."""
    scene, counts = course_spheres(size), (0, *(max(spp // k, 1) for k in (100, 10, 1)))
    pictures = [wf.render(scene, n or 16, integrator="full" if n else "direct_mis", **PLAIN) for n in counts]
    figure, axes = plt.subplots(2, 4, figsize=(12, 6.4))
    for column, (n, picture) in enumerate(zip(counts, pictures, strict=True)):
        show(axes[0, column], np.clip(picture.rgb, 0, 1), f"n = {n}{'' if n else ': direct light'}")
        show(axes[1, column], picture.to_uint8(tone="none"))
    axes[0, 0].set_ylabel("radiance as it is")
    axes[1, 0].set_ylabel("with gamma")
    return figure


def estimators(spp: int, size: int) -> plt.Figure:
    """Show three estimators after the same time, and their errors, which fall as 1/√n."""
    scene, seconds = courtyard(size), spp / 250
    figure, axes = plt.subplots(1, 4, figsize=(14, 3.9), width_ratios=(1, 1, 1, 1.25))
    for column, name in enumerate(("naive", "direct_mis", "full")):
        picture = wf.render(scene, seconds=seconds, integrator=name, **PLAIN)
        title = f"{name}: {picture.spp:.0f} paths in {seconds:g} s"
        show(axes[column], picture.to_uint8(), title)
        error_against_samples(axes[3], courtyard(size // 4), name, spp)
    axes[3].set(xscale="log", yscale="log", xlabel="paths per pixel", ylabel="root of the mean squared error")
    axes[3].legend()
    return figure


def error_against_samples(axes: plt.Axes, scene: wf.Scene, name: str, spp: int) -> None:
    """Draw how the difference of two independent pictures falls, and the slope of a line through it."""
    counts = [n for n in (1, 4, 16, 64, 256) if n <= max(spp // 4, 4)]
    errors = []
    for n in counts:
        given = {"integrator": name, "sampler": "independent", **PLAIN}  # Sobol points gain more with each
        one, other = (wf.render(scene, n, seed=k, **given).rgb for k in (1, 2))
        errors.append(np.sqrt(((one - other) ** 2).mean() / 2))
    slope = np.polyfit(np.log(counts), np.log(errors), 1)[0]
    axes.plot(counts, errors, "o-", label=f"{name}: slope {slope:.2f}")


def bounces(spp: int, size: int) -> plt.Figure:
    """Show the light that is seen directly, and after 1, 2, 3 and 4 scattering events, and the sum."""
    light = wf.bounces(course_spheres(size), spp=max(spp // 10, 1), most=4, progress=False)
    figure, axes = plt.subplots(2, 3, figsize=(12, 8.4))
    titles = ("0 events", "1: direct light", "2 events", "3 events", "4 events", "the sum")
    for axis, part, title in zip(axes.flat, [*light, light.sum(0)], titles, strict=True):
        show(axis, wf.Image(part, 1).to_uint8(tone="none"), title)
    return figure


def lobes(spp: int, size: int) -> plt.Figure:
    """Draw f, f·cos and the density of six BSDFs around a point."""
    shown = {
        "Diffuse": wf.Diffuse(0.8),
        "Plastic, roughness 0.3": wf.Plastic((0.2, 0.4, 0.8), roughness=0.3),
        "Conductor, roughness 0.6": wf.Conductor.named("gold", roughness=0.6),
        "Conductor, roughness 0.3": wf.Conductor.named("gold", roughness=0.3),
        "Conductor, roughness 0.1": wf.Conductor.named("gold", roughness=0.1),
        "Dielectric, roughness 0.3": wf.Dielectric(1.5, roughness=0.3),
    }
    figure, axes = plt.subplots(2, 3, figsize=(12, 8), subplot_kw={"projection": "polar"})
    for axis, (name, bsdf) in zip(axes.flat, shown.items(), strict=True):
        bsdf.plot((0.6, 0, 0.8), axis)
        axis.set_title(name)
    return figure


def samples(spp: int, size: int) -> plt.Figure:
    """Draw 64 samples of a pixel, and the directions of a hemisphere that cosine-weighted sampling makes."""
    figure, axes = plt.subplots(2, 3, figsize=(10.5, 7.2))
    number, pixel = np.arange(64, dtype=np.uint32), np.zeros(64, np.uint32)
    for column, name in enumerate(("independent", "sobol", "bluenoise")):
        x, y = points = make_sampler(name, 1, 64).draw_2d(pixel, number, 0, 0)
        axes[0, column].plot(x, y, ".")
        axes[0, column].set(title=name, xlim=(0, 1), ylim=(0, 1), aspect="equal", xticks=(), yticks=())
        x, y, _ = wf.warp.cosine_hemisphere(points)
        axes[1, column].plot(x, y, ".")
        axes[1, column].add_patch(plt.Circle((0, 0), 1, fill=False))
        axes[1, column].set(xlim=(-1.05, 1.05), ylim=(-1.05, 1.05), aspect="equal", xticks=(), yticks=())
    axes[0, 0].set_ylabel("pixel")
    axes[1, 0].set_ylabel("hemisphere, from above")
    return figure


def roulette(spp: int, size: int) -> plt.Figure:
    """Show the same time with Russian roulette from the first event on, and without."""
    scene, seconds = course_spheres(size), spp / 50
    figure, axes = plt.subplots(1, 2, figsize=(11, 5.8))
    for axis, (after, name) in zip(axes, ((1, "with roulette"), (False, "without")), strict=True):
        given = {"seconds": seconds, "max_bounces": 24, "roulette": after, **PLAIN}
        picture = wf.render(scene, **given)
        noise = picture.metadata["noise"]
        show(axis, picture.to_uint8(tone="none"), f"{name}: {picture.spp:.0f} paths, error {noise:.2%}")
    figure.suptitle(f"{seconds:g} s each")
    return figure


def plates(spp: int, size: int) -> plt.Figure:
    """Show four plates that reflect four lamps, by three ways to sample, and what each brings."""
    scene, n = veach_plates(size), max(spp // 20, 1)
    figure, axes = plt.subplots(2, 2, figsize=(12, 8.6))
    ways = {"light samples": ("direct_simple", 2), "BSDF samples": ("naive", 1), "both": ("direct_mis", 2)}
    for axis, (title, (name, most)) in zip(axes.flat, ways.items(), strict=False):
        given = {"integrator": name, "max_bounces": min(most, 1), **PLAIN}
        show(axis, wf.render(scene, n, **given).to_uint8(), title)
    given = {"integrator": by_way, "max_bounces": 1, "aovs": ("noted.light", "noted.bsdf"), **PLAIN}
    layers = wf.render(scene, 4 * n, **given).layers
    light, bsdf = (layers[f"noted.{name}"].mean(2) for name in ("light", "bsdf"))
    part = light / np.maximum(light + bsdf, 1e-6)
    colors = np.stack([part, 0.3 * np.ones_like(part), 1 - part], -1) * ((light + bsdf) > 0)[..., None]
    show(axes[1, 1], colors, "weights: red of light samples, blue of BSDF samples")
    return figure


def by_way(scene, paths, sampler, max_bounces):  # type: ignore[no-untyped-def]
    """Estimate direct light by both ways, and note what each of them brings."""
    light, bsdf = np.zeros((2, 3, len(paths)), np.float32)
    first, hits = integrators.intersect_and_compact(scene, paths, sampler, 0, bsdf, mis=True)
    bsdf[:] = 0  # emission that is seen directly is no matter of weights
    if len(first):
        shade = integrators.prepare_shading(scene, first, hits)
        found = integrators.direct(scene, first, shade, sampler, 0, mis=True)
        integrators.accumulate(light, first, found)
        left = integrators.bounce_sample(first, shade, sampler, 0)
        integrators.intersect_and_compact(scene, left, sampler, 1, bsdf, mis=True)
    integrators.note(paths, "light", light)
    integrators.note(paths, "bsdf", bsdf)
    return light + bsdf


def veach_plates(size: int) -> wf.Scene:
    """Return four plates from rough to smooth, which reflect lamps from small to large."""
    shapes: list[wf.Shape] = [
        wf.Rectangle((-9, -3, 8), (18, 0, 0), (0, 0, -18), material=wf.Diffuse(0.5)),
        wf.Rectangle((-9, -3, -6), (18, 0, 0), (0, 12, 0), material=wf.Diffuse(0.5)),
    ]
    eye, middle = np.array([0.0, 2, 14]), np.array([0.0, 3.2, -2.5])
    for number, roughness in enumerate((0.07, 0.14, 0.25, 0.4)):
        at = np.array([0, -1.9 + 0.75 * number**1.15, 1.8 - 1.6 * number])
        toward = (eye - at) / np.linalg.norm(eye - at) + (middle - at) / np.linalg.norm(middle - at)
        up = np.cross((1, 0, 0), toward) / np.linalg.norm(toward)  # lies in the plate, away from the eye
        material = wf.Conductor.named("aluminium", roughness=roughness)
        shapes.append(wf.Rectangle(at - (3.6, 0, 0) + 0.55 * up, -1.1 * up, (7.2, 0, 0), material=material))
    for x, radius in zip((-3.3, -1.1, 1.1, 3.3), (0.05, 0.15, 0.4, 0.8), strict=True):
        shapes.append(wf.Sphere((x, 3.2, -2.5), radius, emission=0.5 / radius**2))
    camera = wf.Camera.look_at(eye, (0, 0.6, 0), fov=33, size=(round(1.5 * size), size))
    return wf.Scene(shapes, camera=camera)


def show(axes: plt.Axes, picture: np.ndarray, title: str = "") -> None:
    """Show a picture without scales."""
    axes.imshow(picture)
    axes.set(title=title, xticks=(), yticks=())


FIGURES = {each.__name__: each for each in (paths, estimators, bounces, lobes, samples, roulette, plates)}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Figures of a course on path tracing.")
    parser.add_argument("output", nargs="?", default="course_figures.png")
    parser.add_argument("--spp", type=int, default=1000)
    parser.add_argument("--size", type=int, default=160)
    parser.add_argument("--figure", choices=FIGURES, default="paths")
    options = parser.parse_args()
    figure = FIGURES[options.figure](options.spp, options.size)
    figure.tight_layout()
    figure.canvas.draw()
    iio.imwrite(options.output, np.asarray(figure.canvas.buffer_rgba())[..., :3])
    print(f"wrote {options.output}")
