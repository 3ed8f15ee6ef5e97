"""Joints as candidates see them: the range that recordings cover there and the residual of a fit."""

from __future__ import annotations

import numpy as np

from missing_physics.hypotheses import Place, Sight, extent_of
from missing_physics.inference.coupled import sights_behind
from missing_physics.inference.data import Data
from missing_physics.inference.fit import Fit, residuals

__all__ = ["places"]


def places(data: Data, fit: Fit) -> dict[str, Place]:
    """Joints whose torque is compared, as candidates see them."""
    robot, found = data.standard.nominal, {}
    driven = {drive.name for drive in robot.drives if drive.actuator is not None}
    seen = [data.rows_seen(i) for i in range(data.fitted)]
    left = [np.where(rows[:, None], residuals(data, fit, i), 0.0) for i, rows in enumerate(seen)]
    for k, joint in enumerate(robot.drives):
        if not any(data.runs[i].rows.counted[rows, k].any() for i, rows in enumerate(seen)):
            continue
        sights = []
        for i, run in enumerate(data.runs[: data.fitted]):
            kept = run.motion.kept
            sights.append(
                Sight(
                    time=run.rows.time,
                    position=run.motion.position[kept][:, k],
                    velocity=run.motion.velocity[kept][:, k],
                    torque=run.needed[kept][:, k],
                    residual=left[i][:, k],
                    step=1.0 / run.motion.sampling,
                    cutoff=run.motion.cutoff,
                    gear_ratio=joint.actuator.gear_ratio if joint.actuator else 1.0,
                )
            )
        extents = tuple(extent_of(sight) for sight in sights)
        coulomb = fit.number(f"{joint.name}.coulomb")
        moved = any(run.driven[k] for run in data.runs)
        found[joint.name] = Place(extents, coulomb, moved and (not driven or joint.name in driven))
    behind: dict[str, list[Sight]] = {}
    for i, run in enumerate(data.runs[: data.fitted]):
        for name, sight in sights_behind(run, left[i]):
            behind.setdefault(name, []).append(sight)
    for name, own in behind.items():
        found[name] = Place(tuple(extent_of(sight) for sight in own), 0.0, driven=False, coupled=True)
    return found
