"""Coordinates with a memory: on what a joint has done, not only on where it is and how fast.

Three law-free families. Rate-independent hysteresis is a sum of play operators of many widths (Prandtl and
Ishlinskii; Visintin, Differential Models of Hysteresis, 1994): a curve over the width holds any of it.
Friction that ages at rest and is renewed along a way (Dieterich, J. Geophys. Res. 84 (1979) 2161) is a curve
over the time that the joint took for the last piece of its way. What hangs on a joint and swings by itself
answers its acceleration with a delay: any linear, unchanging answer is a curve over the delay, the impulse
response.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.problem import Problem, Segment
from missing_physics.diagnosis.unnamed.coordinates import Seen, hats, knots_of, reached

__all__ = ["Ageing", "Answer", "History", "Plays", "histories", "plays", "time_of_last_way"]

Array = NDArray[np.float64]

#: Play operators: how many, and the narrowest as a part of half the travel, the widest being all of it.
WIDTHS, NARROWEST = 16, 0.01
#: Pieces of way over which friction may age, as parts of the travel.
WAYS = (0.01, 0.03, 0.1)
#: Knots of a curve over the age.
AGE_KNOTS = 10
#: An impulse response: instants, the last of them [s] and as a part of the shortest recording.
DELAYS, LONGEST, LONGEST_PART = 64, 4.0, 0.25


@dataclass(frozen=True)
class Plays:
    """Play operators along the position of a joint.

    Attributes:
        joint: index of the joint at which the force acts.
        variables: what they are over.
        widths: half the gap of each, rising, shape (K,).
    """

    joint: int
    variables: tuple[str, ...]
    widths: Array

    def columns(self, problem: Problem) -> Array:
        """One column for each width, filtered as torques are, shape (R, K)."""
        return _filtered(problem, lambda s: plays(s.motion.position[:, self.joint], self.widths))


@dataclass(frozen=True)
class Ageing:
    """A curve over the time that a joint took for the last piece of its way, for each direction.

    Attributes:
        joint: index of the joint at which the force acts.
        variables: what it is over.
        way: the piece of way [rad or m].
        knots: of the time's logarithm, rising.
    """

    joint: int
    variables: tuple[str, ...]
    way: float
    knots: Array

    def columns(self, problem: Problem) -> Array:
        """One column for each knot and direction, filtered as torques are, shape (R, K)."""
        return _filtered(problem, self._full)

    def _full(self, segment: Segment) -> Array:
        curve = hats(_age(segment, self.joint, self.way), self.knots)
        direction = np.tanh(segment.motion.velocity[:, self.joint] / segment.places[self.joint].transition)
        return np.hstack([curve * ((1 + sign * direction) / 2)[:, None] for sign in (1, -1)])


@dataclass(frozen=True)
class Answer:
    """The impulse response of a joint's force to its own acceleration.

    Attributes:
        joint: index of the joint at which the force acts.
        variables: what it is over.
        delays: instants of the response, rising [s].
    """

    joint: int
    variables: tuple[str, ...]
    delays: Array

    def columns(self, problem: Problem) -> Array:
        """One column for each delay, filtered as torques are, shape (R, K)."""
        return _filtered(problem, self._full)

    def _full(self, segment: Segment) -> Array:
        time, acceleration = segment.motion.time, segment.motion.acceleration[:, self.joint]
        # Before its recording a joint rested.
        return np.column_stack([np.interp(time - d, time, acceleration, left=0.0) for d in self.delays])


History: TypeAlias = Plays | Ageing | Answer


def histories(seen: Seen, joint: int) -> Iterator[History]:
    """Every coordinate with a memory of a force at `joint` that the data can tell.

    Args:
        seen: the parts of the data that are fitted and asked, with the rows of each that count.
        joint: index among the moving joints.
    """
    name = seen[0][0].joints[joint]
    travel = float(np.ptp(np.concatenate([problem.position[rows, joint] for problem, rows in seen])))
    if travel <= 0:
        return
    yield Plays(joint, (f"{name}.turns",), travel / 2 * np.geomspace(NARROWEST, 1.0, WIDTHS))
    for part in WAYS:
        knots = knots_of(reached(seen, partial(_age, joint=joint, way=part * travel)), AGE_KNOTS)
        if knots is not None:
            yield Ageing(joint, (f"{name}.time_of_last_way",), part * travel, knots)
    shortest = min(
        float(s.motion.time[-1] - s.motion.time[0]) for problem, _ in seen for s in problem.segments
    )
    last = min(LONGEST, LONGEST_PART * shortest)
    yield Answer(joint, (f"{name}.past_acceleration",), np.linspace(last / DELAYS, last, DELAYS))


def plays(position: Array, widths: Array) -> Array:
    """Play operators, which stand in the middle of their gap to begin with, shape (N, K).

    Args:
        position: shape (N,).
        widths: half the gap of each, shape (K,).
    """
    made = np.empty((position.size, widths.size))
    rising = np.diff(position) > 0
    turns = np.flatnonzero(np.diff(rising)) + 2  # each stretch begins behind a turning point
    bounds = np.r_[0, turns, position.size]
    now = np.full(widths.size, position[0])
    for a, b in pairwise(bounds):
        # Along a stretch without turns a play operator goes with one side of its gap or stands.
        up = position[b - 1] > position[max(a - 1, 0)]
        side = position[a:b, None] + (-widths if up else widths)
        made[a:b] = np.maximum(now, side) if up else np.minimum(now, side)
        now = made[b - 1]
    return made


def time_of_last_way(time: Array, position: Array, way: float) -> Array:
    """How long the last `way` of the path took, rests on it included; since the start where there is less.

    Args:
        time, position: shape (N,).
        way: length of path [rad or m].

    Returns:
        Shape (N,) [s].
    """
    path = np.r_[0.0, np.cumsum(np.abs(np.diff(position)))]
    path += np.arange(path.size) * 1e-12 * max(float(path[-1]), 1e-300)  # rests are told from each other
    return np.asarray(time - np.interp(path - way, path, time))


def _age(segment: Segment, joint: int, way: float) -> Array:
    """Logarithm of the time of the last way, from one sampling time on, shape (N,)."""
    time, position = segment.motion.time, segment.motion.position[:, joint]
    return np.asarray(np.log(np.maximum(time_of_last_way(time, position, way), time[1] - time[0])))


def _filtered(problem: Problem, full: Callable[[Segment], Array]) -> Array:
    return np.concatenate([segment.motion.low_pass.reduce(full(segment)) for segment in problem.segments])
