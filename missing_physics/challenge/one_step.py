"""One step of one case in this process, diagnosis excepted.

    python -m missing_physics.challenge.one_step conceal|score PARENT

reads its files as a parcel from standard input and writes what it makes to standard output, so that what is
hidden lies in no file on the way.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Mapping

from missing_physics.challenge.cases.truth import Design
from missing_physics.challenge.concealing.conceal import concealed
from missing_physics.challenge.processes.parcel import packed, unpacked
from missing_physics.challenge.processes.stage import STOPPED, UNUSABLE
from missing_physics.challenge.scoring.score import scored
from robot_model import InputError, lacks_room

__all__ = ["end_with", "main"]

#: How often it is looked whether the challenge is still there [s]; on Linux its kernel says so at once.
LOOKS = 0.5


def end_with(parent: int) -> None:
    """From now on this process ends when the one that started it has ended, however it did.

    Args:
        parent: its number as it stated it, since it may be gone by now.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(LOOKS)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def main(step: str, parent: int) -> int:
    """Carry out one step for the process of that number; exit code as of the command line."""
    end_with(parent)
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
    sys.exit(main(sys.argv[1], int(sys.argv[2])))
