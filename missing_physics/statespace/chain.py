"""One joint of one recording as a linear stochastic system, filtered and smoothed.

The equations are in `kernel.c`; where there is no compiler a NumPy twin gives the same numbers, more slowly.
"""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from missing_physics.statespace import twin
from reference_model.compiled import c_library

__all__ = ["MOST_LATENT", "Chain", "Gains", "Smoothed", "compiled_kernel"]

Array = NDArray[np.float64]

#: Latent forces that the kernel holds at most.
MOST_LATENT = 6


@dataclass(frozen=True)
class Gains:
    """What the filter needs of one set of noise levels.

    Attributes:
        gain: K, shape (N, m, 2 + L).
        variance: of the innovations, shape (N, m); 0 for rows without a measurement.
        latent: time constants of the latent forces [s], shape (L,).
        predicted: covariances before each sample, shape (N, 2 + L, 2 + L); None unless asked for.
    """

    gain: Array
    variance: Array
    latent: Array
    predicted: Array | None

    @property
    def log_determinant(self) -> float:
        """Sum of the logarithms of the innovations' variances."""
        return float(np.log(self.variance[self.variance > 0.0]).sum())


@dataclass(frozen=True)
class Smoothed:
    """Deviation of the joint and latent forces given the whole recording.

    Attributes:
        position, velocity: mean of the deviation, shape (N,) [rad or m, and per s].
        forces: means of the latent forces, shape (N, L) [N m or N].
        position_variance, velocity_variance: shape (N,).
        innovations: whitened, shape (N, m).
    """

    position: Array
    velocity: Array
    forces: Array
    position_variance: Array
    velocity_variance: Array
    innovations: Array


@dataclass(frozen=True)
class Chain:
    """The deterministic part: N samples of a joint's linear dynamics and of which rows measure it.

    Attributes:
        step: length of the step after each sample [s], shape (N,).
        mobility: 1 / inertia at each sample [1/(kg m^2) or 1/kg], shape (N,).
        stiffness, damping: over the inertia [1/s^2, 1/s], shape (N,).
        rows: 0 for a row that measures the position, 1 for one that measures the rate, shape (m,).
        start: variances of the first deviation of position and rate, shape (2,).
    """

    step: Array
    mobility: Array
    stiffness: Array
    damping: Array
    rows: NDArray[np.int32]
    start: Array

    def gains(
        self, force: Array, latent: Array, levels: Array, noise: Array, *, covariances: bool = False
    ) -> Gains:
        """Run the Riccati recursion.

        Args:
            force: variance of the white force over each step [(N m)^2 or N^2], shape (N,).
            latent: time constants of the latent forces [s], shape (L,).
            levels: their stationary variances [(N m)^2 or N^2], shape (L,).
            noise: variance of each row's measurement, negative where there is none, shape (N, m).
            covariances: keep the predicted covariances, which a smoother needs.
        """
        count, width, states = len(self.step), len(self.rows), 2 + len(latent)
        gain, variance = np.empty((count, width, states)), np.empty((count, width))
        kept = np.empty((count, states, states)) if covariances else None
        start = np.concatenate([self.start, levels])
        latent, levels = np.ascontiguousarray(latent, dtype=float), np.ascontiguousarray(levels, dtype=float)
        noise, force = np.ascontiguousarray(noise), np.ascontiguousarray(force)
        _engine("gains")(*self._system(latent), force, latent, levels, noise, start, gain, variance, kept)
        return Gains(gain, variance, latent, kept)

    def whitened(self, gains: Gains, force: Array | None, measured: Array | None) -> Array:
        """Innovations of C columns over their standard deviations, shape (N, m, C).

        Args:
            gains: of the noise levels.
            force: columns at the middle of the steps, shape (N, C); the last one acts on nothing.
            measured: columns of the rows less the reference motion, shape (N, m, C).
        """
        return self._run(gains, force, measured, None)

    def smoothed(self, gains: Gains, force: Array, measured: Array) -> Smoothed:
        """Mean and variance of the states given everything.

        Args:
            gains: with predicted covariances.
            force: at the middle of the steps, shape (N,).
            measured: shape (N, m).
        """
        assert gains.predicted is not None
        count, states = len(self.step), gains.gain.shape[2]
        predicted = np.empty((count, states))
        white = self._run(gains, force[:, None], measured[:, :, None], predicted)
        mean, variance = np.empty((count, states)), np.empty((count, states))
        _engine("smooth")(
            *self._system(gains.latent),
            *(gains.latent, gains.gain, gains.variance, white, gains.predicted, predicted, mean, variance),
        )
        return Smoothed(mean[:, 0], mean[:, 1], mean[:, 2:], variance[:, 0], variance[:, 1], white[:, :, 0])

    def _run(
        self, gains: Gains, force: Array | None, measured: Array | None, predicted: Array | None
    ) -> Array:
        given = force if force is not None else measured
        assert given is not None
        columns = given.shape[-1]
        force = None if force is None else np.ascontiguousarray(force)
        measured = None if measured is None else np.ascontiguousarray(measured)
        white = np.empty((len(self.step), len(self.rows), columns))
        system = self._system(gains.latent)
        _engine("whiten")(
            *system,
            *(gains.latent, gains.gain, gains.variance, force, measured, columns, white, predicted),
        )
        return white

    def _system(self, latent: Array) -> tuple[object, ...]:
        return (
            *(len(self.step), len(latent), len(self.rows), self.rows),
            *(self.step, self.mobility, self.stiffness, self.damping),
        )


def _engine(name: str) -> Callable[..., None]:
    library = compiled_kernel()
    if library is None:
        return getattr(twin, name)
    function = getattr(library, name)

    def call(*arguments: object) -> None:
        function(*map(_as_c, arguments))

    return call


@cache
def compiled_kernel() -> ctypes.CDLL | None:
    """The compiled kernel; None where there is no compiler, or where compiled code is switched off."""
    source = (Path(__file__).parent / "kernel.c").read_text(encoding="utf-8")
    try:
        library = ctypes.CDLL(str(c_library(source)))
    except (OSError, subprocess.SubprocessError):
        return None
    for name in ("gains", "whiten", "smooth"):
        getattr(library, name).restype = None
    return library


def _as_c(value: object) -> object:
    if value is None:
        return None
    if isinstance(value, np.ndarray):
        assert value.flags.c_contiguous
        return ctypes.c_void_p(value.ctypes.data)
    assert isinstance(value, int)
    return ctypes.c_long(value)
