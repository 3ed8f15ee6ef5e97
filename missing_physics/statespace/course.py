"""The reference motion about which everything is linear: the joints' motion given what was recorded.

The first one knows no dynamics: each joint's acceleration is a random process whose level and memory are
those under which the recorded positions are most likely. Later ones come from the smoother of the fitted
model, so that a reversal is as sharp as the model's friction makes it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from missing_physics.statespace.chain import Chain, Gains
from missing_physics.statespace.signals import Signals

__all__ = ["Course", "first_course"]

Array = NDArray[np.float64]

#: Memories of an acceleration [s] between which the likelihood chooses: from a shaken motor to a slow arm.
SHORTEST, USUAL, LONGEST = 2e-3, 0.03, 0.5
#: Standard deviation of the prior of log memory and of log noise over that stated.
SPREAD = 2.0
#: The one row measures the position.
POSITION = np.array([0], dtype=np.int32)
#: Samples on which the two numbers of the first course are estimated.
MOST_SAMPLES = 4000


@dataclass(frozen=True)
class Course:
    """Motion of n joints at N samples.

    Attributes:
        time: [s], shape (N,).
        position, velocity, acceleration: shape (N, n) [rad or m, and per s, s^2].
        spread: standard deviation of the velocity given everything, shape (N, n).
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    spread: Array

    @property
    def mean_acceleration(self) -> Array:
        """Change of the velocity over each step by its length, shape (N, n); the last one is repeated."""
        change = np.diff(self.velocity, axis=0) / np.diff(self.time)[:, None]
        return np.vstack([change, change[-1:]])


def first_course(signals: Signals) -> Course:
    """The motion that the recorded positions show by themselves."""
    columns = [_smoothed(signals, joint) for joint in range(signals.position.shape[1])]
    return Course(signals.time, *(np.column_stack(part) for part in zip(*columns)))


def _smoothed(signals: Signals, joint: int) -> tuple[Array, Array, Array, Array]:
    """Position, velocity, acceleration and the velocity's standard deviation of one joint, (N,) each."""
    measured = signals.position[:, joint]
    middle, time = float(measured.mean()), signals.time
    values = (measured - middle)[:, None]
    noise = signals.position_noise[joint] ** 2 + 1e-300
    rate = np.gradient(measured, time)
    start = np.array([noise + measured.var() + 1e-300, 10.0 * rate.std() ** 2 + 1e-300])
    usual = 2.0 * np.log(np.gradient(rate, time).std() + 1e-12)

    def chain_of(count: int) -> Chain:
        none = np.zeros(count)
        return Chain(np.full(count, signals.step), np.ones(count), none, none, POSITION, start)

    def gains_of(chain: Chain, logs: Array, *, covariances: bool = False) -> Gains:
        memory, level, more = np.exp(np.clip(logs, -60.0, 60.0))
        count = len(chain.step)
        latent, power, noises = np.array([memory]), np.array([level]), np.full((count, 1), more * noise)
        return chain.gains(np.zeros(count), latent, power, noises, covariances=covariances)

    begin = max(0, (measured.size - MOST_SAMPLES) // 2)
    some = values[begin : begin + MOST_SAMPLES]
    chain = chain_of(len(some))

    def cost(logs: Array) -> float:
        gains = gains_of(chain, logs)
        white = chain.whitened(gains, None, some[:, :, None])
        prior = ((logs[0] - np.log(USUAL)) ** 2 + logs[2] ** 2) / (2.0 * SPREAD**2)
        return 0.5 * (float(np.sum(white**2)) + gains.log_determinant) + float(prior)

    bounds = [(np.log(SHORTEST), np.log(LONGEST)), (usual - 16.0, usual + 4.0), (-3.0, 5.0)]
    first = np.array([np.log(USUAL), usual, 0.0])
    best = minimize(cost, first, method="L-BFGS-B", bounds=bounds, options={"maxiter": 25}).x
    whole = chain_of(measured.size)
    gains = gains_of(whole, best, covariances=True)
    found = whole.smoothed(gains, np.zeros(measured.size), values)
    over = found.forces[:, 0]  # the mean over the step after each sample
    at = np.concatenate([over[:1], 0.5 * (over[:-1] + over[1:])])
    return found.position + middle, found.velocity, at, np.sqrt(found.velocity_variance)
