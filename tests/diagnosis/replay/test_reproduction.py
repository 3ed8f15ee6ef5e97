"""Whether a robot's own run does what was recorded: right chances without effects, and small effects seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from missing_physics.diagnosis import Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.replay.reproduction import octave_chances, reproduction
from missing_physics.diagnosis.replay.sensor_errors import rounded_mean
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, Robot, Sensor, load_robot

QUICK = Options(experiments=False)


@pytest.fixture(scope="module")
def arm() -> Robot:
    return load_robot("two_link_arm")


def test_chances_of_white_noise_are_evenly_spread() -> None:
    chance = np.random.default_rng(1)
    found = np.array([octave_chances(chance.standard_normal(1000))[:2] for _ in range(800)])
    for level in (0.1, 0.5):
        shares = (found < level).mean(0)
        # 800 chances each: 1.8 % is one deviation at one half.
        np.testing.assert_allclose(shares, level, atol=0.07)


def test_smallest_chance_times_their_number_is_no_false_alarm() -> None:
    chance = np.random.default_rng(2)
    draws = [octave_chances(chance.standard_normal(500)) for _ in range(400)]
    alarms = np.mean([min(c) * len(c) < 0.1 for c in draws])
    assert alarms < 0.15  # 10 % at most, of 400


def test_a_slow_wave_below_the_noise_stands_out() -> None:
    time = np.arange(4000) / 200
    noise = np.random.default_rng(3).standard_normal(time.size)
    assert min(octave_chances(noise)) > 1e-3
    assert min(octave_chances(noise + 0.3 * np.sin(2 * np.pi * 0.2 * time))) < 1e-12


def test_a_sensor_better_than_stated_hides_nothing() -> None:
    time = np.arange(4000) / 200
    noise = 0.2 * np.random.default_rng(4).standard_normal(time.size)
    assert min(octave_chances(noise)) > 1e-3
    # Against the stated noise this wave is nothing: its energy adds 8 to a chi-square of many numbers.
    assert min(octave_chances(noise + 0.06 * np.sin(2 * np.pi * 0.2 * time))) < 1e-12


@pytest.mark.parametrize("spread", [0.0, 0.15, 0.3, 0.6])
def test_mean_of_rounded_values_by_drawing(spread: float) -> None:
    sensor = Sensor(channel="joint1.position", noise=spread * 2.0, resolution=2.0)
    values = np.linspace(-3.1, 3.1, 25)
    drawn = np.random.default_rng(5).standard_normal((200_000, 1)) * sensor.noise
    said = (np.round((values + drawn) / 2.0) * 2.0).mean(0)
    # Five deviations of a mean of 200,000 values that are off by at most 1 each.
    np.testing.assert_allclose(rounded_mean(values, sensor), said, atol=5 / 200_000**0.5)


def test_own_recording_is_reproduced_and_no_effect_looked_for(arm: Robot) -> None:
    recording = simulate(arm, seed=3000)
    found = reproduction(arm, [recording])
    assert found is not None
    assert found.complete
    assert set(found.channels) == {sensor.channel for sensor in arm.sensors}
    result = diagnose(arm, [recording], options=QUICK)
    assert result.diagnosis.verdict == "consistent"
    assert result.diagnosis.findings == ()
    assert result.ladder == ()
    assert any("nominal robot's own run" in note for note in result.diagnosis.notes)


@pytest.mark.parametrize(
    "use",
    [
        EffectUse(effect="viscous_friction", at="joint2", coefficient=0.026),
        EffectUse(effect="coulomb_friction", at="joint2", torque=0.026),
        EffectUse(effect="torque_gain", at="joint1", gain_error=0.0024),
        EffectUse(effect="sensor_delay", at="joint2.position", delay=0.0026),
    ],
    ids=lambda use: use.effect,
)
def test_effects_of_a_quarter_of_the_noise_energy_are_not_reproduced(arm: Robot, use: EffectUse) -> None:
    # A quarter of what the sensors' noise leaves in the filtered torques: a regression hardly sees it.
    found = reproduction(arm, [simulate(arm.with_effects(use), seed=3106)])
    assert found is not None
    assert not found.complete
    assert found.chance < 1e-6


def test_what_cannot_be_compared_is_not(arm: Robot) -> None:
    recording = simulate(arm, seed=3107)
    silent = arm.model_copy(update={"sensors": arm.sensors[1:]})
    other = dict(recording.channels)
    other["joint1.reference_position"] = other["joint1.reference_position"] + 1e-3
    foreign = replace(recording, channels={**recording.channels, "joint1.motor_position": recording.time})
    assert (moved := reproduction(arm, [replace(recording, channels=other)])) is not None
    assert not moved.complete
    for robot, given in (
        (silent, recording),
        (arm, foreign),
        (arm, without(recording, "joint2.torque")),
        (arm, with_gap(recording)),
    ):
        assert reproduction(robot, [given]) is None


def test_the_recorded_reference_will_do_where_the_file_has_none_or_another(arm: Robot) -> None:
    assert arm.reference is not None
    recording = simulate(arm, seed=3107)
    slower = [
        j.model_copy(update={"frequencies": tuple(0.7 * f for f in j.frequencies)})  # type: ignore[union-attr]
        for j in arm.reference.joints
    ]
    other = arm.model_copy(update={"reference": arm.reference.model_copy(update={"joints": tuple(slower)})})
    late = replace(recording, time=recording.time + 3e-4)
    for robot, given in (
        (arm.model_copy(update={"reference": None}), recording),
        (other, recording),
        (arm, late),
    ):
        found = reproduction(robot, [given])
        assert found is not None
        assert found.complete
    stiff = simulate(
        arm.with_effects(EffectUse(effect="torque_gain", at="joint1", gain_error=0.0024)), seed=3106
    )
    found = reproduction(other, [stiff])
    assert found is not None
    assert found.chance < 1e-6


def without(recording: Recording, name: str) -> Recording:
    return replace(recording, channels={k: v for k, v in recording.channels.items() if k != name})


def with_gap(recording: Recording) -> Recording:
    values = recording["joint1.torque"].copy()
    values[100] = np.nan
    return replace(recording, channels={**recording.channels, "joint1.torque": values})


def test_part_of_a_recording_is_compared_as_well(arm: Robot) -> None:
    recording = simulate(arm, seed=3000)
    part = recording.window(recording.time[200], recording.time[2000])
    found = reproduction(arm, [part])
    assert found is not None
    assert found.complete
