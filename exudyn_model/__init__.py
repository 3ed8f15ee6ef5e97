"""The robot in Exudyn: an engine independent of the reference model, behind the same call.

Formulation: Exudyn's `ObjectKinematicTree`, minimal coordinates. Joint angles, their rates and the reflected
rotor inertia are then the coordinates themselves; there are no constraints to drift, no angle to unwrap,
and no index-3 system whose accelerations ring. Redundant bodies with joints would give the reactions in the
joints; where those are wanted they follow from the motion by Newton and Euler, tip to base, as in
`exudyn_model.rigid_dynamics`. Flexible links (floating frame, reduced order) attach to the tree's links
through rigid-body markers.

Friction, controllers, reference motions and inverse dynamics are written here a second time on purpose:
agreement with the reference model is then worth something.
"""

from exudyn_model.simulation import DEFAULT_STEP, simulate

__all__ = ["DEFAULT_STEP", "simulate"]
