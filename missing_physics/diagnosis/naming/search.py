"""Step 4 of the chain: which set of effects explains the residual.

Forward selection with backward pruning and exchange. A candidate enters only if the evidence for it is
strong against all candidates that were tried (so that many tries do not make a finding), if its parameters
differ from "absent" by a cluster-robust test, and if it lowers the error in blocks that it was not fitted
to. Training fit alone never counts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.candidates.effects import Candidate, candidates, first_look, ranked
from missing_physics.diagnosis.candidates.fitted import present, refit, slim, uninformed, whole
from missing_physics.diagnosis.candidates.structural import LOOKED_ELSEWHERE, hidden, misfelt, searched
from missing_physics.diagnosis.least_squares.explanation import Explanation, View, explain
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.naming.noise_bias import evidence_without_noise
from missing_physics.diagnosis.statistics.correlated_errors import paired_block_p_value
from missing_physics.diagnosis.terms.term import Term
from missing_physics.plausibility import implausible
from missing_physics.results.result import Rung

__all__ = ["ODDS", "Progress", "Search", "cut_off", "incredible", "name_effects", "rung"]

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
LONGEST_EVENT = 0.25
#: Joints that feel less than this part of the nominal inertia are no explanation of it.
LIGHTEST = 0.1
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
    """By falling evidence, but a simpler effect that is supported by itself goes before a richer one.

    Where they are held against each other the effective samples are those of the one that leaves least.
    """
    if not fits:
        return []
    least = min((trial for _, trial, _ in fits), key=lambda trial: float(trial.referred.sum()))
    start = fits[0][1]
    order = sorted(
        fits, key=lambda fit: ranked(fit[1].evidence_over(start, effective=least.effective), fit[2].term)
    )
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


def _refusal(
    trial: Explanation, current: Explanation, candidate: Candidate, evidence: float, needed: float, tried: int
) -> str:
    """Why the candidate may not enter; empty when it may."""
    if searched(candidate.term.effect):
        needed += float(np.log(LOOKED_ELSEWHERE))
    if evidence < needed:
        return f"evidence {evidence:.1f} is below the {needed:.1f} needed"
    term = next(t for t in trial.terms if t.key == candidate.term.key)
    if not present(trial, term):
        return "its parameters do not differ from absent"
    if nonsense := term.effect.implausible(term.parameters):
        return nonsense
    if outermost := cut_off(term) or incredible(term, trial.problem):
        return outermost
    if blind := uninformed(trial, term):
        return f"the data hold no information on its {blind}"
    if _too_light(trial, current, candidate, needed):
        return "it needs a robot with next to no inertia"
    if term.effect.is_event and (elsewhere := _no_event(trial.problem, term)):
        return elsewhere
    if candidate.replaces is None:
        p_value = trial.regression_of(fine=trial.is_brief(term)).wald_p_value(_tested(trial, term))
        if p_value > SIGNIFICANCE / tried:
            return f"not significant when errors are allowed to be correlated (p = {p_value:.2g})"
    fine = trial.is_brief(term)
    if searched(term.effect) and (otherwise := misfelt(trial, term)):
        return otherwise
    gain = paired_block_p_value(
        current.regression_of(fine=fine).held_out_energy(), _unseen_energy(trial, term)
    )
    if gain > HELD_OUT:
        return f"does not lower the error in blocks it was not fitted to (p = {gain:.2g})"
    if hidden(term.effect) and (first := _other_modes(current, term)):
        return f"what is left beside {first} may be of second order in its deflection"
    if hidden(term.effect) and (beside := evidence_without_noise(trial, current, term)) < needed:
        return f"noise of the encoders makes most of it (evidence {beside:.1f} without)"
    return ""


def _other_modes(current: Explanation, term: Term) -> str:
    """The effect of another kind that has modes and is found already; they are simulated to first order."""
    found = (t.label for t in current.found if hidden(t.effect) and t.effect.id != term.effect.id)
    return next(found, "")


def cut_off(term: Term) -> str:
    """Which size of the effect the catalogue's range cuts off; empty when none is.

    The fit wants more of the effect than there can be: it stands in for something else. Not so at a bound
    that is the usual size, as of a beam that stiffens wholly.
    """
    for parameter in term.estimated:
        if not (parameter.linear or parameter.absent is not None):
            continue
        value = term.parameters[parameter.name]
        for bound in (parameter.lower, parameter.upper):
            if value == bound and bound not in (parameter.absent, parameter.typical):
                return f"its {parameter.name} has to be beyond {bound:g}, where there is no such effect"
    return ""


def incredible(term: Term, problem: Problem) -> str:
    """Why no machine has the numbers of a term; empty where one may (`plausibility`)."""
    needed = 0.0
    if term.effect.id == "torque_saturation":
        place = problem.joints.index(term.at)
        needed = max(float(np.abs(segment.inverse[:, place]).max()) for segment in problem.segments)
    return implausible(term.effect.id, term.at, term.own, problem.robot, needed=needed)


def _too_light(trial: Explanation, current: Explanation, candidate: Candidate, needed: float) -> bool:
    """Whether the candidate is better only because joints need hardly feel any inertia with it.

    Masses that the data hardly tell may come out small by chance; then the candidate must be needed with the
    nominal ones, too.
    """
    problem = trial.problem
    if problem.lightness(trial.nuisance) > LIGHTEST or problem.lightness(current.nuisance) < LIGHTEST:
        return False
    heavy = explain(problem, current.view, current.terms, nuisance=False)
    return refit(problem, current.view, heavy, candidate, nuisance=False).evidence_over(heavy) < needed


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


def _unseen_energy(trial: Explanation, term: Term) -> NDArray[np.float64]:
    """Energy of each block by a fit to the others.

    When an event begins and ends, where a wall stands, or how a mode moved when the recording began, is told
    by the blocks where it does so and by no other: these numbers are held, and the others must foretell the
    rest.
    """
    start, fine = trial.slice_of(term).start, trial.is_brief(term)
    told = [i for i, p in enumerate(term.estimated) if p in term.beside or (fine and not p.linear)]
    places = np.array([start + i for i in told], dtype=int)
    return trial.regression_of(fine=fine).held(places, term.values[told]).held_out_energy()


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
    return Rung(
        effect=term.effect.id,
        location=term.at,
        added_to=tuple(t.label for t in current.found),
        train_rms=float(np.sqrt((trial.errors**2).sum() / rows)),
        validation_rms=trial.regression.held_out_rms(rows),
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
        if other.key != term.key and other.at.split(".")[0] == place and whole(other) is not other
    ]


def _without(best: Explanation, term: Term, heirs: Sequence[tuple[str, str]]) -> Explanation:
    """`best` without `term`; `heirs` get back the parameters that they did without."""
    kept = [whole(t) if t.key in heirs else t for t in best.terms if t.key != term.key]
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
