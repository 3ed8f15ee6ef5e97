"""Step 5 of the chain, in simulation: a small ladder of robots refitted until their free runs follow.

It starts from what the regression found and climbs one change at a time: all numbers refined, an effect
added or exchanged for one that looks like it, numbers of the nominal robot freed. A change is kept when

* on the fitted recordings its evidence (a difference of Bayesian information criteria with effective samples)
  beats the number of changes tried,
* its parameters differ from "absent", make sense and lie inside their bounds,
* on recordings that were not fitted the free runs' error falls by more than chance (block bootstrap),
* and, where the torque was measured, it shows this effect as well: the regression gains by it and agrees on
  its parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.naming.search import ODDS
from missing_physics.diagnosis.simulation.fit import Bench, Reached, grouped
from missing_physics.diagnosis.simulation.moves import Move, moves_from, terms_of
from missing_physics.diagnosis.statistics.correlated_errors import paired_block_p_value
from missing_physics.diagnosis.terms.term import Term
from missing_physics.results.result import Rung
from robot_model import InputError, Robot

__all__ = ["NUMBERS", "Climb", "Entry", "climb"]

#: Largest chance of a gain on the deciding part.
SIGNIFICANCE = 0.05
#: Changes of a round that are fitted in full, by what a linearised fit promises.
FITTED = 3
#: and those that promise this part of the evidence needed.
WORTH_FITTING = 0.3
#: Rounds at most.
MOST_ROUNDS = 8
#: An interval wider than this many times its value does not tell the number.
VAGUE = 1.0
#: Stands in the ladder for numbers of the nominal robot.
NUMBERS = "nominal_numbers"

#: Numbers of the nominal robot that are freed together.
Names = tuple[str, ...]
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
        _judge_numbers(bench, state, refined, (), float(np.log(ODDS)))
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
    options: list[Move | Names] = list(moves_from(here.robot, terms, problem, best, ladder, joints))
    options += grouped(bench.nominal_names(here.robot, _free(here, terms)))
    bench.progress(f"weighing {len(options)} changes in simulation")
    needed = float(np.log(ODDS * max(len(options), 1)))
    tried: list[tuple[float, Reached, Move | Names]] = []
    for option in _promising(bench, here, terms, options, needed)[:FITTED]:
        trial = _fitted(bench, here, terms, option)
        if trial is not None:
            tried.append((trial.evidence_over(here), trial, option))
    for _, trial, option in sorted(tried, key=lambda item: -item[0]):
        if isinstance(option, tuple):
            kept = _judge_numbers(bench, state, trial, option, needed)
        else:
            rivals = tuple(
                (m.term, e)
                for e, _, m in tried
                if isinstance(m, Move) and m is not option and m.term.at == option.term.at
            )
            kept = _judge_move(bench, state, trial, option, needed, rivals, objection)
            if kept:
                known.append(option.term)
        if kept:
            return True
    return False


def _promising(
    bench: Bench, here: Reached, terms: Sequence[Term], options: Sequence[Move | Names], needed: float
) -> list[Move | Names]:
    """The options by what a linearised fit of them promises, those that promise hardly anything left out."""
    looks = []
    for place, option in enumerate(options):
        robot, free = _of(here, terms, option)
        left = bench.promise(robot, free)
        extra = len(free) - len(here.free)
        evidence = here.promised(left, extra)
        if evidence > WORTH_FITTING * needed:
            looks.append((-evidence, place))
    return [options[place] for _, place in sorted(looks)]


def _of(here: Reached, terms: Sequence[Term], option: Move | Names) -> tuple[Robot, tuple[str, ...]]:
    """The robot of an option, and its free numbers."""
    if isinstance(option, tuple):
        return here.robot, (*_free(here, terms), *option)
    return option.robot, _free(here, terms, option)


def _fitted(bench: Bench, here: Reached, terms: Sequence[Term], option: Move | Names) -> Reached | None:
    """The robot with its numbers refined; None when they are not those of a real robot."""
    words = f"freeing {' and '.join(option)}" if isinstance(option, tuple) else f"trying {option.term.label}"
    try:
        return bench.fitted(*_of(here, terms, option), f"{words} in simulation")
    except InputError:
        return None


def _free(here: Reached, terms: Sequence[Term], move: Move | None = None) -> tuple[str, ...]:
    """Numbers to refine: of all effects that the nominal robot lacks, and what was freed before."""
    moved = [move.term] if move else []
    gone = move.replaces.key if move and move.replaces else None
    own = [t for t in terms if not t.nominal and not t.effect.is_event and t.key != gone]
    names = [f"{t.label}.{name}" for t in (*own, *moved) for name in t.free]
    return (*names, *(name for name in here.free if "@" not in name))


def _judge_move(
    bench: Bench,
    state: Climb,
    trial: Reached,
    move: Move,
    needed: float,
    rivals: tuple[tuple[Term, float], ...],
    objection: Objection,
) -> bool:
    """Keep a robot with another effect if nothing speaks against it."""
    here = state.reached
    evidence = trial.evidence_over(here)
    why, p_value = _refusal(here, trial, move, evidence, needed, objection)
    state.rungs.append(_rung(bench, here, trial, move.term.effect.id, move.term.at, evidence, why))
    if why:
        return False
    errors = [float(np.sqrt(np.mean(r.blocks))) for r in (here, trial)]
    fresh = next(t for t in terms_of(trial.robot, [move.term]) if t.key == move.term.key)
    state.entries.append(Entry(fresh, move.replaces, evidence, p_value, rivals, *errors))
    state.reached = trial
    state.kept.append((move.term.label, trial))
    return True


def _judge_numbers(bench: Bench, state: Climb, trial: Reached, freed: Names, needed: float) -> bool:
    """Keep a robot with other numbers and the same effects if it is better."""
    here = state.reached
    evidence = trial.evidence_over(here)
    why = _weak(evidence, needed) or _bounds(trial)
    if not why:
        why, _ = _unconfirmed(here, trial)
    what = f"{' and '.join(freed)} freed" if freed else "all numbers of the effects refined"
    rung = _rung(bench, here, trial, NUMBERS, freed[0] if freed else trial.robot.name, evidence, why)
    state.rungs.append(replace(rung, why=f"{what}, {rung.why}"))
    if why:
        return False
    state.reached = trial
    state.kept.append((NUMBERS, trial))
    return True


def _weak(evidence: float, needed: float) -> str:
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
    here: Reached, trial: Reached, move: Move, evidence: float, needed: float, objection: Objection
) -> tuple[str, float]:
    """Why a change of effects is not kept, empty when it is; and the chance of its gain."""
    term = next(t for t in terms_of(trial.robot, [move.term]) if t.key == move.term.key)
    why = _weak(evidence, needed) or _bounds(trial)
    if not why and not _present(trial, term):
        why = "its parameters do not differ from absent"
    why = why or _vague(trial, term) or term.effect.implausible(term.parameters)
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


def _vague(trial: Reached, term: Term) -> str:
    """Which number of those that say where or how fast an effect acts is not told; else empty."""
    for p in term.effect.estimated:
        estimate = trial.estimates.get(f"{term.label}.{p.name}")
        if p.absent is not None or p.linear or estimate is None:
            continue
        if estimate.ci95[1] - estimate.ci95[0] > VAGUE * abs(estimate.value):
            return f"free runs do not determine its {p.name.replace('_', ' ')}"
    return ""


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
