"""The standard model estimated by a Kalman filter at full rate and by rows in a band, judged alike."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from benchmarks.yardstick.kalman.columns import Columns, columns_of
from benchmarks.yardstick.kalman.filter import TIMES, Filter, Levels, levels_of
from benchmarks.yardstick.likelihood.arms import EFFECTS, arm_of
from benchmarks.yardstick.likelihood.least_squares import Plain, least_squares
from benchmarks.yardstick.likelihood.measures import FEWEST
from benchmarks.yardstick.likelihood.recorded import compared_recordings, rms, torque_data
from benchmarks.yardstick.loading import load
from benchmarks.yardstick.machines import machine
from missing_physics.inference.data import held_out_windows
from missing_physics.inference.score import independent_shares
from missing_physics.inference.search import standard_search
from missing_physics.inference.torques.data import TorqueData
from missing_physics.standard.bending import model_of
from missing_physics.standard.rows import FRICTION, without_friction
from robot_model import InputError, Recording, Robot

__all__ = ["ArmErrors", "Compared", "JointResult", "arm_errors", "compared"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Rounds of estimating the levels and the parameters in turn.
ROUNDS = 3
#: Time after which the filter's start has little influence [s]: its longest time constant.
SETTLED = TIMES[0]
#: Least torque noise at the start of the search relative to the residual in the band [-].
LEAST = 1e-3
#: Columns that pass the filter at once, which limits its memory.
AT_ONCE = 8


@dataclass(frozen=True)
class JointResult:
    """One joint.

    Attributes:
        joint: name.
        octaves: power density of the fitted innovations relative to their mean by octave from the highest
            frequency down, each with at least `FEWEST` frequencies.
        chi_square: mean square of the held-out innovations relative to their variance by the filter.
        friction: parameters determined by both, with overlapping 95 % intervals, and their number.
        own, rows: held-out rms error in the band by the filter's parameters and by those of the rows,
            relative to the standard model of the diagnosis.
    """

    joint: str
    octaves: tuple[float, ...]
    chi_square: float
    friction: tuple[int, int]
    own: float
    rows: float


@dataclass(frozen=True)
class Compared:
    """One machine.

    Attributes:
        machine: name of the row.
        joints: of the machine.
        refused: why there are none; "" else.
        seconds: processor time of the filter.
    """

    machine: str
    joints: tuple[JointResult, ...]
    refused: str
    seconds: float


@dataclass(frozen=True)
class ArmErrors:
    """Friction and offsets of one drawn arm that both estimators determine.

    Attributes:
        drift: time constant of the drift of its torques [s], 0 for none.
        own, rows: estimate minus truth of the filter and of least squares of the rows, shape (P,).
        own_deviation, rows_deviation: their standard deviations, shape (P,).
    """

    drift: float
    own: Array
    rows: Array
    own_deviation: Array
    rows_deviation: Array


@dataclass(frozen=True)
class _Filtered:
    """Estimates of the filter.

    Attributes:
        plain: the parameters.
        innovations: by joint and recording, in units of their deviation, shape (N,) each.
        counted: mask of the samples that are compared, by recording, shape (N, n) each.
    """

    plain: Plain
    innovations: tuple[tuple[Array, ...], ...]
    counted: tuple[Mask, ...]


@threadpool_limits.wrap(limits=1, user_api="blas")
def compared(name: str) -> Compared:
    """Compare the two estimators at one row of the yardstick."""
    began = time.process_time()
    try:
        loaded = load(machine(name))
        fit, held = loaded.fit, loaded.held_out
        robot, used = compared_recordings(loaded.robot, [*fit, *held])
        if robot.base.kind == "free" or any(link.beam is not None for link in robot.links):
            raise InputError("the base is free, or links bend.")
        return _machine(name, robot, used[: len(fit)], used[len(fit) :])
    except (InputError, np.linalg.LinAlgError) as error:
        return Compared(name, (), str(error), time.process_time() - began)


def _machine(name: str, robot: Robot, fit: Sequence[Recording], held: Sequence[Recording]) -> Compared:
    data = torque_data(robot, fit, held)
    columns, masks = _columns(data, [*fit, *held])
    rows, standard = _by_rows(data)
    began = time.process_time()
    found = _filtered(data, columns, masks, rows)
    seconds = time.process_time() - began
    ahead = _ahead(data, found.plain.values), _ahead(data, rows.values), _ahead(data, standard)
    joints = []
    for k, joint in enumerate(data.joints):
        own = [(eps, c[:, k]) for eps, c in zip(found.innovations[k], found.counted)]
        if not any((c & m).any() for (_, c), m in zip(own, masks)):
            continue
        after = np.concatenate([eps[c & ~m] for (eps, c), m in zip(own, masks)])
        joints.append(
            JointResult(
                joint,
                _octaves([np.where(c & m, eps, 0.0) for (eps, c), m in zip(own, masks)]),
                float(np.mean(after**2)) if after.size else np.nan,
                _agreeing(data, k, found.plain, rows),
                float(ahead[0][k] / ahead[2][k]),
                float(ahead[1][k] / ahead[2][k]),
            )
        )
    return Compared(name, tuple(joints), "", seconds)


@threadpool_limits.wrap(limits=1, user_api="blas")
def arm_errors(which: tuple[int, float]) -> ArmErrors:
    """Errors of both estimators at a drawn arm without a further effect.

    Args:
        which: number of the arm among those, and the time constant of the drift of its torques [s], zero for
            none.
    """
    number, drift = which
    arm = arm_of(number * len(EFFECTS), drift=drift)
    data = torque_data(arm.robot, [arm.fit], [arm.held_out])
    columns, masks = _columns(data, [arm.fit, arm.held_out])
    rows = _by_rows(data)[0]
    own = _filtered(data, columns, masks, rows).plain
    places = np.array([data.layout.names.index(f"{j}.{kind}") for j in data.joints for kind in FRICTION])
    places = places[np.isfinite(own.deviations[places] + rows.deviations[places])]
    truth = np.array([arm.friction[data.layout.names[place]] for place in places])
    errors = (found.values[places] - truth for found in (own, rows))
    return ArmErrors(drift, *errors, own.deviations[places], rows.deviations[places])


def _columns(data: TorqueData, recordings: Sequence[Recording]) -> tuple[list[Columns], list[Mask]]:
    """Columns of all recordings, and masks of their fitted samples."""
    model, cutoff = model_of(without_friction(data.standard.nominal)), data.standard.cutoff
    columns = [columns_of(model, one, cutoff, SETTLED) for one in recordings]
    masks = []
    for i, (run, own) in enumerate(zip(data.runs, columns)):
        times = run.motion.time[0] + own.step * np.arange(len(own.torque))
        fitted = np.full(times.size, i < data.fitted)
        if data.fitted == len(data.runs):
            for first, last in held_out_windows(run.rows.time):
                fitted &= (times < first) | (times > last)
        masks.append(fitted)
    return columns, masks


def _by_rows(data: TorqueData) -> tuple[Plain, Array]:
    """Least squares of the fitted rows with a common delay, and the standard model with its delay."""
    state = standard_search(data)
    shares = independent_shares(data, state.standard)
    design, torque, where = _rows(data)
    fitted = np.concatenate([_fitted_rows(data, i) for i in range(len(data.runs))])[:, None]
    count = design.shape[2]
    plain = least_squares(design, torque, where & fitted, shares, data.layout.size[:count])
    return plain, state.standard.parameters[:count]


def _rows(data: TorqueData) -> tuple[Array, Array, Mask]:
    """Design with the common delay, torque, and mask of all rows."""
    every, count = range(len(data.runs)), data.standard.estimate.values.size + 1
    design = np.concatenate([data.designs[i][:, :, :count] for i in every])
    torque = np.concatenate([data.target(i) for i in every])
    return design, torque, np.concatenate([data.counted(i) for i in every])


def _fitted_rows(data: TorqueData, run: int) -> Mask:
    return data.fitted_rows(run) if run < data.fitted else np.zeros(data.time(run).size, dtype=bool)


def _ahead(data: TorqueData, values: Array) -> Array:
    """rms error in the band of held-out rows, shape (n,)."""
    design, torque, where = _rows(data)
    held = ~np.concatenate([_fitted_rows(data, i) for i in range(len(data.runs))])[:, None]
    return rms(torque - design @ values, where & held)


def _filtered(data: TorqueData, columns: Sequence[Columns], masks: Sequence[Mask], start: Plain) -> _Filtered:
    """Parameters by innovations whose levels are estimated in turn with them."""
    size, joints = data.layout.size[: start.values.size], range(len(data.joints))
    compared = [np.any([data.counted(i)[:, k].any() for i in range(data.fitted)]) for k in joints]
    counted = [np.where(compared, c.counted, False) for c in columns]
    fitted = np.concatenate([own & m[:, None] for own, m in zip(counted, masks)])
    inertia = np.mean([one.inertia for one in columns], axis=0)
    levels = [_first(columns, k, float(start.sigma[k])) for k in joints]
    plain = start
    for _ in range(ROUNDS):
        torque, design = np.zeros(fitted.shape), np.zeros((*fitted.shape, size.size))
        for k in np.flatnonzero(compared):
            series = [
                (c.torque[:, k] - c.design[:, k] @ plain.values, c.position[:, k], own[:, k] & m, c.step)
                for c, own, m in zip(columns, counted, masks)
                if (own[:, k] & m).any()
            ]
            levels[k] = levels_of(series, inertia[k], levels[k]) if series else levels[k]
            parts = [_passed(Filter(levels[k], inertia[k], c.step), c, k) for c in columns]
            torque[:, k] = np.concatenate([own for own, _ in parts])
            design[:, k] = np.concatenate([own for _, own in parts])
        plain = least_squares(design, torque, fitted, np.ones(len(joints)), size)
    left = np.where(compared, torque - design @ plain.values, 0.0)
    cuts = np.cumsum([len(c.torque) for c in columns])[:-1]
    innovations = [tuple(np.split(left[:, k], cuts)) for k in joints]
    return _Filtered(plain, tuple(innovations), tuple(counted))


def _passed(own: Filter, columns: Columns, k: int) -> tuple[Array, Array]:
    """Innovations of the recorded torque and of the columns, in units of their deviation, (N,) and (N, X)."""
    target = own.innovations(columns.torque[:, [k]], columns.position[:, [k]])[:, 0]
    design = np.zeros((len(target), columns.design.shape[2]))
    used = np.flatnonzero(np.any(columns.design[:, k] != 0.0, axis=0))
    for first in range(0, used.size, AT_ONCE):
        some = used[first : first + AT_ONCE]
        given = columns.design[:, k, some]
        design[:, some] = own.innovations(given, np.zeros_like(given))
    return target / own.deviation, design / own.deviation


def _first(columns: Sequence[Columns], k: int, residual: float) -> Levels:
    """Stated or estimated noise of the sensors, and the residual of the rows for every unknown force."""
    tiny = np.finfo(float).eps
    encoder = max(float(np.mean([one.encoder[k] * np.sqrt(one.step) for one in columns])), tiny)
    torque = float(np.mean([one.torque_noise[k] * np.sqrt(one.step) for one in columns]))
    torque = max(torque, LEAST * residual * np.sqrt(columns[0].step), tiny)
    return Levels(encoder, torque, np.full(len(TIMES), max(residual, tiny)))


def _agreeing(data: TorqueData, k: int, own: Plain, rows: Plain) -> tuple[int, int]:
    """Friction parameters of a joint whose intervals overlap, and those that both determine."""
    agreeing, count = 0, 0
    for kind in FRICTION:
        place = data.layout.names.index(f"{data.joints[k]}.{kind}")
        if data.layout.free[place] and np.isfinite(own.deviations[place] + rows.deviations[place]):
            apart = abs(own.values[place] - rows.values[place])
            agreeing += bool(apart <= 1.96 * (own.deviations[place] + rows.deviations[place]))
            count += 1
    return agreeing, count


def _octaves(series: Sequence[Array]) -> tuple[float, ...]:
    """Power density by octave relative to the mean, from the highest frequency down."""
    at, power = [], []
    for values in series:
        if values.any():
            spectrum = np.abs(np.fft.rfft(values)[1:]) ** 2 / np.count_nonzero(values)
            at.append(np.arange(1, spectrum.size + 1) / (0.5 * values.size))
            power.append(spectrum)
    if not at:
        return ()
    place, density = np.concatenate(at), np.concatenate(power)
    found, end = [], 1.0
    while np.count_nonzero(place <= end) >= FEWEST:
        own = (place <= end) & (place > 0.5 * end)
        if np.count_nonzero(place <= 0.5 * end) < FEWEST:
            own = place <= end
            end = 0.0
        found.append(float(density[own].mean() / density.mean()))
        end *= 0.5
    return tuple(found)
