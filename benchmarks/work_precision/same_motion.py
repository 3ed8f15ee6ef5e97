"""Whether compiled user functions give the same motion in Exudyn as those in Python."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.evidence import paragraph, table
from benchmarks.native import Setting
from benchmarks.work_precision.manoeuvres import Case
from benchmarks.work_precision.measured import Found
from benchmarks.work_precision.rivals import PythonTrial, exudyn_trial
from benchmarks.work_precision.truth import Truth

__all__ = ["same_part"]

#: Steps of both [s].
STEPS = (4e-3, 2e-3)


def same_part(cases: Sequence[Found]) -> str:
    """Differences of the two at equal steps."""
    rows = []
    for found in cases:
        if not found.case.native:
            apart = [_apart(found.case, step) for step in STEPS]
            rows.append([found.case.name, *(f"{a:.1e}" for a in apart), f"{apart[0] / apart[1]:.1f}"])
    return "\n\n".join(
        [
            "## The same motion, compiled and in Python",
            paragraph(
                "`exudyn_model` beside the compiled functions, both by the trapezoidal rule at equal steps:",
                "largest rms over the motion, over the range of the kind. `exudyn_model` has controllers,",
                "friction and kinematics of its own, remembers bristles between steps, cuts steps where",
                "friction turns round, and runs robots with bearing loads as bodies and constraints, rigid",
                "ones too. What is left between the two falls with the step; how far the compiled ones'",
                "limit is from ours is given [below](#how-far-the-converged-solutions-are-apart).",
            ),
            table(["motion", *(f"{1e3 * step:g} ms:" for step in STEPS), "ratio:"], rows),
        ]
    )


def _apart(case: Case, step: float) -> float:
    python = PythonTrial(case, step)
    compiled = exudyn_trial(case, Setting("trapezoidal, index 2", steps=round(case.duration / step)))
    for trial in (python, compiled):
        trial.timed()
    return Truth(case).error(compiled.course(), python.course().values)
