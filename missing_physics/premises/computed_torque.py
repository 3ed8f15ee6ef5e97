"""Torques that are not measured but computed by a model from the motion."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from missing_physics.premises.carried import Carried
from missing_physics.recordings import Finding

__all__ = ["computed_torque_findings"]

Array = NDArray[np.float64]

#: Largest fraction of a computed torque's energy in the residual of rigid bodies without friction. For
#: measured torques of fourteen real machines it is 1.5e-3 or more at every joint; for a model's torque logged
#: by a robot, about 5e-5.
MOST_LEFT = 3e-4
#: Largest white noise of a computed torque, as a fraction of its residual: below 1e-4 in such logs, several
#: tenths or more if torques of a frictionless robot are simulated with sensor noise.
NOISY = 1e-2
#: Most rows that are used, and fewest rows per parameter.
ROWS, PER_NUMBER = 1000, 3.0
#: A joint is used if its torque varies by this fraction of the largest.
COUNTS = 1e-2
RANK = 1e-7


def computed_torque_findings(carried: Carried) -> Iterator[Finding]:
    """Findings of torques that inverse dynamics of a rigid robot without friction explains entirely.

    Masses and inertias are free, since the model may have had others than the robot file.
    """
    spread = carried.torque.std(axis=0)
    speed = np.abs(carried.velocity).max(axis=0)
    counts = carried.known & (spread > COUNTS * spread.max(initial=0.0)) & (speed > 0.0)
    joints = np.flatnonzero(counts)
    if not joints.size:
        return
    residual = _residual_fractions(carried, joints)
    if residual is None or not (residual < MOST_LEFT).all():
        return
    if not (carried.noise[joints] < NOISY * np.sqrt(residual) * spread[joints]).all():
        return
    channels = [carried.channels[k] for k in joints]
    one = len(channels) == 1
    worst = float(residual.max())
    yield Finding(
        "warning",
        "computed_torque",
        channels[0],
        f"{', '.join(channels)} {'is' if one else 'are'} what a rigid robot without friction needs for this "
        f"motion, with a correlation of {np.sqrt(1.0 - worst):.7g}: no real drive is without friction and "
        f"noise, so {'it was' if one else 'they were'} probably computed from a model, in which no physics "
        "can be missing; map the measured torques or currents",
        {"left": worst},
    )


def _residual_fractions(carried: Carried, joints: NDArray[np.intp]) -> Array | None:
    """Residual energy fraction of each joint, corrected for the number of parameters; None with few rows."""
    rows = np.unique(np.linspace(0, len(carried.torque) - 1, ROWS).astype(int))
    model = carried.model
    state = carried.position[rows], carried.velocity[rows], carried.acceleration[rows]
    first = model.tree.offset
    numbers = [k for k, name in enumerate(model.inertial_names) if not name.startswith("gravity.")]
    design = model.regressor(*state)[:, first + joints][:, :, numbers]
    torque = carried.torque[rows][:, joints]
    spread = torque.std(axis=0)
    columns = (design / spread[None, :, None]).reshape(-1, len(numbers))
    size = np.linalg.norm(columns, axis=0)
    columns = columns[:, size > 0.0] / size[size > 0.0]
    target = (torque / spread).reshape(-1)
    found, _, rank, _ = np.linalg.lstsq(columns, target, rcond=RANK)
    if target.size < PER_NUMBER * rank:
        return None
    residual = (target - columns @ found).reshape(-1, joints.size)
    return np.asarray((residual**2).mean(axis=0) * target.size / (target.size - rank))
