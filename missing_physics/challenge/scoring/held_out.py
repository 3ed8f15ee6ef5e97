"""Held-out error of a robot per joint: the logged torque that it does not explain.

The robot's torque is computed along the exact motion of the held-out recording, and its error passes through
the signal path of the log, so that a delay or a filter of the log is not counted as an error: the true model
leaves noise and rounding.
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
    """rms of the held-out torque residual of each robot [N m or N], by joint and name.

    Args:
        case: the case, with its exact motion and the signal path of its torque.
        robots: by name, `completed` by the case; None, or a robot without a torque, is left out.
        recording: held-out recording.

    Returns:
        For each joint with recorded torque the rms of each robot, and `noise`: that of the true torque.
    """
    exact, true = case.exact[1], case.noiseless(1)
    rows = {k: joint for k, joint in enumerate(case.joints) if f"{joint}.torque" in recording}
    recorded = {joint: recording[f"{joint}.torque"] for joint in rows.values()}
    found = {joint: {"noise": _rms(values - true[f"{joint}.torque"])} for joint, values in recorded.items()}
    for name, robot in robots.items():
        missing = None if robot is None else _missing(robot, exact)
        if missing is None:
            continue
        for k, joint in rows.items():
            left = recorded[joint] - logged(exact, joint) + case.path.passed_part(missing[:, k])
            found[joint][name] = _rms(left)
    return found


def _missing(robot: Robot, exact: Recording) -> Array | None:
    """Actuator torque minus the robot's, shape (N, n); None if it cannot be computed."""
    try:
        along = ArmAlong(robot, exact)
        model = along.nominal() + sum(
            (along.part(use) for use in robot.effects if _of_torque_sensor(use.effect, use.at)),
            np.zeros_like(along.torque),
        )
    except Exception:  # an answer may contain any robot
        return None
    missing = along.torque - model
    return missing if np.isfinite(missing).all() else None


def _of_torque_sensor(effect: str, at: str) -> bool:
    """Whether an effect is an error of a torque sensor, which is part of the torque expected in the log."""
    return isinstance(get_effect(effect), SensorEffect) and at.endswith(".torque")


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
