"""Recordings that the robot file's own numbers explain: masses, inertias and friction that are off.

Where a file was tuned, or is a few parts in a hundred off everywhere, no single effect may bring runs down to
the noise, and its own numbers do, once runs have fitted them (`runs/nominal.py`). Named are those without
which
they do not: friction as it is listed there, and masses by the link that is most probably off most
(`run_search/wrong_links.py`). The others are told as numbers of the robot file that are better as fitted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.naming.judge import Weighed
from missing_physics.diagnosis.preparation.setup import InertialBasis
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.run_search.wrong_links import wrong_links
from missing_physics.diagnosis.runs.energies import CONFIRMED, Build, left_in_runs, runs_of
from missing_physics.diagnosis.runs.nominal import Combinations
from missing_physics.diagnosis.runs.numbers import Run, allowed_in, as_given, refined
from missing_physics.diagnosis.terms.term import Term

__all__ = ["OwnNumbers", "by_own_numbers"]

Array = NDArray[np.float64]
#: How sure it is that numbers are off which no regression asked for, and not what they imitate together.
SURE = 0.8
#: Least energy beyond noise, in units of the noise's, of which parts are told.
LEAST = 0.1
#: Runs after which no step of the fit is begun.
MOST_RUNS = 150


@dataclass(frozen=True)
class OwnNumbers:
    """What the file's own numbers explain.

    Attributes:
        explanation: with the numbers that are called wrong as names.
        weighed: these, with other explanations of the same change of masses.
    """

    explanation: Explanation
    weighed: tuple[Weighed, ...]


def by_own_numbers(
    replay: Replay, start: Explanation, own: Sequence[Term], basis: InertialBasis, errors: Array, build: Build
) -> OwnNumbers | None:
    """`start` with the file's own numbers as runs tell them, where these give every recording to the noise.

    Args:
        replay: runs along all recordings.
        start: without any name.
        own: the numbers (`own_numbers`).
        basis: of the inertial combinations among them.
        errors: of the runs of `start`.
        build: the robot of an explanation; None where its numbers are not those of a real one.

    Returns:
        None where the numbers are not enough, or nothing but masses is wrong and no link's can be.
    """
    before = runs_of(replay, build(start)) or ()
    told = refined(replay, start, own, build, errors, most_runs=MOST_RUNS)
    energies = None if told is None else runs_of(replay, build(told))
    if told is None or energies is None:
        return None
    run = Run(told, energies, left_in_runs(replay, energies, before), allowed_in(replay, before))
    if not run.whole:
        return None
    left = {term.key: _left_without(term, run, before, replay, start, build) for term in own}
    named = {key for key, part in left.items() if part > CONFIRMED} or {max(left, key=lambda key: left[key])}
    terms = tuple(replace(t, nominal=False) if t.key in named else t for t in told.terms)
    weighed = tuple(Weighed(t, SURE, ()) for t in terms if not t.nominal)
    if not any(isinstance(t.effect, Combinations) and t.key in named for t in own):
        return OwnNumbers(explain(told.problem, told.view, terms, nuisance=False), weighed)
    assert told.view.told is not None
    wrong = wrong_links(replay.robot, basis, told.view.told, {term.key for term in terms})
    if not wrong:
        return (
            OwnNumbers(explain(told.problem, told.view, terms, nuisance=False), weighed) if weighed else None
        )
    view = replace(told.view, told=wrong[0].rest)
    best = explain(told.problem, view, [*terms, wrong[0].term], nuisance=False)
    first, *others = [(w.term, SURE * w.probability) for w in wrong]
    return OwnNumbers(best, (*weighed, Weighed(*first, tuple(others))))


def _left_without(
    term: Term, run: Run, before: Sequence[Array], replay: Replay, start: Explanation, build: Build
) -> float:
    """Largest part of what differs in a channel that is there with some of the numbers as in the file.

    What is no more than noise is nothing.
    """
    told = run.explanation
    if isinstance(term.effect, Combinations):
        without = explain(told.problem, start.view, told.terms, nuisance=False)
    else:
        given = next(t for t in as_given(told).terms if t.key == term.key)
        terms = [given if t.key == term.key else t for t in told.terms]
        without = explain(told.problem, told.view, terms, nuisance=False)
    energies = runs_of(replay, build(without))
    if energies is None:
        return float("inf")
    parts = [
        np.where(now > allowed, (now - 1.0) / np.maximum(old - 1.0, LEAST), 0.0)
        for now, allowed, old in zip(energies, run.allowed, before)
    ]
    return max(float(part.max()) for part in parts)
