"""Files of points without faces."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core.plural import plural
from ..shapes import Points, Spheres
from ..shapes.points import usual_radius
from .losses import Losses
from .repair import Table


def cloud(losses: Losses, points: Table, colors: Any) -> Spheres | None:
    """Return a sphere at each point (n, 3) of a file, and note it; None if there is none."""
    sound = np.isfinite(points).all(1)
    if not sound.any():
        return None
    if not sound.all():
        lost = plural(int((~sound).sum()), "point")
        losses.note(f"{lost} not finite, first: point {np.argmin(sound)}", done="left out")
    places = points[sound]
    radius = usual_radius(places)
    spheres = f"{plural(len(places), 'point')} become spheres of radius {radius:.3g}"
    losses.note("has no faces", done=f"{spheres} (wf.Points takes another)")
    return Points(places, radius, None if colors is None else colors[sound])
