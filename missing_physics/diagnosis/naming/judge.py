"""Step 7 of the chain: probabilities, what cannot be told apart, and the verdict in words."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from missing_physics.diagnosis.candidates.effects import Look, candidates, first_look
from missing_physics.diagnosis.candidates.fitted import blind_parameters, present, refit, uninformed
from missing_physics.diagnosis.candidates.structural import LOOKED_ELSEWHERE, misfelt, searched
from missing_physics.diagnosis.least_squares.explanation import Explanation, View, explain
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.naming.final_model import FinalModel
from missing_physics.diagnosis.naming.kinship import Contested
from missing_physics.diagnosis.naming.search import Progress, Proof, cut_off, incredible
from missing_physics.diagnosis.terms.term import Term
from missing_physics.recordings import percent
from missing_physics.results.result import Alternative, Finding, Mismatch, Verdict
from reference_model.effects.base import Effect, SensorEffect
from reference_model.effects.catalogue import catalogue
from robot_model import Robot

__all__ = [
    "AMBIGUOUS",
    "EXPLAINED_PART",
    "Weighed",
    "beyond_noise",
    "can_look_like",
    "findings_of",
    "reweighed",
    "ruled_out",
    "verdict_of",
    "verdict_on_names",
    "weigh",
]

#: Alternatives of a finding that are fitted in full: of those that the catalogue calls alike, and of others.
#: An offset has five that are the same at one pose.
WEIGHED = 5
#: and only those whose first look promises this part of the finding's evidence; others must promise as much.
WORTH_FITTING = 0.2
#: A rival that can do the same as the finding and more, and does, must bring this evidence for the more.
RICHER = 3.0
#: Evidence an exchange must bring, and where it needs fewer numbers.
EXCHANGE, SIMPLER = 3.0, 1.0
#: An alternative at least this probable is told as ambiguous.
AMBIGUOUS = 0.05
#: Part of the mismatch energy that must be explained to call the whole explained.
EXPLAINED_PART = 0.5
#: Overall chance of calling noise a mismatch.
FALSE_ALARM = 0.01


@dataclass(frozen=True)
class Weighed:
    """A found term, its probability and the alternatives that were fitted in its place.

    `left` is what runs in closed loop leave of what differs, with the term and with the alternatives that
    were run, by key.
    """

    term: Term
    probability: float
    alternatives: tuple[tuple[Term, float], ...]
    left: Mapping[tuple[str, str], float] = field(default_factory=dict)


def weigh(
    problem: Problem,
    view: View,
    best: Explanation,
    *,
    nuisance: bool,
    progress: Progress,
    settled: Collection[tuple[str, str]] = (),
    proof: Proof | None = None,
    exchange: bool = True,
) -> tuple[Explanation, tuple[Weighed, ...]]:
    """Refit with each found term replaced by its rivals at the same place.

    Rivals are effects that the catalogue calls alike, and any other that promises as much in these data; not
    one that unseen data refuse where they do not refuse the term: see `proof` of `name_effects`.

    A rival that explains the data clearly better takes the term's place, once for each term; not one of
    `settled`, which unseen data have refused in that place, and none without `exchange`.

    Returns:
        The explanation, with such exchanges made, and each of its found terms weighed.
    """
    known: dict[tuple[str, str], list[Fitted]] = {}
    for term in best.found:
        fits = _rivals(problem, view, best, term, proof, nuisance=nuisance, progress=progress)
        known[term.key] = fits
        gains = [(trial.evidence_over(best), trial, fresh) for trial, fresh, _ in fits[1:]]
        for gain, trial, fresh in sorted(gains, key=lambda item: -item[0]):
            simpler = len(fresh.free) < len(term.free)
            if not exchange or gain <= (SIMPLER if simpler else EXCHANGE) or fresh.key in settled:
                continue
            if present(trial, fresh) and not fresh.effect.implausible(fresh.parameters):
                best = trial
                known.clear()
                break
    for term in best.found:
        if term.key not in known:
            known[term.key] = _rivals(problem, view, best, term, proof, nuisance=nuisance, progress=progress)
    return best, tuple(_weighed(term, known[term.key]) for term in best.found)


def reweighed(
    best: Explanation, weighed: Sequence[Weighed], contests: Sequence[Contested] = ()
) -> tuple[Weighed, ...]:
    """`weighed` for the terms that are still found, with the odds of other laws of their families.

    A law that took the place of another of its family at a reversal takes over what was weighed for it.
    """
    result = []
    for term in best.found:
        own = next((w for w in weighed if w.term.key == term.key), None)
        kin = next(
            (w for w in weighed if w.term.at == term.at and w.term.effect.family == term.effect.family), None
        )
        if own is None and kin is not None and term.effect.family:
            own = Weighed(term, kin.probability, kin.alternatives)
        shared = own or Weighed(term, 1.0, ())
        for contest in contests:
            if contest.stands.key == term.key:
                shared = _shared(shared, contest)
        result.append(shared)
    return tuple(result)


def _shared(weighed: Weighed, contest: Contested) -> Weighed:
    """`weighed` with one more alternative, by its odds against the finding, which are one at most."""
    rest = [(t, p) for t, p in weighed.alternatives if t.key != contest.other.key]
    odds = float(np.exp(-np.clip(contest.evidence, 0.0, 700.0)))
    whole = [weighed.probability, weighed.probability * odds, *(p for _, p in rest)]
    scale = max(sum(whole), 1.0)
    alternatives = ((contest.other, whole[1] / scale), *((t, p / scale) for t, p in rest))
    return Weighed(weighed.term, whole[0] / scale, alternatives)


Fitted = tuple[Explanation, Term, float]


def _rivals(
    problem: Problem,
    view: View,
    best: Explanation,
    term: Term,
    proof: Proof | None,
    *,
    nuisance: bool,
    progress: Progress,
) -> list[Fitted]:
    """`best` and the explanations with `term` replaced, each with its evidence over leaving it out."""
    progress(f"weighing rivals of {term.label}")
    without = explain(problem, view, best.terms_without(term), nuisance=nuisance)
    place = term.at.split(".")[0]
    options = [
        option
        for option in candidates(
            problem, without, nominal_numbers=not nuisance, alike=can_look_like(term.effect)
        )
        if option.term.key != term.key and _related(problem, place, option.term.at.split(".")[0])
    ]
    effective = best.effective
    fits = [(best, term, best.evidence_over(without, effective=effective))]
    refused = proof if proof is not None and not proof(without, best) else None
    for look in _worth_fitting(first_look(problem, view, without, options), term, fits[0][2]):
        trial = refit(problem, view, without, look.candidate, nuisance=nuisance)
        fresh = next(t for t in trial.terms if t.key == look.candidate.term.key)
        if fresh.effect.implausible(fresh.parameters) or uninformed(trial, fresh) or cut_off(fresh):
            continue
        if incredible(fresh, problem):
            continue
        if refused is not None and refused(without, trial):
            continue
        evidence = trial.evidence_over(without, effective=effective)
        if searched(fresh.effect):
            if misfelt(trial, fresh):
                continue
            evidence -= 0.0 if searched(term.effect) else float(np.log(LOOKED_ELSEWHERE))
        fits.append((trial, fresh, _counted(evidence, term, fresh)))
    return fits


def _counted(evidence: float, term: Term, rival: Term) -> float:
    """What counts of the `evidence` of a rival of `term`.

    A richer effect must bring `RICHER` for the numbers by which it goes beyond the finding. With no more
    numbers it does not go beyond it: where direction-dependent friction is left with one number it is an
    offset in each row of sure direction, and neither is preferred.
    """
    richer = term.effect.id in rival.effect.simpler and len(rival.free) > len(term.free)
    return evidence - (RICHER if richer else 0.0)


def _worth_fitting(looks: Sequence[Look], term: Term, evidence: float) -> list[Look]:
    """Of first looks, best first: what is known to look like `term`, and what does so in these data."""
    known = can_look_like(term.effect)
    alike = [look for look in looks if look.candidate.term.effect.id in known]
    worth = [look for look in alike[:WEIGHED] if look.evidence >= WORTH_FITTING * evidence]
    strange = [look for look in looks if look.candidate.term.effect.id not in known]
    return worth + [look for look in strange[:WEIGHED] if look.evidence > evidence - EXCHANGE]


def can_look_like(effect: Effect) -> set[str]:
    """Ids of effects that the catalogue says can be taken for this one, or it for them, and its kin.

    A sensor's error can be taken for the same of another sensor, a link that bends for another one.
    """
    return {
        other.id
        for other in catalogue().values()
        if other.id in effect.confused_with
        or effect.id in other.confused_with
        or other.id in effect.simpler
        or effect.id in other.simpler
        or (other.id == effect.id and (isinstance(effect, SensorEffect) or searched(effect)))
        or (effect.family is not None and other.family == effect.family)
    }


def _related(problem: Problem, one: str, other: str) -> bool:
    """Whether two places can show in the same torque: equal, the base, or not two different joints."""
    return one == other or not {one, other} <= set(problem.joints)


def _weighed(term: Term, fits: Sequence[Fitted]) -> Weighed:
    logs = np.array([0.0, *(evidence for _, _, evidence in fits)])
    odds = np.exp(np.clip(logs - logs.max(), -700, 0))
    probability = odds[1:] / odds.sum()
    alternatives = tuple((t, float(p)) for (_, t, _), p in zip(fits[1:], probability[1:]))
    return Weighed(term, float(probability[0]), alternatives)


def findings_of(
    model: FinalModel,
    weighed: Sequence[Weighed],
    gains: dict[tuple[str, str], float],
) -> tuple[Finding, ...]:
    """Findings with intervals and alternatives, in the order in which they were named."""
    found = []
    for item in weighed:
        term = item.term
        blind = set(blind_parameters(model.explanation, term, told=True))
        rivals = [(t, p) for t, p in item.alternatives if p >= AMBIGUOUS]
        found.append(
            Finding(
                effect=term.effect.id,
                location=term.at,
                probability=item.probability,
                parameters={k: v for k, v in model.estimates(term).items() if k not in blind},
                ambiguous_with=tuple(t.label for t, _ in rivals),
                alternatives=tuple(
                    Alternative(t.effect.id, t.at, p, _why_not(item, t, p)) for t, p in item.alternatives
                ),
                validation_improvement=gains.get(term.key, 0.0),
                note=_as_described(model.robot, term),
            )
        )
    return tuple(found)


def _as_described(robot: Robot, term: Term) -> str:
    """What the robot file says of an effect whose numbers are wrong; empty when it lacks the effect."""
    for use in robot.effects:
        if (use.effect, use.at) == term.key:
            stated = ", ".join(
                f"{name.replace('_', ' ')} {value:.4g} {term.unit(robot, term.effect.parameter(name))}"
                for name, value in use.parameters.items()
            )
            return f"The robot file has it already, with {stated}."
    return ""


def ruled_out(left: float, own: float) -> str:
    """Why a rival was not chosen that leaves more in runs in closed loop than the finding does [parts]."""
    return f"run in closed loop it leaves {percent(left)} of the mismatch, and the finding {percent(own)}"


def _why_not(item: Weighed, term: Term, chance: float) -> str:
    if chance >= AMBIGUOUS:
        return "cannot be told apart with these data"
    own, left = item.left.get(item.term.key), item.left.get(term.key)
    if own is not None and left is not None and left > own:
        return ruled_out(left, own)
    odds = item.probability / max(chance, 1e-12)
    return f"the data favour the finding {odds:.3g} to 1" if odds < 1e9 else "does not fit the data"


def beyond_noise(mismatch: Sequence[Mismatch]) -> tuple[Mismatch, ...]:
    """Those that noise alone would hardly leave."""
    return tuple(item for item in mismatch if item.p_value < FALSE_ALARM / max(len(mismatch), 1))


def verdict_of(
    findings: Sequence[Finding], mismatch: Sequence[Mismatch], *, explained_part: float
) -> Verdict:
    """The verdict; `explained_part` is the share of the held-out mismatch energy that the findings remove."""
    real = bool(beyond_noise(mismatch))
    if not findings:
        return "unexplained" if real else "consistent"
    if explained_part < EXPLAINED_PART and real:
        return "unexplained"
    return verdict_on_names(findings)


def verdict_on_names(findings: Sequence[Finding]) -> Verdict:
    """The verdict where something was named and it explains what differs.

    Where a finding is less than sure and no rival is listed, it is because something without a name is there
    beside it: nothing that could be told apart.
    """
    return "ambiguous" if any(f.ambiguous_with for f in findings) else "explained"
