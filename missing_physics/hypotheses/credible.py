"""What is known of an effect's numbers before any recording: credible ranges, as priors and as limits."""

from __future__ import annotations

from missing_physics.hypotheses.term import Term
from missing_physics.plausibility import credible_range, implausible
from missing_physics.plausibility.table import GRAVITY
from reference_model.effects.base import Parameter
from robot_model import Robot

__all__ = ["not_credible", "prior_of"]

#: Standard gravity [m/s^2].
STANDARD_GRAVITY = 9.80665
#: An encoder's error over a turn [rad or m]: discs are centred to some hundredths of a millimetre on radii of
#: some centimetres.
ECCENTRICITY = 1e-3
#: A credible range is two standard deviations wide to either side.
WIDTH = 0.5


def prior_of(term: Term, parameter: Parameter) -> tuple[float, float] | None:
    """Mean and standard deviation of a number; None where only the recordings tell its size."""
    known = credible_range(term.effect.id, parameter.name, term.at)
    if known is not None:
        return 0.0, WIDTH * max(-known.low, known.high)
    if term.effect.id == "gravity":
        return 0.0, WIDTH * GRAVITY * STANDARD_GRAVITY
    if term.effect.id == "encoder_eccentricity" and parameter.linear:
        return 0.0, WIDTH * ECCENTRICITY
    return None


def not_credible(term: Term, robot: Robot, needed: float) -> str:
    """Why a term cannot be as it was fitted, in half a sentence; empty where it can.

    Args:
        term: with fitted numbers.
        robot: nominal.
        needed: largest torque that the recorded motion needs at its joint [N m or N].
    """
    effect, values = term.effect, term.parameters
    meaning = [p for p in term.free if p.absent is not None]
    if meaning and all(values[p.name] == p.absent for p in meaning):
        return "an effect without any effect"
    return effect.implausible(values) or implausible(effect.id, term.at, values, robot, needed=needed)
