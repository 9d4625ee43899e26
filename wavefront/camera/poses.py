"""The poses of cameras that move."""

from __future__ import annotations

import numpy as np

from ..arrays.vec import Doubles


def upright(matrices: Doubles) -> Doubles:
    """Return matrices (n, 4, 4) of cameras without their scales, as `Camera.at` has them."""
    poses = matrices.copy()
    backward, up = poses[:, :3, 2], poses[:, :3, 1]
    backward = backward / np.linalg.norm(backward, axis=1, keepdims=True)
    right = np.cross(up, backward)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    poses[:, :3, 0], poses[:, :3, 1], poses[:, :3, 2] = right, np.cross(backward, right), backward
    return poses
