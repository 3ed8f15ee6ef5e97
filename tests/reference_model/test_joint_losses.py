"""Losses of joints in both engines and motions of least energy, against their closed forms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from sliding_blocks import MASS, block, of_torque

import exudyn_model
from reference_model.kernels.looped import looped_rate
from reference_model.planning.least_energy import least_energy
from reference_model.plant.closed_loop import Plant
from reference_model.simulation import simulate
from robot_model import InputError, Recording, Robot, load_robot


def reference(robot: Robot) -> Recording:
    return simulate(robot, sensors=False, losses=True)


def exudyn(robot: Robot) -> Recording:
    return exudyn_model.simulate(robot, sensors=False, losses=True)


both = pytest.mark.parametrize("run", [reference, exudyn])
#: R/(n k)^2 = 2 W/N^2.
MOTOR = {"gear_ratio": 10.0, "torque_constant": 0.05, "resistance": 0.5}
GAIN = 2.0


def driven(*effects: dict, **more) -> Robot:
    data = block(*effects, **more).model_dump()
    data["joints"][0]["actuator"] = MOTOR
    return Robot.model_validate(data)


def viscous(coefficient: float) -> dict:
    return {"effect": "viscous_friction", "at": "slide", "coefficient": coefficient}


@both
def test_friction_loss_equals_the_kinetic_energy(run: Callable[[Robot], Recording]) -> None:
    found = run(block(viscous(3.0), of_torque("slide", 1.0), velocity=1.0))
    kinetic = MASS / 2 * (1 - found["slide.velocity"] ** 2)
    np.testing.assert_allclose(found["slide.friction_energy"], kinetic, atol=2e-6)
    power = -found["slide.friction_torque"] * found["slide.velocity"]
    np.testing.assert_allclose(found["slide.friction_power"], power, rtol=1e-9, atol=1e-12)
    assert "slide.armature_power" not in found


@both
def test_a_held_weight_heats_the_winding(run: Callable[[Robot], Recording]) -> None:
    pd = {"kind": "pd", "kp": 1e3, "kd": 1e2, "gravity_feedforward": True}
    found = run(driven(tilt=0.2, controller=pd, duration=1.0))
    torque = MASS * 9.81 * np.sin(0.2)
    np.testing.assert_allclose(found["slide.armature_power"], GAIN * torque**2, rtol=1e-9)
    np.testing.assert_allclose(found["slide.armature_energy"], GAIN * torque**2 * found.time, rtol=1e-9)
    assert "slide.armature_energy" not in simulate(driven(duration=0.1), sensors=False)


def test_engines_agree_on_losses() -> None:
    data = load_robot("two_link_arm").model_dump()
    for joint in data["joints"]:
        joint["actuator"] |= {"torque_constant": 0.1, "resistance": 0.8}
    data["sensors"] = []
    data["controller"]["sample_time"] = 0.01
    data["reference"] |= {"duration": 0.3, "sample_rate": 100.0}
    robot = Robot.model_validate(data)
    own, other = reference(robot), exudyn_model.simulate(robot, sensors=False, losses=True, step=2.5e-4)
    for joint in ("joint1", "joint2"):
        for name in ("friction_energy", "armature_energy"):
            channel = f"{joint}.{name}"
            assert own[channel][-1] > 0
            # Where sampled control makes the joint shake, a step of 0.25 ms leaves 2e-4; it falls with its
            # square.
            np.testing.assert_allclose(other[channel], own[channel], atol=4e-4 * own[channel][-1])


def test_with_winding_losses_only_the_motion_of_least_energy_is_a_cubic() -> None:
    far, duration = 0.5, 2.0
    planned = least_energy(driven(duration=duration), {"slide": far}, duration=duration)
    square = GAIN * MASS**2 * far**2 / duration**3
    assert planned.loss == pytest.approx(12 * square, rel=1e-6)
    assert planned.quintic == pytest.approx(120 / 7 * square, rel=1e-4)
    assert planned.robot.reference is not None
    table = planned.robot.reference.joints[0]
    s = np.array(table.times) / duration
    np.testing.assert_allclose(table.positions, far * s**2 * (3 - 2 * s), atol=1e-7)


def test_with_viscous_friction_its_speed_is_a_hyperbolic_cosine() -> None:
    """Of c v^2 + g (m v' + c v)^2: v = A (1 - cosh(w (t - T/2))/cosh(w T/2)), w^2 = (c + g c^2)/(g m^2)."""
    far, duration, c = 0.5, 2.0, 3.0
    planned = least_energy(driven(viscous(c), duration=duration), {"slide": far}, duration=duration)
    w = np.sqrt((c + GAIN * c**2) / (GAIN * MASS**2))
    time = np.linspace(0, duration, 20001)
    shape = 1 - np.cosh(w * (time - duration / 2)) / np.cosh(w * duration / 2)
    size = far / np.trapezoid(shape, time)
    slope = -w * np.sinh(w * (time - duration / 2)) / np.cosh(w * duration / 2)
    speed, force = size * shape, size * (MASS * slope + c * shape)
    assert planned.loss == pytest.approx(np.trapezoid(c * speed**2 + GAIN * force**2, time), rel=1e-5)
    assert planned.loss < planned.quintic


def test_both_engines_reproduce_the_planned_loss() -> None:
    computed = {"kind": "computed_torque", "kp": 400.0, "kd": 40.0}
    robot = driven(viscous(3.0), duration=2.0, controller=computed, rate=100.0)
    planned = least_energy(robot, {"slide": 0.5}, duration=2.0)
    for run in (reference, exudyn):
        found = run(planned.robot)
        total = found["slide.friction_energy"][-1] + found["slide.armature_energy"][-1]
        assert total == pytest.approx(planned.loss, rel=0.02)


def test_a_torque_limit_holds() -> None:
    data = driven(duration=2.0).model_dump()
    free = 6 * MASS * 0.5 / 4  # the cubic's largest force
    data["joints"][0]["actuator"]["torque_limit"] = 0.75 * free
    limited = least_energy(Robot.model_validate(data), {"slide": 0.5}, duration=2.0)
    assert limited.loss > least_energy(driven(duration=2.0), {"slide": 0.5}, duration=2.0).loss * 1.001


def test_unsupported_plans_are_refused() -> None:
    with pytest.raises(InputError, match="'slid' is no moving joint; did you mean 'slide'"):
        least_energy(driven(), {"slid": 1.0}, duration=1.0)
    with pytest.raises(InputError, match="torque_constant and resistance"):
        least_energy(block(), {"slide": 1.0}, duration=1.0)
    with pytest.raises(InputError, match="duration above zero"):
        least_energy(driven(), {"slide": 1.0}, duration=0.0)
    data = driven().model_dump()
    data["joints"][0]["actuator"]["torque_limit"] = 1e-3
    with pytest.raises(InputError, match="give it more time"):
        least_energy(Robot.model_validate(data), {"slide": 0.5}, duration=2.0)


def test_the_looped_rate_has_the_losses() -> None:
    data = load_robot("two_link_arm").model_dump()
    for joint in data["joints"]:
        joint["actuator"] |= {"torque_constant": 0.1, "resistance": 0.8}
    plant = Plant(Robot.model_validate(data), losses=True)
    looped = looped_rate(plant)
    assert looped is not None
    draw = np.random.default_rng(3)
    given = [0.3, *(draw.normal(size=rows) for rows in (plant.layout.size, 2, plant.commands))]
    np.testing.assert_allclose(looped(*given).full(), plant.rate(*given).full(), rtol=1e-9)
