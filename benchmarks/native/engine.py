"""Exudyn's module without range checks, and the settings of a run."""

# ruff: noqa: E402  (the choice of Exudyn's module must come before its import)
from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

sys.exudynFast = True  # type: ignore[attr-defined]  # the module without range checks

import exudyn
import exudyn.itemInterface

from benchmarks.work_precision.manoeuvres import SAMPLES

__all__ = [
    "EXPLICIT",
    "IMPLICIT",
    "LOOSE",
    "Setting",
    "exu",
    "items",
    "module_name",
    "settings_of",
    "watched",
]

exu: Any = exudyn
items: Any = exudyn.itemInterface

#: Exudyn's methods by the names used here; those with "tolerance" control their error.
EXPLICIT: Mapping[str, str] = {
    "RK33": "RK33",
    "RK44": "RK44",
    "RK67": "RK67",
    "ODE23, tolerance": "ODE23",
    "DOPRI5, tolerance": "DOPRI5",
}
#: Implicit methods, with Exudyn's own relative Newton tolerance of 1e-8 or a larger one, which saves a third
#: of the iterations and matters at small errors only.
IMPLICIT: Mapping[str, str] = {
    "trapezoidal, index 2": "TrapezoidalIndex2",
    "trapezoidal, index 2, loose": "TrapezoidalIndex2",
    "generalised alpha": "GeneralizedAlpha",
    "generalised alpha, loose": "GeneralizedAlpha",
}
LOOSE = 1e-5


@dataclass(frozen=True)
class Setting:
    """Settings of a run: a method and its number of steps, or its tolerance."""

    method: str
    steps: int = 0
    tolerance: float = 0.0


def settings_of(duration: float, setting: Setting) -> Any:
    """Exudyn's settings for a run of `duration` [s]."""
    found = exu.SimulationSettings()
    integration = found.timeIntegration
    integration.endTime = duration
    integration.numberOfSteps = setting.steps or SAMPLES
    integration.verboseMode = 0
    integration.automaticStepSize = bool(setting.tolerance)
    integration.relativeTolerance, integration.absoluteTolerance = setting.tolerance, 1e-2 * setting.tolerance
    integration.explicit.computeEndOfStepAccelerations = False
    integration.newton.useModifiedNewton = True
    if setting.method.endswith("loose"):
        integration.newton.relativeTolerance = LOOSE
    found.solution.file.write = False
    found.solution.sensors.writePeriod = duration / SAMPLES
    return found


def watched(mbs: Any, node: int) -> Any:
    """A sensor that keeps the coordinates of a node in memory."""
    kind = exu.OutputVariableType.Coordinates
    return mbs.AddSensor(items.SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=kind))


def module_name() -> str:
    """Which of its two compiled modules Exudyn uses."""
    return str(exudyn.SystemContainer.__module__)
