"""From weighed hypotheses to a diagnosis: residuals, missing effects, and the augmented robot file."""

from missing_physics.answer.answer import answered

__all__ = ["answered"]
