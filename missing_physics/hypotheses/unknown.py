"""Forces of physics that the catalogue does not have: any curve over a variable of the joint.

A sum of hat functions between a lowest and a highest value. Where it predicts better than every known effect,
something is there without a name, and the curve says what it looks like.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import casadi as ca

from reference_model.effects.base import Extent, JointEffect, JointSignals, Parameter, Values

__all__ = ["UNKNOWN", "UnknownForce"]

#: Knots of a curve over the whole range, and over the speeds of one direction: a tenth of the range is what a
#: recording of some travels resolves.
OVER_POSITION, OVER_SPEED = 12, 6


class UnknownForce(JointEffect):
    """A piecewise linear curve of one variable, times the direction of motion or not."""

    place = "joint"
    equation = "sum_i c_i hat_i(x)"
    source = "linear splines (de Boor, A Practical Guide to Splines, 1978)"
    signature = "a residual that is a function of one variable"
    experiment = "repeat the motion at other speeds and over other ranges"
    #: The variable, as in a recording.
    variable: str
    #: What it is times.
    carrier = ""

    def knots(self, values: Mapping[str, float]) -> tuple[float, ...]:
        """Of the curve, for these parameters."""
        count = len(self.estimated)
        low, high = values["low"], values["high"]
        return tuple(low + (high - low) * i / (count - 1) for i in range(count))

    def _hats(self, x: ca.SX, p: Values, names: Sequence[str]) -> ca.SX:
        """The curve at x."""
        place = (x - p["low"]) / (p["high"] - p["low"]) * (len(names) - 1)
        place = ca.fmin(ca.fmax(place, 0.0), len(names) - 1.0)
        total = ca.SX(0.0)
        for i, name in enumerate(names):
            total += p[name] * ca.fmax(0.0, 1.0 - ca.fabs(place - i))
        return total


def _parameters(count: int, variable: str) -> tuple[Parameter, ...]:
    return (
        *(
            Parameter(f"c{i}", "N m", f"force at knot {i}", -1e9, 1e9, 1.0, absent=0.0, linear=True)
            for i in range(count)
        ),
        Parameter("low", variable, "first knot", -1e9, 1e9, 1.0, estimated=False, default=-1.0),
        Parameter("high", variable, "last knot", -1e9, 1e9, 1.0, estimated=False, default=1.0),
    )


class _OfPosition(UnknownForce):
    """A force of the position."""

    id, title, variable = "unknown_of_position", "A force of the position", "position"
    parameters = _parameters(OVER_POSITION, "rad")

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        """Over the range that is covered."""
        return ({"low": extent.position[0], "high": extent.position[1]},)

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        """The curve, as a force on the joint."""
        return self._hats(s.position, p, [q.name for q in self.estimated])


class _OfDirectionAndPosition(_OfPosition):
    """A force against the motion that depends on the position."""

    id, title = "unknown_of_direction_and_position", "A force of direction and position"
    carrier = "direction"

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        """The curve times the direction, as a force on the joint."""
        return s.sign * self._hats(s.position, p, [q.name for q in self.estimated])


class _OfVelocity(UnknownForce):
    """A force of the velocity, with a step at rest; slow speeds have as many knots as fast ones."""

    id, title, variable = "unknown_of_velocity", "A force of the velocity", "velocity"
    parameters = _parameters(2 * OVER_SPEED, "rad/s")

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        """From the slow speeds to the fastest one."""
        slow = min(max(extent.slow, 1e-3 * extent.speed), 0.3 * extent.speed)
        return ({"low": slow, "high": extent.speed},)

    def knots(self, values: Mapping[str, float]) -> tuple[float, ...]:
        """Backward, then forward."""
        low, high = values["low"], values["high"]
        top = ca.asinh(high / low)
        side = [float(low * ca.sinh(top * i / (OVER_SPEED - 1))) for i in range(OVER_SPEED)]
        return (*(-v for v in reversed(side)), *side)

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        """The curve of each direction, as a force on the joint."""
        names = [q.name for q in self.estimated]
        place = ca.asinh(ca.fabs(s.velocity) / p["low"]) / ca.asinh(p["high"] / p["low"])
        unit = {**p, "low": 0.0, "high": 1.0}
        backward = self._hats(place, unit, names[:OVER_SPEED][::-1])
        forward = self._hats(place, unit, names[OVER_SPEED:])
        return 0.5 * (1.0 + s.sign) * forward + 0.5 * (1.0 - s.sign) * backward


#: One of each kind.
UNKNOWN: tuple[UnknownForce, ...] = (_OfVelocity(), _OfPosition(), _OfDirectionAndPosition())
