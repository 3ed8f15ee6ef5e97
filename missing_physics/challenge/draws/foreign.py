"""Physics that is not in the catalogue, for cases in which nothing may be named.

Each kind is a force on a joint that no effect of the catalogue can take the shape of, with its magnitudes
relative to the joint and its motion as in `ranges`. Where it needs a state of its own, that is advanced in
closed form from one accepted step to the next.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import cos, exp, log1p, pi, sin, sqrt, tanh
from types import MappingProxyType

from exudyn_model import ArmInstant, ExtraForce
from missing_physics.challenge.cases.ranges import Draw, Scale
from missing_physics.challenge.cases.truth import Foreign
from robot_model import Robot

__all__ = ["COUPLED", "KINDS", "draw_foreign", "foreign_force"]

Memory = tuple[float, ...]
#: Speed over which a force that follows the direction passes through zero [rad/s or m/s].
TRANSITION = 1e-4


@dataclass(frozen=True)
class _JointForce(ExtraForce):
    """A force on joint `at`; `other` is the joint that drives a coupling. Both are places in file order."""

    at: int
    other: int
    p: Mapping[str, float]

    def advance(self, now: ArmInstant, memory: Memory) -> tuple[Sequence[float], Memory]:
        force, memory = self.acting(now, memory)
        return [force if k == self.at else 0.0 for k in range(len(now.position))], memory

    @abstractmethod
    def acting(self, now: ArmInstant, memory: Memory) -> tuple[float, Memory]:
        """The force on the joint [N m or N], and what to remember."""


class CubicSpring(_JointForce):
    """-k3 (q - q0)^3."""

    def acting(self, now: ArmInstant, memory: Memory) -> tuple[float, Memory]:
        return -self.p["stiffness"] * (now.position[self.at] - self.p["centre"]) ** 3, memory


class RelaxingDrag(_JointForce):
    """-x with T x' = c v - x: a fluid that takes a time T to yield (Maxwell)."""

    def initial(self, now: ArmInstant) -> Memory:
        return (0.0,)

    def acting(self, now: ArmInstant, memory: Memory) -> tuple[float, Memory]:
        yielded = 1.0 - exp(-now.step / self.p["time"])
        force = memory[0] + yielded * (self.p["coefficient"] * now.velocity[self.at] - memory[0])
        return -force, (force,)


class CoupledFriction(_JointForce):
    """-T_c sgn(v) (|v_other| / v_0): a seal or a belt pressed by another joint's motion."""

    def acting(self, now: ArmInstant, memory: Memory) -> tuple[float, Memory]:
        part = abs(now.velocity[self.other]) / self.p["speed"]
        return -self.p["torque"] * part * tanh(now.velocity[self.at] / TRANSITION), memory


class CoupledDamping(_JointForce):
    """-c v_other: one joint drags the other."""

    def acting(self, now: ArmInstant, memory: Memory) -> tuple[float, Memory]:
        return -self.p["coefficient"] * now.velocity[self.other], memory


class DwellStiction(_JointForce):
    """Friction that grows with the logarithm of the time since the joint last moved faster than v_0."""

    def initial(self, now: ArmInstant) -> Memory:
        return (0.0,)

    def acting(self, now: ArmInstant, memory: Memory) -> tuple[float, Memory]:
        speed = now.velocity[self.at]
        rested = (memory[0] + now.step) * exp(-now.step * abs(speed) / self.p["distance"])
        level = self.p["torque"] * log1p(rested / self.p["time"])
        return -level * tanh(speed / TRANSITION), (rested,)


class Absorber(_JointForce):
    """A mass on a spring and a damper, carried by the joint; its frequency may drift as it leaks.

    With x the mass's own way relative to the joint, x'' + 2 z w x' + w^2 x = -a; the force on the joint is
    m (w^2 x + 2 z w x'). The joint's acceleration is that between accepted instants.
    """

    def initial(self, now: ArmInstant) -> Memory:
        return (0.0, 0.0)

    def acting(self, now: ArmInstant, memory: Memory) -> tuple[float, Memory]:
        w = 2 * pi * self.p["frequency"] * (1 + self.p["drift"] * now.time)
        z, (x, xd) = self.p["damping"], memory
        if now.step > 0:
            acceleration = (now.velocity[self.at] - now.last_velocity[self.at]) / now.step
            x, xd = _oscillated(x + acceleration / w**2, xd, w=w, z=z, h=now.step)
            x -= acceleration / w**2
        return self.p["mass"] * (w * w * x + 2 * z * w * xd), (x, xd)


class WanderingWall(_JointForce):
    """A soft wall that comes and goes: contact beyond a position that swings in time."""

    def acting(self, now: ArmInstant, memory: Memory) -> tuple[float, Memory]:
        wall = self.p["position"] + self.p["swing"] * sin(2 * pi * self.p["frequency"] * now.time)
        return -self.p["stiffness"] * max(now.position[self.at] - wall, 0.0), memory


class WarmingDrive(_JointForce):
    """The torque constant falls as the motor warms: gain -b x, with T x' = (u / u_0)^2 - x."""

    def initial(self, now: ArmInstant) -> Memory:
        return (0.0,)

    def acting(self, now: ArmInstant, memory: Memory) -> tuple[float, Memory]:
        command = now.command[self.at]
        heat = (now.last_command[self.at] / self.p["torque"]) ** 2
        warm = heat + (memory[0] - heat) * exp(-now.step / self.p["time"])
        return -self.p["share"] * warm * command, (warm,)


class DriftingCogging(_JointForce):
    """a cos(k q + s t): a phase that slips, as with a creeping coupling."""

    def acting(self, now: ArmInstant, memory: Memory) -> tuple[float, Memory]:
        phase = self.p["order"] * now.position[self.at] + self.p["slip"] * now.time
        return self.p["torque"] * cos(phase), memory


