"""Standard model of the rates of a free base: their dependence on masses, centres and inertias."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.bodies.pseudo_inertia import sizes, solid
from missing_physics.motion.base.rates import Rates
from missing_physics.standard.layout import Layout, bodies_of, is_known, length_of
from reference_model.dynamics.inertial import nominal_inertial
from reference_model.flexible.beam_numbers import POSITIVE
from reference_model.passive.base_motion import BaseMotion
from reference_model.passive.inner_motion import InnerMotion

__all__ = ["MOMENTUM", "bodies_column", "layout_of", "momentum_names"]

Array = NDArray[np.float64]

#: Prefix of the names of a recording's initial angular momentum.
MOMENTUM = "base.momentum"


def momentum_names(run: int) -> tuple[str, ...]:
    """Names of the components of a recording's initial angular momentum about the centre of mass [N m s]."""
    return tuple(f"{MOMENTUM} {axis} in {run}" for axis in "xyz")


def layout_of(runs: Sequence[Rates], begun: int) -> Layout:
    """Layout of the inertial parameters, bodies and beams estimated, then the first recordings' momenta.

    Args:
        runs: rates of each recording.
        begun: number of recordings whose initial momentum is a parameter.
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
    """Angular momentum of the robot at its largest recorded angular rate [N m s]."""
    middle = rates.floating.mass[len(rates.floating.time) // 2, 3:6, 3:6]
    return float(np.linalg.eigvalsh(middle)[-1] * np.linalg.norm(rates.turning, axis=1).max())


def bodies_column(rates: Rates) -> Array:
    """Derivative of the rows by the inertial parameters, shape (K, m, P).

    Momentum, and the forces that make links vibrate, are Y phi along the motion that the robot file predicts.
    Along the recorded motion the file's momentum is not zero, and lighter bodies would explain that.
    """
    floating, model, some = rates.floating, rates.dynamics.model, rates.instants
    joints, inner = rates.along(some)
    position, velocity, _ = joints
    still, level = np.zeros_like(velocity), np.array([1.0, 0.0, 0.0, 0.0])
    base = BaseMotion(*(part[some] for part in _parts(rates.base)))
    zero = np.zeros_like(base.linear_velocity)  # momentum M v equals the forces at accelerations v
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
    found[:, :, -3:] = 0.0  # gravity does not turn a falling body
    return found


def _at_rates(inner: InnerMotion) -> InnerMotion:
    """The links' deflections, with their rates in place of their accelerations."""
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
