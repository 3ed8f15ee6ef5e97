"""Inspection of a recording: its content, its problems, and what can be identified from it."""

from __future__ import annotations

import html
import io
import math
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from missing_physics.api.loading import MapLike, PathLike, RobotLike, load_recording, load_robot, map_of
from missing_physics.api.thinning import thinned
from missing_physics.checks.transmissions import on_both_sides
from missing_physics.diagnosis import (
    Coverage,
    contradictions,
    coverage,
    one_way_words,
    prepared,
    reason_words,
)
from missing_physics.drafting.names import is_commanded
from missing_physics.premises import premise_findings
from missing_physics.recordings import (
    SIZE_LIMIT,
    Finding,
    Mapping,
    check,
    corrected_map,
    estimate_noise,
    estimate_resolution,
    excitation,
    load_recording_and_constants,
    outlook,
    own_mapping,
)
from missing_physics.reporting import PlainConsole
from missing_physics.reporting.terminal.inspection import print_inspection
from robot_model import InputError, Recording, Robot, unit_of

__all__ = ["Inspection", "inspect"]

#: Order in which findings are listed.
SEVERITIES = ("error", "warning", "note")
#: Kinds of findings that follow from the motion alone, without a robot.
MOTION = ("no_motion", "one_direction", "no_torque", "torque_constant", "left_out")


@dataclass(frozen=True, repr=False)
class Inspection:
    """The result of an inspection.

    Attributes:
        content: source, samples, duration_s, sample_rate_hz, channels, motion, can_tell, cannot_tell,
            findings, map (that corrects it), constants (of the file).
        problems: findings of the checks, of severity ``error``, ``warning`` or ``note``, with the correction.
    """

    content: dict[str, Any]
    problems: tuple[Finding, ...]

    @property
    def usable(self) -> bool:
        """Whether a diagnosis would take the recording."""
        return not any(problem.severity == "error" for problem in self.problems)

    def to_dict(self) -> dict[str, Any]:
        """The content as plain values, as `missing-physics inspect --json` prints them; NaN becomes None."""
        plain: dict[str, Any] = _plain(self.content)
        return plain

    def summary(self, *, width: int = 100) -> str:
        """The output of the command, as text."""
        console = PlainConsole(file=io.StringIO(), width=width, color_system=None)
        print_inspection(self.content, console)
        text = console.file.getvalue()  # type: ignore[attr-defined]
        return "\n".join(line.rstrip() for line in text.rstrip().splitlines())

    def __repr__(self) -> str:
        found = self.content
        size = f"{len(found['channels'])} channels, {found['samples']} samples, {found['duration_s']:.6g} s"
        return f"<Inspection of {found['source']}: {size}, {len(self.problems)} problems>"

    def _repr_html_(self) -> str:
        """The summary, for a notebook."""
        return f"<pre>{html.escape(self.summary())}</pre>"


def inspect(
    recording: Any,
    robot: RobotLike | None = None,
    *,
    map: MapLike | None = None,
    overlay: PathLike | None = None,
    size_limit: float = SIZE_LIMIT,
) -> Inspection:
    """What is in a recording: channels, rate, noise; what is wrong with it; what it can and cannot show.

    Args:
        recording: a file, as for `load_recording`, a table in memory or a `Recording`.
        robot: as for `load_robot`; if given, its limits and dynamics are compared with the recording.
        map: as for `load_recording`.
        overlay: as for `load_robot`.
        size_limit: of a file's variables in memory [bytes].

    Raises:
        InputError: the recording or the robot cannot be read. Errors in its content are reported as
            `problems`.
        OutOfMemoryError: the machine has too little memory.
    """
    model = None if robot is None else load_robot(robot, overlay=overlay)
    mapping = map_of(map)
    constants: dict[str, float] = {}
    if isinstance(recording, str | os.PathLike):
        mapping = mapping or own_mapping(recording)
        data, constants = load_recording_and_constants(recording, mapping=mapping, size_limit=size_limit)
    else:
        data = load_recording(recording, map=mapping, check=False)
    sliding = {joint.name for joint in model.joints if joint.kind == "prismatic"} if model else set()
    findings, covered = _findings(data, model)
    findings = (*findings, *_command_findings(mapping))
    prismatic = sliding.union(mapping.prismatic if mapping else ())
    content = _report(data, prismatic=prismatic, covered=covered)
    content["findings"] = [asdict(finding) for finding in findings]
    corrections = [correction for finding in findings for correction in finding.corrections]
    content["map"] = corrected_map(data, corrections, mapping) if corrections else ""
    content["constants"] = constants
    return Inspection(content, findings)


