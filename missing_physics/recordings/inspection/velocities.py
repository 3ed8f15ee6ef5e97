"""Velocities that are not the derivative of their position: a factor, a lag, or a different signal.

Over windows of the recording the velocity's integral x is compared with the change y of the position:
x = b y + e, where b is one and e is due to noise. White noise of the velocity with standard deviation s adds
s^2 T h to x^2 over a window of length T sampled every h, rounding to steps of d adds (d T)^2 / 12, and noise
of the position adds twice its variance to y^2. Deviations that this explains are not reported.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.channels.estimates import noise_of, resolution_of
from missing_physics.recordings.channels.names import place_of
from missing_physics.recordings.inspection.findings import Finding
from missing_physics.recordings.inspection.shares import percent
from missing_physics.recordings.inspection.units import DEGREES, GAP, ODD, RPM
from missing_physics.recordings.maps.corrections import Correction
from robot_model import Recording, Robot

__all__ = ["velocity_findings"]

Array = NDArray[np.float64]

#: Pairs that are compared; references need not belong together.
_PAIRS = (("position", "velocity"), ("motor_position", "motor_velocity"))
#: Windows over which changes are compared; the fewest, and samples in each; levels that a velocity must have.
WINDOWS, FEWEST, IN_WINDOW, LEVELS = 200, 20, 4, 12
#: Longest lag in the search, as a fraction of the recording; number of lags on each side of zero, and
#: refined.
LONGEST_LAG, LAGS, FINER = 0.1, 200, 10
#: Smallest reported lag [samples and s]; largest lag of a filter [s], beyond which data are unusable.
LAG_SAMPLES, LAG_SECONDS, FILTERS = 3, 0.01, 0.05
#: A lag must remove this fraction of the disagreement beyond noise, and this multiple of what chance removes.
EXPLAINED, CHANCE = 0.9, 25.0
#: Deviations that count as noise: standard errors of the factor, and multiples of the expected energy.
SURE, TOLERATED = 4.0, 4.0
#: A position moves if its changes have this many times the energy of their noise.
MOVES = 25.0
#: Largest fraction of a velocity that a filter may remove; below `NOTHING` there is no filter.
FILTERED, NOTHING = 0.5, 0.2
#: Fraction of the windows, those with the largest disagreement, excluded because of outliers.
STRAYS = 0.05
#: Largest difference of a factor from a known one, as a natural logarithm.
KNOWN = 0.1
#: Largest residual fraction if a position's change agrees with another joint's velocity.
SAME = 0.04


def velocity_findings(recording: Recording, *, robot: Robot | None = None) -> Iterator[Finding]:
    """Findings of factors, lags and unrelated signals among measured velocities.

    Args:
        recording: as read.
        robot: if known, its gear ratios are used.
    """
    joints = robot.joints if robot else ()
    gears = {joint.name: joint.actuator.gear_ratio for joint in joints if joint.actuator}
    for place in dict.fromkeys(place_of(name) for name in recording):
        for one, other in _PAIRS:
            position, velocity = f"{place}.{one}", f"{place}.{other}"
            if place != "base" and position in recording and velocity in recording:
                pair = _Pair.of(recording, position, velocity)
                if pair is not None:
                    yield from _disagreement(recording, pair, gears.get(place, 1.0))


@dataclass(frozen=True)
class _Fit:
    """x = factor y + e over the windows; energies of factor y and of e."""

    lag: float
    factor: float
    agrees: float
    left: float
    count: int

    @property
    def error(self) -> float:
        """Relative standard error of the factor; infinite if nothing agrees."""
        return math.sqrt(self.left / (self.count * self.agrees)) if self.agrees > 0 else math.inf


@dataclass(frozen=True)
class _Pair:
    """A position and its velocity.

    Attributes:
        position, velocity: channels.
        edges: instants between the windows [s], shape (M + 1,).
        use: windows without a gap, shape (M,).
        change: of the position, shape (M,).
        time, way: instants of the velocity and its integral, shape (N,).
        noise: energy that noise adds to x.
    """

    position: str
    velocity: str
    edges: Array
    use: NDArray[np.bool_]
    change: Array
    time: Array
    way: Array
    noise: float

    @classmethod
    def of(cls, recording: Recording, position: str, velocity: str) -> _Pair | None:
        """The pair; None if values are too few or too coarse, or if the joint does not move beyond noise."""
        (tq, q), (tv, v) = (_given(recording, channel) for channel in (position, velocity))
        most = min(WINDOWS, tq.size // IN_WINDOW, tv.size // IN_WINDOW)
        if most < FEWEST or np.unique(v).size < LEVELS:
            return None
        margin = LONGEST_LAG * (tv[-1] - tv[0])
        inside = np.flatnonzero((tq >= tv[0] + margin) & (tq <= tv[-1] - margin))
        if inside.size < IN_WINDOW * FEWEST:
            return None
        at = np.unique(np.linspace(inside[0], inside[-1], most + 1).astype(int))
        edges = tq[at]
        use = ~(_holed(tq, edges) | _holed(tv, edges))
        change = np.diff(q[at])
        spans, step = np.diff(edges)[use], float(np.median(np.diff(tv)))
        still = 2.0 * use.sum() * noise_of(recording, position) ** 2
        if use.sum() < FEWEST or not (change[use] ** 2).sum() > MOVES * still:
            return None
        way = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(tv))])
        white, rounding = noise_of(recording, velocity), resolution_of(recording, velocity)
        noise = float((white**2 * step * spans + (rounding * spans) ** 2 / 12.0).sum()) + still
        return cls(position, velocity, edges, use, change, tv, way, noise)

    def fit(self, lag: float) -> _Fit:
        """The fit with the velocity advanced by `lag`, without offset and the most deviating windows."""
        x = np.diff(np.interp(self.edges + lag, self.time, self.way))[self.use]
        y, along = self.change[self.use], np.diff(self.edges)[self.use]
        along = along / np.linalg.norm(along)
        free = y - (along @ y) * along
        if free @ free > 0.1 * (y @ y):  # else offset and factor of an even motion are confounded
            x, y = x - (along @ x) * along, free
        factor = float(x @ y) / float(y @ y)
        apart = np.abs(x - factor * y)
        kept = apart <= np.quantile(apart, 1.0 - STRAYS)
        x, y = x[kept], y[kept]
        yy = max(float(y @ y), 1e-300)
        factor = float(x @ y) / yy
        left = float(((x - factor * y) ** 2).sum())
        return _Fit(lag, factor, factor**2 * yy, left, int(kept.sum()))

    def best(self) -> _Fit:
        """The fit at the lag with the smallest residual."""
        longest = LONGEST_LAG * float(self.time[-1] - self.time[0]) * (1.0 - 1.0 / LAGS)
        found, step = self.fit(0.0), longest / LAGS
        for width, count in ((step, LAGS), (step / FINER, FINER)):
            fits = (self.fit(found.lag + k * width) for k in range(-count, count + 1) if k)
            found = min((found, *fits), key=_disagree)
        return found

    def beyond(self, fit: _Fit) -> float:
        """Energy of the residual beyond noise."""
        return max(fit.left - TOLERATED * self.noise, 0.0)


def _disagree(fit: _Fit) -> float:
    whole = fit.agrees + fit.left
    return fit.left / whole if fit.factor > 0 and whole > 0 else 1.0


def _given(recording: Recording, channel: str) -> tuple[Array, Array]:
    good = np.isfinite(recording[channel])
    return recording.time[good], recording[channel][good]


def _holed(time: Array, edges: Array) -> NDArray[np.bool_]:
    """Mask of the windows with a gap between samples, in which the motion is unknown."""
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > GAP * np.median(steps))
    holed = np.zeros(edges.size - 1, dtype=bool)
    for k in gaps:
        holed |= (edges[:-1] < time[k + 1]) & (edges[1:] > time[k])
    return holed


def _disagreement(recording: Recording, pair: _Pair, gear: float) -> Iterator[Finding]:
    plain, best = pair.fit(0.0), pair.best()
    late = _late(recording, pair, plain, best)
    chosen = best if late or pair.beyond(plain) > plain.agrees else plain
    if pair.beyond(chosen) > chosen.agrees or abs(chosen.factor) * (1.0 + SURE * chosen.error) < _least(gear):
        yield _stranger(recording, pair, chosen)
        return
    if chosen.factor < 0:
        sentence = f"{pair.velocity} has the opposite sign of the change of {pair.position}; reverse one."
        corrections = (_correction(pair.velocity, -1.0),)
        yield Finding("error", "sign", pair.velocity, sentence, {"factor": chosen.factor}, corrections)
        return
    filtered = late and best.lag > 0 and FILTERED < chosen.factor < 1.0
    if abs(math.log(chosen.factor)) > ODD + SURE * chosen.error and not filtered:
        yield _scaled(pair, chosen.factor, gear)
    elif late:
        yield _lagging(pair, best.lag)


def _least(gear: float) -> float:
    """Smallest factor that counts; a velocity may be divided by the gear's ratio twice."""
    return min(NOTHING, 0.5 / max(gear, 1.0)) if gear > 1.0 else NOTHING


