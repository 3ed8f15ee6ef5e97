"""Effects evaluated along a known motion, with exact derivatives with respect to their parameters.

A joint effect without states is a formula of the signals at each sample. States of an effect (the bristles of
LuGre, the delivered torque of a lag) are integrated along the samples, together with their sensitivities;
signals are linear between samples, and an interval is subdivided where the step's error requires it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.codegen.batched import Batched
from reference_model.effects.base import JointEffect, SensorEffect, SensorSignals, YieldingGear
from reference_model.effects.formulas import compiled, formulas
from reference_model.effects.scan import Scan

__all__ = ["EffectAlong", "GearAlong", "SensorAlong"]

Array = NDArray[np.float64]

#: Error that one interval between samples may add to the torque, relative to its largest value. A tenth
#: of the resolution of torque sensors; errors of a bristle decay as it slides.
TOLERANCE = 1e-4
#: Every how many samples the torque is looked at for that largest value.
SCALED = 8
#: An interval is divided into at most this many steps.
MOST_STEPS = 128


class EffectAlong:
    """A joint effect at one place, along recorded or simulated signals.

    Args:
        effect: catalogue entry; its equations are compiled once for each place and kept.
        gear_ratio: motor turns per joint turn.
        bearing_arms: radial and axial arm [m].
        transition: speed over which discontinuous laws are smoothed [rad/s or m/s].
        directed: signals have the direction of motion, -1 to 1, as an additional last column, which laws use
            as the sign of the velocity; for effects without states.
    """

    def __init__(
        self,
        effect: JointEffect,
        *,
        gear_ratio: float = 1.0,
        bearing_arms: tuple[float, float] = (0.0, 0.0),
        transition: float = 1e-4,
        directed: bool = False,
    ) -> None:
        self.effect = effect
        self.transition = transition
        self._formulas = formulas(effect, gear_ratio, bearing_arms, directed)
        self._free = [p.name for p in effect.estimated]

    @property
    def channels(self) -> frozenset[str]:
        """Members of `JointSignals.CHANNELS` on which the contribution depends."""
        return self._formulas.channels

    def channels_without(self, zero: frozenset[str]) -> frozenset[str]:
        """`channels` if these parameters are zero."""
        return self._formulas.channels_without(zero)

    def torque(
        self, signals: Array, parameters: Mapping[str, float], *, transition: float | None = None
    ) -> Array:
        """Generalised force on the joint [N m or N], shape (N,).

        Args:
            signals: columns in the order of `JointSignals.CHANNELS`, time increasing, shape (N, 11).
            parameters: a value for every parameter of the effect that has no default.
            transition: in place of that of the constructor.
        """
        constants = self._constants(parameters, transition)
        if not self.effect.states:
            return self._formulas.torque(signals, constants)[0][:, 0]
        first = self._first(signals, constants)[: self.effect.states]
        states = self._accurate(self._formulas.states, first, signals, constants)
        return self._formulas.torque(signals, constants, states)[0][:, 0]

    def jacobian(
        self,
        signals: Array,
        parameters: Mapping[str, float],
        names: Sequence[str],
        *,
        transition: float | None = None,
    ) -> Array:
        """Derivative of `torque` with respect to the estimated parameters `names`, shape (N, len(names))."""
        return self.evaluate(signals, parameters, names, transition=transition)[1]

    def evaluate(
        self,
        signals: Array,
        parameters: Mapping[str, float],
        names: Sequence[str],
        *,
        transition: float | None = None,
    ) -> tuple[Array, Array]:
        """`torque` and `jacobian` in one pass, which costs little more than either."""
        columns = [self._free.index(name) for name in names]
        constants = self._constants(parameters, transition)
        if self.effect.states:
            first = self._first(signals, constants)
            states = [self._accurate(self._formulas.sensitivities, first, signals, constants)]
        elif not columns:
            torque = self._formulas.torque(signals, constants)[0][:, 0]
            return torque, np.zeros((len(torque), 0))
        else:
            states = []
        force, jacobian = self._formulas.jacobian(signals, constants, *states)
        return force[:, 0], jacobian[:, columns]

    def _constants(self, parameters: Mapping[str, float], transition: float | None) -> Array:
        speed = self.transition if transition is None else transition
        given = {**self.effect.defaults(), **parameters}
        return np.array([*(given[p.name] for p in self.effect.parameters), speed], dtype=float)

    def _first(self, rows: Array, constants: Array) -> Array:
        """State and sensitivities at the first sample."""
        return np.asarray(self._formulas.first(rows[0], constants)).ravel()

    def _accurate(self, chain: Scan, first: Array, signals: Array, constants: Array) -> Array:
        """States and further columns of the chain at the samples, with intervals subdivided as needed."""
        found = chain(first, signals, constants)
        states = found[:, : self.effect.states]
        some = slice(None, None, SCALED)
        scale = float(np.max(np.abs(self._formulas.torque(signals[some], constants, states[some])[0])))
        ends = signals[:-1], signals[1:], constants, states[:-1], states[1:]
        errors = self._formulas.error(*ends)[0][:, 0]
        # A method of second order: dividing an interval by m divides its error by m^2.
        wanted = np.sqrt(np.abs(errors) / max(TOLERANCE * scale, 1e-300))
        steps = np.ceil(np.clip(np.nan_to_num(wanted), 1, MOST_STEPS)).astype(int)
        if not (steps > 1).any():
            return found
        places = np.concatenate([[0], np.cumsum(steps)])
        interval = np.repeat(np.arange(len(steps)), steps)
        share = ((np.arange(places[-1]) - places[interval]) / steps[interval])[:, None]
        divided = signals[interval] + share * (signals[interval + 1] - signals[interval])
        return chain(first, np.vstack([divided, signals[-1:]]), constants)[places]


@lru_cache(maxsize=64)
def _sensor_formulas(effect: SensorEffect) -> tuple[Batched, Batched | None]:
    symbols = {p.name: ca.SX.sym(p.name) for p in effect.parameters}
    row = ca.SX.sym("s", 3)
    error = effect.error(SensorSignals(*ca.vertsplit(row)), symbols)
    inputs = [row, ca.vertcat(*symbols.values())]
    value = Batched(compiled(inputs, error))
    if not effect.estimated:
        return value, None
    by_free = ca.jacobian(error, ca.vertcat(*(symbols[p.name] for p in effect.estimated)))
    return value, Batched(compiled(inputs, by_free.T))


class SensorAlong:
    """A sensor effect's error along a channel, to first order; all arrays have shape (N,)."""

    def __init__(self, effect: SensorEffect) -> None:
        self.effect = effect
        self._error, self._jacobian = _sensor_formulas(effect)
        self._free = [p.name for p in effect.estimated]

    def error(self, time: Array, value: Array, rate: Array, parameters: Mapping[str, float]) -> Array:
        """Measured minus true, in the channel's unit, shape (N,)."""
        return self._error(*self._arguments(time, value, rate, parameters))[0][:, 0]

    def jacobian(
        self,
        time: Array,
        value: Array,
        rate: Array,
        parameters: Mapping[str, float],
        names: Sequence[str],
    ) -> Array:
        """Derivative of `error` with respect to the estimated parameters `names`, shape (N, len(names))."""
        columns = [self._free.index(name) for name in names]
        if self._jacobian is None:
            return np.zeros((len(time), 0))
        return self._jacobian(*self._arguments(time, value, rate, parameters))[0][:, columns]

    def _arguments(
        self, time: Array, value: Array, rate: Array, parameters: Mapping[str, float]
    ) -> tuple[Array, Array]:
        constants = np.array([parameters[p.name] for p in self.effect.parameters], dtype=float)
        return np.column_stack([time, value, rate]), constants


@lru_cache(maxsize=16)
def _gear_formulas(effect: YieldingGear) -> Batched:
    symbols = {p.name: ca.SX.sym(p.name) for p in effect.parameters}
    row = ca.SX.sym("s", 2)
    twist = effect.twist(row[0], row[1], symbols)
    by_free = ca.jacobian(twist, ca.vertcat(*(symbols[p.name] for p in effect.estimated)))
    return Batched(compiled([row, ca.vertcat(*symbols.values())], ca.horzcat(twist, by_free).T))


class GearAlong:
    """The twist of a compliant gear, along the torque that it transmits."""

    def __init__(self, effect: YieldingGear) -> None:
        self.effect = effect
        self._twist = _gear_formulas(effect)

    def evaluate(self, torque: Array, rate: Array, parameters: Mapping[str, float]) -> Array:
        """Twist [rad or m] and its derivatives with respect to estimated parameters, shape (N, 1 + P).

        Args:
            torque, rate: transmitted torque [N m or N] and its rate, shape (N,).
            parameters: a value for every parameter that has no default.
        """
        given = {**self.effect.defaults(), **parameters}
        constants = np.array([given[p.name] for p in self.effect.parameters], dtype=float)
        return self._twist(np.column_stack([torque, rate]), constants)[0]
