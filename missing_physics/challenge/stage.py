"""One step of one case in a process of its own: files in, files out, no common disk needed.

The steps are those of `one_step`; the step `diagnose` is the public command itself. A step that dies, by
whatever cause, costs its case another attempt and no other case anything.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import Literal

from missing_physics.challenge.blind import environment, isolation, prefix

__all__ = ["ATTEMPTS", "KEPT", "LIVE", "Outcome", "Step", "attempt", "begin", "carry_out", "end_all"]

Step = Literal["conceal", "diagnose", "score"]

#: A case is given up after so many processes that died.
ATTEMPTS = 3
#: Longest time of one attempt [s]; far beyond what a case takes on a busy machine.
LONGEST = 1800.0
#: Exit code of the command line for input that it cannot use.
UNUSABLE = 2
#: Exit codes from here on tell of a signal or of a process that could not be started, as negative ones do.
KILLED = 125
#: What is kept of a diagnosis.
KEPT = ("diagnosis.json", "robot.augmented.toml", "comparison.rrd", "report.html")
#: The module that is run for a step; nothing else imports it, so that Python finds it unloaded.
STAGE = "missing_physics.challenge.one_step"
#: Characters kept of a failing process's last words.
LAST_WORDS = 2000

#: Processes under way in this process, so that an interrupt can end them.
LIVE: set[subprocess.Popen[bytes]] = set()
_lock = threading.Lock()
_ending = threading.Event()


@dataclass(frozen=True)
class Outcome:
    """What came of a step.

    Attributes:
        status: "done"; "refused" when the input was called unusable; "failed" when every attempt died.
        files: name to content; empty unless done.
        message: last words of a step that did not end well.
        attempts: processes that were started.
        seconds: of the last one.
        isolation: how far the process was isolated.
    """

    status: Literal["done", "refused", "failed"]
    files: Mapping[str, bytes]
    message: str
    attempts: int
    seconds: float
    isolation: str = ""


def carry_out(
    step: Step, files: Mapping[str, bytes], *, hidden: Sequence[str] = (), keep: Sequence[str] = KEPT[:2]
) -> Outcome:
    """Run a step on `files` until a process ends by itself, `ATTEMPTS` times at most.

    Args:
        step: which.
        files: content of its folder `in`.
        hidden: folders that a diagnosis must not see.
        keep: which files of a diagnosis to bring back.
    """
    attempts, code = 0, -1
    while attempts < ATTEMPTS and not 0 <= code < KILLED:  # what ended by itself would end like this again
        if attempts and _ending.is_set():
            break
        attempts, began = attempts + 1, monotonic()
        code, found, words = attempt(step, files, hidden=hidden)
        if step == "diagnose":
            found = {name: content for name, content in found.items() if name in keep}
    status: Literal["done", "refused", "failed"]
    status = "done" if code == 0 else "refused" if code == UNUSABLE else "failed"
    where = isolation() if step == "diagnose" else ""
    return Outcome(status, found if code == 0 else {}, words, attempts, monotonic() - began, where)


def attempt(
    step: Step, files: Mapping[str, bytes], *, hidden: Sequence[str] = ()
) -> tuple[int, dict[str, bytes], str]:
    """One process: its exit code (negative for a signal), what it wrote, and its last words."""
    with tempfile.TemporaryDirectory(prefix="case-") as name:
        folder = Path(name)
        (folder / "in").mkdir()
        (folder / "out").mkdir()
        for file, content in files.items():
            (folder / "in" / file).write_bytes(content)
            os.utime(folder / "in" / file, (0, 0))  # when a file was made tells nothing
        code, words = _process(_command(step, folder, hidden), folder)
        written = {path.name: path.read_bytes() for path in (folder / "out").iterdir() if path.is_file()}
    return code, written, words


def _command(step: Step, folder: Path, hidden: Sequence[str]) -> list[str]:
    if step != "diagnose":
        return [sys.executable, "-m", STAGE, step, str(folder)]
    command = [sys.executable, "-m", "missing_physics", "diagnose", "robot.toml", "recording.csv"]
    command += ["--validate", "validation.csv", "--out", "../out", "--quiet"]
    return [*prefix([Path(path) for path in hidden]), *command]


def _process(command: Sequence[str], folder: Path) -> tuple[int, str]:
    process = subprocess.Popen(
        command,
        cwd=folder / "in",
        env=dict(environment(folder)),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    with _lock:
        LIVE.add(process)
        if _ending.is_set():  # the interrupt came while it was started
            end(process)
    try:
        _, stderr = process.communicate(timeout=LONGEST)
    except BaseException as error:
        end(process)
        process.communicate()
        if not isinstance(error, subprocess.TimeoutExpired):
            raise
        return -signal.SIGKILL, f"no end after {LONGEST:g} s"
    finally:
        with _lock:
            LIVE.discard(process)
    return process.returncode, stderr.decode("utf-8", "replace").strip()[-LAST_WORDS:]


def end(process: subprocess.Popen[bytes]) -> None:
    """Kill a process of ours and everything that it started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def end_all() -> None:
    """Kill every step under way in this process, and begin none again until `begin`."""
    _ending.set()
    with _lock:
        for process in list(LIVE):
            end(process)


def begin() -> None:
    """Steps may run."""
    _ending.clear()
