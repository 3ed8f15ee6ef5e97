"""Which effects may be added to a hypothesis, and the starting values of their fits."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from missing_physics.hypotheses.extents import FEWEST_CYCLES
from missing_physics.hypotheses.hypothesis import BODIES, TIMING, Hypothesis
from missing_physics.hypotheses.term import Term, offsets_of
from missing_physics.unnamed import CURVES, MEMORIES, driven_by
from reference_model.effects.base import (
    BodyEffect,
    Effect,
    Extent,
    GearEffect,
    JointEffect,
    SensorEffect,
    YieldingGear,
)
from reference_model.effects.body_force import ForceEffect
from reference_model.effects.catalogue import catalogue
from reference_model.effects.structure import StructureEffect
from robot_model import InputError, Robot

__all__ = ["Candidate", "candidates"]

#: Channels known for every joint, recorded or computed.
KNOWN = frozenset({"position", "velocity", "acceleration", "torque"})
#: Starting value of the ratio of static to kinetic friction: a textbook value.
STATIC = 1.3


@dataclass(frozen=True)
class Candidate:
    """A term that may be added to a hypothesis, and what it replaces there.

    Attributes:
        term: the effect with starting values.
        held: parameters of the standard model that it replaces, with their fixed values.
        instead: key of the term that it replaces, such as the lower rung of its family.
        along: parameters of the standard model that must be estimated together with it.
        freed_count: number of parameters of a law in the robot file that it frees; 0 for other terms.
        expected: log score that it gains with its starting values, where that is known [nats].
    """

    term: Term
    held: tuple[tuple[str, float], ...] = ()
    instead: tuple[str, str] | None = None
    along: frozenset[str] = frozenset()
    freed_count: int = 0
    expected: float = -math.inf

    def added_to(self, hypothesis: Hypothesis) -> Hypothesis:
        """The hypothesis with this term."""
        kept = tuple(term for term in hypothesis.terms if term.key != self.instead)
        whole = replace(hypothesis, terms=(*kept, self.term), from_file=hypothesis.from_file - self.along)
        return whole.holding(dict(self.held))


@dataclass(frozen=True)
class Place:
    """Data about a joint from which candidates start.

    Attributes:
        extents: range of each recording at the joint, from which events start.
        coulomb: Coulomb friction in the hypothesis to which candidates are added [N m or N].
        driven: whether an actuator moves it.
        coupled: whether motors move it through a transmission; friction and sensors are then at the motors.
    """

    extents: tuple[Extent, ...]
    coulomb: float
    driven: bool
    coupled: bool = False

    @property
    def whole(self) -> Extent:
        """What all recordings cover together, and the residual where it is largest."""
        lows, highs = zip(*(own.position for own in self.extents))
        return replace(
            max(self.extents, key=lambda own: own.residual),
            position=(min(lows), max(highs)),
            speed=max(own.speed for own in self.extents),
            torque=max(own.torque for own in self.extents),
            peak_torque=max(own.peak_torque for own in self.extents),
            duration=max(own.duration for own in self.extents),
        )


def candidates(
    robot: Robot,
    hypothesis: Hypothesis,
    places: Mapping[str, Place],
    channels: Collection[str],
    given: Sequence[Candidate] = (),
) -> Iterator[Candidate]:
    """All effects that the recordings could show, each with all its sets of starting values.

    Effects on links are candidates where links are flexible and the hypothesis takes the bodies from the
    file; those of rigid links follow from the estimated bodies (`missing_physics.answer.bodies`). Friction
    laws of the robot file are candidates with the file's values where the hypothesis lacks them, and with
    one or all of their parameters estimated where it has them.

    Args:
        robot: nominal.
        hypothesis: the one to which effects are added.
        places: joints whose torque is compared.
        channels: those present in every recording.
        given: effects of the robot file at joints.
    """
    terms = hypothesis.terms
    present = {term.key for term in terms} | {one.term.key for one in given}
    for one in given:
        if one.term.at in places:
            yield from _in_rows(one, terms) if one.term.in_rows else _of_file(one, terms)
    for effect in (*catalogue().values(), *CURVES, *MEMORIES):
        if not effect.is_searched or not effect.estimated:
            continue
        if effect.standard and effect.is_friction_law:
            # The standard model has friction only at motors of transmissions; their joints may have it, too.
            behind = {name: place for name, place in places.items() if place.coupled}
            for joint, place in behind.items():
                yield from _at_joint(effect, joint, place, terms)
        if effect.standard:
            continue
        if isinstance(effect, BodyEffect):
            if effect.place == "base" and (effect.id, "base") not in present and any(robot.gravity):
                yield Candidate(Term.of(effect, "base", {p.name: 0.0 for p in effect.parameters}))
            if effect.place == "link" and robot.flexible_links and BODIES in hypothesis.from_file:
                yield from _at_links(effect, robot, present)
            continue
        if isinstance(effect, StructureEffect):
            if effect.reshapes:
                yield from _reshaping(effect, robot, places, present)
            continue
        if isinstance(effect, ForceEffect):
            if effect.along_base:
                yield from _on_base(effect, robot, places, channels, present)
            continue
        for joint, place in places.items():
            if (effect.place == "actuator" or isinstance(effect, GearEffect)) and not place.driven:
                continue
            if any(q not in KNOWN and f"{joint}.{q}" not in channels for q in effect.needs):
                continue
            if place.coupled and not _applies_behind_motors(effect):
                continue
            if isinstance(effect, JointEffect):
                if (effect.id, joint) not in present:
                    yield from _at_joint(effect, joint, place, terms)
            elif isinstance(effect, SensorEffect):
                yield from _at_sensors(effect, joint, place, channels, present)
            elif _is_behind_only_encoder(effect, joint, channels) and (effect.id, joint) not in present:
                for start in effect.starts(place.whole):
                    yield Candidate(Term.of(effect, joint, _initial(effect, start, place.whole)))
    yield from _between_joints(places, terms)


def _between_joints(places: Mapping[str, Place], terms: Sequence[Term]) -> Iterator[Candidate]:
    """Forces without a name on one joint that depend on the velocity of another one."""
    for joint, place in places.items():
        for other, theirs in places.items():
            coupled = place.coupled or theirs.coupled
            if other != joint and not coupled:
                for effect in driven_by(other):
                    yield from _at_joint(effect, joint, replace(place, extents=theirs.extents), terms)


def _of_file(given: Candidate, terms: Sequence[Term]) -> Iterator[Candidate]:
    """A friction law of the robot file: unchanged, or with further parameters estimated."""
    own = next((term for term in terms if term.key == given.term.key), None)
    if own is None:
        family, here = given.term.effect.family, [t for t in terms if t.at == given.term.at]
        other = next((t.key for t in here if family and t.effect.family == family), None)
        yield replace(given, instead=other)
        return
    names = [p.name for p in own.effect.estimated if p.name not in own.freed]
    for more in [[name] for name in names] + ([names] if len(names) > 1 else []):
        yield Candidate(own.freeing(*more), instead=own.key, freed_count=len(more))


def _in_rows(given: Candidate, terms: Sequence[Term]) -> Iterator[Candidate]:
    """An effect of the robot file already subtracted from the rows, with further parameters estimated."""
    own = next((term for term in terms if term.key == given.term.key), given.term)
    names = [p.name for p in own.effect.estimated if p.linear and p.name not in own.freed]
    for more in [[name] for name in names] + ([names] if len(names) > 1 else []):
        yield Candidate(own.freeing(*more), instead=own.key, freed_count=len(more))


def _is_behind_only_encoder(effect: Effect, joint: str, channels: Collection[str]) -> bool:
    """Whether a gear has only the motor's encoder; two encoders are compared by their difference instead."""
    return isinstance(effect, YieldingGear) and f"{joint}.position" not in channels


