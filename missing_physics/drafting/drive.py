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

#: Most samples that are used, evenly spread over the recording.
SAMPLES = 4000
#: Rate at which the motion is resampled [Hz], and the span of the polynomial for derivatives [s].
RATE, SPAN = 250.0, 0.12
#: The torque must explain this part of the residual of friction alone, and its factor vary no more than this.
EXPLAINS, STEADY = 0.5, 0.3
PARTS = 4
#: Smallest motion of a joint from which its drive can be estimated [rad or m].
LEAST = 0.01
#: A joint must travel its whole range this many times for the work of its torque to determine a direction.
STROKES = 4.0

Array = NDArray[np.float64]


@dataclass
class JointDraft:
    """The table of one joint in an overlay.

    Attributes:
        name: of the joint.
        actuator: keys of its actuator.
        reasons, questions: guesses with their reasons, and open questions.
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
        explains: part of the current, without friction, that the torque explains.
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
    """Torques of a robot on a fixed base with rigid links and all positions recorded; None for any other."""
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
    """Net work of a joint's torque on the motion, as a part of all work that it exchanges.

    Args:
        recording: with position and torque.
        joint: its name.

    Returns:
        From -1 to 1; 0 where a channel is missing, or the joint moves to and fro less than twice, so that
        stored energy may come back.
    """
    if not {f"{joint}.position", f"{joint}.torque"} <= set(recording):
        return 0.0
    time = np.arange(recording.time[0], recording.time[-1], 1.0 / min(RATE, recording.sample_rate))
    position = _at(time, recording, f"{joint}.position")
    width = max(5, int(SPAN / (time[1] - time[0])) | 1)
    if time.size < 2 * width or np.ptp(position) < LEAST:
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
        joint: which of the moving joints.
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
    """Current per torque, and the part of the current that it explains beyond the other regressors."""
    own = torque - rest @ np.linalg.lstsq(rest, torque, rcond=None)[0]
    left = current - rest @ np.linalg.lstsq(rest, current, rcond=None)[0]
    power, whole = float(own @ own), float(left @ left)
    if power < 1e-6 * float(torque @ torque) or whole <= 0:
        return 0.0, 0.0
    slope = float(own @ left) / power
    return slope, slope * float(own @ left) / whole