def _late(recording: Recording, pair: _Pair, plain: _Fit, best: _Fit) -> bool:
    """Whether only a lag makes the two agree."""
    least = max(LAG_SECONDS, LAG_SAMPLES / recording.sample_rate)
    before, after = plain.left - pair.noise, max(best.left - TOLERATED * pair.noise, 0.0)
    chance = CHANCE * max(best.left, pair.noise) / best.count
    return (
        abs(best.lag) > least
        and best.factor > 0
        and after < (1.0 - EXPLAINED) * before
        and plain.left - best.left > chance
    )


def _scaled(pair: _Pair, factor: float, gear: float) -> Finding:
    position, velocity = pair.position, pair.velocity
    known = {
        gear: "is the motor's own; divide it by the gear's ratio",
        1.0 / gear: "is divided by the gear's ratio twice",
        DEGREES: "is in degrees per second",
        RPM: "is in turns per minute",
    }
    for scale, words in known.items():
        if scale != 1.0 and abs(math.log(factor / scale)) < KNOWN:
            kind = "gear_ratio" if "gear" in words else "velocity_scale"
            seen = f"its integral is {factor:.4g} times the change of {position}"
            sentence = f"{velocity} {words} ({seen})."
            return Finding(
                "error", kind, velocity, sentence, {"factor": factor}, (_correction(velocity, scale),)
            )
    return Finding(
        "error",
        "velocity_scale",
        velocity,
        f"the integral of {velocity} is {factor:.3g} times the change of {position}: one of them is scaled "
        "wrongly; correct it or leave the velocity out.",
        {"factor": factor},
        (_correction(velocity, float(f"{factor:.3g}")),),
    )


