"""Friction that stops joints within a step: closed forms, order, exact stiction, and the other engine."""

from __future__ import annotations

import numpy as np
import pytest
from sliding_blocks import GRAVITY, MASS, block, of_torque, on_load, ramp

import exudyn_model
from exudyn_model.solve.stopping import boxed
from reference_model.simulation import simulate
from robot_model import InputError, Recording, Robot, load_robot


def stopping(robot: Robot, step: float, **more) -> Recording:
    return simulate(robot, sensors=False, stiction=True, step=step, **more)


def slow_arm(**changes) -> Robot:
    """A two-link arm that starts, stops and turns back within a second, both joints rubbing."""
    data = load_robot("two_link_arm").model_dump()
    data |= {"sensors": [], "controller": {"kind": "pd", "kp": 300.0, "kd": 30.0}, "gravity": (0.0, 0.0, 0.0)}
    data["reference"] = {
        "duration": 1.0,
        "sample_rate": 50.0,
        "joints": [
            {
                "joint": name,
                "kind": "multisine",
                "amplitudes": [size],
                "frequencies": [1.0],
                "phases": [1.0],
                "ramp": 0.0,
            }
            for name, size in (("joint1", 0.05), ("joint2", 0.08))
        ],
    }
    data["effects"] = [
        {"effect": "stribeck_friction", "at": "joint1", "coulomb_torque": 5.0, "static_torque": 7.0}
        | {"stribeck_velocity": 0.1},
        {"effect": "coulomb_friction", "at": "joint2", "torque": 2.0},
    ]
    return Robot.model_validate(data | changes)


@pytest.mark.parametrize("friction", [on_load("slide", 0.3), of_torque("slide", 6.0)])
def test_a_block_on_an_incline_holds_without_creep(friction: dict) -> None:
    recording = stopping(block(friction, tilt=0.2, duration=20.0, rate=10.0), 0.1)
    np.testing.assert_array_equal(recording["slide.position"], 0.0)
    np.testing.assert_allclose(recording["slide.friction_torque"], -MASS * GRAVITY * np.sin(0.2), rtol=1e-12)


def test_a_sliding_block_stops_within_one_step_of_the_exact_position() -> None:
    braking = GRAVITY * (0.3 * np.cos(0.2) - np.sin(0.2))
    for step in (0.05, 0.01):
        recording = stopping(block(on_load("slide", 0.3), tilt=0.2, velocity=1.0, rate=20.0), step)
        # Within the last step the true deceleration is the larger one, over a time below the step.
        missed = abs(recording["slide.position"][-1] - 1 / (2 * braking))
        assert missed < braking * step**2 / 2
        assert recording["slide.velocity"][-1] == 0.0
        assert recording["slide.sticking"][-1] == 1.0


def test_it_breaks_away_within_a_step_of_the_static_level() -> None:
    pulled = block(
        of_torque("slide", 4.0, 6.0, 1e-3),
        controller={"kind": "pd", "kp": 200.0, "kd": 0.0},
        motion=[ramp("slide", 0.05, 1.0)],
        duration=1.0,
        rate=1000.0,
    )
    recording = stopping(pulled, 1e-3)
    start = 6.0 / (200.0 * 0.05)
    first = recording.time[np.argmax(recording["slide.velocity"] != 0)]
    assert start <= first <= start + 2.5e-3


@pytest.mark.proof
def test_it_converges_to_exact_stiction_with_the_step() -> None:
    robot = slow_arm()
    exact = simulate(robot, sensors=False, stiction=True)
    assert 0.02 < exact["joint1.sticking"].mean() < 0.9
    errors = []
    for step in (2e-2, 5e-3, 1.25e-3):
        found = stopping(robot, step)
        errors.append(np.abs(found["joint1.position"] - exact["joint1.position"]).max())
    assert errors[1] < errors[0] / 2
    assert errors[2] < errors[1] / 2
    assert errors[2] < 2e-5  # [rad], of 0.05


@pytest.mark.proof
def test_engines_agree_on_stopping() -> None:
    robot = slow_arm()
    apart = []
    for step in (2.5e-3, 6.25e-4):
        own = stopping(robot, step)
        other = exudyn_model.simulate(
            robot, sensors=False, stiction=True, step=step, integrator="runge-kutta"
        )
        apart.append(
            [np.abs(own[name] - other[name]).max() for name in ("joint1.position", "joint2.position")]
        )
    # One stops a joint at an even deceleration, the other by an even force; both are of first order in the
    # instant of breaking away, of motions of 0.05 and 0.08 rad.
    assert max(apart[0]) < 2e-4
    assert max(apart[1]) < max(apart[0]) / 2


def test_smoothed_friction_is_unstable_at_these_steps() -> None:
    robot = slow_arm()
    exact = simulate(robot, sensors=False, stiction=True)["joint1.velocity"]
    smoothed = simulate(robot, sensors=False, step=2.5e-3)["joint1.velocity"]
    stopped = stopping(robot, 2.5e-3)["joint1.velocity"]
    assert np.abs(smoothed - exact).max() > 5 * np.abs(stopped - exact).max()


def test_the_box_constrained_solution_satisfies_its_conditions() -> None:
    draw = np.random.default_rng(0)
    for _ in range(50):
        root = draw.normal(size=(4, 4))
        matrix, free = root @ root.T + 0.1 * np.eye(4), 3 * draw.normal(size=4)
        high = draw.uniform(0, 2, 4)
        x = boxed(matrix, free, -high, high)
        w = free + matrix @ x
        assert np.all(np.abs(w[np.abs(x) < high]) < 1e-6)
        assert np.all(w[x == -high] >= -1e-9)
        assert np.all(w[x == high] <= 1e-9)


def test_unsupported_effects_are_refused() -> None:
    with pytest.raises(InputError, match="no steps in which friction stops"):
        exudyn_model.simulate(slow_arm(), stiction=True)


def test_a_diverging_motion_reports_its_time() -> None:
    wild = block(
        of_torque("slide", 4.0),
        velocity=1.0,
        controller={"kind": "pd", "kp": 1e9, "kd": 0.0},
        rate=10.0,
        duration=20.0,
    )
    with pytest.raises(InputError, match="leaves the finite numbers after"):
        stopping(wild, 0.1)
