"""From a robot and recordings to a diagnosis: check data, weigh hypotheses, compare models, decide."""

from missing_physics.coverage import Coverage, coverage, one_way_words, prepared, reason_words
from missing_physics.coverage.contradictions import ContradictionError, contradictions
from missing_physics.diagnosis.pipeline import Options, diagnose
from missing_physics.motion.recorded import make_dynamics, most_samples
from missing_physics.results.result import Diagnosis, Result

__all__ = [
    "ContradictionError",
    "Coverage",
    "Diagnosis",
    "Options",
    "Result",
    "contradictions",
    "coverage",
    "diagnose",
    "make_dynamics",
    "most_samples",
    "one_way_words",
    "prepared",
    "reason_words",
]
