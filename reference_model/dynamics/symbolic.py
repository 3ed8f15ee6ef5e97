"""The symbolic layer: expressions in, expressions out.

`RobotModel` compiles these for arrays; the simulator and estimators put their own expressions in.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import casadi as ca
import numpy as np

from reference_model.dynamics.balance import bearing_load, elastic_energy, kinetic_energy, potential_energy
from reference_model.dynamics.equations import (
    Mechanism,
    accelerations,
    forward_dynamics,
    generalised,
    joint_wrench,
    mass_matrix,
    solve_spd,
    wrenches,
)
from reference_model.dynamics.inertial import masses
from reference_model.dynamics.joints import node_of, node_step
from reference_model.dynamics.outside import Outside
from reference_model.dynamics.tree import State, Tree, recursion, tree_of
from reference_model.kinematics.spatial import quaternion_from_rpy
from robot_model import Bearing, Robot

__all__ = ["Motion", "SymbolicRobot"]


@dataclass(frozen=True)
class Motion:
    """Everything that moves at one instant, as expressions; base quantities as in `BaseMotion.stacked`.

    Attributes:
        position, velocity, acceleration: of the moving joints, n x 1.
        attitude: of the base, 4 x 1.
        base_velocity, base_acceleration: [linear; angular] in base axes, 6 x 1.
        base_position: origin of the base in the inertial frame [m], 3 x 1; only energy depends on it.
        balls, ball_rates, modal, modal_rates: of spherical joints and flexible links, as in `tree.State`.
        inner_acceleration: accelerations of spherical joints [rad/s^2], 3 k, then of modal coordinates, s.
    """

    position: ca.SX
    velocity: ca.SX
    acceleration: ca.SX
    attitude: ca.SX
    base_velocity: ca.SX
    base_acceleration: ca.SX
    base_position: ca.SX
    balls: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    ball_rates: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    modal: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    modal_rates: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    inner_acceleration: ca.SX = field(default_factory=lambda: ca.SX(0, 1))


class SymbolicRobot:
    """The dynamics of one robot for given expressions of motion and mass.

    Args:
        robot: the description.
        motion: expressions or constants.
        inertial: the parameters of `inertial_names`, P x 1, symbols or constants.
        tree: of the robot, where its flexible links have other constants than the description's.
        outside: function from the mechanism in its state to the outer forces on its bodies.

    All results are lazily built expressions with the rows of `reference_model.dynamics.equations`.
    """

    def __init__(
        self,
        robot: Robot,
        motion: Motion,
        inertial: ca.SX,
        *,
        tree: Tree | None = None,
        outside: Callable[[Mechanism], Outside] | None = None,
    ) -> None:
        self.robot, self.motion, self.inertial = robot, motion, inertial
        self.tree = tree_of(robot) if tree is None else tree
        state = State(
            motion.position,
            motion.velocity,
            motion.attitude,
            motion.base_velocity,
            motion.base_position,
            motion.balls,
            motion.ball_rates,
            motion.modal,
            motion.modal_rates,
        )
        states = recursion(self.tree, state)
        found, rotors, gravity = masses(robot, self.tree, states, inertial)
        self.mechanism = Mechanism(self.tree, states, found, rotors, gravity)
        if outside is not None:
            self.mechanism = replace(self.mechanism, outside=outside(self.mechanism))

    @classmethod
    def still_base(cls, robot: Robot) -> dict[str, ca.SX]:
        """The base entries of `Motion` for a base at rest at its described pose, as constants."""
        return {
            "attitude": ca.sparsify(ca.SX(quaternion_from_rpy(robot.base.rpy))),
            "base_velocity": ca.SX(6, 1),
            "base_acceleration": ca.SX(6, 1),
            "base_position": ca.SX(np.asarray(robot.base.position, dtype=float)),
        }

    @cached_property
    def wrenches(self) -> tuple[ca.SX, ...]:
        """Generalised reaction at every body's origin, body axes; see `dynamics.wrenches`."""
        motion = self.motion
        return wrenches(
            self.mechanism, motion.acceleration, motion.base_acceleration, motion.inner_acceleration
        )

    @cached_property
    def inverse_dynamics(self) -> ca.SX:
        """Generalised force required by the motion, rows x 1."""
        return generalised(self.mechanism, self.wrenches, self.motion.acceleration)

    @cached_property
    def mass_matrix(self) -> ca.SX:
        """Z, rows x rows."""
        return mass_matrix(self.mechanism)

    def forward_dynamics(self, force: ca.SX) -> ca.SX:
        """Generalised acceleration under a generalised force, rows x 1."""
        return forward_dynamics(self.mechanism, force, self.motion.base_acceleration)

    @cached_property
    def base_acceleration(self) -> ca.SX:
        """Acceleration of a free base, without external wrench, under the joints' accelerations, 6 x 1.

        The base rows of ``Z ydd - z = 0`` are solved for the base; `motion.base_acceleration` must be zero.
        """
        return solve_spd(self.mass_matrix[:6, :6], -self.inverse_dynamics[:6])

    def node(self, body: int, node: int) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """Motion of a node of a flexible body.

        Args:
            body: its index in `tree.bodies`.
            node: index among its nodes.

        Returns:
            Place in the body's axes [m], 3 x 1; node to body axes, 3 x 3; velocity and inertial acceleration
            [linear; angular] in the node's own axes, 6 x 1 each.
        """
        flexible, state = self.tree.bodies[body].flexible, self.mechanism.states[body]
        assert flexible is not None
        motion = self.motion
        moved = accelerations(
            self.mechanism, motion.acceleration, motion.base_acceleration, motion.inner_acceleration
        )[body]
        rate = state.velocity[6:]
        step = node_step(node_of(flexible, node, state.modal, rate), state.velocity[:6], rate)
        acceleration = step.transfer @ moved[:6] + step.columns @ moved[6:] + step.bias
        return step.shift, step.rotation, step.velocity, acceleration

    @cached_property
    def joint_wrenches(self) -> ca.SX:
        """[force; moment] by the inboard on the outboard body at each moving joint, child axes, 6 x n."""
        columns = [joint_wrench(self.mechanism, index, self.wrenches[index]) for index in self.tree.moved]
        return ca.densify(ca.horzcat(*columns))

    def bearing_loads(self, joint_wrenches: ca.SX) -> ca.SX:
        """Bearing loads of each moving joint, rows `balance.LOADS`, 4 x n; see `balance.bearing_load`."""
        columns = [
            bearing_load(
                joint.kind,
                ca.sparsify(ca.SX(joint.unit_axis)),
                joint_wrenches[:, k],
                joint.bearing or Bearing(),
            )
            for k, joint in enumerate(self.robot.moving_joints)
        ]
        return ca.densify(ca.horzcat(*columns))

    @cached_property
    def energy(self) -> ca.SX:
        """Kinetic plus gravitational potential plus elastic energy [J]."""
        return sum(self.energies[1:], start=self.energies[0])

    @cached_property
    def energies(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Kinetic, gravitational potential and elastic energy [J]."""
        kinetic = kinetic_energy(self.mechanism, self.motion.velocity)
        return kinetic, potential_energy(self.mechanism), elastic_energy(self.mechanism)
