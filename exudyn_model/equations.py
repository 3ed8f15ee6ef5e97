"""Exudyn's equations of motion at a given state, in the robot's own coordinates.

For comparison with another engine without a trajectory: mass matrix, forces, accelerations and bearing
loads of Exudyn's solver, in either formulation. Vectors of all coordinates are in this order: of a
free base linear and angular velocity in base axes (six); the joints with one coordinate, in the order of
the file; of each spherical joint the angular velocity of child against parent in the child's axes; modal
coordinates.

Redundant coordinates x are projected. With the constraints C v = 0 and robot speeds y = W v (v the rates of
x), ``[C; W] v = [0; y]`` gives ``v = N y`` and ``vd = N yd + e``, so that
``N^T M N yd = N^T (f - M e) + tau``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import exudyn
import numpy as np
from numpy.typing import NDArray

from exudyn_model.bodies.bearing import Load
from exudyn_model.bodies.flexible_link import flexible_link
from exudyn_model.bodies.mechanism import mechanism_of
from exudyn_model.bodies.rotation import from_quaternion, from_rpy, skew, to_rpy
from exudyn_model.effects import effects_of
from exudyn_model.effects.build import MOUNT, PUSHES
from exudyn_model.effects.links.structure import STRUCTURES
from exudyn_model.redundant.bodies.handles import Handle, euler_rates
from exudyn_model.redundant.bodies.modal_body import ModalBody
from exudyn_model.redundant.bodies.parts import Bending, Pose
from exudyn_model.redundant.reactions import bearing_load
from exudyn_model.redundant.system import System, build
from exudyn_model.solve import system
from robot_model import InputError, Joint, Robot

__all__ = ["Constrained", "Equations", "Posture", "equations"]

Array = NDArray[np.float64]

# Exudyn's stubs describe its compiled classes only in part.
exu: Any = exudyn


@dataclass(frozen=True)
class Posture:
    """Position and velocity of a robot.

    Attributes:
        position, velocity: of the joints with one coordinate [rad or m, per s], shape (n,).
        base_rotation: of a free base, base to inertial axes, shape (3, 3); None of a fixed one.
        base_velocity: of its origin, then angular, both in base axes [m/s, rad/s], shape (6,).
        balls: of each spherical joint child to joint axes, shape (3, 3).
        ball_rates: of each, child against parent in the child's axes [rad/s], shape (3 k,).
        modal, modal_rates: modal coordinates of all flexible links [sqrt(kg) m, per s], shape (s,).
    """

    position: Array
    velocity: Array
    base_rotation: Array | None = None
    base_velocity: Array | None = None
    balls: Sequence[Array] = ()
    ball_rates: Array | None = None
    modal: Array | None = None
    modal_rates: Array | None = None


@dataclass(frozen=True)
class Constrained:
    """``[M C^T; C 0] [vd; multipliers] = [f + W^T tau; -Cd v]`` at a state.

    Attributes:
        matrix, right: of that system, with tau left out.
        speeds: W, shape (rows, c).
        handles: both places of every connection, and its joint.
    """

    matrix: Array
    right: Array
    speeds: Array
    handles: Sequence[tuple[Joint, Handle, Handle]]

    def loads(self, tau: Array) -> dict[str, Load]:
        """Bearing loads of joints with one coordinate under `tau`."""
        count = self.speeds.shape[1]
        right = self.right.copy()
        right[:count] += self.speeds.T @ tau
        multipliers: Array = np.asarray(np.linalg.solve(self.matrix, right), dtype=np.float64)[count:]
        return {
            joint.name: bearing_load(joint.kind, multipliers[6 * k : 6 * k + 6], outer, inner)
            for k, (joint, outer, inner) in enumerate(self.handles)
            if joint.kind in ("revolute", "prismatic")
        }


@dataclass(frozen=True)
class Equations:
    """``mass @ yd = forces + tau`` with generalised forces tau of actuators, friction and all else.

    Attributes:
        mass: shape (rows, rows).
        forces: gyroscopic, elastic, of damping and gravity, shape (rows,).
        constrained: how constraint forces follow, of the redundant formulation.
    """

    mass: Array
    forces: Array
    constrained: Constrained | None = None

    def accelerations(self, tau: Array) -> Array:
        """yd under generalised forces `tau`, shape (rows,)."""
        found: Array = np.asarray(np.linalg.solve(self.mass, self.forces + tau), dtype=np.float64)
        return found

    def loads(self, tau: Array) -> dict[str, Load]:
        """Bearing loads under `tau`, from Exudyn's constraints; of redundant equations only."""
        assert self.constrained is not None
        return self.constrained.loads(tau)


