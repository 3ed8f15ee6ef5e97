"""Step 5 of the chain, in simulation: a small ladder of robots refitted until their free runs follow.

It starts from what the regression found and climbs one change at a time: all numbers refined, an effect
added or exchanged for one that looks like it, numbers of the nominal robot freed. A change is kept when

* on the fitted recordings its evidence (a difference of Bayesian information criteria with effective samples)
  beats the number of changes tried,
* its parameters differ from "absent", make sense and lie inside their bounds,
* on recordings that were not fitted the free runs' error falls by more than chance (block bootstrap),
* and, where the torque was measured, the regression with this effect in it does not contradict.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from missing_physics.diagnosis.explanation import Explanation
from missing_physics.diagnosis.naming import ODDS
from missing_physics.diagnosis.problem import Problem
from missing_physics.diagnosis.result import Rung
from missing_physics.diagnosis.simulation_fit import Bench, Reached
from missing_physics.diagnosis.simulation_moves import Move, moves_from, terms_of
from missing_physics.diagnosis.statistics import paired_block_p_value
from missing_physics.diagnosis.terms import Term
from robot_model import InputError, Robot

__all__ = ["NUMBERS", "Climb", "Entry", "climb"]

#: Largest chance of a gain on the deciding part.
SIGNIFICANCE = 0.05
#: Changes of a round that are fitted in full, by what a linearised fit promises.
FITTED = 4
#: and of one nominal number each.
NUMBERS_FITTED = 2
#: Rounds at most.
MOST_ROUNDS = 8
#: Stands in the ladder for numbers of the nominal robot.
NUMBERS = "nominal_numbers"

#: Why the regression contradicts a term with these parameters; empty when it does not.
Objection = Callable[[Term], str]


@dataclass(frozen=True)
class Entry:
    """An effect that the ladder let in.

    Attributes:
        term: as it entered.
        replaces: what left for it.
        evidence: over the robot before.
        p_value: on the deciding part.
        rivals: other effects fitted in its place at the same joint, with their evidence.
        error_before, error_after: rms position errors on the deciding part, in units of the scale.
    """

    term: Term
    replaces: Term | None
    evidence: float
    p_value: float
    rivals: tuple[tuple[Term, float], ...]
    error_before: float
    error_after: float


@dataclass
class Climb:
    """What happened.

    Attributes:
        start: the robot as the regression left it.
        reached: where the ladder ended; `start` when nothing was kept.
        rungs: everything that was tried.
        entries: effects that came in.
        kept: robots that were kept, in order, with what each brought.
        exhausted: whether it ended because the work allowed was done.
    """

    start: Reached
    reached: Reached
    rungs: list[Rung]
    entries: list[Entry]
    kept: list[tuple[str, Reached]]
    exhausted: bool = False


def climb(
    bench: Bench,
    robot: Robot,
    problem: Problem,
    best: Explanation,
    ladder: Sequence[Rung],
    *,
    joints: Collection[str],
    objection: Objection,
) -> Climb:
    """Climb from `robot`, which is the regression's explanation `best` as a robot."""
    start = bench.reached(robot)
    state = Climb(start, start, [], [], [])
    known = list(best.terms)
    effects = _free(start, best.terms)
    if effects:
        refined = bench.fitted(robot, effects, "refining what was found")
        _judge_numbers(bench, state, refined, "", 1)
    for _ in range(MOST_ROUNDS):
        if bench.exhausted:
            state.exhausted = True
            break
        if not _round(bench, state, known, problem, best, ladder, joints, objection):
            break
    return state


def _round(
    bench: Bench,
    state: Climb,
    known: list[Term],
    problem: Problem,
    best: Explanation,
    ladder: Sequence[Rung],
    joints: Collection[str],
    objection: Objection,
) -> bool:
    """One change at most; whether there was one."""
    here = state.reached
    terms = terms_of(here.robot, known)
    moves = list(moves_from(here.robot, terms, problem, best, ladder, joints))
    bench.progress(f"weighing {len(moves)} changes in simulation")
    promises = [(bench.promise(m.robot, _free(here, terms, m)), k) for k, m in enumerate(moves)]
    tried: list[tuple[float, Reached, Move]] = []
    for promised, k in sorted(promises)[:FITTED]:
        if not np.isfinite(promised):
            continue
        move = moves[k]
        try:
            trial = bench.fitted(move.robot, _free(here, terms, move), f"trying {move.term.label} in simulation")
        except InputError:
            continue
        tried.append((trial.evidence_over(here), trial, move))
    tried.sort(key=lambda item: -item[0])
    changed = False
    for evidence, trial, move in tried:
        why, p_value = _refusal(here, trial, move, evidence, len(moves), objection)
        state.rungs.append(_rung(bench, here, trial, move.term.effect.id, move.term.at, evidence, why))
        if why:
            continue
        rivals = tuple((m.term, e) for e, _, m in tried if m.term.at == move.term.at and m is not move)
        errors = [float(np.sqrt(np.mean(r.blocks))) for r in (here, trial)]
        fresh = next(t for t in terms_of(trial.robot, [move.term]) if t.key == move.term.key)
        state.entries.append(Entry(fresh, move.replaces, evidence, p_value, rivals, *errors))
        state.reached, changed = trial, True
        state.kept.append((move.term.label, trial))
        known.append(move.term)
        break
    return changed or _free_number(bench, state, known)


