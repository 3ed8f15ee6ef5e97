"""Friction laws of a joint: T(v), and LuGre with its bristle."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, exp, sin

from exudyn_model.effects.base import Instant, JointLaw, Memory, Momentary
from exudyn_model.effects.thermal import AMBIENT_TEMPERATURE

__all__ = [
    "AsymmetricFriction",
    "CoulombFriction",
    "LoadDependentFriction",
    "LuGreFriction",
    "PositionDependentFriction",
    "QuadraticDrag",
    "StribeckFriction",
    "TemperatureDependentFriction",
    "ViscousFriction",
    "stribeck_level",
]

#: Keeps the bristle's rate finite when both friction torques are zero [N m or N].
SMALLEST_LEVEL = 1e-9
#: Keeps the sliding deflection finite without any stiffness [N m/rad or N/m].
SMALLEST_STIFFNESS = 1e-9
#: Bearing load of bristles in a joint that has none [N m or N].
SMALLEST_LOAD = 1e-6


def stribeck_level(velocity: float, *, coulomb: float, static: float, stribeck_velocity: float) -> float:
    """g(v) = T_c + (T_s - T_c) exp(-(v / v_s)^2) [N m or N]."""
    return coulomb + (static - coulomb) * exp(-((velocity / stribeck_velocity) ** 2))


@dataclass(frozen=True, kw_only=True)
class _Level(JointLaw):
    """The level T_c + mu_d W + share |command|, increased near rest by T_s - T_c + (mu_s - mu_d) W.

    W is the friction moment of the joint's bearing, zero without one.
    """

    coulomb_torque: float
    static_torque: float
    stribeck_velocity: float
    load_coefficient: float = 0.0
    load_static_coefficient: float = 0.0
    gear_share: float = 0.0

    @property
    def needs_load(self) -> bool:
        """Whether it depends on the bearing load."""
        return bool(self.load_coefficient or self.load_static_coefficient)

    def level(self, now: Instant, velocity: float, command: float, load: float) -> float:
        """g at the temperature of the instant [N m or N]."""
        kinetic = self.coulomb_torque + self.load_coefficient * load
        static = self.static_torque + max(self.load_static_coefficient, self.load_coefficient) * load
        share = self.gear_share * abs(command)
        return stribeck_level(
            velocity,
            coulomb=now.kinetic_factor * (kinetic + share),
            static=now.static_factor * (static + share),
            stribeck_velocity=self.stribeck_velocity,
        )


@dataclass(frozen=True)
class ViscousFriction(Momentary):
    """T = -c v."""

    role = "friction"
    coefficient: float

    def force(self, now: Instant) -> float:
        return -self.coefficient * now.kinetic_factor * now.velocity


@dataclass(frozen=True)
class QuadraticDrag(Momentary):
    """T = -c |v| v."""

    coefficient: float

    def force(self, now: Instant) -> float:
        return -self.coefficient * abs(now.velocity) * now.velocity


@dataclass(frozen=True)
class CoulombFriction(Momentary):
    """T = -T_c sgn(v)."""

    role = "friction"
    torque: float

    def force(self, now: Instant) -> float:
        return -self.torque * now.kinetic_factor * now.sign


@dataclass(frozen=True)
class StribeckFriction(_Level, Momentary):
    """T = -g(v) sgn(v), g falling from the static to the Coulomb torque."""

    role = "friction"

    def force(self, now: Instant) -> float:
        return -self.level(now, now.velocity, now.command, now.load) * now.sign


@dataclass(frozen=True, kw_only=True)
class LuGreFriction(_Level):
    """T = -(s0 z + s1(v) zd), zd = v - s0 |v| z / g(v), s1(v) = s1 / (1 + limit s1 |v| / (4 g(v))).

    Canudas de Wit et al., IEEE TAC 40 (1995) 419-425, with a damping that falls with speed so that the law
    never generates energy (passive while s1(v) |v| <= 4 g: Barahanov and Ortega, IEEE TAC 45 (2000) 830-832).

    The bristle deflection z [rad or m] is the memory; it starts at its sliding value in an unloaded bearing.
    Over a step it is advanced in closed form for the mean velocity of the step: unconditionally stable for
    any bristle stiffness, and of second order.
    """

    role = "friction"
    bristle_stiffness: float
    bristle_damping: float
    load_stiffness: float = 0.0
    load_damping: float = 0.0
    load_viscosity: float = 0.0
    damping_limit: float = 1.0

    @property
    def needs_load(self) -> bool:
        per_load = self.load_stiffness, self.load_damping, self.load_viscosity
        return super().needs_load or any(per_load)

    def initial(self, now: Instant) -> Memory:
        load = now.load + SMALLEST_LOAD
        level = self._floored(now, now.velocity, now.command, load)
        return (level / self._stiffness(load) * now.sign,)

    def advance(self, now: Instant, memory: Memory) -> tuple[float, Memory]:
        z = self._deflection(now, memory[0])
        load, speed = now.load + SMALLEST_LOAD, abs(now.velocity)
        level, stiffness = self._floored(now, now.velocity, now.command, load), self._stiffness(load)
        damping = self.bristle_damping + self.load_damping * load
        damping /= 1 + self.damping_limit * damping * speed / (4 * level)
        rate = now.velocity - stiffness * speed * z / level
        viscous = self.load_viscosity * now.kinetic_factor * load * now.velocity
        return -(stiffness * z + damping * rate + viscous), (z,)

    def _stiffness(self, load: float) -> float:
        return self.bristle_stiffness + self.load_stiffness * load + SMALLEST_STIFFNESS

    def _floored(self, now: Instant, velocity: float, command: float, load: float) -> float:
        return self.level(now, velocity, command, load) + SMALLEST_LEVEL

    def _deflection(self, now: Instant, z: float) -> float:
        """z_ss + (z - z_ss) exp(-s0 |v| h / g), z_ss = g sgn(v) / s0, with the means over the step."""
        velocity = 0.5 * (now.velocity + now.last_velocity)
        if velocity == 0.0 or now.step == 0.0:
            return z
        load = 0.5 * (now.load + now.last_load) + SMALLEST_LOAD
        level = self._floored(now, velocity, 0.5 * (now.command + now.last_command), load)
        steady = level / self._stiffness(load) * (1.0 if velocity > 0 else -1.0)
        return steady + (z - steady) * exp(-self._stiffness(load) * abs(velocity) * now.step / level)


@dataclass(frozen=True)
class AsymmetricFriction(Momentary):
    """T = -(dTc sgn(v)^2 + dc v sgn(v)), sgn smoothed: half the difference of the two directions."""

    role = "friction"
    coulomb_difference: float
    viscous_difference: float

    def force(self, now: Instant) -> float:
        sign = now.sign
        difference = self.coulomb_difference * sign * sign + self.viscous_difference * now.velocity * sign
        return -now.kinetic_factor * difference


@dataclass(frozen=True)
class PositionDependentFriction(Momentary):
    """T = -(a cos(k q) + b sin(k q)) sgn(v)."""

    role = "friction"
    cosine: float
    sine: float
    order: float

    def force(self, now: Instant) -> float:
        phase = self.order * now.position
        return -(self.cosine * cos(phase) + self.sine * sin(phase)) * now.kinetic_factor * now.sign


@dataclass(frozen=True)
class LoadDependentFriction(Momentary):
    """T = -(mu W + share |command|) sgn(v): the bearing's part, W the friction moment, and the gear's."""

    role = "friction"
    coefficient: float
    gear_share: float

    @property
    def needs_load(self) -> bool:
        """Whether it depends on the bearing load."""
        return bool(self.coefficient)

    def force(self, now: Instant) -> float:
        level = self.coefficient * now.load + self.gear_share * abs(now.command)
        return -level * now.kinetic_factor * now.sign


@dataclass(frozen=True)
class TemperatureDependentFriction(Momentary):
    """T = friction (exp(-b (T - T0)) - 1) at the temperature T of the joint."""

    role = "modifier"
    rate: float
    reference_temperature: float = AMBIENT_TEMPERATURE

    def force(self, now: Instant) -> float:
        return now.friction * (exp(-self.rate * (now.temperature - self.reference_temperature)) - 1)