def equations(
    robot: Robot, posture: Posture, *, formulation: Literal["tree", "redundant"] = "redundant"
) -> Equations:
    """Exudyn's equations of motion of `robot`, with the masses and gravity of its effects, at `posture`.

    Raises:
        InputError: the tree does not support the robot, or a motor has its own coordinate.
    """
    if geared := effects_of(robot).gears:
        name = robot.moving_joints[next(iter(geared))].name
        raise InputError(
            f"robot '{robot.name}': equations at a state are those of motors that move with their joints; "
            f"remove the effects in the gear of {name}."
        )
    if besides := [use for use in robot.effects if use.effect in (*STRUCTURES, *PUSHES, MOUNT)]:
        raise InputError(
            f"robot '{robot.name}': equations at a state are those of the description; remove the effect "
            f"'{besides[0].effect}' at '{besides[0].at}'."
        )
    if formulation == "redundant":
        return _redundant(robot, posture)
    if robot.flexible_links or robot.spherical_joints:
        raise InputError(f"robot '{robot.name}': Exudyn's kinematic tree carries one-coordinate joints only.")
    return _tree(robot, posture)


def _solver(mbs: Any) -> Any:
    """Exudyn's solver, ready to give mass matrix and forces at the system's present state."""
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.timeIntegration.verboseMode = 0
    solver = exu.MainSolverImplicitSecondOrder()
    if not solver.InitializeSolver(mbs, settings):
        raise InputError(f"Exudyn cannot start: {solver.GetErrorString()}")
    return solver


def _mass_and_forces(solver: Any, mbs: Any) -> tuple[Array, Array]:
    solver.ComputeMassMatrix(mbs)
    mass = np.array(solver.GetSystemMassMatrix())
    solver.ComputeODE2RHS(mbs)
    return mass, np.array(solver.GetSystemResidual())[: len(mass)]


def _tree(robot: Robot, posture: Posture) -> Equations:
    effects = effects_of(robot)
    mechanism = mechanism_of(robot, added=effects.masses, added_gravity=effects.gravity)
    order = list(mechanism.coordinate)
    rotation = from_rpy(robot.base.rpy) if posture.base_rotation is None else posture.base_rotation
    speed = np.zeros(6) if posture.base_velocity is None else posture.base_velocity
    state = system.RobotState(
        time=0.0,
        position=tuple(posture.position[order]),
        velocity=tuple(posture.velocity[order]),
        base_rotation=rotation,
        base_position=mechanism.base_position,
        base_velocity=rotation @ speed[:3],
        base_angular_velocity=speed[3:],
    )
    built = system.build(mechanism, state, lambda time, x, v: [0.0] * len(x))
    mass, forces = _mass_and_forces(_solver(built.mbs), built.mbs)
    first = 6 if mechanism.free else 0
    back = np.zeros((len(mass), len(mass)))  # rates of Exudyn's coordinates from the robot's speeds
    back[:first, :first] = np.eye(first)
    extra = np.zeros(len(mass))  # accelerations of Exudyn's coordinates at zero of the robot's
    if first:
        back[:3, :3] = rotation
        x, y, z = speed[3:]
        extra[3:6] = -y * z, x * z, -x * y  # of turns about x, y, z at zero angles
    for member, k in enumerate(order):
        back[first + member, first + k] = 1.0
    return Equations(back.T @ mass @ back, back.T @ (forces - mass @ extra))


def _redundant(robot: Robot, posture: Posture) -> Equations:
    built = _built(robot, posture)
    mbs, data = built.mbs, built.mbs.systemData
    solver = _solver(mbs)
    x, v = data.GetODE2Coordinates(), data.GetODE2Coordinates_t()
    bent = _bent(robot, posture)
    for name, rows in _modal_rows(built).items():
        x[rows], v[rows] = bent[name]
    data.SetODE2Coordinates(x)
    data.SetODE2Coordinates_t(v)
    mass, forces = _mass_and_forces(solver, mbs)
    locked, turning = built.constraint_rows(), built.constraint_drift(x, v)
    held = locked.any(axis=1)
    speeds, drift, handles = _speeds(built, x, v)
    inverse = np.linalg.inv(np.vstack([locked[held], speeds]))
    basis = inverse[:, int(held.sum()) :]
    extra = inverse @ -np.concatenate([turning[held], drift])
    saddle = np.block([[mass, locked.T], [locked, np.diag((~held).astype(float))]])
    named = [(link.joint, *pair) for link, pair in zip(built.connections, handles)]
    constrained = Constrained(saddle, np.concatenate([forces, -turning]), speeds, named)
    return Equations(basis.T @ mass @ basis, basis.T @ (forces - mass @ extra), constrained)


