"""Orders: cycles of a residual along a joint's position, whatever the speed."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from missing_physics.diagnosis.least_squares.problem import Problem
from missing_physics.diagnosis.location.shares import Account, Share, bins, more, solved
from missing_physics.results.result import Order
from robot_model import Robot

__all__ = ["FEWEST_PERIODS", "orders_of", "spatial_peaks"]

Array = NDArray[np.float64]

#: Fewest periods within the travel that make an order, and that make one worth telling: with fewer it is a
#: curve over the position.
FEWEST_PERIODS, FEWEST_TOLD = 0.75, 2.0
#: Bins of position for the spectrum along it.
MOST_BINS = 16384
#: Speeds below this part of the largest count as standing still.
STANDSTILL = 0.02
#: Peaks of a spectrum that are tried, and orders that are told at most.
TRIED, TOLD = 3, 3
#: A rival that explains less by this part only is as good.
AS_GOOD = 0.1
#: Steps of the refinement of a peak, and how often it is made.
STEPS, REFINEMENTS = 9, 3


def spatial_peaks(
    position: Array, velocity: Array, residual: Array, *, cutoff: float, count: int
) -> tuple[float, ...]:
    """Strongest angular orders of the residual along the position [1/rad or 1/m].

    Scans the residual as it is and with the sign of the velocity (what drives against the motion flips).

    Args:
        position, velocity, residual: shape (R,).
        cutoff: of the filter [Hz]; orders that it has removed are not looked at.
        count: number of orders for each of the two.
    """
    travel = float(position.max() - position.min())
    moving = np.abs(velocity) > STANDSTILL * max(float(np.abs(velocity).max()), 1e-12)
    if travel <= 0 or moving.sum() < 50:
        return ()
    typical = float(np.median(np.abs(velocity[moving])))
    highest = 2 * np.pi * cutoff / max(typical, 1e-12)
    lowest = 2 * np.pi * FEWEST_PERIODS / travel
    if highest <= lowest:
        return ()
    bins = int(np.clip(4 * travel * highest / (2 * np.pi), 64, MOST_BINS))
    place = np.clip(((position[moving] - position.min()) / travel * bins).astype(int), 0, bins - 1)
    peaks: list[float] = []
    for values in (residual, residual * np.sign(velocity)):
        centred = values[moving] - values[moving].mean()
        # Residual summed over fine bins of position, then one FFT: the periodogram along the position.
        power = np.abs(np.fft.rfft(np.bincount(place, centred, bins), 4 * bins)) ** 2
        orders = 2 * np.pi * np.arange(power.size) / (4 * travel)
        power[(orders < lowest) | (orders > highest)] = 0.0
        found, _ = signal.find_peaks(power)
        strongest = found[np.argsort(-power[found])][:count]
        peaks += [float(orders[i]) for i in strongest]
    return tuple(peaks)


def orders_of(robot: Robot, account: Account) -> tuple[Order, ...]:
    """Cycles along the position that are no plain curve over it and no plain frequency, largest share first.

    At a constant speed an order and a frequency are the same; then there is no order to tell.
    """
    problem, found = account.problem, []
    travel = float(np.ptp(account.position))
    joint = robot.moving_joints[account.joint]
    ratio = joint.actuator.gear_ratio if joint.actuator else 1.0
    for _ in range(TOLD):
        sight = _Orders(account, travel)
        order, gain = sight.strongest() or (0.0, 0.0)
        if order * travel < 2 * np.pi * FEWEST_TOLD or not account.is_worth_telling(gain):
            break
        share = sight.share()
        if share is None or not account.is_clear(share) or not _is_order(account, share, travel):
            break
        unit = "1/m" if joint.kind == "prismatic" else "1/turn"
        cycles = order if unit == "1/turn" else order / (2 * np.pi)
        motor = order / ratio if ratio != 1.0 else None
        found.append(Order(f"{problem.joints[account.joint]}.position", cycles, unit, motor, share.share))
        account = account.beside(sight.columns(order))
    return tuple(sorted(found, key=lambda item: -item.share))


def _is_order(account: Account, share: Share, travel: float) -> bool:
    """Whether a cycle along the position tells what neither a curve over it nor a frequency does."""
    line = _Frequencies(account)
    found = line.strongest()
    if found is not None:
        rival = line.share()
        clearly = rival is None or more(share, rival, part=AS_GOOD)
        if not clearly and not _beside(account, line.columns(found[0]), travel):
            return False
    curve = bins(account.position)
    curve = np.hstack([curve, curve * account.direction[:, None]])
    return more(share, account.share(curve), part=AS_GOOD) or _beside(account, curve, travel)


def _beside(account: Account, columns: Array, travel: float) -> bool:
    """Whether a cycle along the position explains a clear part of what `columns` leave."""
    known = account.beside(columns)
    share = _Orders(known, travel).share()
    return share is not None and known.is_clear(share)


class _Cycles(ABC):
    """A search for one cycle; each half of the data is foretold by the cycle that the other half shows."""

    def __init__(self, account: Account, width: float) -> None:
        """`width` is that of a peak of the spectrum, in the unit of what is looked for."""
        self.account, self.width = account, width

    @abstractmethod
    def peaks(self, rest: Array, rows: NDArray[np.bool_]) -> tuple[float, ...]:
        """Where to start; `rest` is zero but in `rows`."""

    @abstractmethod
    def quick(self, at: float) -> Array:
        """Columns of the cycle, without what the filter makes of them, shape (K, k)."""

    def columns(self, at: float) -> Array:
        """Columns of the cycle, shape (K, k)."""
        return self.quick(at)

    def strongest(self, rows: NDArray[np.bool_] | None = None) -> tuple[float, float] | None:
        """The cycle that explains most of `rows` (of all when left out), and the part of all the energy."""
        account = self.account
        rows = np.ones(account.residual.size, dtype=bool) if rows is None else rows
        span = account.span(rows)
        rest = np.zeros(account.residual.size)
        rest[rows] = _without(span, account.residual[rows])
        best, most = None, -np.inf
        for start in self.peaks(rest, rows):
            at, reach = start, 0.5 * self.width
            for _ in range(REFINEMENTS):
                tried = at + reach * np.linspace(-1, 1, STEPS)
                gains = [_gain(_without(span, self.quick(k)[rows]), rest[rows]) for k in tried]
                at, reach = float(tried[int(np.argmax(gains))]), 2 * reach / (STEPS - 1)
            if max(gains) > most:
                best, most = at, max(gains)
        return None if best is None else (best, most / float(account.residual @ account.residual))

    def share(self) -> Share | None:
        """What the cycle explains in unseen blocks; None where a half shows none."""
        account, columns = self.account, None
        for half in (0, 1):
            own = account.half == half
            found = self.strongest(~own)
            if found is None:
                return None
            made = self.columns(found[0])
            columns = np.zeros((2, *made.shape)) if columns is None else columns
            columns[half] = made
        assert columns is not None
        return account.share(columns)


class _Orders(_Cycles):
    """Along the position, as it is and turning with the direction."""

    def __init__(self, account: Account, travel: float) -> None:
        super().__init__(account, 2 * np.pi / max(travel, 1e-300))

    def peaks(self, rest: Array, rows: NDArray[np.bool_]) -> tuple[float, ...]:
        account = self.account
        cutoff = account.problem.segments[0].motion.low_pass.cutoff
        shown = account.position[rows], account.velocity[rows], rest[rows]
        return spatial_peaks(*shown, cutoff=cutoff, count=TRIED)

    def quick(self, at: float) -> Array:
        return _with_direction(_wave(at * self.account.position), self.account.direction)

    def columns(self, at: float) -> Array:
        """Through the filter, which takes away of a cycle what is fast."""
        joint, parts = self.account.joint, []
        for segment in self.account.problem.segments:
            wave = _wave(at * segment.motion.position[:, joint])
            parts.append(segment.motion.low_pass.reduce(wave))
        return _with_direction(np.concatenate(parts)[self.account.rows], self.account.direction)


class _Frequencies(_Cycles):
    """Along the time, with a phase of its own in every recording."""

    def __init__(self, account: Account) -> None:
        self._longest = max(float(s.time[-1] - s.time[0]) for s in account.problem.segments)
        super().__init__(account, 2 * np.pi / self._longest)

    def peaks(self, rest: Array, rows: NDArray[np.bool_]) -> tuple[float, ...]:
        del rows
        problem, account = self.account.problem, self.account
        found: list[float] = []
        for values in (rest, rest * account.direction):
            series = np.zeros(problem.time.size)
            series[account.rows] = values
            spectra = [_spectrum(problem, series, k, self._longest) for k in range(len(problem.segments))]
            shortest = min(s.size for s in spectra)
            power = np.sum([s[:shortest] for s in spectra], axis=0)
            peaks, _ = signal.find_peaks(power)
            strongest = peaks[np.argsort(-power[peaks])][:TRIED]
            found += [float(2 * np.pi * k / (4 * self._longest)) for k in strongest]
        return tuple(found)

    def quick(self, at: float) -> Array:
        problem, rows = self.account.problem, self.account.rows
        wave = _with_direction(_wave(at * problem.time[rows]), self.account.direction)
        own = problem.segment_of[rows][:, None] == np.arange(len(problem.segments))
        return (wave[:, :, None] * own[:, None, :]).reshape(rows.size, -1)


def _spectrum(problem: Problem, series: Array, segment: int, longest: float) -> Array:
    """Power of one recording at multiples of a quarter of one over the `longest` recording."""
    own = problem.segment_of == segment
    step = float(np.median(np.diff(problem.time[own])))
    return np.asarray(np.abs(np.fft.rfft(series[own], max(round(4 * longest / step), int(own.sum())))) ** 2)


def _wave(phase: Array) -> Array:
    return np.column_stack([np.cos(phase), np.sin(phase)])


def _with_direction(columns: Array, direction: Array) -> Array:
    return np.hstack([columns, columns * direction[:, None]])


def _without(span: Array, values: Array) -> Array:
    return np.asarray(values - span @ (span.T @ values))


def _gain(columns: Array, target: Array) -> float:
    """Energy of `target` that the columns explain."""
    return float(np.sum(target**2) - np.sum((target - columns @ solved(columns, target)) ** 2))
