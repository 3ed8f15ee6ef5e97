"""Whitening of rows by unknown friction at reversals: what it removes, and what remains."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from missing_physics.evaluation.band import low_passed
from missing_physics.evaluation.nuisance import Nuisance
from missing_physics.evaluation.sliding import cells, determined, shares, slides, undetermined
from missing_physics.evaluation.vibration.whitening import Vibration

Array = NDArray[np.float64]

RATE, SMOOTHING, CUTOFF = 1000.0, 50.0, 10.0  # Hz
MEMORY, STEP = 0.5 / SMOOTHING, 1.0 / RATE
TIME = np.arange(0.0, 8.0, STEP)


def of_joint(columns: Array) -> Nuisance:
    """Nuisance of one joint with these columns, shape (K, V), of standard deviation one."""
    own = columns[:, None, :]
    mask = np.ones(own.shape[:2])
    reversals = Vibration.of(own, mask, np.ones(own.shape[2]))
    return Nuisance(Vibration.of(own[:, :, :0], mask), (reversals,))


def test_whitening_divides_an_unknown_force_by_its_standard_deviation() -> None:
    """Noise of covariance 1 + u u^T: the inverse root divides u by (1 + |u|^2)^1/2 and leaves the rest."""
    u = np.array([3.0, 4.0, 0.0])
    nuisance = of_joint(u[:, None])
    values = np.stack([u, [-4.0, 3.0, 2.0]], axis=1)[:, None, :]
    found = nuisance.removed(values)[:, 0]
    np.testing.assert_allclose(found[:, 0], u / np.sqrt(26.0), rtol=1e-12)
    np.testing.assert_allclose(found[:, 1], values[:, 0, 1], rtol=1e-12)
    assert nuisance.left.sum() == pytest.approx(2.0 + 1.0 / 26.0)


def test_only_the_given_joints_are_whitened_without_links() -> None:
    nuisance = of_joint(np.array([[1.0], [2.0]]))
    joints, found = nuisance.removed_at(np.array([0]), np.ones((2, 1, 1)))
    assert joints.tolist() == [0]
    np.testing.assert_allclose(found, nuisance.removed(np.ones((2, 1, 1))))


def test_slow_friction_is_visible_at_quick_reversals_with_their_cells_removed() -> None:
    """Stribeck's excess at 0.1 rad/s, in units of the noise: most of its information is next to reversals.

    Joint of amplitude 1 rad at 1 Hz, friction 30 times the noise in the band, of which the excess is a third.
    """
    velocity = 2.0 * np.pi * np.cos(2.0 * np.pi * TIME)[:, None]
    acceleration, noise = np.gradient(velocity, STEP, axis=0), np.array([0.02])
    level = 30.0
    excess = level / 3.0 * np.exp(-((velocity / 0.1) ** 2)) * np.sign(velocity)
    plain = [velocity, np.sign(velocity), np.ones_like(velocity)]
    inner = slice(200, -200, 20)

    def information(weight: Array, whiten: Nuisance | None) -> float:
        both = np.concatenate([excess, *plain], axis=1) * weight
        rows = low_passed(both, rate=RATE, cutoff=CUTOFF)[inner]
        rows = rows if whiten is None else whiten.removed(rows[:, None, :])[:, 0]
        left = rows[:, 0] - rows[:, 1:] @ np.linalg.lstsq(rows[:, 1:], rows[:, 0], rcond=None)[0]
        return float(left @ left)

    state = velocity, acceleration, noise
    sliding = slides(*state, memory=MEMORY, step=STEP)
    unknown = undetermined(*state, memory=MEMORY, step=STEP)
    rest, own = cells(unknown[:, 0], unknown[:, 0], ~sliding[:, 0], longest=50, size=10)
    assert not rest.any()
    columns = np.zeros((TIME.size, len(own)))
    for column, cell in enumerate(own):
        columns[cell, column] = level
    reduced = low_passed(columns, rate=RATE, cutoff=CUTOFF)[inner]
    weights = shares(sliding, determined(np.ones(1), np.array([level])))
    without, by_cells = information(weights, None), information(np.ones((1, 1)), of_joint(reduced))
    known = information(np.ones((1, 1)), None)
    assert by_cells > 10.0 * without
    assert by_cells < known


def test_velocity_at_a_kink_is_undetermined_by_the_error_of_the_filter() -> None:
    """The smoothed speed of a joint that reverses at once; the bound is met to a part in fifty."""
    time = np.arange(-1.0, 1.0, 1e-4)
    smooth = low_passed(np.abs(time)[:, None], rate=1e4, cutoff=SMOOTHING)
    error = float(smooth[time.size // 2, 0])
    assert pytest.approx(error, rel=0.02) == 2.0 * 0.104 * MEMORY


def test_long_rest_is_a_stop_and_quick_reversals_are_cut_into_cells() -> None:
    unknown = np.zeros(100, dtype=bool)
    unknown[10:17], unknown[50:80] = True, True
    near = unknown.copy()
    near[8:19], near[45:85] = True, True
    rest, own = cells(unknown, unknown, near, longest=20, size=4)
    assert np.array_equal(np.flatnonzero(rest), np.arange(45, 85))
    assert [(cell.start, cell.stop) for cell in own] == [(10, 14), (14, 17)]
    assert all(first.stop == second.start for first, second in pairwise(own))
