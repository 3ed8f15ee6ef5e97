"""What an unknown force at a joint may depend on, and curves over it that presume no law.

A curve is piecewise linear between knots that lie where the samples lie (degree-one B-splines, de
Boor, A Practical Guide to Splines, 1978). Forces that follow the direction of motion have a curve for each
direction, so that they may jump where it turns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from missing_physics.diagnosis.least_squares.problem import Problem, Segment

__all__ = ["Coordinate", "Seen", "Wandering", "coordinates", "directions", "hats", "knots_of", "reached"]

Array = NDArray[np.float64]
#: Parts of the data, and the rows of each that count, shape (R,).
Seen: TypeAlias = Sequence[tuple[Problem, NDArray[np.bool_]]]

#: Knots of a curve over one variable, of each variable of a surface, and over time.
KNOTS = 14
SURFACE_KNOTS = 7
TIME_KNOTS = 12
#: A joint slower than this part of its largest speed rests.
AT_REST = 5e-3


@dataclass(frozen=True)
class Coordinate:
    """One or two variables on which a force at a joint may depend.

    Attributes:
        joint: index of the joint at which the force acts.
        variables: their names, e.g. ``joint1.velocity``.
        knots: of each variable, rising.
        directed: whether each direction of motion has a curve of its own.
        carriers: what the curves multiply: nothing, or each of several signals of the joint.
    """

    joint: int
    variables: tuple[str, ...]
    knots: tuple[Array, ...]
    directed: bool
    carriers: tuple[str, ...] = ()

    @property
    def parts(self) -> tuple[str, ...]:
        """What each of its curves holds for, in the order of the columns."""
        if self.directed:
            return "forward", "backward"
        return tuple("" if name == "one" else name for name in self.carriers) or ("",)

    def columns(self, problem: Problem) -> Array:
        """One column for each knot, and direction or carrier, filtered as torques are, shape (R, K)."""
        return np.concatenate(
            [segment.motion.low_pass.reduce(self._full(segment)) for segment in problem.segments]
        )

    def _full(self, segment: Segment) -> Array:
        own = [hats(_variable(segment, self.joint, v), k) for v, k in zip(self.variables, self.knots)]
        curve = own[0]
        for more in own[1:]:
            curve = (curve[:, :, None] * more[:, None, :]).reshape(len(curve), -1)
        direction = np.tanh(segment.motion.velocity[:, self.joint] / segment.places[self.joint].transition)
        if self.directed:
            return np.hstack([curve * ((1 + sign * direction) / 2)[:, None] for sign in (1, -1)])
        if not self.carriers:
            return curve
        signals = {
            "one": np.ones_like(direction),
            "direction": direction,
            "velocity": segment.motion.velocity[:, self.joint],
            "torque": segment.dynamics.torque[:, self.joint],
        }
        return np.hstack([curve * signals[name][:, None] for name in self.carriers])


@dataclass(frozen=True)
class Wandering:
    """The numbers of a named law, free to change with time.

    Attributes:
        joint: index of the joint at which it shows.
        law: label of the term.
        variables: what it is over.
        made: columns of both parts of the data, shape (R, K) each, with the problems they belong to.
    """

    joint: int
    law: str
    made: tuple[tuple[Problem, Array], ...]
    variables: tuple[str, ...] = ("time",)

    @classmethod
    def of(cls, law: str, joint: int, parts: Sequence[tuple[Problem, Array]], seen: Seen) -> Wandering | None:
        """From what the law's numbers do at the joint, shape (R, k) of each part; None where time stands."""
        knots = _knots(seen, joint, "time", TIME_KNOTS)
        if knots is None:
            return None
        made = []
        for problem, columns in parts:
            starts = np.array([segment.motion.time[0] for segment in problem.segments])
            curve = hats(problem.time - starts[problem.segment_of], knots)
            both = (columns[:, :, None] * curve[:, None, :]).reshape(len(columns), -1)
            made.append((problem, both))
        return cls(joint, law, tuple(made))

    def columns(self, problem: Problem) -> Array:
        """One column for each number and knot, shape (R, K)."""
        return next(columns for known, columns in self.made if known is problem)


def directions(problem: Problem, joint: int) -> Array:
    """The direction in which a joint moves, -1 to 1, filtered as torques are, shape (R,)."""
    return np.concatenate(
        [
            s.motion.low_pass.reduce(np.tanh(s.motion.velocity[:, joint] / s.places[joint].transition))
            for s in problem.segments
        ]
    )


