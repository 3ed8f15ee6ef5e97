"""Held-out error of a robot per joint: how much of the logged torque it does not account for.

The robot's torque is worked out along the exact motion of the held-out recording, and what it lacks goes the
way of the torque into the log, so that a delay or a filter of the log is nobody's error: what the true model
leaves is noise and rounding.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from missing_physics.challenge.concealing.conceal import Concealed
from missing_physics.challenge.concealing.recorded_torque import logged
from missing_physics.challenge.torques.along import ArmAlong
from reference_model.effects.base import SensorEffect
from reference_model.effects.catalogue import get_effect
from robot_model import Recording, Robot

__all__ = ["held_out_errors"]

Array = NDArray[np.float64]


def held_out_errors(
    case: Concealed, robots: Mapping[str, Robot | None], recording: Recording
) -> dict[str, dict[str, float]]:
    """rms of the held-out torque that each robot leaves [N m or N], by joint and name.

    Args:
        case: its exact motion, and how its torque was recorded.
        robots: by name, as the case `completed` them; None, or one that cannot be worked out, is left out.
        recording: held out.

    Returns:
        By joint whose torque is recorded the rms of each robot, and `noise`: what the true torque leaves.
    """
    exact, true = case.exact[1], case.noiseless(1)
    rows = {k: joint for k, joint in enumerate(case.joints) if f"{joint}.torque" in recording}
    said = {joint: recording[f"{joint}.torque"] for joint in rows.values()}
    found = {joint: {"noise": _rms(values - true[f"{joint}.torque"])} for joint, values in said.items()}
    for name, robot in robots.items():
        missing = None if robot is None else _missing(robot, exact)
        if missing is None:
            continue
        for k, joint in rows.items():
            left = said[joint] - logged(exact, joint) + case.path.passed_part(missing[:, k])
            found[joint][name] = _rms(left)
    return found


def _missing(robot: Robot, exact: Recording) -> Array | None:
    """What the robot's torque falls short of the actuators', shape (N, n); None where it has no torque."""
    try:
        along = ArmAlong(robot, exact)
        model = along.nominal() + sum(
            (along.part(use) for use in robot.effects if _of_torque_sensor(use.effect, use.at)),
            np.zeros_like(along.torque),
        )
    except Exception:  # an answer may be any robot
        return None
    missing = along.torque - model
    return missing if np.isfinite(missing).all() else None


def _of_torque_sensor(effect: str, at: str) -> bool:
    """An error of a torque's sensor: part of what the robot expects in the log."""
    return isinstance(get_effect(effect), SensorEffect) and at.endswith(".torque")


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
