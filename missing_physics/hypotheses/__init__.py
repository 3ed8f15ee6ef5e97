"""Hypotheses on missing physics: the standard model with effects at places, and candidates to add."""

from missing_physics.hypotheses.candidates import Candidate, Place, candidates
from missing_physics.hypotheses.credible import not_credible, prior_of
from missing_physics.hypotheses.extents import Sight, extent_of
from missing_physics.hypotheses.hypothesis import BODIES, TIMING, Hypothesis
from missing_physics.hypotheses.term import Term

__all__ = [
    "BODIES",
    "TIMING",
    "Candidate",
    "Hypothesis",
    "Place",
    "Sight",
    "Term",
    "candidates",
    "extent_of",
    "not_credible",
    "prior_of",
]
