"""What other masses, centres and inertias would make of the rates of a free base: the standard model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.bodies.pseudo_inertia import sizes, solid
from missing_physics.diagnosis.base.rates import Rates
from missing_physics.standard.layout import Layout, bodies_of, is_known, length_of
from reference_model.dynamics.inertial import nominal_inertial
from reference_model.flexible.beam_numbers import POSITIVE
from reference_model.passive.base_motion import BaseMotion
from reference_model.passive.inner_motion import InnerMotion

__all__ = ["MOMENTUM", "bodies_column", "layout_of", "momentum_names"]

Array = NDArray[np.float64]

#: Part of the name of the angular momentum with which a recording begins.
MOMENTUM = "base.momentum"


def momentum_names(run: int) -> tuple[str, ...]:
    """Names of the angular momentum about the centre of mass with which a recording begins [N m s]."""
    return tuple(f"{MOMENTUM} {axis} in {run}" for axis in "xyz")


def layout_of(runs: Sequence[Rates], begun: int) -> Layout:
    """Inertial numbers, of which bodies and beams are estimated, then momenta of the first recordings.

    Args:
        runs: rates of each recording.
        begun: of how many recordings the momentum is a parameter.
    """
    model = runs[0].dynamics.model
    robot, nominal = model.robot, model.inertial
    names = (*model.inertial_names, *(name for run in range(begun) for name in momentum_names(run)))
    count, start, size = nominal.size, np.zeros(len(names)), np.ones(len(names))
    start[:count] = nominal
    free = np.zeros(len(names), dtype=bool)
    bodies = bodies_of(robot, nominal_inertial(robot))
    for body, place in bodies.items():
        start[place] = solid(nominal[place], length_of(robot, body))
        size[place] = sizes(start[place])
        free[place] = [not is_known(robot, name) for name in names[place]]
    beams = np.flatnonzero([name.split(".")[-1] in POSITIVE for name in names])
    beams = beams[[start[i] > 0.0 and not is_known(robot, names[i]) for i in beams]]
    free[beams], size[beams] = True, start[beams]
    momenta = np.arange(count, len(names))
    free[momenta] = True
    for run, rates in enumerate(runs[:begun]):
        size[momenta[3 * run : 3 * run + 3]] = _momentum_size(rates)
    return Layout(
        names=names,
        start=start,
        free=free,
        bodies=tuple(bodies.values()),
        gaussian=momenta,
        positive=np.zeros(0, dtype=int),
        size=size,
        centre=np.zeros(len(names)),
        width=size,
        scale=np.zeros(len(names)),
        beams=beams,
    )


def _momentum_size(rates: Rates) -> float:
    """That of the robot turning as fast as it did at most [N m s]."""
    middle = rates.floating.mass[len(rates.floating.time) // 2, 3:6, 3:6]
    return float(np.linalg.eigvalsh(middle)[-1] * np.linalg.norm(rates.turning, axis=1).max())


def bodies_column(rates: Rates) -> Array:
    """Derivative of the rows by the inertial numbers, shape (K, m, P).

    Momentum, and the forces that make links vibrate, are Y phi along the motion that the robot file predicts.
    Along the recorded one, where its momentum is not zero, all bodies being lighter would explain that.
    """
    floating, model, some = rates.floating, rates.dynamics.model, rates.instants
    joints, inner = rates.along(some)
    position, velocity, _ = joints
    still, level = np.zeros_like(velocity), np.array([1.0, 0.0, 0.0, 0.0])
    base = BaseMotion(*(part[some] for part in _parts(rates.base)))
    zero = np.zeros_like(base.linear_velocity)  # momentum is M v, as forces at accelerations v
    moving = BaseMotion(
        BaseMotion.at_rest(level, len(zero)).attitude, zero, zero, base.angular_velocity, base.linear_velocity
    )
    weightless = np.append(model.inertial[:-3], np.zeros(3))
    along = None if inner is None else _at_rates(inner)
    momentum = model.regressor(position, still, velocity, base=moving, inner=along, inertial=weightless)
    carried = momentum[:, :6]
    if inner is not None:
        forces = model.regressor(*joints, base=base, inner=inner)
        on_modes = floating.lever @ forces[:, :6] - forces[:, floating.modes]
        carried = carried + floating.mass[:, :6, floating.modes] @ floating.vibration(on_modes)
    found = rates.rows(floating.turned(-carried))
    found[:, :, -3:] = 0.0  # gravity turns nothing that falls
    return found


def _at_rates(inner: InnerMotion) -> InnerMotion:
    """Where links bend as they do, with their rates in place of accelerations."""
    still = np.zeros_like(inner.modal)
    none = inner.balls, inner.ball_rates, inner.ball_accelerations
    return InnerMotion(*none, inner.modal, still, inner.modal_rates)


def _parts(base: BaseMotion) -> tuple[Array, ...]:
    return (
        base.attitude,
        base.angular_velocity,
        base.linear_velocity,
        base.angular_acceleration,
        base.linear_acceleration,
    )