def _applies_behind_motors(effect: Effect) -> bool:
    """Whether an effect is tried at joints behind motors, which have friction, sensors and unknown forces."""
    plain = isinstance(effect, JointEffect) and not effect.is_unknown
    return plain and not effect.family and not effect.is_event and not effect.standard


def _at_links(effect: BodyEffect, robot: Robot, present: Collection[tuple[str, str]]) -> Iterator[Candidate]:
    """Candidates at every link: a load at its centre of mass, far end or joints; on a beam at its tip."""
    places = {p.name for p in effect.parameters} >= {"x", "y", "z"}
    for link in robot.links:
        if (effect.id, link.name) in present:
            continue
        if link.beam is not None and places:
            fixed = {axis: (float(v), float(v)) for axis, v in zip("xyz", link.beam.nodes[-1])}
            yield Candidate(Term.of(effect, link.name, {"mass": 0.0}, limits=fixed))
        if link.mass <= 0.0:
            continue
        centre = np.array(link.center_of_mass)
        points = [centre, 2.0 * centre, *(np.array(j.origin) for j in robot.joints if j.parent == link.name)]
        for point in points if places else points[:1]:
            values = {p.name: 0.0 for p in effect.parameters}
            values |= dict(zip("xyz", map(float, point))) if places else {}
            yield Candidate(Term.of(effect, link.name, values))


