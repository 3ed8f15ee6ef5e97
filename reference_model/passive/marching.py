"""Runge-Kutta steps of vibrating links over many samples in one call."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np

from reference_model.codegen.compiled import EARNS_AFTER, compiled

__all__ = ["FASTER", "PHASE_STEP", "Marching"]

#: Largest phase change of the fastest mode in one Runge-Kutta step [rad]: the phase error is then 1e-5 of a
#: cycle per cycle.
PHASE_STEP = 0.3
#: A mode may be faster in other poses than in the first one by up to about this factor.
FASTER = 1.5


class Marching:
    """Functions that march over blocks of samples, compiled once they have been used often."""

    def __init__(
        self, rate: ca.Function, interval: Callable[[ca.Function, int], ca.Function], block: int
    ) -> None:
        """March by the rates of a state.

        Args:
            rate: of the state.
            interval: function over one interval, of the rate and the number of steps in it.
            block: intervals of one call.
        """
        self._rate, self._interval, self._block = rate, interval, block
        self._made: dict[tuple[int, bool], ca.Function] = {}
        self._seen = 0

    def over(self, turning: float, steps: int) -> ca.Function:
        """A block of intervals, in each of which the phase of the fastest mode changes by at most `turning`.

        Args:
            turning: see above [rad].
            steps: number of intervals to come, which decides whether compiling is worth it.
        """
        parts = max(1, int(np.ceil(turning / PHASE_STEP)))
        self._seen += 4 * parts * steps
        often = self._seen >= EARNS_AFTER
        if (parts, often) not in self._made:
            rate = compiled([self._rate]).functions[0] if often else self._rate
            self._made[parts, often] = self._interval(rate, parts).mapaccum(self._block)
        return self._made[parts, often]
