"""A held base and the two quaternions of one attitude."""

from __future__ import annotations

import casadi as ca
import numpy as np

from reference_model.control.decoupling import base_error
from reference_model.dynamics.symbolic import Motion, SymbolicRobot
from robot_model import Base, Joint, Link, Robot


def error_at(attitude: np.ndarray) -> np.ndarray:
    robot = Robot(
        name="held",
        base=Base(kind="free", mass=5.0, inertia=(1.0, 1.0, 1.0), rpy=(0.3, -0.2, 0.5)),
        links=(Link(name="arm", mass=1.0, inertia=(0.1, 0.1, 0.1)),),
        joints=(Joint(name="hinge", parent="base", child="arm"),),
    )
    base = SymbolicRobot.still_base(robot) | {"attitude": ca.SX(attitude)}
    motion = Motion(ca.SX(1, 1), ca.SX(1, 1), ca.SX(1, 1), **base)
    return ca.evalf(ca.densify(base_error(robot, motion)[0])).full().ravel()


def test_both_quaternions_of_an_attitude_lead_back_the_same_way() -> None:
    chance = np.random.default_rng(1)
    for attitude in chance.normal(size=(5, 4)):
        np.testing.assert_array_equal(error_at(attitude), error_at(-attitude))
