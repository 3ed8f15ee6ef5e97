"""The Rosenbrock methods in compiled code: orders, derivatives, and the motion that CVODES finds."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from reference_model.codegen.code_cache import FOLDER_VARIABLE
from reference_model.codegen.compiled import SWITCH, compiler
from reference_model.control.motion import reference_function
from reference_model.plant.closed_loop import Plant
from reference_model.simulation import simulate
from reference_model.steppers.integration import symbols
from reference_model.steppers.rosenbrock_run import COARSE, RosenbrockRun
from reference_model.steppers.rosenbrock_tables import RODAS4, RODAS5P, Tables
from robot_model import EffectUse, InputError, Recording, Robot, load_robot

Array = NDArray[np.float64]

compiled_only = pytest.mark.skipif(compiler() is None, reason="no C compiler on the path")

LUGRE = {
    "effect": "lugre_friction",
    "coulomb_torque": 0.5,
    "static_torque": 0.75,
    "stribeck_velocity": 0.25,
    "bristle_stiffness": 2000.0,
    "bristle_damping": 20.0,
}
LOADED = {
    **LUGRE,
    "load_coefficient": 0.1,
    "load_static_coefficient": 0.15,
    "load_stiffness": 400.0,
    "load_damping": 4.0,
}
ELASTIC = {"effect": "joint_elasticity", "stiffness": 3000.0, "damping": 3.0}
SLOSH = {"effect": "slosh", "mass": 3.0, "frequency": 2.0, "damping_ratio": 0.03, "x": 0.3, "y": -0.2}


@pytest.fixture(autouse=True)
def compiling(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SWITCH, "on")


def short(name: str, *uses: dict[str, object], duration: float = 0.5) -> Robot:
    robot = load_robot(name)
    assert robot.reference is not None
    settings = {"duration": duration, "sample_rate": 100.0}
    reference = robot.reference.model_copy(update=settings)
    effects = tuple(EffectUse.model_validate(use) for use in uses)
    return robot.model_copy(update={"reference": reference, "effects": effects})


def at_joints(robot: Robot, use: dict[str, object]) -> list[dict[str, object]]:
    return [{**use, "at": joint.name} for joint in robot.moving_joints]


def largest_difference(one: Recording, other: Recording) -> float:
    return max(
        float(np.abs(one[c] - other[c]).max() / (1e-3 + np.abs(other[c]).max())) for c in other.channels
    )


def rate(t: float, x: Array) -> Array:
    return np.array([np.cos(t) * x[1] + x[0] * x[1], -x[0] + np.sin(2 * t) - 0.3 * x[1] ** 3])


def slopes(t: float, x: Array) -> tuple[Array, Array]:
    in_time = np.array([-np.sin(t) * x[1], 2 * np.cos(2 * t)])
    return in_time, np.array([[x[1], np.cos(t) + x[0]], [-1.0, -0.9 * x[1] ** 2]])


def stepped(tables: Tables, steps: int) -> tuple[Array, Array, float]:
    """The end of a run over 1 s, the middle of its last step, and the estimated error of the first step."""
    h, x, now, first = 1.0 / steps, np.array([0.7, -0.4]), 0.0, 0.0
    middle = x
    for _ in range(steps):
        in_time, jacobian = slopes(now, x)
        u: list[Array] = []
        for k in range(len(tables.instants)):
            place = x + sum((tables.places[k, j] * u[j] for j in range(k)), start=np.zeros(2))
            right = rate(now + tables.instants[k] * h, place) + tables.slopes[k] * h * in_time
            right += sum((tables.shares[k, j] / h * u[j] for j in range(k)), start=np.zeros(2))
            u.append(np.linalg.solve(np.eye(2) / (tables.gamma * h) - jacobian, right))
        y = place + u[-1]
        bow = sum(0.5**p * (row @ np.array(u)) for p, row in enumerate(tables.dense))
        middle, first = 0.5 * x + 0.5 * (y + 0.5 * bow), first or float(np.abs(u[-1]).max())
        x, now = y, now + h
    return x, middle, first


@pytest.mark.parametrize("tables", [RODAS4, RODAS5P], ids=["order 4", "order 5"])
def test_results_errors_and_interpolation_have_their_nominal_orders(tables: Tables) -> None:
    finest = stepped(RODAS5P, 400)[0]
    ends = [np.abs(stepped(tables, steps)[0] - finest).max() for steps in (20, 40)]
    assert np.log2(ends[0] / ends[1]) == pytest.approx(tables.order, abs=0.3)
    # one step's estimate is of the order of the result, as the embedded one's local error is
    estimates = [stepped(tables, steps)[2] for steps in (20, 40)]
    assert np.log2(estimates[0] / estimates[1]) == pytest.approx(tables.order, abs=0.3)
    # the middle of the last of n steps, against a run whose step ends there
    halves = []
    for steps in (10, 20):
        middle = stepped(tables, steps)[1]
        fine = 2 * steps * 20
        x, now = np.array([0.7, -0.4]), 0.0
        h = 1.0 / fine
        for _ in range(round(fine * (1 - 0.5 / steps))):  # Runge and Kutta's method, far finer
            k1 = rate(now, x)
            k2 = rate(now + h / 2, x + h / 2 * k1)
            k3 = rate(now + h / 2, x + h / 2 * k2)
            k4 = rate(now + h, x + h * k3)
            x, now = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), now + h
        halves.append(np.abs(middle - x).max())
    assert np.log2(halves[0] / halves[1]) > tables.order - 0.5  # a step's error is of one order more


def test_both_methods_are_stable_for_any_stiffness() -> None:
    """On x' = z x the result over x tends to zero with z to minus infinity, and stays below one."""
    for tables in (RODAS4, RODAS5P):
        for z in (-1.0, -30.0, -1e3, -1e9):
            u: list[float] = []
            for k in range(len(tables.instants)):
                place = 1 + sum(tables.places[k, j] * u[j] for j in range(k))
                shares = sum(tables.shares[k, j] * u[j] for j in range(k))
                u.append((z * place + shares) / (1 / tables.gamma - z))
            assert abs(place + u[-1]) < min(1.0, 50 / abs(z))  # L-stable: it falls with z at last


