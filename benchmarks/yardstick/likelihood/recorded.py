"""Real machines: residual of the standard model, calibration of the score, and plain least squares."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.yardstick.likelihood.least_squares import Plain, least_squares
from benchmarks.yardstick.likelihood.measures import (
    Octave,
    Series,
    held_out_deviates,
    held_out_ratios,
    octaves,
)
from benchmarks.yardstick.loading import load
from benchmarks.yardstick.machines import machine
from missing_physics.answer.findings import QUANTILE
from missing_physics.checks.stamps import on_even_clock
from missing_physics.checks.transmissions import on_both_sides
from missing_physics.coverage import prepared
from missing_physics.diagnosis.known.effects import stripped
from missing_physics.diagnosis.known.sensors import without_sensor_errors
from missing_physics.inference import Fit
from missing_physics.inference.data import held_out_windows
from missing_physics.inference.fit import residuals
from missing_physics.inference.search import standard_search
from missing_physics.inference.torques.data import TorqueData
from missing_physics.standard import fit_standard
from missing_physics.standard.bending import model_of
from missing_physics.standard.rows import FRICTION, common_band, rows_of, without_friction
from robot_model import InputError, Recording, Robot

__all__ = [
    "Friction",
    "JointMeasures",
    "MachineMeasures",
    "compared_recordings",
    "fitted_octaves",
    "measured",
    "rms",
    "torque_data",
]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Friction:
    """One friction parameter by two estimators.

    Attributes:
        name: viscous, coulomb or offset.
        ours, plain: estimate and standard deviation, of the standard model and of plain least squares.
        same_bodies: plain least squares of friction alone, with the bodies and rotors of the standard model.
        bounded: whether viscous or Coulomb friction of the joint is negative by either of these fits.
    """

    name: str
    ours: tuple[float, float]
    plain: tuple[float, float]
    same_bodies: tuple[float, float]
    bounded: bool

    @property
    def overlaps(self) -> bool:
        """Whether the two 95 % intervals overlap."""
        return _overlap(self.ours, self.plain)

    @property
    def agrees(self) -> bool:
        """Whether each estimate is in the 95 % interval of the other."""
        return abs(self.ours[0] - self.plain[0]) <= QUANTILE * min(self.ours[1], self.plain[1])

    @property
    def why(self) -> str:
        """Cause of a disagreement, by exclusion."""
        if self.bounded:
            return "negative friction by least squares"
        if _overlap(self.ours, self.same_bodies):
            return "other bodies or rotor"
        return "other weights of the joints"


@dataclass(frozen=True)
class JointMeasures:
    """Measures of one joint.

    Attributes:
        joint: name.
        octaves: of the residual of the fitted recordings, highest first.
        share: independent samples per row by the score.
        chi_square: mean square error of held-out rows relative to the residual's variance in fitted rows.
        foreseen: the same relative to the error of fitted rows that are predicted without their fold.
        deviates: of the held-out blocks.
        over_noise: rms residual relative to the sensors' noise in the band.
        over_error: rms residual relative to the error of any model.
        friction: parameters that both estimators determine.
        apart: rms difference of the torques predicted by the two in fitted rows, relative to the residual.
        held_out: rms error of plain least squares in held-out rows, relative to that of the standard model.
        per_block: independent samples in the median held-out block.
    """

    joint: str
    octaves: tuple[Octave, ...]
    share: float
    chi_square: float
    foreseen: float
    deviates: tuple[float, ...]
    over_noise: float
    over_error: float
    friction: tuple[Friction, ...]
    apart: float
    held_out: float
    per_block: float


@dataclass(frozen=True)
class MachineMeasures:
    """Measures of one machine.

    Attributes:
        machine: name of the row.
        joints: those with a fitted sample.
        white: independent samples per row of white noise in the band.
        refused: why there are none; "" else.
        seconds: processor time without reading.
    """

    machine: str
    joints: tuple[JointMeasures, ...]
    white: float
    refused: str
    seconds: float


def measured(name: str) -> MachineMeasures:
    """Measure one row of the yardstick."""
    began = time.process_time()
    try:
        loaded = load(machine(name))
        began = time.process_time()
        nominal, used = compared_recordings(loaded.robot, [*loaded.fit, *loaded.held_out])
        count = len(loaded.fit)
        first = torque_data(nominal, used[:count], used[count:])
        state = standard_search(first)
    except (InputError, np.linalg.LinAlgError) as error:
        return MachineMeasures(name, (), np.nan, str(error), time.process_time() - began)
    data, fit, shares = state.about(state.standard), state.standard, state.shares
    calibration = held_out_deviates(data, fit, shares)
    plain = _compared(first, shares)
    held = ~data.fitted_blocks
    chi_square, foreseen = held_out_ratios(data, fit)
    found = []
    for k, joint in enumerate(data.joints):
        if data.counts[data.fitted_blocks, k].sum() == 0.0:
            continue
        friction, apart, ahead = plain.get(joint, ((), np.nan, np.nan))
        blocks = data.counts[held, k]
        found.append(
            JointMeasures(
                joint,
                tuple(fitted_octaves(data, fit, k)),
                float(shares[k]),
                float(chi_square[k]),
                float(foreseen[k]),
                tuple(map(float, calibration[k])),
                float(fit.sigma[k] / data.noise[k]) if data.noise[k] > 0.0 else np.inf,
                float(fit.sigma[k] / data.error[k]),
                friction,
                apart,
                ahead,
                float(shares[k] * np.median(blocks[blocks > 0.0])) if blocks.any() else np.nan,
            )
        )
    return MachineMeasures(name, tuple(found), data.independent, "", time.process_time() - began)


def compared_recordings(robot: Robot, recordings: Sequence[Recording]) -> tuple[Robot, list[Recording]]:
    """Robot and recordings that a diagnosis compares, without corrections for gears and the base."""
    timed = [on_even_clock(one)[0] for one in recordings]
    given = tuple(on_both_sides(robot, one) for one in timed)
    nominal = stripped(robot, given)
    return nominal, list(prepared(nominal, [without_sensor_errors(robot, one) for one in given]).recordings)


def torque_data(robot: Robot, fit: Sequence[Recording], held_out: Sequence[Recording]) -> TorqueData:
    """The rows of recordings in the band of the motion, linearised at the standard model."""
    band = common_band(robot, [*fit, *held_out])
    model = model_of(without_friction(robot))
    windows = [] if held_out else [held_out_windows(rows_of(model, r, band).time) for r in fit]
    return TorqueData.of(fit_standard(robot, fit, cutoff=band, held_out=windows), fit, held_out)


def fitted_octaves(data: TorqueData, fit: Fit, joint: int) -> list[Octave]:
    """Octaves of the residual of one joint in the fitted rows."""
    series = []
    for run in range(data.fitted):
        counted = data.counted(run)[:, joint] & data.fitted_rows(run)
        values = np.where(counted, residuals(data, fit, run)[:, joint], 0.0)
        motion, instants = data.runs[run].motion, data.time(run)
        step = float(instants[1] - instants[0])
        series.append(Series(values, counted, step, motion.rate, motion.cutoff))
    return octaves(series)


def _compared(data: TorqueData, shares: Array) -> Mapping[str, tuple[tuple[Friction, ...], float, float]]:
    """For each joint friction parameters by both estimators, `JointMeasures.apart` and `held_out`.

    Only of joints with a recorded torque: others fix no scale, and the standard model takes that of the file.
    """
    own = data.standard.estimate
    count = own.values.size
    every = range(len(data.runs))
    design = np.concatenate([data.designs[run][:, :, :count] for run in every])
    torque = np.concatenate([data.target(run) for run in every])
    fitted = np.concatenate([_fitted_rows(data, run) for run in every])[:, None]
    driven = np.any([run.driven for run in data.runs], axis=0)
    whole = np.concatenate([data.counted(run) for run in every]) & driven
    counted, held = whole & fitted, whole & ~fitted
    if not counted.any():
        return {}
    size = own.layout.size[:count]
    plain = least_squares(design, torque, counted, shares, size)
    bodies = count - len(data.joints) * len(FRICTION)
    rest = torque - design[:, :, :bodies] @ own.values[:bodies]
    friction = least_squares(design[:, :, bodies:], rest, counted, shares, size[bodies:])
    apart = rms(design @ (own.values - plain.values), counted) / own.sigma
    ahead = rms(torque - design @ plain.values, held) / rms(torque - design @ own.values, held)
    found = {}
    for k, joint in enumerate(data.joints):
        if not driven[k]:
            continue
        pairs = []
        first = bodies + k * len(FRICTION)
        both = plain.values[first : first + 2], friction.values[first - bodies : first - bodies + 2]
        bounded = bool(np.min(both) < 0.0)
        for kind in FRICTION:
            place = own.layout.names.index(f"{joint}.{kind}")
            if own.layout.free[place] and np.isfinite(plain.deviations[place]):
                ours = float(own.values[place]), float(own.deviation[place])
                same = _at(friction, place - bodies)
                pairs.append(Friction(kind, ours, _at(plain, place), same, bounded))
        found[joint] = tuple(pairs), float(apart[k]), float(ahead[k])
    return found


def _fitted_rows(data: TorqueData, run: int) -> NDArray[np.bool_]:
    return data.fitted_rows(run) if run < data.fitted else np.zeros(data.time(run).size, dtype=bool)


def rms(values: Array, where: NDArray[np.bool_]) -> Array:
    """rms of each column where a mask is set; NaN if it is not set anywhere, shape (n,)."""
    count = where.sum(axis=0)
    total = np.where(where, values**2, 0.0).sum(axis=0)
    return np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def _at(fit: Plain, place: int) -> tuple[float, float]:
    return float(fit.values[place]), float(fit.deviations[place])


def _overlap(one: tuple[float, float], other: tuple[float, float]) -> bool:
    return abs(one[0] - other[0]) <= QUANTILE * (one[1] + other[1])
