"""The interface of effects that change what the robot is: a link that bends, a base that gives way."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar

from reference_model.effects.base import Effect
from reference_model.flexible import FlexibleBody
from robot_model import Robot

__all__ = ["StructureEffect"]


class StructureEffect(Effect):
    """Changes the description of the robot; its controller keeps believing in the one it was given.

    It has no regressors along a recorded motion, since coordinates appear that no joint recording holds; one
    that only reshapes a link that bends has them along the motion of the link's modes.
    """

    along_motion = False
    #: It changes only the constants of a flexible link, all in proportion to its one parameter.
    reshapes: ClassVar[bool] = False

    #: Those of a lower stage are carried out first: what bends at all, then how it does.
    stage: ClassVar[int] = 0

    @property
    def is_searched(self) -> bool:
        return self.reshapes

    def limits(self, robot: Robot, at: str) -> Mapping[str, tuple[float, float]]:
        """Bounds of parameters that this robot makes narrower than the catalogue's."""
        return {}

    @abstractmethod
    def changed(self, robot: Robot, at: str, p: Mapping[str, float]) -> Robot:
        """The robot as it is; the very same one where the effect is absent.

        Joints with one coordinate stay as they are, and so do all names.

        Raises:
            InputError: the robot cannot have the effect there.
        """

    def reshaped(self, body: FlexibleBody, p: Mapping[str, float]) -> FlexibleBody:
        """The constants of the flexible link it sits at, where no description can say what it changes."""
        return body
