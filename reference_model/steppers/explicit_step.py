"""One step of Dormand and Prince's method over a short piece of the motion, with an estimate of its error.

Where a controller acts every millisecond, restarting a multistep integrator at every instant costs more than
the physics. One explicit step usually suffices for such a short piece; if its error estimate is too large
(dry friction near a reversal is stiff), the piece is left to CVODES.

J. R. Dormand, P. J. Prince, J. Comp. Appl. Math. 6 (1980) 19-26, the pair of orders 5 and 4.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca

__all__ = ["explicit_step"]

#: Instants of the stages, as fractions of the step.
NODES = (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0)
#: Weights of the earlier stages in each stage; the last row is the result of order 5.
STAGES = (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
#: Result of order 5 minus that of order 4, by stage.
DIFFERENCE = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)


def explicit_step(
    rate: Callable[[Any, Any], Any], state: Any, length: Any, *, rtol: float, atol: float
) -> tuple[Any, Any]:
    """The state one step later, and the error estimate relative to the tolerance: above 1 is too much.

    Args:
        rate: (elapsed fraction of the step, state) -> time derivative; SX or MX like `state`.
        state: at the start, rows x 1.
        length: of the step [s].
        rtol, atol: the error is the root mean square of error/(rtol |x| + atol), as in CVODES.
    """
    slopes: list[Any] = []
    later = state
    for node, weights in zip(NODES, STAGES):
        later = state + length * sum((w * k for w, k in zip(weights, slopes) if w), start=0 * state)
        slopes.append(rate(node, later))
    error = length * sum((w * k for w, k in zip(DIFFERENCE, slopes) if w), start=0 * state)
    relative = error / (rtol * ca.fabs(state) + atol)
    return later, ca.sqrt(ca.sumsqr(relative) / max(state.shape[0], 1))
