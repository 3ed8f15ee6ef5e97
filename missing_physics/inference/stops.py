"""Joints that stop and turn back: when friction changes sides, by the equation of motion about every stop.

A filter rounds the bend of the velocity where friction or torque jump, so that the smoothed velocity crosses
zero late, and leaks into a rest that is shorter than the filter's memory. Without that jump there is no bend.
With M the mass matrix, F the filter, tau the recorded torque, s the smoothed velocity, r the torque that is
left for dry friction along the smoothed motion, and d in Sgn(v) the direction of dry friction of level c,

    v' = s' + M^-1 (tau - F tau + r - c d),      since r = F (c d) but for errors.

It is integrated through every stop by implicit steps, so that friction holds the joint where it can, from the
smoothed velocity well before to that well after; a constant error of r takes up what is left between both.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Stops", "through_stops"]

Array = NDArray[np.float64]

#: Standard deviations of the smoothed velocity within which a joint may be at rest.
NEAR = 3.0
#: Memories of the filter to either side of a stop after which it has forgotten it.
REACH = 2.0
#: Times that a rest is longer than its reach and has a middle, in which nothing moves.
LONG = 2
#: Doublings of the bracket of the error of r, and halvings of it.
DOUBLINGS, HALVINGS = 8, 12
#: Rounds over the joints, of which each feels the friction of the others.
ROUNDS = 2


@dataclass(frozen=True)
class Stops:
    """What stops are integrated from; N samples, n joints.

    Attributes:
        step: of time [s].
        velocity: smoothed, shape (N, n) [rad/s or m/s].
        noise: standard deviation of it, shape (N, n).
        left: torque left for dry friction along the smoothed motion, shape (N, n) [N m or N]; NaN columns
            where no torque is recorded.
        level: of dry friction along the smoothed motion, shape (N, n) [N m or N].
        still: level at standstill, shape (N, n) [N m or N].
        speeds: at which `rise` is, rising from zero, shape (n, S) [rad/s or m/s].
        rise: level at these speeds above that at standstill, shape (n, S) [N m or N].
        jumps: torque less the smoothed one, shape (N, n) [N m or N].
        mobility: inverse of the mass matrix, shape (N, n, n).
        memory: of the filter [s].
    """

    step: float
    velocity: Array
    noise: Array
    left: Array
    level: Array
    still: Array
    speeds: Array
    rise: Array
    jumps: Array
    mobility: Array
    memory: float


def through_stops(stops: Stops, direction: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Velocity, direction of dry friction, and where joints are held by it, shape (N, n) each.

    Args:
        stops: see there.
        direction: as the smoothed motion has it, shape (N, n); kept where no stop is near.
    """
    velocity, direction = stops.velocity.copy(), direction.copy()
    held = np.zeros(direction.shape, dtype=bool)
    for _ in range(ROUNDS):
        for k in range(direction.shape[1]):
            if np.isnan(stops.left[:, k]).any():
                continue
            push = np.nan_to_num(stops.left - stops.level * direction) + stops.jumps
            push[:, k] += stops.level[:, k] * direction[:, k]
            free = np.einsum("tj,tj->t", stops.mobility[:, k], push)
            _through(stops, k, free, velocity, direction, held)
    return velocity, direction, held


def _through(
    stops: Stops, k: int, free: Array, velocity: Array, direction: Array, held: NDArray[np.bool_]
) -> None:
    """Joint k through all its stops, in place.

    Args:
        stops, velocity, direction, held: see `through_stops`.
        k: the joint.
        free: acceleration beyond the smoothed one without its own dry friction, shape (N,).
    """
    speed, noise = stops.velocity[:, k], stops.noise[:, k]
    reach = int(np.ceil(REACH * stops.memory / stops.step))
    bend = 0.5 * stops.mobility[:, k, k] * stops.level[:, k] * stops.memory
    sliding = np.abs(speed) > NEAR * noise + bend
    first, last, middles = _windows(speed, ~sliding, reach)
    gain = stops.step * stops.mobility[:, k, k]
    for begin, end in middles:
        rest = np.arange(begin, end)
        size = np.maximum(stops.still[rest, k], 1e-12)
        direction[rest, k] = np.clip(stops.left[rest, k] / size, -1.0, 1.0)
        velocity[rest, k], held[rest, k] = 0.0, True
    if not first.size:
        return
    longest = int((last - first).max())
    index = first[:, None] + np.arange(longest + 1)
    inside = index <= last[:, None]
    index = np.minimum(index, speed.size - 1)
    added = np.diff(speed[index], axis=1) + stops.step * free[index[:, 1:]]
    added[~inside[:, 1:]] = 0.0
    grips = _Grip(
        gain=np.where(inside, gain[index], 0.0)[:, 1:],
        still=stops.still[index[:, 1:], k],
        speeds=stops.speeds[k],
        rise=stops.rise[k],
    )
    start, goal = speed[first], speed[last]
    at_rest = np.isin(first, [end for _, end in middles]), np.isin(last, [begin for begin, _ in middles])
    start, goal = np.where(at_rest[0], 0.0, start), np.where(at_rest[1], 0.0, goal)
    rough = np.abs(stops.left[:, k] - stops.level[:, k] * direction[:, k])[sliding]
    doubt = float(np.sqrt(np.mean(rough**2))) if rough.size else 0.0
    error = stops.step * stops.mobility[first, k, k] * max(doubt, 1e-12)  # of one step's speed
    total = np.maximum(last - first, 1)
    soft = 2.0 * noise[first] ** 2 / (error**2 * total)
    counted = inside[:, 1:].astype(float)

    def missed(bias: Array) -> Array:
        return _integrated(start, added + bias[:, None] * counted, grips)[0][:, -1] - goal + soft * bias

    bias = _root(missed, error)
    own, turned = _integrated(start, added + bias[:, None] * counted, grips)
    places = index[:, 1:][inside[:, 1:]]
    velocity[places, k], direction[places, k] = own[inside[:, 1:]], turned[inside[:, 1:]]
    held[places, k] = np.abs(turned[inside[:, 1:]]) < 1.0


