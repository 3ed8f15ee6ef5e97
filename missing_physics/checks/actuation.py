"""The recorded channel that determines the torque of a joint's actuator or of a motor, and its factor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robot_model import Actuator, Recording, Robot

__all__ = ["TorqueLack", "actuator_torque", "is_passive", "torque_lack"]

#: Channels that belong to an actuator.
DRIVEN = ("torque", "current", "voltage")
DRIVE_CHANNELS = tuple(f".{quantity}" for quantity in DRIVEN)


def is_passive(robot: Robot, recording: Recording, joint: str) -> bool:
    """Whether a joint is undriven, so that the torque of its actuator is known to be zero.

    A joint is undriven if it has no actuator and the recording has no channel of one; or if the recorded
    torque or current is zero throughout. Without any actuator in the robot file, all joints are undriven if
    the recording has no actuator channels; if it has some, it is not known which joints are driven.
    """
    described = any(drive.actuator is not None for drive in robot.drives)
    free = not described and not any(channel.endswith(DRIVE_CHANNELS) for channel in recording)
    recorded = any(f"{joint}.{quantity}" in recording for quantity in DRIVEN)
    channel = actuator_torque(robot, recording, joint)[0]
    if channel is not None and not channel.endswith(".voltage"):  # a short-circuited motor brakes
        values = recording[channel]
        return bool(np.isfinite(values).any()) and not np.any(values[np.isfinite(values)])
    if recorded or _motor(robot, joint) is not None or _is_coupled(robot, joint):
        return False
    return described or free


def actuator_torque(robot: Robot, recording: Recording, joint: str) -> tuple[str | None, float]:
    """The best channel and its factor to torque at the joint [N m or N per channel unit].

    A torque is preferred to a current, and a current to a voltage. A current requires the torque constant, a
    voltage the winding resistance as well; the factor does not include the back-EMF. (None, 0) when the
    recording or the robot file does not suffice.
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
        what: what is missing, as a clause.
        remedy: how to correct it, in the imperative.
    """

    what: str
    remedy: str


def torque_lack(robot: Robot, recording: Recording, joint: str) -> TorqueLack | None:
    """The missing channel or key because of which `actuator_torque` finds no torque; None if it finds one."""
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
    """The actuator of a joint, or a motor of a transmission; None if a joint has no actuator."""
    return next((drive.actuator for drive in robot.drives if drive.name == place), None)


def _is_coupled(robot: Robot, joint: str) -> bool:
    """Whether motors of a transmission move a joint."""
    return any(joint in transmission.joints for transmission in robot.transmissions)


def _listed(words: Sequence[str]) -> str:
    return " and ".join(words)
