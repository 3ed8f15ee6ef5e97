"""Friction for fixed steps that tries to stop the system, exact stiction, smoothed friction, LuGre."""

from __future__ import annotations

from math import radians

import numpy as np

from benchmarks.evidence import number, table
from benchmarks.friction.cases import MU_KINETIC, MU_STATIC, PRELOAD, RADIUS, SIGMA
from exudyn_model import simulate as exudyn_simulate
from reference_model.plant.closed_loop import Plant
from reference_model.simulation import simulate
from reference_model.steppers.effort import Effort
from robot_model import EffectUse, InputError, JointPD, MultiSine, Recording, Reference, Robot, load_robot

__all__ = ["section"]

MILLI = 1e3
JOINTS = ("joint1", "joint2")
STEPS = (8e-3, 4e-3, 2e-3, 1e-3)
#: Amplitude of both joints [rad], frequency [Hz] and duration [s].
AMPLITUDE, FREQUENCY, DURATION, RATE = radians(1), 0.2, 10.0, 25.0
#: Evaluations of the equations of motion in a step of the classical Runge-Kutta method.
STAGES = 4
#: Static friction falls to the kinetic one over this speed [rad/s]: many steps, so that no step skips it.
FALL = 0.02

INTRODUCTION = """\
## [8] Friction for fixed steps

Breedveld, Diepenbroek, van Lunteren (*Real-time simulation of friction in a flexible space manipulator*,
ICAR 1997) let friction *try to stop the system*: it takes the value that brings the velocity to zero
within the step, limited by its level. Their equations could not be read; for several joints at once the
definition is ours, in `reference_model/fixed_steps/stopping.py` and, with forces in place of accelerations
and another solver of the resulting inequalities, in `exudyn_model/solve/stopping.py`. It is asked for
with `simulate(robot, stiction=True, step=h)` and works with every dry friction law and with bearing
loads."""

SETTING = f"""\
Flexible space robot, four modes; both joints swing by {np.degrees(AMPLITUDE):g} degree at {FREQUENCY:g} Hz
for {DURATION:g} s under the controller that it is shipped with. Friction coefficients {MU_KINETIC:g} and
{MU_STATIC:g} on a preload of {PRELOAD:g} N m and the bearing load; static friction falls over {FALL:g}
rad/s. Errors are rms of joint 2's position. *Evaluations* are those of the equations of motion per second of
motion, each with its loop of loads and friction; the exact run locates its events between steps of its own
choice. LuGre has the same levels, a bristle stiffness of {SIGMA[0]:g} 1/m and a damping of {SIGMA[1]:g} s/m,
and its error is against itself at tight tolerances; smoothed friction, over 0.1 mrad/s, is what an explicit
step without any such law would have."""


def section() -> str:
    """The complete section."""
    return "\n\n".join([INTRODUCTION, SETTING, _errors(), _engines()])


def _errors() -> str:
    stribeck, bristles = _robot(_stribeck()), _robot(_lugre())
    effort = Effort()
    exact = simulate(stribeck, sensors=False, stiction=True, rtol=1e-9, atol=1e-11, effort=effort)
    smooth = simulate(bristles, sensors=False, rtol=1e-9, atol=1e-11)
    size = Plant(stribeck).layout.size
    rows = []
    for step in STEPS:
        spent = Effort()
        own = simulate(stribeck, sensors=False, stiction=True, step=step, effort=spent)
        rows.append(
            [
                f"{MILLI * step:g}",
                _apart(own, exact),
                number(spent.states / size / DURATION),
                _stepped(bristles, step, smooth),
                _stepped(stribeck, step, exact),
                number(STAGES / step),
            ]
        )
    headings = (
        *("step, ms:", "stopping friction, mrad:", "its evaluations, 1/s:", "LuGre at this step, mrad:"),
        *("smoothed friction at this step, mrad:", "evaluations of these two, 1/s:"),
    )
    resting = 100 * float(np.mean(exact["joint2.sticking"]))
    cost = effort.states / size / DURATION
    span = MILLI * np.ptp(exact["joint2.position"])
    text = (
        f"Exact stiction takes {number(cost)} evaluations per second; joint 2 rests in {resting:.1f} % of "
        f"the "
        f"time, and the motion spans {span:.3g} mrad. The two laws differ by {_apart(smooth, exact)} mrad "
        "from one another at any step: a bristle deflects before it breaks away, and has memory."
    )
    return f"{table(headings, rows)}\n\n{text}"