def coordinates(seen: Seen, joint: int) -> Iterator[Coordinate]:
    """Every coordinate of a force at `joint` that takes more than one value.

    Args:
        seen: the parts of the data that curves are fitted to and asked in: knots lie wherever they reach.
        joint: index among the moving joints.
    """
    joints = seen[0][0].joints
    name = joints[joint]
    others = [other for other in joints if other != name]
    single = [
        (f"{name}.velocity", True),
        (f"{name}.position", True),
        (f"{name}.acceleration", False),
        (f"{name}.torque", True),
        (f"{name}.path_since_rest", True),
        (f"{name}.time_since_rest", True),
        (f"{name}.last_rest", True),
        *((f"{other}.{what}", True) for other in others for what in ("velocity", "position")),
    ]
    for variable, directed in single:
        knots = _knots(seen, joint, variable, KNOTS)
        if knots is not None:
            yield Coordinate(joint, (variable,), (knots,), directed)
    time = _knots(seen, joint, "time", TIME_KNOTS)
    if time is None:
        return
    yield Coordinate(joint, ("time",), (time,), False, ("one", "direction", "velocity", "torque"))
    position = _knots(seen, joint, f"{name}.position", SURFACE_KNOTS)
    velocity = _knots(seen, joint, f"{name}.velocity", SURFACE_KNOTS)
    if position is not None:
        yield Coordinate(joint, (f"{name}.position", "time"), (position, time), False)
    if position is not None and velocity is not None:
        yield Coordinate(joint, (f"{name}.position", f"{name}.velocity"), (position, velocity), True)


def _knots(seen: Seen, joint: int, variable: str, count: int) -> Array | None:
    return knots_of(reached(seen, lambda segment: _variable(segment, joint, variable)), count)


def reached(seen: Seen, variable: Callable[[Segment], Array]) -> Array:
    """The values of a variable, given at the full rate, on all rows that count."""
    parts = []
    for problem, rows in seen:
        kept = [variable(s)[s.motion.low_pass.kept(s.motion.time.size)] for s in problem.segments]
        parts.append(np.concatenate(kept)[rows])
    return np.concatenate(parts)


def knots_of(values: Array, count: int) -> Array | None:
    """Knots where values lie, rising; None where there are too few values or all are the same."""
    if values.size < count or np.ptp(values) <= 1e-9 * max(float(np.abs(values).max()), 1e-300):
        return None
    # Half by count, half by distance: neither crowded stretches nor wide ones lack knots.
    share = np.linspace(0, 1, count)
    knots = (np.quantile(values, share) + values.min() + share * np.ptp(values)) / 2
    return np.asarray(np.unique(knots))


def hats(values: Array, knots: Array) -> Array:
    """Degree-one B-splines, shape (N, len(knots)); constant beyond the ends."""
    clipped = np.clip(values, knots[0], knots[-1])
    at = np.clip(np.searchsorted(knots, clipped, side="right") - 1, 0, knots.size - 2)
    part = (clipped - knots[at]) / (knots[at + 1] - knots[at])
    made = np.zeros((values.size, knots.size))
    rows = np.arange(values.size)
    made[rows, at], made[rows, at + 1] = 1 - part, part
    return made


def _variable(segment: Segment, joint: int, name: str) -> Array:
    """A variable at the full rate, shape (N,)."""
    motion = segment.motion
    if name == "time":
        return motion.time - motion.time[0]
    place, _, quantity = name.rpartition(".")
    index = [j.name for j in segment.joints].index(place)
    if quantity in ("position", "velocity", "acceleration"):
        return np.asarray(getattr(motion, quantity)[:, index])
    if quantity == "torque":  # as the model has it: the measured one holds what is looked for
        return segment.dynamics.torque[:, index]
    return _since_rest(segment, index)[quantity]


def _since_rest(segment: Segment, joint: int) -> dict[str, Array]:
    """What the joint has done since it last stood still or turned, shape (N,) each."""
    motion = segment.motion
    time, position, velocity = motion.time, motion.position[:, joint], motion.velocity[:, joint]
    slow = np.abs(velocity) <= max(segment.places[joint].transition, AT_REST * np.abs(velocity).max())
    turned = np.r_[True, np.sign(velocity[1:]) != np.sign(velocity[:-1])]
    still = slow | turned
    count = np.arange(time.size)
    last = np.maximum.accumulate(np.where(still, count, 0))
    moved = np.maximum.accumulate(np.where(still, 0, count))[last]  # the last sample before that rest
    return {
        "path_since_rest": np.abs(position - position[last]),
        "time_since_rest": time - time[last],
        "last_rest": time[last] - time[moved],
    }
