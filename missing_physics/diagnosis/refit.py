"""Step 5 of the chain, in simulation: a robot's numbers refined until its free runs follow the recordings.

Regression finds effects from one instant to the next and trusts the nominal motor and sensor. A free run
does not: errors add up, so what it needs is right on average over whole motions. All numbers are refined
together by nonlinear least squares with exact sensitivities, from the regression's values and from others
around them. What comes out counts only if recordings that were not fitted are followed better as well.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import OptimizeResult, least_squares

from missing_physics.diagnosis.result import Estimate
from missing_physics.diagnosis.rollout import LONGEST_STEP, PositionError, Runner
from missing_physics.diagnosis.rollout_numbers import REFERENCE_DELAY, Adjustable, adjustables, with_numbers
from missing_physics.diagnosis.rollout_step import ClosedLoop
from missing_physics.diagnosis.statistics import BlockedRegression, paired_block_p_value
from reference_model.effects.catalogue import used_effects
from robot_model import Controller, InputError, Recording, Robot

__all__ = ["Refit", "Trial", "effect_numbers", "refit"]

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
#: Chance of keeping a refit that held-out data do not support.
ACCEPTED_BY_CHANCE = 0.05


@dataclass(frozen=True)
class Trial:
    """A recording, and the controller that was in force where it is not the robot's own."""

    recording: Recording
    controller: Controller | None = None


@dataclass(frozen=True)
class Refit:
    """What a refit did.

    Attributes:
        robot: with the refined numbers when they were accepted, else as given.
        accepted: whether held-out free runs became better by more than chance.
        why: a sentence.
        parameters: the refined values with 95 % intervals, by name, accepted or not.
        start: the values before.
        without_information: names that free runs hardly depend on; they were kept.
        at_bound: names that ended on a bound of what is credible; their intervals mean nothing.
        reference_delay: what belongs to `robot` but is no part of a robot file [s].
        training, held_out: errors before and after of each recording, by its source and joint.
        p_value: chance of such a gain on held-out data if there is none.
    """

    robot: Robot
    accepted: bool
    why: str
    parameters: Mapping[str, Estimate]
    start: Mapping[str, float]
    without_information: tuple[str, ...]
    at_bound: tuple[str, ...]
    reference_delay: float
    training: Mapping[str, Mapping[str, tuple[PositionError, PositionError]]]
    held_out: Mapping[str, Mapping[str, tuple[PositionError, PositionError]]]
    p_value: float


def effect_numbers(robot: Robot) -> tuple[str, ...]:
    """Names of all estimated parameters of the robot's effects."""
    return tuple(
        f"{used.effect.id}@{used.at}.{p.name}" for used in used_effects(robot) for p in used.effect.estimated
    )


def refit(
    robot: Robot,
    training: Sequence[Trial],
    held_out: Sequence[Trial],
    *,
    free: Sequence[str] | None = None,
    starts: int = 4,
    seed: int = 0,
    longest_step: float = LONGEST_STEP,
    progress: Callable[[str], None] | None = None,
) -> Refit:
    """Refine a robot's numbers so that its free runs follow the recordings.

    Args:
        robot: with the effects that were found, at the values that regression gave; its values are the
            first start.
        training: recordings that are fitted.
        held_out: recordings that decide whether the result is kept. They are looked at once per call; who
            chooses among refits by their held-out errors needs further recordings to score the choice.
        free: names of the numbers to refine, see `rollout_numbers`; the effects' own when None.
        starts: how many starts are tried, the first included.
        seed: of the other starts.
        longest_step: of the integration [s].
        progress: called with a phrase whenever something new is tried.

    Raises:
        InputError: nothing to fit or to hold out, an unknown name, or recordings that cannot be simulated.
    """
    if not training or not held_out:
        raise InputError("a refit in simulation needs recordings to fit and others to hold out.")
    names = tuple(effect_numbers(robot) if free is None else free)
    tell = progress or (lambda phrase: None)
    loop = ClosedLoop(robot, names)
    fitted = _FreeRuns(robot, training, loop, longest_step)
    scored = _FreeRuns(robot, held_out, loop, longest_step)
    numbers = {name: adjustables(robot)[name] for name in names}
    informed = fitted.informed(numbers)
    moved = {name: number for name, number in numbers.items() if name in informed}
    values, _ = _best(fitted, moved, starts, seed, tell)
    after = dict(zip(moved, values))
    gain = scored.block_energies({}) - scored.block_energies(after)
    p_value = paired_block_p_value(gain, np.zeros(gain.size), seed=seed)
    accepted = bool(gain.sum() > 0 and p_value < ACCEPTED_BY_CHANCE)
    kept = {k: v for k, v in after.items() if k != REFERENCE_DELAY} if accepted else {}
    return Refit(
        robot=with_numbers(robot, kept) if kept else robot,
        accepted=accepted,
        why=_why(accepted, float(gain.sum()), p_value),
        parameters=fitted.intervals(moved, after),
        start={name: number.value for name, number in numbers.items()},
        without_information=tuple(name for name in names if name not in informed),
        at_bound=tuple(name for name in moved if _at_bound(moved[name], after[name])),
        reference_delay=after.get(REFERENCE_DELAY, 0.0) if accepted else 0.0,
        training=fitted.compare(after),
        held_out=scored.compare(after),
        p_value=p_value,
    )