def _built(robot: Robot, posture: Posture) -> System:
    """The redundant system that begins in the posture; modal coordinates are still to be set.

    The turn of a spherical joint becomes one of the joint's frame, which is the same to the constraint.
    """
    values = {joint.name: k for k, joint in enumerate(robot.moving_joints)}
    balls = {joint.name: k for k, joint in enumerate(robot.spherical_joints)}
    joints = []
    for joint in robot.joints:
        changes: dict[str, Any] = {}
        if joint.name in values:
            k = values[joint.name]
            changes = {
                "initial_position": float(posture.position[k]),
                "initial_velocity": float(posture.velocity[k]),
            }
        elif joint.name in balls:
            k = balls[joint.name]
            turn = posture.balls[k] if posture.balls else np.eye(3)
            rates = np.zeros(3) if posture.ball_rates is None else posture.ball_rates[3 * k : 3 * k + 3]
            changes = {
                "rpy": to_rpy(from_rpy(joint.rpy) @ turn),
                "initial_angular_velocity": tuple(rates.tolist()),
            }
        joints.append(joint.model_copy(update=changes))
    base = None
    if posture.base_rotation is not None and posture.base_velocity is not None:
        speed = posture.base_velocity
        place = np.asarray(robot.base.position, dtype=float)
        base = Pose(posture.base_rotation, place, posture.base_rotation @ speed[:3], speed[3:])
    moved = robot.model_copy(update={"joints": tuple(joints)})
    wrench = 6 if robot.controller.kind == "computed_torque" and robot.controller.base_kp is not None else 0
    still = np.zeros(len(robot.moving_joints) + wrench)
    return build(
        moved,
        effects_of(robot),
        lambda time, motion, x, v: still.copy(),
        flexible="modal",
        base=base,
        bent=_bent(robot, posture),
    )


def _bent(robot: Robot, posture: Posture) -> dict[str, Bending]:
    """Modal coordinates and rates of every flexible link, in the order of the file."""
    found, first = {}, 0
    for link in robot.flexible_links:
        last = first + flexible_link(link).count
        still = np.zeros(last - first)
        x = still if posture.modal is None else posture.modal[first:last]
        v = still if posture.modal_rates is None else posture.modal_rates[first:last]
        found[link.name], first = (x, v), last
    return found


def _modal_rows(built: System) -> dict[str, slice]:
    """Modal coordinates of every flexible link among all, in the order of the file."""
    rows = {
        part.name: built.rows_of(body.modal)
        for part, body in zip(built.parts, built.bodies)
        if isinstance(body, ModalBody)
    }
    return {link.name: rows[link.name] for link in built.robot.flexible_links}


def _speeds(built: System, x: Array, v: Array) -> tuple[Array, Array, list[tuple[Handle, Handle]]]:
    """W, the time derivative of W times v, and both places of every connection."""
    whole, driven = x + built.reference, built.driven
    motion = built.drive.motion(x[driven], v[driven])
    rows, drift = [], []
    if built.free:
        frame = built.frames[0]
        own = np.zeros((6, len(x)))
        own[:3, frame.start : frame.start + 3] = from_quaternion(whole[frame][3:7]).T
        own[3:, frame.start + 3 : frame.stop] = euler_rates(whole[frame][3:7])
        rows.append(own)
        drift.append(np.zeros(6))
    joints = np.zeros((len(motion.position), len(x)))
    joints[:, driven] = motion.rows
    rows.append(joints)
    drift.append(np.array(motion.extra))
    for joint in built.robot.spherical_joints:
        k = next(k for k, link in enumerate(built.connections) if link.joint.name == joint.name)
        turned, drifted = _ball(*motion.handles[k], len(driven))
        spread = np.zeros((3, len(x)))
        spread[:, driven] = turned
        rows.append(spread)
        drift.append(drifted)
    modal = [row for own in _modal_rows(built).values() for row in range(own.start, own.stop)]
    rows.append(np.eye(len(x))[modal])
    drift.append(np.zeros(len(modal)))
    return np.vstack(rows), np.concatenate(drift), motion.handles


def _ball(outer: Handle, inner: Handle, count: int) -> tuple[Array, Array]:
    """Rows of the angular velocity of child against parent in the child's axes, and their drift.

    With R from parent to child axes, w = w_c - R w_p and wd = wd_c - R wd_p + w x (R w_p).
    """
    rows = np.zeros((3, count))
    for axis, row in enumerate(rows):
        inner.row_of_turn(inner.joint[:, axis], row)
        taken = np.zeros_like(row)
        outer.row_of_turn(inner.joint[:, axis], taken)
        row -= taken
    carried = inner.joint.T @ outer.spin
    return rows, skew(inner.joint.T @ inner.spin - carried) @ carried
