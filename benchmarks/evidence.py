"""Common parts of the pages under `reports/evidence`: their head, tables, and a diagnosis in Markdown."""

from __future__ import annotations

import argparse
import datetime
import os
import platform
import re
import resource
import shlex
import subprocess
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from importlib.metadata import version
from pathlib import Path

from missing_physics.diagnosis import Diagnosis
from missing_physics.recordings import load_mapping, load_recording
from missing_physics.results.result import Estimate
from robot_model import Recording

__all__ = [
    "EVIDENCE",
    "EXAMPLES",
    "ROOT",
    "bullets",
    "command_line",
    "commit",
    "final_values",
    "head",
    "number",
    "paragraph",
    "peak_memory",
    "percent",
    "recording_of",
    "table",
]

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
EVIDENCE = ROOT / "reports" / "evidence"

#: Packages whose versions influence results.
PACKAGES = ("numpy", "scipy", "casadi", "exudyn", "missing-physics")
#: Folders whose changes influence results.
SOURCES = ("robot_model", "reference_model", "exudyn_model", "missing_physics", "examples", "benchmarks")


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


def peak_memory() -> float:
    """Largest memory of this process [MB]; `getrusage` includes that of the process that started it."""
    status = Path("/proc/self/status")
    if status.is_file():
        found = re.search(r"VmHWM:\s*(\d+) kB", status.read_text("ascii", "replace"))
        if found is not None:
            return float(found[1]) / 1024.0
    scale = 1024.0**2 if sys.platform == "darwin" else 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / scale


def command_line(parser: argparse.ArgumentParser, given: argparse.Namespace, names: Iterable[str]) -> str:
    """The command with those of the named arguments that differ from their defaults."""
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
    """A fraction as percent."""
    return f"{100 * value:.{digits}f} %"


def bullets(items: Sequence[str]) -> str:
    """Sentences as a list; "nothing" if there are none."""
    return "\n".join(f"- {item}" for item in items) if items else "- nothing"


def final_values(diagnosis: Diagnosis) -> dict[str, Estimate]:
    """Estimates of an answer: inertial parameters by name, the rest as `effect@place.parameter`."""
    changes = diagnosis.nominal_parameters
    values = {c.name: Estimate(c.estimate, c.ci95, c.unit) for c in changes}
    for item in diagnosis.findings:
        values |= {f"{item.effect}@{item.location}.{name}": e for name, e in item.parameters.items()}
    return values


def recording_of(folder: Path, name: str, *, example: str) -> Recording:
    """A recording through its example's map, with the bare file name as its source."""
    mapping = load_mapping(EXAMPLES / example / "map.toml")
    return replace(load_recording(folder / name, mapping=mapping), source=name)
