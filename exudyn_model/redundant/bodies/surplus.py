"""Additions to Exudyn's modal body as objects on its coordinates: gravity at the masses, further inertia.

Coordinates are those of the frame (r, e) and the modal ones x. With A of the Euler parameters e and the
frame's angular velocity G ed, speeds in the frame's axes are (A^T rd, G ed, xd), and the accelerations that
go with them (A^T rdd, G edd, xdd), since Gd ed = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import exudyn.itemInterface
import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.moments import Moments, Surplus
from exudyn_model.bodies.rotation import cross, from_quaternion
from exudyn_model.redundant.bodies.handles import euler_rates

__all__ = ["add_modal_weight", "add_surplus"]

Array = NDArray[np.float64]
items: Any = exudyn.itemInterface

#: Coordinates of a frame.
SEVEN = 7


def add_modal_weight(
    mbs: Any, nodes: tuple[int, int], moments: Moments, surplus: Surplus, gravity: Array
) -> None:
    """Gravity on a modal body at the positions of its masses.

    Exudyn's own gravity load has the moment of the undeformed body, so that angular momentum would change in
    free fall.

    Args:
        mbs: the system, before it is assembled.
        nodes: of the body's frame and of its modal coordinates.
        moments, surplus: of its masses.
        gravity: inertial frame [m/s^2], shape (3,).
    """
    reference = _reference(mbs, nodes[0])

    def force(_: Any, time: float, item: int, q: Sequence[float], v: Sequence[float]) -> Array:
        e, own = np.asarray(q[3:SEVEN]) + reference[3:], np.asarray(q[SEVEN:])
        along = from_quaternion(e).T @ gravity
        moment, change = surplus.weight(own)
        moment = moment + moments.first[:, 0] + moments.first[:, 1:] @ own
        change = change + moments.first[:, 1:]
        turning = euler_rates(e).T @ cross(moment, along)
        return np.concatenate([moments.mass * gravity, turning, change.T @ along])

    if gravity.any():
        mbs.AddObject(items.ObjectGenericODE2(nodeNumbers=list(nodes), forceUserFunction=force))


def add_surplus(mbs: Any, nodes: tuple[int, int], surplus: Surplus) -> None:
    """Inertia in addition to the points of a modal body; before the system is assembled."""
    reference = _reference(mbs, nodes[0])

    def force(_: Any, time: float, item: int, q: Sequence[float], v: Sequence[float]) -> Array:
        e, rates = np.asarray(q[3:SEVEN]) + reference[3:], np.asarray(v)
        speeds = _speeds(e, len(q))
        omega = speeds[3:6] @ rates
        return speeds.T @ surplus.force(omega, np.asarray(q[SEVEN:]), rates[SEVEN:])

    def mass(_: Any, time: float, item: int, q: Sequence[float], v: Sequence[float]) -> Array:
        speeds = _speeds(np.asarray(q[3:SEVEN]) + reference[3:], len(q))
        found: Array = speeds.T @ surplus.mass(np.asarray(q[SEVEN:])) @ speeds
        return found

    mbs.AddObject(
        items.ObjectGenericODE2(nodeNumbers=list(nodes), forceUserFunction=force, massMatrixUserFunction=mass)
    )


def _reference(mbs: Any, node: int) -> Array:
    return np.asarray(mbs.GetNode(node)["referenceCoordinates"], dtype=float)


def _speeds(e: Array, count: int) -> Array:
    """Speeds in the frame's axes per rate of the coordinates, shape (count - 1, count)."""
    rows = np.zeros((count - 1, count))
    rows[:3, :3] = from_quaternion(e).T
    rows[3:6, 3:SEVEN] = euler_rates(e)
    rows[6:, SEVEN:] = np.eye(count - SEVEN)
    return rows
