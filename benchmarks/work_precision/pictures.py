"""Figures of work over error, on the page and for the rerun viewer."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from benchmarks.evidence import EVIDENCE
from benchmarks.native import IMPLICIT
from benchmarks.svg_lines import Line, Panel, figure
from benchmarks.work_precision.measured import Found, front
from benchmarks.work_precision.rivals import COMPILED, MUJOCO, NATIVE, OWN, PYTHON

__all__ = ["DIGITS", "pictures", "write_curves"]

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
#: Timeline of the curves in the rerun viewer.
DIGITS = "correct_digits"
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


def write_curves(cases: Sequence[Found], path: Path) -> None:
    """The same curves as a file for the rerun viewer.

    The timeline counts correct digits, minus the power of ten of the error, as seconds; values are powers of
    ten of the processor time of a run in ms. A view for each motion.
    """
    views = [
        rrb.TimeSeriesView(
            origin=rr.escape_entity_path_part(found.case.name), name=f"{found.case.name}: log10 ms"
        )
        for found in cases
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    with rr.RecordingStream("missing_physics_work_precision", recording_id="curves") as stream:
        stream.save(str(path), default_blueprint=rrb.Blueprint(rrb.Grid(*views), auto_views=False))
        for found in cases:
            for line in _panel(found).lines:
                place = "/".join(map(rr.escape_entity_path_part, (found.case.name, line.label)))
                shade = tuple(int(line.colour[k : k + 2], 16) for k in (1, 3, 5))
                stream.log(place, rr.SeriesLines(colors=shade, names=line.label), static=True)
                order = np.argsort(-line.x)
                stream.send_columns(
                    place,
                    indexes=[rr.TimeColumn(DIGITS, duration=-line.x[order])],
                    columns=rr.Scalars.columns(scalars=np.log10(line.y[order])),
                )


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
