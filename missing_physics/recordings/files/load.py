"""The one entry point from a file to a `Recording`."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping as MappingType
from dataclasses import replace
from pathlib import Path
from typing import Any

from missing_physics.recordings.channels.names import is_native
from missing_physics.recordings.channels.raw import Raw, Want
from missing_physics.recordings.files.apply import constants_of, from_mapping, from_native_names, wants_native
from missing_physics.recordings.inspection.consistency import require_consistent
from missing_physics.recordings.maps.mapping import JoinedFile, Mapping, load_mapping, mapping_from_tables
from missing_physics.recordings.readers import SIZE_LIMIT, Budget, read_raw
from missing_physics.recordings.readers.tables import raw_of
from missing_physics.recordings.variables import MIN_SAMPLES
from robot_model import InputError, Recording, Robot

__all__ = [
    "load_constants",
    "load_recording",
    "load_recording_and_constants",
    "own_mapping",
    "recording_from_table",
    "recording_of_raw",
]

#: Part of a file: FILE@FIRST:LAST or FILE[FIRST:LAST], in seconds.
_PARTS = tuple(
    re.compile(form, re.DOTALL)
    for form in (
        r"(?P<file>.+)@(?P<first>[^@:]*):(?P<last>[^@:]*)",
        r"(?P<file>.+)\[(?P<first>[^\[\]:]*):(?P<last>[^\[\]:]*)\]",
    )
)


def load_recording(
    path: str | os.PathLike[str],
    *,
    mapping: Mapping | None = None,
    check: bool = True,
    robot: Robot | None = None,
    size_limit: float = SIZE_LIMIT,
) -> Recording:
    """The recording in a file, in SI units.

    Args:
        path: CSV, Parquet, MAT, HDF5, NPZ, JSON or a ROS bag, by its suffix; a pipe without one is CSV.
            ``FILE[FIRST:LAST]`` or ``FILE@FIRST:LAST`` means the samples from FIRST up to, but not including,
            LAST [s]; either may be omitted.
        mapping: for files whose variables do not have native names; see `load_mapping`. By default the one in
            ``NAME.map.toml`` next to the file, if it exists.
        check: refuse channels that contradict each other (degrees as radians, time in milliseconds, exchanged
            joints, a quaternion in another order).
        robot: if known, its gear ratios and limits are weighed in that.
        size_limit: memory for the variables that are read, including those of joined files [bytes].

    Returns:
        Channels over `time`; instants are not changed, uniform or not.

    Raises:
        InputError: missing, empty, truncated, of unknown format; no such channel; text instead of numbers;
            all NaN; time that repeats, goes back or is missing; too short; larger than the limit;
            channels that contradict each other.
        OutOfMemoryError: the machine has too little memory.
    """
    mapping = mapping or own_mapping(path)
    recording, _ = load_recording_and_constants(path, mapping=mapping, size_limit=size_limit)
    if check:
        require_consistent(recording, robot=robot, mapping=mapping)
    return recording


def recording_from_table(
    data: Any,
    *,
    mapping: Mapping | None = None,
    units: MappingType[str, str] | None = None,
    name: str = "data",
    check: bool = True,
    robot: Robot | None = None,
) -> Recording:
    """The recording in a table in memory, in SI units.

    Args:
        data: a data frame of pandas, polars, PyArrow or any other that Narwhals knows; a Dataset of xarray; a
            dictionary of arrays, of shape (N,) or, picked by a mapping, (N, k); a structured array. An index
            of pandas that is more than row numbers counts as a column, called ``time`` if it has no name.
        mapping: for tables whose columns do not have native names; see `load_mapping`.
        units: instead of a mapping, of columns with native names that are not in SI units, as in
            ``{"time": "ms", "joint1.position": "deg"}``.
        name: its name in errors and as the recording's `source`.
        check: refuse channels that contradict each other; see `load_recording`.
        robot: if known, its gear ratios and limits are weighed in that.

    Returns:
        Channels over `time`; copies, so that the table may change.

    Raises:
        InputError: no table; units together with a mapping, of a column that is not there, or of another
            quantity; a mapping that joins files; and as `load_recording`.
    """
    raw = raw_of(data, name=name)
    if units:
        if mapping is not None:
            raise InputError("units go into the mapping where there is one; give one of the two.")
        mapping = _of_units(raw, units)
    if mapping is not None and (mapping.join or mapping.skip_lines):
        raise InputError(f"{name} is no file; take join and skip_lines out of the mapping.")
    recording = recording_of_raw(raw, mapping)
    if check:
        require_consistent(recording, robot=robot, mapping=mapping)
    return recording


def recording_of_raw(raw: Raw, mapping: Mapping | None = None) -> Recording:
    """The recording in variables that were read, unchecked. Raises `InputError` as `load_recording`."""
    return from_native_names(raw) if mapping is None else from_mapping(raw, mapping)


def _of_units(raw: Raw, units: MappingType[str, str]) -> Mapping:
    """A mapping that reads columns with native names in the given units."""
    for label in units:
        if label not in raw.names:
            raise InputError(
                f"{raw.source} has no column '{label}' for the unit '{units[label]}'{raw.hint(label)}"
            )
    tables = {label: {"source": label} for label in raw.names if is_native(label)}
    entries = {"time": {"source": "time"}, **tables}
    for label, unit in units.items():
        if label not in entries:
            raise InputError(
                f"'{label}' is no native channel, so that its unit means nothing; rename it, or give a "
                "mapping."
            )
        entries[label] = {"source": label, "unit": unit}
    return mapping_from_tables({"time": entries.pop("time"), "channels": entries}, source="units")


def load_recording_and_constants(
    path: str | os.PathLike[str], *, mapping: Mapping | None, size_limit: float = SIZE_LIMIT
) -> tuple[Recording, dict[str, float]]:
    """`load_recording`, unchecked, and `load_constants` in one, for files that can be read only once."""
    mapping = mapping or own_mapping(path)
    budget = Budget(size_limit)
    file, window = _part_of(path)
    if mapping is None:
        recording = from_native_names(read_raw(file, want=wants_native, budget=budget))
        constants: dict[str, float] = {}
    else:
        raw = _joined(file, mapping, budget)
        recording, constants = from_mapping(raw, mapping), constants_of(raw, mapping)
    if window is not None:
        recording = _cut(recording, window, named=str(path))
    return recording, constants


def load_constants(
    path: str | os.PathLike[str], *, mapping: Mapping, size_limit: float = SIZE_LIMIT
) -> dict[str, float]:
    """The numbers of the file that the mapping's `constants` name, e.g. a servo's gain."""
    wanted = {pick.source for pick in mapping.constants.values()}
    return constants_of(
        _joined(_part_of(path)[0], mapping, Budget(size_limit), want=wanted.__contains__), mapping
    )


def own_mapping(path: str | os.PathLike[str]) -> Mapping | None:
    """The mapping in ``NAME.map.toml`` next to a recording ``NAME.csv``, or None.

    Raises:
        InputError: the file is not a mapping.
    """
    file = _part_of(path)[0]
    try:
        adjacent = file.with_name(f"{file.stem}.map.toml")
        exists = adjacent.is_file()
    except (OSError, ValueError):  # a path without a name, or a name that the system does not accept
        return None
    return load_mapping(adjacent) if exists else None


def _part_of(path: str | os.PathLike[str]) -> tuple[Path, tuple[float, float] | None]:
    """File and first and last instant [s]; None for the complete file.

    Raises:
        InputError: the text after @ or in brackets is not a pair of instants.
    """
    text = os.fspath(path)
    found = next((match for form in _PARTS if (match := form.fullmatch(text))), None)
    if found is None or Path(path).is_file() or not Path(found["file"]).is_file():
        return Path(path), None
    try:
        first = float(found["first"] or -math.inf)
        last = float(found["last"] or math.inf)
    except ValueError:
        first = last = math.nan
    if not first < last:
        raise InputError(
            f"{path}: behind @ or in brackets two instants in seconds are expected, the first before the "
            "last, as in 0:12 or 12:."
        )
    return Path(found["file"]), (first, last)


def _cut(recording: Recording, window: tuple[float, float], *, named: str) -> Recording:
    cut = recording.window(*window)
    if len(cut) < MIN_SAMPLES:
        raise InputError(
            f"{named} has {len(cut)} samples, of a recording from {recording.time[0]:g} to "
            f"{recording.time[-1]:g} s; at least {MIN_SAMPLES} are needed."
        )
    return replace(cut, source=named)


def _joined(
    path: str | os.PathLike[str], mapping: Mapping, budget: Budget, *, want: Want | None = None
) -> Raw:
    """The variables of the file and of its joined files; the latter also as ``STEM.NAME``."""
    wanted = want or _wanted(mapping)
    raw = read_raw(path, want=wanted, skip_lines=mapping.skip_lines, budget=budget)
    for other in mapping.join:
        more = _companion(other, Path(path), wanted, budget, skip_lines=mapping.skip_lines)
        raw = replace(raw, variables={**more.variables, **raw.variables}, names=raw.names + more.names)
    return raw


def _wanted(mapping: Mapping) -> Want:
    sources = mapping.sources()
    if mapping.channels:
        return sources.__contains__
    return lambda name: name in sources or is_native(name)


def _companion(other: JoinedFile, recording: Path, wanted: Want, budget: Budget, *, skip_lines: int) -> Raw:
    """A joined file of a recording, each variable under its name and as ``PREFIX.NAME``."""
    path = other.located(recording)
    prefix = other.prefix or path.stem

    def want(name: str) -> bool:
        return wanted(name) or wanted(f"{prefix}.{name}")

    raw = read_raw(path, want=want, skip_lines=skip_lines, budget=budget)
    qualified = {f"{prefix}.{name}": values for name, values in raw.variables.items()}
    names = (*raw.names, *(f"{prefix}.{name}" for name in raw.names))
    return replace(raw, variables={**qualified, **raw.variables}, names=names)
