"""Numbers of terms by runs in closed loop: damped Gauss-Newton steps on errors in units of sensors' noise.

A regression along an estimated motion knows a number as well as it knows the motion; a run knows it as well
as the sensors tell.

Far from the right numbers errors are thousands of times the noise, and numbers that move the robot little
would have to go a long way to take what others leave. They are held back there (Levenberg-Marquardt; Nocedal
and Wright, Numerical Optimization (2006), ch. 10.3), by what is left of the errors. And numbers count by
their logarithms, as products of their powers are what runs tell best: a load's mass times its place squared,
a frequency's stiffness over its mass.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from missing_physics.diagnosis.least_squares.explanation import FEWEST_FREEDOM, TOLD
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.runs.nominal import Combinations
from missing_physics.diagnosis.statistics.correlated_errors import BlockedRegression
from missing_physics.diagnosis.terms.term import Term
from robot_model import Robot

__all__ = [
    "RunFit",
    "With",
    "at_step",
    "errors_of",
    "fit_in_runs",
    "lengths",
    "linearised",
    "promise",
    "way_of",
]

Array = NDArray[np.float64]
#: The robot with some terms; None where there is no such robot.
With = Callable[[Sequence[Term]], Robot | None]

#: Step of a difference by a number, as a part of its value or typical size: runs err by a tenth of the noise;
#: of a cycle's order, as a part of it: over the whole way its phase must not change by much.
STEP, CYCLE_STEP = 0.2, 5e-3
#: It is changed where runs move by more than `MOST_DONE` times the noise (rms), to about `DONE`, as they are
#: linear for so long; and, once, where they move by less than `UNTOLD`. A number by which they still do not
#: move so much is not told.
DONE, MOST_DONE, UNTOLD, LARGER, CHANGES = 2.0, 10.0, 0.1, 10.0, 3
#: Near the end steps are no longer than so many times the last change of the numbers, as far as runs still
#: move by the noise: what is brief is linear for less than the noise of a whole recording.
CHANGE, LEAST_DONE = 3.0, 1.0
#: Differences are central and so much longer where steps find nothing any more: numbers that together hardly
#: move a robot, and each for itself much, are told by runs better than these err.
LONGER = 5.0
#: Steps, and trials of one that does not bring a run nearer.
MOST_STEPS, TRIALS = 12, 4
#: Damping of the first step: energy that a number costs which changes by its size, as a part of what is left
#: beyond noise.
#: After each step that brings runs nearer it is less, and after others more, by this factor.
#: Combinations of inertial numbers cost this part of it: runs are next to linear in them, and those of a file
#: that was tuned have to go far together before runs come any nearer.
DAMPING, CHANGED, COMBINED = 0.1, 10.0, 1e-4
#: Numbers count by their logarithms from this part of their typical size on.
LOGARITHMIC = 0.1
#: Runs after which no step is begun.
MOST_RUNS = 200
#: Blocks of time of a recording.
BLOCKS = 10
#: A step that takes less than this of the errors' energy, or this part of what is beyond noise, is the last;
CONVERGED, SLOW = 0.5, 0.02
#: but where this multiple of the noise's energy is left, and more than that, it is looked at more closely.
CLOSE, NOISE = 2.0, 1.02
#: Part of what is beyond noise that the first step has to promise, and to take, for another one to be made.
WORTH_GOING_ON = 0.3


@dataclass(frozen=True)
class RunFit:
    """Terms and their runs.

    Attributes:
        terms: with their numbers; K of them are free in all.
        errors: of all channels of the fitted recordings, one after another, shape (R,).
        columns: their derivatives by the numbers, shape (R, K); zero where runs do not tell a number.
        blocks: block of time of each, shape (R,).
        steps: with which derivatives were taken.
    """

    terms: tuple[Term, ...]
    errors: Array
    columns: Array
    blocks: NDArray[np.int_]
    steps: tuple[float, ...]

    @property
    def energy(self) -> float:
        """Sum of squared errors, in units of the noise."""
        return float(self.errors @ self.errors)

    @property
    def values(self) -> Array:
        """The free numbers of all terms, shape (K,)."""
        return np.concatenate([term.values for term in self.terms])

    @property
    def told(self) -> NDArray[np.bool_]:
        """Which numbers runs tell, shape (K,)."""
        return np.asarray(self.columns.any(axis=0))

    @property
    def spread(self) -> Array:
        """Standard deviations of the numbers, shape (K,): of white noise, or over blocks of time if greater.

        What an integrator errs by, a tenth of the noise at most, is no white noise, and what a model errs by
        shows in all channels at once. As blocks are few, `TOLD` of these deviations make an interval of 95 %.
        """
        found = np.full(self.told.size, np.inf)
        if not self.told.any():
            return found
        order = np.argsort(self.blocks, kind="stable")
        columns = self.columns[order][:, self.told]
        white = np.diagonal(self._white)
        target = self.errors[order] + columns @ self.values[self.told]
        regression = BlockedRegression.of(columns, target, self.blocks[order], prior=np.zeros(white.size))
        freedom = regression.freedom(np.eye(white.size))
        few_blocks = stats.t.ppf(0.975, np.maximum(freedom, FEWEST_FREEDOM)) / TOLD
        # of what is brief one block holds all that is known
        several = freedom >= FEWEST_FREEDOM
        blocks = np.where(several, np.diagonal(regression.covariance()) * few_blocks**2, 0.0)
        found[self.told] = np.sqrt(np.maximum(white, blocks))
        return found

    @property
    def _white(self) -> Array:
        """Covariance of the numbers that are told, of white noise."""
        size = lengths(self.columns[:, self.told])
        columns = self.columns[:, self.told] / size
        return np.asarray(np.linalg.pinv(columns.T @ columns) / np.outer(size, size))

    def covariance(self, spread: Array) -> Array:
        """Covariance of numbers with these standard deviations, shape (K, K); 0 where runs tell none."""
        found = np.zeros((self.told.size, self.told.size))
        if self.told.any():
            wider = spread[self.told] / np.sqrt(np.maximum(np.diagonal(self._white), 1e-300))
            found[np.ix_(self.told, self.told)] = self._white * np.outer(wider, wider)
        return found

    def change(self, damping: float) -> Array:
        """Change of the numbers that takes most of the errors beside what it costs, shape (K,).

        Args:
            damping: see `DAMPING`; numbers to which an effect is in proportion may go as far as they want.
        """
        estimated = [p for term in self.terms for p in term.estimated]
        typical = np.array([abs(p.typical) for p in estimated])
        costs = [
            COMBINED if isinstance(term.effect, Combinations) else float(not p.linear)
            for term in self.terms
            for p in term.estimated
        ]
        beyond = max(self.energy - self.errors.size, 1.0)
        cost = np.sqrt(np.array(costs) * damping * beyond) / np.maximum(np.abs(self.values), typical)
        size = lengths(self.columns)
        rows = np.vstack([self.columns, np.diag(cost)]) / size
        target = np.concatenate([self.errors, np.zeros(cost.size)])
        step = -np.linalg.lstsq(rows, target, rcond=1e-8)[0] / size
        by_logarithm = np.abs(self.values) >= LOGARITHMIC * typical
        lower = np.concatenate([term.bounds[0] for term in self.terms])
        values = np.where(by_logarithm, self.values, 1.0)
        return np.asarray(np.where(by_logarithm, _grown(values, step, lower), step))

    @property
    def step(self) -> Array:
        """Change of the numbers that takes most of the errors, to first order."""
        size = lengths(self.columns)
        return np.asarray(-np.linalg.lstsq(self.columns / size, self.errors, rcond=1e-8)[0] / size)


def _grown(values: Array, step: Array, lower: Array) -> Array:
    """What numbers change by where their logarithms take a step, shape (K,).

    One that may change its sign goes on in proportion where it goes far.
    """
    relative = step / values
    within = np.clip(relative, np.where(lower < 0, -1.0, -np.inf), 1.0)
    return np.asarray(values * (np.expm1(within) + relative - within))


def lengths(columns: Array) -> Array:
    """Lengths of columns, one of those that are zero: numbers have units of very different sizes."""
    size = np.linalg.norm(columns, axis=0)
    return np.asarray(np.where(size > 0, size, 1.0))


def fit_in_runs(
    replay: Replay, starts: Sequence[Term], with_them: With, without: Array, *, most_runs: int = MOST_RUNS
) -> RunFit | None:
    """The numbers of terms with which runs come closest to the fitted recordings.

    Args:
        replay: runs along all recordings.
        starts: the terms, with the numbers from which steps go.
        with_them: the robot with such terms.
        without: errors of runs of the robot without them.
        most_runs: no step is begun after so many runs.

    Returns:
        None where they cannot be run. Where they bring runs hardly nearer they are left where they are.
    """
    last = replay.made + most_runs
    current = linearised(replay, tuple(starts), with_them)
    if current is None:
        return None
    noise = float(without.size)
    most = noise + (1.0 - WORTH_GOING_ON) * (float(without @ without) - noise)
    promised = current.errors + current.columns @ current.step
    if min(current.energy, float(promised @ promised)) > most:
        return current
    damping, central = DAMPING, False
    for _ in range(MOST_STEPS):
        best, damping = _nearer(replay, current, with_them, damping)
        gained, current = current.energy - best.energy, _closer(current, best)
        if best.energy > most or replay.made >= last:
            break
        if gained < max(CONVERGED, SLOW * (best.energy - noise)):
            if central or not NOISE * noise < best.energy < CLOSE * noise:
                break
            damping, central = DAMPING, True
        current = linearised(replay, current.terms, with_them, current, central=central) or current
    return current


def promise(linear: RunFit, without: Array, beside: Array | None = None) -> float:
    """Part of what differs beyond noise that the best change of some numbers leaves, to first order.

    Args:
        linear: runs, linearised in these numbers.
        without: as in `fit_in_runs`.
        beside: derivatives by other numbers, which change with them.
    """
    if beside is not None:
        linear = replace(linear, columns=np.hstack([linear.columns, beside]))
    left = linear.errors + linear.columns @ linear.step
    return (float(left @ left) - without.size) / max(float(without @ without) - without.size, 1.0)


def _nearer(replay: Replay, current: RunFit, with_them: With, damping: float) -> tuple[RunFit, float]:
    """A step of which runs come nearer, and the next one's damping; `current` where there is none."""
    for _ in range(TRIALS):
        moved = _moved(current.terms, current.change(damping))
        errors = errors_of(replay, with_them(moved))
        if errors is not None and float(errors @ errors) < current.energy:
            return replace(current, terms=moved, errors=errors), damping / CHANGED
        damping *= CHANGED
    return current, damping


