"""Even samples with uneven time stamps, and uneven samples with correct ones."""

from __future__ import annotations

import numpy as np
import pytest

from missing_physics.checks.stamps import on_even_clock
from robot_model import Recording

STEP, SAMPLES, NOISE = 1e-3, 4000, 1e-6


def moved(instants: np.ndarray, stamps: np.ndarray) -> Recording:
    """A joint read at some instants, under the stamps of others."""
    noise = np.random.default_rng(3).normal(0.0, NOISE, instants.size)
    return Recording(stamps, {"joint1.position": np.sin(2.0 * np.pi * 1.3 * instants) + noise}, "run")


def even() -> np.ndarray:
    return np.arange(SAMPLES) * STEP


def late(seed: int = 1) -> np.ndarray:
    """Stamps in bursts: now and then a reader sleeps, and then reads what has come."""
    random, found = np.random.default_rng(seed), even()
    for start in random.integers(10, SAMPLES - 10, 60):
        woken = found[start] + random.uniform(1.0, 6.0) * STEP
        waiting = (even() >= even()[start]) & (even() < woken)
        found[waiting] = np.maximum(found[waiting], woken + 1e-5 * np.arange(waiting.sum()))
    return np.maximum.accumulate(found + 1e-9 * np.arange(SAMPLES))


def test_delayed_time_stamps_of_even_samples_are_corrected() -> None:
    found, words = on_even_clock(moved(even(), late()))
    # A clock is known but for when it begins and for the mean lateness.
    shift = found.time - even()
    assert np.ptp(shift) < 0.2 * STEP
    assert "time stamps scatter" in words


@pytest.mark.parametrize("seed", [1, 2])
def test_correct_time_stamps_of_uneven_samples_are_kept(seed: int) -> None:
    uneven = late(seed)
    found, words = on_even_clock(moved(uneven, uneven))
    assert words == ""
    assert np.array_equal(found.time, uneven)


def test_missing_sample_is_not_treated_as_a_delayed_time_stamp() -> None:
    kept = np.delete(even(), [700, 701, 702, 2500])
    assert on_even_clock(moved(kept, kept))[1] == ""


def test_evenly_sampled_recording_is_unchanged() -> None:
    before = moved(even(), even())
    assert on_even_clock(before) == (before, "")


def test_joints_at_rest_do_not_change_time_stamps() -> None:
    stamps = late()
    still = Recording(stamps, {"joint1.position": np.zeros(SAMPLES)}, "run")
    assert on_even_clock(still) == (still, "")
