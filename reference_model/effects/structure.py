"""The interface of effects that change the robot's structure: a flexible link, a compliant base."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar

from reference_model.effects.base import Effect, Extent
from reference_model.flexible import FlexibleBody
from robot_model import Robot

__all__ = ["StructureEffect"]


class StructureEffect(Effect):
    """Changes the description of the robot; the controller still uses the original one.

    It may add coordinates that no encoder measures. They follow from the motion of the joints
    (`missing_physics.inference.torques.yielding`), as the modes of a flexible link do.
    """

    along_motion = False
    #: It changes only the constants of a flexible link, all proportional to its one parameter.
    reshapes: ClassVar[bool] = False
    #: Parameters that change masses; the others change stiffness and damping of the added coordinates only.
    weighs: ClassVar[tuple[str, ...]] = ()

    #: Effects of a lower stage are applied first: which links bend, then how.
    stage: ClassVar[int] = 0

    @property
    def is_searched(self) -> bool:
        return self.reshapes or self.adds_coordinates

    def limits(self, robot: Robot, at: str) -> Mapping[str, tuple[float, float]]:
        """Bounds of parameters narrower than the catalogue's for this robot."""
        return {}

    @abstractmethod
    def changed(self, robot: Robot, at: str, p: Mapping[str, float]) -> Robot:
        """The robot with the effect; the same object if the effect is absent.

        Joints with one coordinate and all names are unchanged.

        Raises:
            InputError: the robot cannot have the effect there.
        """

    def starts(self, extent: Extent) -> Sequence[Mapping[str, float]]:
        return ({p.name: p.typical for p in self.estimated},)

    def grid(self, robot: Robot) -> Sequence[Mapping[str, float]]:
        """Values of the estimated parameters; the best are starting values if it adds coordinates."""
        return ()

    def stiffened(self, p: Mapping[str, float], than: Mapping[str, float]) -> tuple[float, float]:
        """Stiffness and damping of the modes that it adds, relative to those with other parameters [-]."""
        return 1.0, 1.0

    def reshaped(self, body: FlexibleBody, p: Mapping[str, float]) -> FlexibleBody:
        """The changed constants of its flexible link, where a description cannot express the change."""
        return body
