"""Errors of a recorded torque due to sampling and quantisation, beyond white noise.

A recorded torque is exact in a band far below the sampling rate if it is smooth between samples, and if its
rounding errors are independent. Neither holds everywhere:

- A torque that jumps by D at an unknown instant within a sampling time h, as when a friction compensation
  reverses, differs from a straight line by the impulse h D (u - 1/2), u uniform: standard deviation
  h D / sqrt(12), and 2 f h D / sqrt(12) at its peak in a band that ends at f.
- A torque that stays within one quantisation step d over the memory 1 / (2 f) of the band has a constant
  rounding error, with variance d^2 / 12. Over N steps the error is a sawtooth of frequency 2 N f, whose
  variance the filter reduces by about (1 + N)^2, as N is known to one step only. Noise before rounding
  removes this error (Widrow and Kollar, Quantization Noise (2008), ch. 4).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d

__all__ = ["mean_rounding_error", "unsteadiness"]

Array = NDArray[np.float64]

#: With noise above this fraction of the step the first terms of the sawtooth's Fourier series are exact to
#: 1e-9; below it the noise does not change the mean.
DITHER, TERMS = 0.1, 10
#: Variance of a change minus the mean of its neighbours, for white noise of variance one.
OF_NOISE = 5.0


def mean_rounding_error(noise: float, step: float) -> float:
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
    """Standard deviations in the band of errors beyond white noise [N m or N].

    The one of jumps is an upper bound: a recorded torque may be the mean over a sampling time.

    Args:
        torque: recorded samples, shape (N, n); columns with NaN have none.
        noise: of each sample, including rounding, shape (n,).
        steps: resolution of each torque, 0 if not known, shape (n,).
        rate: samples per second [Hz].
        cutoff: end of the band [Hz].
        smoothing: cut-off of the preceding filter [Hz].

    Returns:
        Standard deviations due to jumps and due to rounding, shape (N, n) each.
    """
    known = np.where(np.isfinite(torque), torque, 0.0)
    change = np.diff(known, axis=0)
    around = np.pad(change, ((1, 1), (0, 0)), mode="edge")
    beyond = change - 0.5 * (around[:-2] + around[2:])
    square = beyond**2 - OF_NOISE * noise**2
    near = 2 * int(np.ceil(rate / smoothing)) + 1  # the reach of the filter
    mean = uniform_filter1d(np.vstack([square, square[-1:]]), near, axis=0, mode="nearest")
    jumps = (2.0 * cutoff / rate) ** 2 * near * np.maximum(mean, 0.0) / 12.0
    rounding = np.zeros_like(jumps)
    memory = 2 * int(np.ceil(0.25 * rate / cutoff)) + 1
    for k in np.flatnonzero(steps > 0.0):
        before = np.sqrt(max(noise[k] ** 2 - steps[k] ** 2 / 12.0, 0.0))
        travel = maximum_filter1d(known[:, k], memory) - minimum_filter1d(known[:, k], memory)
        rounding[:, k] = (
            mean_rounding_error(float(before), float(steps[k])) ** 2 / (1.0 + travel / steps[k]) ** 2
        )
    return np.sqrt(jumps), np.sqrt(rounding)
