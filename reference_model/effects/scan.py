"""Running a step function along a series, each result being the next one's start."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

__all__ = ["Scan"]

#: Steps per call of the chained function.
BLOCK = 256


class Scan:
    """A chain x_{i+1} = step(x_i, row_i, row_{i+1}, constants).

    Args:
        step: function of the four columns above, giving the next x; all dense.
    """

    def __init__(self, step: ca.Function) -> None:
        self._chained = step.mapaccum("chain", BLOCK)
        self._state, self._row, _, self._constants = (step.size1_in(k) for k in range(4))

    def __call__(
        self, first: NDArray[np.float64], rows: NDArray[np.float64], constants: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """The chain from `first`, shape (n,), along `rows`, shape (N, r): shape (N, n)."""
        result = np.empty((len(rows), self._state))
        result[0] = first
        state = np.array(first, dtype=float)
        begin, end = np.zeros((BLOCK, self._row)), np.zeros((BLOCK, self._row))
        fixed = np.tile(constants, (BLOCK, 1))
        chain = np.zeros((BLOCK, self._state))
        buffer, run = self._chained.buffer()
        for k, array in enumerate((state, begin, end, fixed)):
            buffer.set_arg(k, memoryview(array))  # type: ignore[call-arg, arg-type]
        buffer.set_res(0, memoryview(chain))  # type: ignore[call-arg, arg-type]
        for i in range(0, len(rows) - 1, BLOCK):
            count = min(BLOCK, len(rows) - 1 - i)
            begin[:count] = rows[i : i + count]
            end[:count] = rows[i + 1 : i + 1 + count]
            run()
            result[i + 1 : i + 1 + count] = chain[:count]
            state[:] = chain[count - 1]
        return result
