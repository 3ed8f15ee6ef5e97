"""From weighed hypotheses to a diagnosis: where recordings differ, what is missing, the robot with it."""

from missing_physics.answer.answer import answered
from missing_physics.answer.scope import has_two_encoders, why_not_weighed

__all__ = ["answered", "has_two_encoders", "why_not_weighed"]
