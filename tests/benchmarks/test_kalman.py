"""The Kalman filter against which the rows are compared: recursion, dense Gaussian likelihood, recovery."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solve_triangular, toeplitz
from scipy.signal import lfilter

from benchmarks.yardstick.kalman.__main__ import main
from benchmarks.yardstick.kalman.compared import arm_errors
from benchmarks.yardstick.kalman.filter import TIMES, Filter, Levels, levels_of, log_likelihood

Array = NDArray[np.float64]

STEP, INERTIA = 0.01, 0.2
LEVELS = Levels(2e-5, 3e-3, np.array([0.3, 0.1, 0.05]))


def forces(random: np.random.Generator, count: int) -> Array:
    """The unknown forces and the noise of the torque, as the filter supposes them."""
    total = LEVELS.torque / np.sqrt(STEP) * random.standard_normal(count)
    for level, time in zip(LEVELS.forces, TIMES):
        kept = np.exp(-STEP / time)
        white = np.sqrt(1.0 - kept**2) * random.standard_normal(count)
        white[0] /= np.sqrt(1.0 - kept**2)
        total += level * lfilter([1.0], [1.0, -kept], white)
    return total


def recorded(seed: int, count: int) -> Array:
    """Deviation of a position that the noise drives, plus that of the encoder."""
    random = np.random.default_rng(seed)
    speed, position, found = 0.0, 0.0, np.zeros(count)
    for k, force in enumerate(-forces(random, count)[:-1] / INERTIA, start=1):
        position += STEP * speed + 0.5 * STEP**2 * force
        speed += STEP * force
        found[k] = position
    return found + LEVELS.encoder / np.sqrt(STEP) * random.standard_normal(count)


def test_innovations_under_the_truth_are_white_with_the_stated_variance() -> None:
    filter_ = Filter(LEVELS, INERTIA, STEP)
    deviates = []
    for seed in range(8):
        y = recorded(seed, 4000)[:, None]
        deviates.append(filter_.innovations(np.zeros_like(y), y)[400:, 0] / filter_.deviation)
    each = np.array(deviates)
    assert np.mean(each**2) == pytest.approx(1.0, abs=0.03)  # 28,800 samples: 0.8 % of scatter
    lags = [np.mean(each[:, lag:] * each[:, :-lag]) for lag in (1, 2, 5, 20)]
    assert np.abs(lags).max() < 0.03


def test_the_filter_has_the_likelihood_of_a_dense_gaussian() -> None:
    """Second differences of the position are stationary, with a covariance known in closed form."""
    count, settled = 600, 100
    quiet = Levels(LEVELS.encoder, LEVELS.torque, np.array([0.3, 1e-9, 1e-9]))
    louder = Levels(1.4 * LEVELS.encoder, 2.0 * LEVELS.torque, np.array([0.15, 1e-9, 1e-9]))
    for seed in range(4):
        y = recorded(seed, count)
        for levels in (quiet, louder):
            filter_ = Filter(levels, INERTIA, STEP)
            found = filter_.innovations(np.zeros((count, 1)), y[:, None])[:, 0]
            by_filter = log_likelihood(found, filter_.deviation, np.arange(count) >= settled)
            dense = _dense(np.diff(y, 2), levels, settled - 2)
            assert by_filter == pytest.approx(dense, abs=0.02)  # nats, of some thousands


def _dense(values: Array, levels: Levels, first: int) -> float:
    """Log likelihood of second differences from the sample `first` on, given those before it.

    A force of 1 s is constant over a step, to a hundredth.
    """
    lags = np.arange(values.size)
    encoder, torque = levels.encoder**2 / STEP, levels.torque**2 / STEP
    square = (STEP**2 / INERTIA) ** 2
    # A second difference has the mean of two forces: 1/4, 1/2 and 1/4 of the covariance at three lags.
    force = levels.forces[0] ** 2 * np.exp(-STEP * np.abs(lags[:, None] - [-1, 0, 1]) / TIMES[0])
    row = square * force @ [0.25, 0.5, 0.25]
    row[:2] += square * torque * np.array([0.5, 0.25])
    row[:3] += encoder * np.array([6.0, -4.0, 1.0])
    factor = np.linalg.cholesky(toeplitz(row))
    each = solve_triangular(factor, values, lower=True)[first:]
    return float(-0.5 * np.sum(each**2) - np.log(np.diag(factor)[first:]).sum())


def test_a_column_passes_the_filter_as_the_torque_that_it_explains() -> None:
    """A torque that the motion needs exactly, recorded without noise, leaves no innovation."""
    time = STEP * np.arange(3000)
    position, force = 0.01 * np.sin(3.0 * time), -0.09 * INERTIA * np.sin(3.0 * time)
    filter_ = Filter(LEVELS, INERTIA, STEP)
    after = filter_.innovations(force[:, None], position[:, None])[500:, 0]
    before = filter_.innovations(np.zeros((3000, 1)), position[:, None])[500:, 0]
    assert np.abs(after).max() < 2e-3 * np.abs(before).max()  # sampling of the force: (3 rad/s 0.01 s)^2


def test_levels_are_recovered() -> None:
    series = []
    for seed in range(4):
        y = recorded(20 + seed, 6000)
        series.append((np.zeros_like(y), y, np.arange(y.size) > 300, STEP))
    start = Levels(3.0 * LEVELS.encoder, 0.3 * LEVELS.torque, np.full(3, 0.2))
    found = levels_of(series, INERTIA, start)
    assert found.encoder == pytest.approx(LEVELS.encoder, rel=0.05)
    white = np.hypot(found.torque, found.forces[2] * np.sqrt(2.0 * TIMES[2]))  # white below 16 Hz, together
    truth = np.hypot(LEVELS.torque, LEVELS.forces[2] * np.sqrt(2.0 * TIMES[2]))
    assert white == pytest.approx(truth, rel=0.25)
    assert found.forces[0] == pytest.approx(LEVELS.forces[0], rel=0.3)  # 240 s: 15 % of scatter


def test_friction_of_an_arm_by_the_filter_is_within_its_errors() -> None:
    found = [arm_errors((number, 0.0)) for number in range(4)]
    deviates = np.abs(np.concatenate([arm.own / arm.own_deviation for arm in found]))
    assert 0.3 < np.median(deviates) < 1.5  # 0.67, of some twenty
    ratios = np.concatenate([arm.own_deviation / arm.rows_deviation for arm in found])
    assert np.all(ratios < 3.0)  # it uses at least the band's information


def test_a_page_of_two_arms(tmp_path, capsys) -> None:  # type: ignore[no-untyped-def]
    main(["--machines", "--arms", "2", "--out", str(tmp_path / "kalman.md")])
    words = (tmp_path / "kalman.md").read_text()
    assert "all noise is white" in words
    assert "drift with a time constant of 1 s" in words
