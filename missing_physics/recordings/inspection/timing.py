"""Gaps, jitter and the clock itself."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from missing_physics.recordings.channels.estimates import smallest_step
from missing_physics.recordings.inspection.findings import Finding
from missing_physics.recordings.inspection.units import GAP
from robot_model import Recording

__all__ = ["timing_findings"]

#: Jitter that causes a note, and a warning, as a fraction of the usual step.
SOME_JITTER, MUCH_JITTER = 0.01, 0.2
#: Steps used to estimate the clock's resolution.
CLOCK_SAMPLES = 20_000
#: Fewest ticks of the clock per sample that do not spoil derivatives.
COARSE = 20
#: Change of the mean rate between the halves of a recording that is reported.
RATE_CHANGE = 0.02


def timing_findings(recording: Recording) -> tuple[Finding, ...]:
    """Findings of gaps, jitter, a coarse clock, a changing rate."""
    return tuple(_findings(recording))


def _findings(recording: Recording) -> Iterator[Finding]:
    steps = np.diff(recording.time)
    usual = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP * usual)
    if gaps.size:
        longest = gaps[np.argmax(steps[gaps])]
        yield Finding(
            "warning",
            "gap",
            "time",
            f"{gaps.size} gap{'s' if gaps.size > 1 else ''} in time, the longest {steps[longest]:.4g} s "
            f"after {recording.time[longest]:.6g} s.",
            {
                "count": float(gaps.size),
                "longest_s": float(steps[longest]),
                "at_s": float(recording.time[longest]),
            },
        )
    even = steps[steps <= GAP * usual]
    jitter = float(np.std(even)) / usual
    if jitter > SOME_JITTER:
        yield Finding(
            "warning" if jitter > MUCH_JITTER else "note",
            "jitter",
            "time",
            f"the sampling step varies by {100 * jitter:.1f} % ({1e3 * even.min():.3g} to "
            f"{1e3 * even.max():.3g} ms).",
            {"relative": jitter, "shortest_s": float(even.min()), "longest_s": float(even.max())},
        )
    yield from _clock(steps, usual)
    half = steps.size // 2
    first, second = float(np.median(steps[:half])), float(np.median(steps[half:]))
    if abs(second / first - 1) > RATE_CHANGE:
        yield Finding(
            "warning",
            "rate_change",
            "time",
            f"the usual sampling step changes from {1e3 * first:.4g} to {1e3 * second:.4g} ms "
            "within the recording.",
            {"first_s": first, "second_s": second},
        )


def _clock(steps: np.ndarray, usual: float) -> Iterator[Finding]:
    """Findings of stamps rounded to a coarse clock: their steps are small multiples of its tick."""
    tick = smallest_step(np.cumsum(steps[:CLOCK_SAMPLES]))
    distinct = np.unique(np.round(steps[:CLOCK_SAMPLES] / usual, 6)).size
    if tick and distinct > 1 and 1.5 < usual / tick < COARSE:
        yield Finding(
            "warning",
            "coarse_clock",
            "time",
            f"the time stamps are rounded to {1e3 * tick:.3g} ms, {usual / tick:.0f} ticks per sample; "
            "derivatives over time suffer from it.",
            {"tick_s": tick},
        )
