"""What is there and has no name: where, what it depends on, and its measured curve."""

from __future__ import annotations

from missing_physics.diagnosis.least_squares.explanation import Explanation
from missing_physics.diagnosis.unnamed.adequacy import Accounts
from missing_physics.diagnosis.unnamed.coordinates import Coordinate, Wandering
from missing_physics.diagnosis.unnamed.curves import Foretold, Leftover
from missing_physics.diagnosis.written.words import labelled
from missing_physics.results.result import Curve, Unnamed, in_words
from robot_model import unit_of

__all__ = ["unnamed"]

#: A curve that foretells less of what is left is not worth telling.
WORTH_TELLING = 0.1


def unnamed(explanation: Explanation, accounts: Accounts) -> tuple[Unnamed, ...]:
    """What curves without a law foretell of what the explanation leaves, joint by joint."""
    found = []
    for index, leftover in accounts.left.items():
        if leftover.coordinate is not None and leftover.best is not None and leftover.share > WORTH_TELLING:
            found.append(_told(explanation, index, leftover))
    return tuple(found)


def _told(explanation: Explanation, index: int, leftover: Leftover) -> Unnamed:
    problem, over = explanation.problem, leftover.coordinate
    assert over is not None
    assert leftover.best is not None
    output = problem.outputs[index]
    joint = problem.robot.joint(output.place)
    unit = unit_of(output.channel, prismatic=joint.kind == "prismatic")
    left = float(problem.noise_floor[index]) * leftover.left**0.5
    law = ""
    knots: tuple[tuple[float, ...], ...] = ()
    curves: tuple[Curve, ...] = ()
    if isinstance(over, Coordinate):
        what = f"a curve over {' and '.join(in_words(name) for name in over.variables)}"
        knots = tuple(tuple(float(x) for x in own) for own in over.knots)
        parts = over.parts
        size = leftover.best.curve.size // len(parts)
        curves = tuple(_curve(part, leftover.best, k * size, size) for k, part in enumerate(parts))
    elif isinstance(over, Wandering):
        law, what = over.law, f"letting the numbers of {labelled(over.law)} change with time"
    else:  # its numbers hold for widths or delays, and are no torques
        what = f"a force that remembers {' and '.join(in_words(name) for name in over.variables)}"
    return Unnamed(
        location=output.place,
        channel=output.channel,
        unit=unit,
        depends_on=over.variables,
        law=law,
        share=leftover.share,
        left=left,
        knots=knots,
        curves=curves,
        words=(
            f"{output.channel}: of the {left:.3g} {unit} rms left in data that were not fitted, {what} "
            f"predicts {leftover.share:.0%} of the energy; no effect of the catalogue does."
        ),
    )


def _curve(carrier: str, whole: Foretold, start: int, size: int) -> Curve:
    """One of the curves that lie one after another."""
    own = [
        (float(x), float(half))
        for x, half in zip(whole.curve[start : start + size], whole.half[start : start + size])
    ]
    return Curve(carrier, tuple(x for x, _ in own), tuple((x - half, x + half) for x, half in own))