@pytest.mark.parametrize(
    ("name", "uses"),
    [
        ("two_link_arm", "loads"),
        ("six_joint_space_arm", "nothing"),
        ("flexible_space_robot", "loads"),
        ("two_link_arm", "gears"),
        ("flexible_space_robot_planar", "slosh"),
    ],
)
def test_implicit_derivatives_equal_those_of_the_solution(name: str, uses: str) -> None:
    robot = load_robot(name)
    chosen = {
        "loads": at_joints(robot, LOADED),
        "gears": at_joints(robot, ELASTIC),
        "slosh": [{**SLOSH, "at": "base"}],
        "nothing": [],
    }[uses]
    robot = short(name, *chosen)
    plant, reference = Plant(robot), reference_function(robot)
    t, x, kind = symbols(reference, plant.layout.size)
    goal = reference(t)
    command, w = plant.command(t, x, *goal), kind.sym("w", plant.unknowns)
    state = plant.initial(reference) + 1e-3 * np.random.default_rng(3).normal(size=plant.layout.size)
    instant = 0.123
    whole = plant.rate(t, x, goal[0], command)
    right = ca.Function("right", [t, x], [ca.densify(ca.jacobian(whole, ca.vertcat(t, x)))])(instant, state)
    found, solved = ca.Function("solved", [t, x], list(plant.solved()(t, x, goal[0], command)))(
        instant, state
    )
    moved, missed = plant.implicit()(t, x, goal[0], command, w)
    parts = [ca.densify(ca.jacobian(part, by)) for part in (moved, missed) for by in (ca.vertcat(t, x), w)]
    values = ca.Function("parts", [t, x, w], [moved, missed, *parts])(instant, state, solved)
    again, gap, e_x, e_w, r_x, r_w = (value.full() for value in values)
    np.testing.assert_allclose(again, found.full(), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(gap, 0.0, atol=1e-7)  # Newton's passes through loads and friction
    wanted = right.full()
    scale = 1 + np.abs(wanted).max()
    np.testing.assert_allclose((e_x - e_w @ np.linalg.solve(r_w, r_x)) / scale, wanted / scale, atol=1e-9)


@compiled_only
def test_it_agrees_with_cvodes_for_load_dependent_bristles() -> None:
    robot = load_robot("two_link_arm")
    robot = short("two_link_arm", *at_joints(robot, LOADED), duration=1.0)
    ours = simulate(robot, sensors=False, integrator="rosenbrock", rtol=1e-9, atol=1e-11)
    theirs = simulate(robot, sensors=False, rtol=1e-11, atol=1e-13)
    assert ours.channels.keys() == theirs.channels.keys()
    assert largest_difference(ours, theirs) < 1e-6


@compiled_only
@pytest.mark.parametrize(
    ("name", "uses"),
    [
        ("flexible_space_robot_planar", [{**SLOSH, "at": "base"}]),
        ("two_link_arm", [{**ELASTIC, "at": "joint1"}]),
    ],
)
def test_it_agrees_with_cvodes_for_flexible_links_slosh_and_gears(
    name: str, uses: list[dict[str, object]]
) -> None:
    robot = short(name, *uses, duration=0.3)
    ours = simulate(robot, sensors=False, integrator="rosenbrock", rtol=1e-9, atol=1e-11, work=True)
    theirs = simulate(robot, sensors=False, rtol=1e-11, atol=1e-13, work=True)
    assert ours.channels.keys() == theirs.channels.keys()
    assert largest_difference(ours, theirs) < 1e-5


@compiled_only
def test_bristles_need_few_steps_and_the_error_follows_the_tolerance() -> None:
    robot = load_robot("two_link_arm")
    robot = short("two_link_arm", *at_joints(robot, LUGRE), duration=2.0)
    run, time = RosenbrockRun(Plant(robot), reference_function(robot)), np.linspace(0.0, 2.0, 11)
    right = run(time, rtol=1e-11, atol=1e-13)[:, :2]
    errors = []
    for tolerance in (COARSE, 1e-5, 1e-7):
        errors.append(np.abs(run(time, rtol=tolerance, atol=1e-2 * tolerance)[:, :2] - right).max())
        if tolerance == COARSE:
            # bristles relax within 1e-4 s at 1 rad/s: explicit steps would number tens of thousands
            assert run.steps < 100
            assert run.derivatives == run.steps
    assert errors[0] < 1e-2
    assert errors[0] > 30 * errors[1] > 600 * errors[2]


@compiled_only
def test_dense_output_is_as_accurate_as_the_steps_and_runs_are_independent() -> None:
    robot = short("two_link_arm", duration=1.0)
    run = RosenbrockRun(Plant(robot), reference_function(robot))
    coarse, fine = np.linspace(0.0, 1.0, 3), np.linspace(0.0, 1.0, 501)
    right = run(fine, rtol=1e-10, atol=1e-12)
    for tolerance in (COARSE, 1e-6):  # of either method
        run(coarse, rtol=tolerance, atol=1e-2 * tolerance)
        few = run.steps
        found = run(fine, rtol=tolerance, atol=1e-2 * tolerance)
        assert run.steps == few  # instants do not make steps
        gaps = np.abs(found - right).max(axis=1)
        assert gaps.max() < 5 * gaps[::250].max() + 10 * tolerance * 1e-2
        np.testing.assert_array_equal(run(fine, rtol=tolerance, atol=1e-2 * tolerance), found)


@compiled_only
def test_unsupported_runs_are_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    robot = short("two_link_arm", duration=0.1)
    with pytest.raises(InputError, match="integrators of their own"):
        simulate(robot, integrator="rosenbrock", stiction=True)
    unlimited = tuple(
        joint.model_copy(update={"actuator": joint.actuator.model_copy(update={"torque_limit": None})})
        for joint in robot.joints
        if joint.actuator
    )
    away = robot.controller.model_copy(update={"kp": -1e9, "kd": 0.0})
    runaway = robot.model_copy(update={"controller": away, "joints": unlimited})
    with pytest.raises(InputError, match=r"stopped after t = 0\.?\d* s because .* \(joint1 at"):
        simulate(runaway, sensors=False, integrator="rosenbrock")
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    monkeypatch.setenv(SWITCH, "off")
    with pytest.raises(InputError, match=r"Rosenbrock integrator runs as compiled C only"):
        simulate(robot, integrator="rosenbrock")
