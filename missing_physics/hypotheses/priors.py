"""What is known of an effect's numbers before any recording: the credible ranges, as Gaussians."""

from __future__ import annotations

from missing_physics.hypotheses.term import Term
from missing_physics.plausibility.table import GRAVITY, credible_range
from reference_model.effects.base import Parameter

__all__ = ["prior_of"]

#: Standard gravity [m/s^2].
STANDARD_GRAVITY = 9.80665
#: Amplitude of an encoder's error over a turn [rad or m]: discs are centred to some hundredths of a millimetre.
ECCENTRICITY = 1e-3


def prior_of(term: Term, parameter: Parameter) -> tuple[float, float] | None:
    """Mean and standard deviation of a number; None where only the recordings tell its size."""
    known = credible_range(term.effect.id, parameter.name, term.at)
    if known is not None:
        return 0.0, 0.5 * max(-known.low, known.high)
    if term.effect.id == "gravity":
        return 0.0, 0.5 * GRAVITY * STANDARD_GRAVITY
    if term.effect.id == "encoder_eccentricity" and parameter.linear:
        return 0.0, 0.5 * ECCENTRICITY
    return None
