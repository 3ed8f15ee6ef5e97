"""Explanations with the numbers that runs in closed loop tell, and what they leave."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.replay.sensor_errors import dear
from missing_physics.diagnosis.runs.energies import (
    CONFIRMED,
    DOWN_TO_NOISE,
    Build,
    evidence_for,
    left_in_runs,
    proves,
    run_of,
    runs_of,
)
from missing_physics.diagnosis.runs.fit import With, errors_of, fit_in_runs
from missing_physics.diagnosis.runs.nominal import MOST, Combinations, freed, moved_view
from missing_physics.diagnosis.runs.spreads import spread_of
from missing_physics.diagnosis.terms.term import Term
from robot_model import Robot

__all__ = [
    "MOST_DEAR",
    "MOST_RUNS",
    "NEAR",
    "NEARLY",
    "Run",
    "allowed_in",
    "as_given",
    "best_numbers",
    "in_runs",
    "keys_of",
    "loudest",
    "plainer",
    "refined",
    "surest",
    "with_numbers",
]

Array = NDArray[np.float64]

#: An effect that leaves no more than this part of what differs may be one of several.
NEAR = 0.5
#: Numbers that are fitted together, and runs after which nothing else is begun; of robots whose runs take
#: long.
MOST_NUMBERS, MOST_RUNS = 10, 200
MOST_NUMBERS_DEAR, MOST_DEAR = 6, 90
#: Numbers that runs leave near the noise are fitted for so many runs, to be sure of them.
NEARLY, MOST_SURE = 10.0, 20
#: Part of what differs in a held-out recording that numbers may leave which the fitted ones tell less well.
NEXT_TO_NOTHING = 1e-3


def plainer(replay: Replay | None, best: Explanation, build: Build) -> Explanation:
    """`best` with the robot file's own numbers, where runs come nearer to the recordings with these.

    A regression moves numbers that its data hardly tell with whatever a name leaves, also where nothing that
    it could name is there.
    """
    if replay is None or not _moved(best):
        return best
    given = as_given(best)
    mine, theirs = runs_of(replay, build(best)), runs_of(replay, build(given))
    if theirs is None or (mine is not None and evidence_for(mine, theirs) <= 0):
        return best
    return given


def _moved(best: Explanation) -> bool:
    """Whether numbers of the robot file are estimated anew."""
    moved = best.nuisance.size > 0 or best.view.told is not None
    return moved or any(term.nominal and not term.frozen for term in best.terms)


def as_given(best: Explanation) -> Explanation:
    """What is named beside the robot file's own numbers and effects as they are there."""
    own = {(use.effect, use.at): use.parameters for use in best.problem.robot.effects}
    terms = [
        replace(t, parameters={**t.parameters, **own[t.key]}, frozen=True)
        if t.nominal and t.key in own
        else t
        for t in best.terms
    ]
    return explain(best.problem, replace(best.view, told=None), terms, nuisance=False)


def surest(replay: Replay | None, best: Explanation, build: Build) -> Explanation:
    """`best` with the numbers that runs tell, where these leave nothing but the sensors' noise anywhere.

    A regression knows a motion by its noisy derivatives, and moves numbers of the robot file with its names;
    a run knows as much as the sensors tell, and where the file's own numbers do, these are taken for known.
    Where those of a regression leave more than noise, it is enough that these leave no channel beyond it.
    Robots whose runs take long keep the regression's numbers.
    """
    if replay is None or not best.found or dear(replay.robot):
        return best
    given = as_given(best) if _moved(best) else best
    if len(given.found) == 1 and given.found[0].held:
        return best
    # numbers that were fitted one after the other are known no better than all together
    free = [term.released for term in given.found]
    if not 0 < sum(len(in_runs(term).free) for term in free) <= MOST_NUMBERS:
        return best
    errors = errors_of(replay, replay.robot)
    most = loudest(replay, build(given))
    if errors is None or most > NEARLY:
        return best
    better = refined(replay, given, free, build, errors, most_runs=MOST_SURE)
    if better is None or any(set(in_runs(term).free) - set(term.held) for term in better.found):
        return best  # a run hardly moves with what is brief
    robot = build(better)
    left = left_in_runs(replay, runs_of(replay, robot))
    quiet = left is not None and left <= CONFIRMED and loudest(replay, robot) <= DOWN_TO_NOISE < most
    return better if quiet or proves(replay, robot, None) else best


def loudest(replay: Replay, robot: Robot | None) -> float:
    """Largest mean square of a channel in a robot's runs; infinite where it cannot be run."""
    energies = runs_of(replay, robot)
    return float("inf") if energies is None else max(float(e.max()) for e in energies)


@dataclass(frozen=True)
class Run:
    """An explanation, its runs' energies per recording, and what these leave of those before.

    `allowed` are the greatest energies that are called down to the noise (`allowed_in`).
    """

    explanation: Explanation
    energies: Sequence[Array] | None
    left: float | None
    allowed: Sequence[Array]

    def nearer(self, other: Run | None) -> Run | None:
        """The one that leaves less; None where neither is near."""
        if self.left is None or self.left > (NEAR if other is None else other.left or 0.0):
            return other
        return self

    @property
    def quiet(self) -> bool:
        """Whether no channel is clearly beyond its noise."""
        return self.energies is not None and all(
            bool((e <= a).all()) for e, a in zip(self.energies, self.allowed)
        )

    @property
    def whole(self) -> bool:
        """Whether next to nothing is left of what differed, and no more than noise."""
        return self.quiet and self.left is not None and self.left <= CONFIRMED


