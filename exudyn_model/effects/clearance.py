"""A journal with play in its bearing: forces on the joint and on the two slides across its axis.

The speed at which a contact begins is that of the last accepted instant before it.
"""

from __future__ import annotations

from math import hypot, tanh

from exudyn_model.control.base import JointState
from robot_model import Clearance, Robot
from robot_model.description.loosening import SLIDES

__all__ = ["LooseBearing", "loose_bearings"]

#: Slowest approach of a contact [m/s].
SLOWEST = 1e-3


class LooseBearing:
    """Contact of Lankarani and Nikravesh with Coulomb friction in one bearing.

    Args:
        clearance: of the description.
        joint, x, y: indices of the joint and its slides among the moving joints.
    """

    def __init__(self, clearance: Clearance, joint: int, x: int, y: int) -> None:
        self._given, self._joint, self._x, self._y = clearance, joint, x, y
        self._approach = SLOWEST

    def normal(self, state: JointState) -> float:
        """Force that presses the journal inwards [N]."""
        away, rate, _, _ = self._place(state)
        depth = away - self._given.radial
        if depth <= 0:
            return 0.0
        lost = 0.75 * (1 - self._given.restitution**2) * rate / self._approach
        return max(0.0, self._given.stiffness * depth**1.5 * (1 + lost))

    def add(self, state: JointState, total: list[float], friction: list[float]) -> None:
        """Add its forces to those on the joints [N m or N]."""
        normal = self.normal(state)
        if normal == 0.0:
            return
        _, _, nx, ny = self._place(state)
        v, radius = state.velocity, self._given.journal_radius
        slip = nx * v[self._y] - ny * v[self._x] + radius * v[self._joint]
        rubbing = -self._given.friction * normal * tanh(slip / self._given.transition)
        total[self._x] += -nx * normal - ny * rubbing
        total[self._y] += -ny * normal + nx * rubbing
        total[self._joint] += radius * rubbing
        friction[self._joint] += radius * rubbing

    def accept(self, state: JointState) -> None:
        """Store the speed of approach while there is no contact."""
        away, rate, _, _ = self._place(state)
        if away <= self._given.radial:
            self._approach = max(rate, SLOWEST)

    def _place(self, state: JointState) -> tuple[float, float, float, float]:
        """Eccentricity [m], its rate [m/s], and its direction."""
        x, y = state.position[self._x], state.position[self._y]
        away = hypot(x, y)
        if away == 0.0:
            return 0.0, 0.0, 1.0, 0.0
        nx, ny = x / away, y / away
        return away, state.velocity[self._x] * nx + state.velocity[self._y] * ny, nx, ny


def loose_bearings(robot: Robot) -> list[LooseBearing]:
    """Of all joints with clearance, in the order of the file."""
    places = {joint.name: k for k, joint in enumerate(robot.moving_joints)}
    found = []
    for name, k in places.items():
        clearance = robot.moving_joints[k].clearance
        if clearance is not None:
            x, y = (places[f"{name}_{end}"] for end in SLIDES)
            found.append(LooseBearing(clearance, k, x, y))
    return found
