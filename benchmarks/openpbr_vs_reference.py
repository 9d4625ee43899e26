"""Compare `wf.OpenPBR` with Adobe's reference, compiled here: f and pdf of pairs of directions.

    python benchmarks/openpbr_vs_reference.py OPENPBR_BSDF GLM

with the folders of github.com/adobe/openpbr-bsdf and github.com/g-truc/glm. It needs g++ and prints for each
lobe the albedos, and the differences of f·cosθ and of the density. A film is compared with the mean of the
reference over wavelengths, by the matching functions that the film here stands for.
"""

import argparse
import subprocess
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from wavefront.bsdfs.openpbr import OpenPBRBsdf
from wavefront.bsdfs.thin_film import GAUSSIANS, SHARES

PROGRAM = """
#include <glm/glm.hpp>
#include "openpbr.h"
#include <cstdio>
#include <cstdlib>
#include <vector>
int main(int, char** argv) {
    OpenPBR_ResolvedInputs inputs = openpbr_make_default_resolved_inputs();
    switch (atoi(argv[1])) {%s}
    std::vector<float> waves(6 * atoi(argv[2]));
    fread(waves.data(), 4, waves.size(), stdin);
    float x[6];
    while (fread(x, 4, 6, stdin) == 6) {
        const vec3 wo(x[0], x[1], x[2]), wi(x[3], x[4], x[5]);
        vec3 f(0.0f);
        float pdf = 0.0f;
        for (size_t k = 0; k < waves.size(); k += 6) {
            const OpenPBR_PreparedBsdf bsdf = openpbr_prepare(
                inputs, vec3(1.0f), vec3(waves[k], waves[k + 1], waves[k + 2]), OpenPBR_VacuumIor, wo);
            f += openpbr_get_sum_of_diffuse_specular(openpbr_eval(bsdf, wi))
                * vec3(waves[k + 3], waves[k + 4], waves[k + 5]);
            pdf = openpbr_pdf(bsdf, wi);
        }
        float out[4] = {f.x, f.y, f.z, pdf};
        fwrite(out, 4, 4, stdout);
    }
}
"""
RED = (0.8, 0.3, 0.1)
SPREAD = 1.0969815577985598  # x⁸ = x + 1: multiples of powers of 1/x are spread evenly (M. Roberts)
NO_GLOSS = {"specular_weight": 0.0}
LOBES = {
    "diffuse": {"base_color": RED, **NO_GLOSS},
    "diffuse, rough": {"base_color": RED, "base_diffuse_roughness": 0.8, **NO_GLOSS},
    "gloss": {"base_color": (0.0, 0.0, 0.0), "specular_roughness": 0.4},
    "gloss, weight 0.3": {"base_color": (0.0, 0.0, 0.0), "specular_roughness": 0.4, "specular_weight": 0.3},
    "gloss over diffuse": {"base_color": RED, "specular_roughness": 0.4},
    "metal": {"base_color": RED, "base_metalness": 1.0, "specular_color": (0.9, 0.7, 0.5)},
    "metal, rough 0.8": {"base_color": RED, "base_metalness": 1.0, "specular_roughness": 0.8},
    "metal, anisotropic": {"base_color": RED, "base_metalness": 1.0, "specular_roughness_anisotropy": 0.7},
    "clear": {"transmission_weight": 1.0, "specular_roughness": 0.4},
    "clear, tinted": {
        "transmission_weight": 1.0,
        "transmission_color": (0.9, 0.7, 0.5),
        "specular_color": RED,
        "specular_roughness": 0.4,
    },
    "sheet": {"transmission_weight": 1.0, "specular_roughness": 0.4, "geometry_thin_walled": True},
    "sheet, tinted": {
        "transmission_weight": 1.0,
        "transmission_color": (0.9, 0.7, 0.5),
        "specular_color": RED,
        "specular_roughness": 0.4,
        "geometry_thin_walled": True,
    },
    "film on metal": {"base_color": RED, "base_metalness": 1.0, "thin_film_weight": 1.0},
    "film on tinted metal": {
        "base_color": RED,
        "base_metalness": 1.0,
        "specular_color": (0.9, 0.7, 0.5),
        "thin_film_weight": 1.0,
    },
    "film on gloss": {"base_color": (0.0, 0.0, 0.0), "specular_roughness": 0.4, "thin_film_weight": 1.0},
    "coat": {"base_color": (0.0, 0.0, 0.0), "coat_weight": 1.0, "coat_roughness": 0.4, **NO_GLOSS},
    "coat over diffuse": {"base_color": RED, "coat_weight": 1.0, "coat_roughness": 0.4, **NO_GLOSS},
    "coat, undarkened": {
        "base_color": RED,
        "coat_weight": 1.0,
        "coat_roughness": 0.4,
        "coat_darkening": 0.0,
        **NO_GLOSS,
    },
    "coat, colored": {
        "base_color": RED,
        "coat_weight": 1.0,
        "coat_roughness": 0.4,
        "coat_color": (1.0, 0.5, 0.2),
        **NO_GLOSS,
    },
    "fuzz": {"base_color": (0.0, 0.0, 0.0), "fuzz_weight": 1.0, **NO_GLOSS},
    "fuzz, rough 0.2": {"base_color": (0.0, 0.0, 0.0), "fuzz_weight": 1.0, "fuzz_roughness": 0.2, **NO_GLOSS},
    "fuzz, rough 0.8": {"base_color": (0.0, 0.0, 0.0), "fuzz_weight": 1.0, "fuzz_roughness": 0.8, **NO_GLOSS},
    "fuzz over diffuse": {"base_color": RED, "fuzz_weight": 1.0, **NO_GLOSS},
}


