"""Fit the polynomials of `wavefront/bsdfs/fuzz.py` to a simulation of the layer of fibers.

    python benchmarks/fuzz_fit.py

prints the constants and the error of each fit, weighted by the albedo. The layer is that of T. Zeltner,
B. Burley and M. J.-Y. Chiang 2022, "Practical Multiple-Scattering Sheen Using Linearly Transformed Cosines":
thickness and density are 1, nothing is absorbed, and the microflakes of E. Heitz et al. 2015, "The SGGX
Microflake Distribution", are fibers along the normal, whose cross section is the square of the roughness.
Light that is scattered once is computed, and what is scattered more often comes from random walks. As in
the paper, the transformation is fitted to f·cosθ on a grid of angles by the sum of cubed differences.
"""

import argparse

import numpy as np

F4 = np.float32
GRID = 20  # angles of each kind, of which the transformation is fitted to GRID²
SIZE = 24  # cosines, and roughnesses
LEAST = 0.1  # roughness whose transformation is fitted; below it single directions are all that is seen


def projected(w: np.ndarray, sigma: float) -> np.ndarray:
    """Projected area of the flakes along w (3, n), (n,)."""
    return np.sqrt(w[0] * w[0] + w[1] * w[1] + sigma * sigma * w[2] * w[2])


def phase(wi: np.ndarray, wo: np.ndarray, sigma: float) -> np.ndarray:
    """Density of the direction wo (3, …) of light that comes from wi (3, …), times the projected area."""
    h = wi + wo
    across, along = h[0] * h[0] + h[1] * h[1], h[2] * h[2]
    bent = sigma * sigma * across + along
    return sigma**3 * (across + along) ** 2 / (4 * np.pi * np.maximum(bent, 1e-20) ** 2)


def scatter(wi: np.ndarray, sigma: float, rng: np.random.Generator) -> np.ndarray:
    """Where flakes mirror light from wi (3, n) to, (3, n)."""
    n = wi.shape[1]
    axis = np.array([[1], [1], [sigma]], F4)
    seen = wi * axis
    seen /= np.sqrt((seen * seen).sum(0))
    turn, u = rng.random((2, n), F4) * np.array([[2 * np.pi], [1]], F4)
    z = np.sqrt(1 - u)
    r = np.sqrt(u)
    # cosine-weighted around `seen`, by a frame without branches (Duff et al. 2017)
    sign = np.copysign(F4(1), seen[2])
    a = -1 / (sign + seen[2])
    b = seen[0] * seen[1] * a
    one = np.stack([1 + sign * seen[0] ** 2 * a, sign * b, -sign * seen[0]])
    two = np.stack([b, sign + seen[1] ** 2 * a, -seen[1]])
    m = (one * (r * np.cos(turn)) + two * (r * np.sin(turn)) + seen * z) * axis
    m /= np.sqrt((m * m).sum(0))
    wo = 2 * (m * wi).sum(0) * m - wi
    return wo / np.sqrt((wo * wo).sum(0))


def angles() -> np.ndarray:
    """The directions of the grid (3, GRID²), whose azimuths from that of wo fill a half turn."""
    theta, phi = (np.indices((GRID, GRID)).reshape(2, -1) + 0.5) * np.array([[np.pi / 2], [np.pi]]) / GRID
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]).astype(F4)


def once(wi: np.ndarray, wo: np.ndarray, sigma: float) -> np.ndarray:
    """Return f·cosθ at wo (3, n) of light from wi (3, 1) that is scattered once."""
    depth = projected(wi, sigma) / wi[2] + projected(wo, sigma) / wo[2]
    return phase(wi, wo, sigma) / wi[2] * -np.expm1(-depth) / depth


