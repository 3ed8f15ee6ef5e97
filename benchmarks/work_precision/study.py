"""Writes reports/evidence/benchmarks.md: work and precision of the reference model and of Exudyn, in one run.

    python -m benchmarks.work_precision.study [CASE ...]

Without names it runs every case and writes the page and its figures; with names it only prints their tables.
Both write the curves for the rerun viewer, reports/work_precision.rrd.
Needs the extra [peers] and a C compiler.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path

from benchmarks.evidence import EVIDENCE, head, paragraph, percent, table
from benchmarks.history.rows import read
from benchmarks.native import LONGEST_VECTOR, LOOSE, module_name
from benchmarks.work_precision.manoeuvres import CASES, SAMPLES
from benchmarks.work_precision.measured import LIMIT_STEPS, ROUNDS, Found, fastest, measure, share_at
from benchmarks.work_precision.pictures import pictures, write_curves
from benchmarks.work_precision.rivals import COMPILED, MUJOCO, NATIVE, OWN, PYTHON
from benchmarks.work_precision.same_motion import same_part
from benchmarks.work_precision.truth import FINEST
from reference_model.codegen.compiled import FLAGS, TUNED, compiler

__all__ = ["main"]

PAGE = EVIDENCE / "benchmarks.md"
#: The curves for the rerun viewer; not in git.
VIEWED = Path("reports/work_precision.rrd")
#: Of `make bench`; not in git.
HISTORY = Path("reports/benchmarks_history.json")
#: Relative errors at which times are compared.
TARGETS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
#: Goals: speed of the reference model relative to Exudyn.
GOALS = {True: 100, False: 20}


def _ratio(found: Found, families: Sequence[str], error: float) -> float | None:
    other, own = fastest(found.points, families, error), fastest(found.points, (OWN,), error)
    return other[1] / own[1] if other and own else None


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def native_part(cases: Sequence[Found]) -> str:
    """Times at equal error where Exudyn runs without Python."""
    return "\n\n".join(
        [
            "## How many times faster at equal error: Exudyn without Python",
            paragraph(
                "Time of Exudyn's fastest method over that of ours, at the relative error above",
                "the column, between measured points by powers; `-` where one of them does not",
                "get there with the steps tried.",
            ),
            _ratio_table(cases, NATIVE),
        ]
    )


def compiled_part(cases: Sequence[Found]) -> str:
    """The same where Exudyn needs user functions, written in C."""
    return "\n\n".join(
        [
            "## How many times faster at equal error: Exudyn with compiled functions",
            paragraph(
                "Bearing loads as a cause of friction and computed torque have no form of Exudyn's own: it",
                "has no law that sees the force of a constraint, no inverse dynamics, and symbolic functions",
                f"of more than {LONGEST_VECTOR} coordinates corrupt memory in this version. Here they are",
                "user functions in C (`benchmarks/native/compiled.py`): the expressions of our own",
                "controllers and friction laws with exact Jacobians, generated and compiled as ours are,",
                "which read Exudyn's state where it keeps it. Of Python the call through pybind is left.",
                "Loads come from Exudyn's multipliers between flexible bodies, and from a tree's",
                "accelerations by inverse dynamics; bristles are coordinates, so that nothing is remembered",
                "between steps. In brackets the share of Exudyn's time that passes in these functions (calls",
                "times the cost of one; converting its arguments is not in it), and the ratio if they cost",
                "nothing.",
            ),
            _ratio_table(cases, COMPILED),
        ]
    )


def _ratio_table(cases: Sequence[Found], family: str) -> str:
    rows = []
    for found in cases:
        if any(point.family == family for point in found.points):
            ratios = [_ratio_text(found, family, error) for error in TARGETS]
            rows.append([found.case.name, str(GOALS[found.case.flexible]), *ratios])
    return table(["motion", "goal:", *(f"{error:.0e}:" for error in TARGETS)], rows)


def _ratio_text(found: Found, family: str, error: float) -> str:
    """The ratio; with user functions also their fraction of the time, and the ratio without it."""
    ratio = _ratio(found, (family,), error)
    share = share_at(found.points, (family,), error)
    if ratio is None or not share:
        return _cell(ratio)
    return f"{ratio:.3g} ({percent(share, 0)}: {(1 - share) * ratio:.3g})"


def python_part(cases: Sequence[Found]) -> str:
    """The same where Exudyn needs Python."""
    rows = []
    for found in cases:
        for point in found.points:
            if point.family != PYTHON:
                continue
            own = fastest(found.points, (OWN,), point.error)
            if own is None:
                continue
            goal = str(GOALS[found.case.flexible])
            ours, share = f"{1e3 * own[1]:.3g}", point.outside or 0.0
            ratio = point.seconds / own[1]
            rows.append(
                [
                    *(found.case.name, goal, point.setting, f"{point.error:.1e}"),
                    *(f"{1e3 * point.seconds:.0f}", ours, own[0], f"{ratio:.0f}"),
                    *(percent(share, 0), f"{(1 - share) * ratio:.3g}"),
                ]
            )
    headings = ["motion", "goal:", "Exudyn's step", "error:", "Exudyn [ms]:", "ours [ms]:", "by", "ratio:"]
    headings += ["outside Exudyn:", "ratio without:"]
    return "\n\n".join(
        [
            "## How many times faster at equal error: Exudyn with Python functions",
            paragraph(
                "`exudyn_model.simulate`: control and friction as Python functions, which Exudyn",
                "calls several times a step, and step control around its solver: what somebody writes who",
                "wants these laws in Exudyn and compiles nothing. Its time holds the building of the system,",
                "some hundredths to a tenth of a second; what is outside of Exudyn's own code is that and",
                "the functions.",
            ),
            table(headings, rows),
        ]
    )


def summary(cases: Sequence[Found]) -> str:
    """Whether the goals are reached, counted error by error."""
    rows = []
    for flexible, goal in GOALS.items():
        kind = "flexible" if flexible else "rigid"
        for family, words in ((NATIVE, "no user functions"), (COMPILED, "compiled user functions")):
            own = [found for found in cases if found.case.flexible is flexible]
            cells = [_counted(own, family, goal, error) for error in TARGETS]
            if any(cell != "-" for cell in cells):
                rows.append([kind, words, str(goal), *cells])
    python = [ratio for found in cases if not found.case.native for ratio in _python_ratios(found)]
    parts = [
        paragraph(
            "How many motions reach the goal at an error, of those that both engines bring to it; the range",
            "of the ratios.",
        ),
        table(["robots", "Exudyn has", "goal:", *(f"{error:.0e}:" for error in TARGETS)], rows),
    ]
    if python:
        parts.append(f"With the same functions in Python: {min(python):.0f} to {max(python):.0f} times.")
    return "\n\n".join(["## The goals", *parts])


def _counted(cases: Sequence[Found], family: str, goal: int, error: float) -> str:
    ratios = [r for r in (_ratio(found, (family,), error) for found in cases) if r is not None]
    if not ratios:
        return "-"
    return f"{sum(r >= goal for r in ratios)} of {len(ratios)} ({min(ratios):.3g} to {max(ratios):.3g})"


def _python_ratios(found: Found) -> list[float]:
    pairs = [(p, fastest(found.points, (OWN,), p.error)) for p in found.points if p.family == PYTHON]
    return [point.seconds / own[1] for point, own in pairs if own]


def limit_part(cases: Sequence[Found]) -> str:
    """Differences of the converged solutions."""
    rows = []
    for found in cases:
        for group, apart in found.apart.items():
            rows.append([found.case.name, group, f"{apart:.1e}", "own" if found.own_limit else "ours"])
    return "\n\n".join(
        [
            "## How far the converged solutions are apart",
            paragraph(
                f"Ours: CVODES at {FINEST:.0e}. Exudyn's: RK67 with {LIMIT_STEPS[0]:,} steps for",
                "rigid robots,",
                f"and where it has methods of second order only, those with {LIMIT_STEPS[0]:,} and",
                f"{LIMIT_STEPS[1]:,} steps, extrapolated; with compiled functions where it needs",
                "any. Largest rms of a quantity over the",
                "motion, over its range.",
                "The flexible robots' limits differ: the equations of the two flexible bodies",
                "are not the same",
                "in small terms, and the range of the tip's deflection is below a millimetre. There Exudyn's",
                "errors are measured against its own limit, so that they tell of its steps only, those",
                "with Python functions against that of the compiled ones.",
            ),
            table(["motion", "quantity", "apart:", "errors of Exudyn against"], rows),
        ]
    )


def method_part(cases: Sequence[Found]) -> str:
    """Which methods were the fastest, with their times."""
    rows = []
    for found in cases:
        for error in (1e-4, 1e-6, 1e-8):
            cells = []
            for families in ((OWN,), (NATIVE, COMPILED), (MUJOCO,)):
                best = fastest(found.points, families, error)
                cells.append(f"{1e3 * best[1]:.3g} ms, {best[0]}" if best else "-")
            if cells[1] != "-" or cells[2] != "-":
                rows.append([found.case.name, f"{error:.0e}", *cells])
    return "\n\n".join(
        ["## The fastest methods", table(["motion", "error:", OWN, NATIVE, f"{MUJOCO} (free motions)"], rows)]
    )


def broken_part(cases: Sequence[Found]) -> str:
    """Failed trials."""
    failures = [f"{found.case.name}: {what}" for found in cases for what in found.broken]
    if not failures:
        return ""
    return "Runs that broke down and are left out: " + "; ".join(failures) + "."


def bench_part(path: Path = HISTORY) -> str:
    """Duration of the last run of `make bench` on this machine; empty if unknown."""
    timed = [row for row in read(path) if row.seconds >= 0]
    if not timed:
        return ""
    row = timed[-1]
    loaded = f", load {row.load:.2f} when it began" if row.load >= 0 else ""
    return "\n\n".join(
        [
            "## How long `make bench` takes",
            paragraph(
                "`make bench` compares at fewer points. The last run on this machine took",
                f"{row.seconds:.0f} s of wall time with everything that it made ({row.time[:19]}, commit",
                f"{row.commit[:7] or 'unknown'}, {row.machine}{loaded}); it measured that by itself,",
                f"and keeps it with its {len(row.ratios)} ratios in `{HISTORY}`.",
            ),
        ]
    )


def _lines(cases: Sequence[Found]) -> Iterator[str]:
    chosen = compiler()
    assert chosen is not None, "no C compiler on the path"
    load = ", ".join(f"{value:.2f}" for value in os.getloadavg())
    peers = ", ".join(f"{name} {version(name)}" for name in ("exudyn", "mujoco", "pin"))
    yield head("Work and precision beside Exudyn", command="python -m benchmarks.work_precision.study")
    yield paragraph(
        f"Peers: {peers}; Exudyn's module `{module_name()}`, without range checks where",
        "its name says fast. Own",
        f"code: {chosen.identity.splitlines()[0]}, `{' '.join(FLAGS)}`,",
        f"for the explicit and the Rosenbrock method `{' '.join(TUNED)}` besides. Load of the machine",
        "when this was",
        f"written: {load} (1, 5, 15 minutes) on {os.cpu_count()} cores; it is virtual and",
        "was shared. Times are",
        f"processor time of a run, medians of {ROUNDS} rounds in which all engines take turns: read",
        "ratios, not milliseconds.",
    )
    yield paragraph(
        "A run goes from the initial state to positions at",
        f"{SAMPLES} instants in memory. Preparation is not included and is given",
        "[below](#making-ready-and-memory):",
        "compiling and building for us, assembling for Exudyn. Error: the largest rms over",
        "the motion of a joint",
        "angle, base position, base attitude or tip deflection, over the range of its kind.",
        "Ours run as compiled C: by CVODES, and by the explicit method of order 8",
        "(`reference_model/steppers/explicit_run.py`), by Rosenbrock methods of order 4 and 5",
        "(`reference_model/steppers/rosenbrock_run.py`), over tolerances, and at fixed steps",
        "(`reference_model/fixed_steps/realtime.py`). Exudyn runs at its fastest: tree in minimal",
        "coordinates and Runge-Kutta of orders 3 to 7, ODE23 or DOPRI5 for rigid robots; trapezoidal",
        "rule and generalised alpha with modified Newton for all, iterated to its own tolerance or to",
        f"{LOOSE:.0e} (loose); no files, sensors at the instants only, one thread; laws as objects of its",
        "own, symbolic or compiled functions. Its sparse solver, full Newton and a Jacobian in every step",
        "were tried and are no faster. MuJoCo runs by its RK4, in C++ by `mujoco.rollout`.",
    )
    yield table(["motion", "what"], [[found.case.name, found.case.what] for found in cases])
    yield summary(cases)
    yield native_part(cases)
    yield compiled_part(cases)
    yield python_part(cases)
    yield same_part(cases)
    yield method_part(cases)
    yield limit_part(cases)


def main(names: Sequence[str]) -> None:
    """Measure, and write the page or print tables."""
    cases = [measure(CASES[name]) for name in names or CASES]
    write_curves(cases, VIEWED)
    print(f"wrote {VIEWED}: rerun {VIEWED}", file=sys.stderr)
    parts = [*_lines(cases), broken_part(cases)]
    if names:
        print("\n\n".join(part for part in parts[2:] if part))
        return
    from benchmarks.speed.scaling import scaling_part
    from benchmarks.work_precision.footprint import footprint_part
    from benchmarks.work_precision.overhead import overhead_part

    drawn = pictures(cases)
    parts += ["## Work over error", *drawn, overhead_part(), scaling_part(), footprint_part(), bench_part()]
    PAGE.write_text("\n\n".join(part for part in parts if part) + "\n")
    print(f"wrote {PAGE.name}", file=sys.stderr)


if __name__ == "__main__":
    main(sys.argv[1:])
