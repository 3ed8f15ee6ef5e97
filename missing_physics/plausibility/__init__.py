"""What numbers of robots and their effects can be, whatever data say."""

from missing_physics.plausibility.before import before
from missing_physics.plausibility.judgement import NOT_CREDIBLE, implausible
from missing_physics.plausibility.table import TABLE, Credible, credible_range

__all__ = ["NOT_CREDIBLE", "TABLE", "Credible", "before", "credible_range", "implausible"]
