"""The closed loop of a sampled controller by linearly implicit steps, each from one command to the next.

A multistep method restarts with every command, at order one and with many short steps, and in stiff cases
(smoothed friction of a joint at rest, bristles) an explicit step is no alternative. A Rosenbrock method
(`rosenbrock_tables`) has its full order from the first step on. It runs uncompiled, so that robots which are
run once or twice gain too.

A piece that takes too many steps is left to CVODES, which reports the reason if it also fails.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from reference_model.codegen.batched import Single
from reference_model.plant.closed_loop import Plant
from reference_model.steppers.effort import Effort
from reference_model.steppers.held_pieces import Piece, in_pieces
from reference_model.steppers.integration import Course, advance_held, cvodes_options
from reference_model.steppers.rosenbrock_tables import RODAS4, RODAS5P

__all__ = ["integrate_held"]

Array = NDArray[np.float64]

#: Safety factor on the step that would just meet the tolerance, and limits of its change.
SAFETY, LEAST, MOST = 0.9, 0.2, 6.0
#: Steps in a piece, including rejected ones, after which it is left to CVODES.
MOST_STEPS = 100
#: From this relative tolerance on the method of order 4 takes less time than that of order 5.
COARSE = 1e-6
#: Pieces after a failed explicit step in which none is tried.
WAIT = 8


def integrate_held(
    plant: Plant,
    reference: ca.Function,
    time: Array,
    *,
    hold: float,
    rtol: float,
    atol: float,
    effort: Effort | None = None,
) -> Course:
    """The course of the closed loop at the instants `time`, which begin at 0.

    Args:
        plant: the closed loop.
        reference: t -> r, rd, rdd.
        time: output instants [s], rising.
        hold: interval over which a command is held [s], above zero.
        rtol, atol: tolerances of a step.
        effort: to which the steps are added.

    Raises:
        InputError: the integration fails; the message gives time, state and what to try.
    """
    options = cvodes_options(rtol, atol)
    implicit = _Implicit(plant, reference, rtol, atol, effort or Effort())
    spare: list[Piece] = []

    def moved(state: Array, command: Array, now: float, then: float) -> Array:
        found = implicit(state, command, now, then)
        if found is None:
            if not spare:
                spare.append(advance_held(plant, reference, options))
            return spare[0](state, command, now, then)
        return found

    course = in_pieces(plant, reference, time, hold, rtol=rtol, atol=atol, moved=moved, wait=WAIT)
    return Course(time, *course)


class _Implicit:
    """Steps of a Rosenbrock method with a held command."""

    def __init__(
        self, plant: Plant, reference: ca.Function, rtol: float, atol: float, effort: Effort
    ) -> None:
        self._rtol, self._atol, self._effort = rtol, atol, effort
        self._reference = Single(reference) if plant.layout.integral else None
        self._tables = RODAS4 if rtol >= COARSE else RODAS5P
        self._still = np.zeros((plant.layout.joints, 1))
        self._step = np.inf  # of the last piece, the initial step of the next
        t, x = ca.SX.sym("t"), ca.SX.sym("x", plant.layout.size)
        r, u = ca.SX.sym("r", plant.layout.joints), ca.SX.sym("u", plant.commands)
        rate = plant.rate(t, x, r, u)
        slopes = ca.jacobian(rate, ca.vertcat(t, r, x))
        self._rate = Single(ca.Function("rate", [t, x, r, u], [rate], {"cse": True}))
        self._slopes = Single(ca.Function("slopes", [t, x, r, u], [ca.densify(slopes)], {"cse": True}))

    def __call__(self, state: Array, command: Array, now: float, then: float) -> Array | None:
        """The state at the end of a piece; None where it takes too many steps."""
        step, tried, instant = self._step, 0, now
        while instant < then:
            tried += 1
            self._effort.states += len(state)
            if tried > MOST_STEPS:
                self._step = np.inf
                return None
            left = then - instant
            length = left if step >= left * (1 - 1e-10) else min(step, left / 2)
            later, error = self._attempt(state, command, instant, length)
            factor = MOST if error == 0 else max(LEAST, SAFETY * error ** (-1 / self._tables.order))
            if error < 1:
                state, instant = later, then if length == left else instant + length
                step = max(length * min(MOST, factor), step if length == left else 0.0)
            else:
                step = length * min(1.0, factor)
        self._step = step
        return state

    def _goal(self, instant: float) -> tuple[Array, Array]:
        """Reference and its rate, where more than the command depends on them."""
        if self._reference is None:
            return self._still[:, 0], self._still[:, 0]
        found = self._reference(instant)
        return found[0][:, 0], found[1][:, 0]

    def _attempt(self, x: Array, command: Array, instant: float, h: float) -> tuple[Array, float]:
        """The state after a step of h, and its error over the tolerance."""
        m, joints = self._tables, len(self._still)
        goal, pace = self._goal(instant)
        slopes = self._slopes(instant, x, goal, command)[0]
        passing = slopes[:, 0] + slopes[:, 1 : 1 + joints] @ pace
        matrix = -slopes[:, 1 + joints :]
        matrix.flat[:: len(x) + 1] += 1.0 / (m.gamma * h)
        lu, pivots, flag = lapack.dgetrf(matrix)
        if flag or not np.isfinite(matrix).all():
            return x, np.inf
        u = np.zeros((len(m.instants), len(x)))
        y = x
        for s, part in enumerate(m.instants):
            y = x + m.places[s, :s] @ u[:s]
            goal = self._goal(instant + part * h)[0] if self._reference is not None else goal
            right = self._rate(instant + part * h, y, goal, command)[0][:, 0]
            right += m.shares[s, :s] @ u[:s] / h + (m.slopes[s] * h) * passing
            u[s] = lapack.dgetrs(lu, pivots, right)[0]
        later = y + u[-1]
        scale = self._atol + self._rtol * np.maximum(np.abs(x), np.abs(later))
        error = float(np.sqrt(np.mean((u[-1] / scale) ** 2)))
        return later, error if np.isfinite(error) else np.inf
