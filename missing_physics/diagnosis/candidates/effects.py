"""Which effects could be missing where, and a first look at each.

Every catalogue effect at every place it can sit competes. The first look costs one projection: the columns
of a candidate at its starting values, made orthogonal to everything the current explanation can already do,
against the residual.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.candidates.pulses import likeliest_pulses
from missing_physics.diagnosis.candidates.structural import hidden, looked_for, searched
from missing_physics.diagnosis.candidates.walls import tip_of
from missing_physics.diagnosis.least_squares.explanation import Explanation, View
from missing_physics.diagnosis.least_squares.problem import Problem, Segment
from missing_physics.diagnosis.least_squares.scanning import Scan
from missing_physics.diagnosis.location.orders import FEWEST_PERIODS, spatial_peaks
from missing_physics.diagnosis.location.residual import outstanding_windows
from missing_physics.diagnosis.statistics.correlated_errors import effective_samples
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.base import BodyEffect, Effect, Extent, JointEffect, SensorEffect
from reference_model.effects.catalogue import catalogue

__all__ = [
    "AT_TORQUE",
    "OF_THE_NOMINAL",
    "Candidate",
    "Look",
    "Sight",
    "candidates",
    "first_look",
    "lacking",
    "ranked",
]

Array = NDArray[np.float64]

#: Effects that change what the re-estimated inertial numbers and scales can change as well; they are
#: weighed against re-estimated nominal numbers afterwards, see `nominal`.
OF_THE_NOMINAL = frozenset({"payload", "inertia", "torque_gain"})
#: The same of a torque sensor: its gain is that of the actuator, told by another channel.
OF_THE_NOMINAL_AT_TORQUE = frozenset({"sensor_gain"})
#: Sensor effects that a torque sensor can have; it has no disc that could be eccentric.
AT_TORQUE = frozenset({"sensor_gain", "sensor_offset", "sensor_delay", "clock_drift"})
#: Quantities that every segment has, recorded or estimated.
ESTIMATED = frozenset({"position", "velocity", "acceleration", "torque"})
#: A column that keeps less than this part of its length after projection says nothing new.
NOTHING_NEW = 1e-3
#: An effect without linear parameters is looked at with its starting contribution scaled by up to this.
LARGEST_AMPLITUDE = 2.0
#: A joint whose error energy falls below this part gets its memory looked at again.
NOTICEABLE = 0.9
#: Decimals of evidence: what differs by less is rounding.
EQUAL = 3
#: Spatial peaks handed to effects that are periodic in position.
PEAKS = 2


@dataclass(frozen=True)
class Candidate:
    """A term that may be added, with the term it replaces when it is a higher rung of the same family."""

    term: Term
    replaces: Term | None = None


@dataclass(frozen=True)
class Sight:
    """What was seen at a joint: windows [(start, stop)] in s, and angular orders [1/rad or 1/m]."""

    windows: tuple[tuple[float, float], ...]
    orders: tuple[float, ...]


def candidates(
    problem: Problem,
    explanation: Explanation,
    *,
    nominal_numbers: bool = False,
    bristles: bool = False,
    among: Collection[str] | None = None,
    alike: Collection[str] | None = None,
    sights: Mapping[str, Sight] | None = None,
) -> Iterator[Candidate]:
    """Every effect at every place that the explanation does not hold yet, at each of its starts.

    Args:
        nominal_numbers: include effects that say no more than that a nominal number is wrong.
        bristles: include dry friction laws with internal states, which show at reversals only.
        among: only these effect ids.
        alike: where given, no other effect is worth a costly search.
        sights: of joints, where something other than the residual tells where to start.
    """
    scan = Scan(explanation)
    extents = {name: _extent(problem, explanation, i, scan) for i, name in enumerate(problem.joints)}
    for name, sight in (sights or {}).items():
        extents[name] = replace(extents[name], windows=sight.windows, orders=sight.orders)
    present = {term.key: term for term in explanation.terms}
    for effect in catalogue().values():
        if effect.id in OF_THE_NOMINAL and not nominal_numbers:
            continue
        if _has_bristles(effect) and not bristles:
            continue
        if among is not None and effect.id not in among:
            continue
        if searched(effect):
            for term in looked_for(problem, explanation, effect, alike):
                if term.key not in present:
                    yield Candidate(term)
            continue
        for place, joint in _places(problem, effect):
            if (effect.id, place) in present or _undone(effect, joint, present):
                continue
            if not nominal_numbers and effect.id in OF_THE_NOMINAL_AT_TORQUE and place.endswith(".torque"):
                continue
            replaces, possible = _ladder(effect, place, explanation.terms)
            if not possible:
                continue
            for start in effect.starts(extents[joint]):
                values = _initial(effect, start, replaces, extents[joint])
                values.update(_payload_place(problem, effect, place))
                narrowed = {
                    **effect.bounds(extents[joint]),
                    **_lowest_order(effect, extents[joint]),
                    **_late(effect, place),
                }
                yield Candidate(Term(effect, place, values, narrowed=narrowed), replaces)


def _lowest_order(effect: Effect, extent: Extent) -> dict[str, tuple[float, float]]:
    """A period longer than the travel is no period: bounds of the order of effects that have one."""
    travel = extent.position[1] - extent.position[0]
    orders = [p for p in effect.estimated if p.name == "order"]
    if not orders or travel <= 0:
        return {}
    return {"order": (min(2 * np.pi * FEWEST_PERIODS / travel, orders[0].upper), orders[0].upper)}


def _undone(effect: Effect, joint: str, present: Collection[tuple[str, str]]) -> bool:
    """Whether another effect undoes this one: both would grow together and smooth nothing but noise."""
    opposite = {
        "sensor_delay": ("actuator_lag", joint),
        "actuator_lag": ("sensor_delay", f"{joint}.torque"),
    }
    return opposite.get(effect.id) in present


def _late(effect: Effect, place: str) -> dict[str, tuple[float, float]]:
    """A channel that is early beside all others is said by those that are late."""
    if effect.id != "sensor_delay" or not place.endswith((".position", ".torque")):
        return {}
    return {"delay": (0.0, effect.parameter("delay").upper)}


def _has_bristles(effect: Effect) -> bool:
    return isinstance(effect, JointEffect) and effect.states > 0 and effect.family is not None


def _places(problem: Problem, effect: Effect) -> Iterator[tuple[str, str]]:
    """(place, joint) pairs where the effect can sit and the data could show it."""
    for index, joint in enumerate(problem.joints):
        seen = problem.usable[index] and not lacking(problem.segments, effect, joint)
        if effect.place == "actuator" and not problem.measured[:, index].any():
            continue  # nothing drives it
        if isinstance(effect, JointEffect) and seen:
            yield joint, joint
        elif isinstance(effect, SensorEffect) and seen:
            if not any(joint in segment.motion.derived for segment in problem.segments):
                yield problem.segments[0].motion.position_channels[index], joint
            if effect.id in AT_TORQUE and _senses_torque(problem, joint):
                yield f"{joint}.torque", joint
    if isinstance(effect, SensorEffect):
        for output in problem.outputs:
            if output.joint is None:
                yield output.channel, problem.joints[0]
    if isinstance(effect, BodyEffect):
        links = [link.name for link in problem.robot.links if link.name not in problem.robot.known]
        for body in ["base"] if effect.place == "base" else links:
            yield body, problem.joints[0]


def _senses_torque(problem: Problem, joint: str) -> bool:
    """Whether its torque was measured, not computed from a current or a voltage."""
    return all(joint in segment.motion.torque_sensors for segment in problem.segments)


def _payload_place(problem: Problem, effect: Effect, link: str) -> dict[str, float]:
    """A payload sits at the link's tip."""
    if effect.id != "payload":
        return {}
    return dict(zip("xyz", tip_of(problem.robot, link)))


