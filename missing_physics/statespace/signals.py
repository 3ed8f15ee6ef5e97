"""What a recording holds of each joint, at evenly spaced instants: its position and its torque."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.checks.actuation import actuator_torque, is_passive
from missing_physics.recordings import estimate_noise
from robot_model import InputError, Recording, Robot

__all__ = ["Signals"]

Array = NDArray[np.float64]

#: Fewest samples from which anything is estimated.
FEWEST = 50
#: A gap longer than this many median steps ends a stretch: what drives the robot in it is not known.
LONGEST_GAP = 10.0
#: Samples times joints of one recording: more cost time and tell nothing of motions of some hertz.
MOST_SAMPLES = 150_000
#: Noise of a channel that states none and shows none: this part of its range, about the last digit written.
ROUNDING = 1e-7


@dataclass(frozen=True)
class Signals:
    """The longest stretch of a recording without a gap, N samples at even instants, n moving joints.

    Attributes:
        source: name of the recording.
        time: [s], shape (N,).
        position: at the motor where it is recorded, else at the joint, shape (N, n) [rad or m].
        torque: of the actuator at the joint, shape (N, n) [N m or N]; zero where nothing drives the joint,
            NaN columns where something does and it was not recorded.
        position_noise, torque_noise: standard deviations of white noise per sample, as stated or as the
            numbers show, shape (n,).
        temperature: of the joints [K], NaN columns where not recorded, shape (N, n).
    """

    source: str
    time: Array
    position: Array
    torque: Array
    position_noise: Array
    torque_noise: Array
    temperature: Array

    @classmethod
    def of(cls, robot: Robot, recording: Recording, *, most: int = MOST_SAMPLES) -> Signals:
        """Read the channels of the moving joints.

        Args:
            robot: names the channels.
            recording: must hold the position of every moving joint.
            most: samples times joints that are kept; of faster recordings, means of neighbours are taken.

        Raises:
            InputError: the position of a moving joint is not recorded, or too few samples in a row.
        """
        name = recording.source or "the recording"
        joints = [joint.name for joint in robot.moving_joints]
        positions = [_position(recording, joint, name) for joint in joints]
        time, mean = _grid(recording, positions, name, most // len(joints))
        noise = _noise(robot, recording)

        def series(channel: str, factor: float = 1.0) -> Array:
            return factor * _averaged(_interpolated(recording, channel, time), mean)

        torque, spread = [], []
        for joint in joints:
            channel, factor = actuator_torque(robot, recording, joint)
            nothing = 0.0 if is_passive(robot, recording, joint) else np.nan
            torque.append(np.full(time.size // mean, nothing) if channel is None else series(channel, factor))
            spread.append(0.0 if channel is None else abs(factor) * noise.get(channel, 0.0) / np.sqrt(mean))
        place = [max(noise.get(c, 0.0), ROUNDING * _range(recording[c])) for c in positions]
        return cls(
            source=recording.source,
            time=_averaged(time, mean),
            position=np.column_stack([series(channel) for channel in positions]),
            torque=np.column_stack(torque),
            position_noise=np.array(place) / np.sqrt(mean),
            torque_noise=np.array(spread),
            temperature=np.column_stack([series(f"{joint}.temperature") for joint in joints]),
        )

    @property
    def step(self) -> float:
        """Sample time [s]."""
        return float(self.time[-1] - self.time[0]) / (self.time.size - 1)

    @property
    def known(self) -> NDArray[np.bool_]:
        """Joints whose torque is known, that of a passive joint included, shape (n,)."""
        return np.asarray(np.isfinite(self.torque).all(axis=0))


def _position(recording: Recording, joint: str, name: str) -> str:
    for quantity in ("motor_position", "position"):
        if f"{joint}.{quantity}" in recording:
            return f"{joint}.{quantity}"
    raise InputError(
        f"{name} has neither {joint}.position nor {joint}.motor_position; the motion of every joint that "
        "moves has to be recorded (name its source in a map file, --map)."
    )


def _grid(recording: Recording, positions: list[str], name: str, most: int) -> tuple[Array, int]:
    """Even instants of the longest stretch without a gap, and how many of them are averaged to one sample."""
    time = recording.time
    there = [np.isfinite(recording[channel]) for channel in positions]
    usual = max((float(np.median(np.diff(time[good]))) for good in there if good.sum() > 1), default=0.0)
    every = np.all([_near(time, good, LONGEST_GAP * usual) for good in there], axis=0)
    cuts = np.flatnonzero(np.diff(every.astype(int))) + 1
    stretches = [part for part in np.split(np.arange(time.size), cuts) if every[part[0]]]
    longest = max(stretches, key=len, default=np.zeros(0, dtype=int))
    if longest.size < FEWEST or usual <= 0.0:
        raise InputError(
            f"{name} has at most {longest.size} samples in a row in which all joints' positions are "
            f"recorded; {FEWEST} are needed."
        )
    first, last = time[longest[0]], time[longest[-1]]
    count = round((last - first) / usual) + 1
    mean = max(1, -(-count // most))
    return np.linspace(first, last, count)[: count - count % mean], mean


def _near(time: Array, good: NDArray[np.bool_], gap: float) -> NDArray[np.bool_]:
    """Instants between two numbers of a channel that are at most `gap` [s] apart."""
    given = time[good]
    if given.size < 2:
        return np.zeros(time.size, dtype=bool)
    after = np.clip(np.searchsorted(given, time, side="right"), 1, given.size - 1)
    inside = (time >= given[0]) & (time <= given[-1])
    return np.asarray(inside & (given[after] - given[after - 1] <= gap))


def _averaged(values: Array, mean: int) -> Array:
    """Means of `mean` neighbours."""
    return values if mean == 1 else values.reshape(-1, mean).mean(axis=1)


def _noise(robot: Robot, recording: Recording) -> dict[str, float]:
    """White noise by channel: what the robot's sensors state, else the recording, else what it shows."""
    stated = {s.channel: float(np.hypot(s.noise, s.resolution / np.sqrt(12.0))) for s in robot.sensors}
    shown = {c: v for c, v in estimate_noise(recording).items() if np.isfinite(v)}
    return {**shown, **recording.noise, **{c: v for c, v in stated.items() if v > 0.0}}


def _interpolated(recording: Recording, channel: str, time: Array) -> Array:
    """A channel at even instants: by a cubic spline through its own numbers; NaN without any."""
    if channel not in recording:
        return np.full(time.size, np.nan)
    values = recording[channel]
    good = np.isfinite(values)
    if good.sum() < FEWEST:
        return np.full(time.size, np.nan)
    given = recording.time[good]
    inside = np.clip(time, given[0], given[-1])
    return np.asarray(make_interp_spline(given, values[good], k=3)(inside))


def _range(values: Array) -> float:
    good = values[np.isfinite(values)]
    return float(np.ptp(good)) if good.size else 0.0
