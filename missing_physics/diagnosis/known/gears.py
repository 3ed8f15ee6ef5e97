"""Torques behind compliant gears, converted as if each rotor were rigidly coupled to its joint.

Through a compliant gear a motor delivers the torque u - B (th" - q") to its joint, with u its own torque,
th and q the motor's and the joint's position and B the reflected inertia of the rotor. With that torque and
the joint's own encoder the robot is one of rigid gears.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import make_interp_spline

from missing_physics.motion.inverse import MotionDynamics
from missing_physics.motion.recorded import make_dynamics
from robot_model import Recording, Robot

__all__ = ["behind_gears"]

#: Quantities of a motor that are replaced by those of its joint.
OF_MOTORS = ("motor_position", "motor_velocity", "current", "voltage")


def behind_gears(
    robot: Robot, recordings: Sequence[Recording], along: Sequence[MotionDynamics], joints: Collection[str]
) -> tuple[Recording, ...]:
    """The recordings with motion and torque on the joint side of some compliant gears.

    Args:
        robot: the nominal robot.
        recordings: joints without both encoders are left unchanged.
        along: dynamics along each recording, with the motors' motion.
        joints: names of the joints with compliant gears.
    """
    joints = [joint for joint in joints if all(_has_both(recording, joint) for recording in recordings)]
    if not joints:
        return tuple(recordings)
    bare = [_without_motors(recording, joints) for recording in recordings]
    cutoff = along[0].motion.low_pass.cutoff
    behind = make_dynamics(robot, bare, cutoff=cutoff)
    return tuple(_behind(robot, *each, joints) for each in zip(bare, along, behind))


def _has_both(recording: Recording, joint: str) -> bool:
    return f"{joint}.position" in recording and f"{joint}.motor_position" in recording


def _without_motors(recording: Recording, joints: Collection[str]) -> Recording:
    dropped = {f"{joint}.{quantity}" for joint in joints for quantity in OF_MOTORS}
    return replace(recording, channels={k: v for k, v in recording.channels.items() if k not in dropped})


def _behind(
    robot: Robot,
    bare: Recording,
    motors: MotionDynamics,
    links: MotionDynamics,
    joints: Collection[str],
) -> Recording:
    time, torques = bare.time, {}
    for k, joint in enumerate(robot.moving_joints):
        if joint.name not in joints:
            continue
        of_motor, of_link = (
            make_interp_spline(each.motion.time, each.motion.acceleration[:, k], k=3)
            for each in (motors, links)
        )
        first = max(motors.motion.time[0], links.motion.time[0])
        last = min(motors.motion.time[-1], links.motion.time[-1])
        inside = (time >= first) & (time <= last)
        inertia = joint.actuator.reflected_inertia if joint.actuator else 0.0
        motor_torque = make_interp_spline(motors.motion.time, motors.motion.torque[:, k], k=3)
        behind = np.full(time.size, np.nan)
        behind[inside] = motor_torque(time[inside]) - inertia * (
            of_motor(time[inside]) - of_link(time[inside])
        )
        torques[f"{joint.name}.torque"] = behind
    return bare.with_channels(torques)
