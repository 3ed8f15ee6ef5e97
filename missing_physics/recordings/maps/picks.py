"""Building blocks of a map's entries: variables of the file, and named functions of them."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PlainValidator, model_validator

__all__ = ["Flag", "Number", "Part", "Pick", "Place", "ServoVoltage", "Whole", "as_pick"]

# Strict, otherwise pydantic would accept `"2.0"` and `true` as numbers and "yes" as true.
Number = Annotated[float, Field(strict=True)]
Whole = Annotated[int, Field(strict=True)]
Flag = Annotated[bool, Field(strict=True)]


class Part(BaseModel):
    """A table of a map: immutable, without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Place(Part):
    """Selection of values of a variable; by default all of an array with one long dimension."""

    row: Whole | None = Field(default=None, description="row of a two-dimensional variable, the first is 0")
    column: Whole | None = Field(
        default=None, description="column of a two-dimensional variable, the first is 0"
    )
    index: tuple[Whole | Literal[":"], ...] | None = Field(
        default=None,
        description='position in a variable of any dimension, ":" for the samples, e.g. [0, 2, ":"]',
    )

    reshape: tuple[Whole, ...] | None = Field(
        default=None,
        min_length=1,
        description="shape that the variable is brought to first, by rows, e.g. [-1, 7] for one long column "
        "that holds seven numbers of each sample; -1 is what fits",
    )

    @model_validator(mode="after")
    def _one_place(self) -> Place:
        if self.reshape is not None and (min(self.reshape) < -1 or self.reshape.count(-1) > 1):
            raise ValueError("reshape takes whole numbers, one of which may be -1")
        if sum(part is not None for part in (self.row, self.column, self.index)) > 1:
            raise ValueError("give only one of row, column and index")
        return self


class Pick(Place):
    """One variable of the file: ``scale * variable + offset``; a scalar is a constant of the file."""

    source: str = Field(description="name of the variable in the file; fields of structures with dots")
    scale: Number = Field(default=1.0, description="factor")
    offset: Number = Field(default=0.0, description="added after scaling")
    signed_bits: Whole | None = Field(
        default=None,
        ge=2,
        le=64,
        description="the variable is a signed integer of so many bits, logged as unsigned",
    )
    derivative: Flag = Field(default=False, description="take the time derivative, by central differences")


def as_pick(value: Any) -> Any:
    return {"source": value} if isinstance(value, str) else value


def _number_or_name(value: Any) -> float | str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError("must be a number, or the name of a variable")
    return float(value)


class ServoVoltage(Part):
    """Voltage of a proportional servo: ``supply * clip(gain * (goal - position), -limit, limit)``."""

    goal: Annotated[Pick, BeforeValidator(as_pick)] = Field(description="where the servo is sent: a pick")
    position: Annotated[Pick, BeforeValidator(as_pick)] = Field(
        description="where it is: a pick, in the same unit"
    )
    gain: Annotated[float | str, PlainValidator(_number_or_name)] = Field(
        description="duty cycle per unit of position, a number or the name of a variable"
    )
    supply: Annotated[float | str, PlainValidator(_number_or_name)] = Field(
        description="supply voltage [V], a number or the name of a variable"
    )
    limit: Number = Field(default=1.0, gt=0, description="largest duty cycle")

    def picks(self) -> tuple[Pick, ...]:
        """The variables that are read: goal, position, and gain and supply if they are variables."""
        named = (Pick(source=name) for name in (self.gain, self.supply) if isinstance(name, str))
        return self.goal, self.position, *named
