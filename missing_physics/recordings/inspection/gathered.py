"""All checks of a recording: consistency of channels, time, values, excitation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from missing_physics.recordings.channels.names import is_native, listed
from missing_physics.recordings.inspection.consistency import consistency_findings
from missing_physics.recordings.inspection.excitation import Excitation, excitation
from missing_physics.recordings.inspection.findings import Finding
from missing_physics.recordings.inspection.timing import timing_findings
from missing_physics.recordings.inspection.values import value_findings
from robot_model import Recording, Robot

__all__ = ["check"]

_ORDER = ("error", "warning", "note")


def check(recording: Recording, *, robot: Robot | None = None) -> tuple[Finding, ...]:
    """Findings of all checks, errors first.

    Args:
        recording: at least a few dozen samples.
        robot: if known, positions are compared with its joints' limits as well.
    """
    moves = excitation(recording)
    found = [
        *consistency_findings(recording, robot=robot),
        *timing_findings(recording),
        *value_findings(recording, moves),
        *_motion(moves),
        *_drive(recording, moves),
        *_left_out(recording),
        *_unknown(recording),
    ]
    return tuple(sorted(found, key=lambda finding: _ORDER.index(finding.severity)))


def _motion(moves: Sequence[Excitation]) -> Iterator[Finding]:
    lacks: dict[tuple[str, str], list[str]] = {}
    for move in moves:
        for lack in _lacks(move):
            lacks.setdefault(lack, []).append(move.place)
    for (kind, words), places in lacks.items():
        yield Finding("warning", kind, f"{places[0]}.position", f"{listed(places)}: {words}")


def _drive(recording: Recording, moves: Sequence[Excitation]) -> Iterator[Finding]:
    """Findings of joints without a known torque, which a diagnosis cannot judge."""
    lacking = []
    for place in dict.fromkeys(move.place for move in moves):
        kinds = [q for q in ("torque", "current", "voltage") if f"{place}.{q}" in recording]
        if not kinds:
            lacking.append(place)
        elif "torque" not in kinds:
            yield Finding(
                "note",
                "torque_constant",
                f"{place}.{kinds[0]}",
                f"{place}: its torque is made of the {' or '.join(kinds)}, for which the robot file must "
                f"have the actuator's torque_constant{' and resistance' if kinds == ['voltage'] else ''}; "
                "--robot checks whether it has.",
            )
    if lacking:
        yield Finding(
            "warning",
            "no_torque",
            f"{lacking[0]}.position",
            f"{listed(lacking)}: no torque, current or voltage is recorded, so a diagnosis can judge nothing "
            "there (but for a joint without an actuator of a robot with actuators).",
        )


def _lacks(move: Excitation) -> Iterator[tuple[str, str]]:
    if not move.moves:
        yield "no_motion", "no motion beyond the noise of the position."
    elif move.trembles:
        yield "no_motion", "only small vibration while another joint moves."
    elif not move.both_directions:
        yield "one_direction", "motion in one direction only."


def _left_out(recording: Recording) -> Iterator[Finding]:
    if recording.left_out:
        yield Finding("warning", "left_out", "time", f"{recording.left_out}.")


def _unknown(recording: Recording) -> Iterator[Finding]:
    for name in recording:
        if not is_native(name):
            yield Finding(
                "note",
                "unknown_quantity",
                name,
                f"{name} is not a native channel; its unit is unknown and it is not used.",
            )
