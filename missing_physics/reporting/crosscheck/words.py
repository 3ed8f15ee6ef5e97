"""The result of a crosscheck in sentences, and its table."""

from __future__ import annotations

from collections.abc import Sequence

from missing_physics.reporting.crosscheck.comparison import Comparison, Difference
from missing_physics.reporting.elements.formatting import number
from robot_model import Robot

__all__ = ["groups", "quantity", "share_text", "table", "verdict_lines"]

#: Group by the quantity of a channel, in the order of the table.
GROUPS = {
    "motion of the joints": (
        "position",
        "velocity",
        "acceleration",
        "attitude",
        "angular_velocity",
        "motor_position",
        "motor_velocity",
    ),
    "drives and friction": ("torque", "friction_torque", "current", "voltage", "bristle", "temperature"),
    "bearing loads": ("radial_force", "axial_force", "bending_moment", "load_moment"),
    "reference motion": ("reference_position", "reference_velocity"),
}
BASE, LINKS, WHOLE = "base", "flexible links", "whole robot"
#: Group of a joint's quantities that belong to no other group.
DRIVES = "drives and friction"
#: Channels named in one sentence.
MOST_NAMED = 3
COLUMNS = ("largest", "at [s]", "rms", "largest/range", "step error", "inside")
ABSENT = "-"


def verdict_lines(comparison: Comparison) -> list[str]:
    """One sentence on the worst channel, one on whether the engines' own errors explain the differences."""
    lines = [_worst(comparison)]
    if comparison.bands:
        lines.append(_explained(comparison))
    return lines


def _worst(comparison: Comparison) -> str:
    worst = comparison.worst
    if worst is None:
        return "No channel has a range to compare a difference with."
    share = worst.relative_largest
    differs = f"differs by up to {quantity(worst)} (at {worst.time:.3g} s)"
    differs += "" if share is None else f", {share_text(share)} of its range"
    if worst.excess is None:
        return f"Worst: {worst.channel} {differs}."
    if worst.explained is False:
        edge = f"leaves its band by a factor of {number(worst.excess, 2)}"
    else:
        edge = f"comes nearest to the edge of its band, at {number(worst.excess, 2)} times it"
    return f"Worst: {worst.channel} {edge}; it {differs}."


def quantity(item: Difference) -> str:
    """The largest difference with its unit, if any."""
    return f"{number(item.largest, 2)} {item.unit}".removesuffix(" -")


def share_text(share: float) -> str:
    """A share of a range, e.g. 0.31 %, 12 ppm, 3.4e-09."""
    if share >= 1e-3:
        return f"{number(100 * share, 2)} %"
    return f"{number(1e6 * share, 2)} ppm" if share >= 1e-6 else f"{share:.1e}"


def _explained(comparison: Comparison) -> str:
    outside, count = comparison.outside, len(comparison.differences)
    if not outside:
        return (
            f"All {count} channels stay inside the step error of the two engines: no sign of a "
            "difference between the models."
        )
    named = ", ".join(f"{item.channel} ({number(item.excess, 2)} times it)" for item in outside[:MOST_NAMED])
    rest = len(outside) - MOST_NAMED
    more = f" and {rest} more" if rest > 0 else ""
    leave = "leaves" if len(outside) == 1 else "leave"
    return (
        f"{len(outside)} of {count} channels {leave} the step error of the two engines: {named}{more}. "
        "There the engines model something differently, or an error is larger than was estimated."
    )


def groups(robot: Robot, differences: Sequence[Difference]) -> dict[str, list[Difference]]:
    """Title of a group to its channels, in the order of the table; none is empty."""
    joints = {joint.name for joint in robot.joints}
    links = {link.name for link in robot.links}
    found: dict[str, list[Difference]] = {title: [] for title in (*GROUPS, LINKS, BASE, WHOLE)}
    for item in differences:
        place, quantity = item.channel.split(".")[:2]
        if place in joints:
            title = next((title for title, own in GROUPS.items() if quantity in own), DRIVES)
        else:
            title = LINKS if place in links else BASE if place == "base" else WHOLE
        found[title].append(item)
    ordered = [*list(GROUPS)[:-1], LINKS, BASE, WHOLE, list(GROUPS)[-1]]
    return {title: found[title] for title in ordered if found[title]}


def table(robot: Robot, comparison: Comparison) -> str:
    """Differences as text: one line for each channel, the worst of each group marked, words at the end."""
    width = max((len(item.channel) for item in comparison.differences), default=0)
    columns = COLUMNS if comparison.bands else COLUMNS[:-2]
    count, duration = len(comparison.reference), comparison.reference.duration
    lines = [f"{robot.name}: Exudyn against reference, {count} samples over {duration:g} s"]
    for title, items in groups(robot, comparison.differences).items():
        heads = " ".join(f"{head:>{_width(head)}}" for head in columns)
        lines += ["", f"{title:{width + 2}}  {'unit':11} {heads}"]
        top = max(items, key=lambda item: item.severity)
        for item in items:
            worst = len(items) > 1 and item is top and bool(item.severity[1])
            lines.append(_line(item, width, worst=worst, columns=columns))
    for which, ours, others in (
        ("the reference", comparison.reference, comparison.exudyn),
        ("Exudyn", comparison.exudyn, comparison.reference),
    ):
        if alone := [name for name in ours if name not in others]:
            lines += ["", f"only in {which}: {', '.join(alone)}"]
    lines += ["", *_legend(comparison), "", *verdict_lines(comparison)]
    return "\n".join(lines)


def _line(item: Difference, width: int, *, worst: bool, columns: Sequence[str]) -> str:
    relative = item.relative_largest
    inside = ABSENT if item.inside is None else "yes" if item.explained else f"{_floored(item.inside)} %"
    cells = {
        "largest": f"{item.largest:.1e}",
        "at [s]": f"{item.time:.3f}",
        "rms": f"{item.rms:.1e}",
        "largest/range": ABSENT if relative is None else f"{relative:.1e}",
        "step error": ABSENT if item.bound is None else f"{item.bound:.1e}",
        "inside": inside,
    }
    texts = " ".join(f"{cells[head]:>{_width(head)}}" for head in columns)
    return f"{'>' if worst else ' '} {item.channel:{width}}  {item.unit:11} {texts}"


def _floored(share: float) -> int:
    """Per cent, never 100 for a channel that leaves its band."""
    return int(100 * share)


def _width(head: str) -> int:
    return max(len(head), 8)


def _legend(comparison: Comparison) -> list[str]:
    lines = [
        "largest/range: largest difference over greatest minus least value of the reference; - where the "
        "channel stays constant. > marks the worst of a group, by its band where there is one."
    ]
    if comparison.bands:
        lines.append(
            "step error: the integration error of each engine, estimated by a second run with larger steps; "
            "inside: the difference stays within it throughout (yes), or in that share of the samples."
        )
    return lines
