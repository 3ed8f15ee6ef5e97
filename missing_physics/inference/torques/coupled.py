"""Effects at joints that are moved through a transmission, in addition to effects at the motors."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses.extents import Sight
from missing_physics.hypotheses.term import Term
from missing_physics.inference.torques.runs import Run
from missing_physics.standard.prediction import coupled_motion
from reference_model.effects.base import JointEffect
from reference_model.evaluation.coupled_effects import coupled_joints
from reference_model.evaluation.drive_model import DriveModel

__all__ = ["behind_motors", "sights_behind"]

Array = NDArray[np.float64]


def behind_motors(term: Term, effect: JointEffect, run: Run) -> Array:
    """Columns, in the motors' torques, of an effect at a joint of a transmission (`columns.columns_of`)."""
    moved = coupled_motion(run.along, run.needed)
    along, signals = moved.along(effect, term.at), moved.signals(term.at)
    force, jacobian = along.evaluate(signals, term.parameters, [p.name for p in term.free])
    full = -np.column_stack([force, jacobian])
    return run.reduce(run.motion.smooth(full)[:, None, :] * moved.row(term.at)[None, :, None])


def sights_behind(run: Run, residual: Array) -> Iterator[tuple[str, Sight]]:
    """The joints of transmissions in one recording.

    A joint moved by a single motor is skipped unless its bearing is given: all other effects at such a
    joint are equivalent to effects at the motor.

    Args:
        run: the recording.
        residual: of the drives' torques, shape (K, n) [N m or N].
    """
    model, motion = run.model, run.motion
    if not isinstance(model, DriveModel):
        return
    names, coupling = [joint.name for joint in model.robot.moving_joints], model.robot.coupling
    for joint in coupled_joints(model):
        j = names.index(joint)
        if np.count_nonzero(model.forward[j]) == 1 and model.robot.moving_joints[j].bearing is None:
            continue
        yield (
            joint,
            Sight(
                time=run.rows.time,
                position=motion.position[motion.kept] @ model.forward[j],
                velocity=motion.velocity[motion.kept] @ model.forward[j],
                torque=run.needed[motion.kept] @ coupling[:, j],
                residual=residual @ coupling[:, j],
                step=1.0 / motion.sampling,
                cutoff=motion.cutoff,
                gear_ratio=1.0,
            ),
        )
