"""Contact of a journal with its bearing; see `robot_model.Clearance`.

The speed at which a contact began is a state: without contact it follows the speed of approach within
`MEMORY`, and during contact it is constant.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from robot_model import Clearance, Robot
from robot_model.description.loosening import SLIDES

__all__ = ["Bearings"]

#: Time constant with which the stored speed follows the approach [s]: far below the time between contacts.
MEMORY = 1e-5
#: Slowest approach of a contact [m/s]; slower ones are not impacts.
SLOWEST = 1e-3
#: Keeps the direction of a centred journal definite [m].
CENTRED = 1e-12


@dataclass(frozen=True)
class _Loose:
    """A joint with clearance: its index among the moving ones, and those of its slides."""

    clearance: Clearance
    joint: int
    x: int
    y: int


@dataclass(frozen=True)
class _Contact:
    """Normal and tangential force on the journal [N], and the direction of contact."""

    normal: ca.SX
    tangential: ca.SX
    outward: tuple[ca.SX, ca.SX]
    rate: ca.SX
    depth: ca.SX


class Bearings:
    """The joints of a robot with clearance.

    Attributes:
        states: number of stored speeds, one for each joint with clearance.
        names: of these joints.
    """

    def __init__(self, robot: Robot) -> None:
        places = {joint.name: k for k, joint in enumerate(robot.moving_joints)}
        self._loose = []
        for joint in robot.moving_joints:
            if joint.clearance is not None:
                x, y = (places[f"{joint.name}_{end}"] for end in SLIDES)
                self._loose.append(_Loose(joint.clearance, places[joint.name], x, y))
        self.states = len(self._loose)
        self.names = tuple(robot.moving_joints[item.joint].name for item in self._loose)
        self._count = len(places)

    @property
    def initial(self) -> np.ndarray:
        """The states at time 0."""
        return np.full(self.states, SLOWEST)

    def forces(self, position: ca.SX, velocity: ca.SX, states: ca.SX) -> tuple[ca.SX, ca.SX]:
        """On all moving joints [N m or N], n x 1, and the friction among them."""
        total, friction = ca.SX(self._count, 1), ca.SX(self._count, 1)
        for row, item in enumerate(self._loose):
            found = self._contact(item, position, velocity, states[row])
            nx, ny = found.outward
            total[item.x] += -found.normal * nx - found.tangential * ny
            total[item.y] += -found.normal * ny + found.tangential * nx
            moment = item.clearance.journal_radius * found.tangential
            total[item.joint] += moment
            friction[item.joint] += moment
        return total, friction

    def normal_forces(self, position: ca.SX, velocity: ca.SX, states: ca.SX) -> ca.SX:
        """Normal force of each joint with clearance [N]."""
        found = [
            self._contact(item, position, velocity, states[row]).normal
            for row, item in enumerate(self._loose)
        ]
        return ca.vertcat(*found) if found else ca.SX(0, 1)

    def rates(self, position: ca.SX, velocity: ca.SX, states: ca.SX) -> ca.SX:
        """Time derivatives of the states [m/s^2]."""
        rates = ca.SX(self.states, 1)
        for row, item in enumerate(self._loose):
            found = self._contact(item, position, velocity, states[row])
            apart = (ca.fmax(found.rate, SLOWEST) - states[row]) / MEMORY
            rates[row] = ca.if_else(found.depth > 0, 0, apart)
        return rates

    def _contact(self, item: _Loose, position: ca.SX, velocity: ca.SX, approach: ca.SX) -> _Contact:
        given, x, y = item.clearance, position[item.x], position[item.y]
        away = ca.sqrt(x**2 + y**2 + CENTRED**2)
        nx, ny = x / away, y / away
        rate = velocity[item.x] * nx + velocity[item.y] * ny
        depth = ca.fmax(away - given.radial, 0)
        lost = 0.75 * (1 - given.restitution**2) * rate / approach
        normal = ca.fmax(given.stiffness * depth**1.5 * (1 + lost), 0)
        slip = velocity[item.y] * nx - velocity[item.x] * ny + given.journal_radius * velocity[item.joint]
        tangential = -given.friction * normal * ca.tanh(slip / given.transition)
        return _Contact(normal, tangential, (nx, ny), rate, depth)