def _why(accepted: bool, gain: float, p_value: float) -> str:
    if accepted:
        return f"free runs of held-out recordings became better (p = {p_value:.2g})"
    if gain <= 0:
        return "free runs of held-out recordings did not become better, so the values before are kept"
    return f"the gain on held-out recordings may be chance (p = {p_value:.2g}), so the values before are kept"


def _at_bound(number: Adjustable, value: float) -> bool:
    return min(value - number.lower, number.upper - value) < MARGIN * number.typical


class _FreeRuns:
    """Free runs along several recordings as one least-squares problem in the free numbers.

    Errors are weighted so that every second of every joint counts the same, whatever the sampling rate.
    """

    def __init__(self, robot: Robot, trials: Sequence[Trial], loop: ClosedLoop, longest_step: float) -> None:
        self.loop = loop
        self.runners = [
            Runner(
                robot if trial.controller is None else _with_controller(robot, trial.controller),
                trial.recording,
                longest_step=longest_step,
            )
            for trial in trials
        ]
        self._weights = [_weights(runner) for runner in self.runners]
        self._blocks = _blocks(self.runners)

    def errors(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """Weighted errors, shape (R,), and their derivatives by all of `loop.free`, shape (R, F)."""
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

    def informed(self, numbers: Mapping[str, Adjustable]) -> tuple[str, ...]:
        """Names on which the free runs depend."""
        errors, slopes = self.errors({})
        level = float(np.linalg.norm(errors))
        scales = np.array([number.typical for number in numbers.values()])
        moved = np.linalg.norm(slopes * scales, axis=0)
        return tuple(
            n for n, size in zip(numbers, moved) if np.isfinite(size) and size > NO_INFORMATION * level
        )

    def fit(self, numbers: Mapping[str, Adjustable], start: Array, steps: int) -> OptimizeResult:
        """Least squares from `start`, shape (len(numbers),)."""
        columns = [self.loop.free.index(name) for name in numbers]
        cache: dict[bytes, tuple[Array, Array]] = {}

        def evaluate(x: Array) -> tuple[Array, Array]:
            key = x.tobytes()
            if key not in cache:
                cache.clear()
                errors, slopes = self.errors(dict(zip(numbers, x)))
                if not np.isfinite(errors).all():
                    errors = np.full(errors.size, HOPELESS)
                cache[key] = errors, np.nan_to_num(slopes[:, columns])
            return cache[key]

        return least_squares(
            lambda x: evaluate(x)[0],
            start,
            jac=lambda x: evaluate(x)[1],
            bounds=([n.lower for n in numbers.values()], [n.upper for n in numbers.values()]),
            x_scale=[n.typical for n in numbers.values()],
            ftol=CONVERGED,
            max_nfev=steps,
        )

    def intervals(
        self, numbers: Mapping[str, Adjustable], values: Mapping[str, float]
    ) -> dict[str, Estimate]:
        """95 % intervals that respect errors correlated within blocks; numbers on a bound count as fixed."""
        inside = [name for name in numbers if not _at_bound(numbers[name], values[name])]
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
            name: Estimate(values[name], (values[name] - half[name], values[name] + half[name]), number.unit)
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


def _best(
    runs: _FreeRuns, numbers: Mapping[str, Adjustable], starts: int, seed: int, tell: Callable[[str], None]
) -> tuple[Array, float]:
    """The best end of fits from several starts, and its cost; every start is given a few steps first."""
    if not numbers:
        return np.zeros(0), 0.0
    tries = []
    for number, start in enumerate(_starts(numbers, starts, seed)):
        tell(f"refitting in simulation, start {number + 1} of {starts}")
        tries.append(runs.fit(numbers, start, FIRST_STEPS))
    best = min(tries, key=lambda result: float(result.cost))
    tell("refitting in simulation to the end")
    final = runs.fit(numbers, np.asarray(best.x), MOST_STEPS)
    return np.asarray(final.x), float(final.cost)


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
