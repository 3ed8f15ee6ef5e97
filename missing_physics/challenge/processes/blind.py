"""Isolation of the diagnosing process: it sees its case, the diagnosis, and as little else as possible.

The environment is emptied, the working folder is a new copy of the case, and standard input is closed. On
Linux, if `unshare` and `setpriv` are available and allowed, the process also runs in namespaces of its own,
without any privilege, under a separate root folder with Python, its libraries, the system's programs, this
program without the challenge, and the case. Other files, such as the challenge's folder, the
checkout and other cases, the network and other processes are not accessible.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

from robot_model.system.owners import held, own_prefix

__all__ = ["CASE", "EMPTIED", "NAMESPACES", "case_folder", "environment", "isolation", "prefix"]

#: Descriptions for a report.
NAMESPACES = (
    "namespaces of its own without network and privileges, under a root folder that holds Python, libraries, "
    "the diagnosis and the case"
)
EMPTIED = (
    "own process, emptied environment, fresh folder; no namespaces on this machine, so that the disk could "
    "be read"
)

UNSHARE = (
    *("unshare", "--user", "--map-root-user", "--mount", "--pid", "--fork", "--kill-child"),
    *("--mount-proc", "--net", "--ipc"),
)
#: Creates a root folder by the orders before `--` and runs the command after it without any privilege. In
#: such a folder no user namespace can be created, so that privileges cannot be regained.
SETUP = """
set -e
trap 'exit 75' EXIT
root=$1 folder=$2; shift 2
mount -t tmpfs -o size=64m,mode=755 none "$root"
while [ "$1" != -- ]; do
  case $1 in
    link) mkdir -p "$root${2%/*}"; ln -s "$3" "$root$2"; shift 3;;
    cover) mount -t tmpfs -o size=1m,mode=755 none "$root$2"; shift 2;;
    show|work)
      if [ -d "$2" ]; then mkdir -p "$root$2"
      else mkdir -p "$root${2%/*}"; [ -e "$root$2" ] || : > "$root$2"; fi
      mount --rbind "$2" "$root$2"
      [ "$1" = work ] || mount -o remount,bind,ro "$root$2" 2> /dev/null || :
      shift 2;;
  esac
done
shift
mkdir -p -m 1777 "$root/dev/shm"
exec unshare --root="$root" --wd="$folder" -- \\
  setpriv --bounding-set=-all --inh-caps=-all --ambient-caps=-all --no-new-privs -- "$@"
