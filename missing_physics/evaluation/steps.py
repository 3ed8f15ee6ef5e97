"""What the samples and the steps of a recorded torque leave unknown of it, beyond white noise.

A recorded torque is exact in a band far below the sampling rate if it is smooth between samples, and if its
rounding errors are independent. Neither holds everywhere:

- A torque that changes by D at an unknown instant within a sample time h, as where a friction compensation
  turns, has the impulse h D (u - 1/2) beyond that of a straight line, u uniform: standard deviation
  h D / sqrt(12), and 2 f h D / sqrt(12) at its peak in a band that ends at f.
- A torque that stays on one step d within the memory 1 / (2 f) of the band is rounded alike throughout, with
  the variance d^2 / 12. Over N steps the error is a sawtooth of frequency 2 N f, of which the filter leaves
  the less the more there are, here one part in (1 + N)^2, as N is known to one step only. Noise before
  rounding takes that away (Widrow and Kollar, Quantization Noise (2008), ch. 4).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d

__all__ = ["steps_left", "unsteadiness"]

Array = NDArray[np.float64]

#: With noise above this part of the step the first terms of the sawtooth's Fourier series are exact to
#: 1e-9; below it the noise does not change the mean.
DITHER, TERMS = 0.1, 10
#: Variance of a change less the mean of its neighbours, of white noise of variance one.
OF_NOISE = 5.0


def steps_left(noise: float, step: float) -> float:
    """rms by which a sensor's mean reading differs from the true value, over all true values.

    The error of rounding is a sawtooth; Gaussian noise multiplies its k-th harmonic by
    exp(-2 (pi k noise / step)^2).
    """
    if step <= 0.0:
        return 0.0
    if noise < DITHER * step:
        return float(step / np.sqrt(12.0))
    k = np.arange(1, TERMS + 1)
    parts = np.exp(-2.0 * (np.pi * k * noise / step) ** 2) / (np.pi * k)
    return float(step * np.sqrt(0.5 * np.sum(parts**2)))


def unsteadiness(
    torque: Array, noise: Array, steps: Array, *, rate: float, cutoff: float, smoothing: float
) -> tuple[Array, Array]:
    """Standard deviations in the band of what is unknown beyond white noise [N m or N].

    That of jumps is an upper bound: a recorded torque may be the mean over a sample.

    Args:
        torque: recorded samples, shape (N, n); columns with NaN have none.
        noise: of each sample, rounding included, shape (n,).
        steps: in which each torque is recorded, 0 where not known, shape (n,).
        rate: samples per second [Hz].
        cutoff: end of the band [Hz].
        smoothing: end of the filter that precedes it [Hz].

    Returns:
        Of jumps and of rounding, shape (N, n) each.
    """
    known = np.where(np.isfinite(torque), torque, 0.0)
    change = np.diff(known, axis=0)
    around = np.pad(change, ((1, 1), (0, 0)), mode="edge")
    beyond = change - 0.5 * (around[:-2] + around[2:])
    square = beyond**2 - OF_NOISE * noise**2
    near = 2 * int(np.ceil(rate / smoothing)) + 1  # where the filter carries it
    mean = uniform_filter1d(np.vstack([square, square[-1:]]), near, axis=0, mode="nearest")
    jumps = (2.0 * cutoff / rate) ** 2 * near * np.maximum(mean, 0.0) / 12.0
    rounding = np.zeros_like(jumps)
    memory = 2 * int(np.ceil(0.25 * rate / cutoff)) + 1
    for k in np.flatnonzero(steps > 0.0):
        before = np.sqrt(max(noise[k] ** 2 - steps[k] ** 2 / 12.0, 0.0))
        travel = maximum_filter1d(known[:, k], memory) - minimum_filter1d(known[:, k], memory)
        rounding[:, k] = steps_left(float(before), float(steps[k])) ** 2 / (1.0 + travel / steps[k]) ** 2
    return np.sqrt(jumps), np.sqrt(rounding)
