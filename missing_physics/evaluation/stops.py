"""Joints that stop and turn back: when friction changes sides, by the equation of motion about every stop.

A filter rounds the bend of the velocity where friction or torque jump, so that the smoothed velocity crosses
zero late, and leaks into a rest that is shorter than the filter's memory. Without that jump there is no bend.
With M the mass matrix, F the filter, tau the recorded torque, s the smoothed velocity, r the torque that is
left for dry friction along the smoothed motion, and d in Sgn(v) the direction of dry friction of level c,

    v' = s' + M^-1 (tau - F tau + r - c d),      since r = F (c d) but for errors.

It is integrated through every stop by implicit steps, so that friction holds the joint where it can. What F v
shows otherwise than s, beyond the noise of s, is added to s' some times over: what r and M are wrong by.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

__all__ = ["Stops", "through_stops"]

Array = NDArray[np.float64]

#: Standard deviations of the smoothed velocity within which a joint may be at rest.
NEAR = 3.0
#: Memories of the filter to either side of a stop after which it has forgotten it.
REACH = 2.0
#: Times that a rest is longer than its reach and has a middle, in which nothing moves.
LONG = 2
#: Times that what the filtered velocity shows otherwise is added.
CORRECTIONS = 6
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
        smooth: the filter, along the first axis.
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
    smooth: Callable[[Array], Array]


def through_stops(
    stops: Stops, direction: Array, held: NDArray[np.bool_], asked: NDArray[np.bool_]
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Velocity, direction of dry friction, and where joints are held by it, shape (N, n) each.

    Args:
        stops: see there.
        direction: as the smoothed motion has it, shape (N, n); kept where no stop is near.
        held: where joints are held by that, shape (N, n).
        asked: joints of which stops are looked at, shape (n,).
    """
    velocity, direction, held = stops.velocity.copy(), direction.copy(), held.copy()
    known = [int(k) for k in np.flatnonzero(asked) if not np.isnan(stops.left[:, k]).any()]
    for _ in range(ROUNDS):
        for k in known:
            push = np.nan_to_num(stops.left - stops.level * direction) + stops.jumps
            push[:, k] += stops.level[:, k] * direction[:, k]
            free = np.einsum("tj,tj->t", stops.mobility[:, k], push)
            found = _through(stops, k, free, direction[:, k])
            if found is not None:
                at, velocity[at, k], direction[at, k] = found
                held[at, k] = np.abs(direction[at, k]) < 1.0
    return velocity, direction, held


def _through(
    stops: Stops, k: int, free: Array, direction: Array
) -> tuple[NDArray[np.int_], Array, Array] | None:
    """Samples about the stops of joint k, its velocity and the direction of friction there, (T,) each.

    None where the joint does not move as its mass, the torque and friction say: a stiff controller that
    imposes the motion, a rotor that is not in the file, a torque that was recorded through a filter.

    Args:
        stops: see `through_stops`.
        k: the joint.
        free: acceleration beyond the smoothed one without its own dry friction, shape (N,).
        direction: of its friction so far, shape (N,).
    """
    speed, noise = stops.velocity[:, k], stops.noise[:, k]
    reach = int(np.ceil(REACH * stops.memory / stops.step))
    sliding = np.abs(speed) > NEAR * noise + _bend(stops, k, reach)
    first, last = _windows(speed, ~sliding, reach)
    if not first.size:
        return None
    gain = stops.step * stops.mobility[:, k, k]
    index = first[:, None] + np.arange(int((last - first).max()) + 1)
    inside = index[:, 1:] <= last[:, None]
    index = np.minimum(index, speed.size - 1)
    steps = index[:, :-1], index[:, 1:]  # a step is from one to the other
    pushed = 0.5 * stops.step * (free[steps[0]] + free[steps[1]])
    added = np.where(inside, np.diff(speed[index], axis=1) + pushed, 0.0)
    grip = _Grip(
        gain=np.where(inside, 0.5 * (gain[steps[0]] + gain[steps[1]]), 0.0),
        still=0.5 * (stops.still[steps[0], k] + stops.still[steps[1], k]),
        speeds=stops.speeds[k],
        rise=stops.rise[k],
    )
    at = index[:, 1:][inside]
    best, bent, known = None, speed.copy(), float(np.sum(noise[at] ** 2))
    least = max(float(np.sum((stops.smooth(speed) - speed)[at] ** 2)), known)
    for _ in range(CORRECTIONS):
        own, turned = _integrated(speed[first], added, grip)
        bent[at] = own[inside]
        wrong = speed - stops.smooth(bent)
        missed = float(np.sum(wrong[at] ** 2))
        if missed < least:
            best, least = (at, own[inside], _at_samples(turned, inside)[inside]), missed
        if missed < known:
            break
        added = np.where(inside, added + np.diff(wrong[index], axis=1), 0.0)
    return best


def _at_samples(turned: Array, inside: NDArray[np.bool_]) -> Array:
    """Direction of friction at the ends of steps, from the steps before and behind, shape (W, L)."""
    behind = np.where(inside[:, 1:], turned[:, 1:], turned[:, :-1])
    return np.asarray(0.5 * (turned + np.column_stack([behind, turned[:, -1]])))


def _bend(stops: Stops, k: int, reach: int) -> Array:
    """By how much a filter rounds the velocity at most where friction jumps, shape (N,) [rad/s or m/s].

    As much as friction can change its slope, and as its slope changes at all.
    """
    slope = np.abs(np.gradient(stops.velocity[:, k], stops.step))
    seen = maximum_filter1d(slope, 2 * reach + 1)
    can = stops.mobility[:, k, k] * stops.still[:, k]
    return np.asarray(0.5 * stops.memory * np.minimum(can, seen))


def _windows(speed: Array, near: NDArray[np.bool_], reach: int) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """First and last sample about every stop; of long ones about where they begin and end."""
    turning = np.zeros(speed.size, dtype=bool)
    turning[1:] = speed[1:] * speed[:-1] <= 0.0
    marked = np.concatenate([[False], near | turning, [False]])
    edges = np.flatnonzero(marked[1:] != marked[:-1])
    begins, ends = edges[::2], edges[1::2]  # a stop is at begins .. ends - 1
    first, last = [], []
    for i, (begin, end) in enumerate(zip(begins, ends)):
        before = 0 if i == 0 else (int(ends[i - 1]) + int(begin)) // 2
        after = speed.size - 1 if i + 1 == len(begins) else (int(end) + int(begins[i + 1])) // 2 - 1
        a, b = max(int(begin) - reach, before), min(int(end) - 1 + reach, after)
        if end - begin > 2 * LONG * reach:
            first += [a, int(end) - LONG * reach]
            last += [int(begin) + LONG * reach, b]
        elif b > a:
            first.append(a)
            last.append(b)
    return np.array(first, dtype=int), np.array(last, dtype=int)


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
