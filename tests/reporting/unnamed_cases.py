"""Measured curves without a name, as provided by a diagnosis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from reporting_cases import hidden_friction

from missing_physics.results.result import Curve, Result, Unnamed

__all__ = ["drag", "roughness", "with_unnamed"]

Array = NDArray[np.float64]


def _unnamed(variable: str, knots: Array, carrier: str, value: Array, half: Array) -> Unnamed:
    pairs = tuple((float(v - h), float(v + h)) for v, h in zip(value, half))
    return Unnamed(
        location="joint2",
        channel="joint2.torque",
        unit="N m",
        depends_on=(f"joint2.{variable}",),
        share=0.93,
        left=1.24,
        knots=(tuple(map(float, knots)),),
        curves=(Curve(carrier, tuple(map(float, value)), pairs),),
        words=f"joint2.torque: of the 1.24 N m rms left, a curve over its {variable} predicts 93%.",
    )


def drag() -> Unnamed:
    """1.5 v |v|, with a step at rest, where both directions have a knot."""
    v = np.array([-2.0, -1.0, -0.4, 0.0, 0.0, 0.3, 0.9, 2.1])
    step = np.where(np.arange(v.size) < 4, -0.2, 0.2)
    return _unnamed("velocity", v, "", 1.5 * v * np.abs(v) + step, 0.1 + 0.1 * v**2)


def roughness() -> Unnamed:
    """sin(q) times the direction of motion."""
    q = np.linspace(-1.0, 1.0, 21)
    return _unnamed("position", q, "direction", np.sin(q), np.full(q.size, 0.1))


def with_unnamed(*items: Unnamed, name: str | None = None) -> Result:
    """A result in which `items` are left; `name` replaces every name that a file can bring in."""
    result = hidden_friction(seconds=4.0, name=name)
    if name:
        items = tuple(
            replace(
                item, location=name, channel=name, unit=name, depends_on=(f"{name}.velocity",), words=name
            )
            for item in items
        )
    return replace(result, diagnosis=replace(result.diagnosis, unnamed=items))
