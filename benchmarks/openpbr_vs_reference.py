"""Compare `wf.OpenPBR` with Adobe's reference, compiled here: f and pdf of random pairs of directions.

    python benchmarks/openpbr_vs_reference.py OPENPBR_BSDF GLM

with the folders of github.com/adobe/openpbr-bsdf and github.com/g-truc/glm. It needs g++ and prints for each
lobe the mean value of the reference, and the differences of the albedo and of f·cosθ from it.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from wavefront.bsdfs.openpbr import OpenPBRBsdf

PROGRAM = """
#include <glm/glm.hpp>
#define OPENPBR_RECIPROCAL_COAT_AND_FUZZ %d
#include "openpbr.h"
#include <cstdio>
int main() {
    OpenPBR_ResolvedInputs inputs = openpbr_make_default_resolved_inputs();
    %s
    float x[6];
    while (fread(x, 4, 6, stdin) == 6) {
        const vec3 wo(x[0], x[1], x[2]), wi(x[3], x[4], x[5]);
        const OpenPBR_PreparedBsdf bsdf = openpbr_prepare(
            inputs, vec3(1.0f), OpenPBR_BaseRgbWavelengths_nm, OpenPBR_VacuumIor, wo);
        const vec3 f = openpbr_get_sum_of_diffuse_specular(openpbr_eval(bsdf, wi));
        float out[4] = {f.x, f.y, f.z, openpbr_pdf(bsdf, wi)};
        fwrite(out, 4, 4, stdout);
    }
}
"""
RED, WHITE = (0.8, 0.3, 0.1), (1.0, 1.0, 1.0)
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
    "sheet": {"transmission_weight": 1.0, "specular_roughness": 0.4, "geometry_thin_walled": True},
    "film on metal": {"base_color": RED, "base_metalness": 1.0, "thin_film_weight": 1.0},
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
    "fuzz over diffuse": {"base_color": RED, "fuzz_weight": 1.0, **NO_GLOSS},
}


def assignments(parameters: dict) -> str:
    """Return C++ statements that set the inputs."""

    def text(value: object) -> str:
        if isinstance(value, bool):
            return str(value).lower()
        return f"vec3{value}" if isinstance(value, tuple) else str(value)

    return " ".join(f"inputs.{name} = {text(value)};" for name, value in parameters.items())


def directions(rng: np.random.Generator, n: int, below: bool) -> np.ndarray:
    """Return random directions (3, n), uniform in solid angle."""
    z = rng.uniform(-1 if below else 0.02, 1, n)
    turn = rng.uniform(0, 2 * np.pi, n)
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z]).astype(np.float32)


def main(reference: str, glm: str, n: int = 20_000) -> None:
    """Print the table."""
    rng = np.random.default_rng(0)
    print(
        f"{'lobe':20} {'albedo':>8} {'ours':>8} {'|Δf|/mean f':>12} {'median |Δf|/f':>14} {'pdf ratio':>10}"
    )
    with tempfile.TemporaryDirectory() as folder:
        for name, parameters in LOBES.items():
            source, binary = Path(folder, "compare.cpp"), Path(folder, "compare")
            source.write_text(PROGRAM % (1, assignments(parameters)))
            command = [
                "g++",
                "-O1",
                "-std=c++17",
                f"-I{reference}",
                f"-I{glm}",
                str(source),
                "-o",
                str(binary),
            ]
            subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
            bsdf = OpenPBRBsdf(**parameters)
            wo, wi = directions(rng, n, False), directions(rng, n, bsdf.transmissive)
            pairs = np.ascontiguousarray(np.concatenate([wo, wi]).T).tobytes()
            out = subprocess.run([binary], input=pairs, check=True, capture_output=True).stdout
            theirs = np.frombuffer(out, np.float32).reshape(n, 4).T
            f, pdf = bsdf.evaluate(wo, wi)
            if bsdf.transmissive and not bsdf.thin:
                f = np.where(wi[2] < 0, f * np.float32(1.5**2), f)  # theirs does not scale radiance
            f = f * np.abs(wi[2])
            area = 4 * np.pi if bsdf.transmissive else 2 * np.pi
            seen, lit = theirs[:3].mean(0), theirs[:3].mean(0) > 1e-4
            gap = np.abs(f - theirs[:3]).mean(0)
            print(
                f"{name:20} {seen.mean() * area:8.4f} {f.mean() * area:8.4f} "
                f"{gap.mean() / seen.mean():12.2%} "
                f"{np.median(gap[lit] / seen[lit]):14.2%} {np.median(pdf[lit] / theirs[3][lit]):10.3f}"
            )


if __name__ == "__main__":
    main(*sys.argv[1:3])
