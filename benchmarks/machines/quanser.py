"""Quanser two-link arm: the published linear model against its own maker's specimen and another."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks.evidence import (
    EXAMPLES,
    estimate,
    final_values,
    findings,
    fit_table,
    held_out_fall,
    number,
    paragraph,
    percent,
    table,
    told,
)
from missing_physics.diagnosis import Result, diagnose
from missing_physics.recordings import load_mapping, load_recording
from missing_physics.recordings.datasets import fetch_dataset
from missing_physics.results.result import Estimate
from robot_model import Recording, load_robot

__all__ = ["section"]

EXAMPLE = "quanser_two_link"
#: Recordings with their maps, as they are called below.
FILES = {
    "2026": ("lqr_full_10deg.mat", "map.toml"),
    "2011": ("quarc_data_fsf_th11.mat", "map_quarc.toml"),
}
#: The run of 2026 repeats itself after so long [s].
PERIOD = 10.0
#: Joint and link of each stage.
STAGES = {"first": ("joint1", "flex1"), "second": ("joint2", "flex2")}
#: Stiffness [N m/rad] of both links by theory, and by the makers' torque impulse tests (`config_2dslf.m`).
THEORY = {"flex1": 39.957, "flex2": 6.858}
TESTED = {"flex1": 27.0, "flex2": 2.5}

METHOD = """\
The machine's linear model as published, with both stages in series (`serial.toml`) and apart as the authors
have it (`stages.toml`); a leaf spring is a joint without a motor, whose position is the angle that the strain
gauge tells and whose torque is known to be nothing. Two recordings exist: of 2026, by the owner of the
repository, and of 2011, by the manufacturer: **two specimens**. A fit to one that helps the other tells of
the design; friction need not be the same. The run of 2026 repeats one motion, so its second half proves that
a finding is no accident of noise, and not that it holds for another motion. The error of a channel
`flexN.torque` is what is left of the link's equation of motion. What is special in these data, the undone
strain filter above all, is in `examples/quanser_two_link/README.md`."""

STAGE_BY_STAGE = """\
What is named is proven: it lowers the error of the recording that was not fitted by more than chance. The
last columns say by how much that error falls, of the joint's torque and of the link's equation of motion;
where nothing is named, changed numbers of the nominal robot are all that lowers it."""


@dataclass(frozen=True)
class Case:
    """One diagnosis: what was fitted, and what was scored."""

    title: str
    nominal: str
    fitted: Recording
    scored: Recording


def section() -> str:
    """The section, in Markdown."""
    folder = fetch_dataset(EXAMPLE)
    every = {name: _recording(folder, *files) for name, files in FILES.items()}
    halves = _halves(every["2026"])
    cases = [
        Case("One specimen: first half of 2026 fitted, second scored", "serial", *halves),
        Case("Two specimens: 2026 fitted, 2011 scored", "serial", every["2026"], every["2011"]),
        Case("Two specimens: 2011 fitted, 2026 scored", "serial", every["2011"], every["2026"]),
        Case("The stages apart: 2026 fitted, 2011 scored", "stages", every["2026"], every["2011"]),
    ]
    results = [_diagnosed(case) for case in cases]
    return "\n\n".join(
        [
            "## Quanser two-link arm: flexible links with strain gauges",
            METHOD,
            "### Stiffness of the links",
            _stiffness(cases, results),
            "### What is missing at each stage",
            STAGE_BY_STAGE,
            _stages(cases, results),
            *(part for case, result in zip(cases, results) for part in _case(case, result)),
        ]
    )


def _recording(folder: Path, file: str, map_file: str) -> Recording:
    mapping = load_mapping(EXAMPLES / EXAMPLE / map_file)
    return replace(load_recording(folder / file, mapping=mapping), source=file)


def _halves(recording: Recording) -> tuple[Recording, Recording]:
    first, second = recording.window(0.0, PERIOD), recording.window(PERIOD, 2 * PERIOD)
    return (
        replace(first, source=f"{recording.source}, up to {PERIOD:g} s"),
        replace(second, source=f"{recording.source}, from {PERIOD:g} s"),
    )


def _diagnosed(case: Case) -> Result:
    robot = load_robot(EXAMPLES / EXAMPLE / f"{case.nominal}.toml")
    return diagnose(robot, [case.fitted], [case.scored])


def _stiffness(cases: list[Case], results: list[Result]) -> str:
    """Theory, the makers' own tests and what was found, for both links."""
    rows = [["theory (the robot files)", *(number(THEORY[link]) for link in THEORY), "-"]]
    rows.append(["the makers' torque impulse tests", *(number(TESTED[link]) for link in THEORY), "-"])
    for case, result in zip(cases, results):
        values = final_values(result.diagnosis)
        labels = {link: f"cable_spring@{link}.stiffness" for link in THEORY}
        named = {f"{f.effect}@{f.location}" for f in result.diagnosis.findings}
        proven = [link for link in THEORY if f"cable_spring@{link}" in named]
        rows.append(
            [
                f"{case.title} (`{case.nominal}`)",
                *(_found(values.get(labels[link])) for link in THEORY),
                ", ".join(proven) or "neither",
            ]
        )
    headings = ["N m/rad", "flex1:", "flex2:", "named and proven on the held-out recording"]
    return table(headings, rows)


def _stages(cases: list[Case], results: list[Result]) -> str:
    """What is named and proven at each stage, and what it does to the recording that was not fitted."""
    rows = []
    for stage, places in STAGES.items():
        for case, result in zip(cases, results):
            named = [
                f"{f.effect}@{f.location} ({f.probability:.2f})"
                for f in result.diagnosis.findings
                if f.location.split(".")[0] in places
            ]
            channels = result.diagnosis.fit.channels
            fall = [percent(held_out_fall(channels[f"{place}.torque"]), 0) for place in places]
            rows.append(
                [stage, f"{case.title} (`{case.nominal}`)", ", ".join(named) or "nothing proven", *fall]
            )
    return table(["stage", "", "named and proven", "joint's error falls by:", "link's:"], rows)


def _found(value: Estimate | None) -> str:
    return "as in the file" if value is None else estimate(replace(value, unit="-"))


def _case(case: Case, result: Result) -> Iterator[str]:
    diagnosis = result.diagnosis
    changes = [
        f"`{c.name}` from {number(c.nominal)} to {estimate(Estimate(c.estimate, c.ci95, c.unit))}"
        for c in diagnosis.nominal_parameters
    ]
    yield f"### {case.title}, nominal robot `{case.nominal}.toml`"
    yield paragraph(
        f"Fitted: `{case.fitted.source}`; scored: `{case.scored.source}`.",
        f"Verdict: **{diagnosis.verdict}**, in {result.seconds:.1f} s.",
        diagnosis.summary,
    )
    yield findings(diagnosis.findings)
    yield fit_table(diagnosis.fit.channels)
    yield "Re-estimated numbers of the nominal robot:\n\n" + told(changes)
    yield "Could not tell:\n\n" + told(diagnosis.could_not_tell)
