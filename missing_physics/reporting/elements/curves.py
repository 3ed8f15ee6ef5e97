"""Measured curves of unnamed forces, as drawn by the report and the rerun file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from missing_physics.results.result import Curve, Unnamed, in_words
from robot_model import Robot, unit_of

__all__ = ["Band", "Panel", "Variable", "fine", "panels", "title_of", "variables"]

Array = NDArray[np.float64]

#: Points of a drawn surface along each of its variables.
FINE = 80
SIDES = {"forward": "moving forwards", "backward": "moving backwards"}
#: Parts of a force that changes with time, in words.
PARTS = {
    "": "whatever the motion",
    "direction": "along the direction of motion",
    "velocity": "in proportion to velocity",
    "torque": "in proportion to torque",
}


@dataclass(frozen=True)
class Variable:
    """Variable of a curve: in words, its unit, and the knots, shape (K,)."""

    name: str
    unit: str
    knots: Array


@dataclass(frozen=True)
class Band:
    """A curve or surface at its knots with its 95 % interval; NaN where the data do not determine it.

    Attributes:
        carrier: as in `Curve`.
        words: condition for which it holds; "" for always.
        knots: of a curve, which of a joint's own velocity ends at rest, shape (K,); of a surface, none.
        value, low, high: shape (K,), of a surface (K1, K2).
    """

    carrier: str
    words: str
    knots: Array
    value: Array
    low: Array
    high: Array


@dataclass(frozen=True)
class Panel:
    """Curves that share an axis: its channel and unit, and where there are several, which part it is."""

    channel: str
    unit: str
    words: str
    bands: tuple[Band, ...]


def title_of(item: Unnamed) -> str:
    """``What joint1 takes beyond the model, over joint1's velocity``."""
    over = " and ".join(in_words(name) for name in item.depends_on)
    return f"What {item.location} takes beyond the model, over {over}"


def variables(item: Unnamed, robot: Robot) -> tuple[Variable, ...]:
    """Variables of the curves of `item`, with units."""
    prismatic = _sliding(robot)
    return tuple(
        Variable(in_words(name), _unit(name, prismatic), np.array(knots))
        for name, knots in zip(item.depends_on, item.knots)
    )


def panels(item: Unnamed, robot: Robot) -> tuple[Panel, ...]:
    """The curves of `item` that the data determine somewhere, grouped by unit.

    Both directions of motion share a panel; every other carrier has its own.
    """
    made: dict[str, list[Band]] = {}
    for band in _bands(item):
        if np.isfinite(band.value).any():
            made.setdefault("" if band.words else band.carrier, []).append(band)
    several = len(item.curves) > 1
    return tuple(
        Panel(
            item.channel,
            _unit_beside(item, carrier, _sliding(robot)),
            PARTS.get(carrier, carrier) if several and not bands[0].words else "",
            tuple(bands),
        )
        for carrier, bands in made.items()
    )


def fine(over: tuple[Variable, ...], values: Array) -> tuple[Array, Array, Array]:
    """A surface between its knots, linear along each variable, on an even grid.

    Args:
        over: the two variables, of K1 and K2 knots.
        values: shape (K1, K2).

    Returns:
        The second variable, shape (M,), the first, shape (M,), and the surface, shape (M, M), a row for each
        value of the first.
    """
    y, x = (np.linspace(v.knots[0], v.knots[-1], FINE) for v in over)
    across = np.array([np.interp(x, over[1].knots, row) for row in values])
    return x, y, np.array([np.interp(y, over[0].knots, column) for column in across.T]).T


def _bands(item: Unnamed) -> Iterator[Band]:
    shape = tuple(len(knots) for knots in item.knots)
    for curve in item.curves:
        low, high = np.array([_finite(bounds) for bounds in curve.ci95]).T
        value = np.where(np.isfinite(low) & np.isfinite(high), np.array(curve.torque), np.nan)
        words = SIDES.get(curve.carrier, "")
        if len(shape) > 1:
            none = np.empty(0)
            yield Band(curve.carrier, words, none, *(x.reshape(shape) for x in (value, low, high)))
        else:
            knots = np.array(item.knots[0])
            kept = _kept(item, curve, knots)
            yield Band(curve.carrier, words, *(kept(x) for x in (knots, value, low, high)))


def _finite(bounds: tuple[float, float]) -> tuple[float, float]:
    low, high = bounds
    return (low, high) if np.isfinite(low) and np.isfinite(high) else (np.nan, np.nan)


def _kept(item: Unnamed, curve: Curve, knots: Array) -> Callable[[Array], Array]:
    """The valid part of a curve: over a joint's own velocity each direction has its side of rest."""
    sign = {"forward": 1.0, "backward": -1.0}.get(curve.carrier, 0.0)
    if not sign or item.depends_on != (f"{item.location}.velocity",) or not knots[0] < 0 < knots[-1]:
        return lambda values: values
    side = sign * knots > 0

    def own(values: Array) -> Array:
        rest, kept = np.interp(0.0, knots, values), values[side]
        return np.concatenate(([rest], kept) if sign > 0 else (kept, [rest]))

    return own


def _unit_beside(item: Unnamed, carrier: str, prismatic: set[str]) -> str:
    """Unit of what multiplies a carrier."""
    if carrier == "velocity":
        return f"{item.unit} s/{unit_of('joint.position', prismatic=item.location in prismatic)}"
    return "1" if carrier == "torque" else item.unit


def _unit(name: str, prismatic: set[str]) -> str:
    place, _, quantity = name.rpartition(".")
    if quantity in ("time", "time_since_rest", "last_rest"):
        return "s"
    own = "position" if quantity == "path_since_rest" else quantity
    return unit_of(f"{place}.{own}", prismatic=place in prismatic)


def _sliding(robot: Robot) -> set[str]:
    return {joint.name for joint in robot.joints if joint.kind == "prismatic"}
