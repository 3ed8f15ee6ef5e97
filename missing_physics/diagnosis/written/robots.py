"""The robots of an explanation: the one that is run in closed loop, and the one of the robot file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.preparation.setup import InertialBasis
from missing_physics.diagnosis.preparation.split import Split
from missing_physics.diagnosis.terms.term import Term
from missing_physics.diagnosis.written.augment import augmented_robot, with_masses
from missing_physics.diagnosis.written.bodies import with_bodies_of
from robot_model import Robot

__all__ = ["Robots"]


@dataclass(frozen=True)
class Robots:
    """Of a described robot.

    Attributes:
        robot: the description.
        basis: combinations of its inertial numbers that explanations estimate.
        passive: what is missing from base and links, whatever the explanation.
    """

    robot: Robot
    basis: InertialBasis
    passive: Sequence[Term]

    def running(self, best: Explanation) -> tuple[Robot, str]:
        """With what was found, and with masses that are surely others; see `with_masses`."""
        return with_masses(self._with_effects(best), self.basis, best)

    def real(self, best: Explanation) -> Robot | None:
        """The same; None where its mass properties are not those of real bodies."""
        changed, remark = self.running(best)
        return None if remark else changed

    def of_file(self, best: Explanation, data: Split, ran: Robot | None) -> tuple[Robot, str]:
        """With everything by which errors are stated; `ran` where they are those of its runs."""
        if ran is not None:
            return ran, ""
        return with_bodies_of(self._with_effects(best), self.basis, data, best)

    def _with_effects(self, best: Explanation) -> Robot:
        return augmented_robot(self.robot, (*best.terms, *self.passive))
