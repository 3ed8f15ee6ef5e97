"""Gains of controllers, one for each joint."""

from __future__ import annotations

from robot_model import Robot

__all__ = ["gains"]


def gains(robot: Robot, given: float | tuple[float, ...]) -> list[float]:
    """One number per moving joint; a single one is for all."""
    count = len(robot.moving_joints)
    return [float(value) for value in given] if isinstance(given, tuple) else [float(given)] * count
