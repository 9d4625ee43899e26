"""Values and densities of the materials beside Mitsuba 3's, on random pairs of directions.

    python benchmarks/bsdf_vs_mitsuba.py [pairs]

Needs `mitsuba` (extra `[bench]`). Mitsuba's microfacets shadow and mask independently, G1(wo)·G1(wi), as
`shadowing="separable"` here. Differences of models: wavefront draws Beckmann's normals as GGX's, so that
densities differ; Mitsuba's smooth plastic has a fit of the reflectance inside, which is divided out; its
`principled` is `Disney`, with other densities, and `Principled` only as a metal.

The limit holds for 99 % of the pairs. Seen from inside glass a few pairs lie at the critical angle,
where the transmitted part goes to 0 as a square root and float32 leaves neither side many digits:
the largest difference is printed beside.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavefront.arrays.state import SurfaceInteraction
from wavefront.bsdfs import (
    Bsdf,
    Conductor,
    Dielectric,
    Diffuse,
    Disney,
    Mirror,
    Plastic,
    Principled,
    ThinDisney,
)
from wavefront.bsdfs.microfacet import Facets, alpha_of
from wavefront.bsdfs.plastic import part_escaping

LIMIT = 1e-4
OF_TABLES = 1e-3  # of Mitsuba's rough plastic, whose tables sum over 32² normals
Array = np.ndarray


@dataclass
class Row:
    """Relative difference of one quantity over all pairs."""

    material: str
    quantity: str
    difference: float  # of 99 % of the pairs at most
    largest: float
    limit: float = LIMIT


def directions(rng: np.random.Generator, n: int, whole: bool) -> Array:
    """Random unit vectors (3, n), not within 0.01 of the horizon."""
    z = rng.uniform(0.01, 1, n)
    phi = rng.uniform(0, 2 * np.pi, n)
    r = np.sqrt(1 - z * z)
    if whole:
        z *= rng.choice([-1, 1], n)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z]).astype(np.float32)


def surface(wo: Array, inside: bool) -> SurfaceInteraction:
    """Hit points for `bind`."""
    n = wo.shape[1]
    normal = np.repeat(np.array([[0], [0], [1]], np.float32), n, 1)
    zero, index = np.zeros(n, np.float32), np.zeros(n, np.intp)
    at = np.zeros((3, n), np.float32)
    return SurfaceInteraction(at, zero, normal, normal, wo, index, index, np.full(n, inside))


def separable(wo: Array, wi: Array, roughness: float) -> Array:
    """G1(wo)·G1(wi)/G2(wo, wi), (n,)."""
    alpha = alpha_of(np.array([roughness], np.float32))
    so, si = (Facets(alpha).stretched(w).astype(float) for w in (wo, wi))
    zo, zi = np.abs(wo[2]).astype(float), np.abs(wi[2]).astype(float)
    return 2 * (zo * si + zi * so) / ((zo + so) * (zi + si))


def fitted_reflectance(ior: float) -> float:
    """Mitsuba's fit of 1 − `part_escaping` (W. Egan and T. Hilgeman 1973)."""
    eta = 1 / ior
    return -1.4399 * eta**2 + 0.7099 * eta + 0.6681 + 0.0636 / eta


def ask_mitsuba(mi: Any, bsdf: Any, wo: Array, wi: Array, inside: bool) -> tuple[Array, Array]:
    """Mitsuba's value times cosine (3, n) and density (n,); its frame is not turned to wo's side."""
    side = np.array([1, 1, -1 if inside else 1], np.float32)[:, None]
    context, hit = mi.BSDFContext(), mi.SurfaceInteraction3f()
    values, densities = [], []
    for a, b in zip((wo * side).T.tolist(), (wi * side).T.tolist(), strict=True):
        hit.wi = mi.Vector3f(*a)
        direction = mi.Vector3f(*b)
        values.append(list(bsdf.eval(context, hit, direction)))
        densities.append(float(bsdf.pdf(context, hit, direction)))
    return np.array(values).T, np.array(densities)


def row(material: str, quantity: str, ours: Array, theirs: Array, limit: float = LIMIT) -> Row:
    """Differences relative to the value, or to a millionth of the largest value."""
    floor = max(np.abs(theirs).max() * 1e-6, 1e-12)
    difference = np.abs(ours - theirs) / np.maximum(np.abs(theirs), floor)
    return Row(material, quantity, float(np.quantile(difference, 0.99)), float(difference.max()), limit)


