"""Motion and torque of a recording: known signals, gaps, jitter, motors, and rejected input."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from diagnosis_cases import AXIS, Sines, bare
from numpy.random import default_rng
from scipy.interpolate import make_interp_spline

from missing_physics.checks.actuation import actuator_torque
from missing_physics.motion.estimate import NOISE_PART, Motion, estimate_motion
from missing_physics.motion.low_pass import LowPass
from robot_model import Actuator, InputError, Recording, Robot

MASS = 95.0
ROBOT = bare("single_axis")


def estimate(recording: Recording, robot: Robot = ROBOT, **given: Any) -> Motion:
    return estimate_motion(robot, recording, inertia=np.array([MASS]), noise=given.pop("noise", {}), **given)


def recording(motion: Sines = AXIS[0], *, rate: float = 1000.0, duration: float = 8.0) -> Recording:
    time = np.arange(round(rate * duration)) / rate
    q, _, qdd = motion(time)
    return Recording(time, {"joint1.position": q, "joint1.torque": MASS * qdd}, "made.csv")


def inner(motion: Motion) -> slice:
    return slice(motion.low_pass.edge, -motion.low_pass.edge)


@pytest.mark.parametrize("frequency", [0.2, 1.0, 5.0, 20.0])
def test_derivatives_of_a_sine(frequency: float) -> None:
    sine = Sines((0.02,), (frequency,), (0.4,))
    motion = estimate(recording(sine, duration=4.0))
    part = slice(1000, 3000)  # far from the ends
    w = 2 * np.pi * frequency
    # Two passes of fourth order lose (f/fc)^8; the quintic spline's second derivative errs by about
    # (w h)^4/100 and its rounding by 1e-16 w^-2 h^-2.
    allowed = (frequency / motion.motion_cutoff) ** 8 + (w * 1e-3) ** 4 / 50 + 1e-14 / (w * 1e-3) ** 2
    wanted = sine(motion.time)
    for found, exact, scale in zip(
        (motion.position, motion.velocity, motion.acceleration), wanted, (1.0, w, w**2)
    ):
        assert np.abs(found[part, 0] - exact[part]).max() < allowed * 0.02 * scale


def test_low_pass_halves_at_its_cutoff_shifts_nothing_and_keeps_constants() -> None:
    low_pass = LowPass(rate=500.0, cutoff=10.0)
    time = np.arange(5000) / 500.0
    sine = np.sin(2 * np.pi * 10.0 * time)
    middle = slice(1000, 4000)
    np.testing.assert_allclose(low_pass.smooth(sine)[middle], 0.5 * sine[middle], atol=1e-6)
    np.testing.assert_allclose(low_pass.smooth(np.full((5000, 2), 3.0)), 3.0, rtol=1e-9)
    kept = np.arange(5000)[low_pass.kept(5000)]
    # four samples per period of the cut-off, ends of two periods left out
    assert np.all(np.diff(kept) == 500 // 40)
    assert (kept[0], kept[-1] < 5000 - 100) == (100, True)
    np.testing.assert_allclose(low_pass.reduce(sine), low_pass.smooth(sine)[kept], atol=1e-9)


def test_cutoff_falls_with_noise() -> None:
    made = recording()
    noises = [0.0, 1e-7, 1e-6, 1e-5, 1e-4]
    motions = [estimate(made, noise={"joint1.position": sigma}) for sigma in noises]
    cutoffs = [motion.low_pass.cutoff for motion in motions]
    assert cutoffs == sorted(cutoffs, reverse=True)
    assert cutoffs[1] > cutoffs[-1]
    widths = [motion.motion_cutoff for motion in motions]
    assert widths == sorted(widths, reverse=True)
    assert all(wide >= cutoff for wide, cutoff in zip(widths, cutoffs))


def test_resolution_counts_as_noise() -> None:
    made = recording()
    step = 1e-5
    coarse = Recording(made.time, made.channels, resolution={"joint1.position": step})
    by_noise = estimate(made, noise={"joint1.position": step / np.sqrt(12)})
    assert estimate(coarse).low_pass.cutoff == pytest.approx(by_noise.low_pass.cutoff)


def test_noise_at_the_cutoff_is_the_specified_fraction_of_the_torque() -> None:
    sigma = 3e-6
    motion = estimate(recording(duration=40.0), noise={"joint1.position": sigma})
    noise = sigma * default_rng(0).standard_normal(motion.time.size)
    smooth = motion.low_pass.smooth(noise)
    made = MASS * make_interp_spline(motion.time, smooth, k=5)(motion.time, 2)
    part = inner(motion)
    ratio = made[part].std() / np.sqrt(np.mean(motion.torque**2))
    # The rule counts an ideal filter; this one is down to a half at the cut-off and passes a little above.
    assert 0.4 * NOISE_PART < ratio < 1.2 * NOISE_PART


def test_velocity_noise_is_that_of_smoothed_noise() -> None:
    sigma = 1e-5
    motion = estimate(recording(duration=40.0), noise={"joint1.position": sigma})
    noise = sigma * default_rng(0).standard_normal(motion.time.size)
    smooth = LowPass(motion.low_pass.rate, motion.motion_cutoff).smooth(noise)
    found = np.gradient(smooth, motion.time)[inner(motion)].std()
    assert found == pytest.approx(motion.velocity_noise[0], rel=0.2)


def test_short_gap_is_interpolated() -> None:
    made = recording()
    holed = made["joint1.position"].copy()
    holed[3000:3005] = np.nan
    whole, found = estimate(made), estimate(made.with_channels({"joint1.position": holed}))
    assert found.time.size == whole.time.size
    # A straight line over 6 ms misses by h^2/8 max|q''| = 4.5e-6 * 0.55 m/s^2.
    assert np.abs(found.raw_position - whole.raw_position).max() < 2.6e-6


def test_longest_part_between_long_gaps_is_used() -> None:
    made = recording()
    holed = made["joint1.torque"].copy()
    holed[1000:1100] = np.nan
    holed[5000:5900] = np.nan
    motion = estimate(made.with_channels({"joint1.torque": holed}))
    assert (motion.time[0], motion.time[-1]) == pytest.approx((1.1, 4.999))
    np.testing.assert_allclose(motion.torque[:, 0], made["joint1.torque"][1100:5000], atol=1e-11)


def test_uneven_samples_are_resampled() -> None:
    chance = default_rng(1)
    time = np.arange(8000) / 1000.0 + 2e-4 * chance.uniform(-1, 1, 8000)
    q, qd, qdd = AXIS[0](time)
    uneven = Recording(time, {"joint1.position": q, "joint1.torque": MASS * qdd})
    motion = estimate(uneven)
    np.testing.assert_allclose(np.diff(motion.time), motion.time[1] - motion.time[0], rtol=1e-9)
    part = inner(motion)
    exact = AXIS[0](motion.time)
    # linear interpolation: h^2/8 max|q''|, with h at most 1.4 ms
    assert np.abs(motion.raw_position[:, 0] - exact[0])[part].max() < 1.4e-3**2 / 8 * np.abs(qdd).max()
    # of which a smoother at 250 Hz makes a velocity error of less than 2 pi 250 Hz times that
    assert np.abs(motion.velocity[:, 0] - exact[1])[part].max() < 1e-3 * np.abs(qd).max()


def motor(**figures: float) -> Robot:
    joint = ROBOT.joints[0].model_copy(update={"actuator": Actuator(**figures)})
    return ROBOT.model_copy(update={"joints": (joint,)})


DRIVE = {"gear_ratio": 20.0, "torque_constant": 0.5, "resistance": 4.0}


def test_torque_is_taken_from_torque_current_or_voltage_in_this_order() -> None:
    channels = {f"joint1.{q}": np.zeros(3) for q in ("torque", "current", "voltage")}
    whole = Recording(np.arange(3.0), channels)
    robot = motor(**DRIVE)

    def without(*names: str) -> Recording:
        return Recording(whole.time, {k: v for k, v in channels.items() if k.split(".")[1] not in names})

    assert actuator_torque(robot, whole, "joint1") == ("joint1.torque", 1.0)
    assert actuator_torque(robot, without("torque"), "joint1") == ("joint1.current", 10.0)
    assert actuator_torque(robot, without("torque", "current"), "joint1") == ("joint1.voltage", 2.5)
    assert actuator_torque(robot, without("torque", "current", "voltage"), "joint1") == (None, 0.0)
    unknown = motor(gear_ratio=20.0)
    assert actuator_torque(unknown, without("torque"), "joint1") == (None, 0.0)
    wireless = motor(gear_ratio=20.0, torque_constant=0.5)
    assert actuator_torque(wireless, without("torque", "current"), "joint1") == (None, 0.0)


def test_torque_from_a_voltage_accounts_for_back_emf() -> None:
    """Winding: i = (u - N kt qd)/R, torque N kt i."""
    _, qd, qdd = AXIS[0](np.arange(8000) / 1000.0)
    current = MASS * qdd / 10.0
    made = recording().with_channels({"joint1.voltage": 4.0 * current + 10.0 * qd, "joint1.current": current})
    channels = {k: v for k, v in made.channels.items() if k in ("joint1.position", "joint1.voltage")}
    motion = estimate(Recording(made.time, channels), motor(**DRIVE))
    part = inner(motion)
    # the velocity is that of the spline, right to 1e-9
    np.testing.assert_allclose(motion.torque[part, 0], (MASS * qdd)[part], atol=1e-6)
    by_current = estimate(Recording(made.time, {**channels, "joint1.current": current}), motor(**DRIVE))
    np.testing.assert_allclose(by_current.torque[:, 0], MASS * qdd, atol=1e-9)


def test_the_motor_side_encoder_is_preferred_and_other_channels_are_kept() -> None:
    made = recording()
    both = made.with_channels(
        {"joint1.motor_position": made["joint1.position"] + 1.0, "joint1.temperature": np.full(8000, 300.0)}
    )
    motion = estimate(both)
    assert motion.raw_position[0, 0] == pytest.approx(made["joint1.position"][0] + 1.0)
    assert np.all(motion.temperature == 300.0)
    assert "joint1.temperature" in motion.others
    assert np.isnan(estimate(made).temperature).all()


def test_without_a_torque_channel_the_torque_is_unknown_not_zero() -> None:
    made = recording()
    motion = estimate(Recording(made.time, {"joint1.position": made["joint1.position"]}))
    assert np.isnan(motion.torque).all()


def holed(made: Recording, channel: str, keep: int) -> Recording:
    values = made[channel].copy()
    values[keep:] = np.nan
    return made.with_channels({channel: values})


def gaps(made: Recording) -> Recording:
    keep = np.arange(8000) % 200 < 40
    return Recording(made.time[keep], {k: v[keep] for k, v in made.channels.items()}, made.source)


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (
            lambda made: Recording(made.time, {"joint1.torque": made["joint1.torque"]}, made.source),
            "made.csv has neither joint1.position nor joint1.motor_position; .*--map",
        ),
        (lambda made: made.window(0.0, 0.03), "made.csv has 30 samples; a diagnosis needs at least 50"),
        (lambda made: holed(made, "joint1.position", 0), "made.csv: joint1.position holds no number"),
        (
            lambda made: holed(made, "joint1.position", 20),
            r"made.csv has 20 samples \(joint1.position has .* at least 50",
        ),
        (gaps, "made.csv is cut by gaps into parts of at most 40 samples; a diagnosis needs 50 in a row"),
    ],
)
def test_unusable_recordings_are_rejected_with_one_sentence(spoil: Any, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        estimate(spoil(recording()))
