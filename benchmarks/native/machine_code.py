"""Functions of Exudyn's coordinates as compiled C, with as little Python around them as possible.

Exudyn passes Python lists to a user function. The code here instead reads the present coordinates and
multipliers from Exudyn's memory, so that a call costs storing the time, a call through ctypes and a list of
results: an overhead of about a microsecond.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

__all__ = ["MachineCode", "System"]

Array = NDArray[np.float64]
#: Signature called by Exudyn: its system, the time and unused arguments.


class System:
    """Memory of an assembled Exudyn system that the compiled code reads.

    Attributes:
        time: [s], to be stored before each call, shape (1,).
        weights: of the derivatives of a Jacobian by coordinates, rates and accelerations, shape (3,).
    """

    def __init__(self, mbs: Any) -> None:
        data = mbs.systemData
        self.time, self.weights = np.zeros(1), np.zeros(3)
        self._kept = [
            data.GetODE2Coordinates(copy=False),
            data.GetODE2Coordinates_t(copy=False),
            data.GetODE2Coordinates_tt(copy=False),
            data.GetAECoordinates(copy=False),
        ]

    @property
    def addresses(self) -> Sequence[int]:
        """Of time, coordinates, rates, accelerations, multipliers and weights."""
        every = (self.time, *self._kept, self.weights)
        return [int(array.ctypes.data) for array in every]


class MachineCode:
    """One compiled function of a system's time, coordinates, rates, accelerations, multipliers and weights.

    Attributes:
        value: its result, in the same memory after every call; a matrix by rows.

    Args:
        library: that holds the function.
        function: as it was compiled; one dense output.
        system: of the coordinates.
    """

    def __init__(self, library: ctypes.CDLL, function: ca.Function, system: System) -> None:
        rows, columns = function.size_out(0)
        self.value: Array = np.zeros((columns, rows) if columns > 1 else rows)
        arguments = (ctypes.c_void_p * max(function.sz_arg(), function.n_in()))(*system.addresses)
        results = (ctypes.c_void_p * max(function.sz_res(), 1))(self.value.ctypes.data)
        integers = np.zeros(max(function.sz_iw(), 1), dtype=np.int64)
        numbers = np.zeros(max(function.sz_w(), 1))
        self._kept = system, integers, numbers, library
        self._code = getattr(library, function.name())
        self._code.argtypes = [ctypes.c_void_p] * 4 + [ctypes.c_int]
        scratch = (ctypes.c_void_p(array.ctypes.data) for array in (integers, numbers))
        self._arguments = arguments, results, *scratch, 0

    def __call__(self) -> Array:
        """Its value at Exudyn's present state."""
        self._code(*self._arguments)
        return self.value
