"""Evaluation of CasADi functions with little overhead: over recordings block by block, or repeatedly."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.codegen.compiled import EARNS_AFTER, compiled_loops

__all__ = ["Batched", "Chain", "InPlace", "Single"]

#: Samples per call of the mapped function: large enough that the call itself costs nothing, small enough
#: that its arguments stay in the processor's cache.
BLOCK = 256
#: Samples for each processor in a call that several share; it starts a thread for each.
SHARE = 2048
#: More of them do not pay for their threads.
MOST_PROCESSORS = 4


class Batched:
    """A function of column vectors, applied to many samples.

    Args:
        function: dense column inputs and outputs.

    Calling it with one array per input, shape (N, rows) or (rows,) when the same for all samples, gives one
    array per output, shape (N, rows). Long calls of functions of plain operations are distributed over
    processors, and once the samples of all calls exceed `compiled.EARNS_AFTER` they run as compiled C where
    that is possible, with the same results.

    Attributes:
        note: how it runs.
    """

    def __init__(self, function: ca.Function) -> None:
        self._function = function
        plain = function.is_a("SXFunction")  # other functions call CasADi's own solvers and splines
        self._maps = _shared(_mapped(function)) if plain else {BLOCK: function.map(BLOCK)}
        self._inputs = [function.size1_in(k) for k in range(function.n_in())]
        self._outputs = [function.size1_out(k) for k in range(function.n_out())]
        self._seen = 0
        self._decided = not plain
        self.note = "CasADi's virtual machine"

    def __call__(self, *arrays: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        samples = max((len(a) for a in arrays if np.ndim(a) == 2), default=1)
        self._consider(samples)
        results = tuple(np.empty((samples, rows)) for rows in self._outputs)
        done = 0
        for size, mapped in sorted(self._maps.items(), reverse=True):
            count = samples - done if size == BLOCK else (samples - done) // size * size
            if count:
                self._run(mapped, size, arrays, results, slice(done, done + count))
            done += count
        return results

    def _run(
        self,
        mapped: ca.Function,
        size: int,
        arrays: Sequence[NDArray[np.float64]],
        results: Sequence[NDArray[np.float64]],
        part: slice,
    ) -> None:
        """Fill a part of the results, `size` samples at a time."""
        scratch_in = [np.zeros((size, rows)) for rows in self._inputs]
        scratch_out = [np.zeros((size, rows)) for rows in self._outputs]
        buffer, run = mapped.buffer()
        for k, array in enumerate(scratch_in):
            buffer.set_arg(k, memoryview(array))  # type: ignore[call-arg, arg-type]
        for k, array in enumerate(scratch_out):
            buffer.set_res(k, memoryview(array))  # type: ignore[call-arg, arg-type]
        for array, scratch in zip(arrays, scratch_in):
            if np.ndim(array) == 1:
                scratch[:] = array
        for start in range(part.start, part.stop, size):
            count = min(size, part.stop - start)
            for array, scratch in zip(arrays, scratch_in):
                if np.ndim(array) == 2:
                    scratch[:count] = array[start : start + count]
            run()
            for result, scratch in zip(results, scratch_out):
                result[start : start + count] = scratch[:count]

    def _consider(self, samples: int) -> None:
        """Compile when the evaluations so far and the coming ones justify it."""
        self._seen += samples
        if self._decided or self._seen < EARNS_AFTER:
            return
        self._decided = True
        code = compiled_loops(self._function, _mapped)
        self._maps, self.note = _shared(code.functions), code.note


def _mapped(function: ca.Function) -> list[ca.Function]:
    return [function.map(BLOCK), function.map(SHARE)]


def _shared(mapped: Sequence[ca.Function]) -> dict[int, ca.Function]:
    """Functions of so many samples, the long one shared among processors; of `_mapped`."""
    block, share = mapped
    count = _processors()
    return {BLOCK: block} | ({count * SHARE: share.map(count, "thread", count)} if count > 1 else {})


@cache
def _processors() -> int:
    """Number of threads for long calls: `OMP_NUM_THREADS`, as for NumPy's libraries."""
    threads = os.environ.get("OMP_NUM_THREADS", "")
    return min(int(threads) if threads.isdecimal() and int(threads) else os.cpu_count() or 1, MOST_PROCESSORS)


class InPlace:
    """A function of column vectors, evaluated in place: nothing is copied.

    Args:
        function: dense inputs and outputs.

    Attributes:
        inputs: one array for each input, shape (rows,), to be written into.
        outputs: one array for each output, of its shape; every evaluation overwrites them.
        evaluate: reads the inputs and fills the outputs.
    """

    def __init__(self, function: ca.Function) -> None:
        buffer, self.evaluate = function.buffer()
        self.inputs = tuple(np.zeros(function.size1_in(k)) for k in range(function.n_in()))
        self.outputs = tuple(np.zeros(function.size_out(k), order="F") for k in range(function.n_out()))
        for k, column in enumerate(self.inputs):
            buffer.set_arg(k, memoryview(column))  # type: ignore[call-arg, arg-type]
        for k, result in enumerate(self.outputs):
            buffer.set_res(k, memoryview(result.T))  # type: ignore[call-arg, arg-type]
        # A reference to `evaluate` alone keeps all its arrays alive.
        self.evaluate.kept = function, buffer, self.inputs, self.outputs


class Single:
    """A function of column vectors, called repeatedly with plain arrays.

    Args:
        function: dense column inputs, dense outputs.

    Calling it with numbers or arrays gives new arrays of the outputs' shapes.
    """

    def __init__(self, function: ca.Function) -> None:
        self._own = InPlace(function)

    def __call__(self, *values: float | NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        for array, value in zip(self._own.inputs, values):
            array[:] = value
        self._own.evaluate()
        return tuple(array.copy() for array in self._own.outputs)


class Chain:
    """A function of its last result and of one more column, called many times without returning to Python.

    Args:
        function: made by `mapaccum`: the first of its results is the next call's first input.
        count: calls in a row.

    Calling it with the first input, shape (rows,), and at most `count` more columns, shape (N, K), gives
    fresh arrays of the results, shape (N, rows) each.
    """

    def __init__(self, function: ca.Function, count: int) -> None:
        self._function = function  # the buffer does not keep it alive
        self._buffer, self._run = function.buffer()
        self._first = np.zeros(function.size1_in(0))
        self._more = np.zeros((count, function.size1_in(1)))
        self._outputs = [np.zeros((count, function.size1_out(k))) for k in range(function.n_out())]
        for k, array in enumerate((self._first, self._more)):
            self._buffer.set_arg(k, memoryview(array))  # type: ignore[call-arg, arg-type]
        for k, array in enumerate(self._outputs):
            self._buffer.set_res(k, memoryview(array))  # type: ignore[call-arg, arg-type]

    def __call__(
        self, first: NDArray[np.float64], more: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], ...]:
        self._first[:] = first
        self._more[: len(more)] = more
        self._run()
        return tuple(array[: len(more)].copy() for array in self._outputs)
