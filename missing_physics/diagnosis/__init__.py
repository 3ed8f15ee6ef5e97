"""From a robot and recordings to a diagnosis: estimate, locate, name, model, prove, judge."""

from missing_physics.diagnosis.pipeline import Options, diagnose
from missing_physics.diagnosis.result import Diagnosis, Result

__all__ = ["Diagnosis", "Options", "Result", "diagnose"]
