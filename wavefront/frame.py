"""Local <-> world: an orthonormal frame whose z axis is a given unit vector."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .vec import Floats, f4, signs


@dataclass(slots=True)
class Frame:
    """Right-handed orthonormal frames, one per column."""

    x: Floats  # (3, n) tangent
    y: Floats  # (3, n) bitangent
    z: Floats  # (3, n) normal

    @classmethod
    def from_normal(cls, z: Floats) -> Frame:
        """Build frames around unit normals (3, n) without branches.

        Source: Duff et al. 2017, "Building an Orthonormal Basis, Revisited", JCGT 6(1), listing 3.
        """
        sign = signs(z[2])
        a = f4(-1) / (sign + z[2])
        b = z[0] * z[1] * a
        x, y = np.empty_like(z), np.empty_like(z)
        sx = sign * z[0]
        np.add(f4(1), sx * z[0] * a, out=x[0])
        np.multiply(sign, b, out=x[1])
        np.negative(sx, out=x[2])
        y[0] = b
        np.add(sign, z[1] * z[1] * a, out=y[1])
        np.negative(z[1], out=y[2])
        return cls(x, y, z)

    def to_local(self, v: Floats) -> Floats:
        """World (3, n) -> local (3, n)."""
        out = np.empty_like(self.z)
        for row, axis in zip(out, (self.x, self.y, self.z), strict=True):
            np.multiply(axis[0], v[0], out=row)
            row += axis[1] * v[1]
            row += axis[2] * v[2]
        return out

    def to_world(self, v: Floats) -> Floats:
        """Local (3, n) -> world (3, n)."""
        out = np.empty_like(self.z)
        for k, row in enumerate(out):
            np.multiply(self.x[k], v[0], out=row)
            row += self.y[k] * v[1]
            row += self.z[k] * v[2]
        return out
