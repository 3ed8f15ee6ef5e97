"""Measured curves of unnamed forces, as drawn by the report and the rerun file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.results.result import Unnamed, in_words
from robot_model import Robot, unit_of

__all__ = ["Drawn", "drawn"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Drawn:
    """The curve of an unnamed force with its 95 % interval.

    Attributes:
        title: of the picture.
        across, upright: titles of its axes, with units.
        knots, value, low, high: shape (K,).
    """

    title: str
    across: str
    upright: str
    knots: Array
    value: Array
    low: Array
    high: Array


#: Quantities with the units of the variables of forces with memory, and what their curves run over.
LIKE = {"time_since_start": "time", "distance_since_start": "position"}
AFTER = {
    "time_since_start": "after a start at the fastest recorded speed",
    "distance_since_start": "on the way from a rest in the middle of the range",
}


def drawn(item: Unnamed, robot: Robot) -> Drawn:
    """The curve of `item`, with words and units."""
    [variable], [knots], [curve] = item.depends_on, item.knots, item.curves
    low, high = np.array(curve.ci95).T
    return Drawn(
        title=f"Torque of {item.location} beyond the model, {_where(variable)}",
        across=f"{in_words(variable)} [{_unit(variable, robot)}]",
        upright=f"{item.channel} [{item.unit}]",
        knots=np.array(knots),
        value=np.array(curve.torque),
        low=low,
        high=high,
    )


def _where(variable: str) -> str:
    return AFTER.get(variable.rpartition(".")[2], f"over {in_words(variable)}")


def _unit(variable: str, robot: Robot) -> str:
    place, _, quantity = variable.rpartition(".")
    prismatic = any(joint.name == place and joint.kind == "prismatic" for joint in robot.joints)
    like = LIKE.get(quantity, quantity)
    return unit_of(like if like == "time" or not place else f"{place}.{like}", prismatic=prismatic)
