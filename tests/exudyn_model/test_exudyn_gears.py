"""Separate motor coordinates in Exudyn: compared with the reference model, in both formulations."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from quick_ones import quick_names

import exudyn_model
from exudyn_model.effects import effects_of
from exudyn_model.equations import Posture, equations
from reference_model.effects.catalogue import used_effects
from reference_model.plant.gears import Gears
from reference_model.simulation import simulate as reference
from robot_model import EffectUse, InputError, Recording, Robot, load_robot

SPRING = {"stiffness": 5e3, "damping": 5.0}
GEARS: dict[str, list[dict[str, Any]]] = {
    "elastic": [{"effect": "joint_elasticity", **SPRING, "cubic_stiffness": 1e7}],
    "play": [{"effect": "backlash", "half_width": 5e-4, **SPRING}],
    "elastic with play": [
        {"effect": "joint_elasticity", **SPRING, "cubic_stiffness": 1e7},
        {"effect": "backlash", "half_width": 5e-4},
    ],
    "lossy": [{"effect": "gear_hysteresis", "torque": 3.0, "travel": 2e-4, **SPRING}],
    "elastic and lossy": [
        {"effect": "joint_elasticity", **SPRING},
        {"effect": "gear_hysteresis", "torque": 3.0, "travel": 2e-4},
    ],
}


def arm(*effects: dict[str, Any], joint: str = "joint1", duration: float = 0.15, **changes: Any) -> Robot:
    """The shipped arm with effects at a joint, without sensors."""
    data = load_robot("two_link_arm").model_dump()
    data["sensors"] = changes.pop("sensors", [])
    data["reference"] |= {"duration": duration, "sample_rate": 50.0}
    data["effects"] = [*data["effects"], *({"at": joint, **effect} for effect in effects)]
    return Robot.model_validate({**data, **changes})


def difference(one: Recording, other: Recording, *channels: str) -> float:
    return max(float(np.abs(one[c] - other[c]).max()) for c in channels)


@pytest.mark.parametrize("gear", quick_names(GEARS, "elastic with play", "elastic and lossy"))
@pytest.mark.parametrize("formulation", ["tree", pytest.param("redundant", marks=pytest.mark.proof)])
def test_engines_agree_and_converge_with_the_step(gear: str, formulation: Any) -> None:
    robot = arm(*GEARS[gear])
    exact = reference(robot, sensors=False, rtol=1e-10, atol=1e-12)
    twist = exact["joint1.motor_position"] - exact["joint1.position"]
    assert np.ptp(twist) > 5e-4
    motion = [f"{joint}.position" for joint in ("joint1", "joint2")] + ["joint1.motor_position"]
    errors = [
        difference(
            exudyn_model.simulate(robot, sensors=False, step=step, formulation=formulation), exact, *motion
        )
        for step in (1e-3, 5e-4)
    ]
    # a hundred thousandth of the twist that is at stake
    assert errors[0] < 1e-6
    # second order; corners of the play, met by error control, scatter it
    assert np.log2(errors[0] / errors[1]) > 1.6


@pytest.mark.parametrize("gear", GEARS)
@given(twists=st.lists(st.floats(-2e-3, 2e-3), min_size=2, max_size=6), rate=st.floats(-0.3, 0.3))
def test_the_torques_are_the_same_formulas(gear: str, twists: list[float], rate: float) -> None:
    robot = arm(*GEARS[gear])
    own = effects_of(robot).gears[0]
    law = _law(robot)
    memory = own.start(0.0)[1]
    for before, after in pairwise([0.0, *twists]):
        torque, memory = own.advance(after, rate, memory)
        z, last = memory
        assert last == after != before or after == before
        expected, stored = (float(part) for part in law(after, rate, z))
        # rounding of torques up to 30 N m and energies below 1 J
        assert torque == pytest.approx(expected, abs=1e-11)
        assert own.energy(memory) == pytest.approx(stored, abs=1e-13)


@pytest.mark.parametrize("gear", GEARS)
def test_gears_start_in_equilibrium_despite_rounding(gear: str) -> None:
    """Stiffness times (torque over stiffness) is less than the torque for one torque in seventeen."""
    robot = arm(*GEARS[gear])
    own, reference_gears = effects_of(robot).gears[0], Gears(robot, used_effects(robot))
    for torque in np.random.default_rng(0).uniform(-40.0, 40.0, 60):
        twist, memory = own.start(torque)
        assert own.advance(twist, 0.0, memory)[0] == pytest.approx(torque, abs=1e-6)  # root to 2e-12 rad
        [other], _ = reference_gears.at_rest(np.array([torque, 0.0]))
        assert twist == pytest.approx(other, abs=1e-11)


def _law(robot: Robot) -> ca.Function:
    gears = Gears(robot, used_effects(robot))
    d, v, z = ca.SX.sym("d"), ca.SX.sym("v"), ca.SX.sym("z")
    found = gears.act(d, v, z[: gears.states])
    return ca.Function("law", [d, v, z], [found.torque, found.stored])


CONTROLLERS = {
    "sampled": {"kind": "pd", "kp": 2000.0, "kd": 100.0, "sample_time": 2e-3},
    "integral": {"kind": "pd", "kp": 2000.0, "kd": 100.0, "ki": 5000.0},
    "by the joint": {"kind": "pd", "kp": 300.0, "kd": 20.0, "feedback": "joint"},
    "computed torque": {"kind": "computed_torque", "kp": 100.0, "kd": 20.0},
}


@pytest.mark.parametrize("controller", CONTROLLERS.values(), ids=CONTROLLERS)
def test_controllers_drives_and_friction_act_on_the_same_side(controller: dict[str, Any]) -> None:
    stiff = {"effect": "joint_elasticity", "stiffness": 2e4, "damping": 100.0}
    others = [
        {"effect": "torque_ripple", "cosine": 2.0, "sine": 1.0, "order": 30.0},
        {"effect": "actuator_lag", "time_constant": 2e-3},
        {"effect": "lugre_friction", "coulomb_torque": 4.0, "static_torque": 6.0, "stribeck_velocity": 0.05}
        | {"bristle_stiffness": 2e3, "bristle_damping": 10.0},
        {"effect": "cable_spring", "stiffness": 3.0},
    ]
    robot = arm(stiff, *others, controller=controller)
    exact = reference(robot, sensors=False, rtol=1e-10, atol=1e-12)
    own = exudyn_model.simulate(robot, sensors=False, step=5e-4)
    channels = ("joint1.position", "joint1.motor_position", "joint2.position")
    # one side mistaken for the other moves the arm by 1e-4 and more
    assert difference(own, exact, *channels) < 1e-6
    assert difference(own, exact, "joint1.torque", "joint1.gear_torque", "joint1.friction_torque") < 0.02


def test_a_servos_back_emf_follows_the_motor() -> None:
    data = arm(*GEARS["elastic"]).model_dump()
    for joint in data["joints"]:
        joint["actuator"] |= {"torque_constant": 0.1, "resistance": 0.5}
    data["controller"] = {"kind": "voltage_servo", "gain": 5.0, "supply": 24.0}
    robot = Robot.model_validate(data)
    exact = reference(robot, sensors=False, rtol=1e-10, atol=1e-12)
    own = exudyn_model.simulate(robot, sensors=False, step=2.5e-4)
    assert difference(own, exact, "joint1.position", "joint1.motor_position") < 1e-6
    assert difference(own, exact, "joint1.voltage", "joint1.torque") < 0.01


@pytest.mark.parametrize("formulation", ["tree", pytest.param("redundant", marks=pytest.mark.proof)])
def test_free_bases_support_gears(formulation: Any) -> None:
    data = load_robot("six_joint_space_arm").model_dump()
    data["sensors"], data["effects"] = [], []
    data["reference"] |= {"duration": 0.1, "sample_rate": 50.0}
    for joint in ("joint2", "joint4"):
        data["effects"].append({"effect": "joint_elasticity", "at": joint, "stiffness": 2e4, "damping": 20.0})
    robot = Robot.model_validate(data)
    exact = reference(robot, sensors=False, rtol=1e-10, atol=1e-12)
    own = exudyn_model.simulate(robot, sensors=False, formulation=formulation)
    motors = [f"{joint}.motor_position" for joint in ("joint2", "joint4")]
    assert difference(own, exact, *motors, "joint2.position", "joint6.position", "base.position.x") < 2e-7


def test_flexible_links_support_gears_and_energy_is_conserved() -> None:
    data = load_robot("flexible_space_robot").model_dump()
    data["sensors"] = []
    data["effects"] = [{"effect": "joint_elasticity", "at": "joint2", "stiffness": 2e3, "damping": 2.0}]
    data["reference"] |= {"duration": 0.4, "sample_rate": 20.0}
    robot = Robot.model_validate(data)
    exact = reference(robot, sensors=False, rtol=1e-10, atol=1e-12)
    errors = []
    for step in (2e-3, 1e-3):
        own = exudyn_model.simulate(robot, sensors=False, step=step)
        errors.append(difference(own, exact, "joint2.position", "joint2.motor_position", "joint1.position"))
    assert np.ptp(exact["joint2.motor_position"] - exact["joint2.position"]) > 1e-4
    assert errors[1] < 1e-6
    assert np.log2(errors[0] / errors[1]) > 1.6
    energy = exact["robot.energy"]
    assert np.abs(own["robot.energy"] - energy).max() < 1e-3 * np.ptp(energy)


def test_high_order_steps_agree_with_the_reference_to_rounding() -> None:
    robot = arm(*GEARS["elastic"])
    exact = reference(robot, sensors=False, rtol=1e-12, atol=1e-14)
    own = exudyn_model.simulate(robot, sensors=False, integrator="runge-kutta")
    # what the reference's tolerance leaves over 0.3 s
    assert difference(own, exact, "joint1.position", "joint1.motor_position", "joint2.position") < 1e-10
    with pytest.raises(InputError, match="remember"):
        exudyn_model.simulate(arm(*GEARS["lossy"]), integrator="runge-kutta")


def test_equations_at_a_state_refuse_separate_motors() -> None:
    with pytest.raises(InputError, match="remove the effects in the gear of joint1"):
        equations(arm(*GEARS["elastic"]), Posture(np.zeros(2), np.zeros(2)))


def test_motor_encoders_are_measured() -> None:
    sensors = [{"channel": f"{joint}.motor_position", "noise": 1e-6} for joint in ("joint1", "joint2")]
    found = exudyn_model.simulate(arm(*GEARS["elastic"], sensors=sensors, duration=0.1))
    assert "joint1.motor_position" in found
    bare = exudyn_model.simulate(arm(sensors=[{**s, "noise": 0.0} for s in sensors], duration=0.1))
    exact = exudyn_model.simulate(arm(duration=0.1), sensors=False)
    assert np.array_equal(bare["joint2.motor_position"], exact["joint2.position"])
    assert "joint2.motor_position" not in exact
    with pytest.raises(InputError, match=r"gives no channel 'joint1.gear_torque'"):
        exudyn_model.simulate(arm(sensors=[{"channel": "joint1.gear_torque"}], duration=0.1))


@pytest.mark.parametrize(
    ("effects", "words"),
    [
        ([GEARS["play"][0], GEARS["elastic"][0]], "more than one effect of its gear states a stiffness"),
        ([{"effect": "backlash", "half_width": 1e-3}], "no effect of its gear states a stiffness"),
        ([*GEARS["lossy"], {"effect": "backlash", "half_width": 1e-3}], "keep backlash or gear_hysteresis"),
        (GEARS["elastic"] * 2, "listed twice"),
    ],
)
def test_impossible_gears_are_refused(effects: list[dict[str, Any]], words: str) -> None:
    with pytest.raises(InputError, match=words):
        exudyn_model.simulate(arm(*effects))


def test_a_motor_without_inertia_is_refused() -> None:
    robot = arm()
    joints = tuple(
        joint.model_copy(update={"actuator": joint.actuator.model_copy(update={"rotor_inertia": 0.0})})
        for joint in robot.joints
        if joint.actuator
    )
    use = EffectUse(effect="joint_elasticity", at="joint1", stiffness=1e4)
    with pytest.raises(InputError, match="rotor_inertia"):
        exudyn_model.simulate(robot.model_copy(update={"joints": joints}).with_effects(use))