def rough(
    mi: Any,
    name: str,
    ours: Bsdf,
    theirs: dict[str, Any],
    n: int,
    *,
    masked: float | None = None,
    times: float = 1.0,
    densities: bool = True,
    limit: float = LIMIT,
) -> list[Row]:
    """Compare value and density of materials that are not deltas.

    The value is multiplied by `times`, and by `separable` where the roughness `masked` is given.
    """
    rng = np.random.default_rng(1)
    material = mi.load_dict(theirs)
    rows = []
    for inside in (False, True) if ours.transmissive else (False,):
        wo, wi = directions(rng, n, False), directions(rng, n, ours.transmissive)
        f, pdf = ours.bind(surface(wo, inside)).evaluate(wo, wi)
        value = f * np.abs(wi[2]).astype(float) * times
        if masked is not None:
            value = value * separable(wo, wi, masked)
        known_value, known_pdf = ask_mitsuba(mi, material, wo, wi, inside)
        label = f"{name}{', inside' if inside else ''}"
        rows.append(row(label, "eval", value, known_value, limit))
        if densities:
            rows.append(row(label, "pdf", pdf, known_pdf, limit))
    return rows


def delta(mi: Any, name: str, ours: Bsdf, theirs: dict[str, Any], n: int) -> list[Row]:
    """Compare direction and weight of delta lobes: the first and the last random number choose both."""
    rng = np.random.default_rng(2)
    material, context, hit = mi.load_dict(theirs), mi.BSDFContext(), mi.SurfaceInteraction3f()
    rows = []
    last = np.nextafter(np.float32(1), np.float32(0))
    for inside in (False, True) if ours.transmissive else (False,):
        side = np.array([1, 1, -1 if inside else 1], np.float32)
        wo = directions(rng, n, False)
        for choice in (np.float32(0), last) if ours.transmissive else (np.float32(0),):
            u = np.full((ours.dimensions, n), choice, np.float32)
            sample = ours.bind(surface(wo, inside)).sample_f(wo, u)
            known_wi, known_weight, known_pdf = [], [], []
            for a in wo.T:
                hit.wi = mi.Vector3f(*(a * side).tolist())
                got, weight = material.sample(context, hit, float(choice), mi.Point2f(0.5, 0.5))
                known_wi.append(list(got.wo))
                known_weight.append(list(weight))
                known_pdf.append(float(got.pdf))
            label = f"{name}{', inside' if inside else ''}, u = {choice:.0f}"
            rows.append(row(label, "direction", sample.wi, (np.array(known_wi) * side).T))
            rows.append(row(label, "weight", sample.weight, np.array(known_weight).T))
            rows.append(row(label, "pdf", sample.pdf, np.array(known_pdf)))
    return rows