def _correction(velocity: str, factor: float) -> Correction:
    return Correction(velocity, scale=1.0 / factor)


def _lagging(pair: _Pair, lag: float) -> Finding:
    much = abs(lag) > FILTERS
    return Finding(
        "error" if much else "warning",
        "lag",
        pair.velocity,
        f"{pair.velocity} {'lags behind' if lag > 0 else 'runs ahead of'} the change of {pair.position} by "
        f"{abs(lag):.3g} s{', more than a filter makes: their clocks differ' if much else ''}.",
        {"lag_s": lag},
        (Correction(pair.velocity, delay=float(f"{lag:.3g}")),),
    )


def _stranger(recording: Recording, pair: _Pair, fit: _Fit) -> Finding:
    whole = max(fit.agrees + fit.left, 1e-300)
    other = _owner(recording, pair.velocity)
    return Finding(
        "error",
        "not_derivative",
        pair.velocity,
        f"{pair.velocity} is not the derivative of {pair.position}: "
        + (
            f"it goes with {other}"
            if other
            else f"whatever the factor and lag, {percent(fit.left / whole)} of it disagrees"
        )
        + "; name its right source in a mapping file, or leave it out.",
        {"left": fit.left / whole, "factor": fit.factor},
    )


def _owner(recording: Recording, velocity: str) -> str:
    """The position of another joint with which a velocity agrees."""
    for name in recording:
        if name.endswith(".position") and name.count(".") == 1 and place_of(name) != place_of(velocity):
            pair = _Pair.of(recording, name, velocity)
            fit = pair.fit(0.0) if pair else None
            if fit and _disagree(fit) < SAME and abs(math.log(fit.factor)) < ODD:
                return name
    return ""
