"""The README's example and picture, from one diagnosis of a real axis.

    python -m benchmarks.readme

Diagnoses EMPS from its mass alone, draws the held-out recording into `docs/emps.svg`, and puts what
`missing-physics diagnose` prints between the README's two marks. The data come from the folder that
`MISSING_PHYSICS_DATA` names, or are downloaded.
"""

from __future__ import annotations

import io
import sys

from rich.console import Console

from benchmarks.emps_picture import picture
from benchmarks.evidence import EXAMPLES, ROOT, recording_of
from missing_physics.diagnosis import Result, diagnose
from missing_physics.recordings.datasets import fetch_dataset
from missing_physics.reporting import print_summary
from robot_model import InputError, load_robot, write_atomically

__all__ = ["main"]

README = ROOT / "README.md"
PICTURE = ROOT / "docs" / "emps.svg"
BEGIN = "<!-- printed by the command above; written by python -m benchmarks.readme -->\n```text\n"
END = "```\n<!-- end of what it prints -->"
FITTED, SCORED = "DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"
#: Columns of the terminal that is shown, and the folder that the command above names.
COLUMNS = 80
OUT = "emps"


def main() -> None:
    """Diagnose, draw, and renew the example."""
    folder = fetch_dataset("emps")
    fitted, scored = (recording_of(folder, name, example="emps") for name in (FITTED, SCORED))
    result = diagnose(load_robot(EXAMPLES / "emps" / "mass_only.toml"), [fitted], [scored])
    write_atomically(PICTURE, picture(result))
    write_atomically(README, with_example(README.read_text("utf-8"), printed(result)))


def printed(result: Result) -> str:
    """What the command prints."""
    console = Console(file=io.StringIO(), width=COLUMNS)
    print_summary(result, console)
    console.print(f"Report: {OUT}/report.html   Comparison: missing-physics view {OUT}", highlight=False)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    return "".join(line.rstrip() + "\n" for line in text.splitlines())


def with_example(readme: str, example: str) -> str:
    """The README with what stands between the marks replaced."""
    before, rest = readme.split(BEGIN)
    return before + BEGIN + example + END + rest.split(END, 1)[1]


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(f"python -m benchmarks.readme: {error}")
