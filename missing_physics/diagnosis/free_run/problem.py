"""Free runs along several recordings as one least-squares problem in a robot's numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import OptimizeResult, least_squares

from missing_physics.diagnosis.free_run.numbers import Adjustable, pairs_in_order
from missing_physics.diagnosis.free_run.run import LONGEST_STEP, PositionError, Runner
from missing_physics.diagnosis.free_run.step import ClosedLoop
from missing_physics.diagnosis.statistics.correlated_errors import BlockedRegression, effective_samples
from missing_physics.results.result import Estimate
from robot_model import Controller, Recording, Robot

__all__ = ["MARGIN", "FreeRuns", "Trial", "at_bound", "best_fit"]

Array = NDArray[np.float64]

#: Length of the blocks in which errors are counted [s]; errors of one block may depend on each other.
BLOCK = 1.0
#: Starts around the first are spread by this factor both ways (or by this part of a number's scale).
SPREAD = 2.0
#: A start keeps this distance from its bounds, in scales: on a bound, an optimiser stalls.
START_MARGIN = 1e-2
#: A number ends on its bound when it is this close, in scales: the optimiser itself stays inside.
MARGIN = 1e-4
#: A number is without information when changing it by its scale moves the positions by less than this part
#: of their error.
NO_INFORMATION = 1e-3
#: A fit ends when a step changes the sum of squares by less than this part, or after so many steps.
CONVERGED = 1e-6
MOST_STEPS = 60
#: Steps with which every start is tried before the best goes on to the end.
FIRST_STEPS = 12
#: Stands for the error of a run that does not stay finite [rad or m].
HOPELESS = 1e3


@dataclass(frozen=True)
class Trial:
    """A recording, and the controller that was in force where it is not the robot's own."""

    recording: Recording
    controller: Controller | None = None


