"""The samples of the recordings that are compared, and the noise level of the sensors there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.checks.actuation import actuator_torque
from missing_physics.evaluation import Band
from missing_physics.inference import Data
from missing_physics.results.result import ChannelSeries
from missing_physics.results.samples import Rows
from robot_model import Recording, Robot, unit_of

__all__ = ["compared_rows", "punctual", "series_of"]

Array = NDArray[np.float64]


def compared_rows(data: Data) -> tuple[Rows, ...]:
    """Samples of every recording, the fitted ones first; joints without fitted samples are not compared."""
    channels = tuple(f"{joint}.torque" for joint in data.joints)
    fitted = data.counts[data.seen].sum(axis=0) > 0.0
    each = [np.hypot(run.rows.noise, run.rows.shaken) for run in data.runs]  # no robot file predicts either
    noise = np.sqrt(np.mean(np.square(each), axis=0))
    found = []
    for i, run in enumerate(data.runs):
        motion = run.motion
        band = Band(motion.cutoff, motion.smoothing, tuple(data.standard.rest))
        counted = run.rows.counted & fitted
        held_out, error = ~data.rows_seen(i), data.error
        found.append(Rows(channels, noise, run.rows.time, held_out, counted, band, error=error))
    return tuple(found)


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


def series_of(data: Data, rows: Sequence[Rows], robot: Robot) -> tuple[ChannelSeries, ...]:
    """Every compared torque of every recording; the models' predictions are added by the comparison."""
    found = []
    for i, (run, own) in enumerate(zip(data.runs, rows)):
        kept = run.motion.kept
        for k, joint in enumerate(robot.drives):
            if not any(other.counted[:, k].any() for other in rows):
                continue
            prismatic = joint.kind == "prismatic"
            measured = run.rows.measured[:, k]
            found.append(
                ChannelSeries(
                    recording=run.rows.source,
                    role="train" if i < data.fitted else "validation",
                    channel=own.channels[k],
                    unit=unit_of(own.channels[k], prismatic=prismatic),
                    location=joint.name,
                    time=own.time,
                    measured=measured,
                    nominal=np.zeros_like(measured),
                    augmented=np.zeros_like(measured),
                    held_out=own.held_out,
                    noise_floor=float(own.noise[k]),
                    position=run.motion.position[kept][:, k],
                    velocity=run.motion.velocity[kept][:, k],
                    variable_units=("m", "m/s") if prismatic else ("rad", "rad/s"),
                    counted=own.counted[:, k],
                )
            )
    return tuple(found)
