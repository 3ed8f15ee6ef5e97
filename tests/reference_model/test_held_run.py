"""Linearly implicit steps between a sampled controller's commands, and runs along tables."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

import reference_model.steppers.held_pieces as held_pieces
import reference_model.steppers.held_run as held_run
from reference_model.control.motion import reference_function
from reference_model.plant.closed_loop import Plant
from reference_model.simulation import simulate
from reference_model.steppers.integration import along_tables, cvodes_options, integrate, symbols
from robot_model import EffectUse, JointPD, Robot, Table, load_robot

#: Smoothed friction of joints that rest and creep, and bristles, are stiff at 2 ms.
FRICTION = (
    EffectUse(effect="coulomb_friction", at="joint1", torque=3.0),
    EffectUse(
        effect="lugre_friction",
        at="joint2",
        coulomb_torque=1.0,
        static_torque=1.5,
        stribeck_velocity=1e-3,
        bristle_stiffness=1e5,
        bristle_damping=300.0,
    ),
)


def stiff(**controller: float) -> Robot:
    robot = load_robot("two_link_arm")
    assert robot.reference is not None
    reference = robot.reference.model_copy(update={"duration": 1.0, "sample_rate": 250.0})
    more = {"reference": reference, "effects": (*robot.effects, *FRICTION)}
    more["controller"] = JointPD(kind="pd", kp=400.0, kd=40.0, sample_time=2e-3, **controller)
    return robot.model_copy(update=more)


@pytest.mark.parametrize("integral", [0.0, 100.0], ids=["proportional", "integral"])
@pytest.mark.parametrize(
    ("rtol", "allowed"), [(1e-5, 1e-5), pytest.param(1e-7, 1e-7, marks=pytest.mark.proof)]
)
def test_stiff_friction_under_a_sampled_controller(
    integral: float, rtol: float, allowed: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Against CVODES at tolerances far below; errors add up over five hundred steps of either method."""
    robot = stiff(ki=integral)
    right = simulate(robot, sensors=False, rtol=1e-10, atol=1e-12)
    monkeypatch.setattr(held_run, "advance_held", None)  # what it cannot do is not left to CVODES here
    found = simulate(robot, sensors=False, rtol=rtol, atol=rtol / 100, integrator="rosenbrock")
    for joint in ("joint1", "joint2"):
        assert np.abs(found[f"{joint}.position"] - right[f"{joint}.position"]).max() < allowed
        np.testing.assert_allclose(
            found[f"{joint}.torque"], right[f"{joint}.torque"], atol=3e3 * allowed, rtol=0
        )


def test_a_piece_that_takes_too_many_steps_is_left_to_cvodes(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = stiff()
    found = simulate(robot, sensors=False, rtol=1e-8, atol=1e-10)
    monkeypatch.setattr(held_run, "MOST_STEPS", 0)
    left = simulate(robot, sensors=False, rtol=1e-8, atol=1e-10, integrator="rosenbrock")
    # the same steps of the same methods but for those that an explicit step was not tried for
    np.testing.assert_allclose(left["joint1.position"], found["joint1.position"], atol=1e-7)


@pytest.mark.parametrize("integral", [0.0, 100.0], ids=["proportional", "integral"])
@pytest.mark.parametrize(
    "rate",
    [
        pytest.param(250.0, id="on the controller's instants", marks=pytest.mark.proof),
        pytest.param(333.0, id="between them"),
    ],
)
def test_chains_equal_single_steps(integral: float, rate: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Some pieces are left to the implicit method, so that chains end in their midst."""
    robot = stiff(ki=integral)
    assert robot.reference is not None
    reference = robot.reference.model_copy(update={"sample_rate": rate})
    robot = robot.model_copy(update={"reference": reference})
    left: list[float] = []
    attempt = held_run._Implicit.__call__

    def counted(self: Any, state: Any, command: Any, now: float, then: float) -> Any:
        left.append(now)
        return attempt(self, state, command, now, then)

    monkeypatch.setattr(held_run._Implicit, "__call__", counted)
    runs = []
    for lengths in ((1,), held_pieces.LENGTHS):
        monkeypatch.setattr(held_pieces, "LENGTHS", lengths)
        runs.append(simulate(robot, sensors=False, integrator="rosenbrock"))
    pieces = 2 * (held_pieces._Schedule.of(runs[0].time, 2e-3).instants.size - 1)
    assert 0.05 * pieces < len(left) < 0.95 * pieces
    for name in ("joint1.position", "joint2.torque"):
        # the same operations, in another order here and there
        np.testing.assert_allclose(runs[0][name], runs[1][name], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("rate", [500.0, 250.0, 333.0, 1234.5])
def test_every_output_is_an_instant_of_the_schedule(rate: float) -> None:
    hold = 2e-3
    time = np.arange(int(0.9 * rate)) / rate
    found = held_pieces._Schedule.of(time, hold)
    np.testing.assert_allclose(found.instants[found.wanted], time, atol=1e-11)
    ticks = np.arange(int(time[-1] / hold + 1e-6) + 1) * hold
    np.testing.assert_array_equal(found.instants[found.acts], ticks)
    # what is one instant is not two
    assert np.diff(found.instants).min() > held_pieces.SAME_INSTANT * hold


@pytest.mark.parametrize("name", ["two_link_arm", "flexible_space_robot_planar"])
def test_derivatives_of_a_loop_with_a_table_agree_with_casadi(name: str) -> None:
    """Right-hand side and Jacobian handed to CVODES, against those that CasADi makes of the whole graph."""
    robot = load_robot(name)
    assert robot.reference is not None
    own = reference_function(robot)
    times = np.linspace(0.0, 2.0, 30)
    places = np.array([own(t)[0].full()[:, 0] for t in times])
    tables = tuple(
        Table(kind="table", joint=joint.name, times=tuple(times), positions=tuple(places[:, k]))
        for k, joint in enumerate(robot.moving_joints)
    )
    reference = robot.reference.model_copy(update={"joints": tables, "duration": 0.2})
    robot = robot.model_copy(update={"reference": reference})
    plant, along = Plant(robot), reference_function(robot)
    t, x, kind = symbols(along, plant.layout.size)
    assert kind is ca.MX
    goal = along(t)
    rate = plant.rate(t, x, goal[0], plant.command(t, x, *goal))
    dae = {"t": t, "x": x, "ode": rate}
    whole = ca.integrator("whole", "cvodes", dae, 0.0, [0.1, 0.2], cvodes_options(1e-9, 1e-11))
    chance = np.random.default_rng(3)
    start = plant.initial(along)
    state = start + 1e-2 * chance.standard_normal(start.size)
    cache = along_tables(plant, along)
    for key, function in cache.items():
        for mine, theirs in zip(
            function(0.73, state, [], [], []), whole.get_function(key)(0.73, state, [], [], [])
        ):
            scale = np.abs(theirs.full()).max(initial=0.0)
            # rounding of some thousand operations
            np.testing.assert_allclose(mine.full(), theirs.full(), atol=1e-9 * scale)
    course = integrate(plant, along, np.array([0.0, 0.1, 0.2]), hold=0.0, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(course.states[1:], whole(x0=start)["xf"].full().T, atol=1e-8)
