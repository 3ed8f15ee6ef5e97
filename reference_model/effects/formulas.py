"""The compiled functions of an effect at a place: contribution, derivatives, steps of its states."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, lru_cache

import casadi as ca

from reference_model.codegen.batched import Batched
from reference_model.effects.base import JointEffect, JointSignals
from reference_model.effects.scan import Scan
from reference_model.effects.stepping import step

__all__ = ["Formulas", "compiled", "formulas"]

Arms = tuple[float, float]

TIME = JointSignals.CHANNELS.index("time")


class Formulas:
    """The compiled functions of one effect.

    Constants are the effect's parameters and then the transition speed; rows are signals in the order of
    `JointSignals.CHANNELS`, followed by the direction if `directed`; sensitivities follow the states column
    by column.

    Attributes:
        torque: (row, constants[, states]) to the contribution.
        jacobian: (row, constants[, states and sensitivities]) to the contribution and its derivative with
            respect to the estimated parameters.
        states, sensitivities: chains of steps, without and with the sensitivities.
        first: (row, constants) to states and sensitivities at the first sample.
        error: (row, next row, constants, states, next states) to the torque's error in one step.
        channels: signals on which the contribution depends.
    """

    def __init__(
        self, effect: JointEffect, gear_ratio: float, bearing_arms: Arms, directed: bool = False
    ) -> None:
        symbols = {p.name: ca.SX.sym(p.name) for p in effect.parameters}
        transition = ca.SX.sym("transition")
        self._constants = ca.vertcat(*symbols.values(), transition)
        self._free = ca.vertcat(*(symbols[p.name] for p in effect.estimated))
        self._z = ca.SX.sym("z", effect.states)
        signals, self._row = JointSignals.symbols(
            gear_ratio=gear_ratio, bearing_arms=bearing_arms, transition=transition, directed=directed
        )
        torque = effect.torque(signals, symbols, self._z)
        self.torque = Batched(self._row_function(torque))
        rate = effect.state_rate(signals, symbols, self._z) if effect.states else ca.SX(0, 1)
        self._symbols, self._laws = symbols, ca.vertcat(torque, rate)
        self.channels = self.channels_without(frozenset())
        by_free = ca.jacobian(torque, self._free)
        if effect.states:
            self._compile_steps(self._row_function(rate), torque, by_free)
            self._compile_first(effect.initial_state(signals, symbols))
        elif self._free.shape[0]:
            self.jacobian = Batched(self._row_function(torque, by_free.T))

    @cache  # noqa: B019  formulas are cached for the process's lifetime, too
    def channels_without(self, zero: frozenset[str]) -> frozenset[str]:
        """Signals on which the contribution depends if these parameters are zero."""
        laws = self._laws
        if zero:
            symbols = ca.vertcat(*(self._symbols[name] for name in sorted(zero)))
            laws = ca.simplify(ca.substitute(laws, symbols, ca.SX.zeros(symbols.shape)))
        used = ca.which_depends(laws, self._row, 1, False)
        return frozenset(name for name, uses in zip(JointSignals.CHANNELS, used) if uses)

    def _compile_first(self, first: ca.SX) -> None:
        by_free = ca.vec(ca.densify(ca.jacobian(first, self._free)))
        self.first = compiled([self._row, self._constants], ca.vertcat(first, by_free))

    def _compile_steps(self, rate: ca.Function, torque: ca.SX, by_free: ca.SX) -> None:
        z, count = self._z, self._row.shape[0]
        begin, end = ca.SX.sym("u0", count), ca.SX.sym("u1", count)
        after = step(
            lambda state, row: rate(row, self._constants, state), z, begin, end, end[TIME] - begin[TIME]
        )
        advance = compiled([z, begin, end, self._constants], after)
        self.states = Scan(advance)
        sensitivity = ca.SX.sym("S", z.shape[0], self._free.shape[0])
        carried = ca.jacobian(after, z) @ sensitivity + ca.jacobian(after, self._free)
        both = ca.vertcat(z, ca.vec(sensitivity))
        chain = ca.vertcat(after, ca.vec(carried))
        self.sensitivities = Scan(compiled([both, begin, end, self._constants], chain))
        total = by_free + ca.jacobian(torque, z) @ sensitivity
        self.jacobian = Batched(compiled([self._row, self._constants, both], torque, total.T))
        self.error = Batched(self._step_error(torque, advance))

    def _step_error(self, torque: ca.SX, advance: ca.Function) -> ca.Function:
        """Torque after one step minus torque after two half steps; of rows and states at both ends."""
        z, constants, count = self._z, self._constants, self._row.shape[0]
        after = ca.SX.sym("z1", z.shape[0])
        begin, end = ca.SX.sym("u0", count), ca.SX.sym("u1", count)
        middle = (begin + end) / 2
        at_end = ca.Function("torque", [self._row, constants, z], [torque])
        halves = advance(advance(z, begin, middle, constants), middle, end, constants)
        error = at_end(end, constants, after) - at_end(end, constants, halves)
        return compiled([begin, end, constants, z, after], error)

    def _row_function(self, *outputs: ca.SX) -> ca.Function:
        """A function of signals, constants and, where there are any, states."""
        states = [self._z] if self._z.shape[0] else []
        return compiled([self._row, self._constants, *states], *outputs)


def compiled(inputs: Sequence[ca.SX], *outputs: ca.SX) -> ca.Function:
    """A function with dense outputs and common subexpressions computed once."""
    return ca.Function("along", inputs, [ca.densify(output) for output in outputs], {"cse": True})


@lru_cache(maxsize=256)
def formulas(effect: JointEffect, gear_ratio: float, bearing_arms: Arms, directed: bool = False) -> Formulas:
    """The formulas of an effect at a place, compiled once."""
    return Formulas(effect, gear_ratio, bearing_arms, directed)
