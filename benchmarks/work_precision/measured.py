"""Interleaved trials and their results: curves of work over error, times at equal error."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.native import Setting
from benchmarks.work_precision.callbacks import outside_share
from benchmarks.work_precision.manoeuvres import Case
from benchmarks.work_precision.rivals import EXUDYN, OWN, Trial, exudyn_trial, trials
from benchmarks.work_precision.truth import Truth

__all__ = ["ROUNDS", "Found", "Point", "fastest", "front", "measure", "share_at", "time_at"]

Array = NDArray[np.float64]

#: Rounds over all trials of a case; medians are reported. Trials longer than `LONG` [s] run once.
ROUNDS, LONG = 5, 2.0
#: Runs in a row whose mean is one measurement, where a run is shorter than this [s].
SHORT, REPEATS = 2e-3, 5
#: Steps of the two runs from which Exudyn's own limit is extrapolated.
LIMIT_STEPS = (10_000, 20_000)


@dataclass(frozen=True)
class Point:
    """One trial, measured.

    Attributes:
        family, method, setting: of the trial.
        seconds: median processor time of a run.
        error: against the limit of the engine's own equations, relative; see `Found`.
        prepared: preparation time [s].
        outside: fraction of the time outside of Exudyn's own code; see `callbacks`. None if not measured.
    """

    family: str
    method: str
    setting: str
    seconds: float
    error: float
    prepared: float
    outside: float | None = None


@dataclass(frozen=True)
class Found:
    """A case, measured.

    Attributes:
        case: the motion.
        points: of all successful trials.
        apart: distance of Exudyn's limit from the reference model's, by group of quantities.
        own_limit: Exudyn's errors are measured against its own limit, because the limits differ.
        broken: failed trials.
    """

    case: Case
    points: Sequence[Point]
    apart: Mapping[str, float]
    own_limit: bool
    broken: Sequence[str]


def measure(case: Case, *, rounds: int = ROUNDS) -> Found:
    """All trials of a case, round by round, so that a busy moment affects all of them."""
    print(f"{case.name}: the converged solution", file=sys.stderr, flush=True)
    truth = Truth(case)
    limit, apart = _limit(case, truth)
    every = trials(case, truth)
    times: list[list[float]] = [[] for _ in every]
    errors = [np.inf] * len(every)
    for number in range(rounds + 1):  # the first warms up, and gives the errors
        print(f"{case.name}: round {number} of {rounds}", file=sys.stderr, flush=True)
        for k, trial in enumerate(every):
            if number and (not np.isfinite(times[k][0]) or times[k][0] > LONG):
                continue
            times[k].append(_once(trial, times[k]))
            if not number and np.isfinite(times[k][0]):
                right = limit if trial.family in EXUDYN else None
                errors[k] = truth.error(trial.course(), right)
    kept = [k for k, error in enumerate(errors) if np.isfinite(error) and np.isfinite(times[k][0])]
    points = []
    for k in kept:
        trial, seconds = every[k], float(np.median(times[k][1:] or times[k]))
        point = Point(trial.family, trial.method, trial.setting, seconds, errors[k], trial.prepared)
        points.append(replace(point, outside=outside_share(trial, seconds)))
    broken = [f"{t.family}, {t.method}, {t.setting}" for t, e in zip(every, errors) if not np.isfinite(e)]
    return Found(case, points, apart, limit is not None, broken)


def _once(trial: Trial, before: Sequence[float]) -> float:
    if before and before[0] < SHORT and trial.family == OWN:
        return float(np.mean([trial.timed() for _ in range(REPEATS)]))
    return trial.timed()


def _limit(case: Case, truth: Truth) -> tuple[Array | None, Mapping[str, float]]:
    """Exudyn's limit at the case's instants if it is needed, and its distance from ours."""
    if not case.flexible and not case.stiff:
        finest = exudyn_trial(case, Setting("RK67", steps=LIMIT_STEPS[0]))
        finest.timed()
        return None, truth.errors(finest.course())
    values = []
    for steps in LIMIT_STEPS:
        run = exudyn_trial(case, Setting("trapezoidal, index 2", steps=steps))
        run.timed()
        course = run.course()
        values.append(course.values)
    # Errors of order 2 fall to a quarter with half the step.
    limit = values[1] + (values[1] - values[0]) / 3
    apart = truth.errors(type(course)(course.time, limit))
    return (limit if case.flexible else None), apart


def front(points: Sequence[Point]) -> list[Point]:
    """Pareto front of points in time and error, by increasing time."""
    found: list[Point] = []
    for point in sorted(points, key=lambda p: (p.seconds, p.error)):
        if not found or point.error < found[-1].error:
            found.append(point)
    return found


def time_at(points: Sequence[Point], error: float) -> float | None:
    """Time in which one method reaches an error, by log interpolation; None if it does not."""
    best = front(points)
    good = [p for p in best if p.error <= error]
    if not good:
        return None
    first, place = good[0], best.index(good[0])
    if place == 0:
        return first.seconds
    worse = best[place - 1]
    share = (np.log(worse.error) - np.log(error)) / (np.log(worse.error) - np.log(first.error))
    return float(worse.seconds * (first.seconds / worse.seconds) ** share)


def share_at(points: Sequence[Point], families: Sequence[str], error: float) -> float | None:
    """Fraction outside of Exudyn's own code of the method that reaches an error first, if any."""
    best = fastest(points, families, error)
    if best is None:
        return None
    own = [p for p in points if p.family in families and p.method == best[0] and p.error <= error]
    return min(own, key=lambda p: p.seconds).outside


def fastest(points: Sequence[Point], families: Sequence[str], error: float) -> tuple[str, float] | None:
    """The method that reaches an error first, and its time; None if none does."""
    methods = {(p.family, p.method) for p in points if p.family in families}
    found = []
    for family, method in methods:
        own = [p for p in points if (p.family, p.method) == (family, method)]
        seconds = time_at(own, error)
        if seconds is not None:
            found.append((seconds, method))
    return (min(found)[1], min(found)[0]) if found else None
