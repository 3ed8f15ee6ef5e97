"""Temperature of a joint, in steps: prescribed, or of a heat capacity heated by the joint's friction.

Over a step of length h the power P is assumed constant, so that C dT/dt = P - (T - T_a)/R has the closed
form T+ = T_s + (T - T_s) exp(-h/(R C)), T_s = T_a + R P. Trial states use the power at the last accepted
instant; an accepted one the mean of both, which makes the method of second order.
"""

from __future__ import annotations

from bisect import bisect_right
from math import exp

from robot_model import ConstantTemperature, Joint, SelfHeating, TemperatureTable, Thermal

__all__ = ["AMBIENT_TEMPERATURE", "Warmth"]

#: Temperature of a joint without any description of it, 20 degrees Celsius [K].
AMBIENT_TEMPERATURE = 293.15


class Warmth:
    """Of one joint, from the last accepted instant on.

    Attributes:
        own: the joint has self-heating.
    """

    def __init__(self, joint: Joint) -> None:
        self._thermal: Thermal | None = joint.thermal
        kind = joint.thermal.temperature if joint.thermal else None
        self.own = isinstance(kind, SelfHeating)
        self._temperature, self._power, self._time = AMBIENT_TEMPERATURE, 0.0, 0.0
        if isinstance(kind, SelfHeating):
            self._temperature = kind.ambient if kind.initial is None else kind.initial

    def at(self, time: float) -> float:
        """Temperature at a trial instant [K]."""
        kind = self._thermal.temperature if self._thermal else None
        if isinstance(kind, ConstantTemperature):
            return kind.value
        if isinstance(kind, TemperatureTable):
            return _between(kind, time)
        return self._advanced(time, self._power)

    def factors(self, temperature: float) -> tuple[float, float]:
        """Temperature factors of static and of kinetic friction [-]."""
        if self._thermal is None:
            return 1.0, 1.0
        above = temperature - self._thermal.reference
        return exp(-self._thermal.static_rate * above), exp(-self._thermal.kinetic_rate * above)

    def begin(self, time: float, power: float) -> None:
        """Store the friction power at the first instant [s, W]."""
        self._time, self._power = time, power

    def accept(self, time: float, power: float) -> None:
        """The same at an accepted instant."""
        if self.own:
            self._temperature = self._advanced(time, 0.5 * (self._power + power))
            self._time, self._power = time, power

    def _advanced(self, time: float, power: float) -> float:
        kind = self._thermal.temperature if self._thermal else None
        if not isinstance(kind, SelfHeating):
            return self._temperature
        steady = kind.ambient + kind.resistance * power
        fade = exp(-(time - self._time) / (kind.resistance * kind.capacity))
        return steady + (self._temperature - steady) * fade


def _between(table: TemperatureTable, time: float) -> float:
    """Linear between instants, constant beyond them."""
    after = bisect_right(table.times, time)
    if after == 0:
        return table.values[0]
    if after == len(table.times):
        return table.values[-1]
    t0, t1 = table.times[after - 1 : after + 1]
    v0, v1 = table.values[after - 1 : after + 1]
    return v0 + (v1 - v0) * (time - t0) / (t1 - t0)
