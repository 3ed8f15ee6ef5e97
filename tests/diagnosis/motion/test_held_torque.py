"""The zero-order hold of a sampled controller is not an actuator lag."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from missing_physics.motion.recorded import make_dynamics
from reference_model.simulation import simulate
from robot_model import load_robot


def unexplained(period: float, rate: float, *, stated: bool) -> NDArray[np.float64]:
    """rms of measured less needed torque [N m], (2,), of a perfectly measured arm.

    Its controller acts every `period` [s], which its file states or not, and is recorded at `rate` [Hz].
    """
    arm = load_robot("two_link_arm")
    assert arm.reference is not None
    changes = {
        "controller": arm.controller.model_copy(update={"sample_time": period}),
        "reference": arm.reference.model_copy(update={"sample_rate": rate, "duration": 8.0}),
        "sensors": (),
        "effects": (),
    }
    robot = arm.model_copy(update=changes)
    continuous = robot.controller.model_copy(update={"sample_time": 0.0})
    file = robot if stated else robot.model_copy(update={"controller": continuous})
    [dynamics] = make_dynamics(file, [simulate(robot, sensors=False)], cutoff=8.0)
    left = dynamics.motion.low_pass.reduce(dynamics.motion.torque - dynamics.torque)
    return np.asarray(np.sqrt(np.mean(left**2, axis=0)))


@pytest.mark.parametrize(
    ("period", "rate"), [(0.002, 250.0), (0.004, 500.0)], ids=["recorded seldom", "recorded often"]
)
def test_zero_order_hold_of_a_torque_is_accounted_for(period: float, rate: float) -> None:
    """What is left is a quarter or less of what a lag of half a period leaves; the filter's own error."""
    stated, unstated = (unexplained(period, rate, stated=known) for known in (True, False))
    assert np.all(stated < 0.3 * unstated)
