"""What runs in closed loop say of what was named: which of its rivals, and whether it at all.

A law that fits the recorded torques along the recorded motion, and would not have brought about this motion
under the robot's controller, is not what is there. So rivals are run along the references of all recordings,
fitted and held out, and each channel's error is held against the sensor's noise; see `replay`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.naming.judge import Weighed
from missing_physics.diagnosis.naming.search import Progress
from missing_physics.diagnosis.replay.replay import Replay, runs_tell
from missing_physics.diagnosis.runs.doubt import (
    FAR_OFF,
    SAY_NOTHING,
    Leftover,
    leftovers,
    moved_by_numbers,
    spreads_of,
)
from missing_physics.diagnosis.runs.energies import (
    CONFIRMED,
    Build,
    down_to_noise,
    evidence_for,
    left_in_runs,
    run_of,
    runs_of,
    told_apart,
)
from missing_physics.diagnosis.runs.rivals import REGRESSION, RUN, RUN_QUICK, rivals, without_beaten
from missing_physics.diagnosis.terms.real_bodies import UNREAL
from missing_physics.diagnosis.terms.term import Term
from missing_physics.diagnosis.written import words
from missing_physics.diagnosis.written.augment import with_findings
from missing_physics.results.result import Diagnosis, Finding, Result, Verdict
from reference_model.effects.base import GearEffect
from reference_model.effects.catalogue import get_effect
from robot_model import InputError, Robot, robot_from_toml

__all__ = ["EXCHANGE", "REGRESSION", "arbitrated", "confirmed", "refused_in_runs"]

Array = NDArray[np.float64]
#: Evidence that an exchange must bring.
EXCHANGE = 1.0
#: Names are half believed where runs with them leave this part of what differs, and hardly at all beyond: of
#: drawn robots, right names leave up to a twentieth, and of real machines the best models leave some.
HALF_BELIEVED, STEEP = 0.1, 4
#: And where runs leave this part of a channel of which they explain most, far beyond its noise: of drawn
#: robots the one right law that left so much left 0.01 % (26146), wrong ones 4.1 and 6.2 % (26108, 26130).
HALF_LEFT = 0.02
#: What runs believe less is no name.
LEAST_BELIEF = 0.1
#: Least probability of a name that runs speak against; more cannot be said without one in its place.
LEAST = 0.05
#: What is said of names that runs refuse or doubt.
ELSE = "something else is there, or another controller was in force"


def arbitrated(
    replay: Replay | None,
    best: Explanation,
    weighed: Sequence[Weighed],
    build: Build,
    *,
    nuisance: bool,
    progress: Progress,
    fewest: int = 1,
) -> tuple[Explanation, tuple[Weighed, ...], tuple[tuple[Term, str], ...]]:
    """`best` and its rivals by their runs; one that runs clearly better takes the finding's place.

    Only what all recordings say alike counts that either does not run down to the noise, and of two only for
    one that leaves little of what differs: where none does, another controller may have been in force.

    Args:
        replay: runs along all recordings; None where that is not possible: nothing changes then.
        build: the robot of an explanation; None where its numbers are not those of a real one.
        fewest: names that stay whether runs need them or not.

    Returns:
        The explanation; its names; and those that no run needs, with the reason.
    """
    if replay is None or not best.found:
        return best, tuple(weighed), ()
    done: list[Weighed] = []
    for item in weighed:
        if item.term.key not in {t.key for t in best.terms}:
            done.append(item)
            continue
        own, mine = run_of(replay, best, build)
        mine = mine if build(own) else runs_of(replay, replay.robot)  # what cannot be explains nothing
        if mine is None:
            done.append(item)
            continue
        progress(f"running rivals of {item.term.label} in closed loop")
        left = left_in_runs(replay, mine)
        lefts = {item.term.key: left}
        said: list[tuple[Term, float, Explanation]] = []
        most = RUN if replay.costly else RUN_QUICK
        near = left is not None and left <= CONFIRMED
        impossible: set[tuple[str, str]] = set()
        for key, odds, trial in rivals(best, item, left, mine, nuisance=nuisance, most=most):
            trial, theirs = run_of(replay, trial, build)
            robot = build(trial)
            if robot is None or (theirs is None and near and runs_tell(robot)):
                impossible.add(key)
            if theirs is None:
                continue
            evidence = evidence_for(mine, theirs)
            lefts[key] = left_in_runs(replay, theirs)
            better = lefts[key] if evidence > 0 else left
            if better is None or better > CONFIRMED:
                continue
            fresh = next(t for t in trial.terms if t.key == key)
            far = told_apart(replay, mine, theirs, len(fresh.free) - len(item.term.free))
            said.append((fresh, float(np.clip(odds, -far, far)) + evidence, trial))
        item, best = _settled(item, best, said)
        [item] = without_beaten([item], impossible)  # nor can it move as recorded
        told = {term.key for term, _, _ in said} | {item.term.key}
        known = {key: part for key, part in lefts.items() if part is not None and key in told}
        done.append(replace(item, left=known))
    free = nuisance and best.nuisance.size > 0
    return _spared(replay, best, done, build, nuisance=free, progress=progress, fewest=fewest)


def _spared(
    replay: Replay,
    best: Explanation,
    weighed: Sequence[Weighed],
    build: Build,
    *,
    nuisance: bool,
    progress: Progress,
    fewest: int,
) -> tuple[Explanation, tuple[Weighed, ...], tuple[tuple[Term, str], ...]]:
    """`best` without names that no run needs, the least probable first, and why they went.

    Without such a name, all other numbers estimated anew, the robot does what was recorded down to the noise
    in every octave of every channel (`reproduction`); or it comes so much closer to it, in every recording,
    that a rival in the name's place would have won.
    """
    gone: list[tuple[Term, str]] = []
    for item in sorted(weighed, key=lambda item: item.probability):
        if len(best.found) <= fewest:
            break
        if item.term.key not in {t.key for t in best.found}:
            continue
        progress(f"running the robot without {item.term.label} in closed loop")
        others = [term.released for term in best.terms_without(item.term)]
        without = explain(best.problem, best.view, others, nuisance=nuisance)
        robot = build(without)
        if robot is None:
            continue
        needless = down_to_noise(replay, robot)
        if not needless and not _hinders(replay, build(best), robot):
            continue
        best = without
        gone.append((item.term, words.NO_RUN_NEEDS if needless else words.HINDERS_RUNS))
    names = {term.key for term, _ in gone}
    kept = [w for w in weighed if w.term.key not in names]
    mine = runs_of(replay, build(best))
    if mine is not None and (left_in_runs(replay, mine) or 0.0) <= CONFIRMED:
        kept = [_against_nothing(replay, best, item, mine, build, nuisance=nuisance) for item in kept]
    return best, tuple(kept), tuple(gone)


def _against_nothing(
    replay: Replay, best: Explanation, item: Weighed, mine: Sequence[Array], build: Build, *, nuisance: bool
) -> Weighed:
    """What runs say against nothing in a name's place, where they speak for all that is named.

    A regression along a noisy motion may be unsure of what runs show to be there.
    """
    nothing = 1.0 - item.probability - sum(p for _, p in item.alternatives)
    if nothing <= 0.0 or item.probability <= 0.0:
        return item
    others = [term.released for term in best.terms_without(item.term)]
    without = [build(explain(best.problem, best.view, others, nuisance=nuisance))]
    if len(best.found) == 1:
        without.append(replay.robot)
    runs = [found for found in (runs_of(replay, robot) for robot in without) if found is not None]
    evidence = min((evidence_for(found, mine) for found in runs), default=0.0)
    if evidence <= 0.0:
        return item
    odds = float(np.clip(np.log(nothing / item.probability), -REGRESSION, REGRESSION)) - evidence
    whole = 1.0 - nothing + item.probability * float(np.exp(odds))
    rivals_left = tuple((term, p / whole) for term, p in item.alternatives)
    return replace(item, probability=item.probability / whole, alternatives=rivals_left)


def _hinders(replay: Replay, with_it: Robot | None, without: Robot) -> bool:
    """Whether runs say more for nothing in a name's place than a regression can say against it.

    As there are many channels, of which one error moves several, half of what is left has to go as well.
    """
    mine, theirs = runs_of(replay, with_it), runs_of(replay, without)
    own, left = left_in_runs(replay, mine), left_in_runs(replay, theirs)
    if mine is None or theirs is None or own is None or left is None or left > min(CONFIRMED, own / 2):
        return False
    return evidence_for(mine, theirs) > REGRESSION + EXCHANGE


def _settled(
    item: Weighed, best: Explanation, said: Sequence[tuple[Term, float, Explanation]]
) -> tuple[Weighed, Explanation]:
    """New probabilities, and an exchange where a rival is likelier than the finding."""
    if not said:
        return item, best
    heard = {term.key for term, _, _ in said}
    rest = [(term, p) for term, p in item.alternatives if term.key not in heard]
    whole = item.probability + sum(p for _, p in item.alternatives)
    weights = [(item.term, 1.0), *((t, float(np.exp(np.clip(o, -700, 700)))) for t, o, _ in said)]
    most = np.exp(REGRESSION)
    weights += [(t, min(p / max(item.probability, 1e-300), most)) for t, p in rest]
    total = sum(w for _, w in weights)
    shares = [(t, whole * w / total) for t, w in weights]
    top = max(range(len(said) + 1), key=lambda k: weights[k][1])
    top = top if weights[top][1] > np.exp(EXCHANGE) else 0
    chosen, probability = shares[top]
    others = tuple(pair for k, pair in enumerate(shares) if k != top)
    if top == 0:
        return Weighed(item.term, probability, others), best
    return Weighed(chosen, probability, others), said[top - 1][2]


def refused_in_runs(replay: Replay | None, best: Explanation, build: Build) -> str:
    """Why runs believe nothing of what `best` names; empty where they may.

    The nearest that a catalogue has to physics outside it fits the recorded torques somewhat, and moves the
    robot otherwise.
    """
    if replay is None or not best.found:
        return ""
    best, energies = run_of(replay, best, build)
    left = left_in_runs(replay, energies, lenient=True, exact=False)
    robot = build(best)
    if robot is None:
        return UNREAL
    if left is not None and _belief(left) < LEAST_BELIEF and left <= FAR_OFF:
        moved = moved_by_numbers(replay, robot, {t.key: spreads_of(best.intervals(t)) for t in best.found})
        left = left_in_runs(replay, energies, lenient=True, exact=False, moved=moved)
    if left is not None and _belief(left) < LEAST_BELIEF:
        return f"{_leaves(left)}: {ELSE}"
    if len(best.found) > 1 or energies is None:
        return ""
    before = runs_of(replay, replay.robot)
    if before is None or not leftovers(replay, energies, before):
        return ""
    moved = moved_by_numbers(replay, robot, {t.key: spreads_of(best.intervals(t)) for t in best.found})
    doubts = leftovers(replay, energies, before, moved)
    return next((f"{d.words}: {ELSE}" for d in doubts if _law_belief(d) < LEAST_BELIEF), "")


def _belief(left: float) -> float:
    """How far names are believed with which runs leave this part of what differs."""
    return 1.0 / (1.0 + (left / HALF_BELIEVED) ** STEEP)


def _law_belief(left: Leftover) -> float:
    """How far a law is believed with which runs leave this of a channel."""
    return 1.0 / (1.0 + (left.part / HALF_LEFT) ** STEEP)


def _leaves(left: float) -> str:
    return (
        "run in closed loop along the recorded references, the robot with everything named leaves "
        f"{left:.1%} of the squared error of the robot as described (geometric mean over channels)"
    )


def confirmed(result: Result, robot: Robot, replay: Replay | None) -> Result:
    """`result` with names as probable as runs with all of them allow, and a sentence on what these leave.

    Args:
        robot: as the user described it.
        replay: runs along all recordings; None where that is not possible: nothing changes then.
    """
    told = result.diagnosis
    if replay is None or not told.findings or not result.real:
        return result
    replay = _with_free_zeros(replay, told.findings)
    try:
        whole = with_findings(robot_from_toml(result.augmented_robot_toml), told.findings)
        runs, before = runs_of(replay, whole), runs_of(replay, robot)
        left = left_in_runs(replay, runs, before, lenient=True, exact=False)
        doubted = left is not None and HALF_BELIEVED < left <= FAR_OFF
        if doubted:
            moved = moved_by_numbers(replay, whole, _spreads(told))
            left = left_in_runs(replay, runs, before, lenient=True, exact=False, moved=moved)
    except InputError:
        return result
    doubts = () if runs is None or before is None else leftovers(replay, runs, before)
    if doubts and runs is not None and before is not None:
        doubts = leftovers(replay, runs, before, moved_by_numbers(replay, whole, _spreads(told)))
    if left is None:
        unsure = replace(told, notes=(*told.notes, SAY_NOTHING)) if doubted else told
        return replace(result, diagnosis=unsure)
    laws = {doubt.channel.split(".")[0]: _law_belief(doubt) for doubt in doubts}
    findings = tuple(
        _less_sure(f, _belief(left) * laws.get(f.location.split(".")[0], 1.0)) for f in told.findings
    )
    doubted = min(laws.values(), default=1.0) <= 0.5
    words_of_it = _leaves(left)
    if doubted and left <= HALF_BELIEVED:
        words_of_it = max(doubts, key=lambda doubt: doubt.part).words
    if left <= HALF_BELIEVED and not doubted:
        diagnosis = replace(told, findings=findings, notes=(*told.notes, words_of_it))
    else:
        told_so = words_of_it[0].upper() + words_of_it[1:]
        why = f"{told_so}: {ELSE}."
        verdict: Verdict = "unexplained" if told.verdict in ("explained", "ambiguous") else told.verdict
        diagnosis = replace(
            told,
            findings=findings,
            verdict=verdict,
            summary=words.summary(robot, verdict, told.mismatch, findings, told.fit, told.unnamed),
            could_not_tell=(*told.could_not_tell, why),
        )
        result = replace(result, doubted=True)
    return replace(result, diagnosis=diagnosis)


def _with_free_zeros(replay: Replay, findings: Sequence[Finding]) -> Replay:
    """Runs that leave zeros of encoders free where a gear was found to give.

    Play under a load of one sign and a zero look the same, and a name left the zero free when it was fitted.
    """
    gears = {f.location for f in findings if isinstance(get_effect(f.effect), GearEffect)}
    both = {f"{joint}.{kind}" for joint in gears for kind in ("position", "motor_position")}
    return replay.about_means(both) if both & set(replay.channels) else replay


def _spreads(told: Diagnosis) -> dict[tuple[str, str], dict[str, float]]:
    """Standard deviations of the numbers of all names."""
    return {
        (f.effect, f.location): spreads_of({name: e.ci95 for name, e in f.parameters.items()})
        for f in told.findings
    }


def _less_sure(finding: Finding, belief: float) -> Finding:
    belief = max(belief, min(LEAST / max(finding.probability, 1e-300), 1.0))
    return replace(
        finding,
        probability=finding.probability * belief,
        alternatives=tuple(replace(a, probability=a.probability * belief) for a in finding.alternatives),
    )
