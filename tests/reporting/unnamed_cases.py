"""Measured curves without a name, as a diagnosis hands them over."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from reporting_cases import hidden_friction

from missing_physics.results.result import Curve, Result, Unnamed

__all__ = ["drag", "law_that_changes", "surface", "wandering", "with_unnamed"]

Array = NDArray[np.float64]
INFINITE = float("inf")


def _curve(carrier: str, values: Array, half: Array) -> Curve:
    flat = [(float(v), float(h)) for v, h in zip(values.ravel(), half.ravel())]
    return Curve(carrier, tuple(v for v, _ in flat), tuple((v - h, v + h) for v, h in flat))


def _unnamed(over: tuple[str, ...], knots: tuple[Array, ...], curves: tuple[Curve, ...]) -> Unnamed:
    return Unnamed(
        location="joint2",
        channel="joint2.torque",
        unit="N m",
        depends_on=over,
        law="",
        share=0.93,
        left=1.24,
        knots=tuple(tuple(float(x) for x in own) for own in knots),
        curves=curves,
        words="joint2.torque: of the 1.24 N m rms left, a curve foretells 93% of the energy.",
    )


def drag() -> Unnamed:
    """1.5 v |v|; each direction is told on its own side, but for its fastest knot backwards."""
    v = np.array([-2.0, -1.5, -1.0, -0.4, 0.3, 0.9, 1.4, 2.1])
    told = {"forward": v > -0.5, "backward": (v < 0.4) & (v > -1.9)}
    return _unnamed(
        ("joint2.velocity",),
        (v,),
        tuple(
            _curve(side, np.where(keep, 1.5 * v * np.abs(v), 0.0), np.where(keep, 0.1 + 0.1 * v**2, INFINITE))
            for side, keep in told.items()
        ),
    )


def wandering() -> Unnamed:
    """A force that changes with time, of which one part cannot be told at all."""
    t = np.linspace(0.0, 20.0, 6)
    parts = ("", "direction", "velocity", "torque")
    half = {"": 0.1, "direction": 0.2, "velocity": 0.3, "torque": INFINITE}
    return _unnamed(
        ("time",),
        (t,),
        tuple(_curve(part, np.sin(t + k), np.full(t.size, half[part])) for k, part in enumerate(parts)),
    )


def surface() -> Unnamed:
    """sin(q) v, without data in one corner."""
    q, v = np.linspace(-1.0, 1.0, 5), np.linspace(-2.0, 2.0, 4)
    value = np.sin(q)[:, None] * v
    half = 0.1 + 0.05 * np.abs(value)
    half[0, 0] = INFINITE
    sides = tuple(_curve(side, value, half) for side in ("forward", "backward"))
    return _unnamed(("joint2.position", "joint2.velocity"), (q, v), sides)


def law_that_changes() -> Unnamed:
    """No curve of its own: the numbers of a law change with time."""
    return replace(_unnamed(("time",), (), ()), law="viscous_friction@joint2")


def with_unnamed(*items: Unnamed, name: str | None = None) -> Result:
    """A result in which `items` are left; `name` replaces every name that a file can bring in."""
    result = hidden_friction(seconds=4.0, name=name)
    if name:
        items = tuple(
            replace(
                item, location=name, channel=name, unit=name, depends_on=(name,) * len(item.knots), words=name
            )
            for item in items
        )
    return replace(result, diagnosis=replace(result.diagnosis, unnamed=items))
