"""Which recorded channel gives the torque of a joint's actuator or a motor's, and by what factor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robot_model import Actuator, Recording, Robot

__all__ = ["TorqueLack", "actuator_torque", "is_passive", "torque_lack"]

#: Channels that belong to an actuator.
DRIVEN = ("torque", "current", "voltage")


def is_passive(robot: Robot, recording: Recording, joint: str) -> bool:
    """Whether nothing drives a joint, so that its actuator's torque is known to be nothing.

    So it is where the robot has actuators and this joint has none, and the recording tells of none; and
    where the recorded torque or current is zero throughout. A robot file without any actuator leaves open
    what drives its joints.
    """
    described = any(drive.actuator is not None for drive in robot.drives)
    recorded = any(f"{joint}.{quantity}" in recording for quantity in DRIVEN)
    channel = actuator_torque(robot, recording, joint)[0]
    if channel is not None and not channel.endswith(".voltage"):  # a short-circuited motor brakes
        values = recording[channel]
        return bool(np.isfinite(values).any()) and not np.any(values[np.isfinite(values)])
    return described and _motor(robot, joint) is None and not _is_coupled(robot, joint) and not recorded


def actuator_torque(robot: Robot, recording: Recording, joint: str) -> tuple[str | None, float]:
    """The best channel and the factor that makes torque at the joint of it [N m or N per channel unit].

    Torque itself before current before voltage. A current needs the torque constant, a voltage the winding
    resistance as well; the back-EMF that a voltage's torque lacks is not part of the factor. (None, 0) when
    the recording or the robot does not say enough.
    """
    if f"{joint}.torque" in recording:
        return f"{joint}.torque", 1.0
    motor = _motor(robot, joint)
    if motor is None or motor.torque_constant is None:
        return None, 0.0
    per_ampere = motor.gear_ratio * motor.torque_constant
    if f"{joint}.current" in recording:
        return f"{joint}.current", per_ampere
    if f"{joint}.voltage" in recording and motor.resistance is not None:
        return f"{joint}.voltage", per_ampere / motor.resistance
    return None, 0.0


@dataclass(frozen=True)
class TorqueLack:
    """Why the torque of a joint's actuator is not known.

    Attributes:
        what: is missing, as a clause.
        remedy: in the imperative.
    """

    what: str
    remedy: str


def torque_lack(robot: Robot, recording: Recording, joint: str) -> TorqueLack | None:
    """Why `actuator_torque` finds nothing, by the channel or the key that is missing; None where it does."""
    if actuator_torque(robot, recording, joint)[0] is not None:
        return None
    recorded = [quantity for quantity in DRIVEN if f"{joint}.{quantity}" in recording]
    if not recorded:
        return TorqueLack(
            "no torque, current or voltage is recorded",
            "record one, name its source in a map file, or record zeros if nothing drives the joint",
        )
    motor = _motor(robot, joint)
    keys = []
    if motor is None or motor.torque_constant is None:
        keys.append("torque_constant [N m/A]")
    if recorded == ["voltage"] and (motor is None or motor.resistance is None):
        keys.append("resistance [ohm]")
    names = _listed([key.split(" ")[0] for key in keys])
    return TorqueLack(
        f"the motor's {_listed(recorded)} is recorded, but its actuator in the robot file has no {names}",
        f"add {_listed(keys)} to the joint's actuator",
    )


def _motor(robot: Robot, place: str) -> Actuator | None:
    """The motor of a joint, or of a transmission; None where a joint has none of its own."""
    return next((drive.actuator for drive in robot.drives if drive.name == place), None)


def _is_coupled(robot: Robot, joint: str) -> bool:
    """Whether motors of a transmission move a joint."""
    return any(joint in transmission.joints for transmission in robot.transmissions)


def _listed(words: Sequence[str]) -> str:
    return " and ".join(words)
