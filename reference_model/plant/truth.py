"""The true robot with its effects, as opposed to the nominal robot of its description and controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from reference_model.dynamics.equations import Mechanism
from reference_model.dynamics.inertial import BODY_NUMBERS, body_names, nominal_inertial
from reference_model.dynamics.outside import Outside
from reference_model.dynamics.symbolic import Motion, SymbolicRobot
from reference_model.dynamics.tree import Tree, tree_of
from reference_model.effects.base import BodyEffect
from reference_model.effects.catalogue import UsedEffect, used_effects
from reference_model.effects.structure import StructureEffect
from reference_model.kinematics.spatial import quaternion_from_rpy, rotation_from_rpy
from reference_model.plant.acting import bodies_with, inertial_with
from reference_model.plant.body_forces import BodyForces
from reference_model.plant.gears import Gears
from robot_model import InputError, Robot
from robot_model.description.bodies import require_body

__all__ = ["Truth", "require_bodies", "structured", "truth_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Truth:
    """The true robot.

    Attributes:
        nominal: the given description.
        robot: with the structure effects; the joints are those of the description.
        effects: all effects, checked.
        tree: of `robot`, with changes of its flexible links by other effects.
        inertial: its inertial parameters, shape (P,).
        gears: its drives with separate motor coordinates.
        forces: the force effects on its bodies.
    """

    nominal: Robot
    robot: Robot
    effects: tuple[UsedEffect, ...]
    tree: Tree
    inertial: Array
    gears: Gears
    forces: BodyForces

    def symbolic(self, motion: Motion, time: ca.SX, states: ca.SX) -> SymbolicRobot:
        """Its dynamics in a motion, at a time [s] and in states of `forces`."""

        def outside(mechanism: Mechanism) -> Outside:
            return self.forces.act(mechanism, time, states)

        return SymbolicRobot(self.robot, motion, ca.SX(self.inertial), tree=self.tree, outside=outside)

    def believed(self, motion: Motion) -> Motion:
        """A motion of the true robot as measured by a controller that uses the description."""
        if self.nominal is self.robot:
            return motion
        inboard = {}
        if self.nominal.base.kind != "free":
            inboard = SymbolicRobot.still_base(self.nominal)
        kept = []
        for link in self.nominal.flexible_links:
            body = self.tree.bodies[self.tree.index(link.name)]
            kept += list(range(body.modal, body.modal + body.modes))
        modal = {name: getattr(motion, name)[kept] for name in ("modal", "modal_rates")}
        return replace(motion, **inboard, **modal)


def structured(robot: Robot, effects: Sequence[UsedEffect]) -> Robot:
    """The description with its structure effects applied.

    Raises:
        InputError: the robot cannot have one of them, with robot, effect and place.
    """
    found = [(used.effect, used) for used in effects if isinstance(used.effect, StructureEffect)]
    for effect, used in sorted(found, key=lambda pair: pair[0].stage):
        try:
            robot = effect.changed(robot, used.at, used.parameters)
        except InputError as error:
            raise InputError(f"robot '{robot.name}', effect '{effect.id}' at '{used.at}': {error}") from None
    return robot


def truth_of(robot: Robot) -> Truth:
    """The true robot, from a description with effects.

    Raises:
        InputError: an effect that does not exist, with unusable parameters, or that the robot cannot have.
    """
    effects = used_effects(robot)
    real = structured(robot, effects)
    tree = tree_of(real, bodies_with(real, effects))
    gears = Gears(real, effects)
    inertial = inertial_with(real, nominal_inertial(real), effects, gears.drives)
    forces = BodyForces(real, tree, effects)
    if forces.carries_start:
        forces = BodyForces(real, tree, effects, _weight_on_base(real, tree, inertial))
    return Truth(robot, real, effects, tree, inertial, gears, forces)


def require_bodies(truth: Truth) -> None:
    """Raise `InputError` where effects leave a link, or a free base, with impossible mass properties."""
    changed = {used.at for used in truth.effects if isinstance(used.effect, BodyEffect)}
    for k, name in enumerate(body_names(truth.robot)):
        if name not in changed:
            continue
        mass, *rest = truth.inertial[len(BODY_NUMBERS) * k :][: len(BODY_NUMBERS)]
        moment, (xx, yy, zz, xy, xz, yz) = np.array(rest[:3]), rest[3:]
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        bending = truth.tree.bodies[truth.tree.index(name)].flexible
        if bending is not None:
            mass, moment, inertia = (
                mass + bending.mass,
                moment + bending.first_moment,
                inertia + bending.inertia,
            )
        require_body(truth.nominal, name, float(mass), moment, inertia)


def _weight_on_base(robot: Robot, tree: Tree, inertial: Array) -> Array:
    """Wrench [force; moment] about the base's origin in inertial axes that holds the robot still, (6,)."""
    position = ca.SX([joint.initial_position for joint in robot.moving_joints])
    still = ca.SX(len(robot.moving_joints), 1)
    straight = ca.SX(np.tile([1.0, 0.0, 0.0, 0.0], len(tree.balls)))
    motion = Motion(
        position,
        still,
        still,
        ca.SX(quaternion_from_rpy(robot.base.rpy)),
        ca.SX(6, 1),
        ca.SX(6, 1),
        ca.SX(np.asarray(robot.base.position, dtype=float)),
        balls=straight,
        ball_rates=ca.SX(3 * len(tree.balls), 1),
        modal=ca.SX(tree.modal, 1),
        modal_rates=ca.SX(tree.modal, 1),
        inner_acceleration=ca.SX(tree.inner, 1),
    )
    needed = SymbolicRobot(robot, motion, ca.SX(inertial), tree=tree).wrenches[0]
    wrench = ca.evalf(ca.densify(needed)).full().reshape(2, 3)
    return (wrench @ rotation_from_rpy(robot.base.rpy).T).ravel()