def compare(pairs: int = 10_000) -> list[Row]:
    """Compare all materials that Mitsuba has too."""
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    color = {"type": "rgb", "value": [0.9, 0.5, 0.1]}
    eta, k = [0.2, 0.9, 1.4], [3.9, 2.4, 1.6]
    metal = {"eta": {"type": "rgb", "value": eta}, "k": {"type": "rgb", "value": k}}
    glass = {"int_ior": 1.5, "ext_ior": 1.0}
    rows = rough(mi, "diffuse", Diffuse((0.9, 0.5, 0.1)), {"type": "diffuse", "reflectance": color}, pairs)
    rows += delta(mi, "conductor", Conductor(eta, k), {"type": "conductor", **metal}, pairs)
    rows += delta(mi, "mirror", Mirror(), {"type": "conductor"}, pairs)
    rows += delta(mi, "dielectric", Dielectric(1.5), {"type": "dielectric", **glass}, pairs)
    for nonlinear in (False, True):
        plastic = {**glass, "diffuse_reflectance": color, "nonlinear": nonlinear}
        gray = {**plastic, "diffuse_reflectance": {"type": "rgb", "value": 0.6}}
        inside = 1 - part_escaping(1.5)
        times = (1 - 0.6**nonlinear * inside) / (1 - 0.6**nonlinear * fitted_reflectance(1.5))
        ours = Plastic(0.6, nonlinear=nonlinear)
        rows += rough(mi, f"plastic {nonlinear:d}", ours, {"type": "plastic", **gray}, pairs, times=times)
        for distribution in ("ggx", "beckmann"):
            shape: dict[str, Any] = {"distribution": distribution, "shadowing": "separable"}
            ours = Plastic((0.9, 0.5, 0.1), 0.6, nonlinear=nonlinear, multiscatter=False, **shape)
            theirs = {"type": "roughplastic", "distribution": distribution, "alpha": 0.36, **plastic}
            name = f"roughplastic {distribution} {nonlinear:d}"
            known = distribution == "ggx"
            rows += rough(mi, name, ours, theirs, pairs, densities=known, limit=OF_TABLES)
    for roughness in (0.3, 0.6, 1.0):
        principled = {"type": "principled", "base_color": color, "metallic": 1.0, "roughness": roughness}
        ours = Principled((0.9, 0.5, 0.1), 1.0, roughness, multiscatter=False)
        rows += rough(mi, f"principled metal {roughness}", ours, principled, pairs, masked=roughness)
    whole = {"roughness": 0.4, "metallic": 0.3, "anisotropic": 0.6, "flatness": 0.7, "sheen": 0.8}
    whole |= {"sheen_tint": 0.4, "clearcoat": 0.9, "clearcoat_gloss": 0.3}
    for clear in (0.0, 0.6):
        theirs = {
            "type": "principled",
            "base_color": color,
            "eta": 1.5,
            "spec_tint": 0.5,
            "spec_trans": clear,
        }
        ours = Disney((0.9, 0.5, 0.1), specular_tint=0.5, transmission=clear, **whole)
        rows += rough(
            mi, f"disney {clear}", ours, {**theirs, "spec_tint": 0.5, **whole}, pairs, densities=False
        )
    sheet = {"roughness": 0.4, "anisotropic": 0.6, "flatness": 0.7, "sheen": 0.8, "sheen_tint": 0.4}
    for clear, crossing in ((0.0, 0.0), (0.7, 1.2), (1.0, 0.0)):
        lobes = {"spec_trans": clear, "diff_trans": crossing, "spec_tint": 0.5, "eta": 1.4}
        theirs = {"type": "principledthin", "base_color": color, **lobes, **sheet}
        parts = {"transmission": clear, "diffuse_transmission": crossing, "specular_tint": 0.5, "ior": 1.4}
        ours = ThinDisney((0.9, 0.5, 0.1), **parts, **sheet)
        rows += rough(mi, f"thin disney {clear}", ours, theirs, pairs)
    for distribution in ("ggx", "beckmann"):
        for first, second in ((0.3, None), (0.6, None), (1.0, None), (0.3, 0.6)):
            shape = {"distribution": distribution, "shadowing": "separable", "roughness_v": second}
            alphas = {"alpha_u": first**2, "alpha_v": (second or first) ** 2, "distribution": distribution}
            name = f"{distribution} {first}" + (f", {second}" if second else "")
            known = distribution == "ggx"
            metallic = Conductor(eta, k, first, multiscatter=False, **shape)
            conductor = {"type": "roughconductor", **metal, **alphas}
            rows += rough(mi, f"conductor {name}", metallic, conductor, pairs, densities=known)
            clear = Dielectric(1.5, first, multiscatter=False, **shape)
            dielectric = {"type": "roughdielectric", **glass, **alphas}
            rows += rough(mi, f"dielectric {name}", clear, dielectric, pairs, densities=known)
    return rows


def main(report: Callable[[str], None] = print) -> int:
    """Print the table; return 1 if any difference is above the limit."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("pairs", type=int, nargs="?", default=10_000, help="of directions")
    rows = compare(parser.parse_args().pairs)
    report(f"{'material':<30} {'quantity':<10} {'99 % of pairs':>14} {'largest':>10}")
    for r in rows:
        mark = "" if r.difference <= r.limit else "  above the limit"
        report(f"{r.material:<30} {r.quantity:<10} {r.difference:>14.2e} {r.largest:>10.2e}{mark}")
    return int(any(r.difference > r.limit for r in rows))


if __name__ == "__main__":
    sys.exit(main())
