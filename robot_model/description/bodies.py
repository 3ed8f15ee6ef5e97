"""Whether a link with a robot's effects is realisable: mass, first moment and inertia."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_model.description.types import Robot
from robot_model.input.errors import InputError
from robot_model.input.fields import inertia_fault

__all__ = ["require_body"]

#: Relative tolerance for rounding of a mass or an inertia that an effect subtracts.
ROUNDING = 1e-9


def require_body(
    robot: Robot, name: str, mass: float, first_moment: NDArray[np.float64], inertia: NDArray[np.float64]
) -> None:
    """Raise `InputError` when no body has these mass properties.

    Args:
        robot: the description.
        name: of the link, or `base`.
        mass: with the effects [kg].
        first_moment: mass times centre of mass [kg m], shape (3,).
        inertia: about the origin of the link's frame [kg m^2], shape (3, 3).
    """
    fault = _fault(mass, first_moment, inertia)
    if not fault:
        return
    what = "the base" if name == "base" else f"link '{name}'"
    raise InputError(
        f"robot '{robot.name}': with its effects, {what} has {fault}; correct the parameters of the payload "
        "or inertia there, or its own mass and inertia."
    )


def _fault(mass: float, first_moment: NDArray[np.float64], inertia: NDArray[np.float64]) -> str:
    """The fault, as the object of "has"; empty if there is none."""
    size = float(np.abs(inertia).max())
    if mass < -ROUNDING:
        return f"a mass of {mass:g} kg, and no mass is negative"
    moment = float(np.linalg.norm(first_moment))
    if mass <= ROUNDING:
        if moment > ROUNDING:
            return f"a first moment of {moment:g} kg m without a mass"
        central = inertia
    else:
        centre = first_moment / mass
        central = inertia - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))  # Steiner
    fault = inertia_fault(central + ROUNDING * size * np.eye(3)) if size else ""
    return f"mass properties that no body has ({fault} about its centre of mass)" if fault else ""
