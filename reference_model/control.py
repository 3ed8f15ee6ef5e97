"""Controllers: from the state and the reference to the actuators' torques at the joints.

A controller gives a *command*, which a sampled controller holds between its instants; the drive makes the
torque of it at every instant. The command is the torque, or for a voltage servo the winding voltage, so
that back-EMF acts continuously.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.symbolic import Motion, SymbolicRobot
from robot_model import ComputedTorque, InputError, JointPD, NoController, Robot, VoltageServo

__all__ = ["Goal", "command", "drive", "has_integral", "sample_time"]


@dataclass(frozen=True)
class Goal:
    """Reference position, velocity, acceleration and the integrated position error, n x 1 each."""

    position: ca.SX
    velocity: ca.SX
    acceleration: ca.SX
    integral: ca.SX


def sample_time(robot: Robot) -> float:
    """Interval over which the command is held [s]; 0 for a continuous controller."""
    return 0.0 if isinstance(robot.controller, NoController) else robot.controller.sample_time


def has_integral(robot: Robot) -> bool:
    """Whether the controller integrates the position error."""
    controller = robot.controller
    return isinstance(controller, JointPD) and any(_gains(robot, controller.ki).elements())


def command(robot: Robot, motion: Motion, goal: Goal, inertial: NDArray[np.float64]) -> ca.SX:
    """The command for every moving joint [N m or N; V for a voltage servo], n x 1.

    Args:
        robot: the description; joints without an actuator get no torque from `drive`.
        motion: state; its accelerations are not used.
        goal: what the controller follows.
        inertial: the numbers the controller believes in, shape (P,).
    """
    controller = robot.controller
    error, error_rate = goal.position - motion.position, goal.velocity - motion.velocity
    if isinstance(controller, JointPD):
        kp, ki, kd = (_gains(robot, gains) for gains in (controller.kp, controller.ki, controller.kd))
        torque = kp * error + kd * error_rate
        torque += ki * goal.integral if has_integral(robot) else 0
        return torque + _static_torque(robot, motion, inertial) if controller.gravity_feedforward else torque
    if isinstance(controller, ComputedTorque):
        kp, kd = _gains(robot, controller.kp), _gains(robot, controller.kd)
        wanted = goal.acceleration + kd * error_rate + kp * error
        return _torque_for(robot, replace(motion, acceleration=wanted), inertial)
    if isinstance(controller, VoltageServo):
        duty = _gains(robot, controller.gain) * error
        return controller.supply * ca.fmax(-1, ca.fmin(1, duty))
    return ca.SX.zeros(motion.position.shape[0])


def drive(robot: Robot, commanded: ca.SX, velocity: ca.SX) -> ca.SX:
    """Actuator torque at the joints made of the command, limited, n x 1 [N m or N].

    A voltage servo's winding carries i = (V - k n qd)/R and gives the torque n k i, with n the gear ratio
    and k the torque constant.

    Raises:
        InputError: a voltage servo's actuator lacks its torque constant or resistance.
    """
    torques = []
    for k, joint in enumerate(robot.moving_joints):
        actuator = joint.actuator
        if actuator is None:
            torques.append(ca.SX(0.0))
            continue
        torque = commanded[k]
        if isinstance(robot.controller, VoltageServo):
            if actuator.torque_constant is None or actuator.resistance is None:
                raise InputError(
                    f"robot '{robot.name}', joint '{joint.name}': a voltage servo needs the actuator's "
                    "torque_constant and resistance."
                )
            constant = actuator.gear_ratio * actuator.torque_constant
            torque = constant * (torque - constant * velocity[k]) / actuator.resistance
        limit = actuator.torque_limit
        torques.append(torque if limit is None else ca.fmax(-limit, ca.fmin(limit, torque)))
    return ca.densify(ca.vertcat(*torques))


def _torque_for(robot: Robot, motion: Motion, inertial: NDArray[np.float64]) -> ca.SX:
    """Nominal torque for the joint accelerations of `motion`; a free base reacts as it must.

    The base accelerations are eliminated: the base rows of Z ydd = z, which no actuator drives, give them.
    """
    numbers = ca.SX(inertial)
    free = robot.base.kind == "free"
    still = replace(motion, base_acceleration=ca.SX(6, 1))
    if not free:
        return SymbolicRobot(robot, still, numbers).inverse_dynamics
    reaction = SymbolicRobot(robot, still, numbers).base_acceleration
    return SymbolicRobot(robot, replace(motion, base_acceleration=reaction), numbers).inverse_dynamics[6:]


def _static_torque(robot: Robot, motion: Motion, inertial: NDArray[np.float64]) -> ca.SX:
    """Nominal torque that holds the joints still against gravity."""
    count = motion.position.shape[0]
    still = replace(motion, velocity=ca.SX(count, 1), acceleration=ca.SX(count, 1), base_velocity=ca.SX(6, 1))
    return _torque_for(robot, still, inertial)


def _gains(robot: Robot, value: float | tuple[float, ...]) -> ca.DM:
    count = len(robot.moving_joints)
    return ca.DM(np.broadcast_to(np.asarray(value, dtype=float), count).tolist())