class Row(NamedTuple):
    """One lobe beside the reference."""

    lobe: str
    reference: float  # albedo for uniform light
    albedo: float
    difference: float  # mean |Δf·cosθ| over the mean of f·cosθ
    median: float  # of |Δf|/f
    density: float  # median ratio of the densities


def assignments(parameters: dict) -> str:
    """Return C++ statements that set the inputs."""

    def text(value: object) -> str:
        if isinstance(value, bool):
            return str(value).lower()
        return f"vec3{value}" if isinstance(value, tuple) else str(value)

    return " ".join(f"inputs.{name} = {text(value)};" for name, value in parameters.items())


def built(reference: str, glm: str, folder: str) -> list[Path]:
    """Return the programs with the weights of layers by the view alone, and by both directions."""
    cases = " ".join(f"case {k}: {assignments(lobe)} break;" for k, lobe in enumerate(LOBES.values()))
    source = Path(folder, "compare.cpp")
    source.write_text(PROGRAM % cases)
    programs = [Path(folder, f"compare{reciprocal}") for reciprocal in (0, 1)]
    for reciprocal, program in enumerate(programs):
        macro = f"-DOPENPBR_RECIPROCAL_COAT_AND_FUZZ={reciprocal}"
        command = [
            "g++",
            "-O1",
            "-w",
            "-std=c++17",
            macro,
            f"-I{reference}",
            f"-I{glm}",
            source,
            "-o",
            program,
        ]
        subprocess.run(command, check=True)
    return programs


def wavelengths(parameters: dict) -> np.ndarray:
    """Return wavelengths of the channels, in nanometers, and their weights, (k, 6)."""
    if "thin_film_weight" not in parameters:
        return np.array([[620, 540, 450, 1, 1, 1]], np.float32)
    wave = np.linspace(1.2e6, 2.8e6, 49)
    density = np.zeros((3, wave.size))
    for function, amplitude, center, variance in GAUSSIANS:
        density[function] += amplitude * np.exp(-((wave - center) ** 2) / (4 * variance))
    weight = SHARES @ (density / density.sum(1, keepdims=True))
    return np.concatenate([np.repeat(1e9 / wave[None], 3, 0), weight]).T.astype(np.float32)


def pairs(bsdf: OpenPBRBsdf, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return two sets of directions (3, n), and the weights of an integral over them, (n,).

    They are uniform, but half of wi are samples of the BSDF, so that narrow lobes have their part.
    """

    def direction(z: np.ndarray, turn: np.ndarray) -> np.ndarray:
        r, angle = np.sqrt(1 - z * z), 2 * np.pi * turn
        return np.stack([r * np.cos(angle), r * np.sin(angle), z]).astype(np.float32)

    x, y, z, w, *u = np.arange(n) * SPREAD ** -np.arange(1.0, 8.0)[:, None] % 1
    wo, wi = direction(0.02 + 0.98 * x, y), direction(2 * z - 1 if bsdf.transmissive else z, w)
    drawn = bsdf.sample_f(wo[:, ::2], np.array(u, np.float32)[:, ::2])
    wi[:, ::2] = np.where(drawn.pdf > 0, drawn.wi, wi[:, ::2])
    area = 4 * np.pi if bsdf.transmissive else 2 * np.pi
    weight = 2 / (1 / area + bsdf.pdf(wo, wi).astype(float)) / n
    weight[::2] *= drawn.pdf > 0
    return wo, wi, weight


def compared(name: str, programs: list[Path], n: int = 40_000) -> Row:
    """Compare a lobe at n pairs of directions."""
    parameters = LOBES[name]
    bsdf, waves = OpenPBRBsdf(**parameters), wavelengths(parameters)
    wo, wi, weight = pairs(bsdf, n)
    command = [programs["fuzz_weight" not in parameters], str(list(LOBES).index(name)), str(len(waves))]
    data = waves.tobytes() + np.ascontiguousarray(np.concatenate([wo, wi]).T).tobytes()
    out = subprocess.run(command, input=data, check=True, capture_output=True).stdout
    *theirs, density = np.frombuffer(out, np.float32).reshape(n, 4).T
    f, pdf = bsdf.evaluate(wo, wi)
    if bsdf.transmissive and not bsdf.thin:
        f = np.where(wi[2] < 0, f * np.float32(1.5**2), f)  # theirs does not scale radiance
    f = f * np.abs(wi[2])
    gap, seen = np.abs(f - theirs).mean(0), np.mean(theirs, 0)
    lit = seen > 1e-4
    reference, albedo, difference = (float((weight * each).sum()) for each in (seen, f.mean(0), gap))
    return Row(
        name,
        reference,
        albedo,
        difference / reference,
        float(np.median(gap[lit] / seen[lit])),
        float(np.median(pdf[lit] / density[lit])),
    )


def main(reference: str, glm: str) -> None:
    """Print the table."""
    print(
        f"{'lobe':20} {'albedo':>8} {'ours':>8} {'|Δf|/mean f':>12} {'median |Δf|/f':>14} {'pdf ratio':>10}"
    )
    with tempfile.TemporaryDirectory() as folder:
        programs = built(reference, glm, folder)
        for name in LOBES:
            row = compared(name, programs)
            print(
                f"{name:20} {row.reference:8.4f} {row.albedo:8.4f} {row.difference:12.2%} {row.median:14.2%} "
                f"{row.density:10.3f}"
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("reference", metavar="OPENPBR_BSDF", help="folder of github.com/adobe/openpbr-bsdf")
    parser.add_argument("glm", metavar="GLM", help="folder of github.com/g-truc/glm")
    options = parser.parse_args()
    main(options.reference, options.glm)
