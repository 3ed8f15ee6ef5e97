"""A massless Exudyn node, fixed to a node of a modal body that moves and rotates with the modes.

Exudyn's own marker on such a body gives its angular velocity in the axes of the undeformed body, so that
joints on it drift apart. Here the node's seven coordinates (p, a) follow from those of the body's frame
(r, q) and the modal coordinates x by six equations, polynomials in all of them:

    r + A(q) rho(x) - p = 0,    vector part of a* o q o (1, Psi x / 2) = 0.
"""

from __future__ import annotations

from typing import Any

import exudyn.itemInterface
import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.flexible_link import FlexibleLink
from exudyn_model.bodies.rotation import cross, from_quaternion, left_product, right_product, skew

__all__ = ["add_weld"]

Array = NDArray[np.float64]
items: Any = exudyn.itemInterface

#: Equations of a weld.
SIX = 6
#: The conjugate of a quaternion.
CONJUGATE = np.diag([1.0, -1.0, -1.0, -1.0])


def add_weld(mbs: Any, body: int, node: int, link: FlexibleLink, index: int) -> Any:
    """Exudyn's constraint that holds `node` at the link's node `index`; `body` is its modal body."""
    markers = [
        mbs.AddMarker(items.MarkerObjectODE2Coordinates(objectNumber=body)),
        mbs.AddMarker(items.MarkerNodeCoordinates(nodeNumber=node)),
    ]
    weld = _Weld(link, index)

    def equations(_: Any, time: float, item: int, q: Any, v: Any, velocity_level: bool) -> Array:
        x = np.asarray(q)
        found: Array = weld.jacobian(x) @ np.asarray(v) if velocity_level else weld.gap(x)
        return found

    return mbs.AddObject(
        items.ObjectConnectorCoordinateVector(
            markerNumbers=markers,
            scalingMarker0=np.zeros((SIX, 1)),  # so many equations
            constraintUserFunction=equations,
            jacobianUserFunction=lambda _, time, item, q, v, level: weld.jacobian(np.asarray(q)),
        )
    )


class _Weld:
    """The equations; coordinates are those of the frame, the modal ones, and those of the held node."""

    def __init__(self, link: FlexibleLink, index: int) -> None:
        self._link, self._index, self._still = link, index, np.zeros(link.count)
        self._half = np.vstack([np.zeros(link.count), 0.5 * link.shapes.rotations[index]])

    def gap(self, x: Array) -> Array:
        """Of the equations, shape (6,)."""
        q, own, held = x[3:7], x[7:-7], x[-7:]
        place = x[:3] + from_quaternion(q) @ self._link.motion(self._index, own, self._still).place
        turned = left_product(CONJUGATE @ held[3:]) @ left_product(q) @ self._bent(own)
        return np.concatenate([place - held[:3], turned[1:]])

    def jacobian(self, x: Array) -> Array:
        """Of the equations, shape (6, 7 + s + 7)."""
        q, own, held = x[3:7], x[7:-7], x[-7:]
        motion = self._link.motion(self._index, own, self._still)
        bent, back = self._bent(own), left_product(CONJUGATE @ held[3:])
        rows = np.zeros((SIX, len(x)))
        rows[:3, :3] = np.eye(3)
        rows[:3, 3:7] = _turned(q, motion.place)
        rows[:3, 7:-7] = from_quaternion(q) @ motion.slide
        rows[:3, -7:-4] = -np.eye(3)
        rows[3:, 3:7] = (back @ right_product(bent))[1:]
        rows[3:, 7:-7] = (back @ left_product(q) @ self._half)[1:]
        rows[3:, -4:] = (right_product(left_product(q) @ bent) @ CONJUGATE)[1:]
        return rows

    def _bent(self, own: Array) -> Array:
        """(1, Psi x / 2), a quaternion along the node's rotation."""
        found: Array = self._half @ own
        found[0] = 1.0
        return found


def _turned(q: Array, u: Array) -> Array:
    """Derivative of A(q) u, of second degree in q, with respect to q, shape (3, 4)."""
    w, axis = q[0], q[1:]
    along = 2 * (np.outer(axis, u) - np.outer(u, axis) + float(axis @ u) * np.eye(3) - w * skew(u))
    return np.column_stack([2 * w * u + 2 * cross(axis, u), along])