def lacking(segments: Sequence[Segment], effect: Effect, joint: str) -> tuple[str, ...]:
    """Channels of a joint without which the effect cannot be seen there, and which some segment lacks."""
    needed = [f"{joint}.{quantity}" for quantity in effect.needs if quantity not in ESTIMATED]
    return tuple(c for c in needed if any(c not in segment.motion.others for segment in segments))


def _ladder(effect: Effect, place: str, terms: Sequence[Term]) -> tuple[Term | None, bool]:
    """The term of the same family that this effect would replace, and whether it may come in at all."""
    here = [t.effect for t in terms if t.at == place]
    modifies = isinstance(effect, JointEffect) and effect.is_modifier
    if modifies and not any(isinstance(e, JointEffect) and e.is_friction_law for e in here):
        return None, False
    if effect.builds_on and not any(e.id in effect.builds_on for e in here):
        return None, False
    if effect.family is None:
        return None, True
    same = [t for t in terms if t.at == place and t.effect.family == effect.family]
    if not same:
        return None, effect.rung == 1
    return same[0], effect.rung > same[0].effect.rung


def _initial(
    effect: Effect, start: Mapping[str, float], replaces: Term | None, extent: Extent
) -> dict[str, float]:
    values = dict(effect.defaults())
    for parameter in effect.parameters:
        if parameter.name not in values:
            typical = extent.residual if parameter.unit == "N m" else parameter.typical
            values[parameter.name] = float(np.clip(typical, parameter.lower, parameter.upper))
    values.update(start)
    if replaces is not None:
        level = replaces.parameters.get("torque", replaces.parameters.get("coulomb_torque", 0.0))
        inherited = {"coulomb_torque": level, "static_torque": 1.3 * level, **replaces.parameters}
        values.update({k: v for k, v in inherited.items() if k in values and k not in start})
    return {p.name: float(np.clip(values[p.name], p.lower, p.upper)) for p in effect.parameters}


