"""One step of one case in this process, diagnosis excepted.

    python -m missing_physics.challenge.one_step conceal|score

reads its files as a parcel from standard input and writes what it makes to standard output, so that what is
hidden lies in no file on the way.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping

from missing_physics.challenge.conceal import concealed
from missing_physics.challenge.parcel import packed, unpacked
from missing_physics.challenge.score import scored
from missing_physics.challenge.stage import STOPPED, UNUSABLE
from missing_physics.challenge.truth import Design
from robot_model import InputError, lacks_room

__all__ = ["main"]


def main(step: str) -> int:
    """Carry out one step; exit code as of the command line."""
    with os.fdopen(os.dup(1), "wb") as told:
        os.dup2(2, 1)  # what libraries print must not get in between
        try:
            told.write(packed(_made(step, unpacked(sys.stdin.buffer.read()))))
        except Exception as error:
            if lacks_room(error):
                print(str(error) or "too little memory", file=sys.stderr)
                return STOPPED
            if not isinstance(error, InputError):
                raise
            print(error, file=sys.stderr)
            return UNUSABLE
    return 0


def _made(step: str, given: Mapping[str, bytes]) -> Mapping[str, bytes]:
    design = Design.model_validate_json(given["design.json"])
    return concealed(design) if step == "conceal" else scored(design, given)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
