"""The consoles and the picture of README and `docs/real_machines.md`, from diagnoses of real machines.

    python -m benchmarks.machines.readme

Diagnoses four rows of the yardstick, draws the held-out recording of the first into `docs/emps.svg`, and
inserts the output of `missing-physics diagnose` between the marks of each page: complete into
`docs/real_machines.md`; into README, for three, the command, the verdict, the errors joint by joint and the
first finding. The data come from the folder `MISSING_PHYSICS_DATA`.
"""

from __future__ import annotations

import io
import re
import sys
import textwrap
from pathlib import Path

from rich.console import Console

from benchmarks.evidence import ROOT
from benchmarks.machines.emps_picture import picture
from benchmarks.yardstick import Machine, load, machine
from missing_physics.diagnosis import Result, diagnose
from missing_physics.reporting import print_summary
from robot_model import InputError, write_atomically

__all__ = ["command", "main", "printed", "shortened", "with_example"]

README = ROOT / "README.md"
MORE = ROOT / "docs" / "real_machines.md"
PICTURE = ROOT / "docs" / "emps.svg"
COMMAND = "python -m benchmarks.machines.readme"
BEGIN = f"<!-- {{name}}: made by {COMMAND} -->\n```{{kind}}\n"
END = "```\n<!-- end -->"
#: Rows of the yardstick shown on the page of machines.
SHOWN = ("emps", "kuka_kr300", "dfki_double_pendulum_C1", "qube_servo_furuta")
#: Rows shown shortened in README, in one block of this name.
FIRST = SHOWN[:3]
BLOCK = "machines"
#: The row for the picture.
DRAWN = "emps"
#: Lines of the verdict and findings that a shortened console shows.
VERDICT, FINDINGS = 2, 1
#: A finding's line: name, place and probability; its details are indented further.
FINDING = re.compile(r"  \S.*%")
#: Ends of rows of the table of errors.
UNITS = (" N", " N m")
DOTS = "..."
#: Columns of the terminal: the usual width, and that of README.
COLUMNS, WIDE = 80, 120


def main() -> None:
    """Diagnose, draw, and update the consoles."""
    short = []
    for name in SHOWN:
        row = load(machine(name), download=True)
        result = diagnose(row.robot, row.fit, row.held_out)
        if name == DRAWN:
            write_atomically(PICTURE, picture(result))
        if name in FIRST:
            short.append(command(machine(name)) + shortened(printed(result, WIDE)))
        _renew(MORE, name, "text", printed(result))
    _renew(README, BLOCK, "console", "".join(short))


def _renew(page: Path, name: str, kind: str, example: str) -> None:
    write_atomically(page, with_example(page.read_text("utf-8"), name, kind, example))


def command(row: Machine) -> str:
    """The command of a row after a prompt with the folder, wrapped to the width.

    `DATA` stands for the folder of the recordings. Rows with overlays or windows would need more options.
    """
    words = ["missing-physics", "diagnose", row.robot, *(f"DATA/{run.file}" for run in row.fit)]
    words += [f"--validate=DATA/{run.file}" for run in row.held_out]
    line = " ".join([f"examples/{row.dataset}$", *words, f"--map={row.map}"])
    # Two columns are for a space and the backslash.
    lines = textwrap.wrap(line, WIDE - 2, subsequent_indent="    ", break_on_hyphens=False)
    whole = len(line) <= WIDE
    return (line if whole else " \\\n".join(lines)) + "\n"


def printed(result: Result, columns: int = COLUMNS) -> str:
    """Output of the command on a terminal of that width."""
    console = Console(file=io.StringIO(), width=columns)
    print_summary(result, console)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    return "".join(line.rstrip() + "\n" for line in text.splitlines())


def shortened(text: str) -> str:
    """The verdict, the table of errors and the first finding, with dots for omitted lines."""
    kept: list[str] = []
    for number, section in enumerate(text.rstrip("\n").split("\n\n")):
        lines = section.split("\n")
        shown = VERDICT if number == 0 else _shown(lines)
        kept += lines[:shown]
        if shown < len(lines) and kept[-1] != DOTS:
            kept.append(DOTS)
    return "\n".join(kept) + "\n"


def _shown(section: list[str]) -> int:
    """Number of lines shown of a section after the verdict, from its top."""
    if section[0].startswith("Torque error"):
        # Heading, heads of the columns, rows; notes below them do not end with a unit.
        return next((n for n, line in enumerate(section) if n > 1 and not line.endswith(UNITS)), len(section))
    if section[0].startswith("What is missing"):
        starts = [n for n, line in enumerate(section) if FINDING.match(line)]
        return starts[FINDINGS] if len(starts) > FINDINGS else len(section)
    return 0


def with_example(page: str, name: str, kind: str, example: str) -> str:
    """The page with the text between the marks of that name replaced."""
    begin = BEGIN.format(name=name, kind=kind)
    before, rest = page.split(begin)
    return before + begin + example + END + rest.split(END, 1)[1]


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(f"python -m benchmarks.machines.readme: {error}")
