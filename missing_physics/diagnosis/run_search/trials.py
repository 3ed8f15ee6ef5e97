"""What a search by runs tries: each effect at each place, with the numbers a fit goes from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from missing_physics.diagnosis.candidates.effects import Sight, candidates, first_look
from missing_physics.diagnosis.candidates.fitted import refit
from missing_physics.diagnosis.candidates.mounts import no_mount, usual_mount
from missing_physics.diagnosis.candidates.structural import no_modes
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.runs.numbers import MOST_NUMBERS, in_runs
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.base import JointEffect, SensorEffect
from reference_model.effects.catalogue import catalogue, get_effect

__all__ = ["trials"]

#: Part of its typical size that a number has at least from which a fit starts.
FELT = 0.1
#: Part of its usual size that an amplitude has from which a fit of a cycle or an encoder's error starts: of a
#: greater one with the wrong phase a cycle that is a little off leaves much, and a joint would begin far off.
SMALL = 0.01
#: Period of the first mode of a link from which its fit starts [s]: a stiff one moves the robot little.
STIFF = 0.05


def trials(
    start: Explanation, sights: Mapping[str, Sight], *, structures: bool
) -> Iterator[tuple[Explanation, Term]]:
    """Each effect at each place with the numbers a fit goes from, most promising ones first."""
    problem, nuisance = start.problem, start.nuisance.size > 0
    options = list(candidates(problem, start, nominal_numbers=True, bristles=True, alike=()))
    for term in _structures(start) if structures else ():
        trial = explain(problem, start.view, [*start.terms, term], nuisance=nuisance)
        yield trial, term.released
    for seen in _seen(start, sights):
        yield explain(problem, start.view, [*start.terms, seen], nuisance=nuisance), seen.released
    for look in first_look(problem, start.view, start, options):
        own = look.candidate.term
        if look.evidence <= 0 and isinstance(own.effect, SensorEffect) and own.at.endswith(".position"):
            # A torque hardly tells an encoder's error: what it makes of it may be no place of the joint.
            trial = explain(problem, start.view, [*start.terms, _next_to_nothing(own)], nuisance=nuisance)
        else:
            trial = refit(problem, start.view, start, look.candidate, nuisance=nuisance)
        term = _with_amplitudes(next(t for t in trial.terms if t.key == look.candidate.term.key))
        if 0 < len(in_runs(term).free) <= MOST_NUMBERS:
            yield trial, _felt(term.released)


def _with_amplitudes(term: Term) -> Term:
    """At a joint with all amplitudes: a regression leaves out those that its noise, or tuned masses, hide."""
    if not isinstance(term.effect, JointEffect):
        return term
    linear = {p.name for p in term.effect.estimated if p.linear}
    return replace(term, unseen=tuple(name for name in term.unseen if name not in linear))


def _felt(term: Term) -> Term:
    """With no time constant and the like so short that steps have to follow it and nothing shows it."""
    least = {
        p.name: FELT * p.typical
        for p in term.estimated
        if not p.linear and p.absent == 0.0 and abs(term.parameters[p.name]) < FELT * p.typical
    }
    return replace(term, parameters={**term.parameters, **least}) if least else term


def _seen(start: Explanation, sights: Mapping[str, Sight]) -> Iterator[Term]:
    """Effects that begin and end, and those with a cycle, when and in which positions differ."""
    effects = [e for e in catalogue().values() if e.is_event or "order" in {p.name for p in e.estimated}]
    for option in candidates(start.problem, start, among={e.id for e in effects}, sights=sights):
        sight, values = sights.get(option.term.at.split(".")[0]), option.term.parameters
        if sight is None or option.replaces is not None:
            continue
        term = option.term
        if not term.effect.is_event and values["order"] not in sight.orders:
            continue
        # as good as no amplitude, of which the phase is as good as any
        term = term if term.effect.is_event else _next_to_nothing(term)
        yield replace(term, held={p.name: abs(values[p.name]) for p in term.estimated if not p.linear})


def _next_to_nothing(term: Term) -> Term:
    """With amplitudes from which a fit is led the right way; a regression does not move its numbers."""
    small = {p.name: SMALL * term.parameters[p.name] for p in term.estimated if p.linear}
    return replace(
        term,
        parameters={**term.parameters, **small},
        held={p.name: abs(term.parameters[p.name]) for p in term.estimated},
    )


def _structures(start: Explanation) -> Iterator[Term]:
    """A stiff mount of the base, and stiff links, of robots that are described without."""
    problem = start.problem
    robot, hidden = problem.robot, [segment.hidden for segment in problem.segments]
    present = {term.key for term in start.terms}
    flexibility, mount = get_effect("link_flexibility"), get_effect("base_motion")
    places = [] if no_modes(robot) else [link.name for link in robot.links if link.name not in robot.known]
    for effect, at in (*((flexibility, name) for name in places), (mount, "base")):
        if (effect.id, at) in present or (effect is mount and no_mount(robot)):
            continue
        if any(own.modes(effect.id, at) is None for own in hidden):
            continue
        if effect is mount:
            values, narrowed = usual_mount(problem)
        else:
            values, narrowed = {**effect.defaults(), "period": STIFF}, {}
        beside = tuple(p for own in hidden for p in own.starts(effect.id, at))
        values = {**values, **{p.name: 0.0 for p in beside}}
        held = {p.name: abs(values[p.name]) for p in effect.estimated}
        yield Term(effect, at, values, narrowed=narrowed, beside=beside, held=held)
