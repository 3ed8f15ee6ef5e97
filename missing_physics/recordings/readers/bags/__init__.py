"""ROS bags: version 1 (``.bag``), version 2 (``.db3``, ``.mcap``, or the folder with its ``metadata.yaml``).

Messages of type ``sensor_msgs/JointState`` are read. rosbags reads all three without ROS, whereas `mcap` and
its extensions support neither version 1 nor databases.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from missing_physics.isolation.process import started
from missing_physics.recordings.channels.raw import Raw, Want
from missing_physics.recordings.readers.bags.states import Group, variables
from missing_physics.recordings.readers.base import reading
from missing_physics.recordings.readers.source import Source
from robot_model import InputError

__all__ = ["SUFFIXES", "read"]

SUFFIXES = (".bag", ".db3", ".mcap")

_PROGRAM = Path(__file__).with_name("program.py")
_MCAP = b"\x89MCAP0\r\n"
#: Bytes between the magic number of MCAP and the length of its profile's name; the longest name.
_BEFORE_PROFILE, _LONGEST_PROFILE = 9, 64
_ADDRESS = "?#%"
#: Topics that an error shows.
_SHOWN = 6


def read(source: Source, *, want: Want) -> Raw:
    """The joint states of a bag.

    ``JOINT.position``, ``.velocity``, ``.torque``, and their ``time``, that of the headers [s from the
    first], if a single topic has one set of joints and increasing stamps; each also as
    ``TOPIC.JOINT.position`` and so on, in addition to ``TOPIC.JOINT.time`` and ``TOPIC.JOINT.receive_time``.

    Raises:
        InputError: rosbags is not installed; truncated, damaged, larger than the budget; no joint states,
            empty topics, messages that contradict themselves, joints that two nodes publish.
    """
    if find_spec("rosbags") is None:
        raise InputError(
            f"{source} is a ROS bag, for which the library rosbags is missing; install it with "
            "pip install 'missing-physics[bags]'."
        )
    with reading(source, "ROS bag"):
        _check_profile(source)
        path = _path(source)
        limit = source.budget.limit - source.budget.taken
        with (
            TemporaryDirectory(prefix="missing-physics-") as folder,
            started(_PROGRAM, path, repr(limit), library="the bag's library", folder=folder) as process,
        ):
            content = process.read()
            if "refused" in content:
                raise InputError(f"{source} {content['refused']}.")
            groups = [Group(k, **group) for k, group in enumerate(content["groups"])]
            if not groups:
                raise InputError(f"{source} {_nothing(content['topics'])}.")
            items = {item["name"]: item for item in content["datasets"]}
            found = variables(source.name, groups, list(items))
            wanted = {name: items[key] for name, key in found.keys.items() if want(name)}
            needed = {item["name"]: item for item in wanted.values()}
            needed |= {key: items[key] for group in groups for key in group.clocks}
            for item in needed.values():
                source.budget.take_array(source, item["name"], item["shape"], item["entry"])
            process.ask(list(needed), 0)
            arrays = {name: process.numbers(item) for name, item in needed.items()}
        return found.raw({name: item["name"] for name, item in wanted.items()}, arrays)
    raise AssertionError("unreachable: reading() raises")


def _path(source: Source) -> str:
    """Path of the bag. rosbags opens databases by a URL, in which some characters are special."""
    path = source.path.resolve()
    files = [file for file in path.iterdir() if file.suffix == ".db3"] if path.is_dir() else [path]
    if any(set(_ADDRESS) & set(str(file)) for file in files if file.suffix == ".db3"):
        raise InputError(
            f"{source} has one of {' '.join(_ADDRESS)} in its path; rename the file or its folder."
        )
    return str(path)


def _check_profile(source: Source) -> None:
    """Raises `InputError` unless an MCAP file, a general container, has a supported profile in its header."""
    if source.path.is_dir():
        return
    with source.path.open("rb") as file:
        if file.read(len(_MCAP)) != _MCAP:
            return
        file.seek(len(_MCAP) + _BEFORE_PROFILE)
        length = int.from_bytes(file.read(4), "little")
        profile = file.read(min(length, _LONGEST_PROFILE)).decode("utf-8", "replace")
    if length <= _LONGEST_PROFILE and profile != "ros2":
        what = f"messages of the profile '{profile}'" if profile else "messages of no profile"
        raise InputError(
            f"{source} holds {what}, of which no joint states can be read; convert it to a bag of ROS 2, or "
            "export it to CSV."
        )


def _nothing(topics: list[list[object]]) -> str:
    """Why there are no joint states."""
    empty = [str(topic) for topic, kind, _ in topics if str(kind).endswith("/JointState")]
    if empty:
        return (
            f"has no joints on {empty[0]}, whose type is sensor_msgs/JointState: the topic is empty, or its "
            "messages name no joints; record it while the robot's driver publishes"
        )
    shown = ", ".join(f"{topic} ({kind})" for topic, kind, _ in topics[:_SHOWN])
    more = f" and {len(topics) - _SHOWN} more" if len(topics) > _SHOWN else ""
    contents = f"it has {shown}{more}" if topics else "it has no topics"
    return (
        f"has no messages of type sensor_msgs/JointState ({contents}); record one, or export the data to CSV"
    )
