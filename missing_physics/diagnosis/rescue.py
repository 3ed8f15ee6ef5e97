"""What runs in closed loop save of what a regression, or curves without a law, refused."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.candidates import candidates, first_look
from missing_physics.diagnosis.closed_loop import (
    CONFIRMED,
    DOWN_TO_NOISE,
    Build,
    evidence_for,
    left_in_runs,
    proves,
    run_of,
    runs_of,
)
from missing_physics.diagnosis.explanation import Explanation, explain
from missing_physics.diagnosis.fitted import present, refit
from missing_physics.diagnosis.naming import Progress, Search, cut_off
from missing_physics.diagnosis.replay import Replay
from missing_physics.diagnosis.run_fit import errors_of, fit_in_runs
from missing_physics.diagnosis.run_rivals import HEARD, RUN, SMALL, richer_laws
from missing_physics.diagnosis.sensor_errors import dear
from missing_physics.diagnosis.structural import searched
from missing_physics.diagnosis.terms import Term
from robot_model import Robot

__all__ = ["Completed", "completed", "plainer", "proved", "rescued"]

Array = NDArray[np.float64]

#: An effect that leaves no more than this part of what differs may be one of several,
NEAR = 0.5
#: of which so many are found by runs alone, one beside the other.
MOST_ADDED = 2
#: One name that leaves no more than this part of what differs is right, whatever else there is: of foreign
#: physics in drawn robots single names left 15 % and more, right names 1.5 %.
ALONE = 0.04
#: Better numbers leave no more than this part of what the others left.
CLEARLY = 0.5
#: Mean square of a channel, in units of its noise, beyond which next to nothing of what differs is much.
LOUD = 10.0
#: Effects that are run beside others, of robots whose runs take long.
RUN_DEAR = 2
#: Numbers that are fitted together, and runs after which nothing else is begun; of such robots.
MOST_NUMBERS, MOST_RUNS = 10, 200
MOST_NUMBERS_DEAR, MOST_DEAR = 6, 60


def proved(replay: Replay | None, start: Explanation, best: Explanation, build: Build) -> bool:
    """Whether, with all that `best` names, every recording comes down to the noise in closed loop.

    Args:
        start: the explanation without any name.
    """
    if replay is None or not best.found:
        return False
    return proves(replay, build(best), run_of(replay, start, build)[1])


def rescued(
    replay: Replay | None, search: Search, refused: Explanation, build: Build, progress: Progress
) -> Explanation | None:
    """What was found or refused along the way, and gives every recording down to the noise in closed loop.

    Or, of what curves without a law refused, the only name, where next to nothing is left with it: numbers of
    the robot file that were tuned leave more than noise beside a right name, which curves notice.

    For data in which the regression names nothing in the end. An effect that is brief, fast, or small beside
    the filter's errors may not stand the regression's tests and yet be the only one with which the robot does
    what was recorded. One effect alone, or the one that leaves least with what it lacks: see `completed`.

    Args:
        search: the regression's, with all that it tried.
        refused: with the names that went in the end, if any.

    Returns:
        The explanation; None where there is none.
    """
    if replay is None:
        return None
    problem, view = search.start.problem, search.start.view
    options = [e for e in (search.best, *reversed(search.stages), refused) if len(e.found) == 1]
    tried = {
        (rung.effect, rung.location)
        for rung in search.ladder
        if not rung.kept and not rung.added_to and rung.evidence > 0
    }
    if tried:
        progress("running what the regression refused in closed loop")
        looks = [c for c in candidates(problem, search.start) if c.term.key in tried]
        best = first_look(problem, view, search.start, looks)[:RUN]
        options += [refit(problem, view, search.start, look.candidate) for look in best]
    options += [refused] if len(refused.found) > 1 else []
    # Numbers of the robot file that are estimated anew may be all that is needed.
    start, before = run_of(replay, search.start, build)
    nearest: _Run | None = None
    spoken_for: Explanation | None = None
    for explanation in options:
        run = _best_numbers(replay, explanation, _keys(explanation), build, before, without=start)
        if run.whole:
            return run.explanation
        nearest = run.nearer(nearest)
        if explanation is refused and len(refused.found) == 1 and run.left is not None and run.left <= ALONE:
            spoken_for = run.explanation
    found = None if nearest is None else completed(replay, nearest.explanation, build, progress)
    return found.explanation if found is not None and found.whole else spoken_for


def plainer(replay: Replay | None, best: Explanation, build: Build) -> Explanation:
    """`best` with the robot file's own numbers, where runs come nearer to the recordings with these.

    A regression moves numbers that its data hardly tell with whatever a name leaves, also where nothing that
    it could name is there.
    """
    if replay is None or not _moved(best):
        return best
    given = explain(best.problem, best.view, _as_given(best), nuisance=False)
    mine, theirs = runs_of(replay, build(best)), runs_of(replay, build(given))
    if theirs is None or (mine is not None and evidence_for(mine, theirs) <= 0):
        return best
    return given


def _moved(best: Explanation) -> bool:
    """Whether numbers of the robot file are estimated anew."""
    return best.nuisance.size > 0 or any(term.nominal and not term.frozen for term in best.terms)


def _as_given(best: Explanation) -> list[Term]:
    """What is named, and the effects of the robot file as they are there."""
    own = {(use.effect, use.at): use.parameters for use in best.problem.robot.effects}
    return [
        replace(t, parameters={**t.parameters, **own[t.key]}, frozen=True)
        if t.nominal and t.key in own
        else t
        for t in best.terms
    ]


@dataclass(frozen=True)
class Completed:
    """What runs make of what was named.

    Attributes:
        explanation: with better numbers, or one more effect.
        whole: whether with it the robot gives every recording down to the noise in closed loop.
    """

    explanation: Explanation
    whole: bool


def completed(replay: Replay | None, best: Explanation, build: Build, progress: Progress) -> Completed | None:
    """What is named with better numbers, or with one or two more effects, where runs need them.

    A regression along the recorded motion may leave out the smaller ones of several effects, and knows
    numbers less well than runs do. Others are added only where nothing is left in closed loop then, in
    recordings, too, to which no number was fitted; a second one to the first that comes nearest to it.

    Returns:
        None where runs with `best` leave next to nothing already, and where nothing is clearly better.
    """
    if replay is None or not best.found:
        return None
    best, before = run_of(replay, best, build)
    if before is None or max(float(e.max()) for e in before) <= HEARD:
        return None
    if (left_in_runs(replay, before) or 0.0) <= SMALL and max(float(e.max()) for e in before) <= LOUD:
        return None
    expensive = dear(replay.robot)
    last = replay.made + (MOST_DEAR if expensive else MOST_RUNS)
    progress("running what was found with better numbers in closed loop")
    own = _best_numbers(replay, best, _keys(best), build, before)
    better = own.left is not None and own.left <= CLEARLY
    if better and own.quiet:
        return Completed(own.explanation, whole=True)
    current = own if better else _Run(best, before, 1.0)
    most = RUN_DEAR if expensive else RUN
    for _ in range(MOST_ADDED if replay.fitted < len(replay.asked) else 0):
        nearest: _Run | None = None
        for trial in chain(_richer(current.explanation), _additions(current.explanation, most)):
            if replay.made >= last:
                break
            (key,) = _keys(trial) - _keys(current.explanation)
            label = f"{key[0].replace('_', ' ')} at {key[1]}"
            progress(f"running {label} with what was found in closed loop")
            run = _best_numbers(replay, trial, {key}, build, current.energies, without=current.explanation)
            if not run.whole and run.left is not None and run.left <= NEAR:
                run = _best_numbers(replay, run.explanation, _keys(trial), build, current.energies)
            if run.whole:
                return Completed(run.explanation, whole=True)
            nearest = run.nearer(nearest)
        if nearest is None:
            break
        current = nearest
    return Completed(own.explanation, whole=False) if better else None


def _richer(best: Explanation) -> Iterator[Explanation]:
    """`best` with a richer law of the same family in the place of one that is named."""
    problem, nuisance = best.problem, best.nuisance.size > 0
    for look in first_look(problem, best.view, best, richer_laws(best, best.found)):
        yield refit(problem, best.view, best, look.candidate, nuisance=nuisance)


def _additions(best: Explanation, most: int) -> Iterator[Explanation]:
    """`best` with each effect that promises something beside it, the best first; all numbers free again.

    No event, which one recording alone tells, and none that takes a costly search.
    """
    problem, nuisance = best.problem, best.nuisance.size > 0
    free = explain(problem, best.view, [term.released for term in best.terms], nuisance=nuisance)
    options = [
        c
        for c in candidates(problem, free, bristles=True, alike=())
        if c.replaces is None and not c.term.effect.is_event and not searched(c.term.effect)
    ]
    for look in first_look(problem, best.view, free, options)[:most]:
        if look.evidence <= 0:
            return
        trial = refit(problem, best.view, free, look.candidate, nuisance=nuisance)
        fresh = next(t for t in trial.terms if t.key == look.candidate.term.key)
        if present(trial, fresh) and not fresh.effect.implausible(fresh.parameters) and not cut_off(fresh):
            yield trial


@dataclass(frozen=True)
class _Run:
    """An explanation, its runs' energies per recording, and what these leave of those before."""

    explanation: Explanation
    energies: Sequence[Array] | None
    left: float | None

    def nearer(self, other: _Run | None) -> _Run | None:
        """The one that leaves less; None where neither is near."""
        if self.left is None or self.left > (NEAR if other is None else other.left or 0.0):
            return other
        return self

    @property
    def quiet(self) -> bool:
        """Whether no channel is clearly beyond its noise."""
        return self.energies is not None and max(float(e.max()) for e in self.energies) <= DOWN_TO_NOISE

    @property
    def whole(self) -> bool:
        """Whether next to nothing is left of what differed, and no more than noise."""
        return self.quiet and self.left is not None and self.left <= CONFIRMED