def _closer(before: RunFit, after: RunFit) -> RunFit:
    """A fit with shorter steps for derivatives, where its numbers changed by less."""
    done = np.sqrt(np.mean(after.columns**2, axis=0)) * after.steps
    least = np.minimum(LEAST_DONE / np.maximum(done, LEAST_DONE), 1.0) * after.steps
    change = CHANGE * np.abs(after.values - before.values)
    return replace(after, steps=tuple(np.minimum(after.steps, np.maximum(change, least))))


def _moved(terms: Sequence[Term], step: Array) -> tuple[Term, ...]:
    """Terms with other values of their free numbers, inside their bounds."""
    ends = np.cumsum([len(term.free) for term in terms])[:-1]
    return tuple(term.at_values(term.values + part) for term, part in zip(terms, np.split(step, ends)))


def linearised(
    replay: Replay,
    terms: tuple[Term, ...],
    with_them: With,
    before: RunFit | None = None,
    *,
    central: bool = False,
) -> RunFit | None:
    """Errors of terms' runs and their derivatives by the numbers; after `before`, with its steps."""
    errors = errors_of(replay, with_them(terms)) if before is None else before.errors
    if errors is None:
        return None
    columns, steps = [], []
    values = np.concatenate([term.values for term in terms])
    for k, parameter in enumerate(p for term in terms for p in term.estimated):
        size = max(abs(values[k]), abs(parameter.typical))
        usual = CYCLE_STEP * abs(values[k]) if parameter.name == "order" else STEP * size
        first = usual if before is None else before.steps[k]
        column, step = _derivative(replay, terms, with_them, errors, k, first)
        if central and column.any():
            column = _central(replay, terms, with_them, k, LONGER * step, column)
        columns.append(column)
        steps.append(step)
    if not columns:
        return None
    return RunFit(terms, errors, np.stack(columns, axis=1), _blocks(replay), tuple(steps))


