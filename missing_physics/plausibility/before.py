"""Credible prior intervals of the parameters of effects."""

from __future__ import annotations

import math

import numpy as np

from missing_physics.plausibility.table import INERTIAL_CHANGE, credible_range
from reference_model.effects.gravity import TILT
from robot_model import Inertial, Robot

__all__ = ["before", "is_credible_number"]

#: Half width of a 95 % interval in standard deviations.
QUANTILE = 1.96


def before(effect: str, place: str, parameter: str, robot: Robot) -> tuple[float, float]:
    """95 % prior interval of a parameter, in its unit.

    Args:
        effect, place: as in a robot file.
        parameter: of the effect.
        robot: nominal.

    Returns:
        Lower and upper bound; infinite if only recordings determine the parameter's value.
    """
    row = credible_range(effect, parameter, place)
    if row is not None:
        return row.low, row.high
    half = math.inf
    if effect == "gravity":
        half = TILT * (float(np.linalg.norm(robot.gravity)) or math.inf)
    elif effect == "inertia":
        bodies: dict[str, Inertial] = {"base": robot.base, **{link.name: link for link in robot.links}}
        if place in bodies:
            half = QUANTILE * INERTIAL_CHANGE * (_size(bodies[place], parameter) or math.inf)
    return -half, half


def is_credible_number(name: str, estimate: float, nominal: float, robot: Robot) -> bool:
    """Whether the error of a body's or rotor's parameter in the robot file is credible; else true.

    Args:
        name: of the parameter, `LINK.mass`, `LINK.first_moment.x`, `LINK.inertia.xx`, of a beam or a rotor.
        estimate, nominal: in its unit.
        robot: nominal.
    """
    body, _, number = name.partition(".")
    half = math.inf
    if number == "reflected_inertia" and nominal > 0.0:  # a file without rotors may lack any
        half = QUANTILE * INERTIAL_CHANGE * nominal
    if body == "base" or body in {link.name for link in robot.links}:
        is_of_ten = number.split(".")[0] in ("mass", "first_moment", "inertia")  # the others are a beam's
        half = QUANTILE * INERTIAL_CHANGE * abs(nominal)
        if is_of_ten:
            half = before("inertia", body, number.replace(".", "_"), robot)[1]
    return abs(estimate - nominal) <= half


def _size(body: Inertial, parameter: str) -> float:
    """Size of a body's parameter: mass [kg], first moment [kg m] or inertia about the frame [kg m^2]."""
    centre = np.asarray(body.center_of_mass)
    steiner = body.mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    inertia = float(np.max(np.diag(body.inertia_matrix + steiner)))
    if parameter == "mass":
        return body.mass
    return (body.mass * inertia) ** 0.5 if parameter.startswith("first_moment") else inertia
