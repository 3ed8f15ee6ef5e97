"""Actuator loads of a rigid arm along its motion, decimated to few rows.

Positions and torques pass one zero-phase low-pass filter at the end of the motion's band, as in
`missing_physics.standard`, and are decimated to four rows per period of this frequency.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.signal import butter, sosfiltfilt

from missing_physics.checks.actuation import actuator_torque
from missing_physics.checks.clocks import FEWEST_SAMPLES, Clock
from missing_physics.recordings.channels.estimates import noise_of
from missing_physics.standard.band import motion_band, position_channel
from reference_model.evaluation.drive_model import drive_model
from reference_model.evaluation.model import RobotModel
from robot_model import InputError, Recording, Robot

__all__ = ["Carried"]

Array = NDArray[np.float64]

#: Most samples that are read; of a longer recording, as many in evenly spaced stretches.
MOST_SAMPLES, STRETCHES = 100_000, 8
#: Most rows that are used.
MOST_ROWS = 4000
#: Rows per period of the band's end, and periods that are left out at either end of a stretch.
ROWS_PER_PERIOD, EDGE_PERIODS = 4, 2.0
#: Order of the filter, forward and backward.
ORDER = 4
#: Speed, as a fraction of a joint's highest, below which the sign of its velocity is smoothed.
SLOW = 0.02


@dataclass(frozen=True)
class Carried:
    """Actuator loads in K rows of n joints.

    Attributes:
        robot: nominal.
        model: of the robot.
        position, velocity, acceleration: shape (K, n).
        torque: of the actuators, in the band, shape (K, n); zero where not known.
        known: joints whose torque channel is recorded and changes, shape (n,).
        noise: white noise of each torque channel within the band, shape (n,) [N m or N].
        channels: source channels of the torques, shape (n,); empty if not known.
        dynamic: torque that the motion requires without gravity, shape (K, n).
        weight: torque per gravitational acceleration along x, y, z, shape (K, n, 3) [N m s^2/m].
    """

    robot: Robot
    model: RobotModel
    position: Array
    velocity: Array
    acceleration: Array
    torque: Array
    known: NDArray[np.bool_]
    noise: Array
    channels: tuple[str, ...]
    dynamic: Array
    weight: Array

    @classmethod
    def of(cls, robot: Robot, recording: Recording) -> Carried | None:
        """Loads of a rigid robot on a fixed base with all positions recorded, else None."""
        joints = [drive.name for drive in robot.drives]
        plain = robot.base.kind == "fixed" and not robot.spherical_joints and not robot.flexible_links
        if not plain or not joints:
            return None
        try:
            channels = [position_channel(robot, recording, joint) for joint in joints]
            torques = [actuator_torque(robot, recording, joint) for joint in joints]
            parts = list(_stretches(recording))
            cutoff = max(motion_band(robot, part) for part in parts)
            rows = [_rows(part, channels, torques, cutoff) for part in parts]
        except InputError:
            return None  # channels that a diagnosis needs are missing, which is reported elsewhere
        both = [np.concatenate([row[k] for row in rows]) for k in range(4)]
        thin = np.unique(np.linspace(0, len(both[0]) - 1, MOST_ROWS).astype(int))
        position, velocity, acceleration, torque = (values[thin] for values in both)
        if len(position) < FEWEST_SAMPLES // 2:
            return None
        model = drive_model(robot)
        dynamic, weight = _needed(model, (position, velocity, acceleration))
        names = tuple(name or "" for name, _ in torques)
        part = np.sqrt(min(1.0, 2.0 * cutoff / recording.sample_rate))
        noise = np.array([abs(f) * noise_of(parts[0], c) * part if c else 0.0 for c, f in torques])
        known = np.array([bool(name) for name in names]) & (np.ptp(torque, axis=0) > 0.0)
        motion = position, velocity, acceleration
        return cls(robot, model, *motion, torque, known, noise, names, dynamic, weight)

    def other(self, joint: int) -> Array:
        """Regressors of the torque other than inertia and weight of the bodies, shape (K, 4).

        Those of a rotor, viscous friction, dry friction and a constant.
        """
        speed = self.velocity[:, joint]
        top = float(np.abs(speed).max()) or 1.0
        constant = np.ones_like(speed)
        return np.stack([self.acceleration[:, joint], speed, np.tanh(speed / (SLOW * top)), constant], axis=1)


def _stretches(recording: Recording) -> Iterator[Recording]:
    """The complete recording, or the stretches of it that are read."""
    count, time = len(recording), recording.time
    if count <= MOST_SAMPLES:
        yield recording
        return
    length = MOST_SAMPLES // STRETCHES
    for first in np.linspace(0, count - length - 1, STRETCHES).astype(int):
        yield recording.window(float(time[first]), float(time[first + length]))


def _rows(
    recording: Recording, channels: list[str], torques: list[tuple[str | None, float]], cutoff: float
) -> tuple[Array, Array, Array, Array]:
    """Position, velocity, acceleration and torque of one stretch, shape (K, n) each."""
    core = [*channels, *(name for name, _ in torques if name)]
    clock = Clock.of(recording, core)
    position = [clock.values(channel) for channel in channels]
    torque = [factor * clock.values(name) if name else np.zeros(clock.time.size) for name, factor in torques]
    sections = butter(ORDER, min(cutoff, 0.4 * clock.rate), fs=clock.rate, output="sos")
    pad = min(clock.time.size - 1, int(3 * EDGE_PERIODS * clock.rate / cutoff))
    smooth = sosfiltfilt(sections, np.column_stack([*position, *torque]), axis=0, padlen=pad)
    stride = max(1, int(clock.rate / (ROWS_PER_PERIOD * cutoff)))
    edge = int(EDGE_PERIODS * ROWS_PER_PERIOD)
    time, smooth, count = clock.time[::stride], smooth[::stride], len(channels)
    spline = make_interp_spline(time, smooth[:, :count], k=5)
    kept = slice(edge, max(edge, time.size - edge))
    at = time[kept]
    return (
        smooth[kept, :count],
        np.asarray(spline(at, 1)),
        np.asarray(spline(at, 2)),
        smooth[kept, count:],
    )


def _needed(model: RobotModel, state: tuple[Array, Array, Array]) -> tuple[Array, Array]:
    """Torque without gravity, shape (K, n), and per gravity along three axes, shape (K, n, 3)."""
    names = list(model.inertial_names)
    places = [names.index(f"gravity.{axis}") for axis in "xyz"]
    still = model.inertial.copy()
    still[places] = 0.0
    joints = slice(model.tree.offset, model.tree.offset + len(model.joints))
    dynamic = np.asarray(model.inverse_dynamics(*state, inertial=still)[:, joints])
    weight = []
    for place in places:
        pulled = still.copy()
        pulled[place] = 1.0
        weight.append(model.inverse_dynamics(*state, inertial=pulled)[:, joints] - dynamic)
    return dynamic, np.stack(weight, axis=2)
