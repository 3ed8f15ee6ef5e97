"""Which effects may be added to a hypothesis, and from where a fit of them starts."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from missing_physics.hypotheses.term import Term
from reference_model.effects.base import BodyEffect, Effect, Extent, JointEffect, SensorEffect
from reference_model.effects.catalogue import catalogue
from robot_model import Robot

__all__ = ["Candidate", "candidates"]

#: Effects that the standard model holds already: its friction, its offsets, its bodies.
STANDARD = frozenset({"viscous_friction", "coulomb_friction", "torque_offset", "inertia", "payload"})
#: What every recording tells of a joint.
RECORDED = frozenset({"position", "velocity", "acceleration", "torque"})
#: Channels of torque sensors have no disc.
AT_TORQUE = frozenset({"sensor_gain", "sensor_delay", "clock_drift"})


@dataclass(frozen=True)
class Candidate:
    """A term, and what goes when it comes: numbers of the standard model, a lower rung of its family."""

    term: Term
    held: tuple[tuple[str, float], ...] = ()
    instead: tuple[str, str] | None = None


def candidates(
    robot: Robot,
    terms: Sequence[Term],
    extents: Mapping[str, Extent],
    channels: Collection[str],
    coulomb: Mapping[str, float],
) -> Iterator[Candidate]:
    """All that the recordings could show.

    Args:
        robot: nominal.
        terms: of the hypothesis that is added to.
        extents: of each joint that can be judged.
        channels: recorded in every recording.
        coulomb: Coulomb friction of each joint by the standard model [N m or N].
    """
    present = {t.key: t for t in terms}
    driven = {j.name for j in robot.moving_joints if j.actuator is not None}
    for effect in catalogue().values():
        if not effect.along_motion or effect.id in STANDARD or not effect.estimated:
            continue
        if isinstance(effect, BodyEffect):
            if effect.place == "base" and (effect.id, "base") not in present:
                zero = {p.name: 0.0 for p in effect.parameters}
                yield Candidate(Term.of(effect, "base", zero))
            continue
        for joint, extent in extents.items():
            if effect.place == "actuator" and driven and joint not in driven:
                continue
            if any(q not in RECORDED and f"{joint}.{q}" not in channels for q in effect.needs):
                continue
            if isinstance(effect, JointEffect):
                yield from _at_joint(effect, joint, extent, present, terms, coulomb.get(joint, 0.0))
            elif isinstance(effect, SensorEffect):
                for channel in _channels(effect, joint, channels):
                    if (effect.id, channel) not in present:
                        yield from (
                            Candidate(Term.of(effect, channel, _initial(effect, start, extent)))
                            for start in effect.starts(extent)
                        )


def _channels(effect: Effect, joint: str, channels: Collection[str]) -> Iterator[str]:
    position = f"{joint}.motor_position" if f"{joint}.motor_position" in channels else f"{joint}.position"
    if effect.id != "sensor_delay":
        yield position
    if effect.id in AT_TORQUE and f"{joint}.torque" in channels:
        yield f"{joint}.torque"


def _at_joint(
    effect: JointEffect,
    joint: str,
    extent: Extent,
    present: Mapping[tuple[str, str], Term],
    terms: Sequence[Term],
    coulomb: float,
) -> Iterator[Candidate]:
    if (effect.id, joint) in present:
        return
    instead, held, first = None, (), {}
    if effect.family:
        same = [t for t in terms if t.at == joint and t.effect.family == effect.family]
        if same and same[0].effect.rung >= effect.rung:
            return
        instead = same[0].key if same else None
        held = ((f"{joint}.coulomb", 0.0),)
        level = max(coulomb, 1e-3 * extent.torque)
        first = {"coulomb_torque": level, "static_torque": 1.3 * level}
        if same:
            shared = {k: v for k, v in same[0].parameters.items() if k in {p.name for p in effect.parameters}}
            first.update(shared)
    for start in effect.starts(extent):
        yield Candidate(Term.of(effect, joint, _initial(effect, {**first, **start}, extent)), held, instead)


def _initial(effect: Effect, start: Mapping[str, float], extent: Extent) -> dict[str, float]:
    """Linear numbers start where they mean nothing, others at what is given or typical."""
    values = dict(effect.defaults())
    for p in effect.parameters:
        if p.name in start:
            values[p.name] = start[p.name]
        elif p.linear and p.absent is not None:
            values[p.name] = p.absent
        elif p.name not in values:
            values[p.name] = extent.residual if p.unit == "N m" else p.typical
    return {p.name: float(np.clip(values[p.name], p.lower, p.upper)) for p in effect.parameters}
