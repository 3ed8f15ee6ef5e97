"""The interface of a force without a name: linear in its parameters, and reported as a curve.

If such a force predicts better than every known effect, there is physics that the catalogue cannot name.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from reference_model.effects.base import JointEffect, Parameter

__all__ = ["KNOTS", "UnknownForce", "fixed", "parameters"]

#: Knots at which a curve is reported.
KNOTS = 21


class UnknownForce(JointEffect):
    """A force on a joint that is a combination of given functions.

    Attributes:
        variable: name of what the reported curve runs over, as in a recording.
        of_joint: whether the variable belongs to the joint.
        carrier: factor of the curve, empty or `direction`.
        within: parameters of the standard model that belong to the force itself, as the mean of a curve;
            they are among `along`.
    """

    place = "joint"
    source = "linear combinations of basis functions"
    signature = "a residual that follows from the motion"
    experiment = "repeat the motion at other speeds and over other ranges"
    is_unknown = True
    variable: ClassVar[str]
    of_joint: ClassVar[bool] = True
    carrier: ClassVar[str] = ""
    within: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    def knots(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Knots at which the curve is reported, for these parameters, shape (K,)."""

    @abstractmethod
    def shape(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Derivatives of the curve at the knots by each estimated parameter, shape (K, P)."""

    def shape_within(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        """Derivatives of the curve at the knots by the parameters `within`, shape (K, W): of an offset."""
        return np.full((self.knots(values).size, len(self.within)), -1.0)

    @abstractmethod
    def phrase(self, variable: str) -> str:
        """What it is, for people.

        Args:
            variable: of the curve, in words.
        """


def parameters(count: int, unit: str, *fixed: Parameter) -> tuple[Parameter, ...]:
    """Coefficients c1 to c`count` of the functions, and further parameters that are not estimated."""
    own = (
        Parameter(f"c{i}", unit, f"of function {i}", -1e9, 1e9, 1.0, absent=0.0, linear=True)
        for i in range(1, 1 + count)
    )
    return (*own, *fixed)


def fixed(name: str, unit: str, meaning: str, default: float = 1.0) -> Parameter:
    """A parameter that follows from the recordings and is not estimated."""
    return Parameter(name, unit, meaning, -1e9, 1e9, 1.0, estimated=False, default=default)
