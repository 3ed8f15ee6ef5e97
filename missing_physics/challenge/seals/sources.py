"""The program itself, by its fingerprints: what cases and answers depend on besides their numbers."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

__all__ = ["differing", "program", "sources"]

ROOMS = ("robot_model", "reference_model", "exudyn_model", "missing_physics")
#: Kinds of files that compute something; C is compiled when it is needed.
KINDS = (".py", ".toml", ".c")


def sources() -> dict[str, str]:
    """Fingerprint of every source that cases and answers depend on, as it lies on the disk now."""
    root = Path(__file__).resolve().parents[3]
    return {
        path.relative_to(root).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for room in ROOMS
        for path in sorted((root / room).rglob("*"))
        if path.suffix in KINDS and "reporting" not in path.parts
    }


def program() -> str:
    """One fingerprint of all of them."""
    return hashlib.sha256(json.dumps(sources(), sort_keys=True).encode()).hexdigest()


def differing(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """Names of the sources that are not what they were."""
    return sorted(name for name in {*before, *now} if before.get(name) != now.get(name))
