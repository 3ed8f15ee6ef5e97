"""What the pages under `reports/evidence` share: their head, tables, and a diagnosis in Markdown."""

from __future__ import annotations

import argparse
import datetime
import os
import platform
import shlex
import subprocess
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib.metadata import version
from pathlib import Path

from missing_physics.diagnosis import Diagnosis
from missing_physics.recordings import load_mapping, load_recording
from missing_physics.results.result import ChannelFit, Errors, Estimate, Finding, Stage
from missing_physics.wording.numbers import within_text
from reference_model.effects.catalogue import catalogue, get_effect
from robot_model import Recording

__all__ = [
    "EVIDENCE",
    "EXAMPLES",
    "ROOT",
    "command_line",
    "commit",
    "estimate",
    "final_values",
    "findings",
    "fit_table",
    "head",
    "held_out_fall",
    "number",
    "paragraph",
    "percent",
    "recording_of",
    "relative",
    "table",
    "told",
    "values_of",
]

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
EVIDENCE = ROOT / "reports" / "evidence"

#: Packages whose versions move numbers.
PACKAGES = ("numpy", "scipy", "casadi", "exudyn", "missing-physics")
#: Folders whose changes move numbers.
SOURCES = ("robot_model", "reference_model", "exudyn_model", "missing_physics", "examples", "benchmarks")
#: Rivals less probable than this are not listed.
WORTH_SHOWING = 1e-3


def head(title: str, *, command: str) -> str:
    """Title, command, date, versions and kind of machine."""
    versions = ", ".join(
        [f"Python {platform.python_version()}", *(f"{name} {version(name)}" for name in PACKAGES)]
    )
    machine = f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores"
    at = f" at commit {commit()}" if commit() else ""
    date = datetime.date.today().isoformat()
    made = f"Made by `{command}` on {date}{at}; {versions}; {machine}. No number was put in by hand."
    return f"# {title}\n\n{made}"


def command_line(parser: argparse.ArgumentParser, given: argparse.Namespace, names: Iterable[str]) -> str:
    """The command with those of the named arguments that are not as they are when left out."""
    words = [parser.prog]
    for name in names:
        value = getattr(given, name)
        if value != parser.get_default(name):
            words += [f"--{name.replace('_', '-')}", shlex.quote(str(value))]
    return " ".join(words)


@cache
def commit() -> str:
    """The commit of the program, marked where tracked files differ from it; empty without a checkout."""
    git = ["git", "-C", str(ROOT)]
    try:
        name, changed = (
            subprocess.run([*git, *words], capture_output=True, text=True, check=True).stdout.strip()
            for words in (("rev-parse", "--short", "HEAD"), ("status", "--porcelain", "-uno", "--", *SOURCES))
        )
    except (OSError, subprocess.CalledProcessError):
        return ""
    return f"{name} with changes" if changed else name


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; headings that end in `:` are aligned to the right."""
    names = [h.removesuffix(":") for h in headings]
    rule = ["---:" if h.endswith(":") else "---" for h in headings]
    lines = [names, rule, *([cell.replace("|", "\\|") for cell in row] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def paragraph(*sentences: str) -> str:
    """Sentences that are not empty, as one paragraph."""
    return " ".join(s for s in sentences if s)


def number(value: float) -> str:
    """Four digits."""
    return f"{value:.4g}"


def percent(value: float, digits: int = 2) -> str:
    """A share as percent."""
    return f"{100 * value:.{digits}f} %"


def estimate(item: Estimate) -> str:
    """Value, interval and unit."""
    return within_text(item.value, item.ci95, item.unit)


def told(items: Sequence[str]) -> str:
    """Sentences as a list; says so when there are none."""
    return "\n".join(f"- {item}" for item in items) if items else "- nothing"


#: Words with which a finding tells what it replaced.
NAMED_FIRST = "it was named first"


def findings(found: Sequence[Finding]) -> str:
    """Findings in the order of naming, with intervals and what each brings on data that were not fitted."""
    if not found:
        return "No effect is named."
    rows = []
    for place, item in enumerate(found, start=1):
        values = "; ".join(f"{name} {estimate(e)}" for name, e in item.parameters.items())
        rivals = ", ".join(
            f"{a.effect} at {a.location} ({a.probability:.2g})"
            for a in item.alternatives
            if a.probability >= WORTH_SHOWING
        )
        event = get_effect(item.effect).is_event if item.effect in catalogue() else False
        gain = "an event, other data cannot confirm it" if event else percent(item.validation_improvement, 1)
        rows.append(
            [str(place), item.effect, item.location, f"{item.probability:.3g}", values, gain, rivals or "-"]
        )
    made = table(
        [
            "",
            "effect",
            "place",
            "probability:",
            "parameters",
            "held-out energy it removes:",
            "rivals",
        ],
        rows,
    )
    told_beside = list(_told_beside(found))
    return made + ("\n\n" + told(told_beside) if told_beside else "")


def _told_beside(found: Sequence[Finding]) -> Iterator[str]:
    """How findings came about, and what was named before them."""
    for item in found:
        if item.note:
            yield f"{item.effect}: {item.note}"
        for other in item.alternatives:
            if NAMED_FIRST in other.why_not:
                yield f"{item.effect} against {other.effect} ({other.probability:.2g}): {other.why_not}"


def values_of(stage: Stage) -> dict[str, Estimate]:
    """Everything estimated at a stage: inertial numbers by name, the rest as `effect@place.parameter`."""
    values = {c.name: Estimate(c.estimate, c.ci95, c.unit) for c in stage.nominal_parameters}
    for label, own in stage.parameters.items():
        values |= {f"{label}.{name}": item for name, item in own.items()}
    return values


def final_values(diagnosis: Diagnosis) -> dict[str, Estimate]:
    """The same of the final answer."""
    changes = diagnosis.nominal_parameters
    values = {c.name: Estimate(c.estimate, c.ci95, c.unit) for c in changes}
    for item in diagnosis.findings:
        values |= {f"{item.effect}@{item.location}.{name}": e for name, e in item.parameters.items()}
    return values


def relative(errors: Errors | None) -> tuple[str, str]:
    """Relative errors on fitted and held-out data as percent."""
    return ("-", "-") if errors is None else (percent(errors.train_rms), percent(errors.validation_rms))


def recording_of(folder: Path, name: str, *, example: str) -> Recording:
    """A recording through its example's map, with the bare file name as its source."""
    mapping = load_mapping(EXAMPLES / example / "map.toml")
    return replace(load_recording(folder / name, mapping=mapping), source=name)


def held_out_fall(fit: ChannelFit) -> float:
    """By which part of itself the held-out error of a channel falls."""
    return 1 - fit.after.validation_rms / max(fit.before.validation_rms, 1e-300)


def fit_table(channels: Mapping[str, ChannelFit]) -> str:
    """Every channel before and after, on fitted and on held-out data."""
    rows = []
    for channel, fit in channels.items():
        before, after = fit.before, fit.after
        rows.append(
            [
                channel,
                fit.unit,
                number(before.train_rms),
                number(after.train_rms),
                number(before.validation_rms),
                number(after.validation_rms),
                percent(held_out_fall(fit), 0),
                number(fit.noise_floor),
            ]
        )
    headings = [
        *("channel", "unit", "fitted, before:", "fitted, after:", "held out, before:", "held out, after:"),
        *("held-out error falls by:", "noise:"),
    ]
    return table(headings, rows)
