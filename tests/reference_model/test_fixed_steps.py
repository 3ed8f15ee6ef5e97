"""Steps of fixed length: their order, closed forms of the bristles, and user loops."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reference_model.codegen.code_cache import FOLDER_VARIABLE
from reference_model.codegen.compiled import SWITCH, compiler
from reference_model.fixed_steps.expression import _hidden_step
from reference_model.fixed_steps.realtime import BLOCK, Stepper
from reference_model.plant.closed_loop import Plant
from reference_model.simulation import simulate
from robot_model import InputError, Recording, Robot, load_robot

LUGRE = {
    "effect": "lugre_friction",
    "coulomb_torque": 6.0,
    "static_torque": 9.0,
    "stribeck_velocity": 0.05,
    "bristle_stiffness": 5e3,
    "bristle_damping": 20.0,
}
#: Friction in proportion to the bearing load, which depends on the friction.
LOADED = {
    "coulomb_torque": 0.0,
    "static_torque": 0.0,
    "bristle_stiffness": 0.0,
    "bristle_damping": 0.0,
    "load_coefficient": 0.1,
    "load_static_coefficient": 0.15,
    "load_stiffness": 400.0,
    "load_damping": 4.0,
}


def manoeuvre(name: str, effects: list[dict] | None = None, **changes) -> Robot:
    """A shipped robot with other effects, a short motion, and no limits of the drives: they bring kinks."""
    data = load_robot(name).model_dump()
    data["effects"] = effects or []
    data["sensors"] = []
    data["reference"] |= {"duration": 1.0, "sample_rate": 50.0}
    data["reference"]["joints"] = [
        {"joint": joint["name"], "kind": "cycloid", "displacement": 0.3, "duration": 1.2}
        for joint in data["joints"]
    ]
    for joint in data["joints"]:
        joint["actuator"]["torque_limit"] = None
    for key, value in changes.items():
        data[key] |= value
    return Robot.model_validate(data)


def error(rough: Recording, fine: Recording, channels: list[str]) -> float:
    return max(float(np.abs(rough[c] - fine[c]).max() / np.abs(fine[c]).max()) for c in channels)


def order(robot: Robot, channels: list[str], steps: tuple[float, float]) -> float:
    """Order of convergence between two steps, to what CVODES finds too."""
    limit = simulate(robot, sensors=False, step=steps[1] / 4)
    other = simulate(robot, sensors=False, rtol=1e-11, atol=1e-13)
    # (w h)^2 of the joint on its bristles, 5 rad/s, and more than (w h)^4 of the modes
    assert error(limit, other, channels) < 1e-5
    first, second = (error(simulate(robot, sensors=False, step=h), limit, channels) for h in steps)
    assert second > 1e-12  # else rounding is measured
    return float(np.log(first / second) / np.log(steps[0] / steps[1]))


def test_without_friction_states_the_order_is_four() -> None:
    robot = manoeuvre("flexible_space_robot")
    channels = ["joint1.velocity", "base.angular_velocity.z", "link2.tip_deflection.y"]
    assert order(robot, channels, (2.5e-3, 1.25e-3)) == pytest.approx(4, abs=0.3)  # next order's share


@pytest.mark.proof
@pytest.mark.parametrize("loaded", [False, True])
def test_with_bristles_the_order_is_two(loaded: bool) -> None:
    law = LUGRE | (LOADED if loaded else {})
    robot = manoeuvre("flexible_space_robot", [{**law, "at": "joint1"}, {**law, "at": "joint2"}])
    channels = ["joint1.bristle", "joint2.bristle"]
    assert order(robot, channels, (2.5e-3, 1.25e-3)) == pytest.approx(2, abs=0.2)


def test_a_held_command_keeps_the_order() -> None:
    robot = manoeuvre("two_link_arm", controller={"sample_time": 0.004})
    assert order(robot, ["joint1.velocity", "joint2.velocity"], (4e-3, 2e-3)) == pytest.approx(4, abs=0.3)


@pytest.mark.parametrize("length", [1e-6, 1e-3, 10.0])
def test_bristles_follow_the_closed_form_at_constant_speed(length: float) -> None:
    robot = manoeuvre("single_axis", [{**LUGRE, "at": "joint1"}])
    plant, speed, bent = Plant(robot), -0.2, 3e-4
    rows = plant.layout.rows("effects")
    state = np.zeros(plant.layout.size)
    state[plant.layout.rows("velocity")], state[rows] = speed, bent
    (found,) = _hidden_step(plant, rows)(0.0, state, 0.0, 0.0, length).full().ravel()
    level = 6.0 + 3.0 * np.exp(-((speed / 0.05) ** 2))
    steady = level * np.sign(speed) / 5e3
    wanted = steady + (bent - steady) * np.exp(-5e3 * abs(speed) * length / level)
    assert found == pytest.approx(wanted, rel=1e-7)  # the floor of the friction level, 1e-9 N


def test_a_step_far_longer_than_the_bristle_time_constant_is_stable() -> None:
    """Bristles that settle within 10 us of sliding, and a step of 5 ms."""
    stiff = {**LUGRE, "bristle_stiffness": 5e6, "bristle_damping": 0.0, "at": "joint1"}
    robot = manoeuvre("flexible_space_robot", [stiff])
    recording = simulate(robot, sensors=False, step=5e-3)
    sliding = np.abs(recording["joint1.velocity"]) > 0.1
    friction = np.abs(recording["joint1.friction_torque"][sliding])
    level = 6.0 + 3.0 * np.exp(-((recording["joint1.velocity"][sliding] / 0.05) ** 2))
    assert sliding.sum() > 10
    np.testing.assert_allclose(friction, level, rtol=0.05)  # half a step's change of the speed


def test_a_user_loop_reproduces_the_simulation() -> None:
    """Under commands held over each step, with the controller's instants at every second step."""
    robot = manoeuvre("two_link_arm", [{**LUGRE, "at": "joint1"}], controller={"sample_time": 0.002})
    stepper = Stepper(robot, compile_code=False)
    state, command = stepper.initial(), np.zeros(stepper.commands)
    states = [state]
    for k in range(BLOCK + 100):
        if k % 2 == 0:
            command = stepper.command(k * 1e-3, state)
        state = stepper.step(k * 1e-3, state, command, 1e-3)
        states.append(state)
    recording = simulate(robot, sensors=False, step=1e-3)
    positions = np.array(states)[::20, stepper.layout.rows("position")]
    for k, joint in enumerate(robot.moving_joints):
        wanted = recording[f"{joint.name}.position"][: len(positions)]
        np.testing.assert_allclose(positions[:, k], wanted, rtol=1e-12, atol=1e-13)  # rounding


