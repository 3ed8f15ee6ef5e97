"""The standard identification model, which is shown next to every answer."""

from missing_physics.standard.model import JointErrors, StandardModel, fit_standard

__all__ = ["JointErrors", "StandardModel", "fit_standard"]