def _keys(explanation: Explanation) -> set[tuple[str, str]]:
    return {term.key for term in explanation.found}


def _best_numbers(
    replay: Replay,
    explanation: Explanation,
    keys: Collection[tuple[str, str]],
    build: Build,
    before: Sequence[Array] | None,
    *,
    without: Explanation | None = None,
) -> _Run:
    """An explanation, where it needs them with better numbers of some names, and its runs.

    Args:
        keys: of these names.
        before: energies of the runs of which parts are left.
        without: from which errors have to fall for better numbers to be worth while; its own when left out.
    """
    explanation, energies = run_of(replay, plainer(replay, explanation, build), build)
    run = _Run(explanation, energies, left_in_runs(replay, energies, before))
    free = [term.released for term in explanation.found if term.key in keys]
    most = MOST_NUMBERS_DEAR if dear(replay.robot) else MOST_NUMBERS
    numbers = sum(len(term.free) for term in free)
    if run.left is None or run.left > 1.0 or not 0 < numbers <= most:
        return run
    if run.quiet and proves(replay, build(explanation), before):
        return run
    errors = errors_of(replay, build(without or explanation) or replay.robot)
    refined = None if errors is None else _refined(replay, explanation, free, build, errors)
    if refined is None:
        return run
    found = runs_of(replay, build(refined))
    left = left_in_runs(replay, found, before)
    return run if left is None or left >= run.left else _Run(refined, found, left)


def _refined(
    replay: Replay, explanation: Explanation, free: Sequence[Term], build: Build, without: Array
) -> Explanation | None:
    """The explanation with the numbers of the terms `free` as runs tell them, all others estimated anew."""

    def put(terms: Sequence[Term]) -> list[Term]:
        known = {term.key: term for term in terms}
        return [known.get(term.key, term) for term in explanation.terms]

    def with_them(terms: Sequence[Term]) -> Robot | None:
        return build(replace(explanation, terms=tuple(put(terms))))

    most = MOST_DEAR if dear(replay.robot) else MOST_RUNS
    fit = fit_in_runs(replay, free, with_them, without, most_runs=most)
    if fit is None:
        return None
    spread = iter(fit.spread)
    held = [_held(term, [float(next(spread)) for _ in term.free]) for term in fit.terms]
    nuisance = explanation.nuisance.size > 0
    return explain(explanation.problem, explanation.view, put(held), nuisance=nuisance)


def _held(term: Term, spread: Sequence[float]) -> Term:
    """A term whose numbers stay where runs put them, those that they tell."""
    return replace(term, held={n: s for n, s in zip(term.free, spread) if np.isfinite(s)})