@pytest.mark.skipif(compiler() is None, reason="no C compiler on the path")
def test_compiled_steps_give_the_same_states(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = manoeuvre("two_link_arm", [{**LUGRE, "at": "joint1"}])
    plain = simulate(robot, sensors=False, step=2e-3)
    own = Stepper(robot, compile_code=False)
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "code"))
    monkeypatch.setenv(SWITCH, "on")
    code = simulate(robot, sensors=False, step=2e-3, compile_code=True)
    for channel in plain:  # rounding: the same operations in the same order
        np.testing.assert_allclose(code[channel], plain[channel], rtol=1e-12, atol=1e-12, err_msg=channel)
    other = Stepper(robot)
    assert "compiled by" in other.note
    start = own.initial() + 0.01
    np.testing.assert_allclose(
        other.step(0.0, start, np.ones(2), 1e-3), own.step(0.0, start, np.ones(2), 1e-3), rtol=1e-13
    )


def test_a_table_reference_is_supported() -> None:
    times = np.linspace(0, 1.0, 21)
    joints = [
        {
            "joint": f"joint{k}",
            "kind": "table",
            "times": times.tolist(),
            "positions": (0.2 * times**2).tolist(),
        }
        for k in (1, 2)
    ]
    robot = manoeuvre("two_link_arm", reference={"joints": joints})
    fine, rough = simulate(robot, sensors=False), simulate(robot, sensors=False, step=2e-3)
    # the spline's third derivative jumps at its knots, which a step of 2 ms meets exactly
    np.testing.assert_allclose(rough["joint2.position"], fine["joint2.position"], atol=1e-7)


def test_mistakes_are_reported() -> None:
    robot = manoeuvre("two_link_arm", controller={"sample_time": 0.01})
    for step, sentence in ((3e-3, "does not divide .* samples"), (-1e-3, "above zero"), (0.05, "divide")):
        with pytest.raises(InputError, match=sentence):
            simulate(robot, step=step)
    with pytest.raises(InputError, match="sample_time"):
        simulate(robot, step=0.02)
    with pytest.raises(InputError, match="bristles have a step of their own"):
        simulate(manoeuvre("two_link_arm", [{**LUGRE, "at": "joint1"}]), step=0.01, stiction=True)
    wild = manoeuvre("two_link_arm").model_dump()
    wild["controller"] = {"kind": "pd", "kp": 1e9, "kd": 0.0}
    with pytest.raises(InputError, match="finite numbers after"):
        simulate(Robot.model_validate(wild), step=0.02)
