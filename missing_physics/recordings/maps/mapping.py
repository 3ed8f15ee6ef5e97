"""Mapping files (TOML): where in a foreign file each native channel comes from.

There is no expression language and nothing is evaluated: a channel is one variable, or a named function of
several (a product, a sum, a servo's voltage), then scaled, shifted and limited.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    Field,
    ValidationError,
    model_validator,
)

from missing_physics.recordings.channels.names import check_native, place_of
from missing_physics.recordings.maps.conversion import Conversion, conversion, seconds
from missing_physics.recordings.maps.picks import (
    Flag,
    Number,
    Part,
    Pick,
    Place,
    ServoVoltage,
    Whole,
    as_pick,
)
from robot_model import InputError, nearest, toml_tables, toml_text
from robot_model.input.complaint import shown

__all__ = [
    "ChannelSource",
    "JoinedFile",
    "LowPassFilter",
    "Mapping",
    "Pick",
    "ServoVoltage",
    "TimeSource",
    "load_mapping",
    "mapping_from_tables",
    "mapping_from_toml",
]


class TimeSource(Place):
    """Source of `time`: a variable of numbers or of timestamps, or a rate."""

    source: str | None = Field(default=None, description="variable that holds the sample instants")
    scale: Number = Field(
        default=1.0, gt=0, description="seconds per unit of the variable, e.g. 0.001 for ms"
    )
    unit: str | None = Field(default=None, description='unit of the variable, e.g. "ms"; scale acts too')
    start_at_zero: Flag = Field(
        default=False, description="subtract the first instant (always done with timestamps)"
    )
    rate: Number | None = Field(
        default=None, gt=0, description="samples per second, instead of a variable [Hz]"
    )
    equal_stamps: Literal["refuse", "spread"] = Field(
        default="refuse",
        description="what to do with rows of one and the same instant: refuse them, or spread them evenly up "
        "to the next instant, as where a clock is coarser than the sampling",
    )

    @model_validator(mode="after")
    def _one_source(self) -> TimeSource:
        if (self.source is None) == (self.rate is None):
            raise ValueError("give either source or rate")
        if self.unit is not None:
            seconds(self.unit)
        return self

    @property
    def step(self) -> float:
        """Seconds per unit of the variable, by its unit and scale."""
        return self.scale * (1.0 if self.unit is None else seconds(self.unit))


class LowPassFilter(Part):
    """``w^2 / (s^2 + 2 d w s + w^2)`` with w = 2 pi `frequency` and d the damping ratio."""

    frequency: Number = Field(gt=0, description="natural frequency [Hz]")
    damping_ratio: Number = Field(
        default=0.5**0.5, gt=0, description="damping ratio; that of Butterworth when left out"
    )


class ChannelSource(Place):
    """One native channel: ``scale * X + offset`` in SI units, limited to `clip`.

    X is `source`, the product of `product`, the sum of `terms`, or the voltage of `servo` (exactly one of
    them), converted to SI units if `unit` is given.
    """

    source: str | None = Field(default=None, description="name of the variable in the file")
    product: tuple[Annotated[Pick, BeforeValidator(as_pick)], ...] = Field(
        default=(),
        description="variables to multiply: names, or tables with source, row, column, scale, offset",
    )
    terms: tuple[Annotated[Pick, BeforeValidator(as_pick)], ...] = Field(
        default=(), description="variables to add"
    )
    servo: ServoVoltage | None = Field(
        default=None, description="proportional servo, whose voltage X is, from its goal and its position"
    )
    unit: str | None = Field(
        default=None, description='unit of X, e.g. "deg", "rpm", "A", "Nm"; SI when left out'
    )
    scale: Number = Field(default=1.0, description="factor to the SI unit, or on top of the unit's")
    offset: Number = Field(default=0.0, description="added after scaling, in the SI unit")
    clip: tuple[Number, Number] | None = Field(
        default=None, description="least and largest value, after scale and offset, in the SI unit"
    )
    signed_bits: Whole | None = Field(
        default=None,
        ge=2,
        le=64,
        description="the variable is a signed integer of so many bits, logged as unsigned",
    )
    derivative: Flag = Field(default=False, description="take the time derivative, by central differences")
    delay: Number = Field(default=0.0, description="delay of the channel; it is compensated [s]")
    low_pass: LowPassFilter | None = Field(
        default=None,
        description="filter that the channel went through before it was recorded; it is inverted",
    )
    time: TimeSource | None = Field(
        default=None, description="the channel's own sample instants, if it has any"
    )
    valid: str | None = Field(
        default=None, description="variable that is 0 or false where the channel is invalid"
    )
    noise: Number | None = Field(default=None, ge=0, description="standard deviation of white noise, SI unit")
    resolution: Number | None = Field(default=None, ge=0, description="smallest step, SI unit")

    @model_validator(mode="after")
    def _one_origin(self) -> ChannelSource:
        if sum((self.source is not None, bool(self.product), bool(self.terms), self.servo is not None)) != 1:
            raise ValueError("give exactly one of source, product, terms and servo")
        if self.clip is not None and not self.clip[0] < self.clip[1]:
            raise ValueError("clip must be a least and a larger largest value")
        if self.scale == 0.0:
            raise ValueError("a scale of 0 makes the channel zero")
        if self.source is None and (self.signed_bits or self.derivative or self._placed()):
            raise ValueError(
                "row, column, index, reshape, signed_bits and derivative belong in the tables of product, "
                "terms or servo"
            )
        return self

    def _placed(self) -> bool:
        return (self.row, self.column, self.index, self.reshape) != (None, None, None, None)

    def picks(self) -> tuple[Pick, ...]:
        """The variables that are read, in order."""
        if self.servo is not None:
            return self.servo.picks()
        if self.source is None:
            return self.product or self.terms
        return (
            Pick(
                source=self.source,
                row=self.row,
                column=self.column,
                index=self.index,
                reshape=self.reshape,
                signed_bits=self.signed_bits,
                derivative=self.derivative,
            ),
        )


class JoinedFile(Part):
    """A file next to the recording that belongs to it; its variables also have names ``PREFIX.NAME``."""

    file: str = Field(description="name of the file; {stem} stands for the recording's name without suffix")
    prefix: str | None = Field(
        default=None, min_length=1, description="the file's own name without suffix when left out"
    )

    def located(self, recording: Path) -> Path:
        """Path of the file."""
        return recording.parent / self.file.replace("{stem}", recording.stem)


def _joined_file(value: Any) -> Any:
    return {"file": value} if isinstance(value, str) else value


class Mapping(Part):
    """A mapping file."""

    description: str = Field(default="", description="which recordings it is for")
    join: tuple[Annotated[JoinedFile, BeforeValidator(_joined_file)], ...] = Field(
        default=(), description="files next to the recording that belong to it: names, or tables"
    )
    prismatic: tuple[str, ...] = Field(
        default=(), description="joints that slide, so that their positions are shown in m"
    )
    skip_lines: Whole = Field(
        default=0,
        ge=0,
        description="lines of a text file before its table; a header line of names may follow",
    )
    record: Whole | None = Field(
        default=None,
        ge=1,
        description="which record is read, where a file holds several one after another and time starts "
        "again with each; the first is 1",
    )
    window: tuple[Number, Number] | None = Field(
        default=None, description="first and last instant that are kept [s]; all when left out"
    )
    time: TimeSource = Field(description="how time is made")
    channels: dict[str, ChannelSource] = Field(
        default={}, description="native channel to its source; when left out, variables with native names"
    )
    constants: dict[str, Annotated[Pick, BeforeValidator(as_pick)]] = Field(
        default={}, description="numbers of the file worth keeping, e.g. a gain, by a name of yours"
    )

    @model_validator(mode="after")
    def _native(self) -> Mapping:
        for name in self.channels:
            check_native(name)
            self.conversion(name)
        if self.window is not None and not self.window[0] < self.window[1]:
            raise ValueError("window must be a first and a later last instant")
        return self

    def conversion(self, name: str) -> Conversion:
        """Factor and shift from the unit of a channel's X to the SI unit; see `conversion`."""
        channel = self.channels[name]
        if channel.unit is None:
            return 1.0, 0.0
        slides = place_of(name) in self.prismatic
        return conversion(channel.unit, name, slides=slides, derivative=channel.derivative)

    def sources(self) -> set[str]:
        """All variables that the mapping reads."""
        return set(self._sources())

    def _sources(self) -> Iterator[str]:
        times = [self.time, *(c.time for c in self.channels.values() if c.time is not None)]
        yield from (t.source for t in times if t.source is not None)
        yield from (c.source for c in self.constants.values())
        for channel in self.channels.values():
            yield from (pick.source for pick in channel.picks())
            if channel.valid is not None:
                yield channel.valid


