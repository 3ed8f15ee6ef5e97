"""Whether the controller of the file was in force: right ones pass whatever encoders and drives do."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from end_to_end_cases import ARM, AXIS

from missing_physics.diagnosis.free_run.in_force import (
    NOT_IN_FORCE,
    _stretch,
    another_controller,
    not_commanded,
)
from missing_physics.diagnosis.motion.low_pass import LowPass
from missing_physics.diagnosis.preparation.setup import make_dynamics
from reference_model.simulation import simulate
from robot_model import ComputedTorque, EffectUse, Hold, JointPD, NoController, Reference, Robot, Table

#: 20 rad/s, critically damped.
COMPUTED = ComputedTorque(kp=400.0, kd=40.0)


def left(hidden: Robot, described: Robot | None = None) -> float:
    """Of a recording of `hidden`, by the controller of `described`."""
    described = described or hidden
    recording = simulate(hidden, seed=21)
    [dynamics] = make_dynamics(described, [recording])
    return not_commanded(described, recording, dynamics.motion)


def controlled(robot: Robot, **factors: float) -> Robot:
    """With other gains; those of the file when left out."""
    controller = robot.controller
    assert isinstance(controller, JointPD | ComputedTorque)
    gains = {
        name: tuple(factor * np.broadcast_to(getattr(controller, name), len(robot.moving_joints)))
        for name, factor in factors.items()
    }
    return robot.model_copy(update={"controller": controller.model_copy(update=gains)})


@pytest.mark.parametrize(
    "use",
    [
        {"effect": "sensor_delay", "at": "joint1.position", "delay": 0.008},
        {"effect": "sensor_delay", "at": "joint1.torque", "delay": 0.012},
        {"effect": "sensor_gain", "at": "joint1.position", "gain_error": 0.06},
        {"effect": "sensor_gain", "at": "joint2.torque", "gain_error": -0.08},
        {"effect": "sensor_offset", "at": "joint1.position", "offset": 0.01},
        {"effect": "torque_gain", "at": "joint1", "gain_error": 0.08},
        {"effect": "actuator_lag", "at": "joint2", "time_constant": 0.01},
        {"effect": "torque_saturation", "at": "joint1", "limit": 15.0},
        {
            "effect": "encoder_eccentricity",
            "at": "joint1.position",
            "cosine": 2e-3,
            "sine": 1e-3,
            "order": 9.0,
        },
        {"effect": "clock_drift", "at": "joint2.position", "rate": 1e-3},
        {"effect": "coulomb_friction", "at": "joint1", "torque": 4.0},
    ],
    ids=lambda use: f"{use['effect']}@{use['at']}",
)
def test_the_right_controller_passes_whatever_is_hidden(use: dict[str, Any]) -> None:
    assert left(ARM.with_effects(EffectUse(**use)), ARM) < NOT_IN_FORCE


def test_a_cycle_is_found_along_a_long_way_without_trying_each_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """Along 100 rad, orders up to 400 would be 12000 at half their width; a stretch needs fewer."""
    tried = []

    def counted(self: LowPass, values: Any) -> Any:
        tried.append(values.shape)
        return reduce(self, values)

    reduce = LowPass.reduce
    monkeypatch.setattr(LowPass, "reduce", counted)
    motion = Table(joint="joint1", times=(0.0, 2.0, 8.0, 10.0), positions=(0.0, 0.0, 100.0, 100.0))
    reference = Reference(duration=10.0, sample_rate=250.0, joints=(motion, Hold(joint="joint2")))
    quick = ARM.joints[0].model_copy(update={"velocity_limit": None, "position_limits": None})
    robot = ARM.model_copy(update={"joints": (quick, *ARM.joints[1:]), "reference": reference})
    disc = {"effect": "encoder_eccentricity", "at": "joint1.position", "cosine": 0.01, "order": 0.8}
    hidden = robot.with_effects(EffectUse(**disc, sine=0.005))
    assert left(hidden, robot) < NOT_IN_FORCE
    assert 10 < len(tried) < 4000


def test_the_stretch_of_a_way_with_most_of_a_residual() -> None:
    way = np.r_[np.linspace(0.0, 30.0, 1000), np.linspace(30.0, 29.0, 1000)]
    even = np.ones(2000)
    assert _stretch(way, even, 100.0) == (0, 1999)
    first, last = _stretch(way, even, 5.0)
    assert way[first] == pytest.approx(25.0, abs=0.04)  # 5 m of the quick way, and all of the slow one
    assert last == 1999
    first, last = _stretch(way, np.where(np.arange(2000) == 500, 1e3, 1.0), 5.0)
    assert first <= 500 <= last
    assert np.ptp(way[first : last + 1]) <= 5.0


@pytest.mark.proof
def test_other_gains_are_seen() -> None:
    for factors in ({"kp": 0.5}, {"kp": 2.0}, {"kd": 3.0}, {"kp": 0.03, "kd": 0.03}):
        assert left(controlled(ARM, **factors), ARM) > NOT_IN_FORCE, factors


def test_computed_torque_is_asked_too() -> None:
    robot = ARM.model_copy(update={"controller": COMPUTED})
    assert left(robot) < NOT_IN_FORCE
    assert left(robot, ARM) > NOT_IN_FORCE


def test_an_integral_action_follows_its_own_zero() -> None:
    robot = controlled(AXIS)
    assert isinstance(robot.controller, JointPD)
    gain = float(np.ravel(robot.controller.kp)[0])
    robot = robot.model_copy(update={"controller": robot.controller.model_copy(update={"ki": gain})})
    hidden = robot.with_effects(EffectUse(effect="sensor_offset", at="joint1.position", offset=1e-3))
    assert left(hidden, robot) < NOT_IN_FORCE


def test_what_cannot_be_asked_passes() -> None:
    recording = simulate(ARM, seed=22)
    [dynamics] = make_dynamics(ARM, [recording])
    assert another_controller(ARM, [recording], [dynamics.motion]) == ""
    none = ARM.model_copy(update={"controller": NoController()})
    assert another_controller(none, [recording], [dynamics.motion]) == ""
