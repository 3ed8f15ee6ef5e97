"""A separate process that reads a format whose library may crash, or take any amount of memory or time.

It communicates through pipes, with JSON and numbers only. It first writes a line with the content of the file
to stdout, in which "datasets" are arrays of numbers with name, shape and bytes per entry. After a line on
stdin has named the wanted datasets, it writes the shape and type of each in a line, followed by its bytes. A
line with "failed" instead of any of these gives the reason of a failure.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

__all__ = ["Process", "started"]

#: The longest line [bytes].
_LONGEST = 1 << 28
#: Kinds of numbers.
_KINDS = "biuf"


class Process:
    """The reading process. Its end raises ValueError, or MemoryError where it lacked memory."""

    def __init__(
        self, process: subprocess.Popen[bytes], output: IO[bytes], input: IO[bytes], library: str
    ) -> None:
        self._process, self._output, self._input, self._library = process, output, input, library

    def read(self) -> dict[str, Any]:
        """The next line of its output."""
        line = self._output.readline(_LONGEST)
        if not line.endswith(b"\n"):
            self._fail()
        content: dict[str, Any] = json.loads(line)
        if "failed" in content:
            raise MemoryError if content["memory"] else ValueError(content["failed"])
        return content

    def ask(self, names: list[str], size: int) -> None:
        """Request datasets, and set the memory that may be used for them."""
        line = json.dumps({"names": names, "size": size}).encode("ascii") + b"\n"
        try:
            self._input.write(line)
            self._input.flush()
        except BrokenPipeError:
            self._fail()

    def numbers(self, declared: dict[str, Any]) -> NDArray[Any]:
        """Read the next dataset, which must have the declared shape and type."""
        header = self.read()
        dtype = np.dtype(header["type"])
        if (header["shape"], dtype.itemsize) != (
            declared["shape"],
            declared["entry"],
        ) or dtype.kind not in _KINDS:
            raise ValueError(f"{declared['name']} is not what it is declared to be")
        values = np.empty(math.prod(header["shape"]), dtype)
        if self._output.readinto(values.view(np.uint8).data) != values.nbytes:  # type: ignore[attr-defined]
            self._fail()
        return values.reshape(header["shape"])

    def _fail(self) -> NoReturn:
        code = self._process.wait()
        if code == -getattr(signal, "SIGKILL", 0):  # sent by the system where memory runs out
            raise MemoryError
        if code == -getattr(signal, "SIGXCPU", 0):
            raise ValueError(f"{self._library} does not come to an end with it")
        by = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        raise ValueError(f"{self._library} is ended by it: {by}")


@contextmanager
def started(program: Path, *arguments: str, library: str, folder: str | None = None) -> Iterator[Process]:
    """Run the process, which ends with the block. Interrupts are handled by the caller, which ends it.

    Args:
        program: file with the program.
        arguments: of the program.
        library: name of the library with which it reads, for errors.
        folder: for its temporary files, since it may be ended before it removes them.
    """
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join(sys.path)}
    if folder is not None:
        environment |= dict.fromkeys(("TMPDIR", "TEMP", "TMP"), folder)
    process = subprocess.Popen(
        [sys.executable, "-P", str(program), *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
        start_new_session=True,
    )
    assert process.stdin
    assert process.stdout
    try:
        yield Process(process, process.stdout, process.stdin, library)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        with suppress(BrokenPipeError):
            process.stdin.close()
