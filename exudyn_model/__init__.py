"""The robot in Exudyn: an engine independent of the reference model, behind the same call.

Two formulations. Rigid robots run as `ObjectKinematicTree`, minimal coordinates: joint angles, their rates
and the reflected rotor inertia are then the coordinates themselves. Robots with flexible links or spherical
joints, and whatever depends on bearing loads, run as bodies and constraints (`exudyn_model.redundant`):
Exudyn's own constraint forces give the loads, flexible links are modal bodies in a floating frame or
geometrically exact beams. Constraints are kept at velocity level, where the trapezoidal rule leaves
accelerations and constraint forces free of ringing; both formulations are of second order.

Friction, controllers, reference motions, inverse dynamics, finite elements and modes are implemented here a
second time on purpose, so that agreement with the reference model is meaningful.
"""

from exudyn_model.forces.extra import ArmInstant, ExtraForce
from exudyn_model.simulation import (
    DEFAULT_STEP,
    Flexible,
    Formulation,
    Integrator,
    check,
    local_tolerance,
    measured,
    simulate,
)

__all__ = [
    "DEFAULT_STEP",
    "ArmInstant",
    "ExtraForce",
    "Flexible",
    "Formulation",
    "Integrator",
    "check",
    "local_tolerance",
    "measured",
    "simulate",
]
