"""Every kind of mistake in a robot file with the sentence that must be said of it."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

__all__ = ["MISTAKES", "VALID", "Mistake"]

FOLDER = Path(__file__).parent
VALID = (FOLDER / "valid.toml").read_text()


@dataclass(frozen=True)
class Mistake:
    """In `VALID`, `old` written as `new` must be refused with `sentence`, after the file's name."""

    kind: str
    old: str
    new: str
    sentence: str

    @property
    def text(self) -> str:
        assert self.old in VALID
        return VALID.replace(self.old, self.new, 1)

    def told_of(self, path: Path) -> str:
        """The whole message for a file at `path`."""
        return f"{path}{'' if self.sentence.startswith(':') else ' '}{self.sentence}"


MASS = "mass = 8.0"
LINKS = "[[links]]"
MANY_LINKS = "".join(f'{LINKS}\nname = "l{k}"\n' for k in range(300))

#: Those too long to be written down.
LONG = (
    Mistake(
        "too deep", MASS, "mass = " + "[" * 5000, "is not a robot: its lists or tables are nested too deeply."
    ),
    Mistake(
        "endless number",
        MASS,
        "mass = 1" + "0" * 5000,
        "is not a robot: it holds a number of thousands of digits.",
    ),
    Mistake(
        "huge whole number",
        MASS,
        "mass = 1" + "0" * 400,
        ": links[link1].mass: must be a number (it is a whole number of very many digits).",
    ),
    Mistake("too many bodies", LINKS, MANY_LINKS + LINKS, ": links: has too many entries; it may have 256."),
)

MISTAKES = (
    *(Mistake(**entry) for entry in tomllib.loads((FOLDER / "mistakes.toml").read_text())["mistakes"]),
    *LONG,
)
