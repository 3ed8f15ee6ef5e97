"""Fixed steps: the orders of Exudyn's integrators, and unsupported cases."""

from __future__ import annotations

from math import log2

import numpy as np
import pytest
from exudyn_robots import pendulum, tumbling_robot
from flexible_robots import beam, mast

from exudyn_model import simulate
from robot_model import Actuator, EffectUse, InputError, Joint, JointPD, Link, Reference

START = Joint(
    name="hinge", parent="base", child="rod", axis=(0.0, 1.0, 0.0), initial_position=1.0, initial_velocity=2.0
)

ROBOT = pendulum(joints=(START,), reference=Reference(duration=1.0, sample_rate=50.0))


def error(step: float, integrator: str, exact: np.ndarray) -> float:
    run = simulate(ROBOT, sensors=False, step=step, integrator=integrator)
    return float(np.abs(run["hinge.position"] - exact).max())


def test_fixed_steps_have_the_order_of_their_rule() -> None:
    exact = simulate(ROBOT, sensors=False, step=1e-3, integrator="runge-kutta")["hinge.position"]
    for integrator, order, steps in (("trapezoidal", 2, (5e-3, 2.5e-3)), ("runge-kutta", 6, (2e-2, 1e-2))):
        coarse, fine = (error(step, integrator, exact) for step in steps)
        # Beyond rounding the next term is of relative size (w h)^2, w = 4 rad/s.
        assert log2(coarse / fine) == pytest.approx(order, abs=0.2)


def test_explicit_steps_give_accelerations_of_the_instant() -> None:
    robot = tumbling_robot(reference=Reference(duration=0.1, sample_rate=100.0))
    explicit = simulate(robot, sensors=False, step=1e-3, integrator="runge-kutta")
    implicit = simulate(robot, sensors=False, step=1e-4, integrator="trapezoidal", formulation="tree")
    for name in explicit:
        # h^2/12 of motion at 3 rad/s of the implicit run, 1e-8, times some tens in accelerations.
        np.testing.assert_allclose(explicit[name], implicit[name], atol=1e-5, err_msg=name)


def test_explicit_steps_refuse_memory_and_constraints() -> None:
    lag = EffectUse.model_validate({"effect": "actuator_lag", "at": "hinge", "time_constant": 0.01})
    robot = pendulum(controller=JointPD(kp=10.0)).with_effects(lag)
    with pytest.raises(InputError, match="forces that remember earlier instants"):
        simulate(robot, integrator="runge-kutta")
    with pytest.raises(InputError, match="does not carry constraints"):
        simulate(pendulum(), integrator="runge-kutta", formulation="redundant")


def test_modal_coordinates_have_a_fixed_order_and_sign() -> None:
    # Of a round beam both bending planes have the same frequencies: y comes first, then z.
    robot = mast(links=(Link(name="pole", beam=beam(tip={"mass": 3.0})),), gravity=(0.0, 0.0, -0.02))
    found = simulate(robot, sensors=False)
    np.testing.assert_allclose(found["pole.modal_coordinate.1"], 0.0, atol=1e-12)
    deflection, second = found["pole.tip_deflection.z"], found["pole.modal_coordinate.2"]
    assert np.abs(second).max() > 1e-5
    assert np.all(deflection * second >= 0)  # positive modes move the tip along the positive axis


@pytest.mark.proof
def test_a_diverging_constrained_run_reports_time_and_state() -> None:
    robot = pendulum(controller=JointPD(kp=-1e4), joints=(START.model_copy(update={"actuator": Actuator()}),))
    with pytest.raises(InputError, match=r"diverges after 0\.\d+ s \(hinge at .* moving"):
        simulate(robot, formulation="redundant", integrator="trapezoidal")
