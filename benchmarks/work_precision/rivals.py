"""The compared engines: preparation for a case, and run.

A `Trial` is one engine at one step or tolerance. Preparation is timed separately from the run; a run stores
the positions at `manoeuvres.SAMPLES` instants in memory, no files.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any, ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from benchmarks.native import EXPLICIT, IMPLICIT, CompiledLaws, NativeRun, Setting
from benchmarks.work_precision.manoeuvres import CASES, Case, Course
from benchmarks.work_precision.truth import MOST_STEPS, Truth, closed_loop
from exudyn_model.simulation import simulate as exudyn_simulate
from reference_model.fixed_steps.realtime import FixedRun
from reference_model.steppers.explicit_run import ExplicitRun
from reference_model.steppers.integration import cvodes
from reference_model.steppers.rosenbrock_run import RosenbrockRun
from robot_model import InputError, Recording, Robot

__all__ = [
    "COMPILED",
    "EXUDYN",
    "MUJOCO",
    "NATIVE",
    "OWN",
    "PYTHON",
    "CompiledTrial",
    "NativeTrial",
    "OwnTrial",
    "PythonTrial",
    "Trial",
    "exudyn_trial",
    "own_trials",
    "trials",
]

Array = NDArray[np.float64]

#: Families; the fastest method of each at a given error is reported.
OWN, NATIVE, MUJOCO = "reference model", "Exudyn", "MuJoCo"
COMPILED, PYTHON = "Exudyn with compiled functions", "Exudyn with Python functions"
EXUDYN = (NATIVE, COMPILED, PYTHON)


class Trial(ABC):
    """One engine at one setting.

    Attributes:
        family, method: of the engine; points of one method make one curve.
        setting: step or tolerance in words.
        prepared: time of the last preparation [s].
    """

    family: ClassVar[str]

    def __init__(self, case: Case, method: str, setting: str) -> None:
        self.case, self.method, self.setting = case, method, setting
        self.prepared = 0.0

    @abstractmethod
    def prepare(self) -> Callable[[], None]:
        """Prepare a run."""

    @abstractmethod
    def course(self) -> Course:
        """Result of the last run."""

    def timed(self) -> float:
        """Processor time of one run [s]; infinite if it fails."""
        start = time.process_time()
        run = self.prepare()
        self.prepared = time.process_time() - start
        return self.run_ready(run)

    @staticmethod
    def run_ready(run: Callable[[], None]) -> float:
        """Processor time of the prepared run [s]; infinite if it fails."""
        start = time.process_time()
        try:
            run()
        except (InputError, RuntimeError, ValueError):
            return np.inf
        return time.process_time() - start


class OwnTrial(Trial):
    """The reference model: everything compiled once, then a run from the initial state."""

    family = OWN

    def __init__(
        self, case: Case, setting: str, method: str, make: Callable[[], Array], truth: Truth
    ) -> None:
        super().__init__(case, method, setting)
        self._make, self._truth = make, truth

    def prepare(self) -> Callable[[], None]:
        def run() -> None:
            self._states = self._make()

        return run

    def course(self) -> Course:
        return Course(self.case.instants, self._truth.seen(self._states))


class NativeTrial(Trial):
    """Exudyn with nothing in Python."""

    family = NATIVE

    def __init__(self, case: Case, setting: Setting) -> None:
        step = f"{setting.steps} steps" if setting.steps else f"tolerance {setting.tolerance:.0e}"
        super().__init__(case, setting.method, step)
        self._chosen = setting
        self._laws: CompiledLaws | None = None

    def prepare(self) -> Callable[[], None]:
        self._run = NativeRun(self.case, self._chosen, self._laws)
        return self._run

    def course(self) -> Course:
        return self._run.course()


class CompiledTrial(NativeTrial):
    """Exudyn with control and friction as user functions in C."""

    family = COMPILED

    def __init__(self, case: Case, setting: Setting, laws: CompiledLaws) -> None:
        super().__init__(case, setting)
        self._laws = laws

    @property
    def called(self) -> Any:
        """The user functions of the last run; see `native.compiled`."""
        return self._run.called


class PythonTrial(Trial):
    """`exudyn_model.simulate`: Python functions for control and friction, with its own step control."""

    family = PYTHON

    def __init__(self, case: Case, step: float) -> None:
        super().__init__(case, "`exudyn_model`", f"largest step {1e3 * step:g} ms")
        self._step = step

    def prepare(self) -> Callable[[], None]:
        def run() -> None:
            self._recording = exudyn_simulate(self.case.robot, sensors=False, step=self._step)

        return run

    def course(self) -> Course:
        return Course(self._recording.time, recorded(self.case.robot, self._recording))


def recorded(robot: Robot, recording: Recording) -> Array:
    """The quantities of a recording."""
    names = [f"{joint.name}.position" for joint in robot.moving_joints]
    if robot.base.kind == "free":
        names += [f"base.position.{axis}" for axis in "xyz"] + [f"base.attitude.{axis}" for axis in "wxyz"]
    names += [f"{link.name}.tip_deflection.{axis}" for link in robot.flexible_links for axis in "xyz"]
    return np.array([recording.channels[name] for name in names]).T


class MujocoTrial(Trial):
    """MuJoCo's Runge-Kutta method of order 4, its steps taken in C++ by `mujoco.rollout`."""

    family = MUJOCO

    def __init__(self, case: Case, steps: int) -> None:
        super().__init__(case, "RK4", f"{steps} steps")
        self._steps = steps

    def prepare(self) -> Callable[[], None]:
        from benchmarks.work_precision.mujoco_run import MujocoRun

        self._run = MujocoRun(self.case, self._steps)
        return self._run

    def course(self) -> Course:
        return self._run.course()


