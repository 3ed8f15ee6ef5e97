"""The program that reads ROS bags, run as a separate process.

    python program.py PATH BYTES

Chunks of a bag may unpack to any size, and a database may take any time, so the memory and time of this
process are limited; BYTES is the memory for joint states. The protocol is described in
`missing_physics.isolation.process`. The first line has "topics", each with name, type and number of messages,
and "groups", each with topic, joints and publishers; or "refused", a sentence without the file's name.

Messages are decoded by the definitions that come with rosbags, never by those in the file, from which rosbags
would generate and run code.
"""

from __future__ import annotations

import json
import sys
from array import array
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

from missing_physics.isolation.limits import Limits, fail, say, send

__all__ = ["main"]

#: The message type that is understood, and its fields by the names of native channels.
JOINT_STATE = "sensor_msgs/msg/JointState"
FIELDS = {"position": "position", "velocity": "velocity", "effort": "torque"}
#: Lowest rate of skipping through a bag [bytes/s].
_SLOWEST = 1e6
#: Largest unpacked size of a compressed bag as a multiple of its size, and the size that is always allowed
#: [bytes].
_MOST_UNPACKED, _HARMLESS = 50, 1 << 26
#: Number of copies in memory while numbers are read.
_COPIES = 3
_NUMBER = 8
#: Messages used to detect that two nodes alternate, how many of one node may be consecutive, and the fraction
#: of the change between consecutive messages that remains between messages of the same node.
_FEWEST, _MOST_APART, _RETURNS = 20, 6, 0.1


class Refusal(Exception):
    """Joint states are unusable; the message is the end of a sentence that begins with the file's name."""


class Group:
    """Messages of one topic that hold the same joints.

    Attributes:
        topic: its name.
        joints: their names, sorted.
        publishers: nodes that sent them, as far as the bag knows.
        stamps: of the headers [ns].
        received: when the recorder had them [ns].
        columns: position, velocity and effort of all joints, message after message; NaN where there is none.
    """

    def __init__(self, topic: str, joints: tuple[str, ...]) -> None:
        self.topic, self.joints = topic, joints
        self.publishers: dict[str, None] = {}
        self.stamps, self.received = array("q"), array("q")
        self.columns = {field: array("d") for field in FIELDS}

    def add(self, message: Any, received: int, publisher: str) -> int:
        """Add a message; returns its memory in bytes."""
        if publisher:
            self.publishers.setdefault(publisher)
        stamp = message.header.stamp
        self.stamps.append(stamp.sec * 10**9 + stamp.nanosec)
        self.received.append(received)
        order = sorted(range(len(message.name)), key=message.name.__getitem__)
        for field, column in self.columns.items():
            values = getattr(message, field)
            if len(values) not in (0, len(order)):
                raise Refusal(
                    f"has {len(values)} values of {field} for {len(order)} joints in message "
                    f"{len(self.stamps)} of {self.topic}; correct the node that publishes them"
                )
            column.extend(values[order] if len(values) else [np.nan] * len(order))
        return (2 + 3 * len(order)) * _NUMBER

    def to_and_fro(self) -> bool:
        """Whether positions jump between two motions, as when two nodes publish the same joints.

        For one motion, or noise, the change over several messages is not smaller than between consecutive
        ones.
        """
        positions = np.array(self.columns["position"]).reshape(-1, len(self.joints))
        if len(positions) < _FEWEST or not np.isfinite(positions).all():
            return False
        steps = [float(np.sum((positions[k:] - positions[:-k]) ** 2)) for k in range(1, _MOST_APART + 1)]
        return min(steps[1:]) < _RETURNS * steps[0]

    def variables(self) -> Iterator[tuple[str, NDArray[Any]]]:
        """Its variables by name: ``time``, ``receive_time`` [ns], ``JOINT.QUANTITY``, each of shape (N,)."""
        yield "time", np.array(self.stamps, dtype=np.int64)
        yield "receive_time", np.array(self.received, dtype=np.int64)
        for field, quantity in FIELDS.items():
            table = np.array(self.columns[field]).reshape(-1, len(self.joints))
            for joint, values in zip(self.joints, table.T):
                if not np.isnan(values).all():
                    yield f"{joint}.{quantity}", values


def main(path: str, size: str) -> None:
    """See the module."""
    files = [file for file in Path(path).iterdir() if file.is_file()] if Path(path).is_dir() else [Path(path)]
    stored = sum(file.stat().st_size for file in files)
    limits = Limits(stored / _SLOWEST)
    try:
        limits.allow_files(_MOST_UNPACKED * stored + _HARMLESS)
        limits.allow(_COPIES * int(float(size)))
        with _opened(Path(path)) as bag:
            topics = [(str(c.topic), str(c.msgtype), int(c.msgcount)) for c in bag.connections]
            groups = _groups(bag, float(size))
        _answer(topics, groups)
    except Refusal as error:
        say({"refused": str(error)})
    except Exception as error:  # the library raises a dozen types, and documents a few of them
        fail(error, limits)


def _opened(path: Path) -> Any:
    return rosbag1.Reader(path) if path.suffix.lower() == ".bag" else rosbag2.Reader(path)


def _groups(bag: Any, most: float) -> list[Group]:
    """All joint states, by topic and joints."""
    first = isinstance(bag, rosbag1.Reader)
    store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
    decode = store.deserialize_ros1 if first else store.deserialize_cdr
    connections = [c for c in bag.connections if c.msgtype == JOINT_STATE]
    if not first:
        for connection in connections:
            if connection.ext.serialization_format != "cdr":
                raise Refusal(
                    f"holds messages of {connection.topic} in the encoding "
                    f"'{connection.ext.serialization_format}', where ROS 2 writes 'cdr'; record them "
                    "with ROS 2"
                )
    groups: dict[tuple[str, tuple[str, ...]], Group] = {}
    taken = 0
    for connection, received, data in bag.messages(connections) if connections else ():
        message: Any = decode(data, JOINT_STATE)
        joints = tuple(sorted(message.name))
        if len(set(joints)) < len(joints):
            raise Refusal(
                f"names a joint twice in a message of {connection.topic}; correct the node that sends it"
            )
        key = (connection.topic, joints)
        group = groups.setdefault(key, Group(*key)) if key not in groups else groups[key]
        taken += group.add(message, received, str(getattr(connection.ext, "callerid", None) or ""))
        if taken > most:
            raise Refusal(
                f"holds joint states that take more than {most / 1e9:g} GB of memory; record less, or allow "
                "more (--size-limit)"
            )
    return [group for group in groups.values() if group.joints]


def _answer(topics: list[tuple[str, str, int]], groups: list[Group]) -> None:
    """Write the content, and send the requested datasets."""
    named = [dict(group.variables()) for group in groups]
    found = {f"{k}/{name}": values for k, group in enumerate(named) for name, values in group.items()}
    described = [
        {
            "topic": group.topic,
            "joints": group.joints,
            "publishers": list(group.publishers),
            "mixed": group.to_and_fro(),
        }
        for group in groups
    ]
    declared = [
        {"name": name, "shape": values.shape, "entry": _NUMBER, "chunk": 0} for name, values in found.items()
    ]
    say({"topics": topics, "groups": described, "datasets": declared})
    for name in json.loads(sys.stdin.readline() or '{"names": []}')["names"]:
        send(np.ascontiguousarray(found[name]))


if __name__ == "__main__":
    main(*sys.argv[1:])
