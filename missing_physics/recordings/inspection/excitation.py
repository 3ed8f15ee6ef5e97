"""Excitation: the motion in a recording, joint by joint."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.channels.estimates import noise_of, resolution_of, rests_on_levels
from missing_physics.recordings.channels.names import place_of
from robot_model import Recording

__all__ = ["Excitation", "excitation"]

Array = NDArray[np.float64]

#: Speeds below this fraction of the highest count as rest.
REST = 0.02
#: A speed level (of ten equal ones up to the highest speed) counts as visited from this fraction of the time.
VISITED = 0.02
LEVELS = 10
#: Fraction of the velocity's energy below the stated bandwidth.
ENERGY = 0.95
#: Longest interval of the differences for a velocity, as a fraction of the recording.
LONGEST_BASE = 0.002
#: Smallest movement that counts, in noise standard deviations (or steps).
CLEAR = 10.0
#: Motion below this fraction of the widest is not commanded: bearings, gears and servos yield as much when
#: another joint moves.
TREMBLING = 1e-4


@dataclass(frozen=True)
class Excitation:
    """The motion of one joint, in its own units (rad or m).

    Attributes:
        place: the joint.
        position_range: largest minus smallest position.
        max_speed, rms_acceleration: of the smoothed motion.
        reversals: number of changes of direction.
        at_rest, forward, backward: fractions of the time.
        speed_levels: number of tenths of the speed range that are visited.
        bandwidth_hz: below it lie 95 % of the velocity's energy.
        trembles: whether the motion is so small compared with another joint's that it is only a reaction.
    """

    place: str
    position_range: float
    max_speed: float
    rms_acceleration: float
    reversals: int
    at_rest: float
    forward: float
    backward: float
    speed_levels: int
    bandwidth_hz: float
    trembles: bool = False

    @property
    def moves(self) -> bool:
        """Whether the motion exceeds the noise."""
        return self.max_speed > 0

    @property
    def both_directions(self) -> bool:
        """Whether each direction takes at least a twentieth of the moving time."""
        return min(self.forward, self.backward) > 0.05 * (self.forward + self.backward)


def excitation(recording: Recording) -> tuple[Excitation, ...]:
    """The motion of every place that has a position (or else a motor position)."""
    found = {}
    for quantity in ("motor_position", "position"):
        for place in dict.fromkeys(place_of(name) for name in recording):
            if f"{place}.{quantity}" in recording:
                found[place] = f"{place}.{quantity}"
    moves = [_of(recording, place, channel) for place, channel in sorted(found.items())]
    most = max((move.position_range for move in moves), default=0.0)
    return tuple(
        replace(move, trembles=move.moves and move.position_range < TREMBLING * most) for move in moves
    )


def _of(recording: Recording, place: str, channel: str) -> Excitation:
    values = recording[channel]
    good = np.isfinite(values)
    time, position = recording.time[good], values[good]
    least = CLEAR * max(noise_of(recording, channel), resolution_of(recording, channel))
    span = float(np.ptp(position))
    if not span > least or rests_on_levels(position):
        return Excitation(place, span, 0.0, 0.0, 0, 1.0, 0.0, 0.0, 0, 0.0)
    t, v = _velocity(time, position)
    speed = np.abs(v)
    top = float(np.quantile(speed, 0.999))
    step = np.gradient(t)
    moving = speed > REST * top
    share = step / step.sum()
    levels = np.histogram(speed, bins=LEVELS, range=(0.0, top), weights=share)[0]
    return Excitation(
        place=place,
        position_range=span,
        max_speed=top,
        rms_acceleration=float(np.sqrt(np.mean(np.gradient(v, t) ** 2))),
        reversals=_reversals(position, max(least, 0.01 * span)),
        at_rest=float(share[~moving].sum()),
        forward=float(share[moving & (v > 0)].sum()),
        backward=float(share[moving & (v < 0)].sum()),
        speed_levels=int(np.sum(levels > VISITED)),
        bandwidth_hz=_bandwidth(t, v),
    )


def _velocity(time: Array, position: Array) -> tuple[Array, Array]:
    """Central differences over an interval long enough to suppress noise, thinned to that interval."""
    base = max(1, int(LONGEST_BASE * time.size))
    width = 2 * base
    t = time[base:-base:base] if base > 1 else time[1:-1]
    count = t.size
    low, high = position[:-width:base][:count], position[width::base][:count]
    dt = time[width::base][:count] - time[:-width:base][:count]
    count = min(count, low.size, high.size)
    return t[:count], (high[:count] - low[:count]) / dt[:count]


def _reversals(position: Array, least: float) -> int:
    """Turning points between which the position moves by at least `least`."""
    count, direction, turn = 0, 0, float(position[0])
    # Only local extremes can be turning points; the loop runs over those alone.
    slope = np.sign(np.diff(position))
    moving = np.flatnonzero(slope)
    extremes = moving[1:][slope[moving[1:]] != slope[moving[:-1]]]
    for value in (*position[extremes].tolist(), float(position[-1])):
        way = value - turn
        if direction == 0 or way * direction > 0:
            if abs(way) >= least or direction:
                direction, turn = direction or (1 if way > 0 else -1), value
        elif abs(way) >= least:
            count, direction, turn = count + 1, -direction, value
    return count


def _bandwidth(time: Array, velocity: Array) -> float:
    """Frequency [Hz] below which `ENERGY` of the velocity's energy lies, on an even grid."""
    even = np.linspace(time[0], time[-1], time.size)
    v = np.interp(even, time, velocity)
    power = np.abs(np.fft.rfft(v * np.hanning(v.size))) ** 2
    total = np.cumsum(power)
    index = int(np.searchsorted(total, ENERGY * total[-1]))
    return float(index / (even[-1] - even[0]))
