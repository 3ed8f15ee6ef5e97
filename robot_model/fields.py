"""The number and name types of the description, and the base of all its parts."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

__all__ = [
    "Description",
    "Flag",
    "Gains",
    "Name",
    "NonNegative",
    "Number",
    "Positive",
    "Vector",
    "one_or_several",
    "triangle_fault",
]

#: How far principal moments may break the triangle inequality before it is called an error: rounded
#: figures of thin rods sit exactly on it.
TRIANGLE_TOLERANCE = 1e-6

#: No figure of a robot in SI units is larger; products of a few such figures do not overflow.
LARGEST = 1e18

# Strict, or pydantic would take `"8.0"` and `true` for numbers and "yes" for true.
Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST)]
Flag = Annotated[bool, Field(strict=True)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=LARGEST)]
NonNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=LARGEST)]
Vector = tuple[Number, Number, Number]
Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$", max_length=64)]


def one_or_several(value: object) -> str:
    """Tag of a key that takes a number or a list."""
    return "list" if isinstance(value, list | tuple) else "number"


def triangle_fault(low: float, middle: float, high: float) -> str:
    """Why no body has these principal moments of inertia, rising [kg m^2]; empty when one may."""
    if low + middle >= high * (1 - TRIANGLE_TOLERANCE):
        return ""
    return (
        "inertia breaks the triangle inequality: the two smaller principal moments "
        f"{low:.6g} + {middle:.6g} are less than the largest, {high:.6g} kg m^2"
    )


#: One number for all moving joints, or one for each in the order of the file. The discriminator keeps an
#: error to the form that was meant.
Gains = Annotated[
    Annotated[Number, Tag("number")] | Annotated[tuple[Number, ...], Field(min_length=1), Tag("list")],
    Discriminator(one_or_several),
]


class Description(BaseModel):
    """Base of every part of the description: frozen, and no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
