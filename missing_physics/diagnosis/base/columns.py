"""Contributions of terms to the rates of a free base, and their derivatives by the terms' parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from missing_physics.evaluation.vibration.newmark import vibrating
from missing_physics.evaluation.vibration.whitening import Vibration
from missing_physics.hypotheses import Term
from missing_physics.inference.kept import Kept, step_of
from missing_physics.motion.base.changed import Changed, Slope, masses_of
from missing_physics.motion.base.rates import Rates
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

#: Derivatives by a parameter are recomputed once it changed by this fraction of its value or typical value.
FAR = 0.5
#: Cached changed robots along one recording: six sets of columns.
REMEMBERED = 48


class BaseColumns:
    """Columns of terms in the rates; those of the terms used last are cached.

    Args:
        runs: rates of each recording.
        quiet: nuisance signals of each recording, which are removed from its columns.
        masks: masks of the rows that are compared, shape (K, m) each.
    """

    def __init__(
        self, runs: Sequence[Rates], quiet: Sequence[Vibration], masks: Sequence[NDArray[np.bool_]]
    ) -> None:
        self._runs, self._quiet, self._masks = runs, quiet, masks
        self._caches: list[_Known] = [_Known() for _ in runs]
        self._kept = Kept[Array]()

    def prepare(self, terms: Sequence[Term], run: int) -> None:
        """Compute the columns of several terms; those of terms that change the robot together."""
        wanted = {self._key(term, run): term for term in terms}
        together: dict[tuple[object, ...], list[Term]] = {}
        for key, term in wanted.items():
            if self._kept.get(key) is None:
                which = (*term.key, *(p.name for p in term.free))
                one = which if isinstance(term.effect, StructureEffect) else key
                together.setdefault(one, []).append(term)
        for group in together.values():
            for term, whole in zip(group, _columns(group, self._runs[run], self._caches[run])):
                found = self._quiet[run].removed(whole * self._masks[run][:, :, None])
                self._kept.keep(self._key(term, run), found)

    @staticmethod
    def _key(term: Term, run: int) -> tuple[object, ...]:
        return (*term.key, term.values, tuple(p.name for p in term.free), run)

    def acting(self, term: Term, run: int) -> tuple[Places, Array]:
        """All channels, since removing nuisance signals couples them, and a term's columns, (K, m, 1 + P)."""
        self.prepare([term], run)
        found = self._kept.get(self._key(term, run))
        assert found is not None
        return np.arange(len(self._runs[run].channels)), found

    def contributed(self, terms: Sequence[Term], run: int) -> Array:
        """Sum of the contributions of terms to the rates, shape (K, m)."""
        rates = self._runs[run]
        found = np.zeros((rates.time.size, len(rates.channels)))
        for term in terms:
            made = _contribution(term, rates, self._caches[run])
            found += self._quiet[run].removed(made * self._masks[run])
        return found


@dataclass
class _Known:
    """Cache of changed robots along one recording.

    Attributes:
        changed: robots by their masses.
        near: robots with one parameter a step away, and the slope used.
        slopes: derivatives of mass-dependent quantities by an effect's parameter, and the parameters there.
    """

    changed: dict[tuple[object, ...], Changed] = field(default_factory=dict)
    near: dict[tuple[object, ...], tuple[Slope | None, Changed]] = field(default_factory=dict)
    slopes: dict[tuple[str, str], tuple[Values, Slope | None]] = field(default_factory=dict)


def _contribution(term: Term, rates: Rates, known: _Known) -> Array:
    """Contribution of a term to the rows of one recording [rad/s], (K, m); NaN if the term is impossible."""
    if isinstance(term.effect, SensorEffect):
        return _sensor(term, term.effect, rates)[:, :, 0]
    return rates.rows(_rates([term], [{}], rates, known))[:, :, 0]


def _columns(terms: Sequence[Term], rates: Rates, known: _Known) -> list[Array]:
    """Columns of terms of one effect, shape (K, m, 1 + P) each."""
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
    """A gyro's error at the rates predicted by the robot file, and its derivatives to first order."""
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
    """Rates of the base due to terms, each followed by those with one parameter a step away, (G, 3, C)."""
    if isinstance(terms[0].effect, StructureEffect):
        return _rates_of_changed(terms, steps, rates, known)
    found = []
    for term, own in zip(terms, steps):
        assert isinstance(term.effect, ForceEffect)
        along, p = ForceAlong(term.effect, rates.dynamics.model.robot), term.parameters
        trials = [p, *({**p, name: p[name] + step} for name, step in own.items())]
        found += [along.wrench(rates.signals, each) for each in trials]
    return rates.floating.under(np.stack(found, axis=2))


def _rates_of_changed(terms: Sequence[Term], steps: Sequence[Values], rates: Rates, known: _Known) -> Array:
    """Rates of the base due to effects that change the robot, (G, 3, C); NaN if they are impossible.

    To first order in the response of the new modes to the known motion. All are integrated together.
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
    """The changed robot, and its variants with single parameters a step away.

    Returns:
        A robot with the masses of the first variant, and all variants, the unchanged parameters first. Both
        are None if the robot cannot have the term; the list is empty if the term changes nothing.
    """
    values, robot, effect = term.parameters, rates.dynamics.model.robot, term.effect
    assert isinstance(effect, StructureEffect)
    try:
        changed = effect.changed(robot, term.at, values)
        if changed is robot:
            return None, []
    except InputError:
        return None, None
    first = _cached(_model(changed), rates, known)
    here, each = _model(changed), [first.bending_as(_model(changed))]
    for name, step in steps.items():
        slope, model = _slope(term, name, known), here
        if slope is None:
            try:
                model = _model(effect.changed(robot, term.at, {**values, name: values[name] + step}))
            except InputError:
                return None, None
            other = _cached(model, rates, known)
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
    """Whether the modes of two models have the same stiffness and damping."""
    return all(np.array_equal(a, b) for a, b in zip(one.elasticity(), other.elasticity()))


def _slope(term: Term, name: str, known: _Known) -> Slope | None:
    """Cached derivative by a parameter; None if it is unknown, was taken too far away, or does not apply."""
    at, slope = known.slopes.get((term.effect.id, name), ({}, None))
    return None if not at or _is_far(term, at) else slope


def _is_far(term: Term, at: Values) -> bool:
    """Whether a parameter has changed by more than the fraction `FAR`."""
    moved = ((abs(term.parameters[p.name] - at[p.name]), p, at[p.name]) for p in term.effect.estimated)
    return any(apart > FAR * max(abs(before), p.typical) for apart, p, before in moved if p.name in at)


def _cached(model: RobotModel, rates: Rates, known: _Known) -> Changed:
    """The changed robot, or a cached one with the same masses."""
    masses = masses_of(model)
    if masses not in known.changed:
        known.changed[masses] = Changed(model, rates)
        while len(known.changed) > REMEMBERED:
            known.changed.pop(next(iter(known.changed)))
    return known.changed[masses]


@lru_cache
def _model(robot: Robot) -> RobotModel:
    """Model of a changed robot, cached for all recordings."""
    return RobotModel(robot)
