"""The samples of the recordings that are compared, and the sensor noise in them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.checks.actuation import actuator_torque
from missing_physics.evaluation import Band
from missing_physics.inference.torques.data import TorqueData
from missing_physics.results.result import ChannelSeries
from missing_physics.results.samples import Rows
from robot_model import Recording, Robot, unit_of

__all__ = ["compared_rows", "series_of", "without_delay"]

Array = NDArray[np.float64]


def compared_rows(data: TorqueData) -> tuple[Rows, ...]:
    """Samples of every recording, the fitted ones first; joints without fitted samples are not compared.

    Args:
        data: the rows of all recordings.
    """
    channels = tuple(f"{joint}.torque" for joint in data.joints)
    fitted = data.counts[data.fitted_blocks].sum(axis=0) > 0.0
    each = [np.hypot(run.rows.noise, run.rows.shaken) for run in data.runs]  # not predicted by any robot file
    noise = np.sqrt(np.mean(np.square(each), axis=0))
    found = []
    for i, run in enumerate(data.runs):
        motion = run.motion
        band = Band(motion.cutoff, motion.smoothing, tuple(data.standard.weights.rest))
        counted = run.rows.counted & fitted
        found.append(
            Rows(channels, noise, run.rows.time, ~data.fitted_rows(i), counted, band, error=data.error)
        )
    return tuple(found)


def without_delay(robot: Robot, recording: Recording, delay: float) -> Recording:
    """The recording with each joint's torque, current or voltage advanced by `delay` [s]."""
    moved = {}
    for joint in robot.drives:
        channel = actuator_torque(robot, recording, joint.name)[0]
        if channel is None or delay == 0.0:
            continue
        good = np.isfinite(recording[channel])
        time, values = recording.time[good], recording[channel][good]
        instants = np.clip(recording.time + delay, time[0], time[-1])
        moved[channel] = np.where(good, make_interp_spline(time, values, k=3)(instants), np.nan)
    return recording.with_channels(moved) if moved else recording


def series_of(data: TorqueData, rows: Sequence[Rows], robot: Robot) -> tuple[ChannelSeries, ...]:
    """Every compared channel of every recording; the models' predictions are added by the comparison.

    Args:
        data: the rows of all recordings.
        rows: of each recording.
        robot: nominal.
    """
    found = []
    for i, (run, own) in enumerate(zip(data.runs, rows)):
        for k, channel in enumerate(own.channels):
            if not any(other.counted[:, k].any() for other in rows):
                continue
            prismatic, measured = robot.drives[k].kind == "prismatic", run.rows.measured[:, k]
            position, velocity = (
                part[run.motion.kept][:, k] for part in (run.motion.position, run.motion.velocity)
            )
            found.append(
                ChannelSeries(
                    recording=run.rows.source,
                    role="train" if i < data.fitted else "validation",
                    channel=channel,
                    unit=unit_of(channel, prismatic=prismatic),
                    location=channel.split(".")[0],
                    time=own.time,
                    measured=measured,
                    nominal=np.zeros_like(measured),
                    augmented=np.zeros_like(measured),
                    held_out=own.held_out,
                    noise_floor=float(own.noise[k]),
                    position=position,
                    velocity=velocity,
                    variable_units=("m", "m/s") if prismatic else ("rad", "rad/s"),
                    counted=own.counted[:, k],
                )
            )
    return tuple(found)
