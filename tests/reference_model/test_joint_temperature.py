"""Joints whose temperature changes their friction: closed forms in both engines, and that they agree."""

from __future__ import annotations

from collections.abc import Callable
from math import exp, log

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sliding_blocks import GRAVITY, MASS, block, of_torque

import exudyn_model
from reference_model.simulation import simulate
from robot_model import InputError, Recording, Robot, load_robot, robot_from_toml, robot_to_toml

#: Ambrose and Askew: static friction by 5 and kinetic friction by 10 from 373 to 223 K.
STATIC, KINETIC = log(5) / 150, log(10) / 150
COLD, WARM = 223.0, 373.0


def reference(robot: Robot) -> Recording:
    return simulate(robot, sensors=False)


def exudyn(robot: Robot) -> Recording:
    return exudyn_model.simulate(robot, sensors=False)


both = pytest.mark.parametrize("run", [reference, exudyn])
#: What a test of both engines beside each other holds too.
also_by_exudyn = pytest.mark.parametrize("run", [reference, pytest.param(exudyn, marks=pytest.mark.proof)])


def tempered(robot: Robot, temperature: dict, **more: float) -> Robot:
    """The robot with that temperature at all its joints."""
    data = robot.model_dump()
    rates = {"static_rate": STATIC, "kinetic_rate": KINETIC, "reference": WARM}
    for joint in data["joints"]:
        joint["thermal"] = {"temperature": temperature, **rates, **more}
    return Robot.model_validate(data)


def viscous(coefficient: float) -> dict:
    return {"effect": "viscous_friction", "at": "slide", "coefficient": coefficient}


@both
@pytest.mark.parametrize(("temperature", "factor"), [(COLD, 10.0), (298.0, 10**0.5), (WARM, 1.0)])
def test_viscous_friction_follows_a_constant_temperature(
    run: Callable[[Robot], Recording], temperature: float, factor: float
) -> None:
    robot = tempered(block(viscous(1.0), velocity=1.0), {"kind": "constant", "value": temperature})
    found = run(robot)
    wanted = np.exp(-factor / MASS * found.time)
    np.testing.assert_allclose(found["slide.velocity"], wanted, atol=3e-6)  # steps of Exudyn: h^2 c^3
    np.testing.assert_allclose(found["slide.temperature"], temperature)


@also_by_exudyn
def test_static_and_kinetic_friction_have_separate_factors(run: Callable[[Robot], Recording]) -> None:
    """On an incline a block holds up to the static level, and slides against the kinetic one."""
    for temperature, static, kinetic in ((COLD, 5.0, 10.0), (WARM, 1.0, 1.0)):
        law, given = of_torque("slide", 0.8, 2.0, 0.01), {"kind": "constant", "value": temperature}
        weights = [2.0 * static * share for share in (0.98, 1.02)]
        tilts = [float(np.arcsin(weight / (MASS * GRAVITY))) for weight in weights]
        held, slid = (run(tempered(block(law, tilt=tilt), given)) for tilt in tilts)
        assert held["slide.position"][-1] < 5e-3  # creeps at 2.3e-4 m/s at most
        assert slid["slide.position"][-1] > 0.05
        np.testing.assert_allclose(slid["slide.friction_torque"][-1], -0.8 * kinetic, rtol=1e-4)


@both
def test_a_table_is_linear_between_its_instants(run: Callable[[Robot], Recording]) -> None:
    table = {"kind": "table", "times": [0.5, 1.5], "values": [300.0, 250.0]}
    found = run(tempered(block(viscous(1.0), velocity=1.0), table))
    wanted = np.interp(found.time, [0.5, 1.5], [300.0, 250.0])
    np.testing.assert_allclose(found["slide.temperature"], wanted, rtol=1e-12)
    fine = np.linspace(0, 2, 20001)
    rate = np.exp(-KINETIC * (np.interp(fine, [0.5, 1.5], [300.0, 250.0]) - WARM)) / MASS
    total = np.concatenate([[0], np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(fine))])
    np.testing.assert_allclose(
        found["slide.velocity"], np.exp(-np.interp(found.time, fine, total)), atol=3e-6
    )


@both
def test_a_steadily_sliding_joint_warms_exponentially(run: Callable[[Robot], Recording]) -> None:
    """On an incline at its steady speed, friction without rates takes constant power."""
    speed = MASS * GRAVITY * np.sin(0.2) / 4.0
    heat = {"kind": "self_heating", "ambient": 290.0, "initial": 280.0, "capacity": 5.0, "resistance": 0.1}
    found = run(
        tempered(block(viscous(4.0), tilt=0.2, velocity=speed), heat, static_rate=0.0, kinetic_rate=0.0)
    )
    steady = 290.0 + 0.1 * 4.0 * speed**2
    wanted = steady + (280.0 - steady) * np.exp(-found.time / 0.5)
    np.testing.assert_allclose(found["slide.temperature"], wanted, atol=1e-5)
    np.testing.assert_allclose(found["slide.velocity"], speed, rtol=1e-6)


