"""Joint states under the names of native channels, if unambiguous, and by topic."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.channels.raw import Raw
from robot_model import InputError

__all__ = ["Group", "Variables", "variables"]

#: Time stamps of a group: those of the headers, and of the recorder.
CLOCKS = ("time", "receive_time")
#: Names that an error shows.
_SHOWN = 4


@dataclass(frozen=True)
class Group:
    """Messages of one topic that hold the same joints.

    Attributes:
        number: its place in the file.
        topic: its name.
        joints: their names.
        publishers: nodes that sent them, as far as the bag knows.
        mixed: whether positions alternate between two motions.
    """

    number: int
    topic: str
    joints: Sequence[str]
    publishers: Sequence[str] = field(default=())
    mixed: bool = False

    @property
    def clocks(self) -> list[str]:
        """Keys of its instants."""
        return [f"{self.number}/{clock}" for clock in CLOCKS]

    def __str__(self) -> str:
        more = f" and {len(self.joints) - _SHOWN} more" if len(self.joints) > _SHOWN else ""
        return f"{self.topic} ({', '.join(self.joints[:_SHOWN])}{more})"


@dataclass(frozen=True)
class Variables:
    """Names of variables, and the arrays of the bag from which they come.

    Attributes:
        source: the file, for people.
        groups: all of them.
        keys: variable to the key of its array.
        ambiguous: why there are no native names; empty if there are.
    """

    source: str
    groups: Sequence[Group]
    keys: Mapping[str, str]
    ambiguous: str

    def raw(self, wanted: Mapping[str, str], arrays: Mapping[str, NDArray[Any]]) -> Raw:
        """The variables.

        Args:
            wanted: variable to the key of its array.
            arrays: by key, including those of all clocks [ns].
        """
        clocks: dict[str, NDArray[np.float64]] = {}
        for clock in CLOCKS:
            own = {f"{group.number}/{clock}": arrays[f"{group.number}/{clock}"] for group in self.groups}
            first = min(values.min() for values in own.values())
            clocks |= {key: (values - first) * 1e-9 for key, values in own.items()}
        ambiguous = self.ambiguous or self._unusable(clocks)
        found = {name: clocks.get(key, arrays[key]) for name, key in wanted.items()}
        if ambiguous:
            found.pop("time", None)
        names = tuple(name for name in self.keys if not (ambiguous and name == "time"))
        return Raw(self.source, found, names, unnamed=ambiguous)

    def _unusable(self, clocks: Mapping[str, NDArray[np.float64]]) -> str:
        """Why the header's stamps of the only group cannot be used as time; empty if they can."""
        group = self.groups[0]
        stamps = clocks[f"{group.number}/time"]
        wrong = int(np.sum(np.diff(stamps) <= 0))
        if not wrong:
            return ""
        if not stamps.any() and stamps.size > 1:
            what = f"gives all messages of {group.topic} one and the same time in their headers"
        else:
            what = (
                f"has stamps on {group.topic} that repeat or go back in {wrong} of {stamps.size} headers: "
                "two nodes publish there, or one sends messages again"
            )
        return f'{what}; to use the instants of the recorder, give a map with [time] source = "receive_time"'


def variables(source: str, groups: Sequence[Group], keys: Sequence[str]) -> Variables:
    """Names of the variables of a bag.

    Args:
        source: the file, for people.
        groups: all groups of the bag.
        keys: of its arrays, ``NUMBER/time`` or ``NUMBER/JOINT.QUANTITY``.

    Raises:
        InputError: joints that two nodes publish.
    """
    _check_publishers(source, groups)
    own = {group.number: [k for k in keys if k.split("/", 1)[0] == str(group.number)] for group in groups}
    named: dict[str, str] = {}
    if len(groups) == 1:
        named = {key.split("/", 1)[1]: key for key in own[groups[0].number]}
    for group in groups:
        inner = {key.split("/", 1)[1]: key for key in own[group.number]}
        for name, key in inner.items():
            if name not in CLOCKS:
                named[f"{group.topic}.{name}"] = key
        for joint in group.joints:
            named |= {f"{group.topic}.{joint}.{clock}": inner[clock] for clock in CLOCKS}
    ambiguous = ""
    if len(groups) > 1:
        sample = f"{groups[0].topic}.{groups[0].joints[0]}"
        ambiguous = (
            f"has joint states of {len(groups)} kinds, {'; '.join(map(str, groups[:_SHOWN]))}; say in a map "
            f'which are meant, as source = "{sample}.position" with [time] source = "{sample}.time"'
        )
    return Variables(source, groups, named, ambiguous)


def _check_publishers(source: str, groups: Sequence[Group]) -> None:
    seen: dict[tuple[str, str], Group] = {}
    for group in groups:
        if len(group.publishers) > 1:
            raise InputError(
                f"{source} has the same joints from {len(group.publishers)} nodes on {group.topic} "
                f"({', '.join(group.publishers[:_SHOWN])}); record one of them, or remap its topic."
            )
        if group.mixed:
            raise InputError(
                f"{source} has positions on {group.topic} that jump to and fro between two motions, message "
                "by message, as where two nodes publish the same joints; record one of them, or remap its "
                "topic."
            )
        for joint in group.joints:
            other = seen.setdefault((group.topic, joint), group)
            if other is not group:
                raise InputError(
                    f"{source} has joint {joint} in messages of two kinds on {group.topic}, "
                    f"{', '.join(other.joints[:_SHOWN])} and {', '.join(group.joints[:_SHOWN])}, as where "
                    "two nodes publish it; record one of them, or remap its topic."
                )
