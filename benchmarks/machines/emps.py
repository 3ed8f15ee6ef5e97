"""EMPS: three nominal robots diagnosed from one recording, scored on another, beside plain least squares."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from benchmarks.evidence import (
    EXAMPLES,
    estimate,
    final_values,
    findings,
    number,
    paragraph,
    percent,
    recording_of,
    relative,
    table,
    told,
    values_of,
)
from benchmarks.machines.emps_recipe import PUBLISHED, STRUCTURES, Axis, predicted_force
from benchmarks.machines.emps_ripple import ripple
from missing_physics.diagnosis import Result, diagnose
from missing_physics.recordings.datasets import fetch_dataset
from missing_physics.results.result import Estimate, Stage
from robot_model import load_robot

__all__ = ["section"]

FITTED, SCORED = "DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"
NOMINALS = ("mass_only", "published", "tuned_away")
CHANNEL = "joint1.torque"
#: Published parameter: its name in a diagnosis, and the sign between the two conventions. Published OF stands
#: on the side of the resistances, `torque_offset` acts on the carriage.
NAMES: Mapping[str, tuple[str, float]] = {
    "M": ("carriage.mass", 1.0),
    "Fv": ("viscous_friction@joint1.coefficient", 1.0),
    "Fc": ("coulomb_friction@joint1.torque", 1.0),
    "OF": ("torque_offset@joint1.torque", -1.0),
}
STRUCTURE = {"viscous_friction@joint1", "coulomb_friction@joint1", "torque_offset@joint1"}
#: Refused candidates with at least this evidence (natural logarithm of odds) are listed.
WORTH_TELLING = 10.0

METHOD = """\
How to read this. Effects enter one after the other; after each entry, effects that it has made superfluous
may leave again. Naming uses only rows in which the joint surely moves in one direction: around a reversal the
sign of the velocity, and so the friction, is not known from filtered data. The *final* parameters come from
these rows, and their intervals span this view and the one that counts quick reversals too; so they differ by
a few percent from least-squares values, which use the reversals. The *step* rows below are fitted to all rows
in which the joint moves, as the published values are. The relative force error is rms of the error over rms
of the force, all samples counted, nothing refitted on the held-out file."""


@dataclass(frozen=True)
class Case:
    """One nominal robot and what came of it."""

    name: str
    result: Result


def section() -> str:
    """The section, in Markdown."""
    folder = fetch_dataset("emps")
    cases = [_diagnosed(name, folder) for name in NOMINALS]
    axes = {name: Axis.of(recording_of(folder, name, example="emps")) for name in (FITTED, SCORED)}
    parts = [
        "## EMPS: one prismatic axis",
        f"`{FITTED}` is fitted, `{SCORED}` only scored. Equivalent command, for each nominal robot:",
        "```\nmissing-physics diagnose examples/emps/NOMINAL.toml FOLDER/emps/DATA_EMPS.mat \\\n"
        "    --validate FOLDER/emps/DATA_EMPS_PULSES.mat --map examples/emps/map.toml\n```",
        METHOD,
        "### Overview",
        _overview(cases),
        *(part for case in cases for part in _case(case)),
        "### Plain least squares beside it",
        *_least_squares(axes, cases),
        "### What remains, over position",
        ripple(cases[0].name, cases[0].result, names=(FITTED, SCORED)),
        "### In words",
        told(list(_words(cases))),
    ]
    return "\n\n".join(parts)


def _diagnosed(name: str, folder: Path) -> Case:
    fitted, scored = (recording_of(folder, file, example="emps") for file in (FITTED, SCORED))
    return Case(name, diagnose(load_robot(EXAMPLES / "emps" / f"{name}.toml"), [fitted], [scored]))


def _overview(cases: list[Case]) -> str:
    rows = []
    for case in cases:
        diagnosis = case.result.diagnosis
        fit = diagnosis.fit.channels[CHANNEL]
        before, after = relative(fit.relative_error_before), relative(fit.relative_error_after)
        named = ", ".join(f.effect for f in diagnosis.findings) or "nothing"
        seconds = f"{case.result.seconds:.1f}"
        rows.append([f"`{case.name}`", diagnosis.verdict, named, *before, *after, seconds])
    headings = [
        *("nominal robot", "verdict", "named, in this order"),
        *("force error before, fitted:", "held out:", "after, fitted:", "held out:", "seconds:"),
    ]
    return table(headings, rows)


def _case(case: Case) -> Iterator[str]:
    diagnosis = case.result.diagnosis
    yield f"### Nominal robot `{case.name}.toml`"
    yield diagnosis.summary
    yield findings(diagnosis.findings)
    changes = [
        f"`{c.name}` from {number(c.nominal)} to {estimate(Estimate(c.estimate, c.ci95, c.unit))}"
        for c in diagnosis.nominal_parameters
    ]
    yield "Re-estimated numbers of the nominal robot:\n\n" + told(changes)
    if diagnosis.stages:
        yield "Step by step:"
        yield _steps(diagnosis.stages)
    yield "Against the published values:"
    yield _against_published(case)
    yield "Weighed with evidence for it, and not believed:\n\n" + told(list(_refused(case)))
    yield "Could not tell:\n\n" + told(diagnosis.could_not_tell)


def _steps(stages: tuple[Stage, ...]) -> str:
    rows, before = [], frozenset[str]()
    for place, stage in enumerate(stages, start=1):
        now = frozenset(stage.effects)
        values = "; ".join(f"{_short(name)} {estimate(e)}" for name, e in values_of(stage).items())
        rows.append(
            [
                str(place),
                _list(e for e in stage.effects if e not in before),
                _list(before - now),
                values,
                *relative(stage.relative_error.get(CHANNEL)),
            ]
        )
        before = now
    return table(["step", "enters", "leaves", "all parameters then", "fitted:", "held out:"], rows)


def _list(labels: Iterator[str] | frozenset[str]) -> str:
    return ", ".join(sorted(label.split("@")[0] for label in labels)) or "-"


def _short(name: str) -> str:
    return name.replace("@joint1", "")


def _published_stage(case: Case) -> Stage | None:
    """The step whose effects, the nominal robot's included, are those of the published model."""
    stages = case.result.diagnosis.stages
    return next((s for s in stages if set(s.parameters) == STRUCTURE), None)


