"""The converged solution of a motion, against which errors are measured."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from benchmarks.work_precision.manoeuvres import Case, Course, quantities
from reference_model.codegen.batched import Batched
from reference_model.control.motion import reference_function
from reference_model.plant.closed_loop import Plant
from reference_model.steppers.integration import cvodes, symbols
from robot_model import Robot

__all__ = ["FINEST", "MOST_STEPS", "Truth", "closed_loop"]

Array = NDArray[np.float64]

#: Relative tolerance of the solution that everything is measured against; the absolute one is a hundredth.
FINEST = 1e-12
#: Steps of that solution's table, whose cubic pieces between states and their rates add less than 1e-9 to it.
TABLE_STEP = 1e-3
#: Steps that CVODES may take between two instants.
MOST_STEPS = 100_000


def closed_loop(robot: Robot) -> tuple[Plant, ca.Function, Mapping[str, ca.SX]]:
    """Plant, reference, and the closed loop for CVODES."""
    plant, reference = Plant(robot), reference_function(robot)
    t, x, _ = symbols(reference, plant.layout.size)
    goal = reference(t)
    return (
        plant,
        reference,
        {"t": t, "x": x, "ode": plant.rate(t, x, goal[0], plant.command(t, x, *goal))},
    )


class Truth:
    """The converged solution of a case.

    Args:
        case: the motion.
        tolerance: of its integration.
    """

    def __init__(self, case: Case, *, tolerance: float = FINEST) -> None:
        self._plant, reference, loop = closed_loop(case.robot)
        time = np.arange(round(case.duration / TABLE_STEP) + 1) * TABLE_STEP
        options = {"reltol": tolerance, "abstol": 1e-2 * tolerance, "max_num_steps": MOST_STEPS}
        options["max_step_size"] = 2 * TABLE_STEP
        start = self._plant.initial(reference)
        later = cvodes(loop, time[1:].tolist(), options, True)(x0=start)["xf"].full().T
        states = np.vstack([start, later])
        rates = Batched(ca.Function("rate_of", [loop["t"], loop["x"]], [ca.densify(loop["ode"])]))
        self._spline = CubicHermiteSpline(time, states, rates(time[:, None], states)[0])
        self._groups = quantities(case.robot)
        values = self.seen(states)
        self._ranges = {
            name: float(np.ptp(values[:, group], axis=0).max()) for name, group in self._groups.items()
        }

    def seen(self, states: Array) -> Array:
        """Quantities of states of the reference model, shape (N, k)."""
        parts = self._plant.layout.split(states)
        columns = [parts["position"]]
        if self._plant.layout.free_base:
            attitude = parts["attitude"] / np.linalg.norm(parts["attitude"], axis=1, keepdims=True)
            columns += [parts["base_position"], attitude]
        for body in self._plant.flexible:
            assert body.flexible is not None
            own = parts["modal"][:, body.modal : body.modal + body.modes]
            columns.append(own @ body.flexible.translations[body.flexible.tip].T)
        return np.hstack(columns)

    def errors(self, course: Course, right: Array | None = None) -> Mapping[str, float]:
        """Largest rms of a column of each group, over the group's range; from this solution, or `right`."""
        if right is None:
            right = self.seen(self._spline(course.time))
        found = {}
        for name, group in self._groups.items():
            apart = course.values[:, group] - right[:, group]
            if name == "base attitude":  # a quaternion and its negative are the same attitude
                other = course.values[:, group] + right[:, group]
                nearer = np.linalg.norm(apart, axis=1) < np.linalg.norm(other, axis=1)
                apart = np.where(nearer[:, None], apart, other)
            with np.errstate(over="ignore", invalid="ignore"):
                found[name] = float(np.sqrt(np.mean(apart**2, axis=0)).max() / self._ranges[name])
        return found

    def error(self, course: Course, right: Array | None = None) -> float:
        """The largest of `errors`; infinite if the run failed."""
        largest = max(self.errors(course, right).values())
        return largest if np.isfinite(largest) else np.inf
