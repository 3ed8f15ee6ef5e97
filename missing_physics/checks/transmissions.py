"""Recordings of robots whose motors move several joints: channels of one side computed from the other.

Some machines record motors and others joints. With q = T m and tau_q = T^-T tau_m each side follows from the
complete other side; recorded channels are left unchanged.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from missing_physics.checks.actuation import actuator_torque
from robot_model import Recording, Robot, Transmission

__all__ = ["on_both_sides"]

Array = NDArray[np.float64]
#: Quantities of motion that are converted between motors and joints.
MOVED = ("position", "velocity", "acceleration", "reference_position", "reference_velocity")


def on_both_sides(robot: Robot, recording: Recording) -> Recording:
    """The recording with channels of joints computed from their motors, and of motors from their joints.

    Args:
        robot: the robot; without transmissions nothing changes.
        recording: any.
    """
    found: dict[str, Array] = {}
    for transmission in robot.transmissions:
        motors = [motor.name for motor in transmission.motors]
        forward, backward = transmission.joints_from_motors, transmission.motors_from_joints
        for quantity in MOVED:
            joints_too = [quantity, *(["motor_position"] if quantity == "position" else [])]
            found |= dict(_moved(recording, motors, transmission.joints, [quantity], quantity, forward))
            found |= dict(
                _moved(recording, transmission.joints, motors, joints_too[::-1], quantity, backward)
            )
        found |= dict(_forced(robot, recording, transmission))
    return recording.with_channels(found) if found else recording


def _moved(
    recording: Recording,
    given: tuple[str, ...] | list[str],
    wanted: tuple[str, ...] | list[str],
    quantities: list[str],
    quantity: str,
    matrix: Array,
) -> Iterator[tuple[str, Array]]:
    """Motion of `wanted` places from that of all `given` ones, for the channels that are missing."""
    for source in quantities:
        if all(f"{name}.{source}" in recording for name in given):
            values = np.column_stack([recording[f"{name}.{source}"] for name in given])
            for name, column in zip(wanted, (values @ matrix.T).T):
                if f"{name}.{quantity}" not in recording:
                    yield f"{name}.{quantity}", column
            return


def _forced(robot: Robot, recording: Recording, transmission: Transmission) -> Iterator[tuple[str, Array]]:
    """Torques of the joints from all their motors' torques or currents, or of the motors from all joints'."""
    joints, motors = transmission.joints, [motor.name for motor in transmission.motors]
    sources = [actuator_torque(robot, recording, name) for name in motors]
    if all(channel is not None and not channel.endswith(".voltage") for channel, _ in sources):
        values = np.column_stack([factor * recording[channel] for channel, factor in sources if channel])
        yield from _absent(recording, joints, values @ transmission.motors_from_joints)
    elif all(f"{name}.torque" in recording for name in joints):
        values = np.column_stack([recording[f"{name}.torque"] for name in joints])
        yield from _absent(recording, motors, values @ transmission.joints_from_motors)


def _absent(
    recording: Recording, names: tuple[str, ...] | list[str], values: Array
) -> Iterator[tuple[str, Array]]:
    for name, column in zip(names, values.T):
        if f"{name}.torque" not in recording:
            yield f"{name}.torque", column
