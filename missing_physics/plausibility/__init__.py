"""Credible values of the parameters of robots and effects, independent of data."""

from missing_physics.plausibility.before import before, is_credible_number
from missing_physics.plausibility.judgement import NOT_CREDIBLE, implausible
from missing_physics.plausibility.table import TABLE, Credible, credible_range

__all__ = [
    "NOT_CREDIBLE",
    "TABLE",
    "Credible",
    "before",
    "credible_range",
    "implausible",
    "is_credible_number",
]
