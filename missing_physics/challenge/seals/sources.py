"""Fingerprints of the program's source files, on which cases and answers depend."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

__all__ = ["differing", "program", "sources"]

PACKAGES = ("robot_model", "reference_model", "exudyn_model", "missing_physics")
#: File types of the program; C is compiled when needed.
KINDS = (".py", ".toml", ".c")


def sources() -> dict[str, str]:
    """Fingerprint of every source file that cases and answers depend on, as currently on disk."""
    root = Path(__file__).resolve().parents[3]
    return {
        path.relative_to(root).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for package in PACKAGES
        for path in sorted((root / package).rglob("*"))
        if path.suffix in KINDS and "reporting" not in path.parts
    }


def program() -> str:
    """Joint fingerprint of all source files."""
    return hashlib.sha256(json.dumps(sources(), sort_keys=True).encode()).hexdigest()


def differing(before: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """Names of the source files that changed."""
    return sorted(name for name in {*before, *now} if before.get(name) != now.get(name))
