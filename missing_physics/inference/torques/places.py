"""Data about each joint from which candidates start: the range covered and the residual of a fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from missing_physics.hypotheses import Place, Sight, extent_of
from missing_physics.inference.torques.coupled import sights_behind
from missing_physics.inference.torques.runs import Run
from robot_model import Robot

__all__ = ["places"]

Array = NDArray[np.float64]


def places(
    robot: Robot,
    every: Sequence[Run],
    fitted_rows: Sequence[NDArray[np.bool_]],
    residual: Sequence[Array],
    coulomb: Mapping[str, float],
) -> dict[str, Place]:
    """Joints whose torque is compared, with the data from which candidates start.

    Args:
        robot: nominal.
        every: recordings, the fitted ones first.
        fitted_rows: mask of the fitted rows of each fitted recording, shape (K,) each.
        residual: of each fitted recording, zero where nothing is fitted, shape (K, n) each [N m or N].
        coulomb: Coulomb friction of each joint in the hypothesis [N m or N].
    """
    found: dict[str, Place] = {}
    runs = every[: len(fitted_rows)]
    driven = {drive.name for drive in robot.drives if drive.actuator is not None}
    for k, joint in enumerate(robot.drives):
        if not any(run.rows.counted[rows, k].any() for run, rows in zip(runs, fitted_rows)):
            continue
        sights = []
        for i, run in enumerate(runs):
            kept = run.motion.kept
            sights.append(
                Sight(
                    time=run.rows.time,
                    position=run.motion.position[kept][:, k],
                    velocity=run.motion.velocity[kept][:, k],
                    torque=run.needed[kept][:, k],
                    residual=residual[i][:, k],
                    step=1.0 / run.motion.sampling,
                    cutoff=run.motion.cutoff,
                    gear_ratio=joint.actuator.gear_ratio if joint.actuator else 1.0,
                )
            )
        extents = tuple(extent_of(sight) for sight in sights)
        moved = any(run.driven[k] for run in every)
        found[joint.name] = Place(
            extents, coulomb[joint.name], moved and (not driven or joint.name in driven)
        )
    behind: dict[str, list[Sight]] = {}
    for i, run in enumerate(runs):
        for name, sight in sights_behind(run, residual[i]):
            behind.setdefault(name, []).append(sight)
    for name, own in behind.items():
        found[name] = Place(tuple(extent_of(sight) for sight in own), 0.0, driven=False, coupled=True)
    return found
