"""A picture of every effect for the catalogue page: its signature in a simulated recording.

``python -m benchmarks.signatures.pictures [FOLDER]`` writes ID.svg of each into FOLDER, by default the folder
of the package. Robots, parameters and channels are in `cases`; nothing is measured.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.signatures.cases import CASES, Case
from benchmarks.svg_lines import Line, Panel, figure
from missing_physics.reporting.elements.palette import AFTER, HELD_OUT
from reference_model.effects.catalogue import get_effect
from reference_model.effects.page import PICTURES
from reference_model.evaluation.model import RobotModel
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, Robot, unit_of, write_atomically

__all__ = ["picture"]

Array = NDArray[np.float64]

#: Points of a line: enough for a picture of this width, few enough for a small file.
POINTS = 320


def picture(effect_id: str) -> str:
    """The SVG of one effect."""
    case, effect = CASES[effect_id], get_effect(effect_id)
    use = EffectUse.model_validate({"effect": effect_id, "at": case.at, **case.values})
    plain = case.robot.with_effects(*case.beside)
    what, lines = _DRAWN[case.kind](case, plain, plain.with_effects(use))
    over, unit = _abscissa(case)
    panel = Panel(f"{effect_id} at {case.at}", f"{over} [{unit}]", what, lines)
    return figure(effect.title, [panel], columns=1)


def _abscissa(case: Case) -> tuple[str, str]:
    if case.over == "time":
        return "time", "s"
    channel = f"joint1.{case.over}"
    return channel, unit_of(channel)


def _recording(case: Case, robot: Robot, *, sensors: bool = False) -> Recording:
    return simulate(robot, sensors=sensors, rtol=1e-8, atol=1e-10)


def _line(label: str, colour: str, case: Case, recording: Recording, y: Array) -> Line:
    x = recording.time if case.over == "time" else recording[f"joint1.{case.over}"]
    begin, end = case.span
    rows = np.flatnonzero((recording.time >= begin) & (recording.time <= end))
    rows = rows[np.linspace(0, len(rows) - 1, min(POINTS, len(rows))).astype(int)]
    return Line(label, colour, x[rows], y[rows])


def _residual(case: Case, plain: Robot, real: Robot) -> tuple[str, list[Line]]:
    """Measured torque minus the torque required by the description without any effect."""
    bare = RobotModel(plain)
    lines = []
    for label, colour, robot in (("without", HELD_OUT, plain), ("with", AFTER, real)):
        recording = _recording(case, robot)
        state = [recording[f"joint1.{what}"][:, None] for what in ("position", "velocity", "acceleration")]
        unexplained = recording["joint1.torque"] - bare.inverse_dynamics(*state)[:, 0]
        lines.append(_line(label, colour, case, recording, unexplained))
    return "torque less the described one [N m]", lines


def _error(case: Case, plain: Robot, real: Robot) -> tuple[str, list[Line]]:
    """Reading of the faulty sensor minus the true value."""
    true, measured = _recording(case, plain, sensors=True), _recording(case, real, sensors=True)
    unit = unit_of(case.channel)
    line = _line("with", AFTER, case, true, measured[case.channel] - true[case.channel])
    return f"{case.channel}, measured less true [{unit}]", [line]


def _twist(case: Case, plain: Robot, real: Robot) -> tuple[str, list[Line]]:
    """Motor position minus joint position."""
    recording = _recording(case, real)
    twist = recording["joint1.motor_position"] - recording["joint1.position"]
    return "motor less joint [rad]", [_line("with", AFTER, case, recording, twist)]


def _channel(case: Case, plain: Robot, real: Robot) -> tuple[str, list[Line]]:
    """The channel itself."""
    lines = []
    for label, colour, robot in (("without", HELD_OUT, plain), ("with", AFTER, real)):
        recording = _recording(case, robot)
        lines.append(_line(label, colour, case, recording, recording[case.channel]))
    return f"{case.channel} [{unit_of(case.channel)}]", lines


_DRAWN = {"residual": _residual, "error": _error, "twist": _twist, "channel": _channel}


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else PICTURES
    folder.mkdir(parents=True, exist_ok=True)
    for name in CASES:
        write_atomically(folder / f"{name}.svg", picture(name))
