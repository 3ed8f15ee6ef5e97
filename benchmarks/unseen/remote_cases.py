"""Free-floating arms of rigid links and what is hidden in them: cases of `remote`."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from missing_physics.challenge.cases.ranges import Draw, bounded
from robot_model import EffectUse, Robot

__all__ = ["GYRO", "FrictionCase", "TwinCase", "friction_case", "label_of", "twin_case"]

GYRO = ("base.angular_velocity.x", "base.angular_velocity.y", "base.angular_velocity.z")
DURATION, RATE = 12.0, 100.0
#: Axis of each joint, and where the next joint sits on the link before [m]. With one joint its axis passes
#: through the base's centre of mass.
AXES = ((0.0, 0.0, 1.0), (0.0, 0.6, 0.8))
SHOULDER, ELBOW, HEIGHT = 1.0, 3.0, 0.3


@dataclass(frozen=True)
class FrictionCase:
    """A robot file, and the friction law that it lacks."""

    number: int
    robot: Robot
    hidden: EffectUse


@dataclass(frozen=True)
class TwinCase:
    """A robot file, what is hidden, and what looks like it in weightlessness.

    Attributes:
        twin: label of what the joint's torque alone does not tell from it.
        alike: labels of what no recorded channel tells from it.
    """

    number: int
    robot: Robot
    hidden: EffectUse
    twin: str
    alike: tuple[str, ...]


def label_of(use: EffectUse) -> str:
    """`effect@place`."""
    return f"{use.effect}@{use.at}"


def friction_case(number: int) -> FrictionCase:
    """One or two joints; dry or viscous friction at one of them."""
    d = _draw(number, "friction")
    joints = 1 + int(d.chance.integers(2))
    at = f"joint{1 + int(d.chance.integers(joints))}"
    robot = arm(d, joints, viscous=[bounded(d.even(2.0, 6.0)) for _ in range(joints)])
    if d.sign() > 0:
        return FrictionCase(number, robot, _use("coulomb_friction", at, torque=d.decades(1.5, 5.0)))
    kept = tuple(use for use in robot.effects if use.at != at)
    hidden = _use("viscous_friction", at, coefficient=d.decades(3.0, 15.0))
    return FrictionCase(number, robot.model_copy(update={"effects": kept}), hidden)


def twin_case(number: int) -> TwinCase:
    """One joint without friction; a payload where the number is even, else a wrong scale of the torque."""
    d = _draw(number, "twin")
    robot = arm(d, 1, viscous=())
    if number % 2:
        hidden = _use("torque_gain", "joint1", gain_error=d.sign() * d.decades(0.03, 0.12))
        return TwinCase(number, robot, hidden, "payload@link1", ("sensor_gain@joint1.torque",))
    place = {"x": d.even(1.0, 3.0), "y": d.even(-0.2, 0.2), "z": d.even(-0.2, 0.2)}
    hidden = _use("payload", "link1", mass=d.decades(1.0, 6.0), **place)
    return TwinCase(number, robot, hidden, "torque_gain@joint1", ())


def arm(d: Draw, joints: int, *, viscous: Sequence[float]) -> Robot:
    """A free base with an arm, drawn: masses, sensors, motion."""
    base = d.decades(150.0, 500.0)
    masses = [d.decades(20.0, 45.0), d.decades(12.0, 30.0)][:joints]
    links = [
        {
            "name": f"link{k + 1}",
            "mass": bounded(mass),
            "center_of_mass": [bounded(d.even(1.2, 1.8)), 0.0, 0.0],
            "inertia": [1.0, bounded(0.7 * mass), bounded(0.7 * mass)],
        }
        for k, mass in enumerate(masses)
    ]
    origins = ([SHOULDER if joints > 1 else 0.0, 0.0, HEIGHT], [ELBOW, 0.0, 0.0])
    return Robot.model_validate(
        {
            "name": "floating_arm",
            "base": {"kind": "free", "mass": bounded(base), "inertia": [bounded(0.23 * base)] * 3},
            "gravity": [0.0, 0.0, 0.0],
            "links": links,
            "joints": [
                {
                    "name": f"joint{k + 1}",
                    "parent": "base" if k == 0 else f"link{k}",
                    "child": f"link{k + 1}",
                    "origin": origins[k],
                    "axis": AXES[k],
                    "actuator": {"gear_ratio": 100.0, "rotor_inertia": 2e-5},
                }
                for k in range(joints)
            ],
            "sensors": _sensors(d, joints),
            "effects": [
                {"effect": "viscous_friction", "at": f"joint{k + 1}", "coefficient": coefficient}
                for k, coefficient in enumerate(viscous)
            ],
            "controller": {"kind": "pd", "kp": [4000.0] * joints, "kd": [800.0] * joints},
            "reference": {"duration": DURATION, "sample_rate": RATE, "joints": _motions(d, joints)},
        }
    )


def _sensors(d: Draw, joints: int) -> list[dict[str, object]]:
    quantities = (("position", 2e-6), ("torque", 0.02))
    found = {f"joint{k + 1}.{name}": size for name, size in quantities for k in range(joints)}
    found |= dict.fromkeys(GYRO, 2e-6)
    return [{"channel": name, "noise": bounded(size * d.decades(0.6, 2.0))} for name, size in found.items()]


def _motions(d: Draw, joints: int) -> list[dict[str, object]]:
    return [
        {
            "joint": f"joint{k + 1}",
            "kind": "multisine",
            "amplitudes": [bounded(d.even(0.35, 0.6)), bounded(d.even(0.1, 0.2))],
            "frequencies": [bounded(d.even(0.10, 0.16)), bounded(d.even(0.28, 0.4))],
        }
        for k in range(joints)
    ]


def _draw(number: int, question: str) -> Draw:
    return Draw(np.random.default_rng([number, zlib.crc32(question.encode())]))


def _use(effect: str, at: str, **values: float) -> EffectUse:
    rounded = {name: bounded(value) for name, value in values.items()}
    return EffectUse.model_validate({"effect": effect, "at": at, **rounded})
