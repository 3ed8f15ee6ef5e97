"""Names whose size may be nothing, and two names for one law: what is left of them in the end.

Names are chosen by evidence, unseen data and runs, while others come and go beside them. In the end each has
to stand as it is told: with an interval that leaves "absent" out. A spring whose stiffness may be zero is the
torque that is left of it; an offset beside a spring is the spring's own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from scipy.stats import norm

from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.motion.low_pass import SAMPLES_PER_PERIOD
from missing_physics.diagnosis.naming.final_model import FinalModel
from missing_physics.diagnosis.naming.judge import Weighed, weigh
from missing_physics.diagnosis.naming.search import Progress
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.runs.confirmation import EXCHANGE
from missing_physics.diagnosis.runs.energies import Build, evidence_for, runs_of
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.catalogue import catalogue, get_effect

__all__ = ["MAY_BE_NOTHING", "has_size", "sure_of_size"]

#: Share of cases in which a number is beyond one end of its interval.
OUTSIDE = 0.025
#: Why a name went.
MAY_BE_NOTHING = "beside everything else that was found, its size may be zero"


def has_size(model: FinalModel, term: Term) -> bool:
    """Whether the intervals of its sizes, as they are told, leave "absent" out.

    Of all that it cannot do without, or of any where an effect needs none in particular. What the robot file
    has, too, is named for being otherwise, and may well be nothing.
    """
    if term.key in {(use.effect, use.at) for use in model.robot.effects}:
        return True
    intervals, wider = model.intervals(term), _wider(term, model.explanation.problem)
    sizes = {p.name: p.absent for p in term.estimated if p.absent is not None}
    needed = [name for name in term.effect.essential if name in sizes]
    told = {}
    for name, absent in sizes.items():
        low, high = (bound - absent for bound in intervals[name])
        told[name] = abs(low + high) > wider * (high - low)
    return all(told[name] for name in needed) if needed else not told or any(told.values())


def _wider(term: Term, problem: Problem) -> float:
    """By how much an interval of 95 % has to be wider, for what was looked for at many places and times.

    Noise makes something of one of all effects at one of all joints (Bonferroni), and of an event at one of
    all times: of two in each period of the cut-off.
    """
    looks = len(catalogue()) * max(1, len(problem.joints))
    if term.effect.is_event:
        looks *= max(1, 2 * problem.time.size // SAMPLES_PER_PERIOD)
    return float(norm.isf(OUTSIDE / looks) / norm.isf(OUTSIDE))


def sure_of_size(
    best: Explanation,
    weighed: Sequence[Weighed],
    replay: Replay | None,
    build: Build,
    final: Callable[[Explanation], FinalModel],
    *,
    nuisance: bool,
    progress: Progress,
) -> tuple[Explanation, tuple[Weighed, ...], tuple[tuple[Term, str], ...]]:
    """`best` with one name for one law, and without names whose size may be nothing.

    One without which runs are clearly farther from the recordings stays.

    Args:
        replay: runs along all recordings; None where that is not possible.
        build: the robot of an explanation; None where its numbers are not those of a real one.
        final: the final fit of an explanation.
        nuisance: whether the robot's inertial numbers are estimated with it.

    Returns:
        The explanation; its names; and those that went, with the reason.
    """
    nuisance, items, gone = nuisance and best.nuisance.size > 0, {w.term.key: w for w in weighed}, []
    for rich, part, renamed in list(_doubled(best)):
        if not {rich.key, part.key} <= set(items):
            continue
        whole = _with_part(rich, part, renamed)
        others = [whole if t.key == rich.key else t for t in best.terms_without(part)]
        best = explain(best.problem, best.view, others, nuisance=nuisance)
        items[rich.key] = _as_sure_as(items[rich.key], items[part.key].probability)
        del items[part.key]
    for item in sorted(items.values(), key=lambda item: item.probability):
        term = next((t for t in best.found if t.key == item.term.key), None)
        if term is None or has_size(final(best), term):
            continue
        progress(f"looking at what is left without {term.label}")
        fresh = _rest_of(term)
        added = [] if fresh is None or fresh.key in {t.key for t in best.terms} else [fresh]
        trial = explain(best.problem, best.view, [*best.terms_without(term), *added], nuisance=nuisance)
        if not all(has_size(final(trial), t) for t in trial.found if fresh and t.key == fresh.key):
            trial = explain(best.problem, best.view, best.terms_without(term), nuisance=nuisance)
        if _needed_in_runs(replay, build, best, trial):
            continue
        best = trial
        gone.append((term, MAY_BE_NOTHING))
        del items[term.key]
        if fresh is not None and fresh.key in {t.key for t in best.found}:
            _, again = weigh(
                best.problem, best.view, best, nuisance=nuisance, progress=progress, exchange=False
            )
            items[fresh.key] = next(w for w in again if w.term.key == fresh.key)
    named = [t for t in best.found if t.key in items]
    return best, tuple(replace(items[t.key], term=t) for t in named), tuple(gone)


def _needed_in_runs(replay: Replay | None, build: Build, best: Explanation, trial: Explanation) -> bool:
    if replay is None:
        return False
    mine, theirs = runs_of(replay, build(trial)), runs_of(replay, build(best))
    if theirs is None:
        return False
    return mine is None or evidence_for(mine, theirs) > EXCHANGE


def _doubled(best: Explanation) -> Iterator[tuple[Term, Term, dict[str, str]]]:
    """A law, another one at the same place that is part of it, and what that one's numbers are in it."""
    for rich in best.found:
        for part in best.found:
            renamed = rich.effect.contains.get(part.effect.id)
            if renamed is not None and part.at == rich.at:
                yield rich, part, dict(renamed)


def _with_part(rich: Term, part: Term, renamed: dict[str, str]) -> Term:
    """A law with the numbers of another one that is part of it."""
    values = {own: rich.parameters.get(own, 0.0) + part.parameters[name] for name, own in renamed.items()}
    held = {own: part.held[name] for name, own in renamed.items() if name in part.held}
    return replace(
        rich,
        parameters={**rich.parameters, **values},
        unseen=tuple(name for name in rich.unseen if name not in values),
        held={**rich.held, **held},
    )


def _as_sure_as(item: Weighed, probability: float) -> Weighed:
    """A name no less probable than that; its rivals share what is left."""
    if probability <= item.probability:
        return item
    left = (1.0 - probability) / max(1.0 - item.probability, 1e-300)
    others = tuple((term, p * left) for term, p in item.alternatives)
    return replace(item, probability=probability, alternatives=others)


def _rest_of(term: Term) -> Term | None:
    """What is left of a law without its essential size; None where that is nothing."""
    for simpler, renamed in term.effect.contains.items():
        values = {name: term.parameters[own] for name, own in renamed.items()}
        if any(values.values()):
            held = {name: term.held[own] for name, own in renamed.items() if own in term.held}
            return Term(get_effect(simpler), term.at, values, held=held)
    return None
