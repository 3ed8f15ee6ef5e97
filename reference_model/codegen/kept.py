"""Cache of expensive results for the same robot in later calls."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import TypeVar

from robot_model import Robot

__all__ = ["kept"]

T = TypeVar("T")

#: Number of cached robots: the nominal one, the standard model's, the answer's, and one to spare.
ROBOTS = 4


def kept(make: Callable[[Robot], T]) -> Callable[[Robot], T]:
    """`make` with a cache of its last results; not for a robot with modes from a file, which may change."""
    cached = lru_cache(maxsize=ROBOTS)(make)

    @wraps(make)
    def found(robot: Robot) -> T:
        return make(robot) if any(link.modal is not None for link in robot.links) else cached(robot)

    return found
