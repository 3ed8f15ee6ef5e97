"""Repeated application of a step function along a series, from each result to the next."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.codegen.compiled import EARNS_AFTER, compiled_loops

__all__ = ["Scan"]

Array = NDArray[np.float64]

#: Steps per call of a chain that cannot fail.
BLOCK = 256
#: Steps per attempt of the cheap function, and of the safe one where it fails; the latter doubles meanwhile.
TRY, DETOUR = 64, 8


class Scan:
    """A chain x_{i+1} = step(x_i, row_i, row_{i+1}, constants).

    Once its steps exceed `compiled.EARNS_AFTER`, a function runs as compiled C where possible, with the same
    results.

    Args:
        step: function of the four columns above, giving the next x; all dense.
        easy: a cheaper function of the same arguments, giving the next x and whether it is valid (1) or has
            to be computed by `step` (anything else). It is tried first.
    """

    def __init__(self, step: ca.Function, easy: ca.Function | None = None) -> None:
        self._state, self._row, _, self._constants = (step.size1_in(k) for k in range(4))
        self._sure = _Earning(step, [DETOUR << k for k in range(4)] if easy else [BLOCK])
        self._easy = _Earning(easy, [TRY]) if easy else None

    def __call__(self, first: Array, rows: Array, constants: Array) -> Array:
        """The chain from `first`, shape (n,), along `rows`, shape (N, r): shape (N, n)."""
        result = np.empty((len(rows), self._state))
        result[0] = first
        n, end, at, sought = self._state, len(rows) - 1, 0, 0
        (self._easy or self._sure).take(end)
        sure = {size: _Chain(function, n, constants) for size, function in self._sure.chains.items()}
        easy = _Chain(self._easy.chains[TRY], n, constants) if self._easy else None
        detour = min(sure)
        while at < end:
            if easy:
                count = easy(rows, result, at)
                failed = np.flatnonzero(~(easy.holds[:count] == 1))
                done = int(failed[0]) if failed.size else count
                at += done
                if not failed.size:
                    continue
                detour = min(sure) if done else min(2 * detour, max(sure))
                sought += detour
            at += sure[detour](rows, result, at)
        self._sure.take(sought)
        return result


class _Earning:
    """A step with its chains of several lengths, compiled once the number of steps justifies it."""

    def __init__(self, step: ca.Function, sizes: list[int]) -> None:
        self._step, self._sizes, self._taken = step, sizes, 0
        self._decided = not step.is_a("SXFunction")  # other functions call CasADi's own solvers and splines
        self.chains = dict(zip(sizes, self._chained(step)))

    def _chained(self, step: ca.Function) -> list[ca.Function]:
        return [step.mapaccum(f"chain{size}", size) for size in self._sizes]

    def take(self, steps: int) -> None:
        """Count steps that follow or were made."""
        self._taken += steps
        if self._decided or self._taken < EARNS_AFTER:
            return
        self._decided = True
        self.chains = dict(zip(self._sizes, compiled_loops(self._step, self._chained).functions))


class _Chain:
    """A chained function with its arrays."""

    def __init__(self, function: ca.Function, state: int, constants: Array) -> None:
        size, row = function.size2_in(1), function.size1_in(1)
        self._size, self._state = size, np.zeros(state)
        self._begin, self._end = np.zeros((size, row)), np.zeros((size, row))
        self._fixed, self._found = np.tile(constants, (size, 1)), np.zeros((size, state))
        #: Whether each step of the last call is valid (1).
        self.holds = np.ones(size)
        self._buffer, self._run = function.buffer()
        for k, array in enumerate((self._state, self._begin, self._end, self._fixed)):
            self._buffer.set_arg(k, memoryview(array))  # type: ignore[call-arg, arg-type]
        for k, array in enumerate((self._found, self.holds)[: function.n_out()]):
            self._buffer.set_res(k, memoryview(array))  # type: ignore[call-arg, arg-type]

    def __call__(self, rows: Array, result: Array, at: int) -> int:
        """Fill `result` after row `at`; returns the number of rows filled."""
        count = min(self._size, len(rows) - 1 - at)
        self._state[:] = result[at]
        self._begin[:count] = rows[at : at + count]
        self._end[:count] = rows[at + 1 : at + 1 + count]
        self._run()
        result[at + 1 : at + 1 + count] = self._found[:count]
        return count