class FreeRuns:
    """Free runs along several recordings as one least-squares problem in the free numbers.

    Errors are weighted so that every second counts the same, whatever the sampling rate, and every joint in
    units of its scale.

    Args:
        robot: with its numbers as they are.
        trials: recordings and the controllers in force.
        loop: made of `robot`.
        longest_step: of the integration [s].
        scale: error of each joint that counts as one, shape (n,); 1 rad or m when left out.
    """

    def __init__(
        self,
        robot: Robot,
        trials: Sequence[Trial],
        loop: ClosedLoop,
        longest_step: float = LONGEST_STEP,
        *,
        scale: Array | None = None,
    ) -> None:
        self.loop = loop
        self.evaluations = 0
        self.runners = [
            Runner(
                robot if trial.controller is None else _with_controller(robot, trial.controller),
                trial.recording,
                longest_step=longest_step,
            )
            for trial in trials
        ]
        units = np.ones(len(robot.moving_joints)) if scale is None else scale
        self._weights = [_weights(runner) / units for runner in self.runners]
        self._blocks = _blocks(self.runners)

    def errors(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Weighted errors, shape (R,), and their derivatives by all of `loop.free`, shape (R, F)."""
        self.evaluations += 1
        gaps, slopes = [], []
        for runner, weights in zip(self.runners, self._weights):
            said, jacobian = runner.positions(self.loop, values)
            gap = np.where(weights > 0, said - runner.recorded, 0.0) * weights
            gaps.append(gap.ravel())
            slopes.append((jacobian * weights[:, :, None]).reshape(gap.size, -1))
        return np.concatenate(gaps), np.concatenate(slopes)

    def block_energies(self, values: Mapping[str, float]) -> Array:
        """Mean squared position error of each block, shape (G,)."""
        errors, _ = self.errors(values)
        return np.bincount(self._blocks, weights=np.nan_to_num(errors, nan=HOPELESS) ** 2).astype(float)

    def rms(self, values: Mapping[str, float]) -> Array:
        """Root mean square position error of each joint over all recordings [rad or m], shape (n,)."""
        squares, seconds = 0.0, 0.0
        for runner in self.runners:
            said, _ = runner.positions(self.loop, values)
            weights = _weights(runner)
            gap = np.where(weights > 0, said - runner.recorded, 0.0) * weights
            squares = squares + (np.nan_to_num(gap, nan=HOPELESS) ** 2).sum(0)
            seconds = seconds + (weights**2).sum(0)
        return np.asarray(np.sqrt(squares / np.maximum(seconds, 1e-300)))

    def effective(self, values: Mapping[str, float]) -> float:
        """Effective number of samples of the errors, of all joints and recordings together."""
        count, first = 0.0, 0
        errors, _ = self.errors(values)
        for runner in self.runners:
            size = runner.recorded.size
            own = errors[first : first + size].reshape(runner.recorded.shape)
            count += sum(effective_samples(np.nan_to_num(column, nan=HOPELESS)) for column in own.T)
            first += size
        return count

    def informed(self, numbers: Mapping[str, Adjustable]) -> tuple[str, ...]:
        """Names on which the free runs depend."""
        errors, slopes = self.errors({})
        level = float(np.linalg.norm(errors))
        scales = np.array([number.typical for number in numbers.values()])
        moved = np.linalg.norm(slopes * scales, axis=0)
        return tuple(
            n for n, size in zip(numbers, moved) if np.isfinite(size) and size > NO_INFORMATION * level
        )

    def fit(
        self,
        numbers: Mapping[str, Adjustable],
        start: Array,
        steps: int,
        *,
        converged: float = CONVERGED,
    ) -> OptimizeResult:
        """Least squares from `start`, shape (len(numbers),).

        Of two numbers in order (friction at rest, and of sliding) the greater is never below the smaller.
        """
        columns = [self.loop.free.index(name) for name in numbers]
        names = list(numbers)
        pairs = [(names.index(a), names.index(b)) for a, b in pairs_in_order(names)]
        cache: dict[bytes, tuple[Array, Array]] = {}

        def evaluate(x: Array) -> tuple[Array, Array]:
            key = x.tobytes()
            if key not in cache:
                cache.clear()
                errors, slopes = self.errors(dict(zip(numbers, _lifted(x, pairs))))
                if not np.isfinite(errors).all():
                    errors = np.full(errors.size, HOPELESS)
                slopes = np.nan_to_num(slopes[:, columns])
                for greater, smaller in pairs:
                    if x[greater] < x[smaller]:
                        slopes[:, smaller] += slopes[:, greater]
                        slopes[:, greater] = 0.0
                cache[key] = errors, slopes
            return cache[key]

        found = least_squares(
            lambda x: evaluate(x)[0],
            start,
            jac=lambda x: evaluate(x)[1],
            bounds=([n.lower for n in numbers.values()], [n.upper for n in numbers.values()]),
            x_scale=[n.typical for n in numbers.values()],
            ftol=converged,
            max_nfev=steps,
        )
        found.x = _lifted(found.x, pairs)
        return found

    def intervals(
        self, numbers: Mapping[str, Adjustable], values: Mapping[str, float]
    ) -> dict[str, Estimate]:
        """95 % intervals that respect errors correlated within blocks; numbers on a bound count as fixed."""
        inside = [name for name in numbers if not at_bound(numbers[name], values[name])]
        half = dict.fromkeys(numbers, 0.0)
        if inside:
            errors, slopes = self.errors(values)
            columns = slopes[:, [self.loop.free.index(name) for name in inside]]
            target = columns @ np.array([values[name] for name in inside]) - errors
            order = np.argsort(self._blocks, kind="stable")
            regression = BlockedRegression.of(columns[order], target[order], self._blocks[order])
            quantile = float(stats.t.ppf(0.975, max(int(self._blocks.max()), 2)))
            deviations = np.sqrt(np.maximum(np.diagonal(regression.covariance()), 0.0))
            half |= dict(zip(inside, quantile * deviations))
        return {
            name: Estimate(
                values[name],
                (float(values[name] - half[name]), float(values[name] + half[name])),
                number.unit,
            )
            for name, number in numbers.items()
        }

    def compare(
        self, values: Mapping[str, float]
    ) -> dict[str, dict[str, tuple[PositionError, PositionError]]]:
        """Errors before and after, by recording and joint."""
        found = {}
        for number, runner in enumerate(self.runners):
            before, after = (runner.errors(runner.positions(self.loop, v)[0]) for v in ({}, values))
            source = runner.recording.source or f"recording {number + 1}"
            found[source] = {joint: (before[joint], after[joint]) for joint in before}
        return found


def best_fit(
    runs: FreeRuns,
    numbers: Mapping[str, Adjustable],
    starts: int,
    seed: int,
    tell: Callable[[str], None],
    *,
    converged: float = CONVERGED,
) -> tuple[Array, float]:
    """The best end of fits from several starts, and its cost; every start is given a few steps first."""
    if not numbers:
        return np.zeros(0), 0.0
    tries = []
    for number, start in enumerate(_starts(numbers, starts, seed)):
        tell(f"refitting in simulation, start {number + 1} of {starts}")
        tries.append(runs.fit(numbers, start, FIRST_STEPS, converged=converged))
    best = min(tries, key=lambda result: float(result.cost))
    tell("refitting in simulation to the end")
    final = runs.fit(numbers, np.asarray(best.x), MOST_STEPS, converged=converged)
    return np.asarray(final.x), float(final.cost)


def _lifted(values: Array, pairs: Sequence[tuple[int, int]]) -> Array:
    """Values of which the first of each pair is at least the second."""
    lifted = np.array(values, dtype=float)
    for greater, smaller in pairs:
        lifted[greater] = max(lifted[greater], lifted[smaller])
    return lifted


def _starts(numbers: Mapping[str, Adjustable], count: int, seed: int) -> list[Array]:
    chance = np.random.default_rng(seed)
    lower = np.array([n.lower + START_MARGIN * n.typical for n in numbers.values()])
    upper = np.array([n.upper - START_MARGIN * n.typical for n in numbers.values()])
    value = np.array([n.value for n in numbers.values()])
    scale = np.array([n.typical for n in numbers.values()])
    found = [np.clip(value, lower, upper)]
    for _ in range(count - 1):
        factor = SPREAD ** chance.uniform(-1, 1, value.size)
        shift = scale * chance.uniform(-0.5, 0.5, value.size)
        found.append(np.clip(np.where(lower >= 0, value * factor, value + shift), lower, upper))
    return found


def at_bound(number: Adjustable, value: float) -> bool:
    return min(value - number.lower, number.upper - value) < MARGIN * number.typical


def _with_controller(robot: Robot, controller: Controller) -> Robot:
    return robot.model_copy(update={"controller": controller})


def _weights(runner: Runner) -> Array:
    """Square roots of each sample's part of a second, zero where the position is missing, shape (N, n)."""
    seconds = np.gradient(runner.time)
    known = np.isfinite(runner.recorded)
    return np.sqrt(seconds)[:, None] * known


def _blocks(runners: Sequence[Runner]) -> NDArray[np.int_]:
    """Block of each weighted error, shape (R,)."""
    found, first = [], 0
    for runner in runners:
        span = runner.time - runner.time[0]
        count = max(1, round(float(span[-1]) / BLOCK))
        own = np.minimum((span / span[-1] * count).astype(int), count - 1)
        found.append(np.repeat(first + own, runner.recorded.shape[1]))
        first += count
    return np.concatenate(found)
