"""Friction inside the motor, in front of an elastic gear or of a stiff one; and a gear that hardens."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import exudyn_model
from reference_model.simulation import simulate
from robot_model import Recording, Robot


def reference(robot: Robot) -> Recording:
    return simulate(robot, sensors=False)


def exudyn(robot: Robot) -> Recording:
    return exudyn_model.simulate(robot, sensors=False, step=5e-4)


both = pytest.mark.parametrize("run", [reference, exudyn])
#: What a test of both engines beside each other holds too.
also_by_exudyn = pytest.mark.parametrize("run", [reference, pytest.param(exudyn, marks=pytest.mark.proof)])
GEAR = {"effect": "joint_elasticity", "at": "hinge", "stiffness": 2000.0, "damping": 5.0}


def hinge(*effects: dict, **motor: float) -> Robot:
    """A body of 5 kg m^2 behind a gear, with a rotor of 1 kg m^2 seen through it."""
    return Robot.model_validate(
        {
            "name": "hinge",
            "links": [{"name": "body", "mass": 1.0, "inertia": (5.0, 5.0, 5.0)}],
            "joints": [
                {
                    "name": "hinge",
                    "parent": "base",
                    "child": "body",
                    "initial_velocity": 1.0,
                    "actuator": {"gear_ratio": 100.0, "rotor_inertia": 1e-4, **motor},
                }
            ],
            "effects": effects,
            "reference": {"duration": 1.0, "sample_rate": 200.0},
        }
    )


@both
def test_motor_friction_brakes_the_entire_drive(run: Callable[[Robot], Recording]) -> None:
    """Behind a stiff gear it is friction of the joint: (5 + 1) v' = -T_c - c v."""
    found = run(hinge(coulomb_friction=2.0, viscous_friction=3.0))
    wanted = (1 + 2 / 3) * np.exp(-3 / 6 * found.time) - 2 / 3
    np.testing.assert_allclose(found["hinge.velocity"], wanted, atol=1e-6)
    np.testing.assert_allclose(found["hinge.friction_torque"], -2.0 - 3.0 * wanted, atol=1e-5)


@both
def test_in_front_of_an_elastic_gear_it_acts_on_the_motor(run: Callable[[Robot], Recording]) -> None:
    """The motor's own angular momentum: B thdd + T_gear = -T_c while it turns, and none is at the joint."""
    found = run(hinge(GEAR, coulomb_friction=2.0))
    np.testing.assert_allclose(found["hinge.friction_torque"], 0.0)
    total = 5.0 * found["hinge.velocity"] + found["hinge.motor_velocity"]
    late = (found["hinge.motor_velocity"] > 1e-2).all()
    assert late
    np.testing.assert_allclose(total, 6.0 - 2.0 * found.time, atol=2e-5)
    assert np.abs(found["hinge.motor_position"] - found["hinge.position"]).max() > 5e-4


def test_engines_agree_on_friction_on_both_sides_of_the_gear() -> None:
    rubbing = {
        "effect": "lugre_friction",
        "at": "hinge",
        "coulomb_torque": 1.0,
        "static_torque": 1.5,
        "stribeck_velocity": 0.05,
        "bristle_stiffness": 4e3,
        "bristle_damping": 20.0,
    }
    robot = hinge({**GEAR, "cubic_stiffness": 1e7}, rubbing, coulomb_friction=2.0, viscous_friction=1.0)
    own, other = reference(robot), exudyn(robot)
    for name in ("hinge.position", "hinge.motor_position"):
        np.testing.assert_allclose(own[name], other[name], atol=2e-5, err_msg=name)


@also_by_exudyn
def test_a_hardening_gear_swings_like_a_duffing_oscillator(run: Callable[[Robot], Recording]) -> None:
    push = {"effect": "external_torque", "at": "hinge", "torque": 3000.0, "start": 0.0, "duration": 2e-3}
    spring = {**GEAR, "damping": 0.0, "cubic_stiffness": 2e7}
    data = hinge(push, spring, gear_ratio=1000.0, rotor_inertia=10.0).model_dump()
    data["joints"][0]["initial_velocity"] = 0.0
    data["reference"]["sample_rate"] = 1000.0
    found = run(Robot.model_validate(data))
    twist = found["hinge.position"] - found["hinge.motor_position"]
    at = np.flatnonzero((twist[:-1] < 0) & (twist[1:] >= 0))
    crossing = found.time[at] - twist[at] / (twist[at + 1] - twist[at]) * 1e-3
    period = np.diff(crossing).mean()
    angle = (np.arange(2000) + 0.5) * np.pi / 4000
    size = np.abs(twist).max()
    exact = 4 * np.sum(np.sqrt(5.0 / (2000.0 + 2e7 * size**2 * (1 + np.sin(angle) ** 2) / 2))) * np.pi / 4000
    assert exact < 0.9 * 2 * np.pi * np.sqrt(5.0 / 2000.0)
    assert period == pytest.approx(exact, rel=2e-3)
