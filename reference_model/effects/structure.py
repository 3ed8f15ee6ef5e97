"""The interface of effects that change the robot's structure: a flexible link, a compliant base."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar

from reference_model.effects.base import Effect
from reference_model.flexible import FlexibleBody
from robot_model import Robot

__all__ = ["StructureEffect"]


class StructureEffect(Effect):
    """Changes the description of the robot; the controller still uses the original one.

    It has no regressors along a recorded motion, since it adds coordinates that no joint recording holds; an
    effect that only changes a flexible link has them along the motion of the link's modes.
    """

    along_motion = False
    #: It changes only the constants of a flexible link, all proportional to its one parameter.
    reshapes: ClassVar[bool] = False

    #: Effects of a lower stage are applied first: which links bend, then how.
    stage: ClassVar[int] = 0

    @property
    def is_searched(self) -> bool:
        return self.reshapes

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

    def reshaped(self, body: FlexibleBody, p: Mapping[str, float]) -> FlexibleBody:
        """The changed constants of its flexible link, where a description cannot express the change."""
        return body