def _engines() -> str:
    """Both engines on a rigid arm, since Exudyn's explicit steps support trees only."""
    robot = _rigid_arm()
    exact = simulate(robot, sensors=False, stiction=True, rtol=1e-10, atol=1e-12)
    rows = []
    for step in (5e-3, 2.5e-3, 1.25e-3, 0.625e-3):
        own = simulate(robot, sensors=False, stiction=True, step=step)
        other = exudyn_simulate(robot, sensors=False, stiction=True, step=step, integrator="runge-kutta")
        rows.append([f"{MILLI * step:g}", _apart(own, exact), _apart(other, exact), _apart(own, other)])
    headings = ("step, ms:", "reference, mrad:", "Exudyn, mrad:", "between them, mrad:")
    text = (
        "Both engines, the shipped two-link arm swinging in the same way with Stribeck friction of 5 to 7 "
        "and Coulomb friction of 2 N m; errors of joint 2 against exact stiction:"
    )
    return f"{text}\n\n{table(headings, rows)}"


def _stepped(robot: Robot, step: float, exact: Recording) -> str:
    try:
        return _apart(simulate(robot, sensors=False, step=step), exact)
    except InputError:
        return "diverges"


def _apart(run: Recording, other: Recording) -> str:
    return f"{MILLI * np.sqrt(np.mean((run['joint2.position'] - other['joint2.position']) ** 2)):.2g}"


def _swinging() -> Reference:
    waves = {"amplitudes": (AMPLITUDE,), "frequencies": (FREQUENCY,), "ramp": 1.0}
    joints = tuple(MultiSine(joint=name, **waves) for name in JOINTS)
    return Reference(duration=DURATION, sample_rate=RATE, joints=joints)


def _robot(effects: list[dict]) -> Robot:
    robot = load_robot("flexible_space_robot")
    uses = tuple(EffectUse.model_validate({**law, "at": joint}) for joint in JOINTS for law in effects)
    return robot.model_copy(update={"reference": _swinging(), "sensors": (), "effects": uses})


def _stribeck() -> list[dict]:
    levels = {"coulomb_torque": MU_KINETIC * PRELOAD, "static_torque": MU_STATIC * PRELOAD}
    loads = {"load_coefficient": MU_KINETIC, "load_static_coefficient": MU_STATIC}
    return [{"effect": "stribeck_friction", **levels, **loads, "stribeck_velocity": FALL}]


def _lugre() -> list[dict]:
    stiffness, damping = (RADIUS * sigma for sigma in SIGMA[:2])
    bristles = {"bristle_stiffness": stiffness * PRELOAD, "bristle_damping": damping * PRELOAD}
    loads = {"load_stiffness": stiffness, "load_damping": damping, "load_viscosity": 0.0}
    return [{**_stribeck()[0], "effect": "lugre_friction", **bristles, **loads}]


def _rigid_arm() -> Robot:
    robot = load_robot("two_link_arm")
    rubbing = {"coulomb_torque": 5.0, "static_torque": 7.0, "stribeck_velocity": 0.1}
    effects = (
        EffectUse.model_validate({"effect": "stribeck_friction", "at": "joint1", **rubbing}),
        EffectUse.model_validate({"effect": "coulomb_friction", "at": "joint2", "torque": 2.0}),
    )
    changes = {
        "reference": _swinging().model_copy(update={"duration": 5.0, "sample_rate": 40.0}),
        "controller": JointPD(kp=300.0, kd=30.0),
        "gravity": (0.0, 0.0, 0.0),
        "sensors": (),
        "effects": effects,
    }
    return robot.model_copy(update=changes)
