"""Losses of joints, and motions of least loss between two poses."""

from __future__ import annotations

from math import radians

import numpy as np

from benchmarks.evidence import number, table
from benchmarks.studies.robots import JOINTS, swinging
from exudyn_model import simulate as exudyn_simulate
from reference_model.planning.least_energy import least_energy
from reference_model.simulation import simulate
from robot_model import ComputedTorque, Quintic, Recording, Reference, Robot

__all__ = ["section"]

#: Joint displacements [rad], viscous friction [N m s/rad] and winding resistances [ohm].
DISPLACEMENTS = {"joint1": radians(30), "joint2": radians(-45)}
VISCOUS, RESISTANCE = 40.0, 0.5
DURATIONS = (5.0, 10.0, 20.0, 40.0)

INTRODUCTION = """\
## [7] Losses and the motion of least energy

Katoh and others plan paths of a space robot that save the energy consumed by the mechanical viscous
friction and the armatures' resistances of the motors. `simulate(robot, losses=True)` gives both in either
engine, as power and energy of every joint. `least_energy(robot, {joint: displacement}, duration=T)` finds
the motion of least loss from rest to rest, by direct collocation and IPOPT, with the dynamics of the
floating robot and its torque limits (`reference_model/planning/least_energy.py`); its result is a robot
with tables as reference, which either engine follows. Their equations could not be read; the loss follows
their description, the method is ours."""


def section() -> str:
    """The complete section."""
    rows = []
    for duration in DURATIONS:
        robot = _robot(duration)
        planned = least_energy(robot, DISPLACEMENTS, duration=duration)
        quintic, best = (simulate(r, sensors=False, losses=True) for r in (robot, planned.robot))
        rows.append(
            [
                f"{duration:g}",
                *_cells(quintic),
                *_cells(best),
                number(100 * (1 - _total(best) / _total(quintic))),
                number(100 * (1 - planned.loss / planned.quintic)),
            ]
        )
    headings = (
        *("duration, s:", "quintic: friction, J:", "windings, J:", "least energy: friction, J:"),
        *("windings, J:", "saved, %:", "saved in the plan, %:"),
    )
    text = (
        "Flexible space robot, free base; joints turn by 30 and -45 degrees under computed torque, kp = 1 "
        f"and kd = 2. Viscous friction {VISCOUS:g} N m s/rad, windings of {RESISTANCE:g} ohm. The plan "
        "assumes rigid links; energies are those of the flexible robot that follows it. With winding losses "
        "only, the best motion of a single axis is a cubic, which loses 0.7 of a quintic's energy; with "
        "friction losses only it is a constant speed, which also loses 0.7 of it: at most 30 % can be saved."
    )
    return "\n\n".join([INTRODUCTION, text, table(headings, rows), _engines()])


def _cells(run: Recording) -> list[str]:
    return [number(_lost(run, kind)) for kind in ("friction", "armature")]


def _lost(run: Recording, kind: str) -> float:
    return sum(float(run[f"{joint}.{kind}_energy"][-1]) for joint in JOINTS)


def _total(run: Recording) -> float:
    return _lost(run, "friction") + _lost(run, "armature")


def _engines() -> str:
    robot = _robot(5.0)
    assert robot.reference is not None
    robot = robot.model_copy(update={"reference": robot.reference.model_copy(update={"duration": 1.0})})
    own, other = (run(robot, sensors=False, losses=True) for run in (simulate, exudyn_simulate))
    channels = [f"{joint}.{kind}_energy" for joint in JOINTS for kind in ("friction", "armature")]
    gap = max(float(np.abs(own[c] - other[c]).max() / own[c][-1]) for c in channels)
    return (
        f"Over the first second of the fastest motion the engines' energies differ by {gap:.1e} of their "
        "final values."
    )


def _robot(duration: float) -> Robot:
    joints = tuple(Quintic(joint=n, displacement=d, duration=duration) for n, d in DISPLACEMENTS.items())
    reference = Reference(duration=duration, sample_rate=100.0, joints=joints)
    friction = [{"effect": "viscous_friction", "coefficient": VISCOUS}]
    robot = swinging(friction, reference, ComputedTorque(kp=1.0, kd=2.0))
    data = robot.model_dump()
    for joint in data["joints"]:
        joint["actuator"]["resistance"] = RESISTANCE
    return Robot.model_validate(data)
