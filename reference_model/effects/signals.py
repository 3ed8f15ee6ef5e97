"""Signals on which effects may depend, as CasADi expressions."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import casadi as ca

__all__ = ["GearSignals", "JointSignals", "SensorSignals", "smooth_sign"]


@dataclass(frozen=True)
class JointSignals:
    """Signals on which an effect at a joint may depend; down to the temperature scalar CasADi expressions.

    Attributes:
        time: [s].
        position, velocity, acceleration: of the joint coordinate [rad or m, and per s, s^2].
        torque: actuator torque at the joint as commanded or measured [N m or N].
        friction: sum of the friction laws of this joint, which modifiers multiply [N m or N].
        radial_force, axial_force: bearing load [N].
        bending_moment: bearing load [N m].
        radial_sum: sum of the forces in the joint's bearings, which the radial arm multiplies [N].
        temperature: of the joint [K].
        gear_ratio: motor turns per joint turn.
        bearing_arms: radial and axial arm [m]; see `robot_model.Bearing`.
        transition: speed over which a discontinuous law is smoothed [rad/s or m/s].
        direction: the sign of the velocity where it is not determined by smoothing [-].
        thermal_rates: relative decrease of static and of kinetic friction per kelvin [1/K].
        reference_temperature: at which friction equals that of its effects [K].
    """

    time: ca.SX
    position: ca.SX
    velocity: ca.SX
    acceleration: ca.SX
    torque: ca.SX
    friction: ca.SX
    radial_force: ca.SX
    axial_force: ca.SX
    bending_moment: ca.SX
    radial_sum: ca.SX
    temperature: ca.SX
    gear_ratio: float = 1.0
    bearing_arms: tuple[float, float] = (0.0, 0.0)
    transition: float | ca.SX = 1e-4
    direction: ca.SX | None = None
    thermal_rates: tuple[float, float] = (0.0, 0.0)
    reference_temperature: float = 293.15

    #: The expression fields, in the order in which arrays of them are stacked.
    CHANNELS: ClassVar[tuple[str, ...]] = (
        "time",
        "position",
        "velocity",
        "acceleration",
        "torque",
        "friction",
        "radial_force",
        "axial_force",
        "bending_moment",
        "radial_sum",
        "temperature",
    )

    @property
    def sign(self) -> ca.SX:
        """sgn(velocity), smoothed to tanh(velocity / transition) unless the direction is given [-]."""
        return smooth_sign(self.velocity, self.transition) if self.direction is None else self.direction

    @property
    def static_factor(self) -> float | ca.SX:
        """Temperature factor of static friction, exp(-rate (T - T0)) [-]."""
        return self._factor(self.thermal_rates[0])

    @property
    def kinetic_factor(self) -> float | ca.SX:
        """The same for kinetic friction [-]."""
        return self._factor(self.thermal_rates[1])

    def _factor(self, rate: float) -> float | ca.SX:
        return ca.exp(-rate * (self.temperature - self.reference_temperature)) if rate else 1.0

    @property
    def load_moment(self) -> ca.SX:
        """W = R_n F_a + R_p * radial_sum, the bearing load as a moment [N m or N]; 0 without a bearing."""
        radial, axial = self.bearing_arms
        return axial * self.axial_force + radial * self.radial_sum

    @classmethod
    def symbols(
        cls,
        *,
        gear_ratio: float = 1.0,
        bearing_arms: tuple[float, float] = (0.0, 0.0),
        transition: float | ca.SX = 1e-4,
        directed: bool = False,
    ) -> tuple[JointSignals, ca.SX]:
        """Signals made of new symbols, and the column of those symbols in the order of `CHANNELS`.

        If `directed`, the direction of motion is a further symbol at the end.
        """
        names = (*cls.CHANNELS, "direction") if directed else cls.CHANNELS
        column = ca.SX.sym("s", len(names))
        parts: dict[str, Any] = dict(zip(names, ca.vertsplit(column)))
        return cls(**parts, gear_ratio=gear_ratio, bearing_arms=bearing_arms, transition=transition), column


@dataclass(frozen=True)
class GearSignals:
    """Signals on which an effect in a gear may depend: scalar CasADi expressions.

    Attributes:
        twist: motor position at the joint side of the gear minus joint position, minus the play [rad or m].
        rate: velocity of motor minus joint [rad/s or m/s].
        contact: 0 without contact of the flanks, 1 in contact, in between while contact builds up [-].
    """

    twist: ca.SX
    rate: ca.SX
    contact: ca.SX = field(default_factory=lambda: ca.SX(1.0))


@dataclass(frozen=True)
class SensorSignals:
    """Signals on which a sensor effect may depend: time [s], the true value and its time derivative."""

    time: ca.SX
    value: ca.SX
    rate: ca.SX


def smooth_sign(velocity: ca.SX, transition: float | ca.SX) -> ca.SX:
    """sgn(v) smoothed to tanh(v / transition); `transition` in the unit of `velocity`."""
    return ca.tanh(velocity / transition)
