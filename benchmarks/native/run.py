"""A motion in Exudyn, prepared and run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from benchmarks.native.bodies import Bodies
from benchmarks.native.compiled import CompiledLaws
from benchmarks.native.engine import EXPLICIT, IMPLICIT, Setting, exu, settings_of
from benchmarks.native.laws import SymbolicLaws
from benchmarks.native.tree import Tree
from benchmarks.work_precision.manoeuvres import Case, Course

__all__ = ["NativeRun"]


@dataclass
class NativeRun:
    """One assembled system, to be run once.

    Attributes:
        case: the motion.
        setting: method and step.
        laws: compiled functions for control and friction; Exudyn's symbolic ones without them.
    """

    case: Case
    setting: Setting
    laws: CompiledLaws | None = None

    def __post_init__(self) -> None:
        exu.config.printToConsole, exu.config.suppressWarnings = False, True
        laws = self.laws or SymbolicLaws(self.case.robot)
        self._system = (Bodies if self.case.flexible else Tree)(self.case.robot, laws)
        self._settings = settings_of(self.case.duration, self.setting)
        name = {**EXPLICIT, **IMPLICIT}[self.setting.method]
        self._method = getattr(exu.DynamicSolverType, name)

    def __call__(self) -> None:
        """Run; only this is timed."""
        self._done = self._system.mbs.SolveDynamic(self._settings, solverType=self._method)

    @property
    def called(self) -> Any:
        """Objects of the laws in the system."""
        return self._system.called

    def course(self) -> Course:
        """Result of the run."""
        return self._system.course()
