"""The motions for comparing engines, and the compared quantities.

Variants of the shipped robots. Where a variant omits something, this allows another engine to have the same
physics without Python: Exudyn has joint springs and dampers, also with a law given as a symbolic function,
but no inverse dynamics for computed torque, no bearing loads as inputs of a friction law, and no inertia of a
rotor about a joint between two free bodies. For these Exudyn needs user functions, compiled or in Python.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from robot_model import Bearing, EffectUse, Joint, JointPD, NoController, Robot, load_robot

__all__ = ["CASES", "SAMPLES", "Case", "Course", "quantities"]

Array = NDArray[np.float64]

#: Sampling instants of a run, besides its start.
SAMPLES = 50

#: Friction in the joints of the rigid arms: as of the flexible robot, scaled to them.
LUGRE = {
    "coulomb_torque": 0.5,
    "static_torque": 0.75,
    "stribeck_velocity": 0.25,
    "bristle_stiffness": 2000.0,
    "bristle_damping": 20.0,
    "load_coefficient": 0.10,
    "load_static_coefficient": 0.15,
    "load_stiffness": 400.0,
    "load_damping": 4.0,
    "load_viscosity": 0.016,
}
BEARING = Bearing(radial_arm=0.03, axial_arm=0.03, bending_arm=0.04)
#: Gains of joint control [N m/rad, N m s/rad] where it takes the place of computed torque.
GAINS = {
    "six_joint_space_arm": (
        (300.0, 300.0, 150.0, 40.0, 40.0, 15.0),
        (120.0, 120.0, 60.0, 16.0, 16.0, 6.0),
    ),
    "flexible_space_robot": ((600.0, 600.0), (900.0, 900.0)),
}
#: Initial joint velocities [rad/s] of motions without control.
PUSHED = {"two_link_arm": (1.0, -2.0), "six_joint_space_arm": (0.5, -0.4, 0.6, 0.8, -0.7, 1.0)}


@dataclass(frozen=True)
class Case:
    """One motion.

    Attributes:
        name: short.
        what: in words.
        robot: with controller, friction and duration.
        flexible: the goal for flexible robots applies, not the one for rigid ones.
        native: Exudyn can run it without Python; else with compiled functions, and with Python functions.
        mujoco: MuJoCo has the same physics.
        stiff: explicit methods diverge or do not finish, or cannot compute the loads of bearings.
        fixed: we also run it at fixed steps; compiling four stages of a long evaluation takes minutes.
        python_steps: largest steps [s] at which Exudyn runs it with Python functions.
    """

    name: str
    what: str
    robot: Robot
    flexible: bool = False
    native: bool = False
    mujoco: bool = False
    stiff: bool = False
    fixed: bool = True
    python_steps: tuple[float, ...] = (4e-3,)

    @property
    def duration(self) -> float:
        """[s]."""
        assert self.robot.reference is not None
        return self.robot.reference.duration

    @property
    def instants(self) -> Array:
        """Sampling instants, shape (SAMPLES + 1,)."""
        return np.arange(SAMPLES + 1) * (self.duration / SAMPLES)


@dataclass(frozen=True)
class Course:
    """A run for comparison: instants (N,) and quantities (N, k), in the order of `quantities`."""

    time: Array
    values: Array


def quantities(robot: Robot) -> Mapping[str, slice]:
    """Groups of columns: joints, base position and attitude, tip deflections, as far as they exist."""
    sizes = {"joints": len(robot.moving_joints)}
    if robot.base.kind == "free":
        sizes |= {"base position": 3, "base attitude": 4}
    if robot.flexible_links:
        sizes["tip deflection"] = 3 * len(robot.flexible_links)
    ends = np.cumsum([0, *sizes.values()])
    return {name: slice(int(a), int(b)) for name, a, b in zip(sizes, ends, ends[1:])}


def _lasting(robot: Robot, duration: float) -> Robot:
    """The first part of its reference motion, sampled `SAMPLES` times."""
    assert robot.reference is not None
    settings = {"duration": duration, "sample_rate": SAMPLES / duration}
    return robot.model_copy(update={"reference": robot.reference.model_copy(update=settings)})


def _joints(robot: Robot, *changes: Mapping[str, object]) -> tuple[Joint, ...]:
    """Its moving joints changed in turn, others as they are."""
    rest = iter(changes)
    moving = {joint.name for joint in robot.moving_joints}
    return tuple(j.model_copy(update=dict(next(rest))) if j.name in moving else j for j in robot.joints)


def _coasting(name: str) -> Robot:
    """A push and no control; only the friction that does not depend on loads."""
    robot = load_robot(name)
    pushes = [{"initial_velocity": speed} for speed in PUSHED[name]]
    reference = robot.reference.model_copy(update={"joints": ()}) if robot.reference else None
    joints = _joints(robot, *pushes)
    return robot.model_copy(update={"joints": joints, "controller": NoController(), "reference": reference})


def _joint_controlled(name: str, gains: str | None = None) -> Robot:
    """Joint control; nothing that limits torques."""
    robot = load_robot(name)
    kp, kd = GAINS[gains or name]
    free = [
        {"actuator": j.actuator.model_copy(update={"torque_limit": None})} if j.actuator else {}
        for j in robot.moving_joints
    ]
    return robot.model_copy(update={"joints": _joints(robot, *free), "controller": JointPD(kp=kp, kd=kd)})


def _bare(name: str, *effects: EffectUse) -> Robot:
    """A flexible robot under joint control without rotors, with these effects only."""
    robot = _joint_controlled(name, "flexible_space_robot")
    bare = [
        {"actuator": j.actuator.model_copy(update={"rotor_inertia": 0.0})} if j.actuator else {}
        for j in robot.moving_joints
    ]
    return robot.model_copy(update={"joints": _joints(robot, *bare), "effects": tuple(effects)})


def _loaded(name: str) -> Robot:
    """A rigid arm as shipped, with LuGre friction from bearing loads besides."""
    robot = load_robot(name)
    held = [{"bearing": joint.bearing or BEARING} for joint in robot.moving_joints]
    friction = tuple(_use("lugre_friction", joint.name, LUGRE) for joint in robot.moving_joints)
    joints = _joints(robot, *held)
    return robot.model_copy(update={"joints": joints, "effects": (*robot.effects, *friction)})


def _constant(robot: Robot) -> Robot:
    """Its LuGre friction without load-dependent terms."""
    kept = {name: value for name, value in LUGRE.items() if not name.startswith("load_")}
    friction = tuple(_use("lugre_friction", joint.name, kept) for joint in robot.moving_joints)
    return robot.model_copy(update={"effects": (*robot.effects, *friction)})


def _stribeck() -> Sequence[EffectUse]:
    """The levels of the flexible robot's friction under a bearing load moment of 30 N m."""
    values = {"coulomb_torque": 4.0, "static_torque": 6.0, "stribeck_velocity": 0.25}
    return [_use("stribeck_friction", joint, values) for joint in ("joint1", "joint2")]


