"""Unnamed forces, with their measured curves."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Curve", "Unnamed"]


@dataclass(frozen=True)
class Curve:
    """A measured curve or surface, piecewise linear between its knots.

    Attributes:
        carrier: condition or factor of the curve: "" (always), "forward" or "backward" motion, or
            "direction", "velocity" or "torque" of the joint.
        torque: torque of the actuator beyond that required by the model, at each knot, the last variable
            changing fastest [the channel's unit, over the carrier's where it has one].
        ci95: 95 % confidence interval at each knot, infinite where the data do not determine it.
    """

    carrier: str
    torque: tuple[float, ...]
    ci95: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Unnamed:
    """A real but unnamed force: the variables on which it depends, and its measured curve.

    Attributes:
        location, channel, unit: where it appears.
        depends_on: one or two variables: a quantity of a joint, as ``joint2.velocity``; ``time`` since the
            recording began; ``joint1.path_since_rest``, ``joint1.time_since_rest`` or ``joint1.last_rest``,
            the duration of the last rest; or the history: ``joint1.turns``, ``joint1.time_of_last_way``,
            ``joint1.past_acceleration``.
        law: label of a finding whose parameters depend on them, instead of a separate curve; else "".
        share: part of the residual energy in held-out data that it predicts.
        left: rms of the residual in held-out data without it.
        knots: of each variable.
        curves: over the knots; none where `law` is given, or where it depends on the joint's history.
        words: a sentence.
    """

    location: str
    channel: str
    unit: str
    depends_on: tuple[str, ...]
    law: str
    share: float
    left: float
    knots: tuple[tuple[float, ...], ...]
    curves: tuple[Curve, ...]
    words: str
