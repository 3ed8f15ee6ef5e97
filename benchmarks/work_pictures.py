"""Figures of work over error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.evidence import EVIDENCE
from benchmarks.measured import Found
from benchmarks.rivals import MUJOCO, NATIVE, OWN, PYTHON
from benchmarks.svg_lines import Line, Panel, figure

__all__ = ["pictures"]

#: Okabe and Ito's colours by family; methods of one family differ in their dashes.
COLOURS = {OWN: "#0072B2", NATIVE: "#D55E00", PYTHON: "#CC79A7", MUJOCO: "#009E73"}
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
    methods = dict.fromkeys((p.family, p.method) for p in found.points)
    for family, method in methods:
        own = sorted(
            (p for p in found.points if (p.family, p.method) == (family, method)), key=lambda p: p.error
        )
        own = [p for p in own if LEAST < p.error < MOST]
        if not own:
            continue
        first = next(name for kind, name in methods if kind == family) == method
        label = f"{family}: {method}" if family in (OWN, NATIVE) else family
        x = np.log10([p.error for p in own])
        y = np.array([1e3 * p.seconds for p in own])
        if len(own) == 1:  # a point is drawn as a short line
            x, y = x + np.array([-0.05, 0.05]), np.repeat(y, 2)
        lines.append(Line(label, _colour(family, method), x, y, dashed=not first))
    return Panel(found.case.name, "error, power of ten", "ms", lines, log=True)


def _colour(family: str, method: str) -> str:
    """Exudyn's explicit methods in another shade."""
    return "#E69F00" if family == NATIVE and ("RK" in method or "DOPRI" in method) else COLOURS[family]
