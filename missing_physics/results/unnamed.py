"""What is there and has no name, with its measured curve."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Curve", "Unnamed"]


@dataclass(frozen=True)
class Curve:
    """A measured curve or surface, piecewise linear between its knots.

    Attributes:
        carrier: what it holds for or is multiplied by: "" (always), "forward" or "backward" motion, or
            "direction", "velocity" or "torque" of the joint.
        torque: what the actuator delivers beyond what the model needs, at each knot, the last variable
            changing fastest [the channel's unit, over the carrier's where it has one].
        ci95: 95 % confidence interval at each knot, infinite where the data say nothing.
    """

    carrier: str
    torque: tuple[float, ...]
    ci95: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Unnamed:
    """Something real without a name: what it depends on, and the curve that was measured.

    Attributes:
        location, channel, unit: where it shows.
        depends_on: one or two variables: a quantity of a joint, as ``joint2.velocity``; ``time`` since the
            recording began; ``joint1.path_since_rest``, ``joint1.time_since_rest`` or ``joint1.last_rest``,
            how long it rested last; what it did before: ``joint1.turns``, ``joint1.time_of_last_way``,
            ``joint1.past_acceleration``.
        law: label of a finding whose numbers change with it instead of a curve of its own; "" else.
        share: part of the residual energy in held-out data that it predicts.
        left: rms that the explanation leaves in held-out data, before it.
        knots: of each variable.
        curves: over them; none where `law` says more, or where it depends on what the joint did before.
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
