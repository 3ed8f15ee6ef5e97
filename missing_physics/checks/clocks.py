"""Channels of one recording brought onto one uniform clock, that of the fastest core channel.

A channel with a separate clock has values at every second or fewer instants, evenly except for gaps. It is
interpolated by a cubic spline, whose frequency response is one to within 1e-4 up to 0.08 of the channel's
rate (Unser, IEEE Signal Processing Magazine 16 (1999), no. 6); nothing is compared above. White noise of
standard
deviation s keeps its density: per sample of a clock r times as fast it is s sqrt(r).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.checks.stretches import LONGEST_GAP, longest_stretch, missing_words, stretch_words
from missing_physics.recordings import sample_time_of
from robot_model import InputError, Recording

__all__ = ["FEWEST_SAMPLES", "Clock"]

Array = NDArray[np.float64]

#: Fewest samples a diagnosis accepts.
FEWEST_SAMPLES = 50
#: Relative jitter of the sample time above which the series are resampled.
JITTER = 1e-3
#: Largest spacing of samples of a slower clock, relative to the usual one.
EVEN = 1.5


@dataclass(frozen=True)
class Clock:
    """Uniform instants, and the sample times of slower channels.

    Attributes:
        recording: whose channels are read.
        time: [s], shape (N,).
        own: sample time [s] of the core channels that have a separate clock.
        left_out: which part of the recording is not used and why, as a clause; empty if all is used.
    """

    recording: Recording
    time: Array
    own: dict[str, float]
    left_out: str = ""

    @classmethod
    def of(cls, recording: Recording, channels: Sequence[str]) -> Clock:
        """The fastest clock of the core `channels`, over the longest part without a long gap in any of them.

        Raises:
            InputError: a channel is empty, or too few samples.
        """
        name, time = recording.source or "the recording", recording.time
        given = {channel: np.isfinite(recording[channel]) for channel in channels}
        for channel, good in given.items():
            if not good.any():
                raise InputError(f"{name}: {channel} holds no number.")
        own = {channel: period for channel, good in given.items() if (period := sample_time_of(time, good))}
        present = {c: _covered(time, good, own[c]) if c in own else good for c, good in given.items()}
        fastest = max(given.values(), key=np.count_nonzero)
        held = time[np.all([*present.values(), fastest], axis=0)]
        if held.size < FEWEST_SAMPLES:
            raise InputError(
                f"{name} has {held.size} sample{'' if held.size == 1 else 's'}"
                f"{missing_words(present)}; a diagnosis needs at least {FEWEST_SAMPLES}."
            )
        used = held[longest_stretch(held)]
        if used.size < FEWEST_SAMPLES:
            raise InputError(
                f"{name} is cut by gaps into parts of at most {used.size} samples{missing_words(present)}; "
                f"a diagnosis needs {FEWEST_SAMPLES} in a row."
            )
        count = round((used[-1] - used[0]) / float(np.median(np.diff(held)))) + 1
        grid = np.asarray(np.linspace(used[0], used[-1], count))
        return cls(recording, grid, own, stretch_words(time, present, used))

    @property
    def rate(self) -> float:
        """Samples per second."""
        return float(1.0 / (self.time[1] - self.time[0]))

    def slowest(self, channels: Iterable[str]) -> float:
        """Lowest rate at which any of `channels` was sampled [Hz]."""
        return min([self.rate, *(1.0 / self.own[channel] for channel in channels if channel in self.own)])

    def spread(self, channel: str) -> float:
        """Factor on the noise per sample of `channel` that preserves its spectral density."""
        return float(np.sqrt(self.rate / self.slowest([channel])))

    def values(self, channel: str, *, absent: float | None = None) -> Array:
        """`channel` at `time`, shape (N,).

        Args:
            absent: value for a channel that has too few numbers; None to refuse it.
        """
        recording, time = self.recording, self.time
        if channel not in recording and absent is not None:
            return np.full(time.size, absent)
        values = recording[channel]
        good = np.isfinite(values)
        if good.sum() < FEWEST_SAMPLES:
            if absent is not None:
                return np.full(time.size, absent)
            raise InputError(
                f"{recording.source or 'the recording'}: {channel} holds {int(good.sum())} numbers; "
                f"a diagnosis needs at least {FEWEST_SAMPLES}."
            )
        source = recording.time
        if (
            good.all()
            and source.size == time.size
            and np.allclose(source, time, rtol=0, atol=JITTER * (time[1] - time[0]))
        ):
            return np.array(values)
        steps = np.diff(source[good])
        even = good.mean() < 0.5 and steps.max() < EVEN * np.median(steps)
        if channel in self.own or even:  # a slower clock: linear interpolation would be coarse
            inside = np.clip(time, source[good][0], source[good][-1])
            return np.asarray(make_interp_spline(source[good], values[good], k=3)(inside))
        return np.asarray(np.interp(time, source[good], values[good]))


def _covered(time: Array, good: NDArray[np.bool_], period: float) -> NDArray[np.bool_]:
    """Mask of the instants between values of a channel without a gap relative to its sampling time."""
    given = time[good]
    after = np.searchsorted(given, time, side="right")
    inside = (after > 0) & (after < given.size)
    at = np.clip(after, 1, given.size - 1)
    near = given[at] - given[at - 1] <= LONGEST_GAP * period
    return np.asarray(good | (inside & near))