def load_mapping(path: str | os.PathLike[str]) -> Mapping:
    """The mapping of a TOML file.

    Raises:
        InputError: no such file, not TOML, an unknown key (the nearest is suggested), a wrong value.
    """
    if not _exists(Path(path)):
        raise InputError(f"{path} does not exist; give the path of a mapping file.")
    return mapping_from_toml(toml_text(Path(path), "mapping"), source=str(path))


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # not a valid name for the system
        return False


def mapping_from_toml(text: str, *, source: str = "mapping") -> Mapping:
    """The mapping described by TOML text; `source` names it in errors. Raises `InputError`."""
    return mapping_from_tables(toml_tables(text, source=source, what="mapping"), source=source)


def mapping_from_tables(data: dict[str, Any], *, source: str = "mapping") -> Mapping:
    """The mapping described by tables as TOML has them; `source` names it in errors. Raises `InputError`."""
    try:
        return Mapping.model_validate(data)
    except ValidationError as error:
        raise InputError(f"{source}: {_sentence(error)}.") from None


def _sentence(error: ValidationError) -> str:
    """The first validation error as ``key: what is wrong``."""
    first = error.errors(include_url=False)[0]
    where = _path(first["loc"])
    if first["type"] == "extra_forbidden":
        known = _model_at(first["loc"]).model_fields
        return f"unknown key '{where}'{nearest(str(first['loc'][-1]), known)}"
    if first["type"] == "missing":
        return f"key '{where}' is missing"
    message = first["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
    value = shown(first.get("input"))
    message = (message[0].lower() + message[1:]).rstrip(".") + (f" (it is {value})" if value else "")
    return f"{where}: {message}" if where else message


def _path(location: tuple[int | str, ...]) -> str:
    """``channels."joint1.position".scale`` as one would write it in TOML."""
    words = ""
    for step in location:
        if isinstance(step, int):
            words += f"[{step}]"
        else:
            words += ("." if words else "") + (f'"{step}"' if "." in step else step)
    return words


def _model_at(location: tuple[int | str, ...]) -> type[BaseModel]:
    """The description in which the last step of `location` should be a key."""
    if len(location) >= 4 and location[2] in ("product", "terms"):
        return Pick
    if len(location) >= 4 and location[2] == "servo":
        return Pick if len(location) >= 5 else ServoVoltage
    if location[0] == "time" or (len(location) >= 4 and location[2] == "time"):
        return TimeSource
    if len(location) >= 4 and location[2] == "low_pass":
        return LowPassFilter
    if location[0] == "join":
        return JoinedFile
    if location[0] == "constants":
        return Pick
    return ChannelSource if location[0] == "channels" and len(location) > 1 else Mapping
