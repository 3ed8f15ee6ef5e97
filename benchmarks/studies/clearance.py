"""A joint with clearance: contact forces, the journal's orbit, and the loss of tracking accuracy."""

from __future__ import annotations

from math import radians

import numpy as np

from benchmarks.evidence import number, table
from benchmarks.studies.robots import JOINTS, MILLI, above, rms
from exudyn_model import simulate as exudyn_simulate
from reference_model.simulation import simulate
from robot_model import Clearance, ComputedTorque, Quintic, Recording, Reference, Robot, load_robot

__all__ = ["section"]

#: Both joints turn by this angle [rad] in this time [s], and then hold.
TURN, DURATION, HOLD, RATE = radians(10), 2.0, 1.0, 2000.0
JOURNAL, STIFFNESS, RESTITUTION, FRICTION = 0.04, 1e9, 0.9, 0.1
RADIAL = (1e-4, 3e-4, 1e-3)

INTRODUCTION = """\
## [12] Joint clearance

Zhao and Bai put clearance and Coulomb friction into the joints of a space manipulator. A revolute joint's
`clearance` table lets its journal move in the bearing, across the axis: contact after Lankarani and
Nikravesh (1990), Coulomb friction at the journal's surface, which turns the joint as well. Along the axis
and in bending the joint stays ideal, so that the same table serves planar and spatial robots. The two
coordinates across the axis are slides of links without mass, which `robot_model/description/loosening.py`
puts into the tree; the contact is in `reference_model/joint/clearance.py`, with the speed at the beginning of
a contact as a state, and in `exudyn_model/effects/clearance.py`, which remembers it."""


def section() -> str:
    """The complete section."""
    rows = []
    for name in ("flexible_space_robot_planar", "flexible_space_robot"):
        for radial in (0.0, *RADIAL):
            rows.append(_row(name, radial))
    headings = (
        *("robot", "clearance, mm:", "tracking of joint 2, mrad rms:", "off the bearing, %:"),
        *("contacts:", "largest contact force, N:", "largest radial load of the ideal joint, N:"),
        *("way of the journal, mm:", "tip above 5 Hz, mm rms:"),
    )
    text = (
        "Flexible space robots, free base, computed torque with kp = 25, kd = 10 and rigid nominal model, "
        f"no friction but that of the journal; both joints turn by 10 degrees in {DURATION:g} s and hold for "
        f"{HOLD:g} s. Clearance at joint 2: journal radius {MILLI * JOURNAL:g} mm, stiffness {STIFFNESS:g} "
        f"N/m^1.5, restitution {RESTITUTION:g}, friction coefficient {FRICTION:g}. In weightlessness nothing "
        "but inertia presses the journal against its bearing, so that it crosses the clearance whenever the "
        "arm changes from speeding up to slowing down, and strikes."
    )
    return "\n\n".join([INTRODUCTION, text, table(headings, rows), _engines()])


def _row(name: str, radial: float) -> list[str]:
    run = simulate(_robot(name, radial), sensors=False, rtol=1e-7, atol=1e-9)
    error = run["joint2.reference_position"] - run["joint2.position"]
    shaking = np.hypot(*(above(run, f"link2.tip_deflection.{axis}", 5.0) for axis in "yz"))
    cells = [name.replace("flexible_space_robot", "spatial").replace("spatial_planar", "planar")]
    cells += [f"{MILLI * radial:g}", number(MILLI * rms(error))]
    if not radial:
        largest = number(float(run["joint2.radial_force"].max()))
        return [*cells, "", "", "", largest, "", number(MILLI * rms(shaking))]
    pressed = run["joint2.contact_force"] > 0
    begins = int(np.sum(pressed[1:] & ~pressed[:-1]))
    x, y = (run[f"joint2_clearance_{axis}.position"] for axis in "xy")
    way = float(np.hypot(np.diff(x), np.diff(y)).sum())
    return [
        *cells,
        f"{100 * np.mean(~pressed):.1f}",
        str(begins),
        number(float(run["joint2.contact_force"].max())),
        "",
        number(MILLI * way),
        number(MILLI * rms(shaking)),
    ]


def _engines() -> str:
    robot = _robot("flexible_space_robot_planar", RADIAL[1])
    assert robot.reference is not None
    robot = robot.model_copy(update={"reference": robot.reference.model_copy(update={"duration": 0.3})})
    own, other = simulate(robot, sensors=False), exudyn_simulate(robot, sensors=False, step=2e-4)
    across = _gap(own, other, [f"joint2_clearance_{axis}.position" for axis in "xy"])
    along = _gap(own, other, [f"{joint}.position" for joint in JOINTS])
    return (
        f"Over the first 0.3 s, in which the journal is caught by its bearing, the engines differ by "
        f"{across:.1e} m in the journal's place and {along:.1e} rad in the joints. Impacts part neighbouring "
        "motions, so that longer runs are compared in what they do, not instant by instant."
    )


def _gap(own: Recording, other: Recording, channels: list[str]) -> float:
    return max(float(np.abs(own[name] - other[name]).max()) for name in channels)


def _robot(name: str, radial: float) -> Robot:
    robot = load_robot(name)
    turned = tuple(Quintic(joint=joint, displacement=TURN, duration=DURATION) for joint in JOINTS)
    reference = Reference(duration=DURATION + HOLD, sample_rate=RATE, joints=turned)
    changes = {
        "reference": reference,
        "sensors": (),
        "effects": (),
        "controller": ComputedTorque(kp=25.0, kd=10.0),
    }
    if radial:
        play = Clearance(
            radial=radial,
            journal_radius=JOURNAL,
            stiffness=STIFFNESS,
            restitution=RESTITUTION,
            friction=FRICTION,
        )
        changes["joints"] = tuple(
            joint.model_copy(update={"clearance": play}) if joint.name == "joint2" else joint
            for joint in robot.joints
        )
    return robot.model_copy(update=changes)
