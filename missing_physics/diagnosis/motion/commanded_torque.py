"""The torque that actuators were commanded, without most of the noise of the sensor that told it.

What an actuator or a torque sensor does is driven by the torque itself. Taken as measured, its noise is in
the driven term and in the residual at once: a lag smooths it, so that a lag seems to be where there is none,
and one that is there comes out too long (errors in variables; Carroll, Ruppert, Stefanski, Crainiceanu,
Measurement Error in Nonlinear Models (2006), ch. 3). What the nominal robot predicts along the recorded
motion has none of that noise, but lacks what the robot's file lacks. Of that, what jumps is fitted first, as
its power reaches up to all frequencies: simple friction, and a gain and a lag of what is predicted. The rest
is combined as Wiener's filter does, frequency by frequency: of measured minus predicted, the part of the
power that is surely beyond the sensor's is believed. Without noise that is all of it, and the torque comes
out as measured.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idct

from missing_physics.diagnosis.motion.low_pass import LowPass

__all__ = ["quiet"]

Array = NDArray[np.float64]

#: Power is averaged over this part of the frequency to either side, and over so many coefficients at least,
#: twice as many and one altogether.
NEIGHBOURS = 1.0 / 6.0
FEWEST = 8
#: Power counts as beyond the sensor's from so many standard deviations of its mean on.
SURELY = 2.0


def quiet(
    measured: Array,
    predicted: Array,
    noise: Array,
    velocity: Array,
    transition: Array,
    low_pass: LowPass,
) -> Array:
    """Torques of n joints with the noise taken out as far as predictions can stand in, shape (N, n).

    Args:
        measured: torques on a uniform grid, shape (N, n) [N m or N]; NaN columns stay as they are.
        predicted: what a model without that noise says of them, shape (N, n).
        noise: standard deviation of the measured torques' white noise per sample, shape (n,).
        velocity: of the joints, shape (N, n) [rad/s or m/s].
        transition: speed below which the sign of a velocity is not known, shape (n,).
        low_pass: below its cut-off torques are compared.
    """
    result = measured.copy()
    for index, sigma in enumerate(noise):
        unexplained = measured[:, index] - predicted[:, index]
        if sigma > 0.0 and np.isfinite(unexplained).all():
            shape = _simple(predicted[:, index], velocity[:, index], transition[index], low_pass)
            simple = shape @ np.linalg.lstsq(shape, unexplained, rcond=1e-10)[0]
            rest = _believed(unexplained - simple, float(sigma))
            result[:, index] = predicted[:, index] + simple + rest
    return result


def _simple(predicted: Array, velocity: Array, transition: float, low_pass: LowPass) -> Array:
    """What simple friction and simple actuators would add to what is predicted, shape (N, k)."""
    smooth = low_pass.smooth(predicted)
    once = np.gradient(smooth) * low_pass.rate
    twice = np.gradient(once) * low_pass.rate
    friction = (np.ones(velocity.size), np.tanh(velocity / transition), velocity, np.abs(velocity))
    shape = np.column_stack([*friction, smooth, once, twice])
    return np.asarray(shape / np.maximum(np.abs(shape).max(axis=0), np.finfo(float).tiny))


def _believed(series: Array, sigma: float) -> Array:
    """What of a series is beyond white noise of standard deviation `sigma`."""
    # A cosine transform continues the series evenly at its ends, where a Fourier transform would jump.
    coefficients = dct(series, norm="ortho")
    power, count = _averaged(coefficients**2)
    # The mean of squares of so many coefficients of noise is as large as this by chance.
    chance = sigma**2 * (1.0 + SURELY * np.sqrt(2.0 / count))
    part = 1.0 - np.minimum(chance / np.maximum(power, np.finfo(float).tiny), 1.0)
    return np.asarray(idct(part * coefficients, norm="ortho"))


def _averaged(power: Array) -> tuple[Array, NDArray[np.int_]]:
    """Mean of the neighbours of each coefficient, and their number."""
    place = np.arange(power.size)
    reach = np.maximum(FEWEST, (NEIGHBOURS * place).astype(int))
    first, last = np.maximum(place - reach, 0), np.minimum(place + reach + 1, power.size)
    sums = np.concatenate([[0.0], np.cumsum(power)])
    count = last - first
    return np.asarray((sums[last] - sums[first]) / count), count
