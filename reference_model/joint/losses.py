"""Power dissipated in joints by friction and by the windings' resistance."""

from __future__ import annotations

import casadi as ca

from robot_model import Robot

__all__ = ["losses", "winding_gain"]


def losses(robot: Robot, friction: ca.SX, velocity: ca.SX, torque: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Losses of friction, -T_f qd, and of the armatures, R i^2 with i = T/(n k_t) [W], n x 1 each.

    Args:
        robot: the description; an actuator without torque constant or resistance has no armature loss.
        friction: at the joints [N m or N], n x 1.
        velocity: of the joints [rad/s or m/s], n x 1.
        torque: of the drives [N m or N], n x 1.
    """
    return -friction * velocity, winding_gain(robot) * torque**2


def winding_gain(robot: Robot) -> ca.DM:
    """R/(n k_t)^2 of every drive [W/(N m)^2 or W/N^2], n x 1."""
    gains = []
    for drive in robot.drives:
        motor = drive.actuator
        if motor is None or motor.torque_constant is None or motor.resistance is None:
            gains.append(0.0)
        else:
            gains.append(motor.resistance / (motor.gear_ratio * motor.torque_constant) ** 2)
    return ca.DM(gains)
