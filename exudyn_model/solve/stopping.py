"""Friction that tries to stop the joints within a step, as constant forces over the step.

Breedveld, Diepenbroek, van Lunteren, ICAR 1997. With M the mass matrix and a the accelerations without dry
friction, the friction T of a step h obeys on every joint

    low <= T <= high,   w = qd / h + a + M^-1 T:   w = 0 between, w >= 0 at low, w <= 0 at high,

low and high the laws' values in the two directions of sliding: a box constrained problem with a symmetric
positive definite matrix, whose unique solution projected Gauss-Seidel sweeps find. The force is constant over
the step, so that a joint comes to rest up to the square of the step; the next step removes the remainder.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from exudyn_model.control.laws import JointState
from exudyn_model.forces.joints import Forces, Stopping
from exudyn_model.solve.explicit import Dynamics

__all__ = ["boxed", "stopped"]

Array = NDArray[np.float64]

#: Sweeps end when no force changes by more than this, relative to the widest box.
SETTLED = 1e-13
#: Strongly coupled joints take some hundred sweeps.
MOST_SWEEPS = 10_000


def stopped(
    forces: Forces,
    state: JointState,
    step: float,
    dynamics: Callable[[], Dynamics],
    places: Sequence[int],
) -> Stopping:
    """Friction over the step from a state.

    Args:
        forces: on the joints; their friction is set to trial values.
        state: at the start of the step.
        step: its length [s].
        dynamics: gives the system's mass matrix and accelerations under the present forces.
        places: indices of the joints among the system's coordinates.
    """
    count = len(places)
    nothing = [0.0] * count
    totals = []
    for direction in (1.0, 0.0, -1.0):
        forces.stop(Stopping([direction] * count, nothing))
        totals.append(np.array(forces.at(state).total))
    ahead, without, behind = totals
    low: Array = ahead - without
    high: Array = behind - without
    forces.stop(Stopping(nothing, nothing))
    mass, acceleration = dynamics()
    rows = list(places)
    inverse = np.asarray(np.linalg.inv(mass)[np.ix_(rows, rows)], dtype=np.float64)
    free = np.asarray(np.array(state.velocity) / step + acceleration[rows], dtype=np.float64)
    force = boxed(inverse, free, low, high)
    sliding = np.where(force <= low, 1.0, np.where(force >= high, -1.0, 0.0))
    sliding[low == high] = 0.0
    return Stopping(sliding.tolist(), np.where(sliding == 0, force, 0.0).tolist())


def boxed(matrix: Array, free: Array, low: Array, high: Array) -> Array:
    """x between `low` and `high` with w = free + matrix x zero inside, >= 0 at low and <= 0 at high, (n,)."""
    x = np.clip(np.zeros(len(free)), low, high)
    scale = float(np.max(high - low, initial=0.0))
    for _ in range(MOST_SWEEPS):
        before = x.copy()
        for k in range(len(x)):
            w = free[k] + matrix[k] @ x
            x[k] = min(max(x[k] - w / matrix[k, k], low[k]), high[k])
        if np.abs(x - before).max(initial=0.0) <= SETTLED * scale:
            break
    return x
