"""Native channel names: ``time`` and ``PLACE.QUANTITY[.AXIS]``."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from functools import lru_cache

from robot_model import QUANTITIES

__all__ = ["check_native", "is_dotted", "is_native", "listed", "misspelt", "place_of", "quantity_of"]

#: A place may begin with a digit (`3dof.position`), but a number such as 1.5e-3 is no name.
_DOTTED = re.compile(r"(?:[^\W\d]|\d(?=[\w-]*\.[^\W\d]))[\w-]*(\.[\w-]+){1,2}")
#: Minimum similarity of an unknown quantity that is treated as a misspelt known one.
_MISSPELT = 0.8
#: Minimum similarity for which the user is asked.
_ALIKE = 0.5


def quantity_of(channel: str) -> str:
    """``position`` of ``joint1.position``; empty if there is none."""
    parts = channel.split(".")
    return parts[1] if len(parts) > 1 else ""


def place_of(channel: str) -> str:
    """``joint1`` of ``joint1.position``."""
    return channel.split(".")[0]


def is_dotted(name: str) -> bool:
    """Whether the name has the form of a channel, known quantity or not."""
    return _DOTTED.fullmatch(name) is not None


def is_native(name: str) -> bool:
    """Whether the name is a native channel."""
    return is_dotted(name) and quantity_of(name) in QUANTITIES


def misspelt(name: str) -> str | None:
    """The native name to which `name` is similar; None if it is native or not similar to any."""
    if not is_dotted(name) or is_native(name):
        return None
    near = _near(quantity_of(name), _MISSPELT)
    return _joined(name.split("."), near) if near else None


def check_native(name: str) -> None:
    """Raises ValueError, with the nearest name, when `name` is not a native channel."""
    if is_native(name):
        return
    near = _near(quantity_of(name), _ALIKE)
    hint = f"; did you mean '{_joined(name.split('.'), near)}'?" if near else ""
    raise ValueError(f"'{name}' is not a native channel, which is written PLACE.QUANTITY[.AXIS]{hint}")


@lru_cache(maxsize=1024)  # wide files have the same quantities many times
def _near(quantity: str, likeness: float) -> str | None:
    """The most similar native quantity, if one is similar enough."""
    hits = difflib.get_close_matches(quantity, QUANTITIES, n=1, cutoff=likeness)
    return hits[0] if hits else None


def _joined(parts: list[str], quantity: str) -> str:
    return ".".join([parts[0], quantity, *parts[2:]])


def listed(names: Sequence[str]) -> str:
    """``a, b and c``."""
    return f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else names[0]