def _against_published(case: Case) -> str:
    stage = _published_stage(case)
    then = values_of(stage) if stage else {}
    end = final_values(case.result.diagnosis)
    rows = []
    for short, value in PUBLISHED.items():
        rows.append([short, number(value), *_compared(short, then), *_compared(short, end)])
    headings = [
        *("", "published:", "step with the published structure:", "deviation:", "interval contains it"),
        *("at the end:", "deviation:", "interval contains it"),
    ]
    return table(headings, rows)


def _compared(short: str, values: Mapping[str, Estimate]) -> tuple[str, str, str]:
    """Value with interval in the published sign, deviation, and whether the interval holds the published."""
    name, sign = NAMES[short]
    if name not in values:
        return "not there", "-", "-"
    found = values[name]
    low, high = sorted(sign * bound for bound in found.ci95)
    turned = Estimate(sign * found.value, (low, high), found.unit)
    published = PUBLISHED[short]
    inside = "yes" if low <= published <= high else "no"
    return estimate(turned), f"{100 * (turned.value / published - 1):+.2f} %", inside


def _refused(case: Case) -> Iterator[str]:
    seen: set[tuple[str, str]] = set()
    refused = [r for r in case.result.ladder if not r.kept and r.evidence > WORTH_TELLING]
    for item in sorted(refused, key=lambda r: -r.evidence):
        if (item.effect, item.location) not in seen:
            seen.add((item.effect, item.location))
            yield (
                f"{item.effect} at {item.location}, beside {len(item.added_to)} named effects "
                f"(evidence {item.evidence:.0f}): {item.why}"
            )


def _least_squares(axes: Mapping[str, Axis], cases: list[Case]) -> Iterator[str]:
    yield (
        "Zero-phase Butterworth filter of order 4 at 100 Hz on the position, central differences, decimation "
        "by 10, least squares; written apart from the diagnosis (`benchmarks/machines/emps_recipe.py`)."
    )
    rows = []
    for structure in STRUCTURES:
        values = axes[FITTED].fit(structure)
        rows.append(_recipe_row(f"fitted: {', '.join(structure)}", values, axes))
    rows.append(_recipe_row("published values, nothing fitted", PUBLISHED, axes))
    yield table(["model", *(f"{name}:" for name in PUBLISHED), "force error, fitted:", "held out:"], rows)
    yield (
        "The diagnoses' final parameters on the same motion and force, by the recipe's own differences and "
        "decimation, nothing refitted:"
    )
    rows = []
    for case in cases:
        values = {name: e.value for name, e in final_values(case.result.diagnosis).items()}
        forces = {name: predicted_force(axis, values) for name, axis in axes.items()}
        errors = [
            "holds effects that the recipe lacks" if f is None else percent(axes[name].relative_error(f))
            for name, f in forces.items()
        ]
        rows.append([f"`{case.name}`, diagnosed", *errors])
    yield table(["model", "force error, fitted:", "held out:"], rows)


def _recipe_row(label: str, values: Mapping[str, float], axes: Mapping[str, Axis]) -> list[str]:
    cells = [number(values[name]) if name in values else "-" for name in PUBLISHED]
    return [label, *cells, *(percent(axis.error(values)) for axis in axes.values())]


def _words(cases: list[Case]) -> Iterator[str]:
    for case in cases:
        yield paragraph(f"`{case.name}`:", *_story(case))
    structures = {case.name: _structure(case) for case in cases}
    first = structures[NOMINALS[0]]
    for name in NOMINALS[1:]:
        here = structures[name]
        same = "ends with the same effects as" if here == first else "ends with other effects than"
        extra = "" if here == first else f": {', '.join(sorted(here))} against {', '.join(sorted(first))}"
        yield f"`{name}` {same} `{NOMINALS[0]}`{extra}."


def _structure(case: Case) -> frozenset[str]:
    """Effects of the final answer, the nominal robot's included."""
    return frozenset(n.split("@")[0] for n in final_values(case.result.diagnosis) if "@" in n)


def _story(case: Case) -> Iterator[str]:
    """Who came, who went, and what it did to the held-out error."""
    stages = case.result.diagnosis.stages
    if not stages:
        yield "nothing is named."
        return
    before, error = frozenset[str](), None
    for stage in stages:
        now = frozenset(stage.effects)
        enters = _list(e for e in stage.effects if e not in before)
        held = stage.relative_error[CHANNEL].validation_rms
        fell = "" if error is None else f" from {percent(error)}"
        gone = f" and replaces {_list(before - now)}" if before - now else ""
        yield f"{enters} enters{gone} (held-out force error{fell} to {percent(held)})."
        before, error = now, held
    alike = _published_stage(case)
    if alike is not None:
        off = [f"{name} {_compared(name, values_of(alike))[1]}" for name in PUBLISHED]
        yield f"With the published structure the parameters deviate from the published by {', '.join(off)}."
    for change in case.result.diagnosis.nominal_parameters:
        if "@" in change.name and change.ci95[0] <= 0.0 <= change.ci95[1]:
            yield f"The nominal robot's {_short(change.name)} cannot be told from zero any more."
