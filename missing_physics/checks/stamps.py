"""Late time stamps: samples taken by an even clock but stamped when they were received.

A computer without a real-time system often stamps samples when it reads them, while the drive took them
evenly, perhaps at a drifting rate. Wrong times of a fast motion are position errors, and bursts of them look
like pushes. The positions reveal the right clock: at the right times they are smooth.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from robot_model import Recording

__all__ = ["on_even_clock"]

Array = NDArray[np.float64]

#: Scatter of the steps between stamps, as a fraction of a step, below which it is ignored: positions of a
#: motion of f cycles per step err by 2 pi f times this fraction of their amplitude.
SCATTER = 1e-3
#: Numbers of samples over which a clock is taken as even, in addition to all samples.
EVEN = (31, 101, 301, 1001, 3001)
#: Quantities of a recording that an encoder counts.
ENCODERS = ("position", "motor_position")
#: Consecutive samples to which a parabola is fitted: the fewest that leave an error.
ROW = 4


def on_even_clock(recording: Recording) -> tuple[Recording, str]:
    """The recording on an even clock if its positions are more probable there than at its stamps.

    No sample may be missing: clocks are straight lines through all stamps, or through some consecutive ones
    around each. Errors of parabolas through neighbouring positions are Gaussian with an unknown level for
    each encoder. A clock's log-likelihood must exceed that of the stamps by the logarithm of the number of
    samples (Schwarz 1978). Among equally probable clocks the most even one is chosen, since crystals are
    steady.

    Args:
        recording: any.

    Returns:
        The recording, and a sentence if its clock was replaced, else an empty string.
    """
    time = recording.time
    if time.size < 2 * ROW:
        return recording, ""
    steps = np.diff(time)
    if float(np.std(steps)) <= SCATTER * float(np.median(steps)):
        return recording, ""
    clocks = list(_clocks(time))
    gains = [sum(_gain(recording[c], time, clock) for c in _encoders(recording)) for clock in clocks]
    needed = float(np.log(time.size))
    if max(gains) <= needed:
        return recording, ""
    best = max(i for i, gain in enumerate(gains) if gain >= max(gains) - needed)
    apart = time - clocks[best]
    words = (
        f"{recording.source or 'The recording'}: its time stamps scatter by {float(np.std(apart)):.2g} s (at "
        f"most {float(np.abs(apart).max()):.2g} s) about an even clock, on which its positions are smoother; "
        "that clock was used."
    )
    return replace(recording, time=clocks[best]), words


def _clocks(time: Array) -> Iterator[Array]:
    """Increasing clocks that are even over some samples, over more, and throughout."""
    count = np.arange(time.size, dtype=float)
    slope, first = np.polyfit(count, time, 1)
    line = first + slope * count
    for width in EVEN:
        if width < time.size:
            clock = line + savgol_filter(time - line, width, 1)
            if np.diff(clock).min() > 0.0:
                yield clock
    yield line


def _encoders(recording: Recording) -> Iterator[str]:
    """Position channels without missing values that move."""
    for channel, values in recording.channels.items():
        if channel.rpartition(".")[2] in ENCODERS and np.all(np.isfinite(values)) and np.ptp(values) > 0.0:
            yield channel


def _gain(position: Array, stamps: Array, even: Array) -> float:
    """Log likelihood of positions on an even clock over that at their stamps [nats]."""
    errors = [float(np.mean(_unexplained(time, position) ** 2)) for time in (stamps, even)]
    if min(errors) <= 0.0:  # the joint moved by few steps of its encoder
        return 0.0
    return 0.5 * position.size / ROW * float(np.log(errors[0] / errors[1]))


def _unexplained(time: Array, position: Array) -> Array:
    """Errors of parabolas through neighbours, in units of the error of a position, shape (N - 3,)."""
    rows = np.lib.stride_tricks.sliding_window_view(time, ROW)
    apart = rows[:, :, None] - rows[:, None, :]
    apart[:, np.arange(ROW), np.arange(ROW)] = 1.0
    weight = 1.0 / np.prod(apart, axis=2)
    weight /= np.linalg.norm(weight, axis=1, keepdims=True)
    return np.asarray(np.sum(weight * np.lib.stride_tricks.sliding_window_view(position, ROW), axis=1))
