"""Bags that the tests write: joint states of any names and stamps, in all three containers."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2.enums import StoragePlugin
from rosbags.typesys import Stores, get_typestore

JOINT_STATE = "sensor_msgs/msg/JointState"
T = np.arange(80) / 100.0
START = 1_700_000_000 * 10**9
#: What the recorder's clock is ahead of that of the robot, and how it jitters [ns].
LATE = 3_000_000

#: Topic, message type, time received [ns], message without its header, stamp [ns]; and who sends it.
Sent = tuple[str, str, int, dict[str, Any], int, str]


def states(
    topic: str = "/joint_states",
    joints: Sequence[str] = ("joint1", "joint2"),
    *,
    time: Any = T,
    stamps: Any = None,
    node: str = "/driver",
    **fields: Any,
) -> list[Sent]:
    """Joint states at instants [s]: a sine, its rate and its negative, each joint in its own amplitude."""
    found = []
    for k, t in enumerate(time):
        size = 1.0 + np.arange(len(joints))
        message = {
            "name": list(joints),
            "position": size * np.sin(t),
            "velocity": size * np.cos(t),
            "effort": -size * np.sin(t),
        } | {name: np.asarray(values[k]) for name, values in fields.items()}
        stamp = START + round(t * 1e9) if stamps is None else int(stamps[k])
        found.append((topic, JOINT_STATE, START + LATE + round(t * 1e9), message, stamp, node))
    return found


def texts(topic: str = "/chatter", count: int = 5) -> list[Sent]:
    """Messages of another type."""
    kind = "std_msgs/msg/String"
    return [(topic, kind, START + k * 10**7, {"data": "hello"}, 0, "/talker") for k in range(count)]


def write_bag(
    path: Path, sent: Sequence[Sent], *, also: Sequence[tuple[str, str]] = (), packed: str = ""
) -> Path:
    """Write the messages, in what the path's suffix says.

    Args:
        path: of the file, or of the folder where it has no suffix.
        sent: the messages.
        also: topics with their types and no message.
        packed: what is compressed: "chunk" in version 1, "file", "message" or "storage" in version 2.
    """
    first = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
    if first:
        writer = rosbag1.Writer(path)
        if packed:
            writer.set_compression(rosbag1.Writer.CompressionFormat.LZ4)
        with writer as bag:
            _fill(bag, store, sent, also)
        return path
    kind = StoragePlugin.SQLITE3 if path.suffix == ".db3" else StoragePlugin.MCAP
    folder = path.with_suffix("")
    bag = rosbag2.Writer(folder, version=9, storage_plugin=kind)
    if packed:
        bag.set_compression(rosbag2.CompressionMode[packed.upper()], rosbag2.CompressionFormat.ZSTD)
    with bag:
        _fill(bag, store, sent, also)
    if not path.suffix:
        return path
    [file] = folder.glob(f"*{path.suffix}")
    file.rename(path)
    shutil.rmtree(folder)
    return path


def _fill(bag: Any, store: Any, sent: Sequence[Sent], also: Sequence[tuple[str, str]]) -> None:
    first = isinstance(bag, rosbag1.Writer)
    connections: dict[tuple[str, str], Any] = {}

    def connection(topic: str, kind: str, node: str) -> Any:
        key = (topic, node if first else "")
        if key not in connections:
            more = {"callerid": node} if first else {}
            connections[key] = bag.add_connection(topic, kind, typestore=store, **more)
        return connections[key]

    for topic, kind in also:
        connection(topic, kind, "/driver")
    for topic, kind, received, message, stamp, node in sorted(sent, key=lambda each: each[2]):
        content = _message(store, kind, message, stamp)
        write = store.serialize_ros1 if first else store.serialize_cdr
        bag.write(connection(topic, kind, node), received, write(content, kind))


def _message(store: Any, kind: str, message: dict[str, Any], stamp: int) -> Any:
    if kind != JOINT_STATE:
        return store.types[kind](**message)
    time = store.types["builtin_interfaces/msg/Time"](*divmod(stamp, 10**9))
    number = {"seq": 0} if "seq" in store.types["std_msgs/msg/Header"].__dataclass_fields__ else {}
    header = store.types["std_msgs/msg/Header"](stamp=time, frame_id="", **number)
    return store.types[kind](header=header, **message)
