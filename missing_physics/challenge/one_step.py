"""One step of one case, except the diagnosis, in this process.

    python -m missing_physics.challenge.one_step conceal|score PARENT

reads packed files from standard input and writes its results to standard output, so that the hidden
physics is never written to a file.
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

#: Interval for checking whether the parent process still runs [s]; on Linux the kernel signals its end.
CHECK_INTERVAL = 0.5


def end_with(parent: int) -> None:
    """End this process as soon as its parent has ended for whatever reason.

    Args:
        parent: process id of the parent as passed by it, since the parent may have ended by now.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(CHECK_INTERVAL)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def main(step: str, parent: int) -> int:
    """Carry out one step for that parent process and return the exit code."""
    end_with(parent)
    with os.fdopen(os.dup(1), "wb") as output:
        os.dup2(2, 1)  # output printed by libraries must not mix with the result
        try:
            output.write(packed(_made(step, unpacked(sys.stdin.buffer.read()))))
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
