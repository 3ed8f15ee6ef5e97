"""Step 3 of the chain: where, when and on what the residual depends.

Shares are parts of the energy that lies above the noise. A dependence is judged by how much of the residual
a curve over that variable explains in blocks of time that were not used to draw the curve, so that chance
does not look like structure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import signal, stats
from scipy.ndimage import binary_erosion

from missing_physics.diagnosis.least_squares.model_error import accuracy
from missing_physics.diagnosis.least_squares.problem import Output, Problem
from missing_physics.diagnosis.location.conditions import depends_on_conditions
from missing_physics.diagnosis.location.orders import orders_of
from missing_physics.diagnosis.location.shares import BINS, TOLD_SHARE, Account
from missing_physics.diagnosis.statistics.correlated_errors import effective_samples
from missing_physics.results.result import Dependence, Mismatch, Order
from missing_physics.wording.numbers import range_text
from robot_model import Robot, unit_of

__all__ = ["FLOOR_TOLERANCE", "locate", "outstanding_windows"]

Array = NDArray[np.float64]

#: Fewest samples that make a bin.
FEWEST_IN_BIN = 5
#: Quantities that say under which conditions a joint runs, and their names in words.
CONDITIONS = {"load_moment": "the load of its bearing", "temperature": "its temperature"}
#: What is explained further.
BESIDE = " beside a curve over velocity"
#: A range of time that covers this part of the recording is no place in time.
EVERYWHERE = 0.5
#: Window length for finding outstanding stretches, as a part of the recording, and how far they stand out.
WINDOW_PART = 1 / 240
STANDS_OUT = 4.0
#: Residual that exceeds the noise floor by less than this factor may come from the noise's uncertainty.
FLOOR_TOLERANCE = 1.15
#: Rows next to others of unsure direction, or to an end, that are not asked whether more than noise is left,
#: where this part of the rows, and so many, remain.
NEXT, INNER_PART, FEWEST_ROWS = 2, 0.4, 20
#: Spectral peaks told, and how far above the median of their neighbourhood they must be.
PEAKS_TOLD = 3
PEAK_HEIGHT = 8.0
#: What is told only of a residual that noise leaves with less than this chance.
BEYOND_NOISE = 0.01


def outstanding_windows(time: Array, residual: Array) -> tuple[tuple[float, float], ...]:
    """Stretches whose mean square stands out from the median stretch, strongest first [(s, s)]."""
    size = max(int(residual.size * WINDOW_PART), 3)
    level = np.convolve(residual**2, np.ones(size) / size, mode="same")
    typical = float(np.median(level))
    if typical <= 0:
        return ()
    above = level > STANDS_OUT * typical
    edges = np.flatnonzero(np.diff(np.r_[0, above.astype(int), 0]))
    spans = list(zip(edges[::2], edges[1::2]))
    spans.sort(key=lambda span: -float(level[span[0] : span[1]].sum()))
    return tuple((float(time[a]), float(time[min(b, time.size - 1)])) for a, b in spans)


def locate(problem: Problem, robot: Robot, residual: Array) -> tuple[Mismatch, ...]:
    """Describe, output by output, what a residual above the noise depends on; largest share first.

    Args:
        residual: measured minus predicted, shape (R, m).
    """
    floor = np.maximum(np.hypot(problem.noise_floor, accuracy(problem)), 1e-300)
    residual = residual * problem.sliding
    rms = np.sqrt(np.sum(residual**2, axis=0) / np.maximum(problem.sliding.sum(0), 1.0))
    whitened = np.where(problem.usable, (rms / floor) ** 2, 0.0)
    shares = whitened / max(float(whitened.sum()), 1e-300)
    found = []
    for index in np.argsort(-shares):
        if not problem.usable[index]:
            continue
        rows = _settled(problem, index)
        p_value = _p_value(residual[rows, index], float(floor[index])) if rows.any() else 1.0
        found.append(_describe(problem, robot, residual[:, index], int(index), float(shares[index]), p_value))
    return tuple(found)


def _settled(problem: Problem, index: int) -> NDArray[np.bool_]:
    """Rows that tell whether more than noise is left of an output, shape (R,); none where they are too few.

    The filter passes a little of what it holds further than its memory, which is where a joint's direction
    is unsure or the recording begins. So rows next to those count only where there are few others.
    """
    sliding = problem.sliding[:, index] > 0
    inner = np.zeros_like(sliding)
    for segment in np.unique(problem.segment_of):
        own = problem.segment_of == segment
        inner[own] = binary_erosion(sliding[own], iterations=NEXT)
    rows = inner if inner.sum() >= max(INNER_PART * sliding.sum(), FEWEST_ROWS) else sliding
    return rows if rows.sum() >= FEWEST_ROWS else np.zeros_like(rows)


def _p_value(residual: Array, floor: float) -> float:
    """Chance that noise of rms `floor`, known to within the tolerance, leaves as much."""
    samples = effective_samples(residual)
    ratio = float(np.mean(residual**2)) / (FLOOR_TOLERANCE * floor) ** 2
    return float(stats.chi2.sf(ratio * samples, samples))


def _describe(
    problem: Problem, robot: Robot, residual: Array, index: int, share: float, p_value: float
) -> Mismatch:
    output = problem.outputs[index]
    variables = {}
    for column, joint in enumerate(problem.joints):
        if output.joint in (None, column):
            variables[f"{joint}.velocity"] = problem.velocity[:, column]
            variables[f"{joint}.position"] = problem.position[:, column]
    if output.joint is not None:
        variables[output.channel] = problem.measured[:, index]
    variables["time"] = problem.time
    depends = _dependences(variables, residual, problem.blocks)
    orders: tuple[Order, ...] = ()
    if output.joint is not None and p_value < BEYOND_NOISE:
        account = Account.of(problem, residual, output.joint)
        if account is not None and account.is_worth_telling(account.before):
            depends = tuple(sorted((*depends, *_conditions(robot, account)), key=lambda d: -d.share))
            orders = orders_of(robot, account)
    first = problem.segment_of == 0
    windows = outstanding_windows(problem.time[first], residual[first])[:4]
    peaks = _spectral_peaks(problem, residual)
    words = _words(robot, output, depends, windows, peaks, orders, share=share)
    return Mismatch(output.place, output.channel, share, p_value, windows, depends, peaks, words, orders)


def _conditions(robot: Robot, account: Account) -> tuple[Dependence, ...]:
    """On which temperature or bearing load the residual depends."""
    return tuple(
        Dependence(name, _range(_edges(values), values, foretold), share)
        for name, (values, foretold, share) in depends_on_conditions(robot, account).items()
    )


def _dependences(
    variables: Mapping[str, Array], residual: Array, blocks: NDArray[np.int_]
) -> tuple[Dependence, ...]:
    told = []
    for name, values in variables.items():
        curve = _curve(values, residual, blocks)
        if curve is None:
            continue
        # Any residual with a memory follows a curve over time; only one that keeps to a part of it is told.
        everywhere = curve[0][1] - curve[0][0] > EVERYWHERE * float(np.ptp(values))
        if curve[1] > TOLD_SHARE and not (name == "time" and everywhere):
            told.append(Dependence(name, curve[0], curve[1]))
    return tuple(sorted(told, key=lambda d: -d.share))


def _curve(
    values: Array, residual: Array, blocks: NDArray[np.int_]
) -> tuple[tuple[float, float], float] | None:
    """Range in which the curve is largest, and the share of energy a binned curve explains out of sample."""
    edges = _edges(values)
    if edges.size < 4:
        return None
    bins = _bins(edges, values)
    fold = blocks % 2
    predicted = np.zeros(residual.size)
    for half in (0, 1):
        train, test = fold != half, fold == half
        counts = np.bincount(bins[train], minlength=edges.size - 1)
        means = np.bincount(bins[train], residual[train], edges.size - 1) / np.maximum(counts, 1)
        means[counts < FEWEST_IN_BIN] = 0.0
        predicted[test] = means[bins[test]]
    energy = float(np.sum(residual**2))
    share = 1.0 - float(np.sum((residual - predicted) ** 2)) / max(energy, 1e-300)
    return _range(edges, values, predicted), share


def _edges(values: Array) -> Array:
    """Of bins that hold equally many of the values."""
    return np.unique(np.quantile(values, np.linspace(0, 1, BINS + 1)))


def _bins(edges: Array, values: Array) -> NDArray[np.int_]:
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, edges.size - 2)


def _range(edges: Array, values: Array, predicted: Array) -> tuple[float, float]:
    """Range of the values in which most of what is predicted lies."""
    per_bin = np.bincount(_bins(edges, values), predicted**2, edges.size - 1)
    order = np.argsort(-per_bin)
    enough = order[: int(np.searchsorted(np.cumsum(per_bin[order]), 0.7 * per_bin.sum())) + 1]
    return float(edges[enough.min()]), float(edges[enough.max() + 1])


def _spectral_peaks(problem: Problem, residual: Array) -> tuple[float, ...]:
    """Frequencies at which the residual's spectrum of the first recording has lines [Hz]."""
    first = problem.segment_of == 0
    series, time = residual[first], problem.time[first]
    if series.size < 64:
        return ()
    rate = 1.0 / float(np.median(np.diff(time)))
    frequency, power = signal.welch(series, rate, nperseg=min(series.size, max(256, series.size // 6)))
    width = min(31, power.size // 2 * 2 - 1)
    background = signal.medfilt(power, max(width, 3))
    found, _ = signal.find_peaks(power / np.maximum(background, 1e-300), height=PEAK_HEIGHT)
    strongest = found[np.argsort(-power[found])][:PEAKS_TOLD]
    cutoff = problem.segments[0].motion.low_pass.cutoff
    return tuple(float(frequency[i]) for i in strongest if 0 < frequency[i] < cutoff)


def _words(
    robot: Robot,
    output: Output,
    depends: Sequence[Dependence],
    windows: Sequence[tuple[float, float]],
    peaks: Sequence[float],
    orders: Sequence[Order],
    *,
    share: float,
) -> str:
    name = output.channel if output.joint is None else output.place
    parts = [f"{name}: {share:.0%} of the mismatch"]
    for dependence in [d for k, d in enumerate(depends) if k < 2 or _condition(d)]:
        place, _, quantity = dependence.variable.rpartition(".")
        prismatic = bool(place) and robot.joint(place).kind == "prismatic"
        unit = unit_of(dependence.variable, prismatic=prismatic) if place else "s"
        low, high = dependence.range
        of = f"{place}'s {quantity}" if place and output.joint is None else quantity
        beside = BESIDE if _condition(dependence) else ""
        parts.append(
            f"a curve over {CONDITIONS.get(of, of)} explains {dependence.share:.0%} of it{beside}, "
            f"mostly from {range_text(low, high, unit)}"
        )
    if windows:
        told = (range_text(*window, "s", between="-") for window in windows[:3])
        parts.append("it stands out at " + ", ".join(told))
    parts += [_cycle(order) for order in orders]
    if peaks:
        parts.append("with spectral lines at " + ", ".join(f"{f:.3g}" for f in peaks) + " Hz")
    return "; ".join(parts) + "."


def _condition(dependence: Dependence) -> bool:
    return dependence.variable.rpartition(".")[2] in CONDITIONS


def _cycle(order: Order) -> str:
    joint = order.variable.rpartition(".")[0]
    per = f"turn of {joint}" if order.unit == "1/turn" else f"metre of {joint}"
    motor = "" if order.per_motor_turn is None else f" ({order.per_motor_turn:.3g} per turn of its motor)"
    told = f"with a cycle of {order.cycles:.3g} per {per}{motor}"
    return f"{told}, which explains {order.share:.0%} of it{BESIDE}"
