"""`RobotModel`: the dynamics of a robot evaluated over complete recordings."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reference_model.dynamics.balance import LOADS
from reference_model.dynamics.inertial import inertial_names, nominal_inertial
from reference_model.dynamics.tree import Body, tree_of
from reference_model.effects.pushing import BodySeries
from reference_model.evaluation import outputs
from reference_model.evaluation.evaluator import Build, Evaluator
from reference_model.flexible import FlexibleBody
from reference_model.kinematics.spatial import quaternion_from_rpy
from reference_model.passive.base_motion import BaseMotion
from reference_model.passive.free_base import reconstruct
from reference_model.passive.inner_motion import InnerMotion, NodeMotion
from reference_model.passive.nominal import PassiveMotion
from robot_model import InputError, Robot, nearest

__all__ = ["RobotModel"]

Array = NDArray[np.float64]


class RobotModel:
    """Dynamics of a robot of rigid and flexible bodies; pure functions of arrays, compiled on first use.

    Every method takes ``position, velocity, acceleration`` of the one-coordinate joints in file order, shape
    (N, n) [rad or m, and per s and s^2], or (n,) for one sample. Results have `rows` in the order of
    `tree.Tree`: of a free base first six, ``[force; moment]`` (or ``[linear; angular]``) at the base frame's
    origin in base axes; then the joints; then the inner coordinates, three of each spherical joint (about it,
    in the child's axes) and the modal ones.

    `base` is needed for a free base. For a fixed base it may be given too: then the base follows that motion,
    and the result has no rows for it. `inner` is the motion of spherical joints and flexible links; if
    omitted, they rest, undeformed. `inertial` replaces the nominal inertial parameters.

    Args:
        robot: the description.
        bodies: replaces the constants of the flexible links (without their hubs), by name.
        beams: whether beam parameters are among the inertial ones, before gravity.

    Attributes:
        robot: the description.
        joints: names of the one-coordinate joints.
        free_base: the base has six coordinates.
        inertial_names: names of the P parameters (see `reference_model.dynamics.inertial`).
        inertial: their nominal values, shape (P,).
        tree: bodies, coordinates and their order.
        evaluate: evaluates any expression of the robot, see `Evaluator`.
    """

    def __init__(
        self, robot: Robot, *, bodies: Mapping[str, FlexibleBody] | None = None, beams: bool = False
    ) -> None:
        self.robot = robot
        self.tree = tree_of(robot, bodies, beams=beams)
        self.joints = self.tree.joints
        self.free_base = self.tree.free_base
        names, numbers = inertial_names(robot), nominal_inertial(robot)
        self.inertial_names = (*names[:-3], *self.tree.beam_names, *names[-3:])
        self.inertial = np.concatenate([numbers[:-3], self.tree.beam_values, numbers[-3:]])
        self.rows = self.tree.rows
        self.evaluate = Evaluator(robot, self.tree, self.inertial)
        self._passive: PassiveMotion | None = None
        self._nodes: dict[tuple[str, int], Build] = {}
        self._bodies: dict[str, Build] = {}

    def inverse_dynamics(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> Array:
        """Generalised force required by the motion [N m or N; base: N, N m], shape (N, rows)."""
        motion = (position, velocity, acceleration)
        return self.evaluate(outputs.inverse, motion, (base, inner, inertial))[0]

    def regressor(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> Array:
        """Exact derivative of `inverse_dynamics` with respect to inertial parameters, shape (N, rows, P).

        The gravity columns are for the masses of `inertial`, the others for its gravity; so the product with
        `inertial`, without the gravity columns, is the inverse dynamics itself.
        """
        motion = (position, velocity, acceleration)
        flat = self.evaluate(outputs.regressor, motion, (base, inner, inertial))[0]
        return flat.reshape(len(flat), self.rows, len(self.inertial_names))

    def motion_jacobians(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> tuple[Array, Array, Array]:
        """Derivatives of `inverse_dynamics` by joint position, velocity, acceleration: (N, rows, n) each."""
        found = self.evaluate(outputs.jacobians, (position, velocity, acceleration), (base, inner, inertial))
        shape = self.rows, len(self.joints)
        first, second, third = (flat.reshape(len(flat), *shape) for flat in found)
        return first, second, third

    def joint_wrenches(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> tuple[Array, Array]:
        """Force [N] and moment [N m] by the inboard on the outboard body at moving joints, (N, n, 3) each.

        About the origin of the child's frame and in the child's axes. The moment along the axis is the
        joint torque minus that of the rotor.
        """
        motion = (position, velocity, acceleration)
        flat = self.evaluate(outputs.wrenches, motion, (base, inner, inertial))[0]
        both = flat.reshape(len(flat), len(self.joints), 6)
        return both[:, :, :3], both[:, :, 3:]

    def bearing_loads(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> Array:
        """Bearing loads of each moving joint, shape (N, n, 4), in the order of `balance.LOADS`.

        Radial force [N], axial force [N], bending moment [N m], and the radial sum of `balance.bearing_load`
        [N].
        """
        motion = (position, velocity, acceleration)
        flat = self.evaluate(outputs.loads, motion, (base, inner, inertial))[0]
        return flat.reshape(len(flat), len(self.joints), len(LOADS))

    def forward_dynamics(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        torque: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        base_wrench: ArrayLike | None = None,
        inner_force: ArrayLike | None = None,
        inertial: ArrayLike | None = None,
    ) -> Array:
        """Accelerations under joint torques [N m or N], shape (N, rows).

        Args:
            position, velocity, torque: shape (N, n).
            base: attitude and rates of a free base; its accelerations are not used.
            inner: attitude and rates of spherical joints, modal coordinates and rates; its accelerations are
                not used.
            base_wrench: external force [N] and moment [N m] on a free base at its origin, base axes, (N, 6).
            inner_force: on the spherical joints [N m] and the modal coordinates, besides the elastic and
                damping forces of the links, shape (N, 3 k + s).
            inertial: replaces the nominal numbers.
        """
        size = 6 if self.free_base else 0
        wrench = np.zeros(size) if base_wrench is None else np.asarray(base_wrench, dtype=float)[..., :size]
        pushed = np.zeros(self.rows - size - len(self.joints))
        pushed = pushed if inner_force is None else np.asarray(inner_force, dtype=float)
        given = (base, inner, inertial)
        extra = _beside(wrench, pushed)
        return self.evaluate(outputs.forward, (position, velocity, torque), given, extra)[0]

    def minimal_form(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> tuple[Array, Array]:
        """Z, shape (N, rows, rows), and z, shape (N, rows), of ``-Z ydd + z + f = 0``.

        A slower computation of the same dynamics, see `reference_model.dynamics.minimal`. A fixed base with a
        prescribed motion enters with its accelerations.
        """
        still = np.zeros_like(np.asarray(position, dtype=float))
        matrix, forces = self.evaluate(outputs.minimal, (position, velocity, still), (base, inner, inertial))
        return matrix.reshape(len(matrix), self.rows, self.rows), forces

    def mass_matrix(
        self,
        position: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> Array:
        """Z of ``Z ydd = z + f``, symmetric, shape (N, rows, rows)."""
        still = np.zeros_like(np.asarray(position, dtype=float))
        flat = self.evaluate(outputs.mass, (position, still, still), (base, inner, inertial))[0]
        return flat.reshape(len(flat), self.rows, self.rows)

    def momentum(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> tuple[Array, Array]:
        """Linear [N s] and angular momentum about the centre of mass [N m s], inertial axes, (N, 3) each."""
        still = np.zeros_like(np.asarray(position, dtype=float))
        found = self.evaluate(outputs.momenta, (position, velocity, still), (base, inner, inertial))
        return found[0], found[1]

    def energy(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        base_position: ArrayLike | None = None,
        inertial: ArrayLike | None = None,
    ) -> Array:
        """Sum of kinetic, gravitational potential and elastic energy [J], shape (N,); see `energies`."""
        parts = self.energies(
            position, velocity, base=base, inner=inner, base_position=base_position, inertial=inertial
        )
        return parts.sum(axis=1)

    def energies(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        base_position: ArrayLike | None = None,
        inertial: ArrayLike | None = None,
    ) -> Array:
        """Kinetic, gravitational potential and elastic energy [J], shape (N, 3).

        The potential is zero at the inertial origin. `base_position` [m], shape (N, 3) or (3,), is the
        description's when left out.
        """
        still = np.zeros_like(np.asarray(position, dtype=float))
        given = (base, inner, inertial)
        return self.evaluate(outputs.energy, (position, velocity, still), given, place=base_position)[0]

    def node_motion(
        self,
        link: str,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        node: int | None = None,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        base_position: ArrayLike | None = None,
        inertial: ArrayLike | None = None,
    ) -> NodeMotion:
        """Motion of a node of a flexible link; of its tip when `node` is omitted.

        Raises:
            InputError: the link is rigid or unknown, or has no such node.
        """
        body = self._flexible(link).flexible
        assert body is not None
        index = body.tip if node is None else node
        if not 0 <= index < len(body.nodes):
            raise InputError(f"link '{link}' has no node {index}; its nodes are 0 to {len(body.nodes) - 1}.")
        motion = (position, velocity, acceleration)
        build = self._nodes.setdefault((link, index), outputs.node(link, index))
        found = self.evaluate(build, motion, (base, inner, inertial), place=base_position)
        rotation = found[1].reshape(-1, 3, 3).transpose(0, 2, 1)
        return NodeMotion(found[0], rotation, *found[2:])

    def body_motion(
        self,
        link: str,
        time: Array,
        position: ArrayLike,
        velocity: ArrayLike,
        *,
        base: BaseMotion | None = None,
        inner: InnerMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> tuple[BodySeries, Array]:
        """Motion of a rigid link, and generalised forces of unit wrenches on it.

        Args:
            link: name of the link.
            time: of the samples [s], shape (N,).
            position, velocity, base, inner, inertial: see the class.

        Returns:
            The motion of its frame, for a base at its described position; and the generalised force of each
            unit component of a wrench [force; moment] about the origin of its frame in its axes, shape
            (N, rows, 6).

        Raises:
            InputError: the link is flexible or unknown.
        """
        members = {body.name for body in self.tree.bodies if not body.flexible}
        if link not in members:
            raise InputError(f"robot '{self.robot.name}' has no rigid link '{link}'{nearest(link, members)}.")
        build = self._bodies.setdefault(link, outputs.body(link))
        still = np.zeros_like(np.asarray(position, dtype=float))
        place, turned, rates, spread = self.evaluate(
            build, (position, velocity, still), (base, inner, inertial)
        )
        rotation = turned.reshape(-1, 3, 3).transpose(0, 2, 1)
        return BodySeries(time, place, rotation, rates), spread.reshape(len(spread), -1, 6)

    def strain(self, link: str, inner: InnerMotion) -> Array:
        """Strain at the gauges of a flexible link [-], shape (N, gauges).

        Raises:
            InputError: the link is rigid or unknown.
        """
        member = self._flexible(link)
        modal = np.atleast_2d(inner.modal)[:, member.modal : member.modal + member.modes]
        assert member.flexible is not None
        return np.asarray(modal @ member.flexible.strain.T)

    def _flexible(self, link: str) -> Body:
        members = {body.name: body for body in self.tree.bodies if body.flexible}
        if link not in members:
            raise InputError(
                f"robot '{self.robot.name}' has no flexible link '{link}'{nearest(link, members)}."
            )
        return members[link]

    def elasticity(self, inertial: ArrayLike | None = None) -> tuple[Array, Array]:
        """Stiffness and damping of the modal coordinates, shape (s, s) each."""
        numbers = self.inertial if inertial is None else np.asarray(inertial, dtype=float)
        count = len(self.tree.beam_names)
        return self.tree.elasticity(numbers[numbers.size - 3 - count : numbers.size - 3])

    def reconstruct_base(
        self,
        time: ArrayLike,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        initial: BaseMotion | None = None,
        inertial: ArrayLike | None = None,
    ) -> BaseMotion:
        """Motion of a free base without external wrench, from joint motion and momentum.

        Args:
            time: [s], shape (N,).
            position, velocity, acceleration: of the joints, shape (N, n).
            initial: its first sample gives attitude and twist at the first instant; if omitted, the attitude
                is that of the description and the momentum is zero, as after a start from rest.
            inertial: replaces the nominal numbers.

        Raises:
            InputError: the base is fixed, or lengths differ.
        """
        numbers = self.inertial if inertial is None else np.asarray(inertial, dtype=float)
        q, qd, qdd = (np.atleast_2d(np.asarray(a, dtype=float)) for a in (position, velocity, acceleration))
        start, momentum = initial, (np.zeros(3), np.zeros(3))
        if start is None:
            start = BaseMotion.at_rest(quaternion_from_rpy(self.robot.base.rpy))
        else:
            first = BaseMotion.from_stacked(start.stacked()[:1])
            linear, angular = self.momentum(q[:1], qd[:1], base=first, inertial=numbers)
            momentum = (linear[0], angular[0])
        instants = np.asarray(time, dtype=float)
        return reconstruct(
            self.robot, instants, (q, qd, qdd), initial=start, momentum=momentum, inertial=numbers
        )

    def reconstruct_passive(
        self,
        time: ArrayLike,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        *,
        inertial: ArrayLike | None = None,
    ) -> tuple[BaseMotion | None, InnerMotion | None]:
        """Motion of a free base and of flexible links, from the joint motion, after a start from rest.

        Args:
            time: [s], shape (N,).
            position, velocity, acceleration: of the joints, shape (N, n).
            inertial: replaces the nominal numbers.

        Returns:
            The base's motion, None when it is fixed; the inner motion, None for a robot without any.

        Raises:
            InputError: lengths differ, or the robot has spherical joints.
        """
        if not self.tree.inner:
            motion = (position, velocity, acceleration)
            base = self.reconstruct_base(time, *motion, inertial=inertial) if self.free_base else None
            return base, None
        joints = [np.atleast_2d(np.asarray(a, dtype=float)) for a in (position, velocity, acceleration)]
        if self._passive is None:
            self._passive = PassiveMotion(self.robot, self.tree, self.inertial.size)
        return self._passive.along(
            np.asarray(time, dtype=float),
            (joints[0], joints[1], joints[2]),
            attitude=quaternion_from_rpy(self.robot.base.rpy),
            momentum=(np.zeros(3), np.zeros(3)),
            inertial=self.inertial if inertial is None else np.asarray(inertial, dtype=float),
        )


def _beside(first: Array, second: Array) -> Array:
    """Columns side by side; a single sample is repeated."""
    samples = max((len(array) for array in (first, second) if array.ndim == 2), default=0)
    if not samples:
        return np.concatenate([first, second])
    return np.hstack([np.broadcast_to(array, (samples, array.shape[-1])) for array in (first, second)])
