"""What terms contribute to the rates of a free base, and its derivatives by their parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.base.changed import Changed, Slope, masses_of
from missing_physics.diagnosis.base.rates import Rates
from missing_physics.evaluation.response import Vibration, vibrating
from missing_physics.hypotheses import Term
from missing_physics.inference.kept import Kept, step_of
from missing_physics.standard.normal import Places
from reference_model.effects.along import SensorAlong
from reference_model.effects.base import SensorEffect
from reference_model.effects.body_force import ForceEffect
from reference_model.effects.pushing import ForceAlong
from reference_model.effects.structure import StructureEffect
from reference_model.evaluation.model import RobotModel
from robot_model import InputError, Robot

__all__ = ["BaseColumns"]

Array = NDArray[np.float64]
Values = Mapping[str, float]

#: Derivatives of masses are taken again where a parameter has moved by this part of itself, or of its size.
FAR = 0.5
#: Changed robots whose masses along a recording are remembered: six sets of columns.
REMEMBERED = 48


class BaseColumns:
    """Columns of terms in the rates, those of the terms used last cached.

    Args:
        runs: rates of each recording.
        quiet: what each recording says itself, and what is removed from its columns.
        masks: which rows are compared, shape (K, m) each.
    """

    def __init__(
        self, runs: Sequence[Rates], quiet: Sequence[Vibration], masks: Sequence[NDArray[np.bool_]]
    ) -> None:
        self._runs, self._quiet, self._masks = runs, quiet, masks
        self._known: list[_Known] = [_Known() for _ in runs]
        self._kept = Kept[Array]()

    def prepare(self, terms: Sequence[Term], run: int) -> None:
        """Compute the columns of several terms, those of changes of the robot together."""
        wanted = {self._key(term, run): term for term in terms}
        alike: dict[tuple[object, ...], list[Term]] = {}
        for key, term in wanted.items():
            if self._kept.get(key) is None:
                which = (*term.key, *(p.name for p in term.free))
                one = which if isinstance(term.effect, StructureEffect) else key
                alike.setdefault(one, []).append(term)
        for group in alike.values():
            for term, whole in zip(group, _columns(group, self._runs[run], self._known[run])):
                found = self._quiet[run].removed(whole * self._masks[run][:, :, None])
                self._kept.keep(self._key(term, run), found)

    @staticmethod
    def _key(term: Term, run: int) -> tuple[object, ...]:
        return (*term.key, term.values, tuple(p.name for p in term.free), run)

    def acting(self, term: Term, run: int) -> tuple[Places, Array]:
        """All channels, since what is removed ties them together, and a term's columns, (K, m, 1 + P)."""
        self.prepare([term], run)
        found = self._kept.get(self._key(term, run))
        assert found is not None
        return np.arange(len(self._runs[run].channels)), found

    def contributed(self, terms: Sequence[Term], run: int) -> Array:
        """Sum of what terms contribute to the rates, shape (K, m)."""
        rates = self._runs[run]
        found = np.zeros((rates.time.size, len(rates.channels)))
        for term in terms:
            made = _made_by(term, rates, self._known[run])
            found += self._quiet[run].removed(made * self._masks[run])
        return found


@dataclass
class _Known:
    """What is known of changed robots along one recording.

    Attributes:
        changed: by their masses.
        near: with one number a step away, and the slope by which.
        slopes: derivatives of what masses determine by a parameter of an effect, and where they were taken.
    """

    changed: dict[tuple[object, ...], Changed] = field(default_factory=dict)
    near: dict[tuple[object, ...], tuple[Slope | None, Changed]] = field(default_factory=dict)
    slopes: dict[tuple[str, str], tuple[Values, Slope | None]] = field(default_factory=dict)


def _made_by(term: Term, rates: Rates, known: _Known) -> Array:
    """What a term contributes to the rows of one recording [rad/s], shape (K, m); NaN where it cannot be."""
    if isinstance(term.effect, SensorEffect):
        return _sensor(term, term.effect, rates)[:, :, 0]
    return rates.rows(_rates([term], [{}], rates, known))[:, :, 0]


def _columns(terms: Sequence[Term], rates: Rates, known: _Known) -> list[Array]:
    """Of terms of one effect, shape (K, m, 1 + P) each."""
    effect = terms[0].effect
    if isinstance(effect, SensorEffect):
        return [_sensor(term, effect, rates) for term in terms]
    steps = [{p.name: step_of(term, p) for p in term.free} for term in terms]
    count = 1 + len(steps[0])
    every = rates.rows(_rates(terms, steps, rates, known))
    found = []
    for k, own in enumerate(steps):
        values = every[:, :, k * count : (k + 1) * count]
        slopes = (values[:, :, 1:] - values[:, :, :1]) / np.array(list(own.values()))
        found.append(np.concatenate([values[:, :, :1], slopes], axis=2))
    return found


def _sensor(term: Term, effect: SensorEffect, rates: Rates) -> Array:
    """A gyro's error at the rates that the robot file predicts, and its derivatives to first order."""
    k, time = rates.channels.index(term.at), rates.dynamics.motion.time
    since, value = time - time[0], rates.predicted[:, k]
    read = effect.apply(since, value, term.parameters)
    rate = np.gradient(value, time)
    slopes = SensorAlong(effect).jacobian(since, value, rate, term.parameters, [p.name for p in term.free])
    own = rates.reduce(np.column_stack([read - value, slopes]))
    found = np.zeros((len(own), len(rates.channels), own.shape[1]))
    found[:, k] = own
    return found


