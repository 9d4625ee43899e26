"""Orthonormal frames with a given z axis: transforms between local and world coordinates."""

from __future__ import annotations

import numpy as np

from .soa import soa
from .vec import Floats, Lanes, column, f4, signs, take


@soa
class Frame:
    """Right-handed orthonormal frames, one per column.

    With σ = ±1 by the sign of z₂ and a = −1/(σ + z₂), the axes are

        x = (1, 0, 0) + σz₀·(a·z₀, a·z₁, −1),  y = (0, σ, 0) + z₁·(a·z₀, a·z₁, −1)  and  z.

    With x and y written out, both transforms share most of their products, so that x and y need not be
    stored.

    Source: Duff et al. 2017, "Building an Orthonormal Basis, Revisited", JCGT 6(1), listing 3.

    Examples
    --------
    >>> normal = np.array([[0], [1], [0]], np.float32)
    >>> frame = wf.Frame.from_normal(normal)
    >>> frame.to_local(normal)[2]
    array([1.], dtype=float32)
    """

    z: Floats  # (3, n) normal
    sign: Floats  # (n,) σ
    a: Floats  # (n,)
    z0: Floats  # (n,) σz₀

    @classmethod
    def from_normal(cls, z: Floats) -> Frame:
        """Return frames whose z axes are unit normals (3, n)."""
        sign = signs(z[2])
        return cls(z, sign, f4(-1) / (sign + z[2]), sign * z[0])

    def take(self, lanes: Lanes) -> Frame:
        """Return the frames of some columns."""
        return Frame(*(take(array, lanes) for array in (self.z, self.sign, self.a, self.z0)))

    @property
    def x(self) -> Floats:
        """Tangents, (3, n)."""
        return self.to_world(column((1, 0, 0)))

    @property
    def y(self) -> Floats:
        """Bitangents, (3, n)."""
        return self.to_world(column((0, 1, 0)))

    def to_local(self, v: Floats) -> Floats:
        """Transform world vectors (3, n) to local vectors (3, n)."""
        z, out = self.z, np.empty_like(self.z)
        along = z[0] * v[0]
        along += z[1] * v[1]
        np.multiply(z[2], v[2], out=out[2])
        out[2] += along
        along *= self.a
        along -= v[2]
        np.multiply(self.z0, along, out=out[0])
        out[0] += v[0]
        along *= z[1]
        np.multiply(self.sign, v[1], out=out[1])
        out[1] += along
        return out

    def to_world(self, v: Floats) -> Floats:
        """Transform local vectors (3, n) to world vectors (3, n)."""
        z, out = self.z, np.empty_like(self.z)
        down = self.z0 * v[0]
        down += z[1] * v[1]
        np.multiply(z[2], v[2], out=out[2])
        out[2] -= down
        down *= self.a
        down += v[2]
        np.multiply(z[0], down, out=out[0])
        out[0] += v[0]
        down *= z[1]
        np.multiply(self.sign, v[1], out=out[1])
        out[1] += down
        return out
