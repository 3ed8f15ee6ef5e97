"""Eye position of a 3-D view, so that the moving parts fill the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun.blueprint as rrb
from numpy.typing import NDArray

__all__ = ["Eye", "eye_on"]

Array = NDArray[np.float64]

#: The viewer's vertical opening angle, and aspect ratio of the views.
OPENING, ASPECT = np.radians(55.0), 1.15
#: Largest fraction of the picture that is filled.
FILLED = 0.88
#: Height of the eye above the horizon, and directions it may look from, round the vertical; all are in front.
ELEVATION = np.radians(24.0)
AZIMUTHS = np.radians(np.arange(-150.0, -29.0, 15.0))
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Eye:
    """Position of the eye and the point it looks at, shape (3,) each [m]."""

    position: Array
    target: Array

    @property
    def controls(self) -> rrb.EyeControls3D:
        """Controls for a view of the rerun viewer."""
        return rrb.EyeControls3D(position=self.position, look_target=self.target, eye_up=UP)

    def seen(self, points: Array) -> Array:
        """Positions of points (M, 3) in the picture, shape (M, 2): its edges are at 1 and -1."""
        toward = (self.position - self.target) / np.linalg.norm(self.position - self.target)
        across, along = _axes(toward)
        offset = points - self.position
        depth = -(offset @ toward)
        return np.column_stack([offset @ across, offset @ along]) / (depth[:, None] * _tangents())


def eye_on(points: Array, *, least: float) -> Eye:
    """An eye in front and above, on the side that shows most, as near as all points allow.

    Args:
        points: everything visible at any time, shape (M, 3) [m].
        least: smallest extent of the picture, for content that hardly moves or has no extent [m].
    """
    directions = [
        np.array([np.cos(ELEVATION) * np.cos(a), np.cos(ELEVATION) * np.sin(a), np.sin(ELEVATION)])
        for a in AZIMUTHS
    ]
    toward = max(directions, key=lambda one: float(np.prod([np.ptp(points @ axis) for axis in _axes(one)])))
    depth = points @ toward
    middles, distances = [], []
    for axis, tangent in zip(_axes(toward), FILLED * _tangents()):
        # |x - middle| <= (distance - depth) tangent for every point, with the least distance.
        high, low = (float((sign * (points @ axis) + tangent * depth).max()) for sign in (1.0, -1.0))
        middles.append((high - low) / 2)
        distances.append((high + low) / (2 * tangent))
    across, along = _axes(toward)
    nearest = float(depth.max()) + least / (2 * float(np.tan(OPENING / 2)))
    middle = middles[0] * across + middles[1] * along
    centre = float(depth.max() + depth.min()) / 2
    return Eye(middle + max(*distances, nearest) * toward, middle + centre * toward)


def _axes(toward: Array) -> tuple[Array, Array]:
    """Unit vectors to the right and upwards in the picture of an eye in the direction `toward`."""
    across = np.cross(UP, toward)
    across /= np.linalg.norm(across)
    return across, np.cross(toward, across)


def _tangents() -> Array:
    """Tangents of half the horizontal and vertical opening angles, shape (2,)."""
    along = float(np.tan(OPENING / 2))
    return np.array([ASPECT * along, along])
