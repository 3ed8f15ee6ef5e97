"""The samples of the recordings that are compared, and the noise level of the sensors there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.checks.actuation import actuator_torque
from missing_physics.checks.gyros import gyro_channels, gyro_noise
from missing_physics.evaluation import Band, Evaluation
from missing_physics.inference.torques.data import TorqueData
from missing_physics.inference.torques.runs import Run
from missing_physics.results.result import ChannelSeries
from missing_physics.results.samples import Rows
from missing_physics.standard import MODEL_ERROR
from robot_model import Recording, Robot, unit_of

__all__ = ["compared_rows", "punctual", "series_of"]

Array = NDArray[np.float64]


def compared_rows(data: TorqueData, robot: Robot, recordings: Sequence[Recording]) -> tuple[Rows, ...]:
    """Samples of every recording, the fitted ones first; joints without fitted samples are not compared.

    Torques of all joints, then gyros of a free base, which no hypothesis was fitted to.

    Args:
        data: the rows of all recordings.
        robot: nominal.
        recordings: as compared, the fitted ones first.
    """
    gyros = gyro_channels(robot, recordings)
    channels = (*(f"{joint}.torque" for joint in data.joints), *gyros)
    fitted = np.append(data.counts[data.seen].sum(axis=0) > 0.0, np.ones(len(gyros), dtype=bool))
    each = [  # no robot file predicts these
        [*np.hypot(run.rows.noise, run.rows.shaken), *(_base_noise(run, robot, one, c) for c in gyros)]
        for run, one in zip(data.runs, recordings)
    ]
    noise = np.sqrt(np.mean(np.square(each), axis=0))
    read = [[np.nanstd(one[c]) for c in gyros] for one in recordings[: data.fitted]]
    error = np.append(data.error, MODEL_ERROR * np.sqrt(np.mean(np.square(read), axis=0)))
    found = []
    for i, run in enumerate(data.runs):
        motion, time = run.motion, run.rows.time
        band = Band(motion.cutoff, motion.smoothing, tuple(data.standard.weights.rest))
        counted = np.hstack([run.rows.counted, np.ones((time.size, len(gyros)), dtype=bool)]) & fitted
        found.append(Rows(channels, noise, time, ~data.rows_seen(i), counted, band, error=error))
    return tuple(found)


def _base_noise(run: Run, robot: Robot, recording: Recording, channel: str) -> float:
    """rms in the band of what a gyro's noise, and that of the encoders, leaves of the rate of a free base."""
    motion, response = run.motion, run.along.response
    assert response is not None
    axis = 3 + "xyz".index(channel[-1])
    lever = np.sqrt(np.mean(response.base[:, : motion.velocity_noise.size, axis] ** 2, axis=0))
    velocity = motion.velocity_noise * (motion.cutoff / motion.smoothing) ** 1.5
    return float(
        np.hypot(gyro_noise(robot, recording, channel, motion.cutoff), np.linalg.norm(lever * velocity))
    )


def punctual(robot: Robot, recording: Recording, late: float) -> Recording:
    """The recording with each joint's torque, current or voltage as it was `late` [s] later."""
    moved = {}
    for joint in robot.drives:
        channel = actuator_torque(robot, recording, joint.name)[0]
        if channel is None or late == 0.0:
            continue
        good = np.isfinite(recording[channel])
        time, values = recording.time[good], recording[channel][good]
        instants = np.clip(recording.time + late, time[0], time[-1])
        moved[channel] = np.where(good, make_interp_spline(time, values, k=3)(instants), np.nan)
    return recording.with_channels(moved) if moved else recording


def series_of(
    data: TorqueData, rows: Sequence[Rows], robot: Robot, made: Sequence[Evaluation]
) -> tuple[ChannelSeries, ...]:
    """Every compared channel of every recording; the models' predictions are added by the comparison.

    Args:
        data: the rows of all recordings.
        rows: of each recording.
        robot: nominal.
        made: what it predicts of each; of those with gyros at least.
    """
    found = []
    for i, (run, own) in enumerate(zip(data.runs, rows)):
        for k, channel in enumerate(own.channels):
            if not any(other.counted[:, k].any() for other in rows):
                continue
            joint = robot.drives[k] if k < len(robot.drives) else None
            prismatic = joint is not None and joint.kind == "prismatic"
            if joint is not None:
                measured = run.rows.measured[:, k]
            else:
                column = made[i].channels.index(channel)
                measured = np.interp(own.time, made[i].time, made[i].measured[:, column])
            moved = (run.motion.position, run.motion.velocity) if joint is not None else ()
            position, velocity = [part[run.motion.kept][:, k] for part in moved] or (None, None)
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
