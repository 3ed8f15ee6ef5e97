"""Fraction of Exudyn's time outside of its own code: in user functions and their overhead."""

from __future__ import annotations

import cProfile
import pstats
import time
from collections.abc import Callable, Mapping

from benchmarks.work_precision.rivals import CompiledTrial, PythonTrial, Trial

__all__ = ["outside_share"]

#: Exudyn's solver: its own time is that of the engine without called Python functions.
SOLVER = "SolveSystem"
#: The file whose functions are the compiled user functions.
FUNCTIONS = "benchmarks/native/compiled.py"

Rows = Mapping[tuple[str, int, str], tuple[int, int, float, float, object]]


def outside_share(trial: Trial, seconds: float) -> float:
    """Fraction of a run of `seconds` that is not Exudyn's own code; 0 where no user function is called.

    For compiled functions the number of calls times the cost of one in a loop; the conversion of arguments
    between C++ and Python is not included. With functions in Python the engine's own time is that of its
    solver in a profile, and the rest is the functions and the building of the system; the profiling overhead
    of the solver is small compared with functions that take a hundred times as long.
    """
    if isinstance(trial, CompiledTrial):
        rows = _profile(trial.prepare())
        counts = {name: row[0] for (file, _, name), row in rows.items() if file.endswith(FUNCTIONS)}
        return min(sum(counts.get(n, 0) * c for n, c in trial.called.costs().items()) / seconds, 1.0)
    if isinstance(trial, PythonTrial):
        own = sum(row[2] for (_, _, name), row in _profile(trial.prepare()).items() if SOLVER in name)
        return min(max(1.0 - own / seconds, 0.0), 1.0)
    return 0.0


def _profile(run: Callable[[], None]) -> Rows:
    """(file, line, function) -> calls, primitive calls, own processor time, ... of a run."""
    profile = cProfile.Profile(time.process_time)
    profile.runcall(run)
    found: Rows = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    return found
