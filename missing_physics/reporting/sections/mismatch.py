"""Where the nominal robot and the recording differ."""

from __future__ import annotations

from missing_physics.reporting.elements.formatting import number, p_value_text, percent
from missing_physics.reporting.elements.verdicts import located_first_to_last
from missing_physics.reporting.sections.base import Section
from missing_physics.results.result import Dependence, Mismatch, Result
from missing_physics.wording.numbers import range_text
from robot_model import Robot, unit_of

__all__ = ["section"]

#: Longer lists of windows or peaks are cut in the table; the pictures show all of them.
MOST_LISTED = 6


def section(result: Result, robot: Robot) -> Section:
    """One row per channel, torques first, by unexplained energy."""
    rows = located_first_to_last(result.diagnosis)
    prismatic = {joint.name for joint in robot.joints if joint.kind == "prismatic"}
    return Section(
        anchor="mismatch",
        heading="Where the recording and the nominal robot differ",
        values={
            "rows": [_row(m, prismatic) for m in rows],
            "kinds": len({m.channel.rpartition(".")[2] for m in rows}),
        },
    )


def _row(mismatch: Mismatch, prismatic: set[str]) -> dict[str, object]:
    return {
        "channel": mismatch.channel,
        "words": mismatch.words,
        "share": percent(mismatch.share),
        "bar": round(100 * min(max(mismatch.share, 0.0), 1.0), 1),
        "p_value": p_value_text(mismatch.p_value),
        "windows": _listed([range_text(*window, "s") for window in mismatch.windows]),
        "depends_on": [_dependence(d, prismatic) for d in mismatch.depends_on],
        "peaks": _listed([f"{number(f)} Hz" for f in mismatch.frequency_hz]),
    }


def _dependence(dependence: Dependence, prismatic: set[str]) -> str:
    place = dependence.variable.split(".")[0]
    unit = unit_of(dependence.variable, prismatic=place in prismatic)
    where = range_text(*dependence.range, unit)
    return f"{dependence.variable} {where}: {percent(dependence.share)} of its energy"


def _listed(items: list[str]) -> list[str]:
    more = len(items) - MOST_LISTED
    return [*items[:MOST_LISTED], *([f"and {more} more"] if more > 0 else [])]
