"""Terms driven by the torque do not take its sensor's noise for physics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_cases import ARM, bare, plain_view, problem_of, recorded, term
from numpy.typing import NDArray

from missing_physics.diagnosis.candidates.effects import Candidate
from missing_physics.diagnosis.candidates.fitted import refit
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.motion.commanded_torque import quiet
from missing_physics.diagnosis.motion.low_pass import LowPass
from robot_model import Recording

Array = NDArray[np.float64]
#: Torque noise as a part of the torque's rms: what friction in the second joint does, many times over.
NOISE = 0.3
FRICTION = 0.7  # [N m]
LAG = 0.006  # [s]


def test_without_noise_the_torque_is_as_measured() -> None:
    chance = np.random.default_rng(1)
    measured, predicted = chance.standard_normal((2, 300, 2))
    measured[:, 1] = np.nan
    found = quiet(measured, predicted, np.array([0.0, 1.0]), measured, np.ones(2), LowPass(200.0, 10.0))
    np.testing.assert_array_equal(found, measured)


def test_noise_goes_and_what_the_prediction_lacks_stays() -> None:
    chance, time = np.random.default_rng(2), np.arange(4000) / 200.0
    turn = 2 * np.pi * 0.4 * time
    known, rate = np.sin(turn), np.cos(turn)
    friction, other = 0.5 * np.sign(rate), 0.5 * np.sin(3 * turn)
    noise = 0.3 * chance.standard_normal(time.size)
    # What is left of the noise is where something else is, and there alone: a tenth of its energy at most.
    for lacking in (0.0 * noise, friction, friction + other):
        measured = known + lacking + noise
        series = measured[:, None], known[:, None], np.array([0.3]), rate[:, None], np.array([1e-3])
        found = quiet(*series, LowPass(200.0, 10.0))
        assert np.std(found[:, 0] - known - lacking) < 0.3 * np.std(noise)


def _fitted(lag: float, seed: int, joint: str) -> tuple[Explanation, Explanation]:
    """Friction known, a lag of `joint` tried beside it on a recording with a lag of both and noise."""
    exact = recorded(bare("two_link_arm"), ARM, lambda t, q, v, a: FRICTION * np.tanh(v / 1e-3) * [0.0, 1.0])
    channels, chance = dict(exact.channels), np.random.default_rng(seed)
    robot, sensors = bare("two_link_arm", noise=True), []
    for sensor in robot.sensors:
        values = channels[sensor.channel]
        if sensor.channel.endswith(".torque"):
            values = values + lag * np.gradient(values, exact.time)
            sensor = sensor.model_copy(update={"noise": NOISE * float(np.std(values))})
        channels[sensor.channel] = values + sensor.noise * chance.standard_normal(values.size)
        sensors.append(sensor)
    robot = robot.model_copy(update={"sensors": tuple(sensors)})
    problem = problem_of(robot, Recording(exact.time, channels, "made by formula"))
    view = plain_view(problem, scale=problem.noise_floor)
    without = explain(problem, view, [term("coulomb_friction", "joint2", torque=0.5)])
    tried = Candidate(term("actuator_lag", joint, time_constant=0.004))
    return without, refit(problem, view, without, tried)


@pytest.mark.parametrize("joint", ["joint1", "joint2"])
@pytest.mark.parametrize("seed", [4])
def test_smoothed_noise_is_no_lag(joint: str, seed: int) -> None:
    """Driven by the torque as measured the lag came out at 8 +- 1.5 ms, with evidence for it."""
    without, fitted = _fitted(0.0, seed, joint)
    lag = next(t for t in fitted.terms if t.effect.id == "actuator_lag")
    assert fitted.intervals(lag)["time_constant"][0] <= 0.0
    assert fitted.evidence_over(without) < 0.0


@pytest.mark.parametrize("joint", ["joint1", "joint2"])
@pytest.mark.parametrize("seed", [4])
def test_noise_makes_a_lag_no_longer(joint: str, seed: int) -> None:
    """Driven by the torque as measured it came out at 12.6 +- 2 ms."""
    without, fitted = _fitted(LAG, seed, joint)
    lag = next(t for t in fitted.terms if t.effect.id == "actuator_lag")
    low, high = fitted.intervals(lag)["time_constant"]
    assert low <= LAG <= high
    assert low > 0.0
    assert fitted.evidence_over(without) > 0.0


def test_noise_is_not_referred_to_the_torque_that_is_delivered() -> None:
    """Errors beyond noise are; noise of the sensor does not go through the actuator."""
    without, _ = _fitted(0.0, 4, "joint1")
    problem, noise = without.problem, without.view.aside(without.problem)
    np.testing.assert_allclose(without.energies, noise, rtol=0.2)
    gained = replace(term("torque_gain", "joint1", gain_error=-0.5), frozen=True)
    half = explain(problem, without.view, [*without.terms, gained])
    # Half the torque has a quarter of the energy.
    wanted = half.energies[0] + 3.0 * (half.energies[0] - noise[0])
    assert half.energies[0] > 2.0 * noise[0]
    np.testing.assert_allclose(half.referred, [wanted, half.energies[1]], rtol=0.05)
