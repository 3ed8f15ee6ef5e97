"""The explicit integrator in compiled code: agreement with CVODES to the requested tolerance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reference_model.codegen.code_cache import FOLDER_VARIABLE
from reference_model.codegen.compiled import SWITCH, compiler
from reference_model.control.motion import reference_function
from reference_model.plant.closed_loop import Plant
from reference_model.simulation import simulate
from reference_model.steppers.explicit_run import BLOCK, ExplicitRun
from robot_model import InputError, Recording, Robot, load_robot

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler on the path")

#: A mass on a rail, held by a proportional controller alone: w^2 = kp / m.
MASS, STIFFNESS = 2.0, 50.0


@pytest.fixture(autouse=True)
def compiling(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SWITCH, "on")


def slider(**changes: object) -> Robot:
    return Robot.model_validate(
        {
            "name": "slider",
            "links": [{"name": "mass", "mass": MASS, "inertia": [1.0, 1.0, 1.0]}],
            "joints": [
                {
                    "name": "rail",
                    "kind": "prismatic",
                    "parent": "base",
                    "child": "mass",
                    "axis": [1.0, 0.0, 0.0],
                    "initial_velocity": 1.0,
                    "actuator": {},
                }
            ],
            "controller": {"kind": "pd", "kp": STIFFNESS},
            "reference": {"duration": 4.0, "sample_rate": 100.0},
            **changes,
        }
    )


def ready(robot: Robot) -> ExplicitRun:
    return ExplicitRun(Plant(robot), reference_function(robot))


def short(name: str) -> Robot:
    robot = load_robot(name)
    assert robot.reference is not None
    settings = {"duration": 1.0, "sample_rate": 100.0}
    return robot.model_copy(update={"reference": robot.reference.model_copy(update=settings)})


def largest_difference(one: Recording, other: Recording) -> float:
    return max(
        float(np.abs(one[c] - other[c]).max() / (1e-3 + np.abs(other[c]).max())) for c in other.channels
    )


def test_an_oscillator_follows_its_closed_form() -> None:
    time = np.linspace(0.0, 10.0, 1001)
    states = ready(slider())(time, rtol=1e-10, atol=1e-12)
    w = np.sqrt(STIFFNESS / MASS)
    # 50 rad at 1e-10 a step: a few hundred steps' errors of 1e-10 of the amplitude
    np.testing.assert_allclose(states[:, 0], np.sin(w * time) / w, atol=1e-8)
    np.testing.assert_allclose(states[:, 1], np.cos(w * time), atol=5e-8)


def test_its_error_follows_the_tolerance() -> None:
    run, time = ready(slider()), np.linspace(0.0, 10.0, 11)
    w = np.sqrt(STIFFNESS / MASS)
    errors, steps = [], []
    for tolerance in (1e-4, 1e-7, 1e-10):
        errors.append(np.abs(run(time, rtol=tolerance, atol=tolerance)[:, 0] - np.sin(w * time) / w).max())
        steps.append(run.steps)
    assert errors[0] > 30 * errors[1] > 900 * errors[2]
    # order 8: a thousandth of the error for 10^(3/8) = 2.4 times the steps
    assert 1.5 < steps[2] / steps[1] < 4.0


def test_dense_output_is_as_accurate_as_the_steps() -> None:
    run = ready(slider())
    coarse, fine = np.linspace(0.0, 4.0, 3), np.linspace(0.0, 4.0, 4001)
    run(coarse, rtol=1e-8, atol=1e-10)
    few = run.steps
    states = run(fine, rtol=1e-8, atol=1e-10)
    assert run.steps < 1.5 * few + 3 * len(fine) / BLOCK  # instants do not make steps, blocks hardly any
    w = np.sqrt(STIFFNESS / MASS)
    # interpolated to order 7 where steps are of order 8: within some tens of the tolerance
    np.testing.assert_allclose(states[:, 0], np.sin(w * fine) / w, atol=3e-7)


@pytest.mark.parametrize("name", ["two_link_arm", "flexible_space_robot"])
def test_it_agrees_with_cvodes(name: str) -> None:
    robot = short(name).model_copy(update={"effects": ()})
    ours = simulate(robot, sensors=False, integrator="explicit", rtol=1e-10, atol=1e-12)
    theirs = simulate(robot, sensors=False, rtol=1e-11, atol=1e-13)
    assert ours.channels.keys() == theirs.channels.keys()
    # CVODES' error grows over its thousands of steps; accelerations feel it most
    assert largest_difference(ours, theirs) < 1e-6


def test_bristles_need_more_steps_for_the_same_trajectory() -> None:
    friction = {"effect": "lugre_friction", "at": "rail", "coulomb_torque": 1.0, "static_torque": 1.5}
    friction |= {"stribeck_velocity": 0.05, "bristle_stiffness": 2e3, "bristle_damping": 10.0}
    robot = slider(effects=[friction])
    ours = simulate(robot, sensors=False, integrator="explicit")
    theirs = simulate(robot, sensors=False, rtol=1e-11, atol=1e-13)
    assert np.abs(ours["rail.position"] - theirs["rail.position"]).max() < 1e-7


def test_runs_are_independent() -> None:
    run, time = ready(slider()), np.linspace(0.0, 4.0, 101)
    first = run(time, rtol=1e-6, atol=1e-8)
    run(time, rtol=1e-3, atol=1e-3)
    np.testing.assert_array_equal(run(time, rtol=1e-6, atol=1e-8), first)


def test_a_diverging_motion_is_refused_with_time_and_state() -> None:
    robot = slider(controller={"kind": "pd", "kp": -5e6}, reference={"duration": 4.0, "sample_rate": 20.0})
    with pytest.raises(InputError, match=r"stopped after t = 0\.\d+ s because .* \(rail at"):
        simulate(robot, sensors=False, integrator="explicit")


def test_unsupported_runs_are_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    sampled = {"kind": "pd", "kp": 1.0, "sample_time": 0.01}
    with pytest.raises(InputError, match="continuous controllers"):
        simulate(slider(controller=sampled), integrator="explicit")
    with pytest.raises(InputError, match="integrators of their own"):
        simulate(slider(), integrator="explicit", stiction=True)
    with pytest.raises(InputError, match="integrators of their own"):
        simulate(slider(), integrator="explicit", step=1e-3)
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    monkeypatch.setenv(SWITCH, "off")
    with pytest.raises(InputError, match=r"compiled C only \(.*MISSING_PHYSICS_COMPILED"):
        simulate(slider(reference={"duration": 1.0}), integrator="explicit")
