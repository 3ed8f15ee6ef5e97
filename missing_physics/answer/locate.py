"""Localisation of the mismatch between nominal robot and recordings: where, when, and its dependences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import signal, stats

from missing_physics.evaluation import Evaluation
from missing_physics.inference.torques.data import TorqueData
from missing_physics.results.result import Dependence, Mismatch
from missing_physics.results.samples import Rows
from missing_physics.wording.numbers import range_text
from robot_model import Robot, unit_of

__all__ = ["BEYOND_NOISE", "FLOOR_TOLERANCE", "located", "p_value_of", "residual_of"]

Array = NDArray[np.float64]

#: Significance level of a residual above the noise.
BEYOND_NOISE = 0.01
#: A noise level is an estimate and may be too low by this factor.
FLOOR_TOLERANCE = 1.15
#: Bins of a curve, fewest samples of each, and the smallest share of the energy that a curve must explain.
BINS, FEWEST, WORTH = 20, 5, 0.05
#: Length of an interval as a fraction of the recording, the multiple of the typical energy from which it is
#: listed, and most intervals.
STRETCH, STANDS_OUT, MOST_WINDOWS = 1 / 240, 4.0, 4
#: Most spectral lines that are listed, and their height relative to their neighbourhood.
LINES, HEIGHT = 3, 8.0
#: A curve over time that covers more than this part of the recording is not localised in time.
EVERYWHERE = 0.5


def residual_of(made: Evaluation, rows: Rows) -> Array:
    """Measured minus predicted where compared, zero elsewhere, shape (K, m)."""
    residuals = np.column_stack([made.at(rows.time, channel) for channel in rows.channels])
    return np.where(rows.counted, np.nan_to_num(residuals), 0.0)


def located(
    data: TorqueData, robot: Robot, made: Sequence[Evaluation], rows: Sequence[Rows]
) -> tuple[Mismatch, ...]:
    """The mismatch of each channel, largest fraction of the error energy first.

    Args:
        data: the rows of all recordings.
        robot: nominal.
        made: its evaluation along each recording, the fitted ones first.
        rows: of each recording.
    """
    fitted = range(data.fitted)
    residuals = [residual_of(made[i], rows[i]) for i in fitted]
    floor = np.maximum(list(rows[0].floor.values()), 1e-300)
    count = np.maximum(sum(own.counted.sum(axis=0) for own in rows[: data.fitted]), 1)
    rms = np.sqrt(sum((r**2).sum(axis=0) for r in residuals) / count)
    beyond = (rms / floor) ** 2
    shares = beyond / max(float(beyond.sum()), 1e-300)
    found = []
    for k in np.argsort(-shares):
        if not any(rows[i].counted[:, k].any() for i in fitted):
            continue
        p_value = p_value_of(
            np.concatenate([residuals[i][rows[i].counted[:, k], k] for i in fitted]), floor[k]
        )
        found.append(
            _described(data, robot, rows, [one[:, k] for one in residuals], int(k), shares[k], p_value)
        )
    return tuple(found)


def p_value_of(residual: Array, floor: float) -> float:
    """p-value of a residual: probability that noise of rms `floor`, within its tolerance, is as large."""
    if residual.size < FEWEST:
        return 1.0
    centred = residual - residual.mean()
    power = np.abs(np.fft.rfft(centred, 2 * residual.size)) ** 2
    rho = np.fft.irfft(power)[: residual.size // 2]
    rho = rho / max(float(rho[0]), 1e-300)
    ends = np.flatnonzero(rho <= 0.0)
    memory = 2.0 * float(rho[: ends[0] if ends.size else rho.size].sum()) - 1.0
    samples = residual.size / max(memory, 1.0)
    ratio = float(np.mean(residual**2)) / (FLOOR_TOLERANCE * floor) ** 2
    return float(stats.chi2.sf(ratio * samples, samples))


def _described(
    data: TorqueData,
    robot: Robot,
    rows: Sequence[Rows],
    residuals: Sequence[Array],
    k: int,
    share: float,
    p_value: float,
) -> Mismatch:
    channel = rows[0].channels[k]
    place, variables = channel.split(".")[0], _variables(data, robot, k)
    variables["time"] = [own.time for own in rows[: data.fitted]]
    prismatic = robot.drives[k].kind == "prismatic"
    counted = np.concatenate([own.counted[:, k] for own in rows[: data.fitted]])
    blocks = np.concatenate([np.arange(own.time.size) * 10 // own.time.size for own in rows[: data.fitted]])
    total = np.concatenate(list(residuals))[counted]
    joined = {name: np.concatenate(parts)[counted] for name, parts in variables.items()}
    depends = tuple(_dependences(joined, total, blocks[counted]))
    windows = _windows(rows[0].time, residuals[0])
    lines = _lines(rows[0].time, residuals[0], rows[0].band.torque)
    words = _words(place, prismatic, share, depends, windows, lines)
    return Mismatch(place, channel, float(share), p_value, windows, depends, lines, words)


def _variables(data: TorqueData, robot: Robot, k: int) -> dict[str, list[Array]]:
    """Variables on which the residual of a joint's torque may depend, in each fitted recording."""
    joint, runs = robot.drives[k].name, data.runs[: data.fitted]
    kept = [run.motion.kept for run in runs]
    return {
        f"{joint}.velocity": [run.motion.velocity[s][:, k] for run, s in zip(runs, kept)],
        f"{joint}.position": [run.motion.position[s][:, k] for run, s in zip(runs, kept)],
        f"{joint}.torque": [run.rows.measured[:, k] for run in runs],
    }


