"""Commands that a sampled controller holds, and torques recorded in steps that nobody states."""

from __future__ import annotations

import numpy as np
import pytest

from missing_physics.evaluation.held import as_held
from missing_physics.hypotheses.hypothesis import Hypothesis
from missing_physics.inference.fit import fitted
from missing_physics.inference.torques.data import TorqueData
from missing_physics.standard import fit_standard
from missing_physics.standard.band import band_motion
from reference_model.simulation import simulate
from robot_model import Recording, Robot, load_robot

ARM = load_robot("two_link_arm").model_copy(update={"effects": ()})
PERIOD = 0.01


def with_period(period: float) -> Robot:
    return ARM.model_copy(update={"controller": ARM.controller.model_copy(update={"sample_time": period})})


def recorded(robot: Robot, seed: int) -> Recording:
    run = simulate(robot, seed=seed)
    names = [f"{j.name}.{q}" for j in robot.moving_joints for q in ("position", "torque")]
    return Recording(run.time, {name: run[name] for name in names}, "simulated")


def test_a_held_command_takes_effect_half_a_period_later() -> None:
    """A parabola, which a cubic spline reproduces exactly; the period is shorter than the sampling time."""
    time = np.arange(0.0, 2.0, 0.05)
    recording = Recording(time, {"joint1.torque": time**2}, "made")
    found = as_held(time**2, time, with_period(PERIOD), recording, "joint1.torque")
    np.testing.assert_allclose(found[1:], (time[1:] - 0.5 * PERIOD) ** 2, rtol=0.0, atol=1e-12)


def test_a_continuous_command_is_unchanged() -> None:
    time = np.arange(0.0, 2.0, 0.05)
    recording = Recording(time, {"joint1.torque": time**2}, "made")
    assert np.array_equal(as_held(time**2, time, with_period(0.0), recording, "joint1.torque"), time**2)


def test_hold_in_the_robot_file_is_not_estimated_as_a_delay() -> None:
    """Torques are early by half a sample; a file without the hold estimates ten times as much."""
    machine = with_period(PERIOD)
    runs = [recorded(machine, seed) for seed in (0, 1)]
    known, unknown = (
        fitted(TorqueData.of(fit_standard(file, runs[:1]), runs[:1], runs[1:]), Hypothesis()).parameter(
            "timing"
        )
        for file in (machine, ARM)
    )
    assert unknown < 0.0
    assert abs(known) < 0.1 * abs(unknown)


@pytest.mark.parametrize("stated", [True, False])
def test_rounding_of_a_torque_counts_whether_its_step_is_stated_or_visible(stated: bool) -> None:
    """Less than a uniform error of the step, as the torque travels over several steps."""
    step, run = 2.0, recorded(ARM, 0)
    torque = "joint1.torque"
    rounded = run.with_channels({torque: step * np.round(run[torque] / step)})
    resolution = {torque: step} if stated else {}
    coarse = Recording(
        rounded.time, {name: rounded[name] for name in rounded}, "coarse", resolution=resolution
    )
    found = band_motion(ARM.model_copy(update={"sensors": ()}), coarse, 5.0).rounding
    assert 0.0 < found[0] < step / np.sqrt(12.0)
    assert found[1] == pytest.approx(0.0, abs=1e-6)
