"""Desired accelerations of a sliding mode controller; see `robot_model.SlidingMode`."""

from __future__ import annotations

import casadi as ca

from robot_model import SlidingMode

__all__ = ["reaching_acceleration"]


def reaching_acceleration(
    controller: SlidingMode, gains: dict[str, ca.DM], error: ca.SX, error_rate: ca.SX
) -> ca.SX:
    """slope ed + a(s), to be added to the reference acceleration [rad/s^2 or m/s^2], n x 1.

    Args:
        controller: its reaching law.
        gains: `slope`, `rate`, `proportional`, `boundary_layer`, n x 1 each.
        error, error_rate: reference minus measured [rad or m, and per s], n x 1.
    """
    surface = error_rate + gains["slope"] * error
    reached = gains["rate"] * ca.fmax(-1, ca.fmin(1, surface / gains["boundary_layer"]))
    if controller.reaching == "exponential":
        reached = reached + gains["proportional"] * surface
    return gains["slope"] * error_rate + reached
