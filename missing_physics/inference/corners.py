"""The most probable corners of the model's error at each joint."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Generic, TypeVar

import numpy as np

from missing_physics.likelihood.evidence import ModelError

__all__ = ["Scored", "best_errors"]

T = TypeVar("T")

#: Corners that are compared, in natural logarithms about the prior's centre, and the prior's standard
#: deviation: a factor of e. Far above it stands a model without error, as in a simulation.
LADDER = np.linspace(-2.0, 4.0, 13)
SPREAD = 1.0
#: Every so many rungs are tried with all joints alike, before each joint finds its own.
COARSE = 3
#: Rounds over all joints, and the gain [nats] below which no further one is made.
ROUNDS, GAIN = 3, 1.0


@dataclass(frozen=True)
class Scored(Generic[T]):
    """A log evidence [nats] and what it belongs to."""

    score: float
    found: T


def best_errors(
    joints: int, centre: float, scored: Callable[[tuple[ModelError, ...]], Scored[T]]
) -> tuple[tuple[ModelError, ...], T]:
    """Corners with the largest evidence times prior, by coordinates from the best common pair.

    Args:
        joints: how many.
        centre: of the prior of every corner [Hz]: ten times the bandwidth of the motion.
        scored: the log evidence under these errors.
    """
    corners = centre * np.exp(LADDER)

    def errors(rungs: tuple[int, ...]) -> tuple[ModelError, ...]:
        pairs = zip(rungs[::2], rungs[1::2])
        return tuple(ModelError(float(corners[b]), float(corners[law])) for b, law in pairs)

    @cache
    def tried(rungs: tuple[int, ...]) -> Scored[T]:
        found = scored(errors(rungs))
        cost = 0.5 * float(np.sum((LADDER[list(rungs)] / SPREAD) ** 2))
        return Scored(found.score - cost, found.found)

    coarse = range(0, LADDER.size, COARSE)
    starts = [(b, law) * joints for b in coarse for law in coarse]
    best = max(starts, key=lambda rungs: tried(rungs).score)
    for _ in range(ROUNDS):
        before = tried(best).score
        for place in range(2 * joints):
            for way in (-1, 1):
                best = _climbed(best, place, way, tried)
        if tried(best).score < before + GAIN:
            break
    return errors(best), tried(best).found


def _climbed(
    rungs: tuple[int, ...], place: int, way: int, tried: Callable[[tuple[int, ...]], Scored[T]]
) -> tuple[int, ...]:
    """Move one corner as long as that helps."""
    while 0 <= rungs[place] + way < LADDER.size:
        other = (*rungs[:place], rungs[place] + way, *rungs[place + 1 :])
        if tried(other).score <= tried(rungs).score:
            break
        rungs = other
    return rungs
