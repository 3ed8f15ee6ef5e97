"""Numbers of a term by runs in closed loop: Gauss-Newton steps on errors in units of the sensors' noise.

A regression along an estimated motion knows a number as well as it knows the motion; a run knows it as well
as the sensors tell.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.replay import Replay
from missing_physics.diagnosis.statistics import BlockedRegression
from missing_physics.diagnosis.terms import Term
from robot_model import Robot

__all__ = ["RunFit", "errors_of", "fit_in_runs"]

Array = NDArray[np.float64]
#: The robot with a term; None where there is no such robot.
With = Callable[[Term], Robot | None]

#: Step of a difference by a number, as a part of its value or typical size: runs err by a tenth of the noise.
STEP = 0.2
#: It is changed where runs move by more than `MOST_DONE` times the noise (rms), to about `DONE`, as they are
#: linear for so long; and, once, where they move by less than `UNTOLD`. A number by which they still do not
#: move so much is not told.
DONE, MOST_DONE, UNTOLD, LARGER, CHANGES = 2.0, 10.0, 0.1, 10.0, 3
#: Gauss-Newton steps, and halvings of one that does not bring a run nearer.
MOST_STEPS, HALVINGS = 5, 2
#: Blocks of time of a recording.
BLOCKS = 10
#: A step that takes less than this of the errors' energy is the last.
CONVERGED = 0.5
#: Part of what is beyond noise that the first step has to promise, and to take, for another one to be made.
WORTH_GOING_ON = 0.3


@dataclass(frozen=True)
class RunFit:
    """A term and its runs.

    Attributes:
        term: with its numbers.
        errors: of all channels of the fitted recordings, one after another, shape (R,).
        columns: their derivatives by the numbers, shape (R, K); zero where runs do not tell a number.
        blocks: block of time of each, shape (R,).
        steps: with which derivatives were taken.
    """

    term: Term
    errors: Array
    columns: Array
    blocks: NDArray[np.int_]
    steps: tuple[float, ...]

    @property
    def energy(self) -> float:
        """Sum of squared errors, in units of the noise."""
        return float(self.errors @ self.errors)

    @property
    def told(self) -> NDArray[np.bool_]:
        """Which numbers runs tell, shape (K,)."""
        return np.asarray(self.columns.any(axis=0))

    @property
    def spread(self) -> Array:
        """Standard deviations of the numbers, shape (K,): of white noise, or over blocks of time if greater.

        What an integrator errs by, a tenth of the noise at most, is no white noise, and what a model errs by
        shows in all channels at once.
        """
        found = np.full(self.told.size, np.inf)
        if not self.told.any():
            return found
        order = np.argsort(self.blocks, kind="stable")
        columns = self.columns[order][:, self.told]
        white = np.diagonal(np.linalg.pinv(columns.T @ columns))
        target = self.errors[order] + columns @ self.term.values[self.told]
        regression = BlockedRegression.of(columns, target, self.blocks[order], prior=np.zeros(white.size))
        found[self.told] = np.sqrt(np.maximum(white, np.diagonal(regression.covariance())))
        return found

    @property
    def step(self) -> Array:
        """Change of the numbers that takes most of the errors, to first order."""
        return np.asarray(-np.linalg.lstsq(self.columns, self.errors, rcond=1e-8)[0])


def fit_in_runs(replay: Replay, start: Term, with_it: With, without: Array) -> RunFit | None:
    """The numbers of a term with which runs come closest to the fitted recordings.

    Args:
        replay: runs along all recordings.
        start: the term, with the numbers from which steps go.
        with_it: the robot with a term.
        without: errors of runs of the robot without the term.

    Returns:
        None where it cannot be run. Where it brings runs hardly nearer it is left where it is.
    """
    current = _linear(replay, start, with_it)
    if current is None:
        return None
    noise = float(without.size)
    most = noise + (1.0 - WORTH_GOING_ON) * (float(without @ without) - noise)
    promised = current.errors + current.columns @ current.step
    if min(current.energy, float(promised @ promised)) > most:
        return current
    for _ in range(MOST_STEPS):
        best = _nearer(replay, current, with_it)
        gained, current = current.energy - best.energy, best
        if gained < CONVERGED or current.energy > most:
            break
        current = _linear(replay, current.term, with_it, current) or current
    return current


def _nearer(replay: Replay, current: RunFit, with_it: With) -> RunFit:
    """A step of which runs come nearer; `current` where there is none."""
    for halving in range(HALVINGS + 1):
        moved = current.term.at_values(current.term.values + current.step / 2**halving)
        errors = errors_of(replay, with_it(moved))
        if errors is not None and float(errors @ errors) < current.energy:
            return replace(current, term=moved, errors=errors)
    return current


def _linear(replay: Replay, term: Term, with_it: With, before: RunFit | None = None) -> RunFit | None:
    """Errors of a term's runs and their derivatives by its numbers; after `before`, with its steps."""
    errors = errors_of(replay, with_it(term)) if before is None else before.errors
    if errors is None:
        return None
    columns, steps = [], []
    for k, parameter in enumerate(term.estimated):
        usual = STEP * max(abs(term.values[k]), abs(parameter.typical))
        first = usual if before is None else before.steps[k]
        column, step = _derivative(replay, term, with_it, errors, k, first)
        columns.append(column)
        steps.append(step)
    return RunFit(term, errors, np.stack(columns, axis=1), _blocks(replay), tuple(steps))


def _derivative(
    replay: Replay, term: Term, with_it: With, errors: Array, which: int, step: float
) -> tuple[Array, float]:
    """Of the errors by one number, and a step that is small enough for it; zero where none tells it."""
    for change in range(CHANGES + 1):
        there, moved = _stepped(replay, term, with_it, which, step)
        if moved is None:
            break
        done = float(np.sqrt(np.mean((moved - errors) ** 2)))
        if UNTOLD <= done <= MOST_DONE:
            return (moved - errors) / (there.values[which] - term.values[which]), step
        if done < UNTOLD and change > 0:
            break
        step *= LARGER if done < UNTOLD else DONE / done
    return np.zeros_like(errors), step


def _stepped(replay: Replay, term: Term, with_it: With, which: int, step: float) -> tuple[Term, Array | None]:
    """The term with one number moved, first to the side where its bounds leave more way, and its errors."""
    ends = []
    for sign in (1.0, -1.0):
        values = term.values.copy()
        values[which] += sign * step
        ends.append(term.at_values(values))
    ends.sort(key=lambda end: -abs(end.values[which] - term.values[which]))
    for end in ends:
        if end.values[which] == term.values[which]:
            continue
        moved = errors_of(replay, with_it(end), keep=False)
        if moved is not None:
            return end, moved
    return term, None


def errors_of(replay: Replay, robot: Robot | None, *, keep: bool = True) -> Array | None:
    """Of all channels of the fitted recordings one after another; None where they cannot be run.

    Args:
        replay: runs along all recordings.
        robot: None gives None.
        keep: whether the same will be asked again.
    """
    if robot is None:
        return None
    parts = []
    for which in range(replay.fitted):
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