@both
def test_friction_falls_as_the_joint_warms(run: Callable[[Robot], Recording]) -> None:
    heat = {"kind": "self_heating", "ambient": 250.0, "capacity": 2.0, "resistance": 5.0}
    found = run(tempered(block(viscous(0.5), tilt=0.5, velocity=2.0), heat))

    def slides(t: float, x: np.ndarray) -> list[float]:
        force = 0.5 * exp(-KINETIC * (x[2] - WARM)) * x[1]
        pull = MASS * GRAVITY * np.sin(0.5)
        return [x[1], (pull - force) / MASS, (force * x[1] - (x[2] - 250.0) / 5.0) / 2.0]

    run_of = solve_ivp(slides, (0, 2), [0, 2, 250], t_eval=found.time, rtol=1e-10, atol=1e-10)
    assert run_of.y[2][-1] > 253
    np.testing.assert_allclose(found["slide.temperature"], run_of.y[2], atol=1e-4)
    np.testing.assert_allclose(found["slide.velocity"], run_of.y[1], atol=1e-4)


def arm(effects: list[dict]) -> Robot:
    data = load_robot("two_link_arm").model_dump()
    heat = {"kind": "self_heating", "ambient": 260.0, "capacity": 0.5, "resistance": 20.0}
    thermal = {"static_rate": STATIC, "kinetic_rate": KINETIC, "reference": WARM, "temperature": heat}
    for joint in data["joints"]:
        joint["thermal"] = thermal
    data |= {"sensors": [], "effects": effects}
    data["reference"] |= {"duration": 0.5, "sample_rate": 100.0}
    return Robot.model_validate(data)


BRISTLES = {
    "effect": "lugre_friction",
    "coulomb_torque": 1.0,
    "static_torque": 2.0,
    "stribeck_velocity": 0.05,
    "bristle_stiffness": 2e3,
    "bristle_damping": 10.0,
}


def test_engines_agree_on_self_heating() -> None:
    others = [
        {"effect": "viscous_friction", "coefficient": 0.5},
        {"effect": "asymmetric_friction", "coulomb_difference": 0.2, "viscous_difference": 0.1},
        {"effect": "position_dependent_friction", "cosine": 0.2, "sine": 0.1, "order": 3.0},
        {"effect": "temperature_dependent_friction", "rate": 0.01},
    ]
    robot = arm([{**law, "at": joint} for law in (BRISTLES, *others) for joint in ("joint1", "joint2")])
    own, other = reference(robot), exudyn(robot)
    assert np.ptp(own["joint1.temperature"]) > 0.5
    for name, tolerance in (("position", 1e-5), ("temperature", 2e-3), ("friction_torque", 5e-3)):
        for joint in ("joint1", "joint2"):
            channel = f"{joint}.{name}"
            gap = np.abs(own[channel] - other[channel]).max()
            assert gap < tolerance * max(1.0, np.ptp(own[channel])), channel


def test_without_rates_nothing_changes() -> None:
    plain = block(of_torque("slide", 1.0, 3.0, 0.01), velocity=1.0)
    still = tempered(plain, {"kind": "constant", "value": COLD}, static_rate=0.0, kinetic_rate=0.0)
    np.testing.assert_array_equal(reference(plain)["slide.position"], reference(still)["slide.position"])


@pytest.mark.proof
def test_fixed_steps_support_self_heating() -> None:
    heat = {"kind": "self_heating", "ambient": 250.0, "capacity": 2.0, "resistance": 5.0}
    robot = tempered(block(viscous(0.5), tilt=0.5, velocity=2.0), heat)
    wanted = reference(robot)["slide.temperature"]
    for stiction in (False, True):
        found = simulate(robot, sensors=False, step=2e-3, stiction=stiction)["slide.temperature"]
        np.testing.assert_allclose(found, wanted, atol=1e-4)


HEAT = 'kind = "self_heating", ambient = 290.0'
TOML = """
name = "r"
[[links]]
name = "a"
mass = 1.0
center_of_mass = [1.0, 0.0, 0.0]
[[joints]]
name = "j"
parent = "base"
child = "a"
thermal = { THERMAL }
"""


@pytest.mark.parametrize(
    ("thermal", "sentence"),
    [
        ('temperature = { kind = "constant", value = -3.0 }', r"value.*-3"),
        ('temperature = { kind = "table", times = [0.0, 1.0], values = [290.0] }', "values"),
        (f"temperature = {{ {HEAT}, capacity = 0.0, resistance = 1.0 }}", "capacity"),
        ('temperature = { kind = "table", times = [1.0, 0.5], values = [290.0, 291.0] }', "must rise"),
        ('kinetic_rate = 7.0, temperature = { kind = "constant", value = 293.0 }', "kinetic_rate is 7"),
        ("static_rate = 0.1", "temperature"),
    ],
)
def test_impossible_temperatures_are_refused(thermal: str, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        robot_from_toml(TOML.replace("THERMAL", thermal))


def test_a_thermal_table_round_trips_through_a_file() -> None:
    table = 'temperature = { kind = "table", times = [0.0, 1.0], values = [290.0, 291.0] }'
    robot = robot_from_toml(TOML.replace("THERMAL", f"static_rate = 0.01, {table}"))
    assert robot_from_toml(robot_to_toml(robot)) == robot
