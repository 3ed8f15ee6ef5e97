"""Forces that are a curve over one variable of the joint.

The curve is a Chebyshev series between a lowest and a highest value. So rarely visited parts follow from the
rest of the curve, and a smooth curve takes few parameters. Beyond these values it goes on with its slope. Its
mean over the range is zero: offsets and friction are parameters of the standard model and estimated with it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from missing_physics.unnamed.force import KNOTS, UnknownForce, fixed, parameters
from reference_model.effects.base import Extent, JointSignals, Parameter, Values

__all__ = ["CURVES", "Curve"]

#: Degree of a curve over the whole range, and over the speeds of one direction: a recording of a few travels
#: resolves about a tenth of the range. Over time it is low: heat and wear change slowly, events have a start.
OVER_POSITION, OVER_SPEED, OVER_TIME = 9, 6, 4
#: Knots at which a curve over the speeds of one direction is reported.
KNOTS_OF_SPEED = 11


class Curve(UnknownForce):
    """A curve over one variable, optionally times the direction of motion."""

    equation = "sum_i c_i (T_i(y) - mean of T_i), y = 2 (x - low) / (high - low) - 1, i from 1 on"
    along: ClassVar[tuple[str, ...]] = ("offset",)
    within: ClassVar[tuple[str, ...]] = ("offset",)

    def knots(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Knots over the range."""
        return np.linspace(values["low"], values["high"], KNOTS)

    def shape(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Derivatives at the knots."""
        return self._chebyshev(KNOTS, len(self.estimated))

    def phrase(self, variable: str) -> str:
        """A curve over the variable."""
        return f"a curve over {variable}{' times the direction of motion' if self.carrier else ''}"

    def _curve(self, x: ca.SX, p: Values, names: Sequence[str]) -> ca.SX:
        """Value of the curve at x."""
        place = 2.0 * (x - p["low"]) / (p["high"] - p["low"]) - 1.0
        y, total = ca.fmin(ca.fmax(place, -1.0), 1.0), ca.SX(0.0)
        beyond = place - y
        before, now, slope_before, slope = ca.SX(1.0), y, ca.SX(0.0), ca.SX(1.0)
        for degree, name in enumerate(names, start=1):
            total += p[name] * (now + slope * beyond - self._level(degree))
            slope_before, slope = slope, 2.0 * (now + y * slope) - slope_before
            before, now = now, 2.0 * y * now - before
        return total

    def _level(self, degree: int) -> float:
        """What is subtracted from T_degree: its mean between -1 and 1."""
        return 0.0 if degree % 2 else 1.0 / (1.0 - degree**2)

    def _chebyshev(self, knots: int, degree: int) -> NDArray[np.float64]:
        """T_1 to T_degree minus their levels at `knots` points over the range, shape (K, P)."""
        values = np.polynomial.chebyshev.chebvander(np.linspace(-1.0, 1.0, knots), degree)[:, 1:]
        return np.asarray(values - [self._level(1 + i) for i in range(degree)])


def _parameters(count: int, unit: str) -> tuple[Parameter, ...]:
    ends = fixed("low", unit, "lowest value", -1.0), fixed("high", unit, "highest value", 1.0)
    return parameters(count, "N m", *ends)


class _Smooth(Curve):
    """A curve of the position or of the time; against the motion where the direction is its carrier."""

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        """A curve over the covered range, or over the duration, which all recordings begin alike."""
        low, high = extent.position if self.of_joint else (0.0, extent.duration)
        return ({"low": low, "high": high},) if high > low else ()

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        """The curve, as a force on the joint."""
        found = self._curve(getattr(s, self.variable), p, [q.name for q in self.estimated])
        return s.sign * found if self.carrier else found


class _OfPosition(_Smooth):
    """A force that depends on the position."""

    id, title, variable = "unknown_of_position", "Position-dependent force", "position"
    parameters = _parameters(OVER_POSITION, "rad")


class _OfDirectionAndPosition(_OfPosition):
    """A force against the motion that depends on the position."""

    id, title = "unknown_of_direction_and_position", "Force dependent on direction and position"
    carrier = "direction"
    along = ("coulomb",)
    within = ()


class _OfVelocity(Curve):
    """A force that depends on the velocity, with a step at zero; its knots are denser at low speeds."""

    id, title, variable = "unknown_of_velocity", "Velocity-dependent force", "velocity"
    along = ("viscous", "coulomb", "offset")
    within = ()
    parameters = _parameters(2 * OVER_SPEED, "rad/s")

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        """A curve from the slow speeds to the fastest."""
        if extent.speed <= 0.0:
            return ()
        slow = min(max(extent.slow, 1e-3 * extent.speed), 0.3 * extent.speed)
        return ({"low": slow, "high": extent.speed},)

    def knots(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Knots of the backward motion, then of the forward motion."""
        top = np.arcsinh(values["high"] / values["low"])
        side = values["low"] * np.sinh(top * np.linspace(0.0, 1.0, KNOTS_OF_SPEED))
        return np.concatenate([-side[::-1], side])

    def shape(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Derivatives at the knots, the backward parameters first."""
        side = self._chebyshev(KNOTS_OF_SPEED, OVER_SPEED)
        return np.block([[side[::-1], np.zeros_like(side)], [np.zeros_like(side), side]])

    def torque(self, s: JointSignals, p: Values, z: ca.SX) -> ca.SX:
        """The curve of each direction, as a force on the joint."""
        names = [q.name for q in self.estimated]
        place = ca.asinh(ca.fabs(s.velocity) / p["low"]) / ca.asinh(p["high"] / p["low"])
        unit = {**p, "low": 0.0, "high": 1.0}
        backward = self._curve(place, unit, names[:OVER_SPEED])
        forward = self._curve(place, unit, names[OVER_SPEED:])
        return 0.5 * (1.0 + s.sign) * forward + 0.5 * (1.0 - s.sign) * backward


class _OfTime(_Smooth):
    """A force that drifts over each recording in the same way."""

    id, title, variable = "unknown_of_time", "Time-dependent force", "time"
    of_joint = False
    parameters = _parameters(OVER_TIME, "s")


class _OfDirectionAndTime(_OfTime):
    """A force against the motion that drifts over a recording: friction that warms up, runs in or wears."""

    id, title = "unknown_of_direction_and_time", "Force dependent on direction and time"
    carrier = "direction"
    along = ("coulomb",)
    within = ()


#: One curve of each kind.
CURVES: tuple[Curve, ...] = (
    _OfVelocity(),
    _OfPosition(),
    _OfDirectionAndPosition(),
    _OfTime(),
    _OfDirectionAndTime(),
)