def _derivative(
    replay: Replay, terms: tuple[Term, ...], with_them: With, errors: Array, which: int, step: float
) -> tuple[Array, float]:
    """Of the errors by one number, and a step that is small enough for it; zero where none tells it."""
    for change in range(CHANGES + 1):
        way, moved = _stepped(replay, terms, with_them, which, step)
        if moved is None:
            break
        done = float(np.sqrt(np.mean((moved - errors) ** 2)))
        if UNTOLD <= done <= MOST_DONE:
            return (moved - errors) / way, step
        if done < UNTOLD and change > 0:
            break
        step *= LARGER if done < UNTOLD else DONE / done
    return np.zeros_like(errors), step


def _central(
    replay: Replay, terms: tuple[Term, ...], with_them: With, which: int, step: float, otherwise: Array
) -> Array:
    """Central difference; `otherwise` where a number cannot go to both sides."""
    sides = [_to(replay, terms, with_them, which, sign * step) for sign in (1.0, -1.0)]
    (up, above), (down, below) = sides
    if above is None or below is None or up <= 0 or down >= 0:
        return otherwise
    return (above - below) / (up - down)


def _stepped(
    replay: Replay, terms: tuple[Term, ...], with_them: With, which: int, step: float
) -> tuple[float, Array | None]:
    """How far one number went, first to the side where its bounds leave more way, and the errors there."""
    ends = sorted((step, -step), key=lambda by: -abs(way_of(terms, which, by)))
    for by in ends:
        way, moved = _to(replay, terms, with_them, which, by)
        if moved is not None:
            return way, moved
    return 0.0, None


