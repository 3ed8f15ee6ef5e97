"""The standard identification model, reported next to every answer."""

from missing_physics.standard.model import JointErrors, StandardModel, fit_standard
from missing_physics.standard.rows import MODEL_ERROR, Sample

__all__ = [
    "MODEL_ERROR",
    "JointErrors",
    "Sample",
    "StandardModel",
    "fit_standard",
]
