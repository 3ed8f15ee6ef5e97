"""Joints that stop and turn back: friction by the equation of motion, not by a smoothed velocity's sign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from missing_physics.evaluation.stops import Stops, through_stops

Array = NDArray[np.float64]

STEP, MASS, LEVEL = 1e-3, 2.0, 3.0
FILTER = butter(4, 25.0, fs=1.0 / STEP, output="sos")
MEMORY = 0.5 / 25.0


def smooth(values: Array) -> Array:
    return np.asarray(sosfiltfilt(FILTER, values, axis=0))


def driven(stiffness: float, push: float = 0.0) -> tuple[Array, Array, Array]:
    """Torque, velocity and friction of a mass that follows a wave, with ten steps to a sample."""
    fine, count = STEP / 10, 40_000
    reference = 0.1 * np.sin(2.0 * np.pi * 0.9 * fine * np.arange(count))
    wanted = np.gradient(reference, fine)
    damping = 2.0 * np.sqrt(stiffness * MASS)
    place, speed, found = 0.0, float(wanted[0]), np.empty((count, 3))
    for i in range(count):
        torque = stiffness * (reference[i] - place) + damping * (wanted[i] - speed) + push
        free = speed + fine / MASS * torque
        friction = min(max(free * MASS / fine, -LEVEL), LEVEL)
        speed = free - fine / MASS * friction
        place += fine * speed
        found[i] = torque, speed, friction
    return found[::10, 0], found[::10, 1], found[:, 2].reshape(-1, 10).mean(axis=1)


def stops(torque: Array, velocity: Array, noise: float = 1e-6) -> Stops:
    seen = smooth(velocity)[:, None]
    left = smooth(torque)[:, None] - MASS * np.gradient(seen, STEP, axis=0)
    flat = np.ones_like(seen)
    return Stops(
        step=STEP,
        velocity=seen,
        noise=noise * flat,
        left=left,
        level=LEVEL * flat,
        still=LEVEL * flat,
        speeds=np.zeros((1, 1)),
        rise=np.zeros((1, 1)),
        jumps=torque[:, None] - smooth(torque)[:, None],
        mobility=np.full((len(torque), 1, 1), 1.0 / MASS),
        memory=MEMORY,
        smooth=smooth,
    )


@pytest.fixture(scope="module", params=[60.0, 2000.0], ids=["soft", "stiff"])
def case(request: pytest.FixtureRequest) -> tuple[Stops, Array, Array]:
    """A mass that sticks as it turns back: for long under a soft controller, for short under a stiff one."""
    torque, velocity, friction = driven(request.param)
    return stops(torque, velocity), velocity, friction


def integrated(given: Stops) -> tuple[Array, Array]:
    """Velocity and direction of friction of the only joint."""
    nowhere = np.zeros(given.velocity.shape, dtype=bool)
    velocity, direction, _ = through_stops(given, np.sign(given.velocity), nowhere, np.array([True]))
    return velocity[:, 0], direction[:, 0]


def rms(values: Array) -> float:
    """Away from the ends, where a filter has no past."""
    return float(np.sqrt(np.mean(values[200:-200] ** 2)))


def test_the_velocity_has_its_bends_back(case: tuple[Stops, Array, Array]) -> None:
    given, velocity, _ = case
    assert rms(integrated(given)[0] - velocity) < 0.2 * rms(given.velocity[:, 0] - velocity)


def test_friction_has_the_impulse_it_had(case: tuple[Stops, Array, Array]) -> None:
    given, _, friction = case
    wrong = smooth(LEVEL * integrated(given)[1] - friction)
    by_sign = smooth(LEVEL * np.sign(given.velocity[:, 0]) - friction)
    assert rms(wrong) < 0.2 * rms(by_sign)


def test_a_motion_that_friction_does_not_bend_is_left_as_it_is() -> None:
    """A stiff controller imposes a smooth motion: its torque jumps by what friction jumps by."""
    time = np.arange(0.0, 4.0, STEP)
    velocity = 0.3 * np.cos(2.0 * np.pi * 0.9 * time)
    torque = MASS * np.gradient(velocity, STEP) + LEVEL * np.sign(velocity)
    given = stops(torque, velocity)
    late = replace(given, jumps=np.zeros_like(given.jumps))  # recorded through a filter
    found, direction = integrated(late)
    assert np.array_equal(found, late.velocity[:, 0])
    assert np.array_equal(direction, np.sign(late.velocity[:, 0]))


def test_a_joint_whose_torque_is_not_recorded_keeps_its_signs() -> None:
    torque, velocity, _ = driven(2000.0)
    given = stops(torque, velocity)
    blind = replace(given, left=np.full_like(given.left, np.nan))
    assert np.array_equal(integrated(blind)[1], np.sign(given.velocity[:, 0]))