def _extent(problem: Problem, explanation: Explanation, index: int, scan: Scan) -> Extent:
    velocity = np.abs(problem.velocity[:, index])
    moving = velocity[velocity > 0.01 * max(float(velocity.max()), 1e-12)]
    segment = problem.segments[0]
    residual = explanation.residual[:, index]
    cutoff = segment.motion.low_pass.cutoff
    return Extent(
        position=(float(problem.position[:, index].min()), float(problem.position[:, index].max())),
        speed=float(velocity.max()),
        slow=float(np.quantile(moving, 0.1)) if moving.size else 0.0,
        torque=float(np.sqrt(np.mean(problem.measured[:, index] ** 2))),
        peak_torque=float(np.abs(problem.measured[:, index]).max()),
        residual=float(np.sqrt(np.mean(residual**2))),
        duration=float(sum(s.time[-1] - s.time[0] for s in problem.segments)),
        sample_time=1.0 / segment.motion.low_pass.rate,
        gear_ratio=segment.places[index].gear_ratio,
        windows=(
            *likeliest_pulses(scan, problem.time, index),
            *outstanding_windows(segment.time, residual[problem.segment_of == 0])[:PEAKS],
        ),
        orders=spatial_peaks(
            problem.position[:, index], problem.velocity[:, index], residual, cutoff=cutoff, count=PEAKS
        ),
    )


@dataclass(frozen=True)
class Look:
    """A candidate with the values its linear parameters would take and the evidence that promises."""

    candidate: Candidate
    evidence: float


def first_look(
    problem: Problem, view: View, explanation: Explanation, options: Sequence[Candidate]
) -> list[Look]:
    """Rank candidates by the evidence their linearised columns promise; the best start of each effect."""
    orthonormal, _ = np.linalg.qr(_independent(explanation.columns))
    errors = explanation.errors[:, 0]
    errors = errors - orthonormal @ (orthonormal.T @ errors)
    width = int(problem.usable.sum())
    before = (errors.reshape(-1, width) ** 2).sum(0)
    torque = view.flatten(problem, problem.measured[:, :, None])[:, 0]
    best: dict[tuple[str, str], Look] = {}
    for option in options:
        look = _look(problem, view, explanation, option, orthonormal, errors, before, torque)
        if look is not None:
            key = look.candidate.term.key
            if key not in best or look.evidence > best[key].evidence:
                best[key] = look
    return sorted(best.values(), key=lambda look: ranked(look.evidence, look.candidate.term))


def ranked(evidence: float, term: Term) -> tuple[float, int, bool, bool, str]:
    """What goes first is least: most evidence, and where it is equal the fewest numbers.

    Then what a joint or link does, what the base does, and what sensors show: effects may be one and the same
    to a robot, and rounding does not choose among them.
    """
    sensed, of_base = isinstance(term.effect, SensorEffect), term.effect.place == "base"
    return -round(evidence, EQUAL), len(term.free), sensed, of_base, term.effect.id


