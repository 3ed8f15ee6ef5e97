"""Unnamed forces, with their measured curves."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Curve", "Unnamed"]


@dataclass(frozen=True)
class Curve:
    """A measured curve, piecewise linear between its knots.

    Attributes:
        carrier: factor of the curve: "" (none) or "direction" of the joint's motion.
        torque: torque of the actuator beyond that required by the model, at each knot [the channel's unit].
        ci95: 95 % confidence interval at each knot.
    """

    carrier: str
    torque: tuple[float, ...]
    ci95: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Unnamed:
    """A real but unnamed force: the variable on which it depends, and its measured curve.

    Attributes:
        location, channel, unit: where it appears.
        depends_on: the variable, a quantity of a joint, as ``joint2.velocity``.
        share: part of the residual energy in held-out data that it predicts.
        left: rms of the residual in held-out data without it.
        knots: of the variable, in a list of one.
        curves: the one over the knots.
        words: a sentence.
    """

    location: str
    channel: str
    unit: str
    depends_on: tuple[str]
    share: float
    left: float
    knots: tuple[tuple[float, ...]]
    curves: tuple[Curve]
    words: str
