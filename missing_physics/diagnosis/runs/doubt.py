"""How far runs in closed loop move with numbers that are not better known.

Some robots run so near to where their control loop swings by itself, or touch and let go so often, that a run
with the right law and a number that is off by its standard deviation differs from the recording by as much as
a run without the law. Such a run says nothing against a name.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.explanation import TOLD
from missing_physics.diagnosis.replay.replay import Replay
from missing_physics.diagnosis.replay.sensor_errors import dear
from reference_model.effects.catalogue import get_effect
from robot_model import EffectUse, Robot

__all__ = [
    "FAR_OFF",
    "SAY_NOTHING",
    "Leftover",
    "leftovers",
    "moved_by_numbers",
    "says_nothing",
    "spreads_of",
]

Array = NDArray[np.float64]
#: Standard deviations of names' numbers, by effect and place.
Spreads = Mapping[tuple[str, str], Mapping[str, float]]

#: What is said where runs have no say.
SAY_NOTHING = (
    "run in closed loop, the robot with everything named is off by no more than the uncertainty of its "
    "numbers moves it, so that runs cannot judge the names"
)
#: Numbers that are moved at most; of robots whose runs take long.
MOST, MOST_DEAR = 12, 4
#: What is left is no more than numbers may make of it where these are off by so many standard deviations.
DEVIATIONS = 2.0
#: What leaves this multiple of what differs is wrong, however far runs move with its numbers: of right laws
#: in loops that nearly swing by themselves runs left up to twice of it.
FAR_OFF = 4.0
#: Mean square, in units of the noise, beyond which much is left of a channel; and the greatest part of what
#: was there that is left of one of which most is explained.
MUCH, MOSTLY = 10.0, 0.5


def moved_by_numbers(replay: Replay, robot: Robot, spreads: Spreads) -> list[Array]:
    """Mean squares by which the channels of each recording's run move with all numbers, shape (channels,).

    Args:
        replay: runs along all recordings.
        robot: with the names and their numbers.
        spreads: of these numbers, moved one at a time; those that are not finite count as not told.

    Returns:
        In units of the sensors' noise; infinite where a run with a number so close by cannot be made.
    """
    changed = list(_moved(robot, spreads))[: MOST_DEAR if dear(replay.robot) else MOST]
    found = []
    for which in range(len(replay.asked)):
        total, before = np.zeros(len(replay.channels)), replay.errors(robot, which)
        for other in changed:
            after = replay.errors(other, which, keep=False)
            if before is None or after is None:
                total[:] = np.inf
                continue
            total += [float(np.mean((after[name] - before[name]) ** 2)) for name in replay.channels]
        found.append(total)
    return found


def spreads_of(intervals: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    """Standard deviations of numbers of which 95 % intervals are known."""
    return {name: (high - low) / (2 * TOLD) for name, (low, high) in intervals.items()}


def says_nothing(energies: Array, moved: Array) -> NDArray[np.bool_]:
    """Channels of which runs leave no more than their numbers may make, shape (channels,).

    Args:
        energies: mean squares of the errors, in units of the noise.
        moved: of `moved_by_numbers`.
    """
    return np.asarray(energies - 1.0 <= DEVIATIONS**2 * moved)


@dataclass(frozen=True)
class Leftover:
    """What names leave of a channel that they are to explain, far beyond its noise in every recording.

    Attributes:
        part: of the squared error that was there, in recordings to which nothing was fitted where there are.
        energy: mean square, in units of the noise.
    """

    channel: str
    part: float
    energy: float

    @property
    def words(self) -> str:
        """A clause for people."""
        return (
            "run in closed loop along the recorded references, the robot with everything named leaves "
            f"{self.part:.1%} of the squared error of {self.channel}, {self.energy:.0f} times its noise"
        )


def leftovers(
    replay: Replay,
    energies: Sequence[Array],
    before: Sequence[Array],
    moved: Sequence[Array] | None = None,
) -> tuple[Leftover, ...]:
    """Channels of which names explain most and leave much: a law that is nearly what is there, and is not.

    Of robots whose runs are quick, as their numbers are told by runs: right laws then leave next to nothing.

    Args:
        energies: of runs with the names, per recording.
        before: of runs of the robot as described.
        moved: by how much runs move with numbers that are not better known.
    """
    if dear(replay.robot):
        return ()
    found = []
    for k, channel in enumerate(replay.channels):
        pairs = [(e[k], b[k]) for e, b in zip(energies, before)]
        if not all(MUCH < e <= MOSTLY * b for e, b in pairs):
            continue
        if moved is not None and any(says_nothing(e, m)[k] for e, m in zip(energies, moved)):
            continue
        unseen = pairs[replay.fitted :] or pairs  # numbers take something of the fitted ones
        part, energy = min(((e - 1.0) / (b - 1.0), e) for e, b in unseen)
        found.append(Leftover(channel, float(part), float(energy)))
    return tuple(found)


def _moved(robot: Robot, spreads: Spreads) -> Iterator[Robot]:
    for key, numbers in spreads.items():
        for use in robot.effects:
            if (use.effect, use.at) != key:
                continue
            bounds = {p.name: (p.lower, p.upper) for p in get_effect(use.effect).parameters}
            for name, spread in numbers.items():
                if np.isfinite(spread) and spread > 0 and name in use.parameters and name in bounds:
                    yield _with(robot, use, name, spread, bounds[name])


def _with(robot: Robot, use: EffectUse, name: str, spread: float, bounds: tuple[float, float]) -> Robot:
    """With one number of one effect moved, upwards where there is room."""
    value = use.parameters[name]
    there = value + spread if value + spread <= bounds[1] else max(value - spread, bounds[0])
    moved = EffectUse(effect=use.effect, at=use.at, **{**use.parameters, name: there})
    effects: Sequence[EffectUse] = [moved if other is use else other for other in robot.effects]
    return robot.model_copy(update={"effects": tuple(effects)})
