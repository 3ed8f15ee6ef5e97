"""From a robot and recordings to a diagnosis: estimate, locate, name, model, prove, judge."""

from missing_physics.diagnosis.coverage import Coverage, coverage, one_way_words, prepared, reason_words
from missing_physics.diagnosis.coverage.contradictions import ContradictionError, contradictions
from missing_physics.diagnosis.pipeline import Options, by_weighing, diagnose
from missing_physics.diagnosis.preparation.setup import make_dynamics, most_samples
from missing_physics.diagnosis.regression import by_regression
from missing_physics.results.result import Diagnosis, Result

__all__ = [
    "ContradictionError",
    "Coverage",
    "Diagnosis",
    "Options",
    "Result",
    "by_regression",
    "by_weighing",
    "contradictions",
    "coverage",
    "diagnose",
    "make_dynamics",
    "most_samples",
    "one_way_words",
    "prepared",
    "reason_words",
]
