"""Estimates of a drive from currents and torques, the robot's inverse dynamics and the work done."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from reference_model.evaluation.drive_model import drive_model
from robot_model import Recording, Robot

__all__ = ["Drive", "JointDraft", "Needed", "needed_torques", "power_share", "torque_per_current"]

#: Maximum number of samples, evenly spread over the recording.
SAMPLES = 4000
#: Rate at which the motion is resampled [Hz], and window of the Savitzky-Golay filter [s].
RATE, SPAN = 250.0, 0.12
#: Minimum fraction of the residual of friction that the torque explains, and maximum spread of its factor.
EXPLAINS, STEADY = 0.5, 0.3
PARTS = 4
#: Smallest range of motion for estimating a drive [rad or m].
SMALLEST_RANGE = 0.01
#: Minimum travel, in ranges of motion, for which the work of a torque determines its sign.
STROKES = 4.0

Array = NDArray[np.float64]


@dataclass
class JointDraft:
    """The table of one joint in an overlay.

    Attributes:
        name: name of the joint.
        actuator: values of its actuator.
        reasons, questions: reasons for the guesses, and open questions.
    """

    name: str
    actuator: dict[str, float] = field(default_factory=dict)
    reasons: list[str] = field(default_factory=list)
    questions: list[str] = field(default_factory=list)


class Needed(NamedTuple):
    """Torques that the nominal robot needs along the motion.

    Attributes:
        time: instants [s], shape (N,).
        velocity, acceleration, torque: of all moving joints, shape (N, n).
    """

    time: Array
    velocity: Array
    acceleration: Array
    torque: Array


class Drive(NamedTuple):
    """Torque per ampere at a joint, torque constant times gear ratio.

    Attributes:
        factor: [N m/A], negative where current and torque have opposite signs.
        low, high: its range over parts of the recording.
        explains: fraction of the current, without friction, that the torque explains.
    """

    factor: float
    low: float
    high: float
    explains: float

    @property
    def determined(self) -> bool:
        """Whether the recording determines the factor."""
        spread = (self.high - self.low) / abs(self.factor) if self.factor else math.inf
        return self.explains > EXPLAINS and self.low * self.high > 0 and spread < 2 * STEADY


def needed_torques(robot: Robot, recording: Recording) -> Needed | None:
    """Torques of a robot with a fixed base, rigid links and all positions recorded; None for any other."""
    joints = robot.drives
    names = [f"{joint.name}.position" for joint in joints]
    plain = robot.base.kind == "fixed" and not robot.spherical_joints and not robot.flexible_links
    if not plain or not joints or any(name not in recording for name in names):
        return None
    rate = min(RATE, recording.sample_rate)
    time = np.arange(recording.time[0], recording.time[-1], 1.0 / rate)
    width = max(5, int(SPAN * rate) | 1)
    if time.size < 2 * width:
        return None
    position = np.stack([_at(time, recording, name) for name in names], axis=1)
    smooth, velocity, acceleration = (
        savgol_filter(position, width, 4, deriv=order, delta=1.0 / rate, axis=0) for order in (0, 1, 2)
    )
    every = np.unique(np.linspace(width, time.size - 1 - width, SAMPLES).astype(int))
    model = drive_model(robot)
    torque = model.inverse_dynamics(smooth[every], velocity[every], acceleration[every])
    order = [model.joints.index(joint.name) for joint in joints]
    return Needed(time[every], velocity[every], acceleration[every], torque[:, order])


def _at(time: Array, recording: Recording, name: str) -> Array:
    good = np.isfinite(recording[name])
    return np.interp(time, recording.time[good], recording[name][good])


def power_share(recording: Recording, joint: str) -> float:
    """Net work of a joint's torque, as a fraction of the work that it exchanges with the motion.

    Args:
        recording: with position and torque.
        joint: name of the joint.

    Returns:
        From -1 to 1; 0 if a channel is missing, or the joint moves back and forth less than twice, so that
        stored energy may be returned.
    """
    if not {f"{joint}.position", f"{joint}.torque"} <= set(recording):
        return 0.0
    time = np.arange(recording.time[0], recording.time[-1], 1.0 / min(RATE, recording.sample_rate))
    position = _at(time, recording, f"{joint}.position")
    width = max(5, int(SPAN / (time[1] - time[0])) | 1)
    if time.size < 2 * width or np.ptp(position) < SMALLEST_RANGE:
        return 0.0
    smooth = savgol_filter(position, width, 4)
    if np.abs(np.diff(smooth)).sum() < STROKES * np.ptp(smooth):
        return 0.0
    torque = _at(time, recording, f"{joint}.torque")
    work = 0.5 * (torque[1:] + torque[:-1]) * np.diff(smooth)
    whole = float(np.abs(work).sum())
    return float(work.sum()) / whole if whole else 0.0


def torque_per_current(needed: Needed, joint: int, recording: Recording, channel: str) -> Drive:
    """Least squares of a joint's current on its torque, friction, rotor and offset.

    Args:
        needed: see `needed_torques`.
        joint: index of the moving joint.
        recording: with the current.
        channel: the current [A].
    """
    current = _at(needed.time, recording, channel)
    speed, torque = needed.velocity[:, joint], needed.torque[:, joint]
    fast = 0.02 * float(np.abs(speed).max(initial=0.0)) or 1.0
    rest = np.stack(
        [speed, np.tanh(speed / fast), needed.acceleration[:, joint], np.ones_like(speed)], axis=1
    )
    slope, explains = _slope(torque, rest, current)
    parts = [_slope(torque[k], rest[k], current[k])[0] for k in np.array_split(np.arange(speed.size), PARTS)]
    if not slope or not all(parts):
        return Drive(0.0, 0.0, 0.0, 0.0)
    factors = [1.0 / part for part in parts]
    return Drive(1.0 / slope, min(factors), max(factors), explains)


def _slope(torque: Array, rest: Array, current: Array) -> tuple[float, float]:
    """Current per torque, and the fraction of the current that it explains beyond the other regressors."""
    own = torque - rest @ np.linalg.lstsq(rest, torque, rcond=None)[0]
    left = current - rest @ np.linalg.lstsq(rest, current, rcond=None)[0]
    power, whole = float(own @ own), float(left @ left)
    if power < 1e-6 * float(torque @ torque) or whole <= 0:
        return 0.0, 0.0
    slope = float(own @ left) / power
    return slope, slope * float(own @ left) / whole
