"""Nonlinear stiffness with friction, and a six-joint space arm with LuGre friction in all joints."""

from __future__ import annotations

from math import sqrt

import numpy as np

from benchmarks.evidence import number, table
from benchmarks.studies.robots import JOINTS, MILLI, above, rms, swings
from exudyn_model import simulate as exudyn_simulate
from reference_model.simulation import simulate
from robot_model import (
    Actuator,
    ComputedTorque,
    EffectUse,
    Joint,
    Link,
    Recording,
    Reference,
    Robot,
    load_robot,
)

__all__ = ["section"]

#: Spring of a gear [N m/rad], its cubic part [N m/rad^3], and the inertia that swings on it [kg m^2].
STIFFNESS, CUBIC, INERTIA = 2000.0, 2e7, 5.0
#: Duration of the push that starts a swing [s].
PUSH = 2e-3
AMPLITUDES = (0.001, 0.003, 0.01, 0.03)
#: Dry friction at the joint [N m], if any, and sampling rate of the free swing [1/s].
FRICTION, RATE = 2.0, 1000.0
#: Spring of the space robot's gears: softer than the links' joints, so that the cubic part matters.
SOFT, HARDENING = 3000.0, 3e8
SECONDS = 20.0

INTRODUCTION = """\
## [13] Nonlinear stiffness and friction

Krzyzak and others give the joints of a flexible two-link space manipulator a nonlinear stiffness and
friction. The effect `joint_elasticity` has a cubic part, T = K d + K3 d^3 + D dd with the twist d, and
lets the motor move by itself; friction acts at the joint."""


def section() -> str:
    """Both sections."""
    return "\n\n".join([INTRODUCTION, _free_swings(), _space_robot(), _six_joints()])


def _free_swings() -> str:
    """Frequency of a free swing on the gear against its amplitude, and rest position with friction."""
    rows = []
    for amplitude in AMPLITUDES:
        smooth = simulate(_swing(amplitude, 0.0), sensors=False, rtol=1e-10, atol=1e-13)
        reached = float(np.abs(smooth["hinge.position"] - smooth["hinge.motor_position"]).max())
        rubbed = simulate(_swing(amplitude, FRICTION), sensors=False, rtol=1e-9, atol=1e-12, stiction=True)
        rows.append(
            [
                number(MILLI * reached),
                number(_frequency(smooth)),
                number(_backbone(reached)),
                number(float(MILLI * np.abs(rubbed["hinge.position"][-200:]).max())),
                number(MILLI * _dead_band()),
            ]
        )
    text = (
        f"A body of {INERTIA:g} kg m^2 swings on the gear of a motor that is held: K = {STIFFNESS:g} N "
        f"m/rad, K3 = {CUBIC:g} N m/rad^3. Its frequency rises with the amplitude A as the complete elliptic "
        f"integral of the undamped Duffing oscillator says. With {FRICTION:g} N m of dry friction it comes "
        "to rest within K d + K3 d^3 = T_c."
    )
    headings = ("amplitude, mrad:", "frequency, Hz:", "Duffing, Hz:", "rests at, mrad:", "at most, mrad:")
    return f"{text}\n\n{table(headings, rows)}"


def _space_robot() -> str:
    rows = []
    for name, cubic in (("linear", 0.0), ("cubic", HARDENING)):
        for friction in (False, True):
            run = simulate(_elastic(cubic, friction), sensors=False, rtol=1e-7, atol=1e-10)
            twists = [run[f"{j}.motor_position"] - run[f"{j}.position"] for j in JOINTS]
            errors = [run[f"{j}.reference_position"] - run[f"{j}.position"] for j in JOINTS]
            tip = np.hypot(*(above(run, f"link2.tip_deflection.{axis}", 0.5) for axis in "yz"))
            rows.append(
                [
                    name,
                    "LuGre" if friction else "none",
                    ", ".join(number(MILLI * rms(error)) for error in errors),
                    ", ".join(number(float(MILLI * np.abs(twist).max())) for twist in twists),
                    number(MILLI * rms(tip)),
                ]
            )
    robot = _elastic(HARDENING, True).model_copy(update={"reference": swings(2.0, 0.5, 2.0)})
    own, other = simulate(robot, sensors=False), exudyn_simulate(robot, sensors=False)
    gap = max(float(np.abs(own[f"{j}.position"] - other[f"{j}.position"]).max()) for j in JOINTS)
    text = (
        f"Flexible space robot with gears of K = {SOFT:g} N m/rad, K3 = {HARDENING:g} N m/rad^3 (cubic) or "
        "none, and 2 N m s/rad of damping; both joints swing by 3 degrees at 0.1 Hz under computed torque "
        "on the motors' encoders. A gear that hardens twists less; friction holds the joint while the motor "
        f"moves on. In the last case the engines differ by {gap:.1e} rad over 2 s of a swing of 2 degrees at "
        "0.5 Hz."
    )
    headings = (
        *("gear", "friction", "tracking of the joints, mrad rms:", "largest twist, mrad:"),
        "tip above 0.5 Hz, mm rms:",
    )
    return f"{text}\n\n{table(headings, rows)}"