def _dependences(
    variables: Mapping[str, Array], residual: Array, blocks: NDArray[np.int_]
) -> Iterator[Dependence]:
    found = []
    for name, values in variables.items():
        edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, BINS + 1)))
        if edges.size < 4:
            continue
        bins = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, edges.size - 2)
        curve = np.zeros(residual.size)
        for half in (0, 1):  # each half is predicted by the curve of the other one
            here = blocks % 2 == half
            counts = np.bincount(bins[~here], minlength=edges.size - 1)
            means = np.bincount(bins[~here], residual[~here], edges.size - 1) / np.maximum(counts, 1)
            means[counts < FEWEST] = 0.0
            curve[here] = means[bins[here]]
        share = 1.0 - float(np.sum((residual - curve) ** 2) / max(float(np.sum(residual**2)), 1e-300))
        energy = np.bincount(bins, curve**2, edges.size - 1)
        order = np.argsort(-energy)
        largest = order[: int(np.searchsorted(np.cumsum(energy[order]), 0.7 * energy.sum())) + 1]
        extent = float(edges[largest.min()]), float(edges[largest.max() + 1])
        everywhere = name == "time" and extent[1] - extent[0] > EVERYWHERE * float(np.ptp(values))
        if share > WORTH and not everywhere:
            found.append(Dependence(name, extent, share))
    return iter(sorted(found, key=lambda d: -d.share))


def _windows(time: Array, residual: Array) -> tuple[tuple[float, float], ...]:
    """Intervals whose energy far exceeds the typical one, strongest first [s]."""
    size = max(int(residual.size * STRETCH), 3)
    level = np.convolve(residual**2, np.ones(size) / size, mode="same")
    typical = float(np.median(level))
    if typical <= 0.0:
        return ()
    edges = np.flatnonzero(np.diff(np.r_[0, (level > STANDS_OUT * typical).astype(int), 0]))
    spans = sorted(zip(edges[::2], edges[1::2]), key=lambda span: -float(level[span[0] : span[1]].sum()))
    return tuple((float(time[a]), float(time[min(b, time.size - 1)])) for a, b in spans[:MOST_WINDOWS])


def _lines(time: Array, residual: Array, cutoff: float) -> tuple[float, ...]:
    """Frequencies at which the residual's spectrum has lines [Hz]."""
    if residual.size < 64:
        return ()
    rate = 1.0 / float(np.median(np.diff(time)))
    length = min(residual.size, max(256, residual.size // 6))
    frequency, power = signal.welch(residual, rate, nperseg=length)
    width = max(min(31, power.size // 2 * 2 - 1), 3)
    around = np.maximum(signal.medfilt(power, width), 1e-300)
    peaks, _ = signal.find_peaks(power / around, height=HEIGHT)
    strongest = peaks[np.argsort(-power[peaks])][:LINES]
    return tuple(float(frequency[i]) for i in strongest if 0.0 < frequency[i] < cutoff)


def _words(
    joint: str,
    prismatic: bool,
    share: float,
    depends: Sequence[Dependence],
    windows: Sequence[tuple[float, float]],
    lines: Sequence[float],
) -> str:
    parts = [f"{joint}: {share:.0%} of the mismatch"]
    for one in depends[:2]:
        quantity = one.variable.rpartition(".")[2]
        unit = unit_of(one.variable, prismatic=prismatic)
        parts.append(
            f"a curve over {quantity} explains {one.share:.0%} of it, mostly from "
            f"{range_text(*one.range, unit)}"
        )
    if windows:
        spans = (range_text(*window, "s", between="-") for window in windows[:3])
        parts.append("it is largest at " + ", ".join(spans))
    if lines:
        parts.append("with spectral lines at " + ", ".join(f"{f:.3g}" for f in lines) + " Hz")
    return "; ".join(parts) + "."