def _to(
    replay: Replay, terms: tuple[Term, ...], with_them: With, which: int, by: float
) -> tuple[float, Array | None]:
    """How far one number went by its bounds, and the errors there; None where it cannot be run."""
    way = way_of(terms, which, by)
    if way == 0.0:
        return way, None
    return way, errors_of(replay, with_them(at_step(terms, which, by)), keep=False)


def way_of(terms: tuple[Term, ...], which: int, by: float) -> float:
    """How far one number can go."""
    here, there = (np.concatenate([t.values for t in some]) for some in (terms, at_step(terms, which, by)))
    return float(there[which] - here[which])


def at_step(terms: tuple[Term, ...], which: int, by: float) -> tuple[Term, ...]:
    step = np.zeros(sum(len(term.free) for term in terms))
    step[which] = by
    return _moved(terms, step)


def errors_of(
    replay: Replay, robot: Robot | None, *, keep: bool = True, recordings: Sequence[int] | None = None
) -> Array | None:
    """Of all channels of recordings one after another; None where they cannot be run.

    Args:
        replay: runs along all recordings.
        robot: None gives None.
        keep: whether the same will be asked again.
        recordings: which ones; the fitted ones when left out.
    """
    if robot is None:
        return None
    parts = []
    for which in range(replay.fitted) if recordings is None else recordings:
        found = replay.errors(robot, which, keep=keep)
        if found is None:
            return None
        parts += [found[name] for name in replay.channels]
    return np.concatenate(parts)


def _blocks(replay: Replay) -> NDArray[np.int_]:
    """Block of time of each error that `errors_of` gives."""
    parts = []
    for which, asked in enumerate(replay.asked[: replay.fitted]):
        count = len(asked.recording)
        parts.append(np.tile(which * BLOCKS + np.arange(count) * BLOCKS // count, len(replay.channels)))
    return np.concatenate(parts)