def _use(effect: str, at: str, values: Mapping[str, float]) -> EffectUse:
    return EffectUse.model_validate({"effect": effect, "at": at, **values})


def _bending(name: str, robot: str) -> Sequence[Case]:
    """A flexible robot without friction, and as shipped."""
    without = Case(
        name,
        f"{robot}, joint control, no friction, no rotors",
        _lasting(_bare(robot), 5.0),
        flexible=True,
        native=True,
    )
    shipped = Case(
        f"{name}, LuGre",
        f"{robot} as shipped: computed torque, LuGre friction from bearing loads",
        _lasting(load_robot(robot), 5.0),
        flexible=True,
    )
    return without, shipped


@cache
def _cases() -> Mapping[str, Case]:
    arm, space, flexible = "two_link_arm", "six_joint_space_arm", "flexible_space_robot"
    planar = "flexible_space_robot_planar"
    found = [
        Case(
            "arm, swinging",
            f"{arm}, a push, gravity, viscous friction, no control",
            _lasting(_coasting(arm), 5.0),
            native=True,
            mujoco=True,
        ),
        Case(
            "arm, tracking",
            f"{arm} as shipped: joint control, gravity, viscous friction",
            _lasting(load_robot(arm), 5.0),
            native=True,
        ),
        Case(
            "arm, constant LuGre",
            f"{arm} as shipped and LuGre friction without loads",
            _lasting(_constant(load_robot(arm)), 5.0),
            native=True,
            stiff=True,
        ),
        Case(
            "arm, LuGre",
            f"{arm} as shipped and LuGre friction from bearing loads",
            _lasting(_loaded(arm), 5.0),
            stiff=True,
        ),
        Case(
            "space arm, coasting",
            f"{space}, a push, viscous friction, no control",
            _lasting(_coasting(space), 5.0),
            native=True,
            mujoco=True,
        ),
        Case(
            "space arm, joint control",
            f"{space}, joint control, viscous friction",
            _lasting(_joint_controlled(space), 5.0),
            native=True,
        ),
        Case(
            "space arm, computed torque",
            f"{space} as shipped: computed torque, viscous friction",
            _lasting(load_robot(space), 5.0),
        ),
        Case(
            "space arm, LuGre",
            f"{space} as shipped and LuGre friction from bearing loads",
            _lasting(_loaded(space), 1.0),
            stiff=True,
            fixed=False,
        ),
        *_bending("flexible", flexible),
        Case(
            "flexible, Stribeck",
            f"{flexible}, joint control, Stribeck friction, no rotors",
            _lasting(_bare(flexible, *_stribeck()), 5.0),
            flexible=True,
            native=True,
        ),
        *_bending("planar", planar),
    ]
    return {case.name: case for case in found}


CASES: Mapping[str, Case] = _cases()
