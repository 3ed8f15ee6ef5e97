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
        columns: their derivatives by the numbers, shape (R, K).
        blocks: block of time of each, shape (R,).
    """

    term: Term
    errors: Array
    columns: Array
    blocks: NDArray[np.int_]

    @property
    def energy(self) -> float:
        """Sum of squared errors, in units of the noise."""
        return float(self.errors @ self.errors)

    @property
    def spread(self) -> Array:
        """Standard deviations of the numbers, shape (K,): of white noise, or over blocks of time if greater.

        What an integrator errs by, a tenth of the noise at most, is no white noise.
        """
        white = np.diagonal(np.linalg.pinv(self.columns.T @ self.columns))
        target = self.errors + self.columns @ self.term.values
        regression = BlockedRegression.of(self.columns, target, self.blocks, prior=np.zeros(white.size))
        return np.asarray(np.sqrt(np.maximum(white, np.diagonal(regression.covariance()))))

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
        current = _linear(replay, current.term, with_it, current.errors) or current
    return current


def _nearer(replay: Replay, current: RunFit, with_it: With) -> RunFit:
    """A step of which runs come nearer; `current` where there is none."""
    for halving in range(HALVINGS + 1):
        moved = current.term.at_values(current.term.values + current.step / 2**halving)
        errors = errors_of(replay, with_it(moved))
        if errors is not None and float(errors @ errors) < current.energy:
            return replace(current, term=moved, errors=errors)
    return current


def _linear(replay: Replay, term: Term, with_it: With, known: Array | None = None) -> RunFit | None:
    """Errors of a term's runs and their derivatives by its numbers."""
    errors = errors_of(replay, with_it(term)) if known is None else known
    if errors is None:
        return None
    columns = []
    for k, parameter in enumerate(term.estimated):
        there = _stepped(term, k, STEP * max(abs(term.values[k]), abs(parameter.typical)))
        moved = errors_of(replay, with_it(there))
        if moved is None:
            return None
        columns.append((moved - errors) / (there.values[k] - term.values[k]))
    return RunFit(term, errors, np.stack(columns, axis=1), _blocks(replay))


def _stepped(term: Term, which: int, step: float) -> Term:
    """The term with one number moved, to the side where its bounds leave more way."""
    ends = []
    for sign in (1.0, -1.0):
        values = term.values.copy()
        values[which] += sign * step
        ends.append(term.at_values(values))
    return max(ends, key=lambda end: abs(end.values[which] - term.values[which]))


def errors_of(replay: Replay, robot: Robot | None) -> Array | None:
    """Of all channels of the fitted recordings one after another; None where they cannot be run."""
    if robot is None:
        return None
    parts = []
    for which in range(replay.fitted):
        found = replay.errors(robot, which)
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
