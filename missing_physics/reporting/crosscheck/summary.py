"""The text in the rerun file of a crosscheck, as Markdown."""

from __future__ import annotations

from missing_physics.reporting.crosscheck.blueprint import robot_bends
from missing_physics.reporting.crosscheck.comparison import WINDOW, Comparison
from missing_physics.reporting.crosscheck.lanes import REST, rubbing_joints
from missing_physics.reporting.crosscheck.scene import Scene
from missing_physics.reporting.crosscheck.words import quantity, share_text, verdict_lines
from missing_physics.reporting.elements.formatting import number
from missing_physics.reporting.viewer.summary_text import plain
from robot_model import Robot

__all__ = ["markdown"]

#: Channels in the table of the worst.
MOST_ROWS = 8


def markdown(robot: Robot, comparison: Comparison, drawn: Scene, *, thinned_to: int | None) -> str:
    """Verdict, table of the worst channels, legend of the file; `thinned_to`: samples of thinned series."""
    parts = [f"### {plain(robot.name)}: Exudyn against reference"]
    parts += [plain(line) for line in verdict_lines(comparison)]
    parts.append(_worst(comparison))
    parts += _how_to_read(robot, comparison, drawn)
    if thinned_to is not None:
        parts.append(
            f"Series are thinned to at most {thinned_to:,} of {len(comparison.reference):,} samples each: "
            "the least and the greatest of each stretch, so that no extreme is lost."
        )
    return "\n\n".join(parts) + "\n"


def _worst(comparison: Comparison) -> str:
    ranked = sorted(comparison.differences, key=lambda item: item.severity, reverse=True)
    lines = ["| channel | largest | of range | step error |", "|---|---|---|---|"]
    for item in ranked[:MOST_ROWS]:
        share = "-" if item.relative_largest is None else share_text(item.relative_largest)
        bound = "-" if item.bound is None else number(item.bound, 2)
        lines.append(f"| {plain(item.channel)} | {plain(quantity(item))} | {share} | {bound} |")
    return "\n".join(lines)


def _how_to_read(robot: Robot, comparison: Comparison, drawn: Scene) -> list[str]:
    found = ["Vermilion, thick: Exudyn. Blue, thin upon it: reference. Grey: Exudyn minus reference."]
    if comparison.bands:
        found.append(
            "Purple: the integration errors of the engines, from a second run with larger steps; the widest "
            f"within {number(WINDOW * comparison.reference.duration, 2)} s around each instant."
        )
    if robot_bends(drawn):
        scale = f"magnified {drawn.factor:,.0f} times" if drawn.factor > 1 else "to scale"
        found.append(
            f"Flexible links are drawn with the deflection of their tip {scale}, bent as by a force at the "
            "tip; grey: undeformed."
        )
    if rubbing_joints(robot):
        found.append(f"A joint with dry friction sticks while it is slower than {REST:g} rad/s or m/s.")
    return found
