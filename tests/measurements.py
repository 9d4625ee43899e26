"""Files of measured materials, written by the definitions of their formats from known formulas."""

import struct
from functools import cache

import numpy as np
from inside import BilinearDensity

CODES = {"uint8": 1, "float32": 10, "float64": 11}
PHI = {
    0: [0.0],
    1: np.linspace(-np.pi, np.pi, 9),
    2: np.linspace(-np.pi, 0, 5),
    4: np.linspace(-np.pi, -np.pi / 2, 3),
}


def tensor_file(fields: dict) -> bytes:
    """The bytes of a file of arrays."""
    arrays = {name: np.ascontiguousarray(array) for name, array in fields.items()}
    size = 18 + sum(13 + len(name) + 8 * array.ndim for name, array in arrays.items())
    head, body = struct.pack("<12sBBI", b"tensor_file\0", 1, 0, len(arrays)), b""
    for name, array in arrays.items():
        body += bytes(-(size + len(body)) % 8)
        head += struct.pack("<H", len(name)) + name.encode()
        head += struct.pack("<HBQ", array.ndim, CODES[array.dtype.name], size + len(body))
        head += struct.pack(f"<{array.ndim}Q", *array.shape)
        body += array.tobytes()
    return head + body


def direction(theta, phi):
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi])


def projected(w, alpha):
    """The area of the facets that w sees: of GGX."""
    x, y, z = w
    return (z + np.sqrt(z * z + (alpha[0] * x) ** 2 + (alpha[1] * y) ** 2)) / 2


@cache
def adaptive_fields(
    mirrors: int = 0, alpha: tuple = (0.4, 0.4), weighted: bool = True, fine: int = 1
) -> dict:
    """The fields of an RGL file of a colored rough metal of GGX; `mirrors` is how often azimuths repeat."""
    phi, theta = np.asarray(PHI[mirrors]), (np.linspace(0, 1, 8 * fine) ** 0.8 * np.radians(88))
    rows, columns, k = 24 * fine, 32 * fine, 16 * fine
    u = np.stack(np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows)))
    m = direction(u[0] ** 2 * np.pi / 2, (u[1] * 2 - 1) * np.pi)
    slope = (m[0] / alpha[0]) ** 2 + (m[1] / alpha[1]) ** 2 + m[2] ** 2
    ndf = 1 / (np.pi * alpha[0] * alpha[1] * slope**2)
    wo = np.stack([direction(t, p) for p in phi for t in theta], 1)
    seen = np.maximum(np.tensordot(wo.T, m, 1), 0) * ndf * u[0] * np.sin(u[0] ** 2 * np.pi / 2)
    vndf = seen.reshape(len(phi), len(theta), rows, columns)
    density = BilinearDensity(vndf.reshape(-1, rows, columns))
    numbers = np.stack(np.meshgrid(*[np.linspace(0, 1, k)] * 2)).reshape(2, -1).astype(np.float32)
    rgb = np.zeros((wo.shape[1], 3, k * k), np.float32)
    for i in range(wo.shape[1]):
        at = density.sample(numbers, ((np.full(k * k, i), np.ones(k * k, np.float32)),)).astype(float)
        half, o = direction(at[0] ** 2 * np.pi / 2, (at[1] * 2 - 1) * np.pi), wo[:, i, None]
        wi = 2 * (o * half).sum(0) * half - o
        g1, z = o[2] / projected(o, alpha), np.maximum(wi[2], 1e-6)
        lambdas = np.maximum(projected(o, alpha) / o[2] + projected(wi, alpha) / z - 1, 1)
        fresnel = (
            np.array([[0.9], [0.6], [0.3]]) + np.array([[0.1], [0.4], [0.7]]) * (1 - (o * half).sum(0)) ** 5
        )
        rgb[i] = np.where(wi[2] > 0, fresnel / lambdas / g1, 0)
        if not weighted:
            rgb[i] *= 0.2
    rgb = rgb.reshape(len(phi), len(theta), 3, k, k)
    corner = np.stack(np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows)))
    sigma = projected(direction(corner[0] ** 2 * np.pi / 2, (corner[1] * 2 - 1) * np.pi), alpha)
    f4 = np.float32
    return {
        "description": np.frombuffer(b"a synthetic metal", np.uint8),
        "phi_i": phi.astype(f4),
        "theta_i": theta.astype(f4),
        "ndf": ndf.astype(f4),
        "sigma": sigma.astype(f4),
        "vndf": vndf.astype(f4),
        "luminance": rgb.mean(2).astype(f4) + f4(0.02),
        "rgb": rgb,
        "jacobian": np.array([weighted], np.uint8),
    }


def spectral_fields(colors) -> dict:
    """The fields of a spectral file; `colors` are its wavelengths and the spectrum of all its values."""
    fields = dict(adaptive_fields())
    gray = fields.pop("rgb")[:, :, :1]
    waves, spectrum = np.asarray(colors, np.float32)
    fields["wavelengths"] = waves
    fields["spectra"] = gray * spectrum[None, None, :, None, None]
    return fields


@cache
def merl_bytes(alpha: float = 0.3) -> bytes:
    """A MERL file of a matte base and a lobe of GGX, of which half the table is not known."""
    centers = [((np.arange(n) + 0.5) / n).astype(np.float32) for n in (90, 90, 180)]
    h, d, p = np.meshgrid(*centers, indexing="ij")
    theta = h**2 * np.pi / 2
    half, tilt, turn = direction(theta, 0 * theta), d * np.pi / 2, p * np.pi
    local = direction(tilt, turn)
    wi = np.stack(
        [local[0] * half[2] + local[2] * half[0], local[1], local[2] * half[2] - local[0] * half[0]]
    )
    wo = 2 * (wi * half).sum(0) * half - wi
    gloss = reflectance(wo, wi, half, alpha, 0)
    values = np.stack([gloss + base / np.pi for base in (0.1, 0.3, 0.6)])
    values = np.where((wi[2] > 0) & (wo[2] > 0), values, -1.0)
    scale = np.array([1500, 1500 / 1.15, 1500 / 1.66])[:, None, None, None]
    return (
        struct.pack("<3i", 90, 90, 180)
        + np.where(values < 0, -1.0, values * scale).astype(np.float64).tobytes()
    )


def reflectance(wo, wi, half, alpha, base):
    """The value of the material in `merl_bytes`."""
    d = 1 / (np.pi * alpha**2 * ((half[0] ** 2 + half[1] ** 2) / alpha**2 + half[2] ** 2) ** 2)
    area = projected(wo, (alpha, alpha)) * projected(wi, (alpha, alpha))
    return base / np.pi + 0.1 * d / (4 * np.maximum(area, 1e-3))


@cache
def measured(kind: str):
    """A measured material of a kind: "merl", or how often the azimuths of RGL's tables repeat."""
    from wavefront.bsdfs import Measured

    if kind == "merl":
        return Measured.from_bytes("test.binary", merl_bytes())
    fields = adaptive_fields(int(kind), (0.4, 0.4) if kind == "0" else (0.2, 0.5))
    return Measured.from_bytes("test.bsdf", tensor_file(fields))
