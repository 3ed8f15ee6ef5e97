"""Columns of forces on a body: they act on the joints and move a free base."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from missing_physics.hypotheses.term import Term
from missing_physics.inference.kept import step_of
from missing_physics.inference.torques.runs import Run
from reference_model.effects.body_force import ForceEffect
from reference_model.effects.pushing import BodySeries, ForceAlong

__all__ = ["on_body"]

Array = NDArray[np.float64]


def on_body(term: Term, effect: ForceEffect, run: Run) -> Array:
    """Columns of a force on a body, see `columns.columns_of`; not yet whitened.

    Its wrench is computed along the motion without it; a free base responds to it to first order
    (`missing_physics.evaluation.vibration.response`).
    """
    signals, spread = (_base(run), np.eye(6)) if term.at == "base" else run.body(term.at)
    pushed = ForceAlong(effect, run.model.robot)
    wrench = pushed.wrench(signals, term.parameters)[:, :, None]
    if effect.states:
        slopes = [wrench[:, :, :0]]
        for p in term.free:
            value = term.parameters[p.name]
            step = p.typical if p.linear else step_of(term, p)
            moved = pushed.wrench(signals, {**term.parameters, p.name: value + step})
            slopes.append((moved[:, :, None] - wrench) / step)
    else:
        slopes = [pushed.slopes(signals, term.parameters, [p.name for p in term.free])]
    columns = np.concatenate([wrench, *slopes], axis=2)
    rows = np.zeros((len(signals.time), run.model.rows, columns.shape[2]))
    rows[:, : spread.shape[-2]] = -spread @ columns
    return run.reduce(run.along.at_joints(rows))


def _base(run: Run) -> BodySeries:
    """Motion of the base; its position is taken as that of the robot file."""
    base, time = run.along.base, run.motion.time
    assert base is not None
    home = np.broadcast_to(np.asarray(run.model.robot.base.position, dtype=float), (time.size, 3))
    turned = Rotation.from_quat(np.roll(base.attitude, -1, axis=1)).as_matrix()
    return BodySeries(time, home, turned, np.column_stack([base.linear_velocity, base.angular_velocity]))
