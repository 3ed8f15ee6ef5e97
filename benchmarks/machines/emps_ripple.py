"""Is there a ripple along the screw? What one recording shows, held against the other."""

from __future__ import annotations

import numpy as np

from missing_physics.diagnosis import Result
from missing_physics.diagnosis.location.orders import spatial_peaks
from missing_physics.results.result import ChannelSeries

__all__ = ["ripple"]

CHANNEL = "joint1.torque"
#: Other periods that are tried for comparison: their number, and how far around the found one they reach.
COMPARED, AROUND = 400, 5.0
#: Takes more than this part of them would: no chance. Amplitudes within this factor are the same.
RARE, ALIKE = 0.99, 1.3


def ripple(nominal: str, result: Result, *, names: tuple[str, str]) -> str:
    """Whether the strongest line over position in what remains on the fitted file holds on the other.

    Args:
        nominal: name of the nominal robot.
        result: of its diagnosis, with one fitted and one validation recording.
        names: of the two recordings.
    """
    fitted, scored = names
    train, other = (
        next(s for s in result.series if s.channel == CHANNEL and s.role == role)
        for role in ("train", "validation")
    )
    assert train.position is not None
    assert train.velocity is not None
    peaks = spatial_peaks(train.position, train.velocity, _left(train), cutoff=_cutoff(train), count=1)
    if not peaks:
        return "No line over position stands out."
    order = peaks[0]
    waves = _waves(train, order)
    wave = np.linalg.lstsq(waves, _left(train), rcond=None)[0]
    changes = [
        float(np.sum((_left(s) - _waves(s, order) @ wave) ** 2) / np.sum(_left(s) ** 2)) - 1
        for s in (train, other)
    ]
    anew, again = _taken(other, order)
    others = order * np.geomspace(1 / AROUND, AROUND, COMPARED)
    less = float(np.mean([_taken(other, near)[0] < anew for near in others]))
    size, size_there = float(np.hypot(*wave)), float(np.hypot(*again))
    if changes[1] < 0.5 * changes[0]:
        verdict = "It holds there."
    elif less > RARE and abs(np.log(size_there / size)) < np.log(ALIKE):
        verdict = (
            "So it is probably real, and tied to something whose zero is not the same in both recordings. "
            "The diagnosis holds the phase from one recording to the next, so it does not name it."
        )
    else:
        verdict = "It does not hold there."
    return (
        f"After `{nominal}`'s findings, the strongest line over position in what remains of `{fitted}` has a "
        f"period of {2e3 * np.pi / order:.2f} mm and an amplitude of {size:.2g} N. Taking it away changes "
        f"the remaining energy by {100 * changes[0]:+.1f} % on `{fitted}`, to which it was fitted, and, held "
        f"as it is, by {100 * changes[1]:+.1f} % on `{scored}`. With phase and amplitude fitted anew there "
        f"it takes {100 * anew:.1f} %, more than {100 * less:.1f} % of {COMPARED} other periods would, at "
        f"{size_there:.2g} N and a phase that differs by {_turn(wave, again):.0f} degrees. {verdict}"
    )


def _taken(series: ChannelSeries, order: float) -> tuple[float, np.ndarray]:
    """Part of the remaining energy that a wave of this order takes when fitted to it, and the wave."""
    left, waves = _left(series), _waves(series, order)
    wave = np.linalg.lstsq(waves, left, rcond=None)[0]
    return 1.0 - float(np.sum((left - waves @ wave) ** 2) / np.sum(left**2)), wave


def _turn(one: np.ndarray, other: np.ndarray) -> float:
    """Angle between two waves given by cosine and sine parts [deg]."""
    product = complex(*one) * complex(*other).conjugate()
    return float(abs(np.degrees(np.angle(product))))


def _left(series: ChannelSeries) -> np.ndarray:
    return np.asarray(series.measured - series.augmented)


def _waves(series: ChannelSeries, order: float) -> np.ndarray:
    assert series.position is not None
    return np.column_stack([np.cos(order * series.position), np.sin(order * series.position)])


def _cutoff(series: ChannelSeries) -> float:
    """A quarter of the rate: series keep four samples per period of the filter's cut-off."""
    return 0.25 / float(np.median(np.diff(series.time)))
