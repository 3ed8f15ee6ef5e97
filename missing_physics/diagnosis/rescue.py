"""What runs in closed loop save of what a regression, or curves without a law, refused."""

from __future__ import annotations

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
)
from missing_physics.diagnosis.explanation import Explanation, explain
from missing_physics.diagnosis.fitted import refit
from missing_physics.diagnosis.naming import Progress, Search
from missing_physics.diagnosis.replay import Replay
from missing_physics.diagnosis.run_fit import errors_of, fit_in_runs
from missing_physics.diagnosis.run_rivals import RUN
from missing_physics.diagnosis.terms import Term
from robot_model import Robot

__all__ = ["proved", "rescued"]

Array = NDArray[np.float64]

#: Numbers keep to so many standard deviations about what runs tell.
WIDE = 3.0


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
    what was recorded. One effect alone: several together imitate much.

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
    without = errors_of(replay, build(start) or replay.robot)
    for explanation in options:
        explanation, energies = run_of(replay, explanation, build)
        left = left_in_runs(replay, energies, before)
        if energies is None or left is None:
            continue
        if left <= CONFIRMED and max(float(e.max()) for e in energies) <= DOWN_TO_NOISE:
            return explanation
        if left < 1.0 and without is not None:
            refined = _refined(replay, explanation, build, without)
            if refined is not None and proves(replay, build(refined), before):
                return refined
    return None


def _refined(replay: Replay, explanation: Explanation, build: Build, without: Array) -> Explanation | None:
    """The explanation with its only name's numbers as runs tell them, all others estimated anew."""
    (name,) = explanation.found

    def with_it(term: Term) -> Robot | None:
        terms = tuple(term if t.key == name.key else t for t in explanation.terms)
        return build(replace(explanation, terms=terms))

    fit = fit_in_runs(replay, name, with_it, without)
    if fit is None:
        return None
    ends = zip(fit.term.free, fit.term.values, fit.spread, *fit.term.bounds)
    narrowed = {
        key: (max(value - WIDE * spread, low), min(value + WIDE * spread, high))
        for key, value, spread, low, high in ends
    }
    term = replace(fit.term, narrowed={**fit.term.narrowed, **narrowed})
    terms = [term if t.key == name.key else t for t in explanation.terms]
    nuisance = explanation.nuisance.size > 0
    return explain(explanation.problem, explanation.view, terms, nuisance=nuisance)
