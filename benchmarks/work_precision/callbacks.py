"""How much of Exudyn's time passes outside of its own code: in user functions, and what comes with them."""

from __future__ import annotations

import cProfile
import pstats
import time
from collections.abc import Callable, Mapping

from benchmarks.work_precision.rivals import CompiledTrial, PythonTrial, Trial

__all__ = ["outside_share"]

#: Exudyn's solver: its own time is that of the engine without what it calls in Python.
SOLVER = "SolveSystem"
#: The file whose functions are the compiled user functions.
FUNCTIONS = "benchmarks/native/compiled.py"

Rows = Mapping[tuple[str, int, str], tuple[int, int, float, float, object]]


def outside_share(trial: Trial, seconds: float) -> float:
    """Share of a run of `seconds` that is not Exudyn's own code; 0 where no user function is called.

    Of compiled functions the number of calls times what one costs when it is called again and again; the
    conversion of arguments between C++ and Python is not in it. With functions in Python the engine's own
    time is what a profile says of its solver alone, and the rest is the functions and the building of the
    system; profiling costs the solver little beside functions that take a hundred times as long.
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
