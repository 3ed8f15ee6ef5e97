"""Prediction of a robot file for a motion: torques of its actuators and rotation of its base."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from missing_physics.evaluation.band import low_passed
from missing_physics.evaluation.joint_motion import JointMotion
from missing_physics.evaluation.vibration.response import Response
from missing_physics.evaluation.yielding import WIDER, Moving, Yields, moved_by, springs_of
from reference_model.codegen.kept import kept
from reference_model.dynamics.balance import LOADS
from reference_model.dynamics.inertial import inertial_names, nominal_inertial
from reference_model.effects.along import EffectAlong, GearAlong
from reference_model.effects.base import JointEffect, JointSignals, YieldingGear
from reference_model.effects.catalogue import UsedEffect
from reference_model.effects.structure import StructureEffect
from reference_model.evaluation.coupled_effects import CoupledMotion
from reference_model.evaluation.drive_model import DriveModel, drive_model
from reference_model.evaluation.model import RobotModel
from reference_model.kinematics.spatial import quaternion_from_rpy
from reference_model.passive.base_motion import BaseMotion
from reference_model.passive.prescribed import prescribed
from reference_model.plant.truth import Truth, truth_of
from robot_model import Robot

__all__ = ["Prediction", "predicted"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Effect:
    """One effect at one joint along the motion.

    Attributes:
        along: the effect; directed if it has no states.
        parameters: its parameters.
        signals: `JointSignals.CHANNELS`, shape (N, 11).
        direction: of the joint's motion, -1 to 1, shape (N,).
        is_law: whether it is a law of friction.
    """

    along: EffectAlong
    parameters: dict[str, float]
    signals: Array
    direction: Array
    is_law: bool

    def force(self) -> Array:
        """Force of the effect on the joint [N m or N], shape (N,)."""
        rows = self.signals
        if not self.along.effect.states:
            rows = np.column_stack([rows, self.direction])
        return self.along.torque(rows, self.parameters)


@dataclass(frozen=True)
class Prediction:
    """Prediction for a motion of n joints.

    Attributes:
        torque: required of the actuators at the joints [N m or N], shape (N, n).
        base_rates: angular velocity of a moving base in its axes [rad/s], shape (N, 3); None for a fixed
            base.
        vibration: torque of each free vibration of links from the start, shape (N, n, V).
    """

    torque: Array
    base_rates: Array | None
    vibration: Array


def predicted(robot: Robot, motion: JointMotion) -> Prediction:
    """Torques and base motion of `robot` with all its effects along a motion of its joints.

    Bodies, base and flexible links are those of the reference model with the joints' motion prescribed.
    Effects at a joint, such as friction, are evaluated by their own equations along that motion and passed
    through the position filter; effects driven by the actuator's torque get the recorded torque.
    """
    truth = truth_of(robot)
    motion = _behind_gears(truth, motion)
    needed, turning = _needed(robot, truth, motion)
    forces = _JointEffects(truth, motion, needed).forces()
    torque = needed - low_passed(forces, rate=motion.rate, cutoff=motion.band.motion)
    return Prediction(torque, turning, _vibration(truth, motion))


def _vibration(truth: Truth, motion: JointMotion) -> Array:
    """`Prediction.vibration`; empty if motors move several joints."""
    robot = truth.robot
    if robot.base.kind != truth.nominal.base.kind:
        return _of_mount(truth, motion)
    if not truth.tree.modal or robot.transmissions:
        return np.zeros((*motion.position.shape, 0))
    model, numbers = _bending(truth.nominal), truth.inertial
    attitude = quaternion_from_rpy(robot.base.rpy)
    base = BaseMotion.at_rest(attitude, motion.time.size) if model.free_base else None
    mass = model.mass_matrix(motion.position, base=base, inertial=numbers)  # of undeformed links
    response = Response.of(model.tree, mass, model.elasticity(numbers), 1.0 / motion.rate)
    return response.free_vibration()[0]


def _of_mount(truth: Truth, motion: JointMotion) -> Array:
    """Free vibration of a base on springs, and of links that bend as if the base were at rest."""
    nominal, found = truth.nominal, [np.zeros((*motion.position.shape, 0))]
    if nominal.flexible_links or nominal.transmissions:
        return found[0]
    names, numbers = inertial_names(truth.robot), truth.inertial - nominal_inertial(truth.robot)
    moving = Moving(
        robot=nominal.model_copy(update={"effects": ()}),
        time=motion.time,
        position=motion.position,
        velocity=motion.velocity,
        acceleration=motion.acceleration,
        base=None,
        cutoff=motion.band.torque,
        first=motion.band.spoiled(motion.rate),
        apart=dict(zip(names, numbers)),
    )
    for used in truth.effects:
        if isinstance(used.effect, StructureEffect) and used.effect.adds_coordinates:
            yields = Yields.of(used.effect, used.at, moving).at(used.parameters)
            springs = springs_of(used.effect, moving.robot, used.at, used.parameters, yields.reached)
            moved = moved_by([yields], [springs], 2.0 * np.pi * WIDER * moving.cutoff)
            found.append(make_interp_spline(yields.time, moved[:, :, 0, 1:], k=3)(motion.time))
    return np.concatenate(found, axis=2)


@kept
def _bending(robot: Robot) -> RobotModel:
    """The model of a robot with its effects on flexible links."""
    truth = truth_of(robot)
    bodies = {body.name: body.flexible for body in truth.tree.bodies if body.flexible is not None}
    return RobotModel(truth.robot, bodies=bodies)


def _needed(robot: Robot, truth: Truth, motion: JointMotion) -> tuple[Array, Array | None]:
    """Torques that move links and rotors, shape (N, n), and the base rates of `Prediction`."""
    forward = robot.transmitting
    joints = [part @ forward.T for part in (motion.position, motion.velocity, motion.acceleration)]
    made = prescribed(robot, motion.time, *joints)
    links = np.column_stack([made[f"{joint.name}.torque"] for joint in robot.moving_joints]) @ forward
    rotors = np.zeros_like(links)
    for k, inertia in zip(truth.gears.drives, truth.gears.inertia):
        rotors[:, k] = inertia * motion.motor[2][:, k]
    rates = [f"base.angular_velocity.{axis}" for axis in "xyz"]
    turning = np.column_stack([made[channel] for channel in rates]) if rates[0] in made else None
    return links + rotors, turning


def _behind_gears(truth: Truth, motion: JointMotion) -> JointMotion:
    """The motion of joints without an encoder: that of their motors minus the twist due to the torque."""
    gears = [(used.at, used.effect, used.parameters) for used in truth.effects]
    twisting = {at: (effect, p) for at, effect, p in gears if isinstance(effect, YieldingGear)}
    compliant = {
        k: twisting[name]
        for k in motion.behind
        for name in [truth.nominal.drives[k].name]
        if name in twisting
    }
    if not compliant:
        return motion
    needed, _ = _needed(truth.nominal, truth, motion)
    passed = needed - _JointEffects(truth, motion, needed).forces()
    moved = tuple(part.copy() for part in (motion.position, motion.velocity, motion.acceleration))
    inertia = dict(zip(truth.gears.drives, truth.gears.inertia))
    for k, (effect, values) in compliant.items():
        torque = passed[:, k] - inertia.get(k, 0.0) * motion.motor[2][:, k]
        rate = np.asarray(make_interp_spline(motion.time, torque, k=3)(motion.time, 1))
        twist = GearAlong(effect).evaluate(torque, rate, values)[:, 0]
        bent = make_interp_spline(motion.time, twist, k=5)
        for order, part in enumerate(moved):
            part[:, k] -= bent(motion.time, order)
    position, velocity, acceleration = moved
    return replace(motion, position=position, velocity=velocity, acceleration=acceleration)


class _JointEffects:
    """Contribution of effects at joints and in their actuators to the joints' forces."""

    def __init__(self, truth: Truth, motion: JointMotion, needed: Array) -> None:
        self.truth, self.motion, self.needed = truth, motion, needed
        self._joints = truth.nominal.drives
        self._loads: Array | None = None

    def forces(self) -> Array:
        """Sum of all contributions, shape (N, n)."""
        twisting = np.column_stack([self._at(k) for k in range(len(self._joints))])
        return twisting if not self.truth.nominal.transmissions else twisting + self._behind_motors()

    def _behind_motors(self) -> Array:
        """Forces of effects at joints moved through transmissions, reflected to the motors, shape (N, n)."""
        model, motion = drive_model(self.truth.robot), self.motion
        assert isinstance(model, DriveModel)
        effects = self.truth.effects
        moved = motion.position, motion.velocity, motion.acceleration
        return CoupledMotion(model, motion.time, *moved, self.needed, motion.sign_speed).forces(effects)

    def _at(self, k: int) -> Array:
        twisting = [self._effect(used, k) for used in self._own(k)]
        friction = sum((one.force() for one in twisting if one.is_law), np.zeros(self.motion.time.size))
        for one in twisting:
            one.signals[:, JointSignals.CHANNELS.index("friction")] = friction
        return sum((one.force() for one in twisting if not one.is_law), start=friction)

    def _own(self, k: int) -> list[UsedEffect]:
        name = self._joints[k].name
        return [u for u in self.truth.effects if u.at == name and isinstance(u.effect, JointEffect)]

    def _effect(self, used: UsedEffect, k: int) -> _Effect:
        effect, joint = used.effect, self._joints[k]
        assert isinstance(effect, JointEffect)
        of_motor = k in self.truth.gears.drives and (effect.place == "actuator" or joint.joint is None)
        bearing, actuator = joint.bearing, joint.actuator
        along = EffectAlong(
            effect,
            gear_ratio=actuator.gear_ratio if actuator else 1.0,
            bearing_arms=(bearing.radial_arm, bearing.axial_arm) if bearing else (0.0, 0.0),
            transition=float(self.motion.sign_speed[k]),
            directed=not effect.states,
        )
        signals = self._signals(k, along.channels, of_motor=of_motor)
        direction = self.motion.motor_direction[:, k] if of_motor else self.motion.direction[:, k]
        return _Effect(along, dict(used.parameters), signals, direction, effect.is_friction_law)

    def _signals(self, k: int, channels: frozenset[str], *, of_motor: bool = False) -> Array:
        """`JointSignals.CHANNELS` of one joint, (N, 11); friction, and loads not in `channels`, are zero."""
        motion = self.motion
        moved = motion.motor if of_motor else (motion.position, motion.velocity, motion.acceleration)
        recorded = motion.torque[:, k]
        columns = {
            "time": motion.time,
            **{what: part[:, k] for what, part in zip(("position", "velocity", "acceleration"), moved)},
            "torque": recorded if np.isfinite(recorded).all() else self.needed[:, k],
            "friction": np.zeros(motion.time.size),
            "temperature": motion.temperature[:, k],
        }
        loads = self._bearing(k) if channels & set(LOADS) else np.zeros((motion.time.size, len(LOADS)))
        columns |= {what: loads[:, column] for column, what in enumerate(LOADS)}
        return np.column_stack([columns[what] for what in JointSignals.CHANNELS])

    def _bearing(self, k: int) -> Array:
        """Loads of a joint's bearing, shape (N, 4); zero where the robot file describes none."""
        if self._joints[k].bearing is None:
            return np.zeros((self.motion.time.size, len(LOADS)))
        if self._loads is None:
            self._loads = _bearing_loads(self.truth, self.motion)
        return self._loads[:, k]


def _bearing_loads(truth: Truth, motion: JointMotion) -> Array:
    """Shape (N, n, 4), in the order of `balance.LOADS`."""
    model = drive_model(truth.robot)
    joints = motion.position, motion.velocity, motion.acceleration
    base, inner = model.reconstruct_passive(motion.time, *joints, inertial=truth.inertial)
    return np.asarray(model.bearing_loads(*joints, base=base, inner=inner, inertial=truth.inertial))