def _independent(columns: Array) -> Array:
    scale = np.linalg.norm(columns, axis=0)
    return np.asarray(columns[:, scale > 0] / scale[scale > 0])


def _look(
    problem: Problem,
    view: View,
    explanation: Explanation,
    option: Candidate,
    orthonormal: Array,
    errors: Array,
    before: Array,
    torque: Array,
) -> Look | None:
    columns = _columns(problem, view, explanation, option.term)
    contribution = columns[:, 0]
    length = np.linalg.norm(columns, axis=0)
    if not np.all(np.isfinite(length)) or not length.any():
        return None
    option = _without_unseen(option, length)
    columns, length = columns[:, length > 0], length[length > 0]
    columns = columns - orthonormal @ (orthonormal.T @ columns)
    fresh = np.linalg.norm(columns, axis=0) > NOTHING_NEW * length
    if not fresh.any():
        return None
    option = _without_unseen(option, np.where(fresh, length, 0.0))
    columns = columns[:, fresh]
    if any(p.linear for p in option.term.estimated):
        columns = columns / np.linalg.norm(columns, axis=0)
        left = errors - columns @ np.linalg.lstsq(columns, errors, rcond=1e-8)[0]
    else:
        amplitude = float(columns[:, 0] @ errors / (columns[:, 0] @ columns[:, 0]))
        amplitude = float(np.clip(amplitude, 0.0, LARGEST_AMPLITUDE))
        left = errors - columns[:, 0] * amplitude
    per_joint = left.reshape(-1, before.size)
    after = (per_joint**2).sum(0)
    effective = explanation.effective.copy()
    for index in np.flatnonzero(after < NOTICEABLE * before):
        effective[index] = max(effective[index], effective_samples(per_joint[:, index]))
    fall = np.log(np.maximum(before, 1e-300) / np.maximum(after, 1e-300))
    if getattr(option.term.effect, "uses_torque", False) and not any(p.linear for p in option.term.estimated):
        # As in `Explanation.referred`: errors beyond noise count relative to the torque that is let through.
        delivered = ((torque - amplitude * contribution).reshape(-1, before.size) ** 2).sum(0)
        commanded = (torque.reshape(-1, before.size) ** 2).sum(0)
        ratio = np.maximum(commanded, 1e-300) / np.maximum(delivered, 1e-300)
        referred = after + np.maximum(after - view.aside(problem), 0.0) * (ratio - 1.0)
        fall = np.log(np.maximum(before, 1e-300) / np.maximum(referred, 1e-300))
    gain = 0.5 * effective @ fall
    extra = len(option.term.free) - (len(option.replaces.free) if option.replaces else 0)
    return Look(option, float(gain - 0.5 * extra * np.log(max(effective.sum(), 2.0))))


def _without_unseen(option: Candidate, length: Array) -> Candidate:
    """Leave out linear parameters whose columns are empty or nothing new: the data say nothing of them."""
    linear = [p for p in option.term.estimated if p.linear]
    if hidden(option.term.effect):
        length = length[1:]
    empty = {p.name: p.absent or 0.0 for p, size in zip(linear, length) if size == 0.0}
    if not empty:
        return option
    term = replace(
        option.term, parameters={**option.term.parameters, **empty}, unseen=(*option.term.unseen, *empty)
    )
    return replace(option, term=term)


def _columns(problem: Problem, view: View, explanation: Explanation, term: Term) -> Array:
    """Weighted columns of the linear parameters, or the contribution itself where there are none."""
    terms = [*explanation.terms, term]
    parts = []
    linear = [i for i, p in enumerate(term.estimated) if p.linear]
    for segment in problem.segments:
        made = segment.contribution(term, terms)
        columns = made.jacobian[:, :, linear] if linear else made.value[:, :, None]
        if hidden(term.effect):  # a response of its own, beside what its start adds
            columns = np.concatenate([made.value[:, :, None], columns], axis=2)
        parts.append(columns)
    return view.flatten(problem, np.concatenate(parts))
