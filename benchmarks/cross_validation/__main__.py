"""The complete cross-validation of both engines, written as a page of evidence.

    python -m benchmarks.cross_validation

Writes `reports/evidence/cross_validation.md` with its pictures; ends with an error if a requirement fails.
Takes some ten minutes of one processor.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

from benchmarks.cross_validation import page
from benchmarks.cross_validation.convergence import STUDIES, Course, course
from benchmarks.cross_validation.deflection import Bent, by_elements, by_load, by_modes
from benchmarks.cross_validation.faults.catalogue import FAULTS
from benchmarks.cross_validation.faults.seeding import Caught, Fault, caught, seeded
from benchmarks.cross_validation.matrix import (
    Case,
    Outcome,
    build_cases,
    cases,
    controller_cases,
    effect_cases,
    outcome,
)
from benchmarks.cross_validation.statics import (
    Agreement,
    agreements,
    control_subjects,
    equation_subjects,
    friction_subjects,
)
from benchmarks.evidence import EVIDENCE, head
from benchmarks.svg_lines import Line, Panel, figure
from missing_physics.reporting.elements import palette
from robot_model import write_atomically

__all__ = ["main"]

COMMAND = "python -m benchmarks.cross_validation"
NAME = "cross_validation"
COLOURS = {
    "position": palette.MEASURED,
    "velocity": palette.AFTER,
    "modal coordinate": palette.BEFORE,
    "constraint force": "#888888",
    "friction": "#b0651d",
}


def main() -> int:
    """Run everything, write the page, report failures."""
    began = _processor_time()
    formulas = _formulas()
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        product, built, controllers, effects = (
            _outcomes(make(), pool) for make in (cases, build_cases, controller_cases, effect_cases)
        )
        courses = _courses(pool)
    bent = by_modes(), by_elements(), by_load()
    seen = _seeded()
    _pictures(courses, bent[2])
    parts = [
        head("The engines against each other", command=COMMAND),
        page.introduction(),
        "## Faults found",
        page.findings(),
        "## Agreement at a given state",
        page.formulas(formulas),
        "## Trajectories",
        page.bounds(),
        page.summary((*product, *built, *controllers, *effects)),
        "In the tables motion/rates/forces. Friction over motions of rigid and flexible arms:",
        page.product_table(product),
        "### Further parts",
        page.loops(built),
        "### Controllers",
        page.loops(controllers),
        "### Effects",
        page.loops(effects),
        "## Convergence",
        f"![convergence]({NAME}_convergence.svg)",
        page.courses(courses),
        "## Linear modes against exact beams",
        f"![deflection]({NAME}_deflection.svg)",
        page.bending(*bent),
        "## Seeded faults",
        page.faults(seen),
        f"All this took {_processor_time() - began:.0f} s of one processor.",
    ]
    write_atomically(EVIDENCE / f"{NAME}.md", "\n\n".join(parts) + "\n")
    failures = [f"{a.subject}: {a.quantity}" for a in formulas if not a.holds]
    failures += [", ".join(o.case.labels) for o in (*product, *built, *controllers, *effects) if not o.holds]
    failures += [c.study.name for c in courses if not c.holds]
    failures += [f"not detected: {fault.what}" for fault, sight in seen if sight is None]
    for failure in failures:
        print(f"failed: {failure}", file=sys.stderr)
    return 1 if failures else 0


def _formulas() -> list[Agreement]:
    subjects = (*equation_subjects(), *control_subjects(), *friction_subjects())
    return [item for subject in subjects for item in agreements(subject)]


def _outcomes(every: Iterable[Case], pool: Executor) -> list[Outcome]:
    found = []
    for item in pool.map(outcome, every):
        print(("" if item.holds else "! ") + ", ".join(item.case.labels), file=sys.stderr)
        found.append(item)
    return found


def _courses(pool: Executor) -> list[Course]:
    found = []
    for item in pool.map(course, STUDIES):
        print(("" if item.holds else "! ") + item.study.name, file=sys.stderr)
        found.append(item)
    return found


def _processor_time() -> float:
    """Of this process and of its workers that have ended [s]."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def _seeded() -> list[tuple[Fault, Caught | None]]:
    found = []
    for fault in FAULTS:
        with seeded(fault):
            found.append((fault, caught()))
    return found


def _pictures(courses: Sequence[Course], loads: Sequence[Bent]) -> None:
    panels = [
        Panel(
            item.study.name,
            "log10 of step, s",
            "difference over range",
            [
                Line(name, COLOURS[name], np.log10(item.study.steps), np.array(values))
                for name, values in item.relative.items()
                if min(values) > 0
            ],
            log=True,
        )
        for item in courses[:4]
    ]
    write_atomically(EVIDENCE / f"{NAME}_convergence.svg", figure("Difference against Exudyn's step", panels))
    deflection = np.log10([b.deflection for b in loads])
    lines = [
        Line("across, beside its peak", palette.AFTER, deflection, np.array([b.across for b in loads])),
        Line("along, beside the length", palette.BEFORE, deflection, np.array([b.along for b in loads])),
    ]
    panel = Panel(
        "Tip of a mast", "log10 of deflection over length", "modes against exact beam", lines, log=True
    )
    write_atomically(
        EVIDENCE / f"{NAME}_deflection.svg", figure("Where linear modes stop being valid", [panel], columns=1)
    )


if __name__ == "__main__":
    sys.exit(main())