def allowed_in(replay: Replay, before: Sequence[Array] | None) -> list[Array]:
    """Greatest energies of each recording's channels that are called down to the noise.

    Numbers are known as well as the fitted recordings tell them: of a wall that these touch for a moment, and
    a held-out recording leans on, its place to so many micrometres. There next to nothing of what differed
    may be left. What beams may do otherwise than described is no more than noise (`Replay.doubt`).

    Args:
        before: energies of the runs from which they differ; of the robot as described when left out.
    """
    before = before or runs_of(replay, replay.robot) or ()
    least = [DOWN_TO_NOISE + replay.doubt(which) for which in range(len(replay.asked))]
    return [
        a if k < replay.fitted else np.maximum(a, 1.0 + NEXT_TO_NOTHING * (e - 1.0))
        for k, (a, e) in enumerate(zip(least, before or least))
    ]


def keys_of(explanation: Explanation) -> set[tuple[str, str]]:
    """Effects and places of all names."""
    return {term.key for term in explanation.found}


def best_numbers(
    replay: Replay,
    explanation: Explanation,
    keys: Collection[tuple[str, str]],
    build: Build,
    before: Sequence[Array] | None,
    *,
    without: Explanation | None = None,
) -> Run:
    """An explanation, where it needs them with better numbers of some names, and its runs.

    Args:
        keys: of these names.
        before: energies of the runs of which parts are left.
        without: from which errors have to fall for better numbers to be worth while; its own when left out.
    """
    explanation, energies = run_of(replay, plainer(replay, explanation, build), build)
    allowed = allowed_in(replay, before)
    run = Run(explanation, energies, left_in_runs(replay, energies, before), allowed)
    free = [term.released for term in explanation.found if term.key in keys]
    most = MOST_NUMBERS_DEAR if dear(replay.robot) else MOST_NUMBERS
    numbers = sum(len(in_runs(term).free) for term in free)
    if run.left is None or run.left > 1.0 or not 0 < numbers <= most:
        return run
    guessed = any(_guessed(term) for term in explanation.found if term.key in keys)
    if not guessed and run.quiet and proves(replay, build(explanation), before):
        return run
    errors = errors_of(replay, build(without or explanation) or replay.robot)
    better = None if errors is None else refined(replay, explanation, free, build, errors)
    if better is None:
        return run
    found = runs_of(replay, build(better))
    left = left_in_runs(replay, found, before)
    told = Run(better, found, left, allowed)
    if left is not None and (left < run.left or (guessed and told.whole)):
        return told
    return run


def _guessed(term: Term) -> bool:
    """Whether the deviations of what runs should tell only say that they have not told it yet."""
    return bool(term.held) and all(size == abs(term.parameters[name]) for name, size in term.held.items())


def refined(
    replay: Replay,
    explanation: Explanation,
    free: Sequence[Term],
    build: Build,
    without: Array,
    *,
    most_runs: int | None = None,
) -> Explanation | None:
    """The explanation with the numbers of the terms `free` as runs tell them, all others estimated anew.

    Args:
        without: errors of runs from which these have to fall.
        most_runs: no step is begun after so many; what such robots allow when left out.

    Returns:
        None where it cannot be run.
    """

    most = most_runs or (MOST_DEAR if dear(replay.robot) else MOST_RUNS)
    built = with_numbers(explanation, build)
    fit = fit_in_runs(replay, [in_runs(term) for term in free], built, without, most_runs=most)
    if fit is None:
        return None
    spread, at, held = spread_of(replay, fit, built), 0, []
    combinations = np.zeros((0, 0))
    for term, fitted in zip(free, fit.terms):
        own = slice(at, at + len(fitted.free))
        at = own.stop
        known = dict(zip(fitted.free, map(float, spread[own])))
        held.append(replace(term, parameters=fitted.parameters, held=_told(known)))
        if isinstance(term.effect, Combinations):
            combinations = fit.covariance(spread)[own, own] + np.diag(MOST**2 * ~fit.told[own])
    return freed(explanation, held, combinations)


def with_numbers(explanation: Explanation, build: Build) -> With:
    """The robot of an explanation with other numbers of some of its terms: what is free of them stays so."""

    def built(terms: Sequence[Term]) -> Robot | None:
        known = {term.key: term.parameters for term in terms}
        moved = (replace(t, parameters=known.get(t.key, t.parameters)) for t in explanation.terms)
        view = moved_view(explanation.view, known, np.zeros((0, 0)))
        return build(replace(explanation, terms=tuple(moved), view=view))

    return built


def in_runs(term: Term) -> Term:
    """A term as runs know it: how hidden modes began is no number of theirs, as they begin at rest."""
    return replace(term.released, unseen=(*term.unseen, *(p.name for p in term.beside)))


def _told(spread: Mapping[str, float]) -> dict[str, float]:
    """Standard deviations of the numbers that runs tell: these stay where runs put them."""
    return {name: size for name, size in spread.items() if np.isfinite(size)}
