"""Sensor readings of a simulation."""

from __future__ import annotations

import numpy as np
import pytest
from exudyn_robots import cart

from exudyn_model import simulate
from robot_model import EffectUse, InputError, JointPD, MultiSine, Reference, Robot, Sensor

NOISE, RESOLUTION = 2e-3, 5e-4


def moving_cart(**changes: object) -> Robot:
    """The cart in motion, its position measured with noise and its torque without."""
    motion = MultiSine(joint="slide", amplitudes=(0.1,), frequencies=(0.7,), ramp=0.2)
    given = {
        "controller": JointPD(kp=500.0, kd=60.0),
        "reference": Reference(duration=1.0, sample_rate=1000.0, joints=(motion,)),
        "sensors": (
            Sensor(channel="slide.position", noise=NOISE, resolution=RESOLUTION),
            Sensor(channel="slide.torque", noise=0.0, resolution=0.0),
        ),
    }
    return cart(**{**given, **changes})


def test_only_sensed_channels_are_recorded() -> None:
    recording = simulate(moving_cart())
    assert set(recording) == {"slide.position", "slide.torque", "slide.reference_position"}
    assert dict(recording.noise) == {"slide.position": NOISE}
    assert dict(recording.resolution) == {"slide.position": RESOLUTION}
    assert len(recording) == 1001


def test_noise_and_resolution_have_their_stated_values() -> None:
    robot = moving_cart()
    exact, recording = simulate(robot, sensors=False), simulate(robot, seed=4)
    error = recording["slide.position"] - exact["slide.position"]
    # 1001 samples: the standard deviation is within 4 / sqrt(2 * 1001) = 9 % but once in 16,000 draws, and
    # rounding adds (RESOLUTION / NOISE)^2 / 24 = 0.3 % to it.
    assert np.std(error) == pytest.approx(NOISE, rel=0.1)
    steps = recording["slide.position"] / RESOLUTION
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    np.testing.assert_array_equal(recording["slide.torque"], exact["slide.torque"])


def test_the_seed_determines_the_noise() -> None:
    robot = moving_cart()
    first, again, other = (simulate(robot, seed=seed)["slide.position"] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.mean(first == other) < 0.5


def test_a_robot_without_sensors_gives_every_channel() -> None:
    assert set(simulate(moving_cart(sensors=()))) == set(simulate(moving_cart(), sensors=False))


def test_a_sensor_of_an_unknown_channel_is_refused() -> None:
    robot = moving_cart(sensors=(Sensor(channel="slide.temperature", noise=0.0, resolution=0.0),))
    with pytest.raises(InputError, match=r"gives no channel 'slide\.temperature'"):
        simulate(robot)


def test_a_fault_of_an_unmeasured_channel_is_refused() -> None:
    use = EffectUse.model_validate({"effect": "sensor_offset", "at": "slide.velocity", "offset": 0.1})
    with pytest.raises(InputError, match=r"'slide\.velocity', which no sensor measures"):
        simulate(moving_cart().with_effects(use))
