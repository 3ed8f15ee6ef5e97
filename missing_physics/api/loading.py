"""Robots and recordings: from files, from tables in memory, or unchanged objects."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping as MappingType
from typing import Any, TypeAlias

from missing_physics.recordings import SIZE_LIMIT, Mapping, load_mapping, recording_from_table
from missing_physics.recordings import load_recording as recording_from_file
from robot_model import InputError, Recording, Robot, read_robot

__all__ = ["MapLike", "PathLike", "RobotLike", "load_recording", "load_robot", "map_of", "several"]

PathLike: TypeAlias = str | os.PathLike[str]
RobotLike: TypeAlias = PathLike | Robot
MapLike: TypeAlias = PathLike | Mapping


def load_robot(robot: RobotLike, *, overlay: PathLike | None = None) -> Robot:
    """A robot from its file, or a shipped one by its name.

    Args:
        robot: file (TOML, URDF, xacro or MJCF) or name of a shipped robot; a `Robot` is returned unchanged.
        overlay: TOML file whose keys override those of the robot, such as what a URDF or MJCF file cannot
            hold. By default ``NAME.overlay.toml`` next to such a file, if it exists.

    Returns:
        The robot, in SI units. Parts of its file that are ignored are reported as a `UserWarning`.

    Raises:
        InputError: no such file or robot; an invalid key or value, with its place; an overlay for a robot
            that is already loaded.
    """
    if isinstance(robot, Robot):
        if overlay is not None:
            raise InputError(f"robot '{robot.name}' was read already; give the overlay where it is loaded.")
        return robot
    found, notes = read_robot(robot, overlay=overlay)
    for note in notes:
        warnings.warn(f"{robot}: {note}", UserWarning, stacklevel=2)
    return found


def load_recording(
    source: Any,
    *,
    map: MapLike | None = None,
    units: MappingType[str, str] | None = None,
    robot: RobotLike | None = None,
    check: bool = True,
    size_limit: float = SIZE_LIMIT,
) -> Recording:
    """A recording from a file or a table in memory.

    Args:
        source: file (CSV, Parquet, MAT, HDF5, NPZ, JSON or a ROS bag; ``FILE[0:12]`` is a part, in seconds);
            a data frame of pandas, polars or PyArrow; a Dataset of xarray; a dictionary of arrays of shape
            (N,). A `Recording` is returned unchanged.
        map: mapping, or its file (TOML), if columns do not have native names such as ``joint1.position``. By
            default ``NAME.map.toml`` next to a file, if it exists.
        units: of columns of a table that are not in SI units, such as ``{"time": "ms",
            "joint1.position": "deg"}``.
        robot: if given, the check uses its gear ratios and limits.
        check: refuse channels that contradict each other, such as degrees given as radians.
        size_limit: of a file's variables in memory [bytes].

    Returns:
        Channels of shape (N,) in SI units over `time` [s].

    Raises:
        InputError: what is wrong, where, and how to correct it.
        OutOfMemoryError: the machine has too little memory.
    """
    if isinstance(source, Recording):
        return source
    model = None if robot is None else load_robot(robot)
    mapping = map_of(map)
    if not isinstance(source, str | os.PathLike):
        return recording_from_table(source, mapping=mapping, units=units, check=check, robot=model)
    if units is not None:
        raise InputError(f"{source} is a file; the units of its columns belong in a map.")
    return recording_from_file(source, mapping=mapping, check=check, robot=model, size_limit=size_limit)


def map_of(map: MapLike | None) -> Mapping | None:
    """The mapping, read if its file is given. Raises `InputError` if there is no such file."""
    return load_mapping(map) if isinstance(map, str | os.PathLike) else map


def several(sources: Any) -> tuple[Any, ...]:
    """One recording or a list or tuple of them, as a tuple."""
    return tuple(sources) if isinstance(sources, list | tuple) else (sources,)