def _rates(terms: Sequence[Term], steps: Sequence[Values], rates: Rates, known: _Known) -> Array:
    """Rates of the base that terms make, each followed by those a step of its numbers away, (G, 3, C)."""
    if isinstance(terms[0].effect, StructureEffect):
        return _shaken(terms, steps, rates, known)
    found = []
    for term, own in zip(terms, steps):
        assert isinstance(term.effect, ForceEffect)
        along, p = ForceAlong(term.effect, rates.dynamics.model.robot), term.parameters
        trials = [p, *({**p, name: p[name] + step} for name, step in own.items())]
        found += [along.wrench(rates.signals, each) for each in trials]
    return rates.floating.under(np.stack(found, axis=2))


def _shaken(terms: Sequence[Term], steps: Sequence[Values], rates: Rates, known: _Known) -> Array:
    """The base turned by what effects make of the robot, (G, 3, C); NaN where it cannot have them.

    To first order in how what is new answers to the known motion. All are integrated together.
    """
    count = 1 + len(steps[0])
    found = np.zeros((rates.floating.time.size, 3, count * len(terms)))
    real: dict[int, tuple[Changed, Changed]] = {}
    for k, (term, own) in enumerate(zip(terms, steps)):
        first, each = _variants(term, own, rates, known)
        if first is not None and each is not None:
            real |= {k * count + number: (first, one) for number, one in enumerate(each)}
        elif each is None:
            found[:, :, k * count : (k + 1) * count] = np.nan
    if real:
        which, pairs = list(real), list(real.values())
        turning = [first.turning for first, _ in pairs]
        stiffness, damping = (
            np.stack([part[w] + one.elasticity[w] for part, (_, one) in zip(turning, pairs)], axis=1)
            for w in (0, 1)
        )
        inertia = np.stack([one.inertia for _, one in pairs], axis=1)
        force = np.stack([one.force for _, one in pairs], axis=1)[..., None]
        places, speeds, _ = vibrating(inertia, stiffness, damping, force, rates.floating.step)
        for k, (number, (_, one)) in enumerate(zip(which, pairs)):
            found[:, :, number] = one.turned(places[:, k], speeds[:, k])[:, :, 0]
    return found


def _variants(
    term: Term, steps: Values, rates: Rates, known: _Known
) -> tuple[Changed | None, list[Changed] | None]:
    """The changed robot and what it is with single numbers a step away.

    Returns:
        One of the same masses as the first, and all; nothing of both where the robot cannot have the term,
        an empty list where that changes nothing.
    """
    values, robot, effect = term.parameters, rates.dynamics.model.robot, term.effect
    assert isinstance(effect, StructureEffect)
    try:
        changed = effect.changed(robot, term.at, values)
        if changed is robot:
            return None, []
    except InputError:
        return None, None
    first = _known_of(_model(changed), rates, known)
    here, each = _model(changed), [first.bending_as(_model(changed))]
    for name, step in steps.items():
        slope, model = _slope(term, name, known), here
        if slope is None:
            try:
                model = _model(effect.changed(robot, term.at, {**values, name: values[name] + step}))
            except InputError:
                return None, None
            other = _known_of(model, rates, known)
            if other is not first and _is_as_elastic(model, here):
                slope = first.slope(other, step)
                known.slopes[effect.id, name] = values, slope
        elif (near := (masses_of(here), name, step)) in known.near and known.near[near][0] is slope:
            other = known.near[near][1]
        else:
            other = first.moved(slope, step)
            known.near[near] = slope, other
            while len(known.near) > REMEMBERED:
                known.near.pop(next(iter(known.near)))
        each.append(other.bending_as(model))
    return first, each


def _is_as_elastic(one: RobotModel, other: RobotModel) -> bool:
    """Whether modes have the same stiffness and damping."""
    return all(np.array_equal(a, b) for a, b in zip(one.elasticity(), other.elasticity()))


def _slope(term: Term, name: str, known: _Known) -> Slope | None:
    """How masses change with a parameter, where that is known from near by and nothing else changes."""
    at, slope = known.slopes.get((term.effect.id, name), ({}, None))
    return None if not at or _is_far(term, at) else slope


def _is_far(term: Term, at: Values) -> bool:
    """Whether a parameter has moved by more than half of its size."""
    moved = ((abs(term.parameters[p.name] - at[p.name]), p, at[p.name]) for p in term.effect.estimated)
    return any(apart > FAR * max(abs(before), p.typical) for apart, p, before in moved if p.name in at)


def _known_of(model: RobotModel, rates: Rates, known: _Known) -> Changed:
    """The changed robot, or one of the same masses."""
    masses = masses_of(model)
    if masses not in known.changed:
        known.changed[masses] = Changed(model, rates)
        while len(known.changed) > REMEMBERED:
            known.changed.pop(next(iter(known.changed)))
    return known.changed[masses]


@lru_cache
def _model(robot: Robot) -> RobotModel:
    """Of a changed robot, for all recordings."""
    return RobotModel(robot)
