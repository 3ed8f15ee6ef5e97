"""Torque of a gear between a motor with its own coordinate and its joint.

With d the motor's position at the joint side minus the joint's, and e = d minus the play,

    T = K e + K3 e^3 + T_h z + D c dd,

z tends to 1 or -1 over a travel of the twist, at any speed. c is 1 in contact and 0 without, with a ramp over
a hundredth of the play, and flanks do not pull. A gear has one spring: one of its effects states K and D.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import copysign, exp, tanh
from types import MappingProxyType

from scipy.optimize import brentq

from exudyn_model.effects.base import Memory
from robot_model import Drive, InputError, Robot

__all__ = ["GEAR_PARTS", "Backlash", "Gear", "GearHysteresis", "GearPart", "JointElasticity", "gear_of"]

#: Depth of contact over which damping sets in, per half width, and at least [rad or m].
RAMP, LEAST_RAMP = 0.01, 1e-12
#: First command [N m or N] that puts a gear with play on one of its flanks.
SEATED = 1e-6
#: A spring alone twists by torque over stiffness, where rounding may take away from its torque.
BEYOND = 1.0 + 1e-9


@dataclass(frozen=True)
class GearPart:
    """An effect in a gear; parameters are the fields of the concrete class, in SI units."""


@dataclass(frozen=True)
class JointElasticity(GearPart):
    """A spring, K e + K3 e^3, with a damper."""

    stiffness: float
    cubic_stiffness: float = 0.0
    damping: float = 0.0


@dataclass(frozen=True)
class Backlash(GearPart):
    """Play of twice the half width, in series with the spring."""

    half_width: float
    stiffness: float = 0.0
    damping: float = 0.0


@dataclass(frozen=True)
class GearHysteresis(GearPart):
    """Friction T_h z in parallel with the spring, travel zd = dd - |dd| z."""

    torque: float
    travel: float
    stiffness: float = 0.0
    damping: float = 0.0


GEAR_PARTS: Mapping[str, type[GearPart]] = MappingProxyType(
    {"joint_elasticity": JointElasticity, "backlash": Backlash, "gear_hysteresis": GearHysteresis}
)


@dataclass(frozen=True, kw_only=True)
class Gear:
    """One gear with all its effects; the memory is z and its twist.

    Attributes:
        inertia: of the rotor at the joint side of the gear [kg m^2 or kg].
        stiffness, cubic, damping: K, K3, D.
        play: half width; None of a gear whose flanks are always in contact [rad or m].
        friction: T_h [N m or N].
        travel: of the twist over which friction builds up [rad or m].
    """

    inertia: float
    stiffness: float
    cubic: float
    damping: float
    play: float | None
    friction: float
    travel: float

    def start(self, torque: float) -> tuple[float, Memory]:
        """Twist under a first commanded torque [N m or N], and what is remembered then."""
        size = abs(torque)
        most = BEYOND * size / self.stiffness
        depth = brentq(lambda e: self._loading(e) - size, 0.0, most) if size > 0 else 0.0
        z = copysign(1 - exp(-depth / self.travel), torque)
        twist = copysign(depth, torque) + (self.play or 0.0) * tanh(torque / SEATED)
        return twist, (z, twist)

    def _loading(self, depth: float) -> float:
        spring = self.stiffness * depth + self.cubic * depth**3
        return spring + self.friction * (1 - exp(-depth / self.travel))

    def advance(self, twist: float, rate: float, memory: Memory) -> tuple[float, Memory]:
        """Torque on the joint [N m or N], and the memory if this instant is accepted.

        z follows in closed form from the twist, which is monotonic within a step.
        """
        z, last = memory
        way = copysign(1.0, twist - last)
        z = way + (z - way) * exp(-abs(twist - last) / self.travel)
        depth = self._depth(twist)
        torque = self.stiffness * depth + self.cubic * depth**3 + self.friction * z
        if self.play is None:
            return torque + self.damping * rate, (z, twist)
        contact = min(1.0, abs(depth) / (RAMP * self.play + LEAST_RAMP))
        torque += contact * self.damping * rate
        return (torque if torque * depth > 0 else 0.0), (z, twist)

    def energy(self, memory: Memory) -> float:
        """Energy stored in the gear [J]."""
        z, twist = memory
        depth = self._depth(twist)
        spring = self.stiffness * depth**2 / 2 + self.cubic * depth**4 / 4
        return spring + self.friction * self.travel * z**2 / 2

    def _depth(self, twist: float) -> float:
        free = self.play or 0.0
        return twist - max(-free, min(free, twist))


def gear_of(robot: Robot, drive: Drive, parts: Sequence[GearPart]) -> Gear:
    """The gear of a drive with these effects.

    Raises:
        InputError: no rotor to move, no spring or two, or parts that cannot be put together.
    """
    where = f"robot '{robot.name}', {'joint' if drive.joint else 'motor'} '{drive.name}'"
    if drive.reflected_inertia <= 0:
        raise InputError(f"{where}: a motor that moves by itself needs its actuator's rotor_inertia.")
    kinds = [type(part) for part in parts]
    if len(set(kinds)) < len(kinds):
        raise InputError(f"{where}: an effect of its gear is listed twice.")
    if {Backlash, GearHysteresis} <= set(kinds):
        raise InputError(
            f"{where}: hysteresis behind a play needs the position of the flanks, for which the Exudyn "
            "engine has no coordinate; keep backlash or gear_hysteresis."
        )
    springs = [part for part in parts if _stiffness(part) > 0]
    if len(springs) != 1:
        what = "no effect" if not springs else "more than one effect"
        raise InputError(f"{where}: {what} of its gear states a stiffness; a gear has one spring.")
    return _assembled(drive.reflected_inertia, parts, springs[0])


def _stiffness(part: GearPart) -> float:
    return float(getattr(part, "stiffness", 0.0))


def _assembled(inertia: float, parts: Sequence[GearPart], spring: GearPart) -> Gear:
    play = next((part.half_width for part in parts if isinstance(part, Backlash)), None)
    lossy = next((part for part in parts if isinstance(part, GearHysteresis)), None)
    return Gear(
        inertia=inertia,
        stiffness=_stiffness(spring),
        cubic=float(getattr(spring, "cubic_stiffness", 0.0)),
        damping=sum(float(getattr(part, "damping", 0.0)) for part in parts),
        play=play,
        friction=lossy.torque if lossy else 0.0,
        travel=lossy.travel if lossy else 1.0,
    )
