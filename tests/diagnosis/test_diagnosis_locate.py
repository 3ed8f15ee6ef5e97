"""Where, when and on what: synthetic residuals whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_cases import ARM, Array, bare, problem_of, recorded

from missing_physics.diagnosis.locate import locate, outstanding_windows, spatial_peaks
from missing_physics.diagnosis.problem import Problem
from missing_physics.diagnosis.result import Mismatch

ROBOT = bare("two_link_arm", noise=True)


@pytest.fixture(scope="module")
def problem() -> Problem:
    return problem_of(ROBOT, recorded(ROBOT, ARM, duration=20.0, seed=2))


def located(problem: Problem, joint: int, shape: Array) -> Mismatch:
    """What is said of the noise with `shape` on top at one joint."""
    residual = problem.residual.copy()
    residual[:, joint] += shape
    return next(m for m in locate(problem, ROBOT, residual) if m.location == f"joint{joint + 1}")


def share(item: Mismatch, variable: str) -> float:
    return next((d.share for d in item.depends_on if d.variable.endswith(variable)), 0.0)


def test_noise_is_no_mismatch(problem: Problem) -> None:
    found = locate(problem, ROBOT, problem.residual)
    assert {m.location for m in found} == {"joint1", "joint2"}
    assert all(m.p_value > 0.05 for m in found)
    assert all(not m.depends_on for m in found)
    assert sum(m.share for m in found) == pytest.approx(1.0)


def test_what_the_filter_passes_next_to_a_reversal_is_no_mismatch(problem: Problem) -> None:
    sliding = problem.sliding[:, 0] > 0
    edge = sliding & ~(np.roll(sliding, 1) & np.roll(sliding, -1))
    item = located(problem, 0, 30.0 * problem.noise_floor[0] * edge)
    assert edge.sum() > 10
    assert item.p_value > 0.05
    inner = sliding & ~edge & (np.arange(sliding.size) % 5 == 0)
    assert located(problem, 0, 30.0 * problem.noise_floor[0] * inner).p_value < 1e-9


def test_shares_are_parts_of_the_whitened_energy_largest_first(problem: Problem) -> None:
    residual = np.random.default_rng(0).standard_normal(problem.residual.shape)
    residual *= problem.noise_floor * np.array([2.0, 6.0])
    first, second = locate(problem, ROBOT, residual)
    assert (first.location, first.channel) == ("joint2", "joint2.torque")
    # 36 against 4, by about a thousand samples each
    assert first.share == pytest.approx(0.9, abs=0.02)
    assert second.share == pytest.approx(0.1, abs=0.02)
    assert first.p_value < 1e-9


def test_a_curve_over_velocity_is_seen_as_one(problem: Problem) -> None:
    velocity = problem.velocity[:, 1]
    item = located(problem, 1, 5.0 * np.sign(velocity))
    assert item.depends_on[0].variable == "joint2.velocity"
    # 24 bins hold the sign but for the one at zero; noise is a ten-thousandth of the energy
    assert 0.9 < share(item, "velocity") <= 1.0
    assert item.p_value < 1e-9
    assert "joint2" in item.words
    assert "curve over velocity" in item.words


def test_a_curve_over_position_is_seen_where_it_is(problem: Problem) -> None:
    position = problem.position[:, 0]
    edge = float(np.quantile(position, 0.8))
    item = located(problem, 0, 8.0 * np.maximum(position - edge, 0.0) / np.ptp(position))
    best = item.depends_on[0]
    assert best.variable == "joint1.position"
    assert best.share > 0.8
    bin_width = 0.2 * np.ptp(position)
    assert best.range[0] > edge - bin_width
    assert best.range[1] == pytest.approx(position.max(), abs=1e-9)


def test_what_depends_on_nothing_is_not_said_to(problem: Problem) -> None:
    chance = np.random.default_rng(1)
    item = located(problem, 0, 5.0 * chance.standard_normal(problem.time.size))
    assert not item.depends_on
    assert item.p_value < 1e-9


def test_memory_is_not_taken_for_a_dependence(problem: Problem) -> None:
    """One draw per block: a curve drawn and judged on the same blocks would explain most of it."""
    draws = np.random.default_rng(4).standard_normal(problem.blocks.max() + 1)
    item = located(problem, 1, 5.0 * draws[problem.blocks])
    assert item.p_value < 1e-9
    assert not item.depends_on


def test_a_burst_is_found_in_time(problem: Problem) -> None:
    burst = (problem.time > 6.0) & (problem.time < 6.5)
    item = located(problem, 1, 4.0 * burst)
    start, stop = item.windows[0]
    # a window of 1/240 of 20 s, and one sample of 1/80 s
    assert start == pytest.approx(6.0, abs=0.15)
    assert stop == pytest.approx(6.5, abs=0.15)
    assert "6." in item.words


def test_a_line_in_the_spectrum_is_found(problem: Problem) -> None:
    item = located(problem, 0, 2.0 * np.sin(2 * np.pi * 3.3 * problem.time))
    # Welch's windows of a sixth of 20 s resolve 0.3 Hz
    assert item.frequency_hz[0] == pytest.approx(3.3, abs=0.3)


def test_windows_come_strongest_first_and_not_from_even_noise() -> None:
    chance = np.random.default_rng(2)
    time = np.arange(4800) / 100.0
    noise = chance.standard_normal(4800)
    residual = noise.copy()
    residual[1000:1200] += 5.0
    residual[3000:3100] += 12.0
    first, second = outstanding_windows(time, residual)[:2]
    # half the averaging window of 20 samples on each side
    assert first == pytest.approx((30.0, 31.0), abs=0.15)
    assert second == pytest.approx((10.0, 12.0), abs=0.15)
    assert not outstanding_windows(time, noise)
    assert not outstanding_windows(time, np.zeros(4800))


@pytest.mark.parametrize("flips", [False, True])
@pytest.mark.parametrize("order", [5.0, 40.0])
def test_orders_along_the_position(order: float, flips: bool) -> None:
    time = np.arange(8000) / 200.0
    position = np.sin(2 * np.pi * 0.11 * time) + 0.7 * np.sin(2 * np.pi * 0.05 * time)
    velocity = np.gradient(position, time)
    residual = np.cos(order * position + 0.4) * (np.sign(velocity) if flips else 1.0)
    residual += 0.5 * np.random.default_rng(3).standard_normal(time.size)
    peaks = spatial_peaks(position, velocity, residual, cutoff=20.0, count=2)
    # the travel resolves 2 pi over itself; the peak of a strong line is known far better
    assert min(abs(k - order) for k in peaks) < 0.3 * 2 * np.pi / np.ptp(position)
    strongest = peaks[2 if flips and len(peaks) > 2 else 0]
    assert abs(strongest - order) < np.pi / np.ptp(position)


def test_no_orders_without_travel_or_above_the_filter() -> None:
    time = np.arange(2000) / 200.0
    still = np.zeros(2000)
    assert spatial_peaks(still, still, np.sin(time), cutoff=10.0, count=2) == ()
    position = np.sin(time)
    velocity = np.cos(time)
    fast = spatial_peaks(position, velocity, np.cos(300.0 * position), cutoff=2.0, count=3)
    assert all(order < 2 * np.pi * 2.0 / 0.5 for order in fast)
