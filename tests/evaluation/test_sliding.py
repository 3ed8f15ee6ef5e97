"""Detection of sliding: away from reversals by the width of the filter, independent of units."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from missing_physics.evaluation.sliding import determined, directions, shares, slides

STEP, CUTOFF = 1e-3, 30.0
MEMORY = 0.5 / CUTOFF
TIME = np.arange(0.0, 4.0, STEP)
NONE = np.zeros(1)


def smoothed(velocity: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Velocity and acceleration through the filter of the positions, shape (N, 1) each."""
    smooth = sosfiltfilt(butter(4, CUTOFF, fs=1.0 / STEP, output="sos"), velocity)
    return smooth[:, None], np.gradient(smooth, STEP)[:, None]


def known(velocity: NDArray[np.float64], noise: NDArray[np.float64] = NONE) -> NDArray[np.bool_]:
    return slides(*smoothed(velocity), noise, memory=MEMORY, step=STEP)[:, 0]


def sticking() -> NDArray[np.float64]:
    """A joint that decelerates, rests for a quarter of a second and goes back."""
    return np.where(TIME < 2.0, np.maximum(2.0 - TIME, 0.0), -np.maximum(TIME - 2.25, 0.0))


def test_smoothed_velocity_has_the_right_sign_during_sliding() -> None:
    """Within a thousandth of the bend, slope times memory: the ripples of the filter behind it."""
    true = sticking()
    inside = known(true) & (TIME > 0.5) & (TIME < 3.5)
    wrong = np.abs(smoothed(true)[0][:, 0] - true)
    assert wrong.max() > 0.05 * MEMORY
    assert wrong[inside].max() < 0.02 * MEMORY


def test_only_rest_and_the_filter_transients_around_it_are_excluded() -> None:
    inside = known(sticking())
    left_out = STEP * np.count_nonzero(~inside[(TIME > 1.0) & (TIME < 3.5)])
    assert 0.25 < left_out < 0.25 + 4.0 * MEMORY


def test_smooth_reversal_excludes_fewer_samples_than_a_stop() -> None:
    smooth, bent = np.cos(TIME), np.cos(TIME) * np.where(np.cos(TIME) > 0.0, 1.0, 4.0)
    assert np.count_nonzero(~known(smooth)) < 0.5 * np.count_nonzero(~known(bent))


def test_velocity_noise_is_not_detected_as_a_reversal() -> None:
    """White noise below the filter's end leaves out what three of its deviations do, and a fifth more."""
    noise = 0.01
    white = np.random.default_rng(1).standard_normal(TIME.size)
    shaken = smoothed(white)[0][:, 0]
    velocity = np.cos(TIME) + noise * shaken / shaken.std()
    inside = known(velocity, np.array([noise]))
    assert np.mean(~inside) < 1.2 * np.mean(np.abs(np.cos(TIME)) < 3.0 * noise + MEMORY)


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_sliding_does_not_depend_on_the_unit(unit: float) -> None:
    velocity, acceleration = smoothed(sticking())
    noise = np.array([1e-4])
    one, other = (
        slides(scale * velocity, scale * acceleration, scale * noise, memory=MEMORY, step=STEP)
        for scale in (1.0, unit)
    )
    assert np.array_equal(one, other)


def test_friction_changes_sign_gradually_while_its_direction_is_unknown() -> None:
    velocity = smoothed(sticking())[0]
    inside = known(sticking())[:, None]
    found = directions(velocity, inside)
    assert np.array_equal(found[inside], np.sign(velocity[inside]))
    assert np.all(np.diff(found[:, 0]) <= 0.0)
    never = directions(velocity, np.zeros_like(inside))  # slides for certain
    assert np.array_equal(never, np.sign(velocity))


def test_samples_near_rest_are_weighted_by_the_uncertainty_of_dry_friction() -> None:
    """The error that friction within its level leaves there is then half of the noise at most."""
    noise, dry = np.array([0.1, 0.1, 0.0]), np.array([0.0, 10.0, 0.0])
    rest = determined(noise, dry)
    assert rest == pytest.approx([1.0, 1e-4, 1.0], abs=1e-6)
    levels = np.linspace(0.0, 5.0, 50)
    assert np.all(determined(np.ones(50), levels) * levels <= 0.5 + 1e-12)
    known = np.array([[True, True, True], [False, False, False]])
    assert np.array_equal(shares(known, rest), [np.ones(3), rest])
