"""Effects that may be added to a hypothesis on the gap of one joint, and their starting values."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.gear.columns import VELOCITY
from missing_physics.diagnosis.gear.laws import BACKLASH, BENDING, ELASTICITY, HYSTERESIS, OF_GEARS, OPTIONAL
from missing_physics.hypotheses import Candidate, Sight, Term, extent_of
from missing_physics.hypotheses.extents import STANDSTILL
from missing_physics.inference.ledger import ODDS
from missing_physics.motion.gap import Gap
from reference_model.effects.catalogue import get_effect
from reference_model.effects.gear_hysteresis import TORQUE_SHARE

__all__ = ["COVERED_CYCLE", "candidates"]

Array = NDArray[np.float64]

#: Starting values as fractions of the range of the torque: travel of the friction inside a gear, and torque
#: below which the flanks are in flight (the last one would be a spring).
TRAVELS = (0.01, 0.03, 0.1, 0.3)
#: Fewest cycles of a wave over position that the motion must cover if its order is known, and starting value
#: if it is not.
COVERED_CYCLE = 0.5
#: Fewest cycles in a fit: with fewer, a wave is indistinguishable from a parabola.
FEWEST = 0.25


def candidates(gaps: Sequence[Gap], terms: Sequence[Term], residual: Sequence[Array]) -> Iterator[Candidate]:
    """All effects that the gap could show, each with all its sets of starting values.

    The gap does not show which encoder has a wrong scale or clock: it is attributed to the joint's.

    Args:
        gaps: of one joint, in each fitted recording.
        terms: those of the hypothesis, at any joint.
        residual: of the hypothesis, zero where nothing is fitted, shape (K,) each [rad or m].
    """
    present = {term.key for term in terms}
    every = [
        *_of_encoders(gaps, residual),
        Candidate(Term.of(BENDING, gaps[0].link, {"static_deflection": 0.0})),
    ]
    yield from (one for one in every if one.term.key not in present)
    yield from _of_gear(gaps, terms, residual)


def _of_encoders(gaps: Sequence[Gap], residual: Sequence[Array]) -> Iterator[Candidate]:
    position, motor = (f"{gaps[0].joint}.{side}" for side in ("position", "motor_position"))
    speed = np.concatenate([gap.reduce(gap.velocity) for gap in gaps])
    delayed = position if float(speed @ np.concatenate(list(residual))) <= 0.0 else motor
    for effect, channel in (("sensor_gain", position), ("sensor_delay", delayed), ("clock_drift", position)):
        law = get_effect(effect)
        yield Candidate(Term.of(law, channel, {p.name: 0.0 for p in law.parameters}))
    if gaps[0].is_prismatic:
        return
    extents = [extent_of(_sight(gap, own)) for gap, own in zip(gaps, residual)]
    travel = max(extent.position[1] - extent.position[0] for extent in extents)
    if travel <= 0.0:
        return
    eccentricity, ratio = get_effect("encoder_eccentricity"), gaps[0].gear_ratio
    most = _cycles(gaps, travel)
    shafts = [(position, 1.0), (position, 2.0)] + [(motor, k * ratio) for k in (1.0, 2.0) if ratio > 1.0]
    for channel, order in shafts:
        if order * travel >= 2.0 * np.pi * COVERED_CYCLE and order * travel < 2.0 * np.pi * most:
            fixed = {"order": (order, order)}
            yield Candidate(Term.of(eccentricity, channel, _cycle(order), limits=fixed))
    # A ratio that the file does not list: one of the orders distinguishable by Rayleigh's criterion.
    further = ODDS + float(np.log(max(2.0 * most, 1.0)))
    cycle = 2.0 * np.pi / travel
    for order in (COVERED_CYCLE * cycle, *(order for extent in extents for order in extent.orders)):
        wide = {"order": (FEWEST * cycle, eccentricity.parameter("order").upper)}
        yield Candidate(Term.of(eccentricity, position, _cycle(order), limits=wide, further=further))


def _cycle(order: float) -> dict[str, float]:
    return {"cosine": 0.0, "sine": 0.0, "order": order}


def _cycles(gaps: Sequence[Gap], travel: float) -> float:
    """Most cycles over the travel that the filter passes at the median speed and the samples resolve."""
    speed = np.abs(np.concatenate([gap.velocity[gap.along.motion.kept] for gap in gaps]))
    moving = speed[speed > STANDSTILL * float(speed.max())]
    if not moving.size:
        return 0.0
    cutoff = gaps[0].along.motion.low_pass.cutoff
    return min(cutoff * travel / float(np.median(moving)), moving.size / 2)


def _of_gear(gaps: Sequence[Gap], terms: Sequence[Term], residual: Sequence[Array]) -> Iterator[Candidate]:
    """Effects driven by the torque through the gear; all effects of one gear use the same torque estimate."""
    joint, flights = gaps[0].joint, TRAVELS[:-1]
    here = {term.effect.id: term for term in terms if term.at == joint and term.effect.id in OF_GEARS}
    chosen = {term.along for term in here.values()} - {VELOCITY}
    for along in sorted(chosen or gaps[0].torques):
        torques = [gap.smooth[along] for gap in gaps]
        span = max(float(np.ptp(torque)) for torque in torques)
        if span <= 0.0:
            continue
        turns = any(torque.min() < 0.0 < torque.max() for torque in torques)
        if not {ELASTICITY.id, HYSTERESIS.id} & here.keys():
            stiffness = _stiffness([gap.reduce(gap.torques[along]) for gap in gaps], residual)
            spring = Term.of(ELASTICITY, joint, {"stiffness": stiffness}, along=along, optional=OPTIONAL)
            for name in OPTIONAL:
                spring = spring.lacking(name)
            yield Candidate(spring)
        for term in here.values():
            for name in sorted(term.optional - set(term.added)):
                yield Candidate(term.having(name), instead=term.key)
        if HYSTERESIS.id in here:
            continue
        if BACKLASH.id not in here and turns:
            for part in flights:
                yield _play(joint, along, part * span, flights[-1] * span)
        if ELASTICITY.id in here and BACKLASH.id not in here:
            found = here[ELASTICITY.id].parameters["stiffness"]
            height = TORQUE_SHARE * float(np.sqrt(np.mean(np.concatenate(torques) ** 2)))
            for part in TRAVELS:
                values = {"torque": height, "travel": part * span / found, "stiffness": found}
                lossy = Term.of(HYSTERESIS, joint, values, along=along, further=ODDS)  # two effects in one
                yield Candidate(lossy, instead=(ELASTICITY.id, joint))
    if not {BACKLASH.id, HYSTERESIS.id} & here.keys() and "motor" not in gaps[0].torques:
        fastest = max(float(np.abs(gap.velocity).max()) for gap in gaps)
        yield _play(joint, VELOCITY, max(gap.transition for gap in gaps), fastest)


def _play(joint: str, along: str, flight: float, most: float) -> Candidate:
    limits = {"flight": (min(1e-3 * most, flight), most)}
    return Candidate(
        Term.of(BACKLASH, joint, {"half_width": 0.0, "flight": flight}, limits=limits, along=along)
    )


def _stiffness(torques: Sequence[Array], residual: Sequence[Array]) -> float:
    """Stiffness by regression of the residual on the torque; if negative, by the ratio of their norms."""
    torque = np.concatenate([own - own.mean() for own in torques])
    gap = np.concatenate(list(residual))
    compliance = -float(gap @ torque) / max(float(torque @ torque), 1e-300)
    if compliance <= 0.0:
        compliance = float(np.linalg.norm(gap) / max(float(np.linalg.norm(torque)), 1e-300))
    stiffness = ELASTICITY.parameter("stiffness")
    return float(np.clip(1.0 / max(compliance, 1e-300), stiffness.lower, stiffness.upper))


def _sight(gap: Gap, residual: Array) -> Sight:
    """The joint's data in one recording, to find the orders in its residual."""
    motion = gap.along.motion
    return Sight(
        time=motion.reduced_time,
        position=gap.position[motion.kept],
        velocity=gap.velocity[motion.kept],
        torque=gap.reduce(gap.torques["link"]),
        residual=residual,
        step=1.0 / motion.low_pass.rate,
        cutoff=motion.low_pass.cutoff,
        gear_ratio=gap.gear_ratio,
    )
