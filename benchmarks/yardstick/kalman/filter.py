"""Steady-state Kalman filter of one joint whose motion deviates from a smoothed one.

With the deviation d of the position from the smoothed position, the mean inertia J and the part u of the
recorded torque that a model leaves unexplained,

    J d'' = u - f_1 - f_2 - f_3 - w,    y = d + v,

where y is recorded minus smoothed position, w and v are white, and the forces f_i are Ornstein-Uhlenbeck
processes with time constants a decade apart. All noise levels are estimated by maximum likelihood.
Innovations are linear in u and y, so those of a regression's columns follow by the same gains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are
from scipy.optimize import minimize
from scipy.signal import lfilter

__all__ = ["TIMES", "Filter", "Levels", "levels_of", "log_likelihood"]

Array = NDArray[np.float64]

#: Time constants of the unknown forces [s].
TIMES = (1.0, 0.1, 0.01)
#: Range of a level relative to its starting value [nats]; at the lower end it has no influence.
LOWEST, HIGHEST = -14.0, 7.0
#: Evaluations of the likelihood in one estimate of the levels.
EVALUATIONS = 400


@dataclass(frozen=True)
class Levels:
    """Standard deviations of the noise.

    Attributes:
        encoder: density of white position noise [rad s^0.5 or m s^0.5]; its deviation per sample is this over
            the root of the sample time.
        torque: density of white torque noise [N m s^0.5 or N s^0.5].
        forces: standard deviations of the unknown forces, shape (3,) [N m or N].
    """

    encoder: float
    torque: float
    forces: Array


class Filter:
    """The filter for given levels.

    Args:
        levels: of the noise.
        inertia: J [kg m^2 or kg].
        step: time between samples [s].
    """

    def __init__(self, levels: Levels, inertia: float, step: float) -> None:
        # Units: a sample of time, the encoder's noise for positions, F with F step^2 / J = that noise.
        encoder, torque = levels.encoder / np.sqrt(step), levels.torque / np.sqrt(step)
        unit = encoder * inertia / step**2
        count = 2 + len(TIMES)
        rates = np.array([step / time for time in TIMES])
        rate = np.zeros((count + 1, count + 1))
        rate[0, 1] = 1.0
        rate[1, 2:count] = -1.0
        rate[2:count, 2:count] = -np.diag(rates)
        rate[1, count] = 1.0  # the input, held over a sample
        whole = expm(rate)
        self._move, force = whole[:count, :count], whole[:count, count]
        self._force = force / unit
        noise = np.outer(force, force) * (torque / unit) ** 2
        noise += _integrated(rate[:count, :count], np.r_[0.0, 0.0, 2.0 * rates * (levels.forces / unit) ** 2])
        see = np.zeros((1, count))
        see[0, 0] = 1.0
        spread = solve_discrete_are(self._move.T, see.T, noise, np.ones((1, 1)))
        self.deviation = float(np.sqrt(spread[0, 0] + 1.0)) * encoder
        gain = self._move @ spread[:, 0] / (spread[0, 0] + 1.0)
        self._gain, self._see = gain / encoder, encoder
        loop = self._move - np.outer(gain, see[0])
        self.poles, self._modes = np.linalg.eig(loop)
        self._into = np.linalg.inv(self._modes)

    def innovations(self, forces: Array, positions: Array) -> Array:
        """Innovations of the position [rad or m], shape (N, P); the filter starts at rest.

        Args:
            forces: u, shape (N, P).
            positions: y, shape (N, P).
        """
        mean = 0.5 * (forces[1:] + forces[:-1])
        driven = np.zeros((len(forces), forces.shape[1], self.poles.size), dtype=complex)
        driven[1:] = mean[:, :, None] * (self._into @ self._force)
        driven[1:] += positions[:-1, :, None] * (self._into @ self._gain)
        predicted = np.zeros(forces.shape)
        for k, pole in enumerate(self.poles):
            mode = lfilter([1.0], [1.0, -pole], driven[:, :, k], axis=0)
            predicted += (self._modes[0, k] * mode).real
        return np.asarray(positions - self._see * predicted)


def _integrated(rate: Array, density: Array) -> Array:
    """Covariance after one sample of white noise with these densities (Van Loan 1978)."""
    n = len(rate)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:], block[n:, n:] = -rate, np.diag(density), rate.T
    found = expm(block)
    own = found[n:, n:].T @ found[:n, n:]
    return np.asarray(0.5 * (own + own.T))


def log_likelihood(innovations: Array, deviation: float, counted: NDArray[np.bool_]) -> float:
    """Gaussian log likelihood of one series of innovations, up to a constant."""
    own = innovations[counted] / deviation
    return float(-0.5 * np.sum(own**2) - own.size * np.log(deviation))


def levels_of(
    series: list[tuple[Array, Array, NDArray[np.bool_], float]], inertia: float, start: Levels
) -> Levels:
    """Levels of maximum likelihood.

    Args:
        series: of each recording u, y and the samples that count, shape (N,) each, and the step.
        inertia: see `Filter`.
        start: where the search begins.
    """
    first = np.log(np.r_[start.encoder, start.torque, start.forces])

    def levels(x: Array) -> Levels:
        values = np.exp(first + np.clip(x, LOWEST, HIGHEST))
        return Levels(float(values[0]), float(values[1]), values[2:])

    def cost(x: Array) -> float:
        own, total = levels(x), 0.0
        try:
            filters = {step: Filter(own, inertia, step) for *_, step in series}
        except (np.linalg.LinAlgError, ValueError):  # no steady state can be computed there
            return np.inf
        with np.errstate(over="ignore", invalid="ignore"):
            for force, position, counted, step in series:
                found = filters[step].innovations(force[:, None], position[:, None])[:, 0]
                total -= log_likelihood(found, filters[step].deviation, counted)
        return total if np.isfinite(total) else np.inf

    simplex = np.vstack([np.zeros(first.size), np.diag(np.full(first.size, -2.0))])
    options = {"maxfev": EVALUATIONS, "initial_simplex": simplex, "xatol": 0.05, "fatol": 0.1}
    return levels(minimize(cost, simplex[0], method="Nelder-Mead", options=options).x)
