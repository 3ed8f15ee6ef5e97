"""Assignment of columns to channels of joints."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from missing_physics.drafting.columns import Column
from missing_physics.drafting.names import Reading, read_name, tokens
from robot_model import Drive, Robot

__all__ = ["Entry", "UnusedColumn", "assigned"]

#: Prefix of a reason based on the order of columns alone.
BY_ORDER = "it is taken for"


@dataclass
class Entry:
    """The table of one channel in a map.

    Attributes:
        channel: native name of the channel.
        joint: joint of the robot with its actuator, or a motor of a transmission.
        column: the column from which it is read.
        reading: interpretation of the column's name.
        table: entries of the map other than source and place.
        reasons, questions: reasons for the guesses, and open questions.
    """

    channel: str
    joint: Drive
    column: Column
    reading: Reading
    table: dict[str, Any] = field(default_factory=dict)
    reasons: list[str] = field(default_factory=list)
    questions: list[str] = field(default_factory=list)

    @property
    def family(self) -> str:
        """The common part of columns whose names differ only in numbers."""
        return _family(self.column, self.reading)

    @property
    def quantity(self) -> str:
        """The quantity of the channel."""
        return self.channel.split(".")[1]


@dataclass(frozen=True)
class UnusedColumn:
    """A column that is not read, and why."""

    column: Column
    why: str


def assigned(robot: Robot, columns: Sequence[Column]) -> tuple[list[Entry], list[UnusedColumn]]:
    """Channels identified by names alone, and the unused columns."""
    joints, unused = robot.drives, []
    coupled = {name for transmission in robot.transmissions for name in transmission.joints}
    output_joints = [
        Drive(one.name, one.kind, None, one) for one in robot.moving_joints if one.name in coupled
    ]
    read: dict[str, list[tuple[Column, Reading]]] = defaultdict(list)
    for column in columns:
        reading = read_name(column.source)
        if reading is None:
            unused.append(UnusedColumn(column, "its name contains no quantity of a joint"))
        else:
            read[_family(column, reading)].append((column, reading))
    found: dict[str, list[Entry]] = defaultdict(list)
    unnumbered: dict[str, list[Column]] = defaultdict(list)
    for family in read.values():
        for column, reading in family:
            if not reading.numbers and column.number is None:
                unnumbered[f"{reading.quantity} {reading.rank}"].append(column)
    for family in read.values():
        for column, reading in family:
            alone = unnumbered[f"{reading.quantity} {reading.rank}"]
            joint, why = _joint(joints, output_joints, column, reading, family, alone)
            if joint is None:
                unused.append(UnusedColumn(column, why))
                continue
            entry = Entry(f"{joint.name}.{reading.quantity}", joint, column, reading)
            entry.reasons.append(f"'{reading.word}' in '{column.label}' is a {reading.quantity}; {why}")
            if why.startswith(BY_ORDER):
                entry.questions.append(f"is '{column.label}' of {joint.name}?")
            if not reading.sure:
                entry.questions.append(f"is '{column.label}' the {reading.quantity.replace('_', ' ')}?")
            found[entry.channel].append(entry)
    kept = _moving([_preferred(entries, unused) for entries in found.values()], unused)
    order = {joint.name: k for k, joint in enumerate((*joints, *output_joints))}
    return sorted(kept, key=lambda entry: order[entry.joint.name]), unused


def _moving(entries: Sequence[Entry], unused: list[UnusedColumn]) -> list[Entry]:
    """The entries without constant columns of the joint side if the motor side moves."""
    live = {
        entry.channel for entry in entries if np.nanmax(entry.column.values) > np.nanmin(entry.column.values)
    }
    kept = []
    for entry in entries:
        if entry.channel not in live and f"{entry.joint.name}.motor_{entry.quantity}" in live:
            unused.append(UnusedColumn(entry.column, "it is constant while the motor moves"))
        else:
            kept.append(entry)
    return kept


def _changes(column: Column) -> bool:
    return bool(np.nanmax(column.values) > np.nanmin(column.values))


def _family(column: Column, reading: Reading) -> str:
    """Common name of columns that differ only in numbers."""
    return " ".join(word for word in tokens(column.source) if not word.isdigit()) + reading.quantity


def _joint(
    joints: Sequence[Drive],
    output_joints: Sequence[Drive],
    column: Column,
    reading: Reading,
    family: Sequence[tuple[Column, Reading]],
    alone: Sequence[Column],
) -> tuple[Drive | None, str]:
    """The joint of a column and the reason, or None and the reason why there is none.

    Motors of transmissions count as joints; the `output_joints` of transmissions have to be named.
    """
    named = [
        joint for joint in (*joints, *output_joints) if _within(tokens(joint.name), tokens(column.source))
    ]
    if named:
        joint = max(named, key=lambda joint: len(tokens(joint.name)))
        return joint, f"its name contains the joint {joint.name}"
    if column.number is not None:
        k, count = column.number
        if count == len(joints):
            return joints[k], f"it has as many {next(iter(column.place))}s as the robot has joints"
        return None, f"it has {count} {next(iter(column.place))}s, the robot {len(joints)} joints"
    number = next(reversed(reading.numbers), None)
    if number is None:
        if len(joints) == 1:
            return joints[0], "the robot has one joint"
        return _in_order(joints, column, alone)
    return _numbered(joints, number, [r.numbers[-1] for _, r in family if r.numbers])


def _in_order(joints: Sequence[Drive], column: Column, alone: Sequence[Column]) -> tuple[Drive | None, str]:
    """The joint of a column whose name contains none, if there are as many such columns as joints."""
    if len(alone) == len(joints):
        joint = joints[[other.source for other in alone].index(column.source)]
        return joint, f"{BY_ORDER} '{joint.name}', by the order of columns and joints alone"
    return None, "its name contains no joint"


def _numbered(joints: Sequence[Drive], number: int, numbers: Iterable[int]) -> tuple[Drive | None, str]:
    """The joint with a number, from the numbers in the joints' names or from their order."""
    digits = {joint.name: [word for word in tokens(joint.name) if word.isdigit()] for joint in joints}
    own = {int(digits[joint.name][-1]): joint for joint in joints if digits[joint.name]}
    if len(own) == len(joints) and set(numbers) <= own.keys():
        return own[number], f"{number} is the number of {own[number].name}"
    first = 0 if 0 in numbers else 1
    if first <= number < first + len(joints):
        joint = joints[number - first]
        return joint, f"{number} is {joint.name}, counted from {first} in the order of the robot file"
    return None, f"the robot has no joint number {number}"


def _within(words: Sequence[str], inside: Sequence[str]) -> bool:
    return any(list(inside[k : k + len(words)]) == list(words) for k in range(len(inside) - len(words) + 1))


def _preferred(entries: Sequence[Entry], unused: list[UnusedColumn]) -> Entry:
    """The best of several columns for a channel: varying before constant, measured before computed."""

    def worth(entry: Entry) -> tuple[bool, int, int]:
        return _changes(entry.column), entry.reading.rank, -len(entry.column.source)

    best = max(entries, key=worth)
    others = [entry.column for entry in entries if entry is not best]
    unused += [UnusedColumn(column, f"another column is used for {best.channel}") for column in others]
    different = [column for column in others if not np.array_equal(column.values, best.column.values)]
    if different:
        names = ", ".join(f"'{column.label}'" for column in different)
        best.questions.append(f"there is {names} as well: which one was measured?")
    if best.reading.rank < 0:
        best.questions.append("its name suggests a commanded or computed quantity; was it measured?")
    return best