def _six_joints() -> str:
    rows = []
    for name in ("none", "LuGre"):
        robot = _arm(name == "LuGre", SECONDS)
        run = simulate(robot, sensors=False, rtol=1e-7, atol=1e-9)
        names = [joint.name for joint in robot.moving_joints]
        errors = [MILLI * rms(run[f"{j}.reference_position"] - run[f"{j}.position"]) for j in names]
        momentum = max(float(np.abs(run[f"robot.angular_momentum.{axis}"]).max()) for axis in "xyz")
        vector = np.sqrt(sum(run[f"base.attitude.{axis}"] ** 2 for axis in "xyz"))
        turned = float(2 * np.arcsin(vector).max())
        rows.append([name, ", ".join(map(number, errors)), number(turned), f"{momentum:.1e}"])
    short = _arm(True, 1.0)
    own, other = simulate(short, sensors=False), exudyn_simulate(short, sensors=False)
    moving = [joint.name for joint in short.moving_joints]
    gap = max(float(np.abs(own[f"{j}.position"] - other[f"{j}.position"]).max()) for j in moving)
    text = (
        "Liu and others derived a space robot of six joints with friction. The shipped "
        f"`six_joint_space_arm` on a floating base, its shipped motion of which the first {SECONDS:g} s are "
        "run, computed torque with the nominal model; LuGre friction of 1 to 1.5 N m and a bearing load "
        "with coefficients of 0.1 and 0.15 in every joint. The less a joint carries, the more its friction "
        "weighs: gains of computed torque are accelerations. Friction is internal: the angular momentum "
        "stays zero, but the base turns otherwise because the joints do. Over the first second the engines "
        f"differ by {gap:.1e} rad."
    )
    headings = (
        *("friction", "tracking of joints 1 to 6, mrad rms:", "base turned at most, rad:"),
        "angular momentum, N m s:",
    )
    return f"## [14] Six joints with LuGre friction\n\n{text}\n\n{table(headings, rows)}"


def _swing(amplitude: float, friction: float) -> Robot:
    """A practically fixed motor, and a body that is pushed against it."""
    spring = {"effect": "joint_elasticity", "at": "hinge", "stiffness": STIFFNESS, "cubic_stiffness": CUBIC}
    push = {"torque": INERTIA * _start(amplitude) / PUSH, "start": 0.0, "duration": PUSH}
    uses = [{**spring, "damping": 0.0}, {"effect": "external_torque", "at": "hinge", **push}]
    if friction:
        uses.append({"effect": "coulomb_friction", "at": "hinge", "torque": friction})
    # A rotor a million times as heavy as the body, not driven, is held.
    motor = Actuator(gear_ratio=1000.0, rotor_inertia=INERTIA)
    joint = Joint(name="hinge", parent="base", child="body", actuator=motor)
    return Robot(
        name="swing",
        links=(Link(name="body", mass=1.0, inertia=(INERTIA, INERTIA, INERTIA)),),
        joints=(joint,),
        effects=tuple(EffectUse.model_validate(use) for use in uses),
        reference=Reference(duration=8.0, sample_rate=RATE),
    )


def _start(amplitude: float) -> float:
    """Speed in the middle of a swing of this amplitude, by energy [rad/s]."""
    return sqrt((STIFFNESS * amplitude**2 + CUBIC * amplitude**4 / 2) / INERTIA)


def _frequency(run: Recording) -> float:
    """Frequency from the zero crossings of the twist [Hz]."""
    twist = run["hinge.position"] - run["hinge.motor_position"]
    at = np.flatnonzero((twist[:-1] < 0) & (twist[1:] >= 0))
    exact = run.time[at] - twist[at] / (twist[at + 1] - twist[at]) * np.diff(run.time)[at]
    return float((len(exact) - 1) / (exact[-1] - exact[0]))


def _backbone(amplitude: float) -> float:
    """Frequency of the undamped Duffing oscillator, by quadrature of its period [Hz]."""
    angle = (np.arange(2000) + 0.5) * np.pi / 4000
    spring = STIFFNESS + CUBIC * amplitude**2 * (1 + np.sin(angle) ** 2) / 2
    return float(1 / (4 * np.sum(np.sqrt(INERTIA / spring)) * np.pi / 4000))


def _dead_band() -> float:
    """Twist whose torque is the friction [rad]."""
    roots = np.roots([CUBIC, 0.0, STIFFNESS, -FRICTION])
    return float(roots[np.abs(roots.imag) < 1e-9].real[0])


def _elastic(cubic: float, friction: bool) -> Robot:
    robot = load_robot("flexible_space_robot")
    shipped = [use for use in robot.effects if use.effect == "lugre_friction"] if friction else []
    spring = {"effect": "joint_elasticity", "stiffness": SOFT, "cubic_stiffness": cubic, "damping": 2.0}
    springs = [EffectUse.model_validate({**spring, "at": joint}) for joint in JOINTS]
    changes = {
        "effects": (*shipped, *springs),
        "sensors": (),
        "reference": swings(3.0, 0.1, SECONDS),
        "controller": ComputedTorque(kp=1.0, kd=2.0),
    }
    return robot.model_copy(update=changes)


def _arm(friction: bool, duration: float) -> Robot:
    robot = load_robot("six_joint_space_arm")
    bristles = {
        "effect": "lugre_friction",
        "coulomb_torque": 1.0,
        "static_torque": 1.5,
        "stribeck_velocity": 0.05,
        "bristle_stiffness": 4e3,
        "bristle_damping": 40.0,
        "load_coefficient": 0.1,
        "load_static_coefficient": 0.15,
        "load_stiffness": 400.0,
        "load_damping": 4.0,
    }
    uses = [{**bristles, "at": joint.name} for joint in robot.moving_joints] if friction else []
    assert robot.reference is not None
    changes = {
        "effects": tuple(EffectUse.model_validate(use) for use in uses),
        "sensors": (),
        "reference": robot.reference.model_copy(update={"duration": duration, "sample_rate": 50.0}),
    }
    return robot.model_copy(update=changes)
