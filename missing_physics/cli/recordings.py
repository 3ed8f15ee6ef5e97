"""Options of the commands that read a recording."""

from __future__ import annotations

from typing import Annotated

import typer

from missing_physics.recordings import SIZE_LIMIT

__all__ = ["GIGABYTE", "LIMIT", "SizeLimitOption"]

#: Bytes of a GB.
GIGABYTE = 1e9
#: Default size limit of a recording [GB].
LIMIT = SIZE_LIMIT / GIGABYTE

SizeLimitOption = Annotated[
    float,
    typer.Option(
        "--size-limit",
        min=1e-3,
        metavar="GB",
        help="most memory for the variables of one recording; their sizes are checked before reading",
    ),
]
