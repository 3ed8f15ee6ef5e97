"""Columns of effects that add coordinates to rigid robots: a compliant base, a link that bends.

The added coordinates follow from the joints' motion (`missing_physics.evaluation.yielding`). The
vibration with which a recording begins is estimated from the recording itself, with a prior as wide as the
largest deflection under the forces of the motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.evaluation.band import low_passed
from missing_physics.evaluation.yielding import (
    WIDER,
    Moving,
    Yielding,
    Yields,
    modes_of,
    moved_by,
    springs_of,
)
from missing_physics.hypotheses.term import Term
from missing_physics.inference.kept import step_of
from missing_physics.inference.torques.runs import Run
from reference_model.effects.structure import StructureEffect

__all__ = [
    "WIDER",
    "frequencies_of",
    "of_yielding",
    "rows_of_yielding",
    "rows_within",
    "stretch_of",
    "torques_of_yielding",
]

Array = NDArray[np.float64]
Values = Mapping[str, float]

#: A whole recording [s].
ALL = -np.inf, np.inf
#: Torque relative to the largest recorded one beyond which a deflection grows without bound [-].
FALLS = 1e3
#: Least weight of a joint's residual, relative to the largest one [-].
LEAST = 1e-6


def of_yielding(term: Term, effect: StructureEffect, run: Run) -> Array:
    """Columns of an effect that adds coordinates, see `columns.columns_of`."""
    return _columns(term, effect, run, {p.name: step_of(term, p) for p in term.free})


def torques_of_yielding(term: Term, effect: StructureEffect, run: Run) -> Array:
    """The first of these columns, the torques in the rows of the recording, shape (K, n)."""
    return _columns(term, effect, run, {})[:, :, 0]


def _columns(term: Term, effect: StructureEffect, run: Run, steps: Values) -> Array:
    """Columns with the vibration from the start that explains the residual best, whatever the parameters."""
    p, at, found = term.parameters, term.at, np.zeros((*run.torque.shape, 1 + len(steps)))
    size = np.sqrt(np.mean(run.residual**2, axis=0))
    weight = 1.0 / np.maximum(size, max(LEAST * float(size.max()), np.finfo(float).eps))[:, None]
    is_present, free, begins = _is_present(effect, p), found[:, :, :0], np.zeros(0)

    def explaining(values: Array) -> Array:
        """Amplitudes of the free vibrations that explain some series best, (K, n, C) to (S, C)."""
        columns, aims = ((part * weight).reshape(weight.size * len(part), -1) for part in (free, values))
        return np.linalg.solve(columns.T @ columns + np.eye(columns.shape[1]), columns.T @ aims)

    if is_present:
        rows = run.rows.nuisance.removed(rows_of_yielding(effect, at, run, [p]))[:, :, 0]
        free = rows[:, :, 1:]
        begins = explaining((run.residual - rows[:, :, 0])[:, :, None])[:, 0]
        found[:, :, 0] = rows[:, :, 0] + free @ begins
    trials = {k: {**p, name: p[name] + step} for k, (name, step) in enumerate(steps.items(), 1)}
    trials = {k: one for k, one in trials.items() if _is_present(effect, one)}
    if trials:
        every = [p, *trials.values()] if is_present else list(trials.values())
        rows = run.rows.nuisance.removed(rows_of_yielding(effect, at, run, every, begins=begins))[..., 0]
        changes = rows[:, :, 1:] - rows[:, :, :1] if is_present else rows
        found[:, :, list(trials)] = changes - free @ explaining(changes)
    found[:, :, 1:] /= np.array(list(steps.values()))
    return found


def rows_of_yielding(
    effect: StructureEffect,
    at: str,
    run: Run,
    trials: Sequence[Values],
    *,
    within: tuple[float, float] = ALL,
    begins: Array | None = None,
) -> Array:
    """Torques in the rows of a recording for V values of an effect's parameters, shape (K, n, V, 1 + S).

    Those due to the forces of the motion are followed by those of S free vibrations from the start, each with
    the largest deflection under these forces. A mount so soft that the robot would fall over has torques
    that no recording has.

    Args:
        effect, at, run: the effect, its place and the recording.
        trials: values of its parameters.
        within: times between which they are wanted [s]. Other rows are left out.
        begins: amplitudes of free vibrations that are added to the forced one, see `moved_by`.
    """
    motion = run.motion
    each = [_dynamics_of(effect, at, run, p).within(*within) for p in trials]
    springs = [springs_of(effect, run.model.robot, at, p, each[0].reached) for p in trials]
    time, full = each[0].time, moved_by(each, springs, 2.0 * np.pi * WIDER * motion.cutoff, begins)
    impossible = FALLS * float(np.abs(run.torque).max())
    falls = ~(np.abs(full) < impossible).all(axis=(0, 1, 3))
    full[:, :, falls] = 0.0
    full[:, :, falls, 0] = impossible
    nearest = np.searchsorted(motion.time, time).clip(0, motion.time.size - 1)
    weighted = full * run.rows.shares[nearest, :, None, None]
    smooth = low_passed(weighted, rate=1.0 / (time[1] - time[0]), cutoff=motion.cutoff)
    some = rows_within(run, *within)
    found = _interpolated(smooth, (run.rows.time[some] - time[0]) / (time[1] - time[0]))
    return found * run.rows.counted[some, :, None, None]


def stretch_of(run: Run, instants: int, fitted: NDArray[np.bool_]) -> tuple[float, float]:
    """The times between which the standard model errs most, in a stretch of so many instants [s].

    Args:
        run: the recording.
        instants: of the integration.
        fitted: mask of the rows that are fitted, shape (K,): held-out ones have no say.
    """
    moving, time, left = _moving(run), run.rows.time, run.residual
    length = instants * moving.stride / moving.rate
    if time[-1] - time[0] <= length:
        return ALL
    left = np.where(fitted[:, None], left, 0.0)
    energy = (left**2 / np.maximum(np.mean(left**2, axis=0), np.finfo(float).tiny)).sum(axis=1)
    total = np.concatenate([[0.0], np.cumsum(energy)])
    ends = np.searchsorted(time, time + length)
    first = int(np.argmax(np.where(ends < time.size, total[ends] - total[:-1], -np.inf)))
    return float(time[first]), float(time[first]) + length


def rows_within(run: Run, first: float, last: float) -> slice:
    """Rows between two times [s]."""
    begin, end = np.searchsorted(run.rows.time, (first, last))
    return slice(int(begin), int(end))


def _interpolated(values: Array, places: Array, points: int = 6) -> Array:
    """Series at places between its samples, in samples, (T, ...) to (K, ...): Lagrange's polynomial.

    Its error with six points is a thousandth at the band's end.
    """
    first = np.clip(np.floor(places).astype(int) - 2, 0, len(values) - points)
    apart = places - first
    found = np.zeros((places.size, *values.shape[1:]))
    for k in range(points):
        others = [m for m in range(points) if m != k]
        weight = np.prod([(apart - m) / (k - m) for m in others], axis=0)
        found += weight.reshape(-1, *[1] * (values.ndim - 1)) * values[first + k]
    return found


def frequencies_of(effect: StructureEffect, at: str, run: Run, p: Values) -> Array:
    """Frequencies of the added coordinates at the start of a recording, slowest first [rad/s]."""
    dynamics = _dynamics_of(effect, at, run, p)
    stiffness, _ = springs_of(effect, run.model.robot, at, p, dynamics.reached)
    sprung = np.flatnonzero(np.diag(stiffness) > 0.0)
    block = np.ix_(sprung, sprung)
    return modes_of(dynamics.mass[0][block], stiffness[block])[1]


def _is_present(effect: StructureEffect, p: Values) -> bool:
    """Whether an effect with these parameters changes the robot."""
    return all(p[name] != effect.parameter(name).absent for name in effect.essential)


def _dynamics_of(effect: StructureEffect, at: str, run: Run, p: Values) -> Yielding:
    """The dynamics of the coordinates that an effect adds, cached."""
    key = effect.id, at
    if key not in run.reshaped:
        run.reshaped[key] = Yields.of(effect, at, _moving(run))
    found = run.reshaped[key]
    assert isinstance(found, Yields)
    return found.at(p)


def _moving(run: Run) -> Moving:
    motion = run.motion
    return Moving(
        robot=run.model.robot,
        time=motion.time,
        position=motion.position,
        velocity=motion.velocity,
        acceleration=motion.acceleration,
        base=run.along.base,
        cutoff=motion.cutoff,
        first=motion.kept.start,
        apart=dict(zip(run.model.inertial_names, run.along.inertial - run.model.inertial)),
    )
