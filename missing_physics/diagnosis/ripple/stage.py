"""Names waves over position that the torques show above the band of the motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from missing_physics.answer.answer import dismissed, rung
from missing_physics.diagnosis.further.errors import Channel, series_of
from missing_physics.diagnosis.further.findings import Key, Reading, findings_of
from missing_physics.diagnosis.further.merge import Further, joined
from missing_physics.diagnosis.ripple.data import RippleData
from missing_physics.diagnosis.ripple.series import fast
from missing_physics.inference import Fit, Posterior, Search, search, weighed
from missing_physics.inference.fit import residuals
from missing_physics.inference.ledger import ODDS
from missing_physics.inference.score import block_scores
from missing_physics.recordings.channels.estimates import resolution_of
from missing_physics.results.result import ChannelSeries, Finding, Result
from missing_physics.standard.model import use_of
from reference_model.effects.base import Parameter
from robot_model import Drive, Recording, Robot, robot_from_toml

__all__ = ["with_ripple"]


def with_ripple(
    result: Result,
    robot: Robot,
    recordings: Sequence[Recording],
    fitted: int,
    slow: float,
    progress: Callable[[str], None] | None = None,
) -> Result:
    """A diagnosis of the torques with the waves over position that are too fast for its band.

    A wave of a motor or gear has the frequency speed times order over two pi. Above the band of the motion
    nothing else of a rigid robot depends on the position.

    Args:
        result: the diagnosis, with its robot file.
        robot: nominal.
        recordings: all of them, corrected for delays, those that are fitted first.
        fitted: how many these are.
        slow: end of the band of the motion [Hz].
        progress: called with a phrase whenever something new is tried.
    """
    file = robot_from_toml(result.augmented_robot_toml)
    if robot.base.kind == "free" or robot.flexible_links or robot.transmissions:
        return result  # bodies that follow the joints vibrate above the band
    compared = np.any([own.counted.any(axis=0) for own in result.rows], axis=0)
    every = [own for own in (fast(file, one, slow, compared) for one in recordings) if own is not None]
    if len(every) < len(recordings):
        return result
    data = RippleData.of(robot, every, fitted)
    if data is None:
        return result
    if progress:
        progress("weighing waves above the band of the motion")
    found = search(data, progress)
    posterior = weighed(found)
    findings = tuple(
        replace(one, note=_words(one, slow))
        for one in findings_of(found, posterior, _reading(data))
        if _is_proven(found, posterior, one) and _exceeds_steps(one, recordings[:fitted])
    )
    more = Further(
        findings=findings,
        could_not_tell=tuple(dismissed(found, findings)),
        ladder=tuple(rung(found, step) for step in found.steps),
        series=_series(data, found.standard, posterior.answer, findings),
    )
    uses = [
        use_of(f.effect, f.location, {name: e.value for name, e in f.parameters.items()}) for f in findings
    ]
    return joined(result, more, robot, uses)


def _series(
    data: RippleData, standard: Fit, answer: Fit, findings: Sequence[Finding]
) -> tuple[ChannelSeries, ...]:
    """Filtered residuals of the joints at which a wave is stated, without and with it."""
    stated = {finding.location.split(".")[0] for finding in findings}
    before, after = ([residuals(data, fit, i) for i in range(len(data.rows))] for fit in (standard, answer))
    channels = [
        Channel(f"{drive.name}.torque above {data.rows[0].own.slow:.2g} Hz", _unit(drive, "N m"), drive.name)
        for drive in data.robot.drives
    ]

    def shown(run: int, k: int) -> dict[str, object]:
        rows, unit = data.rows[run], _unit(data.robot.drives[k], "rad")
        return {
            "recording": rows.own.source,
            "position": rows.own.motion.position[rows.kept, k],
            "velocity": rows.own.motion.velocity[rows.kept, k],
            "variable_units": (unit, f"{unit}/s"),
        }

    every = series_of(data, channels, before, before, after, shown)
    return tuple(one for one in every if one.location in stated)


def _words(finding: Finding, slow: float) -> str:
    order = finding.parameters["order"]
    length = f"{2.0 * math.pi / order.value:.4g} {order.unit.removeprefix('1/')}"
    return f"One cycle is {length}; found above {slow:.2g} Hz, where the motion itself has no part."


def _is_proven(found: Search[RippleData], known: Posterior, finding: Finding) -> bool:
    """Whether data that were not fitted alone outweigh the prior odds against a wave."""
    rest = {term.key for term in known.answer.hypothesis.terms} - {(finding.effect, finding.location)}
    less = [fit for fit in found.made.values() if {term.key for term in fit.hypothesis.terms} == rest]
    if not less:
        return False
    unseen = ~found.data.fitted_blocks
    before, after = (
        float(block_scores(found.data, fit, found.shares)[unseen].sum())
        for fit in (max(less, key=found.score), known.answer)
    )
    return after - before > ODDS


def _exceeds_steps(finding: Finding, recordings: Sequence[Recording]) -> bool:
    """Whether an encoder's wave is larger than its steps, which repeat with the position, too."""
    sizes = [finding.parameters[name].value for name in ("cosine", "sine") if name in finding.parameters]
    seen = [one for one in recordings if finding.location in one]
    return math.hypot(*sizes) > max((resolution_of(one, finding.location) for one in seen), default=0.0)


def _reading(data: RippleData) -> Reading:
    def channels(key: Key) -> list[int]:
        return [data.joints.index(key[1].split(".")[0])]

    def unit(key: Key, p: Parameter) -> str:
        return _unit(data.robot.drives[channels(key)[0]], p.unit)

    return Reading(channels, unit=unit)


def _unit(drive: Drive, unit: str) -> str:
    return unit.replace("N m", "N").replace("rad", "m") if drive.kind == "prismatic" else unit
