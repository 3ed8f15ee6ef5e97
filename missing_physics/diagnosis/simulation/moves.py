"""What a ladder in simulation may try next: neighbours of the effects that are there, and nominal numbers."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from missing_physics.diagnosis.candidates.effects import OF_THE_NOMINAL, candidates
from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.naming.judge import can_look_like
from missing_physics.diagnosis.terms.term import Term
from missing_physics.diagnosis.written.augment import augmented_robot
from missing_physics.results.result import Rung
from reference_model.effects.base import JointEffect
from reference_model.effects.catalogue import catalogue, used_effects
from robot_model import Robot

__all__ = ["Move", "moves_from", "terms_of"]

#: Friction laws tried at every joint that differs: what free runs feel most.
FRICTION = ("viscous_friction", "coulomb_friction", "load_dependent_friction", "stribeck_friction")
#: An amplitude starts at this part of what would explain everything, so that no effect is given away.
SMALL = 0.1


@dataclass(frozen=True)
class Move:
    """A robot with an effect added, or put in the place of another.

    Attributes:
        term: what enters, at its start.
        replaces: what leaves.
        robot: with the change.
    """

    term: Term
    replaces: Term | None
    robot: Robot


def terms_of(robot: Robot, known: Sequence[Term]) -> tuple[Term, ...]:
    """The effects of a robot as terms; bounds, and what is nominal, as in `known`."""
    before = {term.key: term for term in known}
    found = []
    for used in used_effects(robot):
        own = before.get((used.effect.id, used.at), Term(used.effect, used.at))
        found.append(replace(own, parameters={k: float(v) for k, v in used.parameters.items()}))
    return tuple(found)


def moves_from(
    robot: Robot,
    terms: Sequence[Term],
    problem: Problem,
    best: Explanation,
    ladder: Sequence[Rung],
    joints: Collection[str],
) -> Iterator[Move]:
    """Every change by one effect.

    Args:
        robot: where the ladder stands.
        terms: its effects.
        problem, best: of the regression, which lend starting values.
        ladder: what the regression tried: what had evidence for it is tried again.
        joints: where something differs.
    """
    close = {(r.effect, r.location) for r in ladder if r.evidence > 0 and not r.kept}
    here = replace(best, terms=tuple(terms))
    for option in _each_once(problem, here, _neighbours(terms) | {effect for effect, _ in close}):
        term, replaces = option
        effect = term.effect
        if not isinstance(effect, JointEffect) or effect.is_event or term.at not in joints:
            continue
        if replaces is not None and replaces.nominal:
            continue
        near = effect.id in FRICTION or term.key in close or effect.id in _neighbours(terms, term.at)
        if not near:
            continue
        yield Move(term, replaces, _changed(robot, terms, term, replaces))
        for other in terms:
            rival = other.at == term.at and not other.nominal and replaces is None
            if rival and other.effect.id != effect.id and effect.id in can_look_like(other.effect):
                yield Move(term, other, _changed(robot, terms, term, other))


def _neighbours(terms: Sequence[Term], at: str | None = None) -> set[str]:
    found = set(FRICTION)
    for term in terms:
        if not term.nominal and at in (None, term.at):
            found |= can_look_like(term.effect)
    return found - OF_THE_NOMINAL


def _each_once(
    problem: Problem, here: Explanation, among: Collection[str]
) -> Iterator[tuple[Term, Term | None]]:
    """The first start of each candidate, its amplitudes small."""
    seen: set[tuple[str, str]] = set()
    for option in candidates(problem, here, among=set(among) & set(catalogue())):
        if option.term.key in seen:
            continue
        seen.add(option.term.key)
        yield replace(option.term, parameters=_small(option.term)), option.replaces


def _small(term: Term) -> Mapping[str, float]:
    values = dict(term.parameters)
    for p in term.effect.estimated:
        if p.linear and p.absent is not None:
            values[p.name] = p.absent + SMALL * (values[p.name] - p.absent)
    return values


def _changed(robot: Robot, terms: Sequence[Term], term: Term, replaces: Term | None) -> Robot:
    kept = [t for t in terms if replaces is None or t.key != replaces.key]
    return augmented_robot(robot, [*kept, term])
