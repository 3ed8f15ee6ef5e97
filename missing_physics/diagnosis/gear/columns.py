"""Contribution of a term to the gap, and its derivatives by the term's parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.gear.hysteresis import lagging
from missing_physics.diagnosis.gear.laws import BACKLASH, BENDING, HYSTERESIS
from missing_physics.hypotheses import Term
from missing_physics.inference.kept import TermColumns
from missing_physics.motion.gap import Gap
from missing_physics.standard.normal import Places
from reference_model.effects.along import GearAlong, SensorAlong
from reference_model.effects.base import SensorEffect, YieldingGear

__all__ = ["VELOCITY", "GapColumns"]

Array = NDArray[np.float64]

#: Name of the signal that drives play if no torque is recorded and so friction is not known.
VELOCITY = "velocity"


class GapColumns(TermColumns):
    """Columns of terms in the gaps.

    Args:
        gaps: of each recording, channel by channel.
        centred: for each recording, whether its mean is removed.
    """

    def __init__(self, gaps: Sequence[Sequence[Gap]], centred: Sequence[bool]) -> None:
        super().__init__()
        self._gaps, self._centred = gaps, centred

    def _places(self, term: Term, run: int) -> Places:
        own = enumerate(self._gaps[run])
        return np.array([k for k, gap in own if term.at.split(".")[0] in (gap.joint, gap.link)][:1])

    def _made(self, term: Term, run: int) -> Array:
        gap = self._gaps[run][self._places(term, run)[0]]
        found = gap.reduce(_columns(term, gap))[:, None, :]
        return found - found.mean(axis=0) if self._centred[run] else found

    def _shape(self, run: int) -> tuple[int, int]:
        return self._gaps[run][0].along.motion.reduced_time.size, len(self._gaps[run])


def _columns(term: Term, gap: Gap) -> Array:
    """Columns at full rate, shape (N, 1 + P)."""
    effect, p = term.effect, term.parameters
    if isinstance(effect, SensorEffect):
        return _sensor(term, effect, gap)
    if isinstance(effect, YieldingGear):
        torque = gap.smooth[term.along]
        twist = GearAlong(effect).evaluate(torque, np.gradient(torque, gap.time), p)
        names = [q.name for q in effect.estimated]
        return -twist[:, [0, *(1 + names.index(q.name) for q in term.free)]]
    if effect is BENDING:
        return -gap.acceleration[:, None] * np.array([p["static_deflection"], 1.0])
    if effect is BACKLASH:
        drive = gap.velocity if term.along == VELOCITY else gap.smooth[term.along]
        side = np.tanh(drive / p["flight"])
        turning = (1.0 - side**2) * drive / p["flight"] ** 2
        return np.column_stack([-p["half_width"] * side, -side, p["half_width"] * turning])
    assert effect is HYSTERESIS
    return _hysteresis(term, gap)


def _sensor(term: Term, effect: SensorEffect, gap: Gap) -> Array:
    """An encoder's exact error, and its derivatives to first order."""
    since, free = gap.time - gap.time[0], [p.name for p in term.free]
    read = effect.apply(since, gap.position, term.parameters)
    slopes = SensorAlong(effect).jacobian(since, gap.position, gap.velocity, term.parameters, free)
    sign = -1.0 if term.at.endswith(".motor_position") else 1.0
    return sign * np.column_stack([read - gap.position, slopes])


def _hysteresis(term: Term, gap: Gap) -> Array:
    """Columns of gear hysteresis: the gap is r z - T / K + D dT/dt c^2, to first order in D.

    With r = T_h / K, the state z of size K travel and height T_h, and c = de/dT without damping.
    """
    p, torque = term.parameters, gap.smooth[term.along]
    height, travel, stiffness = p["torque"], p["travel"], p["stiffness"]
    state, by_size, by_height = lagging(torque, stiffness * travel, height).T
    ratio, rate = height / stiffness, np.gradient(torque, gap.time)
    compliance = 1.0 / (stiffness + height * (1.0 - state * np.sign(rate)) / travel)
    columns = {
        "torque": state / stiffness + ratio * by_height,
        "travel": ratio * by_size * stiffness,
        "stiffness": torque / stiffness**2 - ratio * state / stiffness + ratio * by_size * travel,
        "damping": rate * compliance**2,
    }
    gap_of_term = ratio * state - torque / stiffness + p["damping"] * columns["damping"]
    return np.column_stack([gap_of_term, *(columns[q.name] for q in term.free)])