def _windows(
    speed: Array, near: NDArray[np.bool_], reach: int
) -> tuple[NDArray[np.int_], NDArray[np.int_], list[tuple[int, int]]]:
    """First and last sample of every stop, and the middles of long rests."""
    turning = np.zeros(speed.size, dtype=bool)
    turning[1:] = speed[1:] * speed[:-1] <= 0.0
    marked = np.concatenate([[False], near | turning, [False]])
    edges = np.flatnonzero(marked[1:] != marked[:-1])
    begins, ends = edges[::2], edges[1::2]  # a stop is at begins .. ends - 1
    first, last, middles = [], [], []
    for i, (begin, end) in enumerate(zip(begins, ends)):
        before = 0 if i == 0 else (int(ends[i - 1]) + int(begin)) // 2
        after = speed.size - 1 if i + 1 == len(begins) else (int(end) + int(begins[i + 1])) // 2 - 1
        a, b = max(int(begin) - reach, before), min(int(end) - 1 + reach, after)
        if end - begin > 2 * LONG * reach:
            rest = int(begin) + LONG * reach, int(end) - LONG * reach
            middles.append(rest)
            first += [a, rest[1]]
            last += [rest[0], b]
        elif b > a:
            first.append(a)
            last.append(b)
    return np.array(first, dtype=int), np.array(last, dtype=int), middles


@dataclass(frozen=True)
class _Grip:
    """What dry friction takes of the velocity in a step at most, in W stops of L steps.

    Attributes:
        gain: velocity by one unit of force, shape (W, L).
        still: level at standstill, shape (W, L).
        speeds, rise: see `Stops`, shape (S,).
    """

    gain: Array
    still: Array
    speeds: Array
    rise: Array

    def at(self, step: int, velocity: Array) -> Array:
        """In one step that begins with a velocity, shape (W,)."""
        level = self.still[:, step]
        if self.rise.any():
            level = np.maximum(level + np.interp(np.abs(velocity), self.speeds, self.rise), 0.0)
        return np.asarray(self.gain[:, step] * level)


def _integrated(start: Array, added: Array, grip: _Grip) -> tuple[Array, Array]:
    """Velocity after every implicit step, and the direction of friction in it, (W, L) each.

    Args:
        start: velocity before the first step, shape (W,).
        added: to the velocity in every step without friction, shape (W, L).
        grip: what friction takes of it at most.
    """
    now, found, turned = start, np.empty_like(added), np.empty_like(added)
    for i in range(added.shape[1]):
        most = grip.at(i, now)
        now = now + added[:, i]
        taken = np.clip(now, -most, most)
        now = now - taken
        found[:, i] = now
        turned[:, i] = np.divide(taken, most, out=np.sign(now), where=most > 0.0)
    return found, turned


def _root(function: Callable[[Array], Array], size: Array) -> Array:
    """Where increasing functions of one number each are zero, shape (W,); the last bracket if nowhere."""
    at = np.zeros_like(size)
    value = function(at)
    side = -np.sign(value)
    near, far = at, at + side * size
    for _ in range(DOUBLINGS):
        short = function(far) * side < 0.0
        if not short.any():
            break
        near = np.where(short, far, near)
        far = np.where(short, far + side * 2.0 * np.abs(far), far)
    for _ in range(HALVINGS):
        half = 0.5 * (near + far)
        short = function(half) * side < 0.0
        near, far = np.where(short, half, near), np.where(short, far, half)
    return np.where(side == 0.0, 0.0, 0.5 * (near + far))
