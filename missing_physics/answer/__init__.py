"""From weighed hypotheses to a diagnosis: residuals, missing effects, and the augmented robot."""

from missing_physics.answer.answer import answered
from missing_physics.answer.scope import has_two_encoders, require_weighable

__all__ = ["answered", "has_two_encoders", "require_weighable"]
