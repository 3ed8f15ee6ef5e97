"""Torque uncertainty due to sampling and rounding, against simulated and filtered errors."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from missing_physics.evaluation.band import low_passed
from missing_physics.evaluation.steps import mean_rounding_error, unsteadiness

RATE, CUTOFF, SMOOTHING = 200.0, 5.0, 25.0
TIME = np.arange(0.0, 20.0, 1.0 / RATE)
STEP = 0.1
Array = NDArray[np.float64]


def unsteady(torque: Array, *, noise: float = 0.0, step: float = 0.0) -> Array:
    """By jumps and rounding together, shape (N,)."""
    given = torque[:, None], np.array([noise]), np.array([step])
    jumps, rounding = unsteadiness(*given, rate=RATE, cutoff=CUTOFF, smoothing=SMOOTHING)
    return np.hypot(jumps, rounding)[:, 0]


def in_band(error: Array) -> Array:
    return low_passed(error, rate=RATE, cutoff=CUTOFF)


def test_smooth_unrounded_torque_has_no_interpolation_uncertainty() -> None:
    """A sample changes by at most 2 pi f / RATE of the amplitude beyond a straight line: 1e-4 at 1 Hz."""
    assert unsteady(np.sin(2.0 * np.pi * TIME)).max() < 1e-4


def test_white_noise_is_not_detected_as_a_torque_step() -> None:
    """Of the noise in the band, root of 2 CUTOFF / RATE, not more than three tenths are added, as squares."""
    noise = np.random.default_rng(1).normal(size=TIME.size)
    added = float(np.sqrt(np.mean(unsteady(noise, noise=1.0) ** 2)))
    assert added < 0.3 * np.sqrt(2.0 * CUTOFF / RATE)


def test_a_jump_between_samples_is_as_uncertain_as_its_instant() -> None:
    """The error in the band of jumps at 200 instants within a sample, at its largest."""
    between = np.random.default_rng(2).uniform(0.0, 1.0 / RATE, 200)
    errors = []
    for instant in 10.0 + between:
        sampled = np.where(instant > TIME, 0.0, 1.0)
        fine = np.arange(0.0, 20.0, 0.02 / RATE)
        true = low_passed(np.where(fine < instant, 0.0, 1.0), rate=50.0 * RATE, cutoff=CUTOFF)[::50]
        errors.append((in_band(sampled) - true)[np.abs(TIME - 10.0) < 0.02])
    centred = np.array(errors) - np.mean(errors)  # half a sample late on the average, which is timing
    found = unsteady(np.where(TIME < 10.0, 0.0, 1.0))
    assert found[np.abs(TIME - 10.0) > 0.2].max() < 1e-9  # rounding of a running sum
    # The peak of an impulse in the band is 2 f times its size but for the shape of the filter.
    assert found.max() == pytest.approx(float(centred.std()), rel=0.5)


@pytest.mark.parametrize(("travel", "largest"), [(0.01, 1.2), (0.2, 2.5), (20.0, 4.0)])
def test_rounding_errors_in_the_band_are_predicted(travel: float, largest: float) -> None:
    """Never smaller than they are by more than a fifth, over offsets at random, and not much larger.

    Args:
        travel: of the torque over the recording, in steps.
        largest: ratio of the foreseen to the real rms: the number of steps covered is known to one only.
    """
    real, foreseen = [], []
    for offset in np.random.default_rng(3).uniform(0.0, STEP, 60):
        torque = offset + STEP * travel * np.sin(2.0 * np.pi * 0.1 * TIME)
        rounded = STEP * np.round(torque / STEP)
        real.append(np.mean(in_band(rounded - torque) ** 2))
        foreseen.append(np.mean(unsteady(rounded, noise=STEP / np.sqrt(12.0), step=STEP) ** 2))
    white = STEP**2 / 12.0 * 2.0 * CUTOFF / RATE  # what independent errors leave
    ratio = np.sqrt((np.mean(foreseen) + white) / np.mean(real))
    assert 0.8 < ratio < largest


def test_noise_masks_rounding_steps() -> None:
    assert mean_rounding_error(0.0, STEP) == pytest.approx(STEP / np.sqrt(12.0))
    assert mean_rounding_error(STEP, STEP) < 1e-8 * STEP
    assert mean_rounding_error(0.0, 0.0) == 0.0
    fine = np.linspace(0.0, STEP, 400, endpoint=False)
    noise = 0.3 * STEP * np.random.default_rng(4).normal(size=(20000, 1))
    mean = np.mean(STEP * np.round((fine + noise) / STEP), axis=0) - fine
    # Twenty thousand samples leave a hundred and fortieth of the noise in a mean.
    assert mean_rounding_error(0.3 * STEP, STEP) == pytest.approx(float(np.std(mean)), rel=0.15)


def test_unknown_torque_has_a_finite_uncertainty() -> None:
    torque = np.full(TIME.size, np.nan)
    assert np.isfinite(unsteady(torque, step=STEP)).all()
