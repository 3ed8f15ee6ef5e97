"""The pictures of the friction study."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from benchmarks.friction.cases import JOINTS, LAWS, Case, run
from benchmarks.friction.features import reversal_windows
from benchmarks.friction.measures import deflection, error, spectrum
from benchmarks.svg_lines import Line, Panel, figure
from missing_physics.reporting.elements.palette import AFTER, BEFORE, FORWARDS, HELD_OUT, WINDOW
from robot_model import Recording

__all__ = ["hunting", "laws", "loads", "response", "spectra"]

Array = NDArray[np.float64]

#: One colour per friction law, in all pictures.
COLOURS = {"none": HELD_OUT, "Coulomb": BEFORE, "Stribeck": FORWARDS, "LuGre": AFTER}
#: One more for the laws that leave static friction at a lower speed.
LAST = "#E69F00"
#: Range shown around a reversal: displacement [mrad] and velocity [mrad/s].
NEAR_PLACE, NEAR_SPEED = 0.6, 3.0
#: Frequencies that are shown in spectra [Hz].
LOWEST, HIGHEST = 0.5, 8.0
#: The first swings after a motion under PID, before friction matters, are not shown [s].
UNREST = 30.0
MILLI = 1e3


def response(title: str, case: Case) -> str:
    """Tracking errors, tip deflection and friction of a manoeuvre under each law."""
    laws = {law: case.but(friction=law) for law in COLOURS}
    return figure(
        title,
        [
            _over_time("tracking error, joint 1", "mrad", laws, lambda r: MILLI * error(r, "joint1")),
            _over_time("tracking error, joint 2", "mrad", laws, lambda r: MILLI * error(r, "joint2")),
            _over_time("tip deflection along z", "mm", laws, lambda r: MILLI * deflection(r)[:, 1]),
            _over_time("friction torque, joint 2", "N m", laws, lambda r: r["joint2.friction_torque"]),
        ],
    )


def spectra(title: str, cases: Mapping[str, Case]) -> str:
    """Spectra of the tip's deflection, one panel per case."""
    panels = []
    for name, case in cases.items():
        lines = []
        for law, colour in COLOURS.items():
            frequency, density = spectrum(case.but(friction=law))
            kept = (frequency >= LOWEST) & (frequency <= HIGHEST)
            lines.append(Line(law, colour, frequency[kept], density[kept]))
        panels.append(Panel(name, "frequency, Hz", "power density, m\u00b2/Hz", lines, log=True))
    return figure(title, panels)


def laws(title: str, case: Case, joint: str) -> str:
    """Friction around a reversal: against time, velocity, and displacement since the reversal."""
    rates, by_time, by_speed, by_way = [], [], [], []
    for law in LAWS:
        chosen, colour = case.but(friction=law), COLOURS[law]
        found = run(chosen)
        window, turn = reversal_windows(chosen, joint)[0]
        time, speed = found.time[window], MILLI * found[f"{joint}.velocity"][window]
        friction, place = found[f"{joint}.friction_torque"][window], found[f"{joint}.position"]
        way = MILLI * (place[window] - place[turn])
        slow, near = np.abs(speed) < NEAR_SPEED, np.abs(way) < NEAR_PLACE
        rates.append(Line(law, colour, time, speed))
        by_time.append(Line(law, colour, time, friction))
        by_speed.append(Line(law, colour, speed[slow], friction[slow]))
        by_way.append(Line(law, colour, way[near], friction[near]))
    panels = [
        Panel("velocity around a reversal", "time, s", "mrad/s", rates),
        Panel("friction torque around it", "time, s", "N m", by_time),
        Panel("friction against velocity, near zero", "velocity, mrad/s", "N m", by_speed),
        Panel("friction against the way since the reversal", "way, mrad", "N m", by_way),
    ]
    return figure(title, panels)


def hunting(title: str, cases: Mapping[str, Case]) -> str:
    """Integral action: error and friction of both joints in the hold after the motion."""
    colours = dict(zip(cases, (*COLOURS.values(), LAST, WINDOW)))
    panels = []
    for quantity, unit in (("error", "mrad"), ("friction torque", "N m")):
        for joint in JOINTS:
            lines = []
            for name, case in cases.items():
                found = run(case)
                late = found.time > case.motion_end + UNREST
                values = (
                    MILLI * error(found, joint) if quantity == "error" else found[f"{joint}.friction_torque"]
                )
                lines.append(Line(name, colours[name], found.time[late], values[late]))
            panels.append(Panel(f"{quantity}, joint {joint[-1]}", "time, s", unit, lines))
    return figure(title, panels)


def loads(title: str, case: Case) -> str:
    """Bearing loads and friction torques by both models of the joint, and those of the planar robot."""
    panels = []
    for quantity, name in (("load_moment", "bearing load W"), ("friction_torque", "friction torque")):
        for joint in JOINTS:
            lines = []
            for words, changes, colour in (
                ("spatial joint", {}, AFTER),
                ("radial force alone", {"joint": "planar"}, BEFORE),
                ("planar robot", {"geometry": "planar"}, HELD_OUT),
            ):
                found = run(case.but(**changes))
                lines.append(Line(words, colour, found.time, found[f"{joint}.{quantity}"]))
            panels.append(Panel(f"{name}, joint {joint[-1]}", "time, s", "N m", lines))
    return figure(title, panels)


def _over_time(
    title: str, unit: str, cases: Mapping[str, Case], values: Callable[[Recording], Array]
) -> Panel:
    lines = []
    for law, case in cases.items():
        found = run(case)
        lines.append(Line(law, COLOURS[law], found.time, values(found)))
    return Panel(title, "time, s", unit, lines)
