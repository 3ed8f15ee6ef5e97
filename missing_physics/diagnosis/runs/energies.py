"""What runs in closed loop leave of recordings: energies, and what these say between explanations."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.replay.reproduction import CHANCE, chance_of
from missing_physics.diagnosis.runs.doubt import says_nothing
from missing_physics.diagnosis.runs.rivals import HEARD, REGRESSION
from robot_model import Robot

__all__ = [
    "CONFIRMED",
    "DOWN_TO_NOISE",
    "INDEPENDENT",
    "INEXACT",
    "Build",
    "beyond",
    "down_to_noise",
    "evidence_for",
    "farther",
    "left_in_runs",
    "proves",
    "run_of",
    "runs_of",
    "told_apart",
]

Array = NDArray[np.float64]
#: The robot of an explanation; None where its numbers are not those of a real one.
Build = Callable[[Explanation], Robot | None]

#: Error energy beyond noise, in units of its own, that numbers which are not exact leave of a right law:
#: where laws are held against each other, and where what is left is held against what was there.
INEXACT, NOTHING = 0.3, 0.05
#: Independent errors of a channel, by which a ratio of energies becomes evidence.
INDEPENDENT = 4.0
#: Runs speak for what leaves no more than this part of what differs.
CONFIRMED = 0.15
#: Largest mean square of a channel, in units of its noise, that is called down to the noise.
DOWN_TO_NOISE = 1.1


def run_of(replay: Replay, explanation: Explanation, build: Build) -> tuple[Explanation, list[Array] | None]:
    """An explanation and its runs: with the robot file's inertial numbers where its own are no real ones."""
    robot = build(explanation)
    if robot is None and explanation.nuisance.size:
        explanation = explain(explanation.problem, explanation.view, explanation.terms, nuisance=False)
        robot = build(explanation)
    return explanation, runs_of(replay, robot)


def runs_of(replay: Replay, robot: Robot | None) -> list[Array] | None:
    """Energies of each recording's channels; None where one cannot be run."""
    if robot is None:
        return None
    found = [replay.energies(robot, which) for which in range(len(replay.asked))]
    return None if any(item is None for item in found) else [item for item in found if item is not None]


def beyond(energies: Array, floor: float) -> Array:
    """Energy beyond noise, in units of the noise's, no less than what inexact numbers leave."""
    return np.asarray(np.maximum(energies - 1.0, 0.0) + floor)


def evidence_for(mine: Sequence[Array], theirs: Sequence[Array]) -> float:
    """For the rival: what the recording that says less for it says, times their number; 0 if they differ.

    A recording that both run down to the noise has no say: one in which nothing was asked that tells them
    apart would else silence all others. Where one of them runs all recordings down to the noise each has its
    own say: the other one may do one of them nearly as well.
    """
    said = [
        0.5 * INDEPENDENT * float(np.log(beyond(a, INEXACT) / beyond(b, INEXACT)).sum())
        for a, b in zip(mine, theirs)
        if max(a.max(), b.max()) > DOWN_TO_NOISE
    ]
    if said and min(max(float(e.max()) for e in runs) for runs in (mine, theirs)) <= DOWN_TO_NOISE:
        return sum(said)
    if said and min(said) > 0:
        return min(said) * len(said)
    return max(said) * len(said) if said and max(said) < 0 else 0.0


def farther(replay: Replay | None, robot: Robot, other: Robot) -> bool:
    """Whether runs of a robot are farther from every recording that tells than those of another one."""
    if replay is None or robot == other:
        return False
    mine, theirs = runs_of(replay, robot), runs_of(replay, other)
    return theirs is not None and (mine is None or evidence_for(mine, theirs) > 0)


def told_apart(replay: Replay, mine: Sequence[Array], theirs: Sequence[Array], more: int) -> float:
    """Most that a regression can say between two explanations that both run down to the noise.

    Runs hold all that was recorded, and their noise is known: where they come as close to all of it, nothing
    else tells the two apart.

    Args:
        mine, theirs: energies of their runs, per recording.
        more: numbers that one of them has more.
    """
    if max(float(e.max()) for e in (*mine, *theirs)) > DOWN_TO_NOISE:
        return REGRESSION
    rows = [len(asked.recording) for asked in replay.asked]
    likelihoods = (0.5 * n * abs(float((a - b).sum())) for n, a, b in zip(rows, mine, theirs))
    return sum(likelihoods) + 0.5 * abs(more) * float(np.log(sum(rows)))


def left_in_runs(
    replay: Replay,
    energies: Sequence[Array] | None,
    before: Sequence[Array] | None = None,
    *,
    lenient: bool = False,
    exact: bool = True,
    moved: Sequence[Array] | None = None,
) -> float | None:
    """Part of what differs in closed loop that runs leave: geometric mean over channels and recordings.

    Args:
        energies: of the runs, as `Replay.energies` gives them, per recording.
        before: of the runs from which they differ; of the robot as described when left out.
        lenient: what links may owe to bending otherwise than described is nothing left (`Replay.doubt`).
        exact: else what numbers that are not exact leave of a right law is nothing left.
        moved: by how much runs move with numbers that are not better known (`runs/doubt.py`); where they
            leave no more than that they say nothing.

    Returns:
        None where nothing differs there, or where one cannot be run.
    """
    before = before or runs_of(replay, replay.robot)
    if energies is None or before is None:
        return None
    logs = []
    for which, (old, new) in enumerate(zip(before, energies)):
        doubt = replay.doubt(which) if lenient else np.zeros(len(old))
        heard = np.maximum(old, new) > HEARD + doubt
        if moved is not None:  # channels down to the noise speak for the names all the same
            heard &= (new <= HEARD) | ~says_nothing(new, moved[which])
        allowed = doubt + (0.0 if exact else INEXACT)
        logs += list(np.log(beyond(new - allowed, NOTHING) / beyond(old - doubt, NOTHING))[heard])
    return float(np.exp(np.mean(logs))) if logs else None


def down_to_noise(replay: Replay, robot: Robot) -> bool:
    """Whether a robot's runs leave the sensors' noise of all recordings, in every octave of every channel."""
    errors: list[Array] = []
    for which in range(len(replay.asked)):
        found = replay.errors(robot, which)
        if found is None or max(float(np.mean(e**2)) for e in found.values()) > DOWN_TO_NOISE:
            return False
        errors += found.values()
    return chance_of(errors) >= CHANCE


def proves(replay: Replay, robot: Robot | None, before: Sequence[Array] | None) -> bool:
    """Whether a robot brings every recording down to the noise in closed loop, and another one does not.

    Along recordings in which nothing differs, runs prove nothing.

    Args:
        robot: None where there is no such robot.
        before: energies of the other one, per recording; of the robot as described when left out.
    """
    if robot is None:
        return False
    left = left_in_runs(replay, runs_of(replay, robot), before)
    return left is not None and left <= CONFIRMED and down_to_noise(replay, robot)
