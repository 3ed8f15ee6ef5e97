"""What further channels see of the correction of a robot's motion (`modal_smoother`).

Strain and deflection of a link are what its modes make of them; a gyro on a free base sees how joints and
links move by momentum (`MotionDynamics.base_rows`). All are linear in the small correction about the
reconstructed motion.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.diagnosis.base_rates import GYRO
from missing_physics.diagnosis.dynamics import MotionDynamics
from missing_physics.diagnosis.modal_state import Sight

__all__ = ["drawn_gap", "modal_sight"]

Array = NDArray[np.float64]

#: Part of a channel's rms below which what the linearised model foretells of it is not trusted.
ACCURACY = 1e-5
#: Fewest samples of a channel that is looked at.
FEWEST = 50


@dataclass(frozen=True)
class _Seen:
    """One channel: what is foretold of it, shape (N,), and its rows of `Sight`, shape (N, 2 g)."""

    channel: str
    kind: str
    foretold: Array
    rows: Array


def modal_sight(dynamics: MotionDynamics) -> Sight | None:
    """The channels of `dynamics.motion` that see its flexible links' modes; None without any."""
    motion, inner = dynamics.motion, dynamics.inner
    if inner is None:
        return None
    found = [
        seen
        for seen in _seen(dynamics)
        if motion.there(seen.channel).sum() >= FEWEST and motion.others[seen.channel].any()
    ]
    if not found:
        return None
    there = np.column_stack([motion.there(seen.channel) for seen in found])
    recorded = np.column_stack([motion.others[seen.channel] for seen in found])
    foretold = np.column_stack([seen.foretold for seen in found])
    level = np.sqrt(np.nanmean(np.where(there, recorded, np.nan) ** 2, axis=0))
    noise = np.nan_to_num([motion.noise.get(seen.channel, 0.0) for seen in found])
    return Sight(
        rows=np.stack([seen.rows for seen in found], axis=1),
        foretold=foretold,
        gap=np.where(there, recorded - foretold, np.nan),
        noise=np.hypot(noise, ACCURACY * level),
        level=level,
        load=np.sqrt(np.mean((inner.modal @ dynamics.motion_response.stiffness) ** 2, axis=0)),
        guessed=np.array([seen.channel in motion.guessed for seen in found]),
        kinds=tuple(seen.kind for seen in found),
    )


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
    ringing = dynamics.motion_response.ringing(errors[2])
    s = ringing.shape[1] // 2
    moved = np.hstack([errors[0], ringing[:, :s], errors[1], ringing[:, s:]])
    made = chance.standard_normal(sight.gap.shape) * sight.noise
    made -= np.einsum("tij,tj->ti", sight.rows, moved)
    return np.where(np.isfinite(sight.gap), made, 0.0)


def _seen(dynamics: MotionDynamics) -> Iterator[_Seen]:
    yield from _of_links(dynamics)
    base = dynamics.base
    axes = [axis for axis, channel in enumerate(GYRO) if channel in dynamics.motion.others]
    if base is None or not axes:
        return
    at = np.unique(np.linspace(0, len(dynamics.motion.time) - 1, len(dynamics.motion_response.inertia)))
    rows = _everywhere(dynamics, at.astype(int), dynamics.base_rows(at.astype(int)))
    for axis in axes:
        yield _Seen(GYRO[axis], "base.angular_velocity", base.angular_velocity[:, axis], rows[:, axis])


def _everywhere(dynamics: MotionDynamics, at: NDArray[np.int_], values: Array) -> Array:
    """At every sample what is known at some of them."""
    return np.asarray(make_interp_spline(at, values, k=3)(np.arange(len(dynamics.motion.time))))


def _of_links(dynamics: MotionDynamics) -> Iterator[_Seen]:
    inner, motion, n = dynamics.inner, dynamics.motion, len(dynamics.model.joints)
    assert inner is not None
    count, size = len(motion.time), 2 * dynamics.motion_response.inertia.shape[1]
    for body in dynamics.model.tree.bodies:
        if body.flexible is None:
            continue
        columns = n + body.modal + np.arange(body.modes)
        x = inner.modal[:, body.modal : body.modal + body.modes]
        for k, shape in enumerate(body.flexible.strain):
            channel = f"{body.name}.strain.{k + 1}"
            if channel in motion.others:
                rows = np.zeros((count, size))
                rows[:, columns] = shape
                yield _Seen(channel, f"{body.name}.strain", x @ shape, rows)
        tip = body.flexible.translations[body.flexible.tip]
        short, axis = np.zeros((body.modes, body.modes)), np.zeros(3)
        if body.flexible.foreshortening is not None and body.flexible.axis is not None:
            short, axis = body.flexible.foreshortening[body.flexible.tip], body.flexible.axis
        for k, letter in enumerate("xyz"):
            channel = f"{body.name}.tip_deflection.{letter}"
            if channel in motion.others:
                rows = np.zeros((count, size))
                rows[:, columns] = tip[k] - axis[k] * (x @ short)
                shortened = 0.5 * np.einsum("ti,ij,tj->t", x, short, x)
                yield _Seen(channel, f"{body.name}.tip_deflection", x @ tip[k] - axis[k] * shortened, rows)