def _free_number(bench: Bench, state: Climb, known: Sequence[Term]) -> bool:
    """Free one more number of the nominal robot that the runs can tell; whether that was kept."""
    here = state.reached
    free = _free(here, terms_of(here.robot, known))
    more = bench.nominal_names(here.robot, free)
    promises = sorted((bench.promise(here.robot, (*free, name)), k) for k, name in enumerate(more))
    for promised, k in promises[:NUMBERS_FITTED]:
        if not np.isfinite(promised):
            continue
        try:
            trial = bench.fitted(here.robot, (*free, more[k]), f"freeing {more[k]} in simulation")
        except InputError:
            continue
        if _judge_numbers(bench, state, trial, more[k], len(more)):
            return True
    return False


def _free(here: Reached, terms: Sequence[Term], move: Move | None = None) -> tuple[str, ...]:
    """Numbers to refine: of all effects that the nominal robot lacks, and what was freed before."""
    moved = [move.term] if move else []
    gone = move.replaces.key if move and move.replaces else None
    own = [t for t in terms if not t.nominal and not t.effect.is_event and t.key != gone]
    names = [f"{t.label}.{name}" for t in (*own, *moved) for name in t.free]
    return (*names, *(name for name in here.free if "@" not in name))


def _judge_numbers(bench: Bench, state: Climb, trial: Reached, freed: str, tried: int) -> bool:
    """Keep a robot with other numbers and the same effects if it is better."""
    here = state.reached
    evidence = trial.evidence_over(here)
    why = _weak(evidence, tried) or _bounds(trial)
    if not why:
        why, _ = _unconfirmed(here, trial)
    what = f"{freed} freed" if freed else "all numbers of the effects refined"
    rung = _rung(bench, here, trial, NUMBERS, freed or trial.robot.name, evidence, why)
    state.rungs.append(replace(rung, why=f"{what}, {rung.why}"))
    if why:
        return False
    state.reached = trial
    state.kept.append((freed or NUMBERS, trial))
    return True


def _weak(evidence: float, tried: int) -> str:
    needed = float(np.log(ODDS * tried))
    return "" if evidence >= needed else f"evidence {evidence:.1f} is below the {needed:.1f} needed"


def _bounds(trial: Reached) -> str:
    if not trial.at_bound:
        return ""
    return f"{', '.join(trial.at_bound)} would have to go to the bound of what is credible"


def _unconfirmed(here: Reached, trial: Reached) -> tuple[str, float]:
    p_value = paired_block_p_value(here.blocks, trial.blocks)
    if p_value <= SIGNIFICANCE:
        return "", p_value
    return f"does not lower the error of free runs that were not fitted (p = {p_value:.2g})", p_value


def _refusal(
    here: Reached, trial: Reached, move: Move, evidence: float, tried: int, objection: Objection
) -> tuple[str, float]:
    """Why a change of effects is not kept, empty when it is; and the chance of its gain."""
    term = next(t for t in terms_of(trial.robot, [move.term]) if t.key == move.term.key)
    why = _weak(evidence, tried) or _bounds(trial)
    if not why and not _present(trial, term):
        why = "its parameters do not differ from absent"
    why = why or term.effect.implausible(term.parameters)
    if why:
        return why, 1.0
    why, p_value = _unconfirmed(here, trial)
    return why or objection(term), p_value


def _present(trial: Reached, term: Term) -> bool:
    for p in term.effect.estimated:
        estimate = trial.estimates.get(f"{term.label}.{p.name}")
        if p.absent is None or estimate is None:
            continue
        if not estimate.ci95[0] <= p.absent <= estimate.ci95[1]:
            return True
    return False


def _rung(
    bench: Bench, here: Reached, trial: Reached, effect: str, at: str, evidence: float, why: str
) -> Rung:
    found = tuple(f"{use.effect}@{use.at}" for use in here.robot.effects)
    errors = np.sqrt(np.mean((trial.rms / bench.scale) ** 2, axis=1))
    return Rung(
        effect=effect,
        location=at,
        added_to=found,
        train_rms=float(errors[0]),
        validation_rms=float(errors[1]),
        evidence=evidence,
        kept=not why,
        why="in simulation: " + (why or "strong evidence, and free runs that were not fitted follow better"),
    )