def simulate(
    mu: float, alpha: float, rng: np.random.Generator, n: int, seen: int
) -> tuple[float, np.ndarray]:
    """Return the albedo by n walks, and f·cosθ on the grid by `seen` of them."""
    sigma, grid = F4(alpha * alpha), angles()
    start = np.array([[np.sqrt(1 - mu * mu)], [0], [mu]], F4)
    value = once(start, grid, sigma).astype(float)
    d, depth, lane, out = -np.repeat(start, n, 1), np.zeros(n, F4), rng.permutation(n), 0.0
    u = (rng.permutation(n) + rng.random(n)).astype(F4) / n
    for bounce in range(200):
        depth = depth + np.log(np.maximum(1 - u, F4(1e-9))) / projected(d, sigma) * d[2]
        stays = (depth > 0) & (depth < 1)
        d, depth, lane = d[:, stays], depth[stays], lane[stays]
        if not lane.size:
            break
        few = lane < seen
        if bounce and few.any():
            wi = -d[:, few]
            towards = phase(wi[:, :, None], grid[:, None], sigma) / projected(wi, sigma)[:, None]
            passed = np.exp(-depth[few][:, None] * (projected(grid, sigma) / grid[2]))
            value += (towards * passed).sum(0, dtype=float) / seen
        d = scatter(-d, sigma, rng)
        up = d[2] > 0
        out += np.exp(-depth[up] * projected(d[:, up], sigma) / d[2, up]).sum(dtype=float)
        u = rng.random(lane.size, F4)
    return out / n, value


def density(a: float, b: float, w: np.ndarray) -> np.ndarray:
    """Density of transformed directions at w (3, n), as in `fuzz_lobe`."""
    size2 = (a * w[0] + b * w[2]) ** 2 + (a * w[1]) ** 2 + w[2] ** 2
    return a * a * w[2] / (np.pi * size2 * size2)


def transformation(albedo: float, value: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return A and B of the paper that fit f·cosθ on the grid."""
    from scipy.optimize import minimize  # here, so that --help does not need it

    grid = angles().astype(float)
    return minimize(
        lambda ab: (np.abs(albedo * density(*ab, grid) - value) ** 3).sum(),
        start,
        method="Nelder-Mead",
        tol=1e-7,
    ).x


def polynomial(
    x: np.ndarray, y: np.ndarray, value: np.ndarray, weight: np.ndarray, degree: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the coefficients of a polynomial, a row for each power of x, and its values."""
    i, j = (np.arange(n + 1) for n in degree)
    powers = x[..., None, None] ** i[:, None] * y[..., None, None] ** j
    powers = powers.reshape(x.size, -1)
    found = np.linalg.lstsq(powers * weight.reshape(-1, 1), (value * weight).ravel(), rcond=None)[0]
    return found.reshape(i.size, j.size), (powers @ found).reshape(x.shape)


def main() -> None:
    """Simulate, fit and print."""
    mu = np.maximum(np.linspace(0, 1, SIZE + 1), 0.01)
    alpha = np.linspace(0, 1, SIZE + 1)[1:]
    albedo, a, b = np.zeros((3, SIZE, SIZE + 1))
    for j, cos in enumerate(mu):
        start = np.array([1.0, 0.0])
        for i in reversed(range(SIZE)):
            albedo[i, j], value = simulate(cos, alpha[i], np.random.default_rng([i, j]), 65_536, 6144)
            if albedo[i, j] > 1e-4:
                start = a[i, j], b[i, j] = transformation(albedo[i, j], value, start)
    x, y = np.meshgrid(mu, alpha)
    near, r, wide = x / (x + y), np.sqrt(1 - x * x), y > LEAST
    fits = {
        "ALBEDO": ((x, 1 / (y + 0.1), np.log(np.maximum(albedo, 1e-5)), albedo + 0.003), (3, 3)),
        "SCALE": ((near, y, a / y, wide * albedo * y / np.sqrt(np.maximum(a, 0.02))), (2, 2)),
        "SHIFT": ((near, y, b / np.maximum(r, 0.1), wide * albedo * r), (2, 2)),
    }
    found = {name: polynomial(*fit, degree) for name, (fit, degree) in fits.items()}
    for name, (table, _) in found.items():
        rows = "".join(f"    ({', '.join(f'{c:.5g}' for c in row)}),\n" for row in table)
        print(f"{name} = (\n{rows})")
    fitted = np.exp(found["ALBEDO"][1]), found["SCALE"][1] * y, found["SHIFT"][1] * r
    for name, ours, exact in zip(fits, fitted, (albedo, a, b), strict=True):
        gap = (np.abs(ours - exact) * (1 if name == "ALBEDO" else albedo))[wide]
        print(f"{name}: off by {gap.mean():.4f}, at most {gap.max():.4f}")


if __name__ == "__main__":
    argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    main()