def _findings(data: Recording, model: Robot | None) -> tuple[tuple[Finding, ...], Coverage | None]:
    """Findings of the checks; with a robot, and without errors so far, those of a diagnosis's premises."""
    found = check(data, robot=model)
    if model is None or any(finding.severity == "error" for finding in found):
        return found, None
    notes: list[str] = []
    try:
        kept = thinned(model, [data], tell=notes.append)
        ready = prepared(model, [on_both_sides(model, one) for one in kept])
    except InputError as error:  # channels that a diagnosis needs are missing
        stops = Finding("warning", "robot", "time", f"a diagnosis with this robot stops: {error}")
        return (*found, stops), None
    covered = coverage(model, ready.recordings, ready.dynamics, fitted=1, dead=ready.dead)
    # With a robot the motion is judged as in a diagnosis.
    reported = {("dead", channel) for channel in ready.dead}
    others = (f for f in found if f.kind not in MOTION and (f.kind, f.channel) not in reported)
    wrong = contradictions(model, ready.recordings[0], ready.dynamics[0])
    blamed = {correction.channel for finding in wrong for correction in finding.corrections}
    taken = (f for f in premise_findings(model, ready.recordings[0]) if f.channel not in blamed)
    fewer = (Finding("note", "too_many", "time", note.removeprefix(f"{data.source}: ")) for note in notes)
    every = (*wrong, *taken, *_lacking(covered), *fewer, *others)
    return tuple(sorted(every, key=lambda finding: SEVERITIES.index(finding.severity))), covered


def _command_findings(mapping: Mapping | None) -> Iterator[Finding]:
    """Findings of torques whose source columns are named like commands."""
    sources = {} if mapping is None else {name: own.source for name, own in mapping.channels.items()}
    commands = {
        n: s for n, s in sources.items() if n.endswith(".torque") and s is not None and is_commanded(s)
    }
    if commands:
        pairs = ", ".join(f"{name} from '{source}'" for name, source in commands.items())
        yield Finding(
            "note",
            "command",
            next(iter(commands)),
            f"{pairs}: by the name{'s' * (len(commands) > 1)} of what was asked for, not of what was "
            "measured; what the drive makes of it (lag, gain, saturation) counts as missing physics.",
        )


def _lacking(covered: Coverage) -> Iterator[Finding]:
    """What a diagnosis could not determine, as findings."""
    for sentence in covered.general:
        yield Finding("warning", "left_out", "time", sentence)
    for reason, joints in covered.not_judged.items():
        yield Finding("warning", reason.kind, f"{joints[0]}.position", reason_words(reason, joints))
    if one_way := covered.one_way:
        yield Finding("warning", "one_direction", f"{one_way[0]}.position", one_way_words(one_way))
    if not covered.enough:
        yield Finding("warning", "not_enough", "time", "a diagnosis with this robot ends as not_enough_data.")


def _report(
    recording: Recording,
    *,
    prismatic: set[str] | frozenset[str] = frozenset(),
    covered: Coverage | None = None,
) -> dict[str, Any]:
    """Channels, motion and outlook of a recording as plain data.

    Args:
        recording: the recording.
        prismatic: joints whose positions are lengths.
        covered: coverage by a diagnosis, if a robot is given.
    """
    noise, resolution = estimate_noise(recording), estimate_resolution(recording)
    can, cannot = outlook(recording, not_judged=_not_judged(covered))
    return {
        "source": recording.source,
        "samples": len(recording),
        "duration_s": recording.duration,
        "sample_rate_hz": recording.sample_rate,
        "channels": [
            {
                "name": name,
                "unit": unit_of(name, prismatic=name.split(".")[0] in prismatic),
                "smallest": float(np.nanmin(values)),
                "largest": float(np.nanmax(values)),
                "rms": float(np.sqrt(np.nanmean(values**2))),
                "missing": int(np.isnan(values).sum()),
                "noise": noise[name],
                "resolution": resolution.get(name),
            }
            for name, values in recording.channels.items()
        ],
        "motion": [asdict(move) for move in excitation(recording)],
        "can_tell": list(can),
        "cannot_tell": list(cannot),
    }


def _not_judged(covered: Coverage | None) -> dict[str, str]:
    """For each joint that cannot be judged, the sentence with the reason."""
    reasons = {} if covered is None else covered.not_judged
    return {name: reason_words(reason, names) for reason, names in reasons.items() for name in names}


def _plain(value: Any) -> Any:
    """Plain JSON values; numbers that are not finite become null."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
