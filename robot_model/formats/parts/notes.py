"""Notes on a robot file, each reported once: assumptions and omissions."""

from __future__ import annotations

from collections.abc import Container, Iterable

from robot_model.input.errors import one_sentence

__all__ = ["Notes", "listed"]

#: Number of names written out; the others are counted.
SHOWN = 8


def listed(names: Iterable[str]) -> str:
    """``a, b and c``, the rest of a long list counted."""
    words = list(dict.fromkeys(names))
    if len(words) > SHOWN:
        words = [*words[: SHOWN - 1], f"{len(words) - SHOWN + 1} more"]
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


class Notes:
    """Sentences, each reported once with all names that it concerns."""

    def __init__(self) -> None:
        self._names: dict[str, list[str]] = {}
        self._about: dict[str, str] = {}

    def add(self, sentence: str, *names: str, about: str = "") -> None:
        """Add `names` to a sentence, in which ``{}`` stands for them.

        Args:
            sentence: the note.
            names: parts that it concerns.
            about: the list of a robot file, such as ``effects``, if it concerns nothing else.
        """
        self._names.setdefault(sentence, []).extend(names)
        self._about[sentence] = about

    def sentences(self, *, dropped: Container[str] = ()) -> tuple[str, ...]:
        """All notes except those about a list that is `dropped`, in the order of first occurrence."""
        return tuple(
            one_sentence(sentence.replace("{}", listed(names)) if names else sentence)
            for sentence, names in self._names.items()
            if self._about[sentence] not in dropped
        )
