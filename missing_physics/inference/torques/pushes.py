"""Columns of what pushes on a free base: the base gives way, and joints feel that it does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from missing_physics.hypotheses.term import Term
from missing_physics.inference.kept import step_of
from missing_physics.inference.torques.runs import Run
from reference_model.effects.body_force import ForceEffect
from reference_model.effects.pushing import BaseSignals, ForceAlong

__all__ = ["on_base"]

Array = NDArray[np.float64]


def on_base(term: Term, effect: ForceEffect, run: Run) -> Array:
    """Columns of an effect that pushes on the base, as `columns.columns_of` gives them, not yet whitened.

    Its wrench is that along the motion of the base without it, and the base follows it to first order
    (`missing_physics.evaluation.response`).
    """
    pushed, signals = ForceAlong(effect, run.model.robot), _signals(run)
    columns = [pushed.wrench(signals, term.parameters)]
    for p in term.free:
        value = term.parameters[p.name]
        step = p.typical if p.linear else step_of(term, p)
        moved = pushed.wrench(signals, {**term.parameters, p.name: value + step})
        columns.append((moved - columns[0]) / step)
    rows = np.zeros((len(signals.time), run.model.rows, len(columns)))
    rows[:, :6] = -np.stack(columns, axis=2)
    return run.reduce(run.along.at_joints(rows))


def _signals(run: Run) -> BaseSignals:
    """How the base moves; it stays about where the robot file puts it."""
    base, time = run.along.base, run.motion.time
    assert base is not None
    home = np.broadcast_to(np.asarray(run.model.robot.base.position, dtype=float), (time.size, 3))
    turned = Rotation.from_quat(np.roll(base.attitude, -1, axis=1)).as_matrix()
    return BaseSignals(time, home, turned, np.column_stack([base.linear_velocity, base.angular_velocity]))