class PlayOperators(_JointForce):
    """-sum k_i play(q, w_i): hysteresis of a bundle of cables, the same at every speed."""

    WIDTHS = (0.15, 0.4, 0.8)

    def initial(self, now: ArmInstant) -> Memory:
        return tuple(now.position[self.at] for _ in self.WIDTHS)

    def acting(self, now: ArmInstant, memory: Memory) -> tuple[float, Memory]:
        q, span = now.position[self.at], self.p["span"]
        kept = tuple(min(max(x, q - width * span), q + width * span) for x, width in zip(memory, self.WIDTHS))
        return -self.p["stiffness"] * sum(kept), kept


def _oscillated(x: float, xd: float, *, w: float, z: float, h: float) -> tuple[float, float]:
    """x'' + 2 z w x' + w^2 x = 0 over a time h, z < 1."""
    damped = w * sqrt(1 - z * z)
    b = (xd + z * w * x) / damped
    c, s, decay = cos(damped * h), sin(damped * h), exp(-z * w * h)
    there = decay * (x * c + b * s)
    return there, decay * damped * (b * c - x * s) - z * w * there


Maker = Callable[[Draw, Scale, Scale], dict[str, float]]


def _absorber(d: Draw, s: Scale, drift: float) -> dict[str, float]:
    frequency = d.decades(0.8, 4.0)
    # As heavy as the torque it makes out of the motion's accelerations, about speed^2 / span.
    mass = s.torque * d.decades(1.5, 6.0) * s.span / s.speed**2
    return {"frequency": frequency, "damping": d.decades(0.01, 0.05), "drift": drift, "mass": mass}


#: Kinds: the class, and what draws its parameters from the joint's and the other joint's scale.
KINDS: Mapping[str, tuple[type[_JointForce], Maker]] = MappingProxyType(
    {
        "cubic_spring": (
            CubicSpring,
            lambda d, s, o: {
                "stiffness": s.torque * d.decades(1.5, 6.0) / s.span**3,
                "centre": (s.low + s.high) / 2 + 0.2 * s.span * d.even(-1, 1),
            },
        ),
        "relaxing_drag": (
            RelaxingDrag,
            lambda d, s, o: {
                "coefficient": s.torque * d.decades(1.5, 8.0) / s.speed,
                "time": s.duration * d.decades(0.02, 0.08),
            },
        ),
        "coupled_friction": (
            CoupledFriction,
            lambda d, s, o: {"torque": s.torque * d.decades(2.0, 8.0), "speed": o.speed},
        ),
        "coupled_damping": (
            CoupledDamping,
            lambda d, s, o: {"coefficient": s.torque * d.decades(1.5, 8.0) / o.speed},
        ),
        "dwell_stiction": (
            DwellStiction,
            lambda d, s, o: {
                "torque": s.torque * d.decades(2.0, 6.0),
                "time": 0.02,
                "distance": s.span * d.decades(0.02, 0.1),
            },
        ),
        "absorber": (Absorber, lambda d, s, o: _absorber(d, s, 0.0)),
        "leaking_slosh": (Absorber, lambda d, s, o: _absorber(d, s, d.even(0.4, 1.0) / s.duration)),
        "wandering_wall": (
            WanderingWall,
            lambda d, s, o: {
                "position": s.high - s.span * d.even(0.2, 0.5),
                "swing": s.span * d.even(0.2, 0.5),
                "frequency": d.decades(0.05, 0.3),
                "stiffness": s.torque * d.decades(6.0, 20.0) / s.span,
            },
        ),
        "warming_drive": (
            WarmingDrive,
            lambda d, s, o: {
                "share": d.even(0.1, 0.3),
                "torque": max(s.peak, s.torque) / 2,
                "time": s.duration * d.decades(0.2, 0.8),
            },
        ),
        "drifting_cogging": (
            DriftingCogging,
            lambda d, s, o: {
                "torque": s.torque * d.decades(1.0, 4.0),
                "order": 2 * pi * d.decades(1.5, 12.0) / (2 * s.span),
                "slip": d.sign() * 2 * pi * d.even(2.0, 6.0) / s.duration,
            },
        ),
        "play_operators": (
            PlayOperators,
            lambda d, s, o: {"stiffness": s.torque * d.decades(0.6, 3.0) / s.span, "span": s.span},
        ),
    }
)
#: Kinds that need a second joint.
COUPLED = ("coupled_friction", "coupled_damping")


def draw_foreign(scales: Mapping[str, Scale], d: Draw) -> Foreign:
    """One kind at one joint, drawn with its parameters."""
    joints = list(scales)
    kinds = [kind for kind in KINDS if len(joints) > 1 or kind not in COUPLED]
    kind = kinds[int(d.chance.integers(len(kinds)))]
    at, other = (str(name) for name in d.chance.permutation(joints * 2)[:2])
    if other == at:
        other = next((name for name in joints if name != at), at)
    values = KINDS[kind][1](d, scales[at], scales[other])
    return Foreign(
        kind=kind,
        joint=at,
        other=other if kind in COUPLED else "",
        parameters={key: float(f"{value:.6g}") for key, value in values.items()},
    )


def foreign_force(robot: Robot, foreign: Foreign) -> ExtraForce:
    """The force that `foreign` puts on the joints of `robot`."""
    joints = [joint.name for joint in robot.moving_joints]
    other = joints.index(foreign.other) if foreign.other else joints.index(foreign.joint)
    return KINDS[foreign.kind][0](joints.index(foreign.joint), other, foreign.parameters)
