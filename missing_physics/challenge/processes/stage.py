"""One step of one case in a process of its own, with files passed through pipes.

The steps are those of `one_step`, which exchange files through pipes, so that the hidden physics is not
written to disk; the step `diagnose` is the public command itself, in a folder of its own. A step that dies
for whatever reason is repeated, without affecting other cases.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from time import monotonic
from typing import Literal

from missing_physics.challenge.processes.blind import CASE, case_folder, environment, isolation, prefix
from missing_physics.challenge.processes.parcel import packed, unpacked
from missing_physics.challenge.processes.sockets import behind_filter
from robot_model.system.owners import held, own_prefix, remove_left
from robot_model.system.untrusted import untrusted_files

__all__ = [
    "ATTEMPTS",
    "KEPT",
    "LIVE",
    "STOPPED",
    "UNUSABLE",
    "Outcome",
    "Step",
    "attempt",
    "begin",
    "carry_out",
    "end_all",
]

Step = Literal["conceal", "diagnose", "score"]
Status = Literal["done", "refused", "failed", "stopped"]

#: Maximum number of processes per case, if they die.
ATTEMPTS = 3
#: Maximum time of one attempt [s], far longer than a case takes on a busy machine, and the exit code of an
#: attempt that exceeds it, which is not repeated.
LONGEST, TOO_LONG = 1800.0, 1
#: Exit code of the command line for unusable input.
UNUSABLE = 2
#: Exit code if the machine failed, for instance for lack of disk space; it does not concern the case.
STOPPED = 75
#: Exit codes from here on, like negative ones, mean a signal or a process that could not be started.
KILLED = 125
ENDS: dict[int, Status] = {0: "done", UNUSABLE: "refused", STOPPED: "stopped"}
#: Files kept of a diagnosis.
KEPT = ("diagnosis.json", "robot.augmented.toml", "comparison.rrd", "report.html")
#: The module that is run for a step; no other module imports it.
STAGE = "missing_physics.challenge.one_step"
#: Prefix of the names of the steps' folders.
STEP = "step-"
#: Characters kept of the error output of a failing process.
LAST_OUTPUT = 2000

#: Running child processes and the tag of each, so that an interrupt can end them.
LIVE: dict[subprocess.Popen[bytes], str] = {}
_lock = threading.Lock()
_ending: set[str] = set()


@dataclass(frozen=True)
class Outcome:
    """Result of a step.

    Attributes:
        status: "done"; "refused" if the input is unusable; "failed" if every attempt died;
            "stopped" if the machine failed, so that the step has to be repeated later.
        files: name to content; empty unless done.
        message: last error output of an unsuccessful step.
        attempts: number of processes that were started.
        seconds: duration of the last one.
        isolation: description of the isolation of the process.
    """

    status: Status
    files: Mapping[str, bytes]
    message: str
    attempts: int
    seconds: float
    isolation: str = ""


def carry_out(
    step: Step,
    files: Mapping[str, bytes],
    *,
    hidden: Sequence[str] = (),
    keep: Sequence[str] = KEPT[:2],
    tag: str = "",
) -> Outcome:
    """Run a step on `files` until a process ends by itself, `ATTEMPTS` times at most.

    Args:
        step: name of the step.
        files: input files.
        hidden: folders that a diagnosis must not see.
        keep: files of a diagnosis to return.
        tag: of the challenge that it belongs to, see `end_all`.
    """
    attempts, code = 0, -1
    while (
        attempts < ATTEMPTS and not 0 <= code < KILLED
    ):  # a step that ended by itself would end the same way again
        if attempts and tag in _ending:
            break
        attempts, began = attempts + 1, monotonic()
        try:
            code, found, words = attempt(step, files, hidden=hidden, tag=tag)
        except OSError as error:
            code, found, words = STOPPED, {}, error.strerror or str(error)
        if step == "diagnose":
            found = {name: content for name, content in found.items() if name in keep}
    status = ENDS.get(code, "failed")
    where = isolation() if step == "diagnose" else ""
    return Outcome(status, found if code == 0 else {}, words, attempts, monotonic() - began, where)


def attempt(
    step: Step, files: Mapping[str, bytes], *, hidden: Sequence[str] = (), tag: str = ""
) -> tuple[int, dict[str, bytes], str]:
    """One process: its exit code (negative for a signal), its files, and its last error output."""
    if step != "diagnose":
        with (
            tempfile.TemporaryDirectory(prefix=own_prefix(STEP)) as name,
            held(Path(name)),
        ):
            code, made, words = _process(_command(step, Path(name), hidden), Path(name), tag, packed(files))
        if code != 0:
            return code, {}, words
        try:
            return code, unpacked(made), words
        except ValueError as error:
            return 1, {}, f"{error} {words}"
    with case_folder() as folder:
        for file, content in files.items():
            (folder / "in" / file).write_bytes(content)
            os.utime(folder / "in" / file, (0, 0))  # file times must not reveal anything
        code, _, words = _process(_command(step, folder, hidden), folder / "in", tag)
        written = untrusted_files(folder, "out", KEPT)
    return code, written, words


def _command(step: Step, folder: Path, hidden: Sequence[str]) -> list[str]:
    if step != "diagnose":
        return [sys.executable, "-m", STAGE, step, str(os.getpid())]
    arguments = ["diagnose", "robot.toml", "recording.csv", "--validate", "validation.csv"]
    command = behind_filter("missing_physics", *arguments, "--out", "../out", "--quiet")
    return [*prefix(folder, [Path(path) for path in hidden]), *command]


def _process(
    command: Sequence[str], folder: Path, tag: str, given: bytes | None = None
) -> tuple[int, bytes, str]:
    """Exit code, standard output if input was `given`, and last error output of a command in `folder`."""
    process = subprocess.Popen(
        [*ends_with_us(), *command],
        cwd=folder,
        env=dict(environment(folder if given is not None else folder.parent)),
        stdin=subprocess.DEVNULL if given is None else subprocess.PIPE,
        stdout=subprocess.DEVNULL if given is None else subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    with _lock:
        LIVE[process] = tag
        if tag in _ending:  # interrupted while it was started
            end(process)
    try:
        stdout, stderr = process.communicate(given, timeout=LONGEST)
    except BaseException as error:
        end(process)
        process.communicate()
        if not isinstance(error, subprocess.TimeoutExpired):
            raise
        return TOO_LONG, b"", f"no end after {LONGEST:g} s"
    finally:
        with _lock:
            LIVE.pop(process, None)
    return process.returncode, stdout or b"", stderr.decode("utf-8", "replace").strip()[-LAST_OUTPUT:]


def end(process: subprocess.Popen[bytes]) -> None:
    """Kill a child process and everything that it started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def end_all(tag: str = "") -> None:
    """Kill every running step of that tag, and start none until `begin`."""
    with _lock:
        _ending.add(tag)
        for process, its in list(LIVE.items()):
            if its == tag:
                end(process)


def begin(tag: str = "") -> None:
    """Allow steps of that tag, and remove folders left by killed processes."""
    _ending.discard(tag)
    remove_left(Path(tempfile.gettempdir()), CASE, STEP)


@cache
def ends_with_us() -> tuple[str, ...]:
    """Prefix of a command that is to be killed when this process ends for whatever reason.

    The kernel does it on Linux (PR_SET_PDEATHSIG). Elsewhere steps check it themselves (`one_step`), and a
    running diagnosis continues until it is done.
    """
    found = shutil.which("setpriv") if sys.platform == "linux" else None
    if found is None:
        return ()
    prefix = (found, "--pdeathsig", "KILL", "--")
    done = subprocess.run([*prefix, "true"], capture_output=True, check=False)
    return prefix if done.returncode == 0 else ()
