"""What happens where a joint reverses: pre-sliding, which only a law with an internal state shows.

Effects are named from rows of sure direction, in which LuGre and its static curve are nearly the same. So
afterwards, where a dry friction law is present and the rows around reversals are explained worse than the
others, a law with bristles may take its place, if it does better than every law without. It must explain the
reversals nearly as well as the rest: the filter's own error at a reversal cannot be explained so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.candidates.effects import Candidate, candidates
from missing_physics.diagnosis.candidates.fitted import present, refit, uninformed
from missing_physics.diagnosis.least_squares.explanation import Explanation, View, explain
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.naming.kinship import (
    REFUSED,
    Contested,
    evidence_by_parts,
    law_at,
    odds_for,
    static_laws,
)
from missing_physics.diagnosis.naming.search import ODDS, Progress, rung
from missing_physics.diagnosis.preparation.proof import HeldOut
from missing_physics.diagnosis.statistics.correlated_errors import paired_block_p_value
from missing_physics.diagnosis.terms.term import Term
from missing_physics.results.result import Rung
from reference_model.effects.base import Effect, JointEffect
from reference_model.effects.catalogue import catalogue

__all__ = ["explain_reversals", "unresolved"]

Array = NDArray[np.float64]

#: Rows around reversals are looked at when with them the rms error exceeds that of the others so much,
WORSE = 1.03
#: and a law is believed when with it the whole is at most so much worse than the others.
NEARLY_AS_GOOD = 1.25
#: Held-out rows of sure direction may have so much more energy at the joint with the law: what the rows
#: around reversals want is never quite what the others want.
WORSE_UNFITTED = 1.1
#: Bristles so many times as stiff as those of a fit are taken for rigid.
STIFFER = 10.0
#: Largest p-value of the held-out gain.
HELD_OUT = 0.05
#: Laws weighed at a reversal, for the odds that evidence must beat.
WEIGHED = 4
NEEDED = float(np.log(ODDS * WEIGHED))
#: A law with bristles can do all that one without can, at the cost of its numbers: one that does worse than
#: this has gone astray in its fit, and is tried from its next start.
ASTRAY = -15.0
#: Keeps logarithms finite.
TINY = 1e-300


def explain_reversals(
    best: Explanation, held_out: HeldOut, *, nuisance: bool, progress: Progress
) -> tuple[Explanation, tuple[Rung, ...], tuple[Contested, ...]]:
    """Replace dry friction laws by ones with internal states where the reversals ask for it.

    A law with states has to do better than every law without, in the same rows, and than itself with bristles
    that are stiff beyond what shows: what a Stribeck law does near rest is no evidence for bristles, nor is a
    better idea of when a joint turns.

    Returns:
        The explanation, in the view with reversals if anything was replaced; what was weighed; and the odds
        of each law that was weighed against the one that stands.
    """
    problem, view = best.problem, best.view
    sure, all_alike = replace(view, reversals=False), replace(view, reversals=True)

    def unfitted(explanation: Explanation, law: Term) -> float:
        where = held_out.acts(explanation, [law])
        return float(held_out.block_energies(held_out.residual(explanation), where).sum())

    ladder: list[Rung] = []
    contests: list[Contested] = []
    for term in [t for t in best.terms if t.effect.family == "dry_friction" and not t.frozen]:
        joint = problem.joints.index(term.at)
        others = _rms(best, sure, joint)
        if _rms(best, all_alike, joint) < WORSE * others and _to_gain(best, joint, others) < NEEDED:
            continue
        whole_view = replace(view, reversals=True, rougher=_rougher(best))
        whole = explain(problem, whole_view, best.terms, nuisance=nuisance)
        progress(f"looking at the reversals of {term.at}")
        plain = list(static_laws(whole, term, nuisance=nuisance))
        refused: list[Contested] = []
        for candidate in _best_starts(problem, whole_view, whole, term):
            trial = refit(problem, whole_view, whole, candidate, nuisance=nuisance)
            wanted = candidate.term
            fresh = next(t for t in trial.terms if t.key == wanted.key)
            static = [*plain, _without_give(trial, fresh, nuisance=nuisance)]
            evidence = min(evidence_by_parts(trial, law) for law in static)
            odds = [odds_for(trial, law, held_out) for law in static]
            hidden = unresolved(problem, fresh, joint) or _no_better(trial, static, joint)
            gains = [own - evidence_by_parts(trial, law) for law, own in zip(static, odds)]
            why = _refusal(trial, plain, fresh, evidence, confirmed=min(gains) >= NEEDED) or hidden
            if not why and min(odds) < NEEDED:
                why = "data that were not fitted speak against it"
            alike = trial if why else explain(problem, all_alike, trial.terms, nuisance=nuisance)
            if not why and unfitted(alike, fresh) > WORSE_UNFITTED * unfitted(best, term):
                why = "away from reversals data that were not fitted get worse with it"
            if not why and _rms(alike, all_alike, joint) > NEARLY_AS_GOOD * others:
                why = "it leaves the reversals worse explained than the rest"
            ladder.append(rung(trial, whole, fresh, evidence, why))
            if not why:
                best, refused = alike, []
                for law, own in zip(plain, odds):
                    same = law_at(law, term).key == term.key  # it stood, whatever the bristles' stiffness
                    contests.append(Contested(fresh, law_at(law, term), min(own, odds[-1]) if same else own))
            else:
                nonsense = fresh.effect.implausible(fresh.parameters) or uninformed(trial, fresh)
                if not (hidden or nonsense) and min(gains) > REFUSED:
                    refused.append(Contested(term, fresh, -min(odds)))
            if not why or ASTRAY < evidence < NEEDED:
                break
        contests += sorted(refused, key=lambda contest: contest.evidence)[:1]
    standing = {t.key for t in best.terms}
    return best, tuple(ladder), tuple(c for c in contests if c.stands.key in standing)


def _no_better(trial: Explanation, static: Sequence[Explanation], joint: int) -> str:
    """Says so where a law without bristles, or their give, leaves less around reversals; else empty."""
    problem, rows = trial.problem, trial.view.rows
    near = ((problem.moving > 0) & (problem.sliding == 0))[rows, joint]
    left, *others = (float((e.residual[rows, joint][near] ** 2).sum()) for e in (trial, *static))
    return "" if left < min(others) else "it explains the reversals no better than laws without bristles"


def _rougher(explanation: Explanation) -> Array:
    """How many times as large as elsewhere errors around reversals are, at least one, shape (m,).

    A fit that took them for errors like others would bend everything to these few rows.
    """
    problem, rows = explanation.problem, explanation.view.rows
    sure = problem.sliding[rows] > 0
    near = (problem.moving[rows] > 0) & ~sure
    squares = explanation.residual[rows] ** 2
    level, other = (np.sqrt((squares * part).sum(0) / np.maximum(part.sum(0), 1)) for part in (near, sure))
    return np.asarray(np.maximum(level / np.maximum(other, TINY), 1.0))


def unresolved(problem: Problem, fresh: Term, joint: int) -> str:
    """Why nobody could see bristles bend, empty when one could.

    Noise of the encoder hides some travel; and a smoother of cut-off f rounds the corner that an acceleration
    a makes at a reversal over a travel of a / (2 pi f)^2.
    """
    hidden = 0.0
    for segment in problem.segments:
        motion = segment.motion
        near = (segment.moving[:, joint] > 0) & (segment.sliding[:, joint] == 0)
        turning = motion.acceleration[motion.low_pass.kept(motion.time.size), joint][near]
        level = float(np.sqrt(np.mean(turning**2))) if turning.size else 0.0
        corner = level / (2 * np.pi * motion.motion_cutoff) ** 2
        hidden = max(hidden, float(np.hypot(motion.position_noise[joint], corner)))
    assert isinstance(fresh.effect, JointEffect)
    travel = fresh.effect.build_up(fresh.parameters)
    if travel >= hidden:
        return ""
    return f"its bristles bend by {travel:.2g} before they slide, and the motion is known to {hidden:.2g}"


def _without_give(trial: Explanation, fresh: Term, *, nuisance: bool) -> Explanation:
    """`trial` with bristles so stiff that no build-up shows: a static law, by travel instead of by sign.

    Everything else is fitted again.
    """
    stiffness = STIFFER * fresh.parameters["bristle_stiffness"]
    rigid = replace(
        fresh,
        parameters={**fresh.parameters, "bristle_stiffness": stiffness},
        unseen=(*fresh.unseen, "bristle_stiffness", "bristle_damping"),
    )
    terms = [rigid if t.key == fresh.key else t for t in trial.terms]
    return explain(trial.problem, trial.view, terms, nuisance=nuisance)


def _to_gain(best: Explanation, joint: int, others: float) -> float:
    """Evidence of a law that explains rows around reversals as well as the others, at rms `others`."""
    problem, rows = best.problem, best.view.rows
    near = ((problem.moving > 0) & (problem.sliding == 0))[rows, joint]
    if not near.any():
        return 0.0
    level = float(np.sqrt(np.mean(best.residual[rows, joint][near] ** 2)))
    index = int(problem.usable[:joint].sum())
    share = float(best.effective[index] / max((problem.sliding[rows, joint] > 0).sum(), 1.0))
    return share * float(near.sum()) * float(np.log(max(level, TINY) / max(others, TINY)))


def _best_starts(problem: Problem, view: View, whole: Explanation, term: Term) -> list[Candidate]:
    """The law with internal states that may replace `term`, from each Stribeck velocity the best start.

    A fit that begins with another velocity may end in another minimum; the next is asked where the data want
    such a law and the one before is not to be believed, or went astray.
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


def _refusal(
    trial: Explanation, plain: Sequence[Explanation], fresh: Term, evidence: float, *, confirmed: bool
) -> str:
    """Why the law may not enter; empty when it may. What held-out data confirm no block has to."""
    if evidence < NEEDED:
        return f"evidence {evidence:.1f} is below the {NEEDED:.1f} needed"
    if nonsense := fresh.effect.implausible(fresh.parameters):
        return nonsense
    if not present(trial, fresh):
        return "its parameters do not differ from absent"
    if blind := uninformed(trial, fresh):
        return f"the data hold no information on its {blind}"
    if confirmed:
        return ""
    unseen = trial.regression.held_out_energy()
    gains = (paired_block_p_value(law.regression.held_out_energy(), unseen) for law in plain)
    return "" if max(gains) <= HELD_OUT else "it does not lower the error in unseen blocks"
