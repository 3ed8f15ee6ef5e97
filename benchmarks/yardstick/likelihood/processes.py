"""The same function for many keys, in processes of their own."""

from __future__ import annotations

import multiprocessing
import sys
from collections.abc import Callable, Sequence
from typing import TypeVar

__all__ = ["each"]

Key = TypeVar("Key")
Found = TypeVar("Found")


def each(function: Callable[[Key], Found], keys: Sequence[Key], processes: int) -> list[Found]:
    """Results for all keys, in their order, with progress on stderr."""
    found = []
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        for result in pool.imap(function, keys):
            found.append(result)
            print(f"\r{function.__name__} {len(found)} of {len(keys)}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return found
