"""Is there a ripple along the screw? What one recording shows, held against the other."""

from __future__ import annotations

import numpy as np

from missing_physics.diagnosis import Result
from missing_physics.diagnosis.locate import spatial_peaks
from missing_physics.diagnosis.result import ChannelSeries

__all__ = ["ripple"]

CHANNEL = "joint1.torque"


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
    again = np.linalg.lstsq(_waves(other, order), _left(other), rcond=None)[0]
    anew = float(np.sum((_left(other) - _waves(other, order) @ again) ** 2) / np.sum(_left(other) ** 2)) - 1
    verdict = "it holds there" if changes[1] < 0.5 * changes[0] else "as it is, it does not hold there"
    return (
        f"After `{nominal}`'s findings, the strongest line over position in what remains of `{fitted}` has "
        f"a period of {2e3 * np.pi / order:.2f} mm and an amplitude of {float(np.hypot(*wave)):.2g} N. "
        f"Taking it away changes the remaining energy by {100 * changes[0]:+.1f} % on `{fitted}`, to which "
        f"it was fitted, and, held as it is, by {100 * changes[1]:+.1f} % on `{scored}`: {verdict}. With "
        f"phase and amplitude fitted anew on `{scored}` it takes {-100 * anew:.1f} % there, at "
        f"{float(np.hypot(*again)):.2g} N and a phase that differs by {_turn(wave, again):.0f} degrees."
    )


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
