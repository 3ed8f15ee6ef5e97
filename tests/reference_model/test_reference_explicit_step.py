"""The explicit step between a sampled controller's instants."""

from __future__ import annotations

import casadi as ca
import numpy as np
from test_reference_simulation import FRICTION, columns, moving_robot

from reference_model.simulation import simulate
from reference_model.steppers.explicit_step import explicit_step


def pendulum() -> ca.Function:
    """Angle and rate of a driven pendulum, one step: (x, start, length) -> state, relative error."""
    x, start, length = ca.SX.sym("x", 2), ca.SX.sym("t"), ca.SX.sym("h")

    def rate(part: float, state: ca.SX) -> ca.SX:
        return ca.vertcat(state[1], -9 * ca.sin(state[0]) + ca.cos(2 * (start + part * length)))

    step = explicit_step(rate, x, length, rtol=0.0, atol=1.0)
    return ca.Function("pendulum", [x, start, length], list(step))


def after_one_second(steps: int) -> np.ndarray:
    step, state = pendulum(), ca.DM([1.0, 0.0])
    for k in range(steps):
        state = step(state, k / steps, 1 / steps)[0]
    return state.full().ravel()


def test_it_converges_with_order_five() -> None:
    finest = after_one_second(640)  # 1e-12 of the others' errors
    errors = [np.abs(after_one_second(steps) - finest).max() for steps in (20, 40, 80)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders[0] > orders[1]  # it comes down to five as the steps shrink
    np.testing.assert_allclose(orders, 5, atol=0.45)


def test_its_error_estimate_is_of_order_five_in_one_step_and_not_too_small() -> None:
    step, start = pendulum(), ca.DM([1.0, 0.3])
    lengths = (0.2, 0.1, 0.05)
    estimates = np.array([float(step(start, 0.0, h)[1]) for h in lengths])
    np.testing.assert_allclose(estimates[:-1] / estimates[1:], 32, rtol=0.25)  # the pair's order is four
    for h, estimate in zip(lengths, estimates):
        fine = start
        for k in range(50):
            fine = step(fine, k * h / 50, h / 50)[0]
        error = np.abs((step(start, 0.0, h)[0] - fine).full()).max()
        assert error < estimate


def test_a_sampled_run_with_friction_keeps_its_tolerance() -> None:
    """Reversals are stiff and go to CVODES, the rest is explicit: together as accurate as was asked for."""

    def run(tolerance: float) -> np.ndarray:
        gains = {"kind": "computed_torque", "kp": 100.0, "kd": 20.0, "sample_time": 0.004}
        robot = moving_robot("fixed", FRICTION, controller=gains)
        reference = robot.reference.model_copy(update={"sample_rate": 250.0})
        robot = robot.model_copy(update={"reference": reference})
        return columns(
            simulate(robot, sensors=False, rtol=tolerance, atol=tolerance / 100), robot, "position"
        )

    fine = run(1e-12)
    errors = [np.abs(run(tolerance) - fine).max() for tolerance in (1e-6, 1e-8)]
    # errors of order one come from a few hundred steps, each allowed the tolerance times a position of 0.3
    assert errors[0] < 1e-4
    assert errors[1] < 1e-6
    assert errors[1] < 0.1 * errors[0]
