"""Figures of work over error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.evidence import EVIDENCE
from benchmarks.native import IMPLICIT
from benchmarks.svg_lines import Line, Panel, figure
from benchmarks.work_precision.measured import Found, front
from benchmarks.work_precision.rivals import COMPILED, MUJOCO, NATIVE, OWN, PYTHON

__all__ = ["pictures"]

#: Curves by the methods that make them, each the front of its methods; Okabe and Ito's colours.
CURVES = {
    "CVODES": ("#0072B2", lambda family, method: family == OWN and method == "CVODES"),
    "explicit 8": ("#56B4E9", lambda family, method: family == OWN and method.startswith("explicit")),
    "Rosenbrock": ("#F0E442", lambda family, method: family == OWN and method == "Rosenbrock"),
    "fixed steps": ("#8C8C8C", lambda family, method: family == OWN and method == "fixed steps"),
    "Exudyn implicit": ("#D55E00", lambda family, method: family == NATIVE and method in IMPLICIT),
    "Exudyn explicit": ("#E69F00", lambda family, method: family == NATIVE and method not in IMPLICIT),
    "Exudyn, compiled": ("#8B4513", lambda family, method: family == COMPILED),
    "Exudyn, Python": ("#CC79A7", lambda family, method: family == PYTHON),
    "MuJoCo": ("#009E73", lambda family, method: family == MUJOCO),
}
#: Errors beyond these are off the figure.
LEAST, MOST = 1e-11, 1e-1


def pictures(cases: Sequence[Found]) -> list[str]:
    """Write the figures; gives the lines of the page that show them."""
    found = []
    for name, flexible in (("rigid", False), ("flexible", True)):
        panels = [_panel(case) for case in cases if case.case.flexible is flexible]
        path = EVIDENCE / f"benchmarks_{name}.svg"
        path.write_text(figure(f"Processor time over error, {name} robots", panels))
        words = f"Processor time over relative error for {name} robots: lower and further left is better"
        found.append(f"![{words}]({path.name})")
    return found


def _panel(found: Found) -> Panel:
    lines = []
    for label, (colour, belongs) in CURVES.items():
        points = [p for p in found.points if belongs(p.family, p.method) and LEAST < p.error < MOST]
        own = front(points)
        if not own:
            continue
        x = np.log10([p.error for p in own])
        y = np.array([1e3 * p.seconds for p in own])
        if len(own) == 1:  # a point is drawn as a short line
            x, y = x + np.array([-0.08, 0.08]), np.repeat(y, 2)
        lines.append(Line(label, colour, x, y))
    return Panel(found.case.name, "error, power of ten", "ms", lines, log=True)