def _on_base(
    effect: ForceEffect,
    robot: Robot,
    places: Mapping[str, Place],
    channels: Collection[str],
    present: Collection[tuple[str, str]],
) -> Iterator[Candidate]:
    """Candidates on a free base without gyros (gyros: see `missing_physics.diagnosis.base`)."""
    if robot.base.kind != "free" or robot.transmissions or not places or (effect.id, "base") in present:
        return
    if any(channel.startswith("base.angular_velocity") for channel in channels):
        return
    for start in effect.starts(next(iter(places.values())).whole):
        values = {p.name: p.absent for p in effect.parameters if p.linear and p.absent is not None}
        yield Candidate(Term.of(effect, "base", {**values, **start}, limits=effect.limits(robot, "base")))


def _reshaping(
    effect: StructureEffect, robot: Robot, places: Mapping[str, Place], present: Collection[tuple[str, str]]
) -> Iterator[Candidate]:
    """Candidates at every flexible link that can have the effect; effects of the robot file are known."""
    known = {(use.effect, use.at) for use in robot.effects}
    for link in robot.flexible_links:
        if (effect.id, link.name) in {*present, *known} or not places:
            continue
        for start in effect.starts(next(iter(places.values())).whole):
            try:
                effect.changed(robot, link.name, {**effect.defaults(), **start})
            except InputError:
                continue
            yield Candidate(Term.of(effect, link.name, start, limits=effect.limits(robot, link.name)))


def _at_sensors(
    effect: SensorEffect,
    joint: str,
    place: Place,
    channels: Collection[str],
    present: Collection[tuple[str, str]],
) -> Iterator[Candidate]:
    encoder = next(
        (f"{joint}.{q}" for q in ("motor_position", "position") if f"{joint}.{q}" in channels), None
    )
    at = [encoder] if encoder and "position" in effect.searched_in else []
    at += [f"{joint}.torque"] if "torque" in effect.searched_in and f"{joint}.torque" in channels else []
    extent = place.whole
    for channel in at:
        if (effect.id, channel) in present:
            continue
        for start in effect.starts(extent):
            values = _initial(effect, start, extent)
            yield Candidate(Term.of(effect, channel, values, limits=_limits(effect, extent)))


def _at_joint(effect: Effect, joint: str, place: Place, terms: Sequence[Term]) -> Iterator[Candidate]:
    here = [term for term in terms if term.at == joint]
    if any(term.effect.id == effect.id for term in here):
        return
    instead: tuple[str, str] | None = None
    held: tuple[tuple[str, float], ...] = ()
    given: dict[str, float] = {}
    extent = place.whole
    if effect.family:  # a dry friction law includes the kinetic friction of the standard model
        lower = next((t for t in here if t.effect.family == effect.family), None)
        if lower and lower.effect.rung >= effect.rung:
            return
        least = 1e-3 * extent.torque
        level = max(place.coulomb, least)
        given = {"coulomb_torque": level, "static_torque": STATIC * level}
        given |= {} if lower is None else dict(lower.parameters)
        given["coulomb_torque"] = max(given["coulomb_torque"], least)
        instead = None if lower is None else lower.key
        held = () if place.coupled else ((f"{joint}.coulomb", 0.0),)
    if effect.replaces_delay and not place.coupled:
        held = (*held, (f"{joint}.{TIMING}", 0.0))
    constant: dict[str, tuple[float, float]] = {}
    if offsets := offsets_of(effect):  # else two parameters would be equivalent
        held = held if place.coupled else (*held, (f"{joint}.offset", 0.0))
        if place.coupled or any(offsets_of(t.effect) and not t.is_given for t in here):
            constant = dict.fromkeys(offsets, (0.0, 0.0))
    for run, own in enumerate(place.extents if effect.is_event else (place.whole,)):
        for start in effect.starts(own):
            values = _initial(effect, {**given, **start}, own)
            for at_run in (run, None) if effect.is_event else (None,):  # in this run only, or in every run
                term = Term.of(effect, joint, values, run=at_run, limits=_limits(effect, own) | constant)
                yield Candidate(term, held, instead, frozenset(f"{joint}.{name}" for name in effect.along))


def _limits(effect: Effect, extent: Extent) -> dict[str, tuple[float, float]]:
    """Bounds set by a recording; a wave longer than the travel is indistinguishable from a slope."""
    found = dict(effect.bounds(extent))
    travel = extent.position[1] - extent.position[0]
    if effect.is_wave and travel > 0.0:
        highest = effect.parameter("order").upper
        found["order"] = (min(2.0 * math.pi * FEWEST_CYCLES / travel, highest), highest)
    return found


def _initial(effect: Effect, start: Mapping[str, float], extent: Extent) -> dict[str, float]:
    """Starting values: zero effect for linear parameters, given or typical values for others."""
    values = dict(effect.defaults())
    for p in effect.parameters:
        if p.name in start:
            values[p.name] = start[p.name]
        elif p.linear and p.absent is not None:
            values[p.name] = p.absent
        elif p.name not in values:
            values[p.name] = extent.residual if p.unit == "N m" else p.typical
    return values
