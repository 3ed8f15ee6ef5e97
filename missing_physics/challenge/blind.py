"""A process that sees its case and nothing else.

The environment is emptied, the working folder is a fresh copy of the case, and standard input is closed. On
Linux, where `unshare` is allowed, the process also lives in namespaces of its own: it has no network, sees no
other process (so neither anybody's memory nor command line), and an empty folder lies over the challenge's.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path

__all__ = ["EMPTIED", "NAMESPACES", "environment", "isolation", "prefix"]

#: Words for a report.
NAMESPACES = "own user, mount, process and network namespaces, the challenge's folder covered"
EMPTIED = "own process, emptied environment, fresh folder; no namespaces on this machine"

UNSHARE = (
    *("unshare", "--user", "--map-root-user", "--mount", "--pid", "--fork", "--kill-child"),
    *("--mount-proc", "--net", "--ipc"),
)
#: Covers the folders before `--` and runs what follows.
COVER = (
    'while [ "$1" != -- ]; do mount -t tmpfs -o size=4k none "$1" || exit 125; shift; done; shift; exec "$@"'
)
PROBE_SECONDS = 20.0


def environment(home: Path) -> Mapping[str, str]:
    """All that the process finds in its environment."""
    return {
        "PATH": os.defpath,
        "HOME": str(home),
        "TMPDIR": str(home),
        "LANG": "C.UTF-8",
        "PYTHONPATH": str(Path(__file__).resolve().parents[2]),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }


def prefix(hidden: Sequence[Path]) -> list[str]:
    """What stands before a command to isolate it; empty where the system does not allow it."""
    if not namespaces_allowed():
        return []
    covered = [str(path.resolve()) for path in hidden if path.is_dir()]
    return [*UNSHARE, "--", "sh", "-c", COVER, "sh", *covered, "--"]


def isolation() -> str:
    """How far processes are isolated on this machine, in words."""
    return NAMESPACES if namespaces_allowed() else EMPTIED


@lru_cache
def namespaces_allowed() -> bool:
    """Whether a covered folder is empty inside; tried once, with a folder that is not."""
    if sys.platform != "linux" or shutil.which("unshare") is None:
        return False
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "seen").write_text("x")
        look = ["sh", "-c", COVER, "sh", folder, "--", "test", "!", "-e", f"{folder}/seen"]
        try:
            done = subprocess.run(
                [*UNSHARE, "--", *look], capture_output=True, timeout=PROBE_SECONDS, check=False
            )
        except (OSError, subprocess.TimeoutExpired):
            return False
        return done.returncode == 0
