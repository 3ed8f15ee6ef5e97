"""Time integration with Exudyn's implicit solver under local error control, landing on given instants.

Method: the trapezoidal rule (Newmark, beta 1/4, gamma 1/2) with Newton iterations. It is of second order at
any sequence of step sizes, adds no numerical damping, and stays stable where regularised dry friction or a
bristle makes the equations stiff. Its local error in the velocities, h^3 |d2a/dt2| / 12, is estimated from
the accelerations of three instants; a step beyond the tolerance is repeated smaller. So smooth motion runs
at the given step, and only reversals and impacts of friction are resolved finer. The trapezoidal rule
oscillates at step sizes that skip a fast transient; error control prevents this.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, inf
from typing import Any

import exudyn
import numpy as np
from numpy.typing import NDArray

__all__ = ["FIXED_TOLERANCE", "TOLERANCE", "Silence", "Stepper"]

Array = NDArray[np.float64]

# Exudyn's stubs describe its compiled classes only in part.
exu: Any = exudyn

#: Local error of a velocity per step [rad/s or m/s], at the default step.
TOLERANCE = 1e-7
#: Steps below this [s] are accepted whatever their error: only a jump of the forces requires them.
SMALLEST_STEP = 1e-7
#: Limits of the change of step size, and safety factor on the step that would just meet the tolerance.
LARGEST_GROWTH, LARGEST_CUT, SAFETY = 2.0, 0.2, 0.85
#: Relative tolerance of Newton's iterations with constraints: Exudyn's own, 1e-8, leaves noise in velocities
#: that accelerations and constraint forces keep, divided by the step.
CONSTRAINED_TOLERANCE = 1e-10
#: The same at fixed steps, where only the step error should remain.
FIXED_TOLERANCE = 1e-13
#: Newton's iterations that reduce the residual by less get a new Jacobian: each evaluates the forces once, a
#: Jacobian of two joints four times. Exudyn's own, 0.5, takes six iterations a step with an old Jacobian.
CONTRACTIVITY = 0.03
#: Tolerance for instants of the grid [s]; Exudyn ends a run with the same tolerance.
ON_GRID = 1e-10
#: Speeds beyond this are a diverging run [rad/s or m/s].
LARGEST_SPEED = 1e4
#: Beyond this speed [rad/s or m/s] the tolerance grows with it, or a diverging run would never end.
FAST = 100.0


class Stepper:
    """One run of Exudyn's solver.

    Attributes:
        solver: Exudyn's.
        steps: accepted so far.

    Args:
        mbs: assembled system.
        step: largest step [s].
        tolerance: local error of a velocity per step [rad/s or m/s].
        next_stop: time [s] to the next instant after it that must be met exactly.
        accepted: called at every accepted instant (the first included) with time, coordinates and rates;
            returns the jump of the forces here, None without a jump.
        seen: called after it with time, coordinates, rates and accelerations (after the jump); returns
            whether to continue.
        jumped: the change of the accelerations due to a jump of the forces, from the solver and the jump; by
            default from the mass matrix alone.
        constrained: constraints hold at velocity level (index 2), where their forces do not oscillate under
            the trapezoidal rule.
        newton: relative and absolute tolerance of Newton's iterations; None leaves Exudyn's own.
    """

    def __init__(
        self,
        mbs: Any,
        *,
        step: float,
        tolerance: float,
        next_stop: Callable[[float], float],
        accepted: Callable[[float, Array, Array], Array | None],
        seen: Callable[[float, Array, Array, Array], bool],
        jumped: Callable[[Any, Array], Array] | None = None,
        constrained: bool = False,
        newton: float | None = None,
    ) -> None:
        self._data, self._mbs = mbs.systemData, mbs
        self._step, self._tolerance = step, tolerance
        self._next_stop, self._accepted, self._seen = next_stop, accepted, seen
        self.solver: Any = exu.MainSolverImplicitSecondOrder()
        self._jumped = jumped or (lambda solver, jump: np.linalg.solve(solver.GetSystemMassMatrix(), jump))
        self._constrained, self._newton = constrained, newton
        self._time = -inf
        self._wanted = self._planned = step
        self._error, self._hurry = 0.0, 1.0
        self._last: Array | None = None
        self._slope: tuple[Array, float] | None = None
        self.steps = 0

    def run(self, start: float, stop: float) -> bool:
        """Integrate from `start` to `stop` [s]; False when the solver gave up."""
        settings = exu.SimulationSettings()
        integration = settings.timeIntegration
        integration.startTime, integration.endTime = start, stop
        integration.numberOfSteps = max(1, ceil((stop - start) / self._step))
        integration.minimumStepSize = SMALLEST_STEP * 1e-3
        integration.adaptiveStepRecoverySteps = 2**31 - 1  # step sizes are set here, never by Exudyn
        integration.verboseMode = 0
        integration.generalizedAlpha.useNewmark = True
        integration.generalizedAlpha.newmarkBeta, integration.generalizedAlpha.newmarkGamma = 0.25, 0.5
        integration.generalizedAlpha.useIndex2Constraints = self._constrained
        integration.generalizedAlpha.storeInitialAlgebraicCoordinates = True
        integration.newton.useModifiedNewton = True
        if self._newton is None and not self._constrained:
            integration.newton.modifiedNewtonContractivity = CONTRACTIVITY
        if self._newton is not None:
            integration.newton.relativeTolerance = integration.newton.absoluteTolerance = self._newton
        if self._constrained:
            integration.newton.modifiedNewtonJacUpdatePerStep = True
        settings.solution.file.write = False
        self._mbs.SetPostNewtonUserFunction(self._judge)
        self._mbs.SetPostStepUserFunction(self._finish)
        with Silence():
            return bool(self.solver.SolveSystem(self._mbs, settings))

    def _judge(self, mbs: Any, time: float) -> list[float]:
        """After Newton: Exudyn repeats the step when the first number is large, with the second as size."""
        h = time - self._time
        self._error = self._estimate(h)
        if not self._error > self._tolerance or h <= SMALLEST_STEP:
            return [0.0, -1.0]
        return [inf, max(SMALLEST_STEP, h * max(LARGEST_CUT, self._factor()))]

    def _estimate(self, h: float) -> float:
        """h^3 |d2a/dt2| / 12 by divided differences over unequal steps, scaled down at high speeds."""
        assert self._last is not None
        slope = (self._data.GetODE2Coordinates_tt() - self._last) / h
        if self._slope is None:
            # No history: the change of acceleration itself, as if it came from one half wave of ten steps.
            return float(np.abs(slope).max()) * h * h / 120 / self._hurry
        before, h0 = self._slope
        return float(np.abs(slope - before).max()) * 2 * h**3 / (12 * (h + h0)) / self._hurry

    def _factor(self) -> float:
        return SAFETY * (self._tolerance / max(self._error, 1e-300)) ** (1 / 3)

    def _finish(self, mbs: Any, time: float) -> bool:
        data = self._data
        x, v, a = data.GetODE2Coordinates(), data.GetODE2Coordinates_t(), data.GetODE2Coordinates_tt()
        speed = float(np.abs(v).max())
        if not speed < LARGEST_SPEED:
            return False
        self._hurry = max(1.0, speed / FAST)
        if self._last is not None:
            self._remember(time, a)
        self._time, self._last = time, a
        jump = self._accepted(time, x, v)
        if jump is not None:
            self._last = a = a + self._jumped(self.solver, jump)
            data.SetODE2Coordinates_tt(a)
            self._slope = None
        self._plan(time)
        return self._seen(time, x, v, a)

    def _remember(self, time: float, a: Array) -> None:
        """Slope of the accelerations for the next estimate, and the step size to try next."""
        assert self._last is not None
        h = time - self._time
        self._slope = ((a - self._last) / h, h)
        self.steps += 1
        grown = h * min(LARGEST_GROWTH, self._factor())
        if h < 0.999 * self._planned or grown < h:  # repeated smaller, or about to be
            self._wanted = min(self._step, grown)
        else:  # a step shortened to meet the grid does not invalidate the previous size
            self._wanted = min(self._step, max(self._wanted, grown))

    def _plan(self, time: float) -> None:
        """Equal steps up to the next instant that must be met."""
        rest = self._next_stop(time) - time
        self._planned = rest / max(1, ceil(rest / self._wanted - 1e-9)) if rest < inf else self._wanted
        self.solver.it.currentStepSize = self._planned


class Silence:
    """Suppress Exudyn's output while its solver runs; failures are reported by our own errors."""

    def __enter__(self) -> None:
        self._before = exu.config.printToConsole, exu.config.suppressWarnings
        exu.config.printToConsole, exu.config.suppressWarnings = False, True

    def __exit__(self, *error: object) -> None:
        exu.config.printToConsole, exu.config.suppressWarnings = self._before
