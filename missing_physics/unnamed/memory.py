"""Forces that remember the past motion of the joint.

A force with memory is a combination of states that forget at several rates: over time, as in a fluid, grease
or cable that yields (generalised Maxwell model), or over the distance travelled, at any speed, as in a bundle
of cables or a gear (a combination of Dahl's models; Dahl, 1976). The rates are spaced evenly in logarithm, so
that together they approximate any law that forgets monotonically.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from missing_physics.unnamed.force import KNOTS, UnknownForce, fixed, parameters
from reference_model.effects.base import Extent, JointSignals, Values

__all__ = ["MEMORIES", "Memory"]

#: Number of times over which a force forgets, about two for each decade: closer ones are hardly different.
TIMES = 4
#: The shortest of them relative to the time in which the fastest motion passes the range [-], about a third
#: of its period: times of a twelfth of a period and less look like viscous friction and inertia.
SHORTEST = 0.25
#: The same for friction, which changes with the direction and so within a reversal [-].
SHORTEST_OF_FRICTION = 0.05
#: The longest of them relative to the duration [-]: a recording holds enough of these times to determine it.
LONGEST = 1.0 / 8.0
#: Number of distances over which a force forgets, about two for each decade, and the shortest and the longest
#: of them relative to the range of motion [-]: shorter ones look like Coulomb friction, longer ones like a
#: spring.
DISTANCES, NEAREST, FARTHEST = 4, 0.03, 1.0


class Memory(UnknownForce):
    """A force that remembers the past, optionally times the direction of motion."""

    def rates(self, p: Mapping[str, float]) -> NDArray[np.float64]:
        """Times [s] or distances [rad or m] over which the states forget, shape (P,)."""
        return np.geomspace(p["low"], p["high"], self.states)

    def _rates(self, p: Values) -> list[ca.SX]:
        last = self.states - 1
        return [p["low"] * (p["high"] / p["low"]) ** (i / last) for i in range(self.states)]

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        """The combination of the states, against the motion."""
        found = -sum((p[q.name] * z[i] for i, q in enumerate(self.estimated)), ca.SX(0.0))
        return s.sign * found if self.carrier else found


class _OfPastVelocity(Memory):
    """A force that follows the velocity with a delay: viscosity that yields."""

    id, title, variable = "unknown_of_past_velocity", "Force dependent on past velocities", "time_since_start"
    equation = "-sum_i c_i z_i, T_i z_i' = v - z_i"
    along: ClassVar[tuple[str, ...]] = ("viscous",)
    states = TIMES
    parameters = parameters(
        states,
        "N m s/rad",
        fixed("low", "s", "shortest time"),
        fixed("high", "s", "longest time"),
        fixed("speed", "rad/s", "at which the curve is reported"),
    )

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        """Times that a recording resolves."""
        high = LONGEST * extent.duration
        travel = extent.position[1] - extent.position[0]
        if travel <= 0.0 or extent.speed <= 0.0:
            return ()
        passes = travel / extent.speed
        low = min((SHORTEST_OF_FRICTION if self.carrier else SHORTEST) * passes, 0.1 * high)
        return ({"low": low, "high": high, "speed": extent.speed},)

    def state_rate(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        """The speed, or its size where the direction is the factor, minus the state."""
        speed = ca.fabs(s.velocity) if self.carrier else s.velocity
        return ca.vertcat(*((speed - z[i]) / time for i, time in enumerate(self._rates(p))))

    def knots(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Times since the joint started from rest."""
        return np.linspace(0.0, 2.0 * values["high"], KNOTS)

    def shape(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Derivatives after a start at the fastest recorded speed."""
        return values["speed"] * np.expm1(-self.knots(values)[:, None] / self.rates(values))

    def phrase(self, variable: str) -> str:
        """What it remembers."""
        return f"{'friction' if self.carrier else 'a force'} that depends on past speeds"


class _OfDirectionAndPastSpeed(_OfPastVelocity):
    """Friction that depends on how fast the joint moved before."""

    id, title = "unknown_of_direction_and_past_speed", "Friction dependent on past speeds"
    equation = "-sgn(v) sum_i c_i z_i, T_i z_i' = |v| - z_i"
    carrier = "direction"
    along = ()


class _OfPath(Memory):
    """A force that depends on the path by which a position was reached, at any speed: hysteresis.

    The first function is the elastic force about which a loop of hysteresis turns.
    """

    id, title, variable = "unknown_of_path", "Force dependent on the path", "distance_since_start"
    equation = "-c_1 (q - middle) - sum_i c_i z_i, z_i' = v - |v| z_i / r_i, i from 2 on"
    along = within = ("offset",)
    states = DISTANCES
    parameters = parameters(
        1 + states,
        "N m/rad",
        fixed("low", "rad", "shortest distance"),
        fixed("high", "rad", "longest distance"),
        fixed("middle", "rad", "middle of the range of motion", 0.0),
    )

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        """Distances that the range of motion resolves."""
        first, last = extent.position
        if last <= first:
            return ()
        low, high = NEAREST * (last - first), FARTHEST * (last - first)
        return ({"low": low, "high": high, "middle": 0.5 * (first + last)},)

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        """The elastic force and the combination of the states, against the motion."""
        functions = s.position - p["middle"], *ca.vertsplit(z)
        return -sum((p[q.name] * own for q, own in zip(self.estimated, functions)), ca.SX(0.0))

    def state_rate(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        """The velocity, less what is forgotten on the way."""
        v = s.velocity
        return ca.vertcat(*(v - ca.fabs(v) * z[i] / r for i, r in enumerate(self._rates(p))))

    def knots(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Distances from a rest, up to the range of motion."""
        return np.linspace(0.0, values["high"], KNOTS)

    def shape(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Derivatives on the way in one direction from a rest in the middle of the range."""
        rates, knots = self.rates(values), self.knots(values)[:, None]
        return np.hstack([-knots, rates * np.expm1(-knots / rates)])

    def phrase(self, variable: str) -> str:
        """What it remembers."""
        return "a force that depends on the path (hysteresis)"


#: One force of each kind.
MEMORIES: tuple[Memory, ...] = (_OfPastVelocity(), _OfDirectionAndPastSpeed(), _OfPath())
