"""KUKA KR300: six axes from motor torque and motor motion, and what lies between two encoders of an axis."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from benchmarks.evidence import (
    EXAMPLES,
    estimate,
    findings,
    fit_table,
    number,
    percent,
    recording_of,
    relative,
    table,
    told,
)
from missing_physics.diagnosis import Result, diagnose
from missing_physics.diagnosis.gear.transmission import TransmissionResult, diagnose_transmission
from missing_physics.diagnosis.preparation.setup import make_segments
from missing_physics.recordings.datasets import fetch_dataset
from missing_physics.results.result import ChannelFit, Estimate, Finding
from robot_model import load_robot

__all__ = ["section"]

FITTED, SCORED = "traj_A.mat", "traj_B.mat"
NOMINALS = ("nominal", "published")
TORQUE = ".torque"
#: A held-out error that grows by more than this is called worse.
WORSE = 1.02


def section() -> str:
    """The section, in Markdown."""
    folder = fetch_dataset("kuka_kr300")
    results = {name: _diagnosed(name, folder) for name in NOMINALS}
    ways = ((FITTED, SCORED), (SCORED, FITTED))
    gaps = {way: _transmission(folder, *way) for way in ways}
    parts = [
        "## KUKA KR300: six axes",
        f"`{FITTED}` is fitted, `{SCORED}` only scored. `nominal.toml` has the published masses and rotors "
        "and no friction; `published.toml` has the published friction too. Neither has the hydraulic "
        "counterbalance of axis 2. Equivalent command, for each:",
        "```\nmissing-physics diagnose examples/kuka_kr300/NOMINAL.toml FOLDER/kuka_kr300/traj_A.mat \\\n"
        "    --validate FOLDER/kuka_kr300/traj_B.mat --map examples/kuka_kr300/map.toml\n```",
        *(part for name, result in results.items() for part in _case(name, result, gaps[FITTED, SCORED])),
        "### Between the encoders of axes 1 to 3, both ways round",
        told(gaps[FITTED, SCORED].could_not_tell),
        *(part for way, gap in gaps.items() for part in _way(way, gap)),
        "What these answers are worth is weighed in `examples/kuka_kr300/README.md`.",
    ]
    return "\n\n".join(parts)


def _diagnosed(name: str, folder: Path) -> Result:
    fitted, scored = (recording_of(folder, file, example="kuka_kr300") for file in (FITTED, SCORED))
    return diagnose(load_robot(EXAMPLES / "kuka_kr300" / f"{name}.toml"), [fitted], [scored])


def _case(name: str, result: Result, gap: TransmissionResult) -> Iterator[str]:
    """What the torques say; `gap` holds the findings between encoders, which are told apart from these."""
    diagnosis = result.diagnosis
    apart = {(f.effect, f.location) for f in gap.findings}
    found = [f for f in diagnosis.findings if (f.effect, f.location) not in apart]
    channels = {name: fit for name, fit in diagnosis.fit.channels.items() if name.endswith(TORQUE)}
    yield f"### Nominal robot `{name}.toml`"
    yield f"Verdict of the whole: **{diagnosis.verdict}**, in {result.seconds:.1f} s. Of the torques:"
    yield told([item.words for item in diagnosis.mismatch if item.channel in channels and item.words])
    yield findings(found)
    yield _per_axis(found, channels)
    yield fit_table(channels)
    yield _worse(channels)
    if diagnosis.nominal_parameters:
        changes = [
            f"`{c.name}` from {number(c.nominal)} to {estimate(Estimate(c.estimate, c.ci95, c.unit))}"
            for c in diagnosis.nominal_parameters
        ]
        yield "Re-estimated numbers of the nominal robot:\n\n" + told(changes)
    yield "Could not tell:\n\n" + told([s for s in diagnosis.could_not_tell if s not in gap.could_not_tell])


def _per_axis(found: Sequence[Finding], channels: Mapping[str, ChannelFit]) -> str:
    """Named effects and relative torque errors of each axis."""
    rows = []
    for channel, fit in channels.items():
        joint = channel.removesuffix(TORQUE)
        named = [f.effect for f in found if f.location.split(".")[0] == joint]
        before, after = relative(fit.relative_error_before), relative(fit.relative_error_after)
        rows.append([joint, ", ".join(named) or "nothing", *before, *after])
    headings = ["axis", "named", "torque error before, fitted:", "held out:", "after, fitted:", "held out:"]
    return table(headings, rows)


def _worse(channels: Mapping[str, ChannelFit]) -> str:
    """Says it where an axis is predicted worse than before on data that were not fitted."""
    worse = [
        f"{channel} ({number(fit.before.validation_rms)} to {number(fit.after.validation_rms)} {fit.unit})"
        for channel, fit in channels.items()
        if fit.after.validation_rms > WORSE * fit.before.validation_rms
    ]
    if not worse:
        return "No axis is predicted worse on the held-out recording than before."
    return f"Predicted worse on the held-out recording than before: {', '.join(worse)}."


def _transmission(folder: Path, fitted: str, scored: str) -> TransmissionResult:
    robot = load_robot(EXAMPLES / "kuka_kr300" / "nominal.toml")
    one, two = (recording_of(folder, file, example="kuka_kr300") for file in (fitted, scored))
    found = diagnose_transmission(robot, [one], [two], segments=make_segments(robot, [one, two]))
    assert found is not None
    return found


def _way(way: tuple[str, str], gap: TransmissionResult) -> Iterator[str]:
    yield f"`{way[0]}` fitted, `{way[1]}` held out; rms about a constant [microrad]:"
    rows = []
    for channel, fit in gap.fit.items():
        joint = channel.split(".")[0]
        errors = (
            *(fit.before.train_rms, fit.after.train_rms),
            *(fit.before.validation_rms, fit.after.validation_rms),
        )
        named = [
            f"{f.effect} ({percent(f.probability, 0)}): "
            + ", ".join(f"{name} {estimate(e)}" for name, e in f.parameters.items())
            for f in gap.findings
            if f.location.split(".")[0] == joint
        ]
        cells = [f"{1e6 * e:.0f}" for e in errors]
        rows.append([joint, *cells, f"{1e6 * fit.noise_floor:.1f}", "; ".join(named) or "nothing"])
    headings = [
        *("axis", "fitted, before:", "fitted, after:", "held out, before:", "held out, after:"),
        *("noise:", "named"),
    ]
    yield table(headings, rows)
