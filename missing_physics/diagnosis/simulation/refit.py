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

from missing_physics.diagnosis.free_run.numbers import REFERENCE_DELAY, adjustables, with_numbers
from missing_physics.diagnosis.free_run.problem import FreeRuns, Trial, at_bound, best_fit
from missing_physics.diagnosis.free_run.run import LONGEST_STEP, PositionError
from missing_physics.diagnosis.free_run.step import ClosedLoop
from missing_physics.diagnosis.simulation.fit import effect_numbers
from missing_physics.diagnosis.statistics.correlated_errors import paired_block_p_value
from missing_physics.results.result import Estimate
from robot_model import InputError, Robot

__all__ = ["Refit", "refit"]

#: Chance of keeping a refit that held-out data do not support.
ACCEPTED_BY_CHANCE = 0.05


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
        free: names of the numbers to refine, see `free_run/numbers.py`; the effects' own when None.
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
    fitted = FreeRuns(robot, training, loop, longest_step)
    scored = FreeRuns(robot, held_out, loop, longest_step)
    numbers = {name: adjustables(robot)[name] for name in names}
    informed = fitted.informed(numbers)
    moved = {name: number for name, number in numbers.items() if name in informed}
    values, _ = best_fit(fitted, moved, starts, seed, tell)
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
        at_bound=tuple(name for name in moved if at_bound(moved[name], after[name])),
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
