"""Flexible hinges with friction: gear, friction on both of its sides and link, separately and together."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from benchmarks.evidence import number, table
from benchmarks.studies.robots import JOINTS, MILLI, above, rms, swinging, swings
from exudyn_model import simulate as exudyn_simulate
from reference_model.flexible.undeformed import undeformed
from reference_model.simulation import simulate
from robot_model import ComputedTorque, Recording, Reference, Robot

__all__ = ["section"]

#: Gear [N m/rad, N m s/rad], and dry friction on the motor's and on the joint's side of it [N m].
STIFFNESS, DAMPING, MOTOR_SIDE, JOINT_SIDE = 3000.0, 2.0, 2.0, 2.0
#: Swing [degrees, Hz, s].
AMPLITUDE, FREQUENCY, DURATION = 3.0, 0.1, 30.0

INTRODUCTION = """\
## [9] Flexible hinges with friction

Zavrazhina and Zavrazhina analyse a space manipulator with elastic hinges and friction. Here a joint has
an elastic gear (`joint_elasticity`), dry friction inside the motor (`actuator.coulomb_friction`), which
acts in front of the gear, dry friction in the bearing behind it (`lugre_friction`), and the link bends.
The controller reads the motors' encoders and assumes rigid bodies with stiff gears. The separate effects do
not add up."""


def section() -> str:
    """The complete section."""
    rows, combined = [], {}
    for bends, elastic, inside, outside in product((False, True), repeat=4):
        run = simulate(_robot(bends, elastic, inside, outside), sensors=False, rtol=1e-7, atol=1e-10)
        cells = _cells(run, bends)
        combined[bends, elastic, inside, outside] = _error(run)
        flags = ("yes" if part else "" for part in (bends, elastic, inside, outside))
        rows.append([*flags, *cells])
    headings = (
        *("link bends", "gear elastic", "friction at the motor", "friction at the joint"),
        *("tracking of joint 2, mrad rms:", "of its motor, mrad rms:", "largest twist, mrad:"),
        *("joint above 0.5 Hz, mrad rms:", "tip above 0.5 Hz, mm rms:"),
    )
    whole = combined[True, True, True, True]
    alone = [combined[key] for key in ((True, False, False, False), (False, True, False, False))]
    alone += [combined[key] for key in ((False, False, True, False), (False, False, False, True))]
    together = float(np.sqrt(np.sum(np.square(alone))))
    text = (
        f"Space robot, both joints swing by {AMPLITUDE:g} degrees at {FREQUENCY:g} Hz under computed torque, "
        f"kp = 1 and kd = 2. Gears of {STIFFNESS:g} N m/rad and {DAMPING:g} N m s/rad, {MOTOR_SIDE:g} N m of "
        f"dry friction in the motor, {JOINT_SIDE:g} to {1.5 * JOINT_SIDE:g} N m in the bearing. All four "
        f"together cause a tracking error of {whole:.3g} mrad; the root of the summed squares of the four "
        f"separate errors is {together:.3g} mrad."
    )
    return "\n\n".join([INTRODUCTION, text, table(headings, rows), _engines()])


def _error(run: Recording) -> float:
    return MILLI * rms(run["joint2.reference_position"] - run["joint2.position"])


def _cells(run: Recording, bends: bool) -> list[str]:
    motor = run["joint2.motor_position"] if "joint2.motor_position" in run else run["joint2.position"]
    tip = np.zeros(1)
    if bends:
        tip = np.hypot(*(above(run, f"link2.tip_deflection.{axis}", 0.5) for axis in "yz"))
    return [
        number(_error(run)),
        number(MILLI * rms(run["joint2.reference_position"] - motor)),
        number(float(MILLI * np.abs(motor - run["joint2.position"]).max())),
        number(MILLI * rms(above(run, "joint2.position", 0.5))),
        number(MILLI * rms(tip)) if bends else "",
    ]


def _engines() -> str:
    robot = _robot(True, True, True, True).model_copy(update={"reference": swings(2.0, 0.5, 2.0)})
    own, other = simulate(robot, sensors=False), exudyn_simulate(robot, sensors=False)
    gap = max(float(np.abs(own[f"{j}.position"] - other[f"{j}.position"]).max()) for j in JOINTS)
    return f"With all of it the engines differ by {gap:.1e} rad over 2 s of a swing of 2 degrees at 0.5 Hz."


def _robot(bends: bool, elastic: bool, inside: bool, outside: bool) -> Robot:
    laws: list[dict[str, Any]] = []
    if elastic:
        laws.append({"effect": "joint_elasticity", "stiffness": STIFFNESS, "damping": DAMPING})
    if outside:
        levels = {"coulomb_torque": JOINT_SIDE, "static_torque": 1.5 * JOINT_SIDE, "stribeck_velocity": 0.01}
        bristles = {"bristle_stiffness": 8e3, "bristle_damping": 40.0}
        laws.append({"effect": "lugre_friction", **levels, **bristles})
    reference: Reference = swings(AMPLITUDE, FREQUENCY, DURATION)
    robot = swinging(laws, reference, ComputedTorque(kp=1.0, kd=2.0))
    if inside:
        data = robot.model_dump()
        for joint in data["joints"]:
            joint["actuator"]["coulomb_friction"] = MOTOR_SIDE
        robot = Robot.model_validate(data)
    return robot if bends else undeformed(robot)
