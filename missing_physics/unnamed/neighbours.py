"""Forces on a joint that depend on how another joint moves: wrists with a common gear, cables over joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import casadi as ca

from missing_physics.unnamed.curves import Curve
from missing_physics.unnamed.force import fixed, parameters
from reference_model.effects.base import Extent, JointSignals, Values

__all__ = ["OfNeighbour", "driven_by"]

#: Degree of a curve over the velocities of another joint.
DEGREE = 6


class OfNeighbour(Curve):
    """A force that depends on the velocity of another joint, or on its speed and against its own motion.

    It vanishes while the other joint rests. Its signals hold the velocity of the other joint and the
    direction of its own.

    Args:
        neighbour: name of the other joint.
        carrier: empty, or `direction`.
    """

    title = "Force dependent on another joint's velocity"
    of_joint = False
    equation = "sum_i c_i (T_i(y) - T_i at rest), y from -1 to 1 over the other joint's velocity, i from 1 on"
    along = within = ()
    parameters = parameters(
        DEGREE,
        "N m",
        fixed("low", "rad/s", "lowest velocity", -1.0),
        fixed("high", "rad/s", "highest velocity"),
    )

    def __init__(self, neighbour: str, carrier: str) -> None:
        self.neighbour, self.carrier = neighbour, carrier  # type: ignore[misc]
        self.id = f"unknown_of_{'direction_and_' if carrier else ''}velocity_of_{neighbour}"  # type: ignore[misc]
        self.variable = f"{neighbour}.velocity"  # type: ignore[misc]

    def phrase(self, variable: str) -> str:
        """On which joint it depends."""
        if self.carrier:
            return f"friction that depends on the speed of {self.neighbour}"
        return super().phrase(variable)

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        """A curve over the velocities, or speeds, of the other joint, whose extent it is."""
        if extent.speed <= 0.0:
            return ()
        return ({"low": 0.0 if self.carrier else -extent.speed, "high": extent.speed},)

    def _level(self, degree: int) -> float:
        """Value of T_degree at rest."""
        if self.carrier:
            return float((-1) ** degree)
        return 0.0 if degree % 2 else float((-1) ** (degree // 2))

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        """The curve, as a force on the joint."""
        names = [q.name for q in self.estimated]
        if self.carrier:
            return s.sign * self._curve(ca.fabs(s.velocity), p, names)
        return self._curve(s.velocity, p, names)


@lru_cache(maxsize=64)
def driven_by(neighbour: str) -> tuple[OfNeighbour, ...]:
    """The forces that depend on the velocity of a joint."""
    return OfNeighbour(neighbour, ""), OfNeighbour(neighbour, "direction")