#: Integrators of the reference model with error control; CVODES is rebuilt for every tolerance.
METHODS = {"CVODES": None, "explicit, order 8": ExplicitRun, "Rosenbrock": RosenbrockRun}
#: Tolerances of the reference model, and of Exudyn's method with error control.
TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11)
DOPRI5 = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
#: Numbers of steps of fixed ones.
OWN_STEPS = (500, 1000, 2000, 5000)
RIGID_STEPS = (100, 200, 500, 1000, 2000, 5000)
FLEXIBLE_STEPS = (100, 200, 500, 1000, 2000, 5000, 10_000)
MUJOCO_STEPS = (250, 500, 1000, 2000, 4000)


def trials(case: Case, truth: Truth) -> Sequence[Trial]:
    """All trials of a case."""
    found: list[Trial] = [trial for method in METHODS for trial in own_trials(case, truth, method)]
    if case.fixed:
        found += fixed_trials(case, truth)
    found += [exudyn_trial(case, setting) for setting in _native(case)]
    found += [PythonTrial(case, step) for step in case.python_steps]
    if case.mujoco:
        found += [MujocoTrial(case, steps) for steps in MUJOCO_STEPS]
    return found


def exudyn_trial(case: Case, setting: Setting) -> NativeTrial:
    """Exudyn at its fastest: without Python, or where it needs user functions, with compiled ones."""
    return NativeTrial(case, setting) if case.native else CompiledTrial(case, setting, _compiled(case.name))


@cache
def _compiled(name: str) -> CompiledLaws:
    return CompiledLaws.of(CASES[name].robot)


def own_trials(
    case: Case, truth: Truth, method: str, tolerances: Sequence[float] = TOLERANCES
) -> Sequence[OwnTrial]:
    """The reference model by one of `METHODS` over tolerances."""
    plant, reference, loop = closed_loop(case.robot)
    start, later = plant.initial(reference), case.instants[1:].tolist()
    march = METHODS[method](plant, reference) if method != "CVODES" else None
    found = []
    for tolerance in tolerances:
        options = {"reltol": tolerance, "abstol": 1e-2 * tolerance, "max_num_steps": MOST_STEPS}
        if march is None:
            run = _cvodes_run(cvodes(loop, later, options, True), start)
        else:
            run = _march_run(march, case, tolerance)
        found.append(OwnTrial(case, f"tolerance {tolerance:.0e}", method, run, truth))
    return found


def fixed_trials(case: Case, truth: Truth) -> Sequence[OwnTrial]:
    """The reference model at fixed steps."""
    plant, reference, _ = closed_loop(case.robot)
    run = FixedRun(plant, reference, hold=0.0, compile_code=True)
    found = []
    for steps in OWN_STEPS:
        step = case.duration / steps
        make = partial(_fixed_run, run, case, step)
        found.append(OwnTrial(case, f"step {1e3 * step:g} ms", "fixed steps", make, truth))
    return found


def _fixed_run(run: FixedRun, case: Case, step: float) -> Array:
    return run(case.instants, step)[0]


def _cvodes_run(solver: ca.Function, start: Array) -> Callable[[], Array]:
    return lambda: np.vstack([start, solver(x0=start)["xf"].full().T])


def _march_run(march: ExplicitRun | RosenbrockRun, case: Case, tolerance: float) -> Callable[[], Array]:
    return lambda: march(case.instants, rtol=tolerance, atol=1e-2 * tolerance)


def _native(case: Case) -> Sequence[Setting]:
    steps = FLEXIBLE_STEPS if case.flexible else RIGID_STEPS
    found = [Setting(method, steps=count) for method in IMPLICIT for count in steps]
    if case.flexible or case.stiff:
        return found
    for method in EXPLICIT:
        if "tolerance" in method:
            found += [Setting(method, tolerance=tolerance) for tolerance in DOPRI5]
        else:
            found += [Setting(method, steps=count) for count in RIGID_STEPS]
    return found
