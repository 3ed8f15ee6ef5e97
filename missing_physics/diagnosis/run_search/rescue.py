"""What runs in closed loop save of what a regression, or curves without a law, refused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain

from missing_physics.diagnosis.candidates.effects import candidates, first_look
from missing_physics.diagnosis.candidates.fitted import present, refit
from missing_physics.diagnosis.candidates.structural import searched
from missing_physics.diagnosis.candidates.walls import tip_of
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.naming.search import Progress, Search, cut_off, incredible
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.replay.sensor_errors import dear
from missing_physics.diagnosis.runs.doubt import spreads_of
from missing_physics.diagnosis.runs.energies import Build, left_in_runs, proves, run_of
from missing_physics.diagnosis.runs.numbers import (
    MOST_DEAR,
    MOST_RUNS,
    NEAR,
    Run,
    allowed_in,
    best_numbers,
    keys_of,
)
from missing_physics.diagnosis.runs.rivals import HEARD, RUN, SMALL, richer_laws
from missing_physics.diagnosis.terms.point_masses import nearest_point
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.catalogue import get_effect

__all__ = ["Completed", "completed", "proved", "rescued"]

#: Of several effects so many are found by runs alone, one beside the other.
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
    nearest: Run | None = None
    spoken_for: Explanation | None = None
    for explanation in options:
        run = best_numbers(replay, explanation, keys_of(explanation), build, before, without=start)
        if run.whole:
            return run.explanation
        nearest = run.nearer(nearest)
        if explanation is refused and len(refused.found) == 1 and run.left is not None and run.left <= ALONE:
            spoken_for = run.explanation
    found = None if nearest is None else completed(replay, nearest.explanation, build, progress)
    return found.explanation if found is not None and found.whole else spoken_for


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
    own = best_numbers(replay, best, keys_of(best), build, before)
    better = own.left is not None and own.left <= CLEARLY
    if better and own.quiet:
        return Completed(own.explanation, whole=True)
    current = own if better else Run(best, before, 1.0, allowed_in(replay, before))
    most = RUN_DEAR if expensive else RUN
    for _ in range(MOST_ADDED if replay.fitted < len(replay.asked) else 0):
        nearest: Run | None = None
        told = current.explanation
        for trial in chain(_as_points(told), _richer(told), _additions(told, most)):
            if replay.made >= last:
                break
            (key,) = keys_of(trial) - keys_of(current.explanation)
            label = f"{key[0].replace('_', ' ')} at {key[1]}"
            progress(f"running {label} with what was found in closed loop")
            run = best_numbers(replay, trial, {key}, build, current.energies, without=current.explanation)
            if not run.whole and run.left is not None and run.left <= NEAR:
                run = best_numbers(replay, run.explanation, keys_of(trial), build, current.energies)
            if run.whole:
                return Completed(run.explanation, whole=True)
            nearest = run.nearer(nearest)
        if nearest is None:
            break
        current = nearest
    return Completed(own.explanation, whole=False) if better else None


def _as_points(best: Explanation) -> Iterator[Explanation]:
    """`best` with a point of mass in the place of wrong mass properties: four numbers instead of ten."""
    point, nuisance = get_effect("payload"), best.nuisance.size > 0
    keys = {term.key for term in best.terms}
    for term in best.found:
        if term.effect.id != "inertia" or (point.id, term.at) in keys:
            continue
        start = Term(point, term.at, {"mass": 0.0, **dict(zip("xyz", tip_of(best.problem.robot, term.at)))})
        near = nearest_point(term, spreads_of(best.intervals(term)), start)
        held = replace(near, held={name: abs(near.parameters[name]) for name in near.free})
        yield explain(best.problem, best.view, [*best.terms_without(term), held], nuisance=nuisance)


def _richer(best: Explanation) -> Iterator[Explanation]:
    """`best` with a richer law of the same family in the place of one that is named.

    With a regression's numbers, and with those from which these were fitted: a motion that is hardly ever
    slow, or compared below a low cut-off, may leave a regression far off.
    """
    problem, nuisance = best.problem, best.nuisance.size > 0
    for look in first_look(problem, best.view, best, richer_laws(best, best.found)):
        trial = refit(problem, best.view, best, look.candidate, nuisance=nuisance)
        fresh = next(t for t in trial.terms if t.key == look.candidate.term.key)
        others, ordered = trial.terms_without(fresh), _in_order(fresh)
        if ordered is not fresh:
            trial = explain(problem, best.view, [*others, ordered], nuisance=nuisance)
        yield trial
        start = _all_free(look.candidate.term, look.candidate.term.parameters)
        yield explain(problem, best.view, [*others, start], nuisance=nuisance)


def _in_order(term: Term) -> Term:
    """A term that can be run, all its numbers free.

    A number that noise made smaller than it can be, as friction at rest below that of sliding, is in its
    usual proportion to the one that it exceeds.
    """
    values = dict(term.parameters)
    for greater, smaller in term.effect.ordered:
        if values[greater] <= values[smaller]:
            usual = term.effect.parameter(greater).typical / term.effect.parameter(smaller).typical
            values[greater] = usual * values[smaller]
    return term if values == term.parameters else _all_free(term, values)


def _all_free(term: Term, values: Mapping[str, float]) -> Term:
    """The term with these numbers, as a regression would not have them: runs are to tell them."""
    whole = replace(term, parameters=dict(values), unseen=())
    return replace(whole, held={name: abs(values[name]) for name in whole.free})


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
        if (
            present(trial, fresh)
            and not fresh.effect.implausible(fresh.parameters)
            and not cut_off(fresh)
            and not incredible(fresh, problem)
        ):
            yield trial
