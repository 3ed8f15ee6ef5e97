"""What runs in closed loop save of what a regression, or curves without a law, refused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.candidates import candidates, first_look
from missing_physics.diagnosis.closed_loop import (
    CONFIRMED,
    DOWN_TO_NOISE,
    Build,
    left_in_runs,
    proves,
    run_of,
    runs_of,
)
from missing_physics.diagnosis.explanation import Explanation, explain
from missing_physics.diagnosis.fitted import refit
from missing_physics.diagnosis.naming import Progress, Search
from missing_physics.diagnosis.replay import Replay
from missing_physics.diagnosis.run_fit import errors_of, fit_in_runs
from missing_physics.diagnosis.run_rivals import RUN, SMALL
from missing_physics.diagnosis.sensor_errors import dear
from missing_physics.diagnosis.structural import searched
from missing_physics.diagnosis.terms import Term
from robot_model import Robot

__all__ = ["completed", "proved", "rescued"]

Array = NDArray[np.float64]

#: An effect that leaves no more than this part of what differs may be one of two.
NEAR = 0.5
#: Effects that are run beside others, of robots whose runs take long.
RUN_DEAR = 2


def proved(replay: Replay | None, start: Explanation, best: Explanation, build: Build) -> bool:
    """Whether, with all that `best` names, every recording comes down to the noise in closed loop.

    Args:
        start: the explanation without any name.
    """
    if replay is None or not best.found:
        return False
    return proves(replay, build(best), run_of(replay, start, build)[1])


def rescued(replay: Replay | None, search: Search, build: Build, progress: Progress) -> Explanation | None:
    """What was found or refused along the way, and gives every recording down to the noise in closed loop.

    For data in which the regression names nothing in the end. An effect that is brief, fast, or small beside
    the filter's errors may not stand the regression's tests and yet be the only one with which the robot does
    what was recorded. One effect alone, or the one that leaves least with what it lacks: see `completed`.

    Args:
        search: the regression's, with all that it tried.

    Returns:
        The explanation; None where there is none.
    """
    if replay is None:
        return None
    problem, view = search.start.problem, search.start.view
    options = [e for e in (search.best, *reversed(search.stages)) if len(e.found) == 1]
    refused = {
        (rung.effect, rung.location)
        for rung in search.ladder
        if not rung.kept and not rung.added_to and rung.evidence > 0
    }
    if refused:
        progress("running what the regression refused in closed loop")
        looks = [c for c in candidates(problem, search.start) if c.term.key in refused]
        best = first_look(problem, view, search.start, looks)[:RUN]
        options += [refit(problem, view, search.start, look.candidate) for look in best]
    # Numbers of the robot file that are estimated anew may be all that is needed.
    start, before = run_of(replay, search.start, build)
    least, nearest = NEAR, None
    for explanation in options:
        proven, left = _proven(replay, explanation, explanation.found, build, start, before)
        if left is not None and left < least:
            least, nearest = left, proven
        if left is not None and left <= CONFIRMED and _at_noise(replay, proven, build, before):
            return proven
    return None if nearest is None else completed(replay, nearest, build, progress)


def completed(
    replay: Replay | None, best: Explanation, build: Build, progress: Progress
) -> Explanation | None:
    """What is named with better numbers, or with one more effect, where that leaves nothing in closed loop.

    A regression along the recorded motion may leave out the smaller one of two effects, and knows numbers
    less well than runs do.

    Returns:
        The explanation with which the robot gives every recording down to the noise in closed loop; None
        where there is none, or where that of `best` leaves next to nothing already.
    """
    if replay is None or not best.found:
        return None
    best, before = run_of(replay, best, build)
    if before is None or _quiet(before) or (left_in_runs(replay, before) or 0.0) <= SMALL:
        return None
    problem, nuisance = best.problem, best.nuisance.size > 0
    progress("running what was found with better numbers in closed loop")
    refined, left = _proven(replay, best, best.found, build, None, before)
    if _quiet(runs_of(replay, build(refined))):
        return refined
    if left is not None and left < 1.0:
        best = refined
    options = [
        c
        for c in candidates(problem, best, bristles=True, alike=())
        if not c.term.effect.is_event and not searched(c.term.effect)
    ]
    looks = [look for look in first_look(problem, best.view, best, options) if look.evidence > 0]
    for look in looks[: RUN_DEAR if dear(replay.robot) else RUN]:
        progress(f"running {look.candidate.term.label} beside what was found in closed loop")
        trial = refit(problem, best.view, best, look.candidate, nuisance=nuisance)
        added = tuple(t for t in trial.found if t.key == look.candidate.term.key)
        for free in (added, trial.found):
            trial, left = _proven(replay, trial, free, build, best, before)
            if _at_noise(replay, trial, build, before):
                return trial
            if left is None or left > NEAR:
                break
    return None


def _quiet(energies: Sequence[Array] | None) -> bool:
    """Whether no channel is clearly beyond its noise."""
    return energies is not None and max(float(e.max()) for e in energies) <= DOWN_TO_NOISE


def _at_noise(replay: Replay, explanation: Explanation, build: Build, before: Sequence[Array] | None) -> bool:
    return proves(replay, build(explanation), before)


def _proven(
    replay: Replay,
    explanation: Explanation,
    free: Sequence[Term],
    build: Build,
    without: Explanation | None,
    before: Sequence[Array] | None,
) -> tuple[Explanation, float | None]:
    """An explanation, with better numbers of the terms `free` where it needs them, and what its runs leave.

    Args:
        without: from which errors have to fall for better numbers to be worth while; its own when left out.
        before: energies of the runs of which parts are left.
    """
    explanation, energies = run_of(replay, explanation, build)
    left = left_in_runs(replay, energies, before)
    if energies is None or left is None or left > 1.0 or not free:
        return explanation, left
    if _quiet(energies):
        return explanation, left
    errors = errors_of(replay, build(without or explanation) or replay.robot)
    refined = None if errors is None else _refined(replay, explanation, free, build, errors)
    if refined is None:
        return explanation, left
    other = left_in_runs(replay, runs_of(replay, build(refined)), before)
    return (explanation, left) if other is None or other >= left else (refined, other)


def _refined(
    replay: Replay, explanation: Explanation, free: Sequence[Term], build: Build, without: Array
) -> Explanation | None:
    """The explanation with the numbers of the terms `free` as runs tell them, all others estimated anew."""

    def put(terms: Sequence[Term]) -> list[Term]:
        known = {term.key: term for term in terms}
        return [known.get(term.key, term) for term in explanation.terms]

    def with_them(terms: Sequence[Term]) -> Robot | None:
        return build(replace(explanation, terms=tuple(put(terms))))

    fit = fit_in_runs(replay, free, with_them, without)
    if fit is None:
        return None
    told = iter(fit.told)
    held = [_held(term, [next(told) for _ in term.free]) for term in fit.terms]
    nuisance = explanation.nuisance.size > 0
    return explain(explanation.problem, explanation.view, put(held), nuisance=nuisance)


def _held(term: Term, told: Sequence[bool]) -> Term:
    """A term whose numbers stay where runs put them: a regression would move them by its errors."""
    narrowed = {name: (value, value) for name, value, sure in zip(term.free, term.values, told) if sure}
    return replace(term, narrowed={**term.narrowed, **narrowed})
