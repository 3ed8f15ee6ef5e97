"""MAT version 7.3, which is HDF5 with MATLAB's conventions, read by a process of its own; see `hdf5`."""

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

from missing_physics.recordings.raw import Raw, Want
from missing_physics.recordings.readers.base import reading
from missing_physics.recordings.readers.source import Source

__all__ = ["is_hdf5", "read"]

_PROGRAM = Path(__file__).with_name("hdf5.py")
#: The begin of HDF5, which stands at byte 0, 512 or any double of that.
_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_FIRST_DOUBLED = 512
#: The longest line with all datasets [bytes].
_LONGEST = 1 << 28
#: Kinds of numbers, and how often they are in memory while they are read.
_KINDS = "biuf"
_COPIES = 2


def is_hdf5(source: Source) -> bool:
    """Whether the file is HDF5, whatever its header text says."""
    size = source.path.stat().st_size
    at = 0
    with source.path.open("rb") as file:
        while at < size:
            file.seek(at)
            if file.read(len(_SIGNATURE)) == _SIGNATURE:
                return True
            at = 2 * at or _FIRST_DOUBLED
    return False


def read(source: Source, *, want: Want) -> Raw:
    """The numeric variables of a version 7.3 MAT file; see `missing_physics.recordings.readers.mat.read`."""
    with reading(source, "MAT 7.3"), _started(source.path) as process:
        items = {item["name"].replace("/", "."): item for item in process.told()["datasets"]}
        wanted = {label: item for label, item in items.items() if want(label)}
        size = 0
        for label, item in wanted.items():
            shape, entry, chunk = item["shape"], item["entry"], item["chunk"]
            source.budget.take_array(source, label, shape, entry)
            source.budget.take(chunk, f"{source} declares {label} in chunks of {chunk} bytes")
            size += math.prod(shape) * entry + chunk
        process.ask([item["name"] for item in wanted.values()], _COPIES * size)
        # MATLAB stores by columns, HDF5 by rows: the file's shape is MATLAB's reversed.
        found = {label: process.numbers(item).T for label, item in wanted.items()}
        return Raw(source.name, found, tuple(items))
    raise AssertionError("unreachable: reading() raises")


class _Process:
    """The process that reads. Its death raises ValueError, and MemoryError where it lacked memory."""

    def __init__(self, process: subprocess.Popen[bytes], told: IO[bytes], asked: IO[bytes]) -> None:
        self._process, self._told, self._asked = process, told, asked

    def told(self) -> dict[str, Any]:
        """Its next line."""
        line = self._told.readline(_LONGEST)
        if not line.endswith(b"\n"):
            self._fail()
        content: dict[str, Any] = json.loads(line)
        if "failed" in content:
            raise MemoryError if content["memory"] else ValueError(content["failed"])
        return content

    def ask(self, names: list[str], size: int) -> None:
        """Name the datasets that are wanted, and what it may take of memory for them."""
        line = json.dumps({"names": names, "size": size}).encode("ascii") + b"\n"
        try:
            self._asked.write(line)
            self._asked.flush()
        except BrokenPipeError:
            self._fail()

    def numbers(self, declared: dict[str, Any]) -> NDArray[Any]:
        """The next dataset, which has to be as declared."""
        told = self.told()
        dtype = np.dtype(told["type"])
        if (told["shape"], dtype.itemsize) != (
            declared["shape"],
            declared["entry"],
        ) or dtype.kind not in _KINDS:
            raise ValueError(f"{declared['name']} is not what it is declared to be")
        values = np.empty(math.prod(told["shape"]), dtype)
        if self._told.readinto(values.view(np.uint8).data) != values.nbytes:  # type: ignore[attr-defined]
            self._fail()
        return values.reshape(told["shape"])

    def _fail(self) -> NoReturn:
        code = self._process.wait()
        if code == -getattr(signal, "SIGKILL", 0):  # what a machine does to whoever takes its last memory
            raise MemoryError
        if code == -getattr(signal, "SIGXCPU", 0):
            raise ValueError("HDF5's library does not come to an end with it")
        by = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        raise ValueError(f"HDF5's library is ended by it: {by}")


@contextmanager
def _started(path: Path) -> Iterator[_Process]:
    """The process, which does not outlive the block. An interrupt is for us, who end it."""
    process = subprocess.Popen(
        [sys.executable, "-P", str(_PROGRAM), str(path.resolve())],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        start_new_session=True,
    )
    assert process.stdin
    assert process.stdout
    try:
        yield _Process(process, process.stdout, process.stdin)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        with suppress(BrokenPipeError):
            process.stdin.close()
