"""The state derivative as a loop over bodies: results of straight-line code, with code of constant size."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from random_robots import random_robot

from benchmarks.speed.chains import chain
from reference_model.codegen.compiled import SWITCH, compiler
from reference_model.control.motion import reference_function
from reference_model.kernels import LOOPED_FROM, looped_rate, rate_by_size
from reference_model.kernels.looped import _Loop
from reference_model.plant.closed_loop import Plant
from reference_model.steppers.explicit_run import ExplicitRun
from robot_model import EffectUse, Robot, load_robot

#: Two orders of the same sums; the factors of a heavy base and a light wrist enlarge their rounding.
SAME = 1e-10


def gap(robot: Robot) -> float:
    """Largest difference of the loop from the straight line over the largest value, at random states."""
    plant = Plant(robot)
    loop = looped_rate(plant)
    assert loop is not None
    worst, rng = 0.0, np.random.default_rng(3)
    for _ in range(3):
        state, goal = 0.3 * rng.normal(size=plant.layout.size), rng.normal(size=plant.layout.joints)
        held = rng.normal(size=plant.commands)
        first, second = (np.asarray(f(0.1, state, goal, held)).ravel() for f in (plant.rate, loop))
        worst = max(worst, float(np.abs(second - first).max() / np.abs(first).max()))
    return worst


@pytest.mark.parametrize("flexible", [False, True])
def test_looped_chains_give_the_same_rates(flexible: bool) -> None:
    assert gap(chain(4, flexible=flexible)) < SAME


@pytest.mark.parametrize("name", ["two_link_arm", "six_joint_space_arm", "flexible_space_robot"])
def test_looped_shipped_robots_without_load_friction_give_the_same_rates(name: str) -> None:
    robot = load_robot(name)
    joint = robot.moving_joints[0].name
    laws = [
        EffectUse.model_validate({"effect": "viscous_friction", "at": joint, "coefficient": 0.3}),
        EffectUse.model_validate(
            {
                "effect": "lugre_friction",
                "at": joint,
                "coulomb_torque": 1.0,
                "static_torque": 1.4,
                "stribeck_velocity": 0.1,
                "bristle_stiffness": 1e3,
                "bristle_damping": 5.0,
            }
        ),
    ]
    assert gap(robot.model_copy(update={"effects": tuple(laws)})) < SAME


@pytest.mark.parametrize("base", ["fixed", "free"])
def test_looped_random_trees_give_the_same_rates(base: str) -> None:
    kinds = ["revolute", "prismatic", "fixed", "revolute", "revolute"]
    assert gap(random_robot(5, base=base, kinds=kinds)) < SAME


def test_a_robot_with_a_spherical_joint_has_no_loop() -> None:
    robot = chain(2)
    ball = robot.joints[1].model_copy(update={"kind": "spherical", "actuator": None})
    assert looped_rate(Plant(robot.model_copy(update={"joints": (robot.joints[0], ball)}))) is None


def test_friction_that_depends_on_the_loads_has_no_loop() -> None:
    assert looped_rate(Plant(load_robot("flexible_space_robot"))) is None


def test_a_longer_chain_needs_no_more_functions() -> None:
    counts = []
    for links in (4, 6):
        plant = Plant(chain(links, flexible=True))
        loop = _Loop(plant)
        state, force = ca.MX.sym("x", plant.layout.size), ca.MX.sym("f", links)
        loop.accelerations(state, force)
        counts.append(len(loop._bodies))
    assert counts[0] == counts[1]


def test_the_size_decides_between_loop_and_straight_line() -> None:
    short, long = Plant(chain(2)), Plant(chain(12))
    assert short.rate.n_instructions() < LOOPED_FROM < long.rate.n_instructions()
    assert rate_by_size(short) is short.rate
    assert rate_by_size(long).is_a("MXFunction")


@pytest.mark.skipif(compiler() is None, reason="no C compiler on the path")
def test_an_explicit_run_by_the_loop_gives_the_same_motion(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(SWITCH, "on")
    robot = chain(3)
    motion = {"duration": 0.2, "sample_rate": 100.0}
    robot = robot.model_validate({**robot.model_dump(), "reference": motion})
    plant, time = Plant(robot), np.linspace(0.0, 0.2, 5)
    reference = reference_function(robot)
    straight = ExplicitRun(plant, reference)(time, rtol=1e-9, atol=1e-11)
    monkeypatch.setattr("reference_model.kernels.looped.LOOPED_FROM", 0)
    looped = ExplicitRun(plant, reference)(time, rtol=1e-9, atol=1e-11)
    assert np.allclose(looped, straight, rtol=0, atol=1e-8)
    assert np.abs(looped[-1] - looped[0]).max() > 1e-3
