"""The error every reader and validator raises when the input is unusable."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

__all__ = ["InputError", "nearest", "one_sentence"]

#: Longer words come from damaged files, not from people, and comparing them takes long.
LONGEST_WORD = 80


class InputError(ValueError):
    """The input cannot be used.

    The message is one sentence for the person at the keyboard: what is wrong, where (file, column, row
    or key) and how to correct it. The command line prints it and ends with exit code 2. It is made one
    printable line with one closing mark, whatever a file name or a library's message contains.
    """

    def __init__(self, message: str) -> None:
        super().__init__(one_sentence(message))


def one_sentence(message: str) -> str:
    """The message as one printable line with one closing mark."""
    line = " ".join(message.splitlines()).rstrip(". ")
    printable = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in line)
    return printable if printable.endswith(("?", "!")) else f"{printable}."


def nearest(word: str, known: Iterable[str]) -> str:
    """A suggestion such as ``; did you mean 'mass'?``, or an empty string if nothing is similar.

    Args:
        word: the given word.
        known: the accepted words.
    """
    names = sorted(set(known))
    if len(word) > LONGEST_WORD:
        return ""
    hits = difflib.get_close_matches(word, names, n=1, cutoff=0.5)
    if not hits:  # a key such as `weight_kg` is similar to `weight` only in its beginning
        hits = [n for n in names if word and (n.startswith(word) or word.startswith(n))][:1]
    return f"; did you mean '{hits[0]}'?" if hits else ""
