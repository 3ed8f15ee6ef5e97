"""Limits of a process that reads for another one, and its protocol; see `process`."""

from __future__ import annotations

import json
import math
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

try:
    import resource
except ImportError:  # there are none on Windows
    resource = None  # type: ignore[assignment]

__all__ = ["Limits", "fail", "say", "send"]

#: Memory for everything except numbers: names, tables of chunks, caches [bytes].
_ROOM = 1 << 28
#: Time to read the table of contents [s of computing], and lowest rate of reading numbers [bytes/s].
_TIME = 20
_SLOWEST = 1e7


class Limits:
    """Limits of this process's memory and time, in addition to those used at the start."""

    def __init__(self, seconds: float = 0.0) -> None:
        """`seconds` of computing are allowed in addition to those for numbers."""
        self._size, self._seconds = 0, _TIME + math.ceil(seconds)
        self.own = False
        with suppress(OSError, ValueError, IndexError):
            pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
            self._size = pages * resource.getpagesize() if resource else 0
        if resource:
            self._inherited = {
                kind: resource.getrlimit(kind) for kind in (resource.RLIMIT_AS, resource.RLIMIT_CPU)
            }
            _, most = resource.getrlimit(resource.RLIMIT_CORE)
            resource.setrlimit(resource.RLIMIT_CORE, (0, most))

    def allow(self, size: int) -> None:
        """Allow memory and time for `size` bytes of numbers."""
        if not resource:
            return
        if self._size:
            self.own = self._set(resource.RLIMIT_AS, self._size + _ROOM + size)
        self._set(resource.RLIMIT_CPU, self._seconds + math.ceil(size / _SLOWEST))

    def allow_files(self, size: int) -> None:
        """Allow written files, such as an unpacked copy, of `size` bytes each."""
        if resource:
            _, most = resource.getrlimit(resource.RLIMIT_FSIZE)
            least = size if most == resource.RLIM_INFINITY else min(size, most)
            resource.setrlimit(resource.RLIMIT_FSIZE, (least, most))

    def _set(self, kind: int, value: int) -> bool:
        """Whether a limit is lower than one that is already set."""
        soft, hard = self._inherited[kind]
        if soft != resource.RLIM_INFINITY and soft <= value:
            return False
        resource.setrlimit(kind, (value, hard))
        return True


def say(content: dict[str, Any]) -> None:
    """Write one line to the calling process."""
    sys.stdout.buffer.write(json.dumps(content).encode("ascii") + b"\n")
    sys.stdout.buffer.flush()


def send(values: NDArray[Any]) -> None:
    """Write numbers, after a line with their shape and type."""
    say({"shape": values.shape, "type": values.dtype.str})
    sys.stdout.buffer.write(values.reshape(-1).view(np.uint8).data)
    sys.stdout.buffer.flush()


def fail(error: Exception, limits: Limits) -> None:
    """Write the reason of a failure. If it is a limit of this process, the file takes more than declared."""
    lacking = isinstance(error, MemoryError) and not limits.own
    say({"failed": str(error) or type(error).__name__, "memory": lacking})
