"""Files of luminaires, written by LM-63, with intensities that are known in every direction."""

import numpy as np

GAMMA = np.array([0, 20, 45, 60, 90, 130, 180.0])


def folded(symmetry: str, c):
    """A function of C, in degrees, that is linear between planes at multiples of 30°, with this symmetry."""
    c = np.asarray(c, float) % 360
    return {
        "axis": 0 * c,
        "quadrants": np.abs((c + 90) % 180 - 90),
        "0-180": np.abs((c + 180) % 360 - 180),
        "90-270": np.abs((c - 90 + 180) % 360 - 180),
        "none": np.interp(c, [0, 90, 210, 330, 360], [10, 70, 0, 50, 10]),
    }[symmetry]


def intensity(symmetry: str, c, gamma):
    """Candela, bilinear between planes and nodes, so that interpolation must give it everywhere."""
    return (1 + np.interp(gamma, GAMMA, [5, 9, 7, 6, 2, 3, 1])) * (20 + folded(symmetry, c))


SYMMETRIES = {
    "axis": [0],
    "quadrants": [0, 30, 60, 90],
    "0-180": [0, 30, 90, 120, 180],
    "90-270": [90, 120, 150, 180, 240, 270],
    "none": [0, 90, 210, 240, 330, 360],
}


def lm63(
    vertical,
    horizontal,
    candela,
    kind=1,
    *,
    version="IESNA:LM-63-2002",
    tilt="NONE",
    included="",
    multiplier=1.0,
    ballast="1 1",
    lumens="1 -1",
) -> str:
    """The text of a file, with candela (planes, rows)."""
    head = f"{version}\n[TEST] made here\nTILT={tilt}\n{included}"
    counts = f"{lumens} {multiplier} {len(vertical)} {len(horizontal)} {kind} 2 0.1 0.1 0\n{ballast} 20\n"
    rows = [vertical, horizontal, *np.asarray(candela, float)]
    return head + counts + "\n".join(" ".join(f"{x:.9g}" for x in row) for row in rows) + "\n"


def write(folder, symmetry: str = "none"):
    """A file of type C in a folder, and its name."""
    planes, path = np.array(SYMMETRIES[symmetry], float), folder / f"{symmetry}.ies"
    path.write_text(lm63(GAMMA, planes, intensity(symmetry, planes[:, None], GAMMA)))
    return path
