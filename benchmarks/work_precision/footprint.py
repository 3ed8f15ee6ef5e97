"""Preparation time and memory of an engine, each measured in a separate process.

    python -m benchmarks.work_precision.footprint ENGINE MOTION

prints one measurement as JSON; the page uses the medians of a few. Only the standard library is imported at
the top of this file, since other imports would be missing in the time and included in the memory.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path

__all__ = ["footprint_part", "measured", "peak"]

#: Processes of each kind, whose medians are reported; one where everything is recompiled.
TIMES = 3
MOTIONS = ("arm, tracking", "space arm, joint control", "flexible", "flexible, LuGre")
#: Variable of the cache of compiled code; an empty folder means that everything is compiled.
CACHE = "MISSING_PHYSICS_CODE_CACHE"
ROOT = Path(__file__).resolve().parents[2]
MEGABYTE = 1024.0  # the system counts kilobytes


def _reference(motion: str) -> Mapping[str, float]:
    start = time.perf_counter()
    from benchmarks.work_precision.manoeuvres import CASES
    from reference_model.control.motion import reference_function
    from reference_model.plant.closed_loop import Plant
    from reference_model.steppers.explicit_run import ExplicitRun

    ready = time.perf_counter()
    case = CASES[motion]
    run = ExplicitRun(Plant(case.robot), reference_function(case.robot))
    built = time.perf_counter()
    run(case.instants, rtol=1e-6, atol=1e-8)
    return _times(start, ready, built)


def _reference_uncompiled(motion: str) -> Mapping[str, float]:
    start = time.perf_counter()
    from benchmarks.work_precision.manoeuvres import CASES
    from reference_model.simulation import simulate

    ready = time.perf_counter()
    simulate(CASES[motion].robot, sensors=False, rtol=1e-6, atol=1e-8)
    return _times(start, ready, ready)


def _native(motion: str) -> Mapping[str, float]:
    start = time.perf_counter()
    from benchmarks.native import NativeRun, Setting
    from benchmarks.work_precision.manoeuvres import CASES

    ready = time.perf_counter()
    run = NativeRun(CASES[motion], Setting("trapezoidal, index 2", steps=1000))
    built = time.perf_counter()
    run()
    return _times(start, ready, built)


def _compiled(motion: str) -> Mapping[str, float]:
    start = time.perf_counter()
    from benchmarks.native import CompiledLaws, NativeRun, Setting
    from benchmarks.work_precision.manoeuvres import CASES

    ready = time.perf_counter()
    case = CASES[motion]
    run = NativeRun(case, Setting("trapezoidal, index 2", steps=1000), CompiledLaws.of(case.robot))
    built = time.perf_counter()
    run()
    return _times(start, ready, built)


def _python(motion: str) -> Mapping[str, float]:
    start = time.perf_counter()
    from benchmarks.work_precision.manoeuvres import CASES
    from exudyn_model.simulation import simulate

    ready = time.perf_counter()
    simulate(CASES[motion].robot, sensors=False, step=4e-3)
    return _times(start, ready, ready)


def _times(start: float, ready: float, built: float) -> Mapping[str, float]:
    end = time.perf_counter()
    return {"import": ready - start, "build": built - ready, "run": end - built, "megabytes": peak()}


def peak() -> float:
    """Peak of resident memory of this process [MB]; that of `getrusage` begins with the parent's."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return float(next(line for line in lines if line.startswith("VmHWM:")).split()[1]) / MEGABYTE


ENGINES: Mapping[str, Callable[[str], Mapping[str, float]]] = {
    "reference model, explicit": _reference,
    "reference model, `simulate` uncompiled": _reference_uncompiled,
    "Exudyn without Python": _native,
    "Exudyn with compiled functions": _compiled,
    "`exudyn_model`": _python,
}


def measured(engine: str, motion: str, *, cache: str | None = None) -> Mapping[str, float]:
    """One measurement in a fresh process, with a separate cache of compiled code if given."""
    environment = {**os.environ, **({CACHE: cache} if cache else {})}
    words = [sys.executable, "-W", "ignore", "-m", "benchmarks.work_precision.footprint", engine, motion]
    process = subprocess.run(words, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    found: Mapping[str, float] = json.loads(process.stdout.splitlines()[-1])
    return found


def _row(engine: str, motion: str) -> list[str]:
    with tempfile.TemporaryDirectory() as empty:
        compiles = engine.endswith(("explicit", "compiled functions"))
        first = measured(engine, motion, cache=empty)["build"] if compiles else None
    every = [measured(engine, motion) for _ in range(TIMES)]
    middle = {key: statistics.median(one[key] for one in every) for key in every[0]}
    together = engine.startswith("`") or "`" in engine
    return [
        motion,
        engine,
        f"{middle['import']:.2f}",
        "in the run" if together else f"{middle['build']:.3f}",
        f"{first:.1f}" if first is not None else "",
        f"{middle['run']:.3f}",
        f"{middle['megabytes']:.0f}",
    ]


def footprint_part() -> str:
    """The section of the page."""
    from benchmarks.evidence import paragraph, table
    from benchmarks.work_precision.manoeuvres import CASES

    rows = []
    for motion in MOTIONS:
        for engine in ENGINES:
            other = "Exudyn with compiled functions" if CASES[motion].native else "Exudyn without Python"
            if engine != other:
                print(f"{motion}: {engine}", file=sys.stderr, flush=True)
                rows.append(_row(engine, motion))
    headings = ["motion", "engine", "import [s]:", "build [s]:", "of which compiling, the first time [s]:"]
    headings[-1] = "build, the first time [s]:"
    return "\n\n".join(
        [
            "## Making ready, and memory",
            paragraph(
                "Wall time and peak of resident memory of a process of its own that imports,",
                "builds and runs a",
                f"motion once, medians of {TIMES}; `import` holds everything, NumPy and the",
                "robots included. `build` is with",
                "compiled code in the cache, `build, the first time` with an empty one, when",
                "a C compiler makes it;",
                "the run is at a relative tolerance of 1e-6 for us, with 1000 steps in Exudyn",
                "without Python or with compiled functions,",
                "and with steps of at most 4 ms in `exudyn_model`, so that runs are not at equal",
                "errors here.",
            ),
            table([*headings, "first run [s]:", "memory [MB]:"], rows),
        ]
    )


if __name__ == "__main__":
    print(json.dumps(ENGINES[sys.argv[1]](sys.argv[2])))
