"""Step 4 of the chain: which set of effects explains the residual.

Forward selection with backward pruning and exchange. A candidate enters only if the evidence for it is
strong against all candidates that were tried (so that many tries do not make a finding), if its parameters
differ from "absent" by a cluster-robust test, and if it lowers the error in blocks that it was not fitted
to. Training fit alone never counts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.candidates import Candidate, candidates, first_look
from missing_physics.diagnosis.explanation import Explanation, View, explain
from missing_physics.diagnosis.problem import Problem
from missing_physics.diagnosis.result import Rung
from missing_physics.diagnosis.statistics import paired_block_p_value
from missing_physics.diagnosis.structural import LOOKED_ELSEWHERE, hidden, not_that_mode
from missing_physics.diagnosis.terms import Term
from reference_model.effects.base import Parameter

__all__ = ["Search", "blind_parameters", "name_effects", "present", "refit", "rung", "slim", "uninformed"]

Array = NDArray[np.float64]
Progress = Callable[[str], None]
#: Says why the second explanation may not follow the first by the held-out data; empty when it may.
Proof = Callable[["Explanation", "Explanation"], str]

#: Odds against one false entry that evidence must beat, on top of the number of candidates tried.
ODDS = 100.0
#: Candidates of a round that are fitted in full.
FITTED_PER_ROUND = 5
#: Effects named at most.
MOST_EFFECTS = 30
#: Largest p-value of the cluster-robust test, before division by the number of candidates.
SIGNIFICANCE = 0.01
#: Largest p-value of the blocks' held-out gain.
HELD_OUT = 0.05
#: An event lies so far inside the recording, and lasts at most so long [parts of its length].
EVENT_MARGIN = 0.02
LONGEST_EVENT = 0.2
#: An interval wider than this many times its value says nothing.
UNKNOWN = 4.0
#: or, of a parameter that may be absent, this many times its typical size.
UNHEARD_OF = 1e3
#: A parameter whose column is shorter than this part of the longest moves nothing.
UNFELT = 1e-12
#: A column that keeps less than this part of its length beside the others is one of their combinations.
IMITATED = 1e-4
#: A term whose columns alone promise more evidence than this is not tried to be left out.
SURELY_NEEDED = 30.0


@dataclass
class Search:
    """What was tried and where it ended.

    Attributes:
        start: the nominal effects, re-estimated.
        best: the final explanation.
        ladder: every step.
        stages: the explanation after each entry and what it made superfluous.
        tried: number of candidates weighed in the last round.
    """

    start: Explanation
    best: Explanation
    ladder: list[Rung] = field(default_factory=list)
    stages: list[Explanation] = field(default_factory=list)
    tried: int = 0


def present(explanation: Explanation, term: Term) -> bool:
    """Whether at least one amplitude of `term` differs from "absent" beyond its 95 % interval."""
    intervals = explanation.intervals(term)
    amplitudes = [p for p in term.estimated if p.absent is not None]
    if not amplitudes:
        return True
    return any(not intervals[p.name][0] <= float(p.absent or 0.0) <= intervals[p.name][1] for p in amplitudes)


def blind_parameters(explanation: Explanation, term: Term) -> tuple[str, ...]:
    """Parameters of a term whose intervals say nothing."""
    fitted = next(t for t in explanation.terms if t.key == term.key)
    intervals = explanation.intervals(fitted)
    length = np.linalg.norm(explanation.columns[:, explanation.slice_of(fitted)], axis=0)
    moves = length > UNFELT * max(float(np.linalg.norm(explanation.columns, axis=0).max()), 1e-300)
    return tuple(
        p.name
        for p, felt in zip(fitted.estimated, moves)
        if not felt
        or not intervals[p.name][1] - intervals[p.name][0] <= _believable(p, fitted.parameters[p.name])
    )


def _believable(parameter: Parameter, value: float) -> float:
    """Widest interval of a parameter that still says something."""
    if parameter.absent is None:
        return UNKNOWN * abs(value)
    return UNHEARD_OF * max(abs(value), parameter.typical)


def uninformed(explanation: Explanation, term: Term) -> str:
    """The first parameter that a term cannot do without and of which the data say nothing; else empty."""
    essential = term.effect.essential or tuple(p.name for p in term.estimated)
    blind = [name for name in blind_parameters(explanation, term) if name in essential]
    return blind[0].replace("_", " ") if blind else ""


def name_effects(
    problem: Problem, view: View, terms: Sequence[Term], *, proof: Proof, progress: Progress
) -> Search:
    """Grow and prune until nothing more is supported by the data, held-out data included."""
    start = explain(problem, view, terms)
    search = Search(start, start)
    for _ in range(MOST_EFFECTS):
        if not _grow(problem, view, search, proof, progress):
            break
        entered = search.best
        search.stages.append(entered)
        _prune(problem, view, search)
        if search.best is not entered:
            search.stages[-1] = search.best
    return search


def _grow(problem: Problem, view: View, search: Search, proof: Proof, progress: Progress) -> bool:
    current = search.best
    options = list(candidates(problem, current))
    search.tried = max(len({(o.term.effect.id, o.term.at) for o in options}), 1)
    progress(f"{len(current.found)} found; weighing {search.tried} candidates")
    looks = first_look(problem, view, current, options)
    needed = float(np.log(ODDS * search.tried))
    fits = []
    for look in looks[:FITTED_PER_ROUND]:
        if look.evidence < 0.3 * needed:
            break
        progress(f"{len(current.found)} found; fitting {look.candidate.term.label}")
        trial = refit(problem, view, current, look.candidate)
        fits.append((trial.evidence_over(current), trial, look.candidate))
    for evidence, trial, candidate in _simpler_first(fits, needed):
        why = _refusal(trial, current, candidate, evidence, needed, search.tried)
        if not why and not candidate.term.effect.is_event:
            why = proof(current, trial)
        search.ladder.append(rung(trial, current, candidate.term, evidence, why))
        if not why:
            search.best = trial
            return True
    return False


Trial = tuple[float, Explanation, Candidate]


def _simpler_first(fits: Sequence[Trial], needed: float) -> list[Trial]:
    """By falling evidence, but a simpler effect that is supported by itself goes before a richer one."""
    order = sorted(fits, key=lambda item: -item[0])
    for index, (_, _, candidate) in enumerate(order):
        for later in order[index + 1 :]:
            term = later[2].term
            if (
                term.at == candidate.term.at
                and term.effect.id in candidate.term.effect.simpler
                and later[0] > needed
            ):
                order.remove(later)
                order.insert(index, later)
                return order
    return order


def refit(
    problem: Problem, view: View, current: Explanation, candidate: Candidate, *, nuisance: bool = True
) -> Explanation:
    """Fit the current terms with the candidate added, or put in the place of what it replaces."""
    kept = [t for t in current.terms if candidate.replaces is None or t.key != candidate.replaces.key]
    nominal = candidate.replaces is not None and candidate.replaces.nominal
    added = replace(candidate.term, nominal=False) if nominal else candidate.term
    return slim(explain(problem, view, [*kept, added], nuisance=nuisance), added.key)


def slim(explanation: Explanation, key: tuple[str, str]) -> Explanation:
    """Leave out parameters that cannot be told from "absent", and those of which the data say nothing.

    At least one that makes the effect remains.
    """
    term = next(t for t in explanation.terms if t.key == key)
    intervals = explanation.intervals(term)
    needless = [
        p.name
        for p in term.estimated
        if p.linear
        and p.absent is not None
        and p.name not in term.effect.essential
        and intervals[p.name][0] <= p.absent <= intervals[p.name][1]
    ]
    if len(needless) == sum(p.absent is not None for p in term.estimated):
        needless = []
    optional = [p.name for p in term.estimated if p.name not in (*term.effect.essential, *needless)]
    unknown = {*blind_parameters(explanation, term), *_imitated(explanation, term, optional)}
    blind = [name for name in optional if term.effect.essential and name in unknown]
    if not needless and not blind:
        return explanation
    absent = {name: float(term.effect.parameter(name).absent or 0.0) for name in needless}
    simpler = replace(
        term, parameters={**term.parameters, **absent}, unseen=(*term.unseen, *needless, *blind)
    )
    terms = [simpler if t.key == key else t for t in explanation.terms]
    slimmed = explain(explanation.problem, explanation.view, terms, nuisance=explanation.nuisance.size > 0)
    return slimmed if slimmed.evidence_over(explanation) > 0 else explanation


def _imitated(explanation: Explanation, term: Term, names: Sequence[str]) -> list[str]:
    """Those of the parameters `names` whose every change other parameters can make as well."""
    length = np.linalg.norm(explanation.columns, axis=0)
    columns = explanation.columns / np.where(length > 0, length, 1.0)
    start, kept = explanation.slice_of(term).start, length > 0
    found = []
    for name in names:
        own = start + term.free.index(name)
        kept[own] = False
        others = columns[:, kept]
        gap = columns[:, own] - others @ np.linalg.lstsq(others, columns[:, own], rcond=1e-10)[0]
        if np.linalg.norm(gap) < IMITATED:
            found.append(name)
        else:
            kept[own] = True
    return found


def _refusal(
    trial: Explanation, current: Explanation, candidate: Candidate, evidence: float, needed: float, tried: int
) -> str:
    """Why the candidate may not enter; empty when it may."""
    if hidden(candidate.term.effect):
        needed += float(np.log(LOOKED_ELSEWHERE))
    if evidence < needed:
        return f"evidence {evidence:.1f} is below the {needed:.1f} needed"
    term = next(t for t in trial.terms if t.key == candidate.term.key)
    if not present(trial, term):
        return "its parameters do not differ from absent"
    if nonsense := term.effect.implausible(term.parameters):
        return nonsense
    if blind := uninformed(trial, term):
        return f"the data hold no information on its {blind}"
    if term.effect.is_event and (elsewhere := _no_event(trial.problem, term)):
        return elsewhere
    if candidate.replaces is None:
        p_value = trial.regression_of(fine=term.effect.is_event).wald_p_value(_tested(trial, term))
        if p_value > SIGNIFICANCE / tried:
            return f"not significant when errors are allowed to be correlated (p = {p_value:.2g})"
    fine = term.effect.is_event
    if hidden(term.effect) and (otherwise := not_that_mode(trial, term)):
        return otherwise
    gain = paired_block_p_value(
        current.regression_of(fine=fine).held_out_energy(), trial.regression_of(fine=fine).held_out_energy()
    )
    if gain > HELD_OUT:
        return f"does not lower the error in blocks it was not fitted to (p = {gain:.2g})"
    return ""


def _no_event(problem: Problem, term: Term) -> str:
    """Why what a term describes is no event within the recording; empty when it is one."""
    time = problem.time[problem.segment_of == 0]
    margin = EVENT_MARGIN * float(time[-1] - time[0])
    start = term.parameters["start"]
    stop = start + term.parameters["duration"]
    if start < time[0] + margin or stop > time[-1] - margin:
        return "it begins or ends with the recording, so that it may as well be there always"
    if stop - start > LONGEST_EVENT * float(time[-1] - time[0]):
        return "it lasts too long for an event"
    return ""


def _tested(trial: Explanation, term: Term) -> NDArray[np.int_]:
    """Columns of the parameters whose departure from "absent" makes the effect."""
    place = trial.slice_of(term)
    amplitudes = [
        i for i, p in enumerate(term.estimated) if (p.linear or p.absent is not None) and p not in term.beside
    ]
    return np.array([place.start + i for i in amplitudes], dtype=int)


def rung(trial: Explanation, current: Explanation, term: Term, evidence: float, why: str) -> Rung:
    """The step from `current` to `trial`; an empty `why` says that it was taken."""
    rows = trial.errors.size
    held_out = float(np.sqrt(trial.regression.held_out_energy().sum() / rows))
    return Rung(
        effect=term.effect.id,
        location=term.at,
        added_to=tuple(t.label for t in current.found),
        train_rms=float(np.sqrt((trial.errors**2).sum() / rows)),
        validation_rms=held_out,
        evidence=evidence,
        kept=not why,
        why=why or "strong evidence, significant, and holds in unseen blocks",
    )


def _prune(problem: Problem, view: View, search: Search) -> None:
    """Leave out what later entries have made superfluous."""
    while len(search.best.found) > 1:
        best = search.best
        weakest: tuple[float, Explanation, Term] | None = None
        for term in best.found[:-1]:
            heirs = _heirs(best, term)
            if not heirs and _promised_loss(best, term) > SURELY_NEEDED and present(best, term):
                continue
            without = _without(best, term, heirs)
            evidence = best.evidence_over(without)
            if weakest is None or evidence < weakest[0]:
                weakest = (evidence, without, term)
        if weakest is None or (weakest[0] > np.log(ODDS) and present(best, weakest[2])):
            return
        evidence, without, term = weakest
        search.ladder.append(
            rung(without, best, term, -evidence, "left out again: what came later explains it as well")
        )
        search.best = without


def _heirs(best: Explanation, term: Term) -> list[tuple[str, str]]:
    """Findings beside `term` that do without a parameter, which `term` may be the reason of."""
    place = term.at.split(".")[0]
    return [
        other.key
        for other in best.found
        if other.key != term.key and other.at.split(".")[0] == place and _whole(other) is not other
    ]


def _whole(term: Term) -> Term:
    """`term` with every parameter free that would be zero if it could not be told."""
    left = tuple(p.name for p in term.effect.estimated if p.linear and p.absent is not None)
    if not set(left) & set(term.unseen):
        return term
    return replace(term, unseen=tuple(name for name in term.unseen if name not in left))


def _without(best: Explanation, term: Term, heirs: Sequence[tuple[str, str]]) -> Explanation:
    """`best` without `term`; `heirs` get back the parameters that they did without."""
    kept = [_whole(t) if t.key in heirs else t for t in best.terms if t.key != term.key]
    without = explain(best.problem, best.view, kept)
    for key in heirs:
        without = slim(without, key)
    return without


def _promised_loss(best: Explanation, term: Term) -> float:
    """Evidence that would be lost without the columns of `term`, everything else refitted linearly."""
    regression = best.regression
    place = best.slice_of(term)
    kept = np.array([i for i in range(best.columns.shape[1]) if not place.start <= i < place.stop], dtype=int)
    ratio = regression.take(kept).residual_energy() / max(regression.residual_energy(), 1e-300)
    effective = float(best.effective.sum())
    return float(0.5 * effective * np.log(ratio) - 0.5 * len(term.free) * np.log(max(effective, 2.0)))
