"""Exudyn at its fastest, with no Python code during the run except calls of compiled functions.

Rigid robots are `ObjectKinematicTree`, which explicit Runge-Kutta methods can integrate, with or without
error control. Flexible ones are bodies, constraints and `ObjectFFRFreducedOrder`, for which Exudyn has
implicit methods of second order at fixed steps. Bodies and modes come from `exudyn_model`. Control and
friction are symbolic user functions, which Exudyn evaluates in C++ (`laws`, `lugre`), or, where these are not
possible, user functions in C (`compiled`).
"""

from benchmarks.native.compiled import CompiledLaws
from benchmarks.native.engine import EXPLICIT, IMPLICIT, LOOSE, Setting, module_name
from benchmarks.native.lugre import LONGEST_VECTOR
from benchmarks.native.run import NativeRun

__all__ = [
    "EXPLICIT",
    "IMPLICIT",
    "LONGEST_VECTOR",
    "LOOSE",
    "CompiledLaws",
    "NativeRun",
    "Setting",
    "module_name",
]
