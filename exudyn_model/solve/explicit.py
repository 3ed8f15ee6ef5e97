"""Explicit Runge-Kutta at fixed steps, for the kinematic tree: the highest order that Exudyn offers.

Of sixth order in seven stages, for proofs of convergence: smooth motion of a rigid robot is then accurate to
rounding. There is no memory between the stages of a step, and dry friction requires implicit steps; so laws
with a memory are not supported.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, inf
from typing import Any

import exudyn
import numpy as np
from numpy.typing import NDArray

from exudyn_model.solve.stepping import LARGEST_SPEED, Silence

__all__ = ["Dynamics", "ExplicitStepper"]

Array = NDArray[np.float64]

# Exudyn's stubs describe its compiled classes only in part.
exu: Any = exudyn


#: Mass matrix of the system and its accelerations under the present forces.
Dynamics = tuple[Array, Array]


class ExplicitStepper:
    """One run of Exudyn's explicit solver; arguments as in `stepping.Stepper`.

    `decided` is called before each step, with time, coordinates, rates, the step's length, and a function for
    the system's dynamics: it may change forces for the duration of the step.
    """

    def __init__(
        self,
        mbs: Any,
        *,
        step: float,
        next_stop: Callable[[float], float],
        accepted: Callable[[float, Array, Array], Array | None],
        seen: Callable[[float, Array, Array, Array], bool],
        decided: Callable[[float, Array, Array, float, Callable[[], Dynamics]], None] | None = None,
    ) -> None:
        self._mbs, self._step, self._decided = mbs, step, decided
        self._next_stop, self._accepted, self._seen = next_stop, accepted, seen
        self.solver: Any = exu.MainSolverExplicit()
        self._asks: Any = exu.MainSolverImplicitSecondOrder()

    def run(self, start: float, stop: float) -> bool:
        """Integrate from `start` to `stop` [s]; False when the solver gave up."""
        settings = exu.SimulationSettings()
        integration = settings.timeIntegration
        integration.startTime, integration.endTime = start, stop
        integration.numberOfSteps = max(1, ceil((stop - start) / self._step))
        integration.automaticStepSize = False
        integration.verboseMode = 0
        integration.solverType = exu.DynamicSolverType.RK67
        settings.solution.file.write = False
        self._mbs.SetPostStepUserFunction(self._finish)
        with Silence():
            if not self._asks.InitializeSolver(self._mbs, settings):
                return False
            return bool(self.solver.SolveSystem(self._mbs, settings))

    def _finish(self, mbs: Any, time: float) -> bool:
        data = mbs.systemData
        x, v = data.GetODE2Coordinates(), data.GetODE2Coordinates_t()
        if not np.abs(v).max() < LARGEST_SPEED:
            return False
        self._accepted(time, x, v)
        rest = self._next_stop(time) - time
        steps = max(1, ceil(rest / self._step - 1e-9)) if rest < inf else 1
        self.solver.it.currentStepSize = min(rest, self._step * steps) / steps
        if self._decided is not None:
            self._decided(time, x, v, self.solver.it.currentStepSize, self._dynamics)
        return self._seen(time, x, v, self._dynamics()[1])

    def _dynamics(self) -> Dynamics:
        """At the present state; the solver's own accelerations are those of a stage."""
        self._asks.ComputeMassMatrix(self._mbs)
        self._asks.ComputeODE2RHS(self._mbs)
        mass = np.array(self._asks.GetSystemMassMatrix())
        return mass, np.linalg.solve(mass, np.array(self._asks.GetSystemResidual())[: len(mass)])
