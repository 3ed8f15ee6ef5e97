"""Robots, friction, manoeuvres and controllers of the friction study; all values are this project's own.

The paper's simulation parameters are not known. The robot is the shipped `flexible_space_robot`; its friction
is replaced by that of the case, with the values below.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from math import radians

import numpy as np
from numpy.typing import NDArray

from reference_model.evaluation.model import RobotModel
from reference_model.flexible.undeformed import undeformed
from reference_model.passive.base_motion import BaseMotion
from reference_model.simulation import simulate
from robot_model import (
    Bearing,
    ComputedTorque,
    Cycloid,
    EffectUse,
    Joint,
    JointPD,
    JointReference,
    Link,
    MultiSine,
    Recording,
    Reference,
    Robot,
    load_robot,
)

__all__ = [
    "BANDWIDTH",
    "BASE_BANDWIDTH",
    "ELEMENTS",
    "FREQUENCY",
    "INTEGRAL",
    "JOINTS",
    "LAWS",
    "MODES",
    "MU_KINETIC",
    "MU_STATIC",
    "PRELOAD",
    "RADIUS",
    "SIGMA",
    "SLOW_STRIBECK_SPEED",
    "STRIBECK_SPEED",
    "TOLERANCES",
    "Case",
    "effective_inertia",
    "run",
]

JOINTS = ("joint1", "joint2")
#: Friction laws compared with a robot without friction.
LAWS = ("Coulomb", "Stribeck", "LuGre")
#: Elements and modes of link 2: with the joints free, the fourth frequency is within 1 % of a converged one.
ELEMENTS, MODES = 24, 6
#: A bearing so long [m] that a bending moment causes no force: the joint of a planar model.
NO_BENDING = 1e12
#: Friction coefficients of the bearings, kinetic and static [-].
MU_KINETIC, MU_STATIC = 0.10, 0.15
#: Friction radius of the bearings, the `radial_arm` of the shipped robots [m].
RADIUS = 0.04
#: Bristles at that radius: stiffness [1/m], damping and viscosity [s/m], Stribeck speed [m/s].
SIGMA = (1e5, 316.0, 0.4)
STRIBECK_SPEED = 1e-3
#: A Stribeck speed at which integral action causes a limit cycle [m/s].
SLOW_STRIBECK_SPEED = 3e-5
#: Preload of the cases that have one: the largest bearing load of the fast manoeuvre, base held [N m].
PRELOAD = 30.0
#: Both joints: displacements [rad], and amplitude [rad] and frequency [Hz] of the reversals.
DISPLACEMENTS = {"joint1": radians(30), "joint2": radians(-45)}
AMPLITUDE, FREQUENCY = radians(5), 0.05
#: Motions, holds after them (the long one for integral action), and length of the reversals [s].
FAST, SLOW, HOLD, WAIT, REVERSALS = 10.0, 120.0, 10.0, 190.0, 60.0
#: Sampling rate; the link's second pair of modes, 46 Hz with the joint free, is still resolved [Hz].
SAMPLE_RATE, SLOW_RATE = 100.0, 50.0
#: Bandwidth w of the controllers, with the gains w^2 and 2 w: of rigid computed torque and of PID a fifth of
#: the clamped link's first frequency; of full computed torque and of the held base free choices [rad/s].
BANDWIDTH = {"rigid": 1.0, "full": 5.0, "pid": 1.0}
BASE_BANDWIDTH = 1.0
#: Integral gain over w^3; without friction the loop settles.
INTEGRAL = 0.5
#: Tolerances of the integration: errors of a micrometre and of a microradian.
TOLERANCES = {"rtol": 1e-7, "atol": 1e-9}


@dataclass(frozen=True)
class Case:
    """One simulation.

    Attributes:
        geometry: "skewed" or "planar".
        friction: "none", or one of `LAWS`.
        manoeuvre: "fast", "slow", "reversals" or "wait".
        base: "free" or "held".
        preload: of each bearing, a constant load moment [N m].
        level: multiplies all friction.
        control: "rigid" or "full" computed torque, or "pid" with gains times the joints' inertia.
        stribeck: surface speed at which bearings leave static friction [m/s].
        static: friction coefficient at rest of Stribeck's and LuGre's laws [-].
        joint: "spatial", whose bearings carry force and bending moment, or "planar", with the radial force
            only, as in a planar model of the joint.
        elements, modes: of link 2.
        bandwidth: of the joints' controller [rad/s]; 0 means that of `BANDWIDTH`.
    """

    friction: str
    manoeuvre: str = "fast"
    geometry: str = "skewed"
    base: str = "free"
    preload: float = 0.0
    level: float = 1.0
    control: str = "rigid"
    bandwidth: float = 0.0
    stribeck: float = STRIBECK_SPEED
    static: float = MU_STATIC
    joint: str = "spatial"
    elements: int = ELEMENTS
    modes: int = MODES

    def but(self, **changes: object) -> Case:
        """The same with some attributes changed."""
        return replace(self, **changes)  # type: ignore[arg-type]

    @property
    def motion_end(self) -> float:
        """When the reference comes to rest [s]."""
        return {"fast": FAST, "slow": SLOW, "reversals": REVERSALS, "wait": FAST}[self.manoeuvre]

    @property
    def robot(self) -> Robot:
        """Its description."""
        name = "flexible_space_robot" + ("_planar" if self.geometry == "planar" else "")
        robot = load_robot(name)
        changes = {
            "reference": self._reference(),
            "controller": self._controller(robot),
            "sensors": (),
            "effects": self._effects(),  # instead of the shipped friction
            "links": tuple(self._link(link) for link in robot.links),
            "joints": tuple(self._joint(joint) for joint in robot.joints),
        }
        return robot.model_copy(update=changes)

    def _link(self, link: Link) -> Link:
        if link.beam is None:
            return link
        beam = link.beam.model_copy(update={"elements": self.elements, "modes": self.modes})
        return link.model_copy(update={"beam": beam})

    def _joint(self, joint: Joint) -> Joint:
        if self.joint == "spatial" or joint.bearing is None:
            return joint
        radial = Bearing(radial_arm=joint.bearing.radial_arm, bending_arm=NO_BENDING)
        return joint.model_copy(update={"bearing": radial})

    def _effects(self) -> tuple[EffectUse, ...]:
        if self.friction == "none":
            return ()
        kinetic, static = self.level * MU_KINETIC, self.level * self.static
        if self.friction == "Coulomb":
            load = {"effect": "load_dependent_friction", "coefficient": kinetic, "gear_share": 0.0}
            level = {"effect": "coulomb_friction", "torque": kinetic * self.preload}
            laws = [load, level] if self.preload else [load]
        elif self.friction == "Stribeck":
            falling = {
                "coulomb_torque": kinetic * self.preload,
                "static_torque": static * self.preload,
                "stribeck_velocity": self.stribeck / RADIUS,
                "load_coefficient": kinetic,
                "load_static_coefficient": static,
            }
            laws = [{"effect": "stribeck_friction", **falling}]
        else:
            stiffness, damping, viscosity = (RADIUS * self.level * sigma for sigma in SIGMA)
            bristles = {
                "coulomb_torque": kinetic * self.preload,
                "static_torque": static * self.preload,
                "bristle_stiffness": stiffness * self.preload,
                "bristle_damping": damping * self.preload,
                "stribeck_velocity": self.stribeck / RADIUS,
                "load_coefficient": kinetic,
                "load_static_coefficient": static,
                "load_stiffness": stiffness,
                "load_damping": damping,
                "load_viscosity": viscosity,
            }
            laws = [{"effect": "lugre_friction", **bristles}]
        return tuple(EffectUse.model_validate({**law, "at": joint}) for joint in JOINTS for law in laws)

    def _reference(self) -> Reference:
        if self.manoeuvre == "reversals":
            waves = {"amplitudes": (AMPLITUDE,), "frequencies": (FREQUENCY,), "ramp": 1 / FREQUENCY}
            joints: tuple[JointReference, ...] = tuple(MultiSine(joint=name, **waves) for name in JOINTS)
            return Reference(duration=REVERSALS, sample_rate=SAMPLE_RATE, joints=joints)
        rate = SLOW_RATE if self.manoeuvre in ("slow", "wait") else SAMPLE_RATE
        duration = SLOW if self.manoeuvre == "slow" else FAST
        hold = WAIT if self.manoeuvre == "wait" else HOLD
        joints = tuple(Cycloid(joint=n, displacement=d, duration=duration) for n, d in DISPLACEMENTS.items())
        return Reference(duration=duration + hold, sample_rate=rate, joints=joints)

    def _controller(self, robot: Robot) -> ComputedTorque | JointPD:
        w = self.bandwidth or BANDWIDTH[self.control]
        kp, kd, ki = w**2, 2 * w, INTEGRAL * w**3
        if self.control == "pid":
            inertia = effective_inertia(robot.name)
            scaled = (tuple((gain * inertia).tolist()) for gain in (kp, kd, ki))
            return JointPD(**dict(zip(("kp", "kd", "ki"), scaled)))
        held = {"base_kp": BASE_BANDWIDTH**2, "base_kd": 2 * BASE_BANDWIDTH} if self.base == "held" else {}
        return ComputedTorque(model=self.control, kp=kp, kd=kd, **held)


@cache
def effective_inertia(name: str, *, flexible: bool = False) -> NDArray[np.float64]:
    """Diagonal of Zbar of the stretched arm, base and modal coordinates eliminated, shape (n,) [kg m^2].

    Args:
        name: of a shipped robot with a free base.
        flexible: with the modal coordinates of its links, or undeformed.
    """
    robot = load_robot(name)
    model = RobotModel(robot if flexible else undeformed(robot))
    still = BaseMotion.at_rest(np.array([1.0, 0.0, 0.0, 0.0]))
    matrix = model.mass_matrix(np.zeros((1, len(JOINTS))), base=still)[0]
    joints = np.arange(6, 6 + len(JOINTS))
    others = np.setdiff1d(np.arange(len(matrix)), joints)
    reaction = np.linalg.solve(matrix[np.ix_(others, others)], matrix[np.ix_(others, joints)])
    return np.diagonal(matrix[np.ix_(joints, joints)] - matrix[np.ix_(joints, others)] @ reaction).copy()


@cache
def run(case: Case) -> Recording:
    """Its true channels; laws without a state stick and slip exactly, except under exact decoupling.

    There the motion may diverge, which a smoothed law detects soonest.
    """
    exact = case.friction in ("Coulomb", "Stribeck") and case.control != "full"
    return simulate(case.robot, sensors=False, stiction=exact, **TOLERANCES)
