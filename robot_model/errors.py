"""The error every reader and validator raises when the input is unusable."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

__all__ = ["InputError", "nearest"]


class InputError(ValueError):
    """The input cannot be used.

    The message is one sentence for the person at the keyboard: what is wrong, where (file, column, row
    or key) and how to mend it. The command line prints it and leaves with exit code 2.
    """


def nearest(word: str, known: Iterable[str]) -> str:
    """A suggestion such as ``; did you mean 'mass'?``, or an empty string when nothing is near.

    Args:
        word: what was given.
        known: the words that would have been accepted.
    """
    names = sorted(set(known))
    hits = difflib.get_close_matches(word, names, n=1, cutoff=0.5)
    if not hits:  # a key such as `weight_kg` is near `weight` only by its beginning
        hits = [n for n in names if n.startswith(word) or word.startswith(n)][:1]
    return f"; did you mean '{hits[0]}'?" if hits else ""
