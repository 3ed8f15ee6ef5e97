"""Core channels with different clocks: all are used, and none is compared beyond its bandwidth."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from diagnosis_cases import ARM as ARM_MOTION
from diagnosis_cases import AXIS, Sines, bare, recorded
from end_to_end_cases import ARM, CASES
from numpy.random import default_rng

from missing_physics.diagnosis import Options, diagnose
from missing_physics.motion.estimate import Motion, estimate_motion
from missing_physics.recordings import estimate_noise
from missing_physics.standard.band import HIGHEST
from reference_model.simulation import simulate
from robot_model import InputError, Recording

ROBOT = bare("single_axis")
POSITION, TORQUE = "joint1.position", "joint1.torque"
FAST = 1000.0


def thinned(recording: Recording, kept: Mapping[str, tuple[int, int]]) -> Recording:
    """With numbers at every so many-th sample of these channels, from some sample on."""
    channels = {}
    for channel, (every, first) in kept.items():
        channels[channel] = np.full(len(recording), np.nan)
        channels[channel][first::every] = recording[channel][first::every]
    return recording.with_channels(channels)


def made(motion: Sines = AXIS[0]) -> Recording:
    time = np.arange(8000) / FAST
    q, _, qdd = motion(time)
    return Recording(time, {POSITION: q, TORQUE: 95.0 * qdd}, "made.csv")


def estimate(recording: Recording, **noise: float) -> Motion:
    by_channel = {f"joint1.{quantity}": value for quantity, value in noise.items()}
    return estimate_motion(ROBOT, recording, inertia=np.array([95.0]), noise=by_channel)


def test_a_slower_torque_keeps_all_samples_of_the_encoder_and_limits_the_cutoff() -> None:
    slow = estimate(thinned(made(), {TORQUE: (4, 2)}))
    assert slow.low_pass.rate == pytest.approx(FAST)
    assert slow.time[0] == pytest.approx(0.002)
    recorded_there = made()[POSITION][2 : 2 + slow.time.size, None]
    np.testing.assert_allclose(slow.raw_position, recorded_there, rtol=1e-14)
    assert slow.low_pass.cutoff == pytest.approx(HIGHEST * FAST / 4)
    exact = 95.0 * AXIS[0](slow.time)[2]
    inner = slice(50, -50)
    assert np.abs(slow.torque[inner, 0] - exact[inner]).max() < 1e-5 * np.ptp(exact)


def test_requested_cutoff_is_limited_by_the_slower_channel() -> None:
    found = estimate_motion(
        ROBOT, thinned(made(), {TORQUE: (4, 0)}), inertia=np.array([95.0]), noise={}, cutoff=70.0
    )
    assert found.low_pass.cutoff == pytest.approx(HIGHEST * FAST / 4)


def test_noise_of_an_interpolated_channel_keeps_its_density() -> None:
    """What passes the filters is as strong as white noise of the stated size per sample."""
    noise = 0.5 * default_rng(3).standard_normal(8000)
    quiet = made().with_channels({TORQUE: np.zeros(8000)})
    slow = estimate(thinned(quiet.with_channels({TORQUE: noise}), {TORQUE: (4, 0)}), torque=0.5)
    white = slow.torque_noise * default_rng(4).standard_normal((40, 8000))
    passed = np.std(slow.low_pass.reduce(slow.torque[:, 0]))
    drawn = np.std([slow.low_pass.reduce(one) for one in white])
    assert passed == pytest.approx(drawn, rel=0.2)  # 320 independent samples


@pytest.mark.parametrize("every", [2, 4])
def test_noise_of_a_slower_channel_is_estimated_from_its_own_samples(every: int) -> None:
    noisy = made().with_channels({TORQUE: made()[TORQUE] + 0.5 * default_rng(5).standard_normal(8000)})
    found = estimate_noise(thinned(noisy, {TORQUE: (every, 1)}))
    assert found[TORQUE] == pytest.approx(0.5, rel=0.1)


def test_positions_of_two_joints_on_interleaved_clocks_are_combined() -> None:
    """Neither clock has an instant of the other; together they have as many instants as one."""
    robot = bare("two_link_arm")
    whole = recorded(robot, ARM_MOTION)
    both = {f"joint{k + 1}.{what}": (2, k) for k in range(2) for what in ("position", "torque")}
    found = estimate_motion(robot, thinned(whole, both), inertia=np.ones(2), noise={})
    assert found.low_pass.rate == pytest.approx(125.0)
    for joint, motion in enumerate(ARM_MOTION):
        exact = motion(found.time)
        inner = slice(100, -100)
        assert found.motion_cutoff <= 0.25 * 125.0
        assert np.abs(found.raw_position[inner, joint] - exact[0][inner]).max() < 1e-7
        assert np.abs(found.acceleration[inner, joint] - exact[2][inner]).max() < 1e-3


def test_a_gap_of_a_slower_channel_stays_a_gap() -> None:
    """Ten of its own sample times are bridged, more are not."""
    slow = thinned(made(), {TORQUE: (4, 0)})
    short, long = slow[TORQUE].copy(), slow[TORQUE].copy()
    short[3001:3036] = np.nan
    long[3001:3056] = np.nan
    assert estimate(slow.with_channels({TORQUE: short})).time.size == estimate(slow).time.size
    cut = estimate(slow.with_channels({TORQUE: long}))
    assert cut.time[0] == pytest.approx(3.056)


def test_random_numbers_are_not_accepted_as_time_stamps() -> None:
    """What comes without any rhythm is used where it is, as ever."""
    holed = np.where(default_rng(6).random(8000) < 0.3, made()[TORQUE], np.nan)
    found = estimate(made().with_channels({TORQUE: holed}))
    assert found.low_pass.rate < 0.5 * FAST


def test_too_few_samples_are_rejected() -> None:
    with pytest.raises(InputError, match="needs at least 50"):
        estimate(thinned(made(), {TORQUE: (200, 0)}))


SLOWER = {
    "torques at a quarter of the rate": {f"joint{k}.torque": (4, 0) for k in (1, 2)},
    "positions on interleaved clocks": {"joint1.position": (2, 0), "joint2.position": (2, 1)},
}


@pytest.mark.parametrize(
    "which", [pytest.param(name, marks=pytest.mark.proof if "rate" in name else ()) for name in SLOWER]
)
def test_hidden_dry_friction_is_named_with_its_size(which: str) -> None:
    case = CASES["coulomb"]
    recording = thinned(simulate(ARM.with_effects(case.hidden), seed=1), SLOWER[which])
    found = diagnose(ARM, [recording], options=Options(experiments=False)).diagnosis
    [finding] = found.findings
    assert (finding.effect, finding.location) == (case.effect, case.at)
    low, high = finding.parameters["torque"].ci95
    assert low < case.parameters["torque"] < high
    assert found.fit.validation_improvement > case.improvement
