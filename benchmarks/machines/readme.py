"""The examples and the picture of README and `docs/real_machines.md`, from diagnoses of real machines.

    python -m benchmarks.machines.readme

Diagnoses three rows of the yardstick, draws the held-out recording of the first into `docs/emps.svg`,
and puts of what `missing-physics diagnose` prints the verdict, the errors joint by joint and the names
between the marks of each page. The data come from the folder that `MISSING_PHYSICS_DATA` names.
"""

from __future__ import annotations

import io
import sys

from rich.console import Console

from benchmarks.evidence import ROOT
from benchmarks.machines.emps_picture import picture
from benchmarks.yardstick import load, machine
from missing_physics.diagnosis import Result, diagnose
from missing_physics.reporting import print_summary
from robot_model import InputError, write_atomically

__all__ = ["main", "printed", "shortened", "with_example"]

README = ROOT / "README.md"
MORE = ROOT / "docs" / "real_machines.md"
PICTURE = ROOT / "docs" / "emps.svg"
COMMAND = "python -m benchmarks.machines.readme"
BEGIN = f"<!-- {{name}}: what the command above prints, shortened by {COMMAND} -->\n```text\n"
END = "```\n<!-- end -->"
#: Rows of the yardstick and the page that shows each.
SHOWN = {"emps": README, "dfki_double_pendulum_C1": MORE, "qube_servo_furuta": MORE}
#: The row that is drawn.
DRAWN = "emps"
#: Sections that are shown after the verdict; the others are left out.
SECTIONS = ("Torque error", "Numbers of the robot file", "What is missing")
#: Columns of the terminal that is shown.
COLUMNS = 80


def main() -> None:
    """Diagnose, draw, and renew the examples."""
    for name, page in SHOWN.items():
        row = load(machine(name), download=True)
        result = diagnose(row.robot, row.fit, row.held_out)
        if name == DRAWN:
            write_atomically(PICTURE, picture(result))
        write_atomically(page, with_example(page.read_text("utf-8"), name, shortened(printed(result))))


def printed(result: Result) -> str:
    """What the command prints."""
    console = Console(file=io.StringIO(), width=COLUMNS)
    print_summary(result, console)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    return "".join(line.rstrip() + "\n" for line in text.splitlines())


def shortened(text: str) -> str:
    """The verdict and the sections that are shown, with dots for what is left out."""
    verdict, *sections = text.rstrip("\n").split("\n\n")
    kept = [section for section in sections if section.startswith(SECTIONS)]
    dots = ["[...]"] if len(kept) < len(sections) else []
    return "\n\n".join([verdict, *kept, *dots]) + "\n"


def with_example(page: str, name: str, example: str) -> str:
    """The page with what stands between the marks of that name replaced."""
    begin = BEGIN.format(name=name)
    before, rest = page.split(begin)
    return before + begin + example + END + rest.split(END, 1)[1]


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(f"python -m benchmarks.machines.readme: {error}")
