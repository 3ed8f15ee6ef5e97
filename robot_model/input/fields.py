"""The number and name types of the description, and the base of all its parts."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
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
    "inertia_fault",
    "one_or_several",
    "triangle_fault",
]

#: A principal moment this far below zero, relative to the largest entry, is not rounding.
NEGATIVE = 1e-6

#: Tolerance of the triangle inequality for principal moments: rounded values of thin rods lie exactly on it.
TRIANGLE_TOLERANCE = 1e-6

#: No value of a robot in SI units is larger; products of a few such values do not overflow.
LARGEST = 1e18

# Strict, or pydantic would accept `"8.0"` and `true` as numbers and "yes" as true.
Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST)]
Flag = Annotated[bool, Field(strict=True)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=LARGEST)]
NonNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=LARGEST)]
Vector = tuple[Number, Number, Number]
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_-]*$", max_length=64)]


def one_or_several(value: object) -> str:
    """Tag of a key that takes a number or a list."""
    return "list" if isinstance(value, list | tuple) else "number"


def triangle_fault(low: float, middle: float, high: float) -> str:
    """Why these principal moments of inertia (increasing, [kg m^2]) are impossible; empty if possible."""
    if low + middle >= high * (1 - TRIANGLE_TOLERANCE):
        return ""
    return (
        "inertia breaks the triangle inequality: the two smaller principal moments "
        f"{low:.6g} + {middle:.6g} are less than the largest, {high:.6g} kg m^2"
    )


def inertia_fault(inertia: NDArray[np.float64]) -> str:
    """Why this inertia matrix [kg m^2], shape (3, 3), is impossible; empty if possible."""
    scale = max(float(np.abs(inertia).max()), 1e-300)  # division first, or huge figures overflow
    moments = np.linalg.eigvalsh(inertia / scale)
    low, middle, high = (scale * float(moment) for moment in moments)
    if moments[0] < -NEGATIVE:
        return f"inertia has a negative principal moment ({low:.6g} kg m^2)"
    return triangle_fault(low, middle, high)


#: One number for all moving joints, or one for each in the order of the file. The discriminator keeps an
#: error to the form that was meant.
Gains = Annotated[
    Annotated[Number, Tag("number")] | Annotated[tuple[Number, ...], Field(min_length=1), Tag("list")],
    Discriminator(one_or_several),
]


class Description(BaseModel):
    """Base of every part of the description: frozen, and no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
