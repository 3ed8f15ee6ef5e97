"""Further channels as measurements of the correction of a robot's motion (`modal/smoother.py`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from missing_physics.diagnosis.dynamics.channels import seen
from missing_physics.diagnosis.dynamics.inverse import MotionDynamics
from missing_physics.diagnosis.modal.state import Sight

__all__ = ["drawn_gap", "modal_sight"]

Array = NDArray[np.float64]

#: Part of a channel's rms below which what the linearised model foretells of it is not trusted.
ACCURACY = 1e-6
#: Fewest samples of a channel that is looked at.
FEWEST = 50


def modal_sight(dynamics: MotionDynamics) -> Sight | None:
    """The channels of `dynamics.motion` that see the correction beside the encoders; None without any."""
    found = [one for one in seen(dynamics) if np.isfinite(one.recorded).sum() >= FEWEST]
    found = [one for one in found if np.nan_to_num(one.recorded).any()]
    if not found:
        return None
    inner, response = dynamics.inner, dynamics.motion_response
    recorded = np.column_stack([one.recorded for one in found])
    foretold = np.column_stack([one.foretold for one in found])
    level = np.sqrt(np.nanmean(recorded**2, axis=0))
    count, g = len(recorded), response.inertia.shape[1]
    load = np.zeros(0) if inner is None else np.sqrt(np.mean((inner.modal @ response.stiffness) ** 2, axis=0))
    return Sight(
        rows=_stacked([one.rows for one in found], (count, 2 * g)),
        foretold=foretold,
        gap=recorded - foretold,
        noise=np.hypot(np.nan_to_num([one.noise for one in found]), ACCURACY * level),
        level=level,
        load=load,
        guessed=np.array([one.guessed for one in found]),
        kinds=tuple(one.kind for one in found),
        channels=tuple(one.channel for one in found),
        pull=_stacked([one.pull for one in found], (count, g))
        if any(one.pull is not None for one in found)
        else None,
        turn=next((one.turn for one in found if one.turn is not None), None),
        axes=np.array([one.axis for one in found]),
    )


def _stacked(parts: list[Array | None], shape: tuple[int, int]) -> Array:
    return np.stack([np.zeros(shape) if part is None else part for part in parts], axis=1)


def drawn_gap(
    dynamics: MotionDynamics, sight: Sight, errors: tuple[Array, Array, Array], chance: np.random.Generator
) -> Array:
    """What noise of the channels and of the joints' motion makes of the gaps, shape (N, p).

    Args:
        dynamics: along the motion.
        sight: its channels.
        errors: of position, velocity and acceleration, shape (N, n) each.
        chance: of the channels' noise.
    """
    response = dynamics.motion_response
    ringing, n = response.ringing(errors[2]), response.joints
    s = response.modes
    moved = np.hstack([errors[0], ringing[:, :s], errors[1], ringing[:, s:]])
    made = chance.standard_normal(sight.gap.shape) * sight.noise
    made -= np.einsum("tij,tj->ti", sight.rows, moved)
    if sight.pull is not None:
        own = response.inertia[response.pose]
        pushed = np.einsum("tij,tj->ti", own[:, n:, :n], errors[2]) + ringing @ response.elastic.T
        shaken = -np.linalg.solve(own[:, n:, n:], pushed[:, :, None])[:, :, 0]
        made -= np.einsum("tij,tj->ti", sight.pull, np.hstack([errors[2], shaken]))
    if sight.turn is not None and sight.axes is not None:
        rate = np.einsum("tij,tj->ti", sight.turn[response.pose], moved)
        angle = cumulative_trapezoid(rate, dx=response.step, axis=0, initial=0.0)
        telling = np.flatnonzero(sight.axes >= 0)
        made[:, telling] -= angle[:, sight.axes[telling]]
    return np.where(np.isfinite(sight.gap), made, 0.0)
