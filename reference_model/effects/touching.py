"""Candidate walls in contact with a link, located from residual forces at the joints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference_model.effects.body_force import BodySight

__all__ = ["walls"]

Array = NDArray[np.float64]

#: Largest number of walls returned for a link.
MOST = 4
#: Number of wall positions tried along its normal, and the least depth relative to the point's range.
PLACES, LEAST = 40, 0.005
#: Fraction of a row's largest squared sensitivity to a force that counts as zero [-].
RIDGE = 1e-6


@dataclass(frozen=True)
class _Wall:
    """A plane, the point in contact, and the fraction of the squared forces that it explains."""

    normal: Array
    point: Array
    offset: float
    share: float

    @property
    def start(self) -> Mapping[str, float]:
        """Parameters of the `contact` effect."""
        found = {"offset": self.offset}
        for axis, along, place in zip("xyz", self.normal.tolist(), self.point.tolist()):
            found |= {f"normal_{axis}": along, axis: place}
        return found


def walls(sight: BodySight, power: float) -> Sequence[tuple[float, Mapping[str, float]]]:
    """Walls as starting values for the fit of a contact, best first.

    A wall pushes along its normal only. So the force at a point that best explains the joints' forces is
    estimated at every sample, and planes perpendicular to its principal direction and to the inertial axes
    are placed where the depth explains most.

    Args:
        sight: the link, and the residual forces.
        power: exponent of the depth in the contact force.

    Returns:
        The fraction of the squared forces that each explains, and its parameters as those of a contact.
    """
    if not sight.left.any():
        return ()
    found = [wall for point in sight.points for wall in _across(sight, point, power) if wall.share > 0.0]
    best = sorted(found, key=lambda wall: -wall.share)[:MOST]
    return tuple((wall.share, wall.start) for wall in best)


def _at(sight: BodySight, point: Array) -> Array:
    """Joint forces due to a unit force at a point, by component in inertial axes, shape (K, n, 3)."""
    inward = sight.rotation.transpose(0, 2, 1)
    moment = np.cross(point, inward.transpose(0, 2, 1)).transpose(0, 2, 1)  # point x R^T e, by columns
    return np.asarray(sight.spread[:, :, :3] @ inward + sight.spread[:, :, 3:] @ moment)


def _across(sight: BodySight, point: Array, power: float) -> Iterator[_Wall]:
    """The best wall perpendicular to each direction, for one point."""
    spread = _at(sight, point)
    gram = spread.transpose(0, 2, 1) @ spread
    ridge = RIDGE * float(np.abs(gram).max(initial=0.0)) + np.finfo(float).tiny
    right = np.einsum("kni,kn->ki", spread, sight.left)
    force = np.linalg.solve(gram + ridge * np.eye(3), right[:, :, None])[:, :, 0]
    gone = np.einsum("ki,ki->k", force, right)  # of the squared forces, at each sample
    size = np.maximum(np.linalg.norm(force, axis=1, keepdims=True), np.finfo(float).tiny)
    _, axes = np.linalg.eigh(np.einsum("k,ki,kj->ij", gone, force / size, force / size))
    total = float(np.sum(sight.left**2))
    for axis in (axes[:, -1], *np.eye(3)):
        for normal in (axis, -axis):
            along, height = spread @ normal, _height(sight, point, normal)
            offsets = float(height.min()) + np.ptp(height) * np.geomspace(LEAST, 1.0, PLACES)
            force = np.maximum(offsets[:, None] - height, 0.0) ** power  # of a wall of unit stiffness
            size = force**2 @ np.sum(along**2, axis=1)
            product = np.maximum(force @ np.sum(along * sight.left, axis=1), 0.0)
            shares = product**2 / np.maximum(size * total, np.finfo(float).tiny)
            best = int(np.argmax(shares))
            yield _Wall(normal, point, float(offsets[best]), float(shares[best]))


def _height(sight: BodySight, point: Array, normal: Array) -> Array:
    """Position of the point along the normal [m], shape (K,)."""
    return np.asarray((sight.position + sight.rotation @ point) @ normal)