"""
#: Files of the system's programs and libraries; those missing on a machine are skipped.
SYSTEM = (
    *("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/libx32", "/nix/store", "/gnu/store"),
    *("/etc/ld.so.cache", "/etc/ld.so.conf", "/etc/ld.so.conf.d", "/etc/alternatives", "/etc/localtime"),
    *("/dev/null", "/dev/zero", "/dev/full", "/dev/random", "/dev/urandom"),
)
#: Parts of this program that a diagnosis needs.
PACKAGES = ("robot_model", "reference_model", "missing_physics")
#: The part that draws the truth.
SECRET = Path("missing_physics", "challenge")
#: Conditions that must hold inside for it to be called isolated.
PROBE = """
import importlib.util, sys
from pathlib import Path
import casadi, numpy, robot_model
said = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
assert not any(int(said[kind], 16) for kind in ("CapInh", "CapPrm", "CapEff", "CapBnd", "CapAmb"))
assert int(said["NoNewPrivs"]) == 1
assert not Path(sys.argv[1]).exists()
assert importlib.util.find_spec("missing_physics.diagnosis")
assert importlib.util.find_spec("missing_physics.challenge.draws") is None
Path("tried").write_text("x")
"""
#: Prefix of the names of case folders.
CASE = "case-"
PROBE_SECONDS = 60.0
_lock = threading.Lock()


def environment(home: Path) -> Mapping[str, str]:
    """Complete environment of the process."""
    return {
        "PATH": os.defpath,
        "HOME": str(home),
        "TMPDIR": str(home),
        "LANG": "C.UTF-8",
        "PYTHONPATH": str(_sources()),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }


@contextmanager
def case_folder() -> Iterator[Path]:
    """A new folder with `in` and `out` for a case, and next to it a folder for its root."""
    with tempfile.TemporaryDirectory(prefix=own_prefix(CASE)) as name, held(Path(name)):
        folder = Path(name).resolve() / "case"
        for made in (folder / "in", folder / "out", folder.parent / "root"):
            made.mkdir(parents=True)
        yield folder


def prefix(folder: Path, hidden: Sequence[Path] = ()) -> list[str]:
    """Prefix of a command that isolates it; empty if the system does not allow it.

    Args:
        folder: folder of the case, from `case_folder`.
        hidden: folders that must not be accessible, wherever they are.
    """
    return _prefix(folder, hidden) if namespaces_allowed() else []


def isolation() -> str:
    """Description of the isolation on this machine."""
    return NAMESPACES if namespaces_allowed() else EMPTIED


def namespaces_allowed() -> bool:
    """Whether a process can be isolated and still diagnose; tested once."""
    with _lock:
        return _tried()


@lru_cache
def _tried() -> bool:
    if sys.platform != "linux" or not all(map(shutil.which, ("unshare", "setpriv", "mount"))):
        return False
    with case_folder() as folder:
        seen = folder.parent / "seen"
        seen.write_text("x")
        try:
            done = subprocess.run(
                [*_prefix(folder, ()), sys.executable, "-c", PROBE, str(seen)],
                cwd=folder / "in",
                env=dict(environment(folder)),
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=PROBE_SECONDS,
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired):
            return False
        return done.returncode == 0 and (folder / "in" / "tried").is_file()


def _prefix(folder: Path, hidden: Sequence[Path]) -> list[str]:
    orders = [word for order in _orders(hidden) for word in order]
    root = str(folder.parent / "root")
    orders += ["work", str(folder), "show", "/proc"]
    return [*UNSHARE, "--", "sh", "-c", SETUP, "sh", root, str(folder / "in"), *orders, "--"]


def _sources() -> Path:
    """The folder of this program: a checkout, or the folder of installed packages."""
    return Path(__file__).resolve().parents[3]


def _orders(hidden: Sequence[Path]) -> list[tuple[str, ...]]:
    """Orders for the root folder, outer folders first: links, visible and covered folders."""
    orders: list[tuple[str, ...]] = []
    shown: set[Path] = set()
    for place in map(Path, SYSTEM):
        if place.is_symlink() and place.parent == Path("/"):
            orders.append(("link", str(place), os.readlink(place)))
        elif place.exists():
            shown.add(place)
    shown |= _interpreter()
    libraries = [found for place in shown for found in place.glob("lib/python*/*-packages")]
    covered = {found / SECRET for found in libraries} | {_sources() / SECRET}
    covered |= {Path(tempfile.gettempdir()).resolve(), *(path.resolve() for path in hidden)}
    if _is_checkout(_sources()):
        covered.add(_sources())
    shown |= {_sources() / package for package in PACKAGES}
    done: dict[Path, str] = {}
    for place in sorted(shown | covered, key=lambda path: path.parts):
        around = next((done[outer] for outer in place.parents if outer in done), "cover")
        kind = "cover" if place in covered else "show"
        if kind != around and (kind == "show" or place.is_dir()):
            done[place] = kind
            orders.append((kind, str(place)))
    return orders


def _interpreter() -> set[Path]:
    """Folders of Python and of its environment, and every link that leads to its executable."""
    found = {Path(place) for place in (sys.prefix, sys.base_prefix, sys.exec_prefix, sys.base_exec_prefix)}
    found |= {place.resolve() for place in found}
    link = Path(sys.executable)
    while link.is_symlink():
        link = link.parent / os.readlink(link)
        found.add(Path(os.path.normpath(link)))
    return {place for place in found if place != Path("/")}


def _is_checkout(folder: Path) -> bool:
    return (folder / "pyproject.toml").is_file()
