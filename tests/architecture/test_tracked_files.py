"""The repository is machine-independent: no local path, no registry, no server open to others."""

from __future__ import annotations

import re
import subprocess
import tomllib
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

#: Folders of a particular machine. Written in parts, or this file would fail its own test.
MACHINE_PATH = re.compile(r"(?<![\w.~$}/:])/(?:work|root|home|opt|tmp|Users|mnt)" + r"/[\w.]")

#: The source of packages belongs to the machine's settings, never to this repository.
REGISTRY = re.compile(
    "|".join(("pypi" + r"\.org", "python" + "hosted", "(?:extra-)?index" + "-url", "find" + "-links"))
)

#: Listening on all interfaces.
OPEN_SERVER = re.compile(r"\b0\.0\.0" + r"\.0\b")


@cache
def tracked() -> tuple[Path, ...]:
    """Files under version control; skips where there is none, as in an unpacked archive."""
    try:
        listed = subprocess.run(
            ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True
        ).stdout
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no git checkout")
    return tuple(path for name in listed.split("\0") if name and (path := ROOT / name).is_file())


def hits(pattern: re.Pattern[str]) -> list[str]:
    found = []
    for path in tracked():
        text = path.read_bytes().decode("utf-8", errors="replace")
        lines = enumerate(text.splitlines(), start=1)
        found += [
            f"{path.relative_to(ROOT)}:{row}: {line[:120]}" for row, line in lines if pattern.search(line)
        ]
    return found


def test_no_machine_specific_path() -> None:
    assert not hits(MACHINE_PATH)


def test_no_registry() -> None:
    assert not hits(REGISTRY)


def test_no_server_listens_on_all_interfaces() -> None:
    assert not hits(OPEN_SERVER)


@pytest.mark.parametrize(
    ("pattern", "text"),
    [
        (MACHINE_PATH, 'open("/' + 'home/me/log.csv")'),
        (MACHINE_PATH, "see /" + "work/notes"),
        (REGISTRY, "--index" + "-url x"),
        (OPEN_SERVER, "bind 0.0.0" + ".0"),
    ],
)
def test_the_patterns_detect_violations(pattern: re.Pattern[str], text: str) -> None:
    assert pattern.search(text)


def requirement_name(line: str) -> str:
    return re.split(r"[<>=!~\[; ]", line, maxsplit=1)[0].lower().replace("_", "-")


def test_every_requirement_is_pinned_once() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    needed = [*project["dependencies"], *(r for rs in project["optional-dependencies"].values() for r in rs)]
    lines = [
        line for line in (ROOT / "constraints.txt").read_text("utf-8").splitlines() if line[:1] not in "#"
    ]
    assert all(re.fullmatch(r"[A-Za-z0-9_.-]+==[A-Za-z0-9_.]+", line) for line in lines)
    pinned = [requirement_name(line) for line in lines]
    assert len(pinned) == len(set(pinned))
    assert {requirement_name(line) for line in needed} <= set(pinned)
