"""One step of one case in this process, diagnosis excepted.

    python -m missing_physics.challenge.one_step conceal|score FOLDER

reads FOLDER/in and writes FOLDER/out.
"""

from __future__ import annotations

import sys
from pathlib import Path

from missing_physics.challenge.conceal import concealed
from missing_physics.challenge.score import scored
from missing_physics.challenge.stage import UNUSABLE
from missing_physics.challenge.truth import Design
from robot_model import InputError

__all__ = ["main"]


def main(step: str, folder: Path) -> int:
    """Carry out one step; exit code as of the command line."""
    given = {path.name: path.read_bytes() for path in (folder / "in").iterdir()}
    design = Design.model_validate_json(given["design.json"])
    try:
        made = concealed(design) if step == "conceal" else scored(design, given)
    except InputError as error:
        print(error, file=sys.stderr)
        return UNUSABLE
    for name, content in made.items():
        (folder / "out" / name).write_bytes(content)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], Path(sys.argv[2])))
