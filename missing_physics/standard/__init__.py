"""The standard identification model, which is shown next to every answer."""

from missing_physics.standard.model import JointErrors, StandardModel, fit_standard
from missing_physics.standard.offset import Offset, torque_offsets

__all__ = ["JointErrors", "Offset", "StandardModel", "fit_standard", "torque_offsets"]
