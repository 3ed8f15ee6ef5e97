"""What happens where a joint reverses: pre-sliding, which only a law with an internal state shows.

Effects are named from rows of sure direction, in which LuGre and its static curve are nearly the same. So
afterwards, where a dry friction law is present and the rows around reversals are explained worse than the
others, a law with bristles may take its place. It must explain the reversals nearly as well as the rest:
the filter's own error at a reversal cannot be explained so.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.candidates import Candidate, candidates
from missing_physics.diagnosis.explanation import Explanation, View, explain
from missing_physics.diagnosis.fitted import present, refit, uninformed
from missing_physics.diagnosis.naming import ODDS, Progress, rung
from missing_physics.diagnosis.problem import Problem
from missing_physics.diagnosis.result import Rung
from missing_physics.diagnosis.statistics import paired_block_p_value
from missing_physics.diagnosis.terms import Term
from reference_model.effects.base import Effect, JointEffect
from reference_model.effects.catalogue import catalogue

__all__ = ["explain_reversals"]

Array = NDArray[np.float64]

#: Rows around reversals are looked at when with them the rms error exceeds that of the others so much,
WORSE = 1.03
#: and a law is believed when with it the whole is at most so much worse than the others.
NEARLY_AS_GOOD = 1.25
#: Largest p-value of the held-out gain.
HELD_OUT = 0.05
#: Laws weighed at a reversal, for the odds that evidence must beat.
WEIGHED = 4
NEEDED = float(np.log(ODDS * WEIGHED))


def explain_reversals(
    problem: Problem, view: View, best: Explanation, *, nuisance: bool, progress: Progress
) -> tuple[Explanation, tuple[Rung, ...]]:
    """Replace dry friction laws by ones with internal states where the reversals ask for it.

    Returns:
        The explanation, in the view with reversals if anything was replaced; and what was weighed.
    """
    whole_view = replace(view, reversals=True)
    ladder: list[Rung] = []
    for term in [t for t in best.terms if t.effect.family == "dry_friction" and not t.frozen]:
        joint = problem.joints.index(term.at)
        whole = explain(problem, whole_view, best.terms, nuisance=nuisance)
        others = _rms(best, view, joint)
        if _rms(whole, whole_view, joint) < WORSE * others:
            continue
        progress(f"looking at the reversals of {term.at}")
        for candidate in _best_starts(problem, whole_view, whole, term):
            trial = refit(problem, whole_view, whole, candidate, nuisance=nuisance)
            evidence, wanted = trial.evidence_over(whole), candidate.term
            fresh = next(t for t in trial.terms if t.key == wanted.key)
            why = _refusal(trial, whole, fresh, evidence)
            if not why and _rms(trial, whole_view, joint) > NEARLY_AS_GOOD * others:
                why = "it leaves the reversals worse explained than the rest"
            ladder.append(rung(trial, whole, fresh, evidence, why))
            if not why:
                best, view = trial, whole_view
            if not why or evidence < NEEDED:
                break
    return best, tuple(ladder)


def _best_starts(problem: Problem, view: View, whole: Explanation, term: Term) -> list[Candidate]:
    """The law with internal states that may replace `term`, from each Stribeck velocity the best start.

    A fit that begins with another velocity may end in another minimum; the next is asked where the data want
    such a law and the one before is not to be believed.
    """
    laws = {e.id for e in catalogue().values() if e.family == term.effect.family and _has_states(e)}
    found = [
        option
        for option in candidates(problem, whole, bristles=True, among=laws)
        if option.replaces is not None and option.replaces.key == term.key
    ]
    rest = [replace(t, frozen=True) for t in whole.terms if t.key != term.key]
    energies = [
        float(explain(problem, view, [*rest, replace(option.term, frozen=True)]).energies.sum())
        for option in found
    ]
    ordered = [found[k] for k in np.argsort(energies)]
    speeds = [option.term.parameters.get("stribeck_velocity") for option in ordered]
    return [option for k, option in enumerate(ordered) if speeds[k] not in speeds[:k]]


def _has_states(effect: Effect) -> bool:
    return isinstance(effect, JointEffect) and effect.states > 0


def _rms(explanation: Explanation, view: View, joint: int) -> float:
    weight = view.weight(explanation.problem)[view.rows, joint]
    residual = explanation.residual[view.rows, joint] * weight
    return float(np.sqrt(np.sum(residual**2) / max(float(weight.sum()), 1.0)))


def _refusal(trial: Explanation, whole: Explanation, fresh: Term, evidence: float) -> str:
    if evidence < NEEDED:
        return f"evidence {evidence:.1f} is below the {NEEDED:.1f} needed"
    if nonsense := fresh.effect.implausible(fresh.parameters):
        return nonsense
    if not present(trial, fresh):
        return "its parameters do not differ from absent"
    if blind := uninformed(trial, fresh):
        return f"the data hold no information on its {blind}"
    gain = paired_block_p_value(whole.regression.held_out_energy(), trial.regression.held_out_energy())
    return "" if gain <= HELD_OUT else "it does not lower the error in unseen blocks"
