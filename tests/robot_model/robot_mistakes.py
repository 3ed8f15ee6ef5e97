"""Every kind of mistake in a robot file, with the error message expected for it."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

__all__ = ["COUPLED", "FLEXIBLE", "LOOSE", "MISTAKES", "VALID", "Mistake"]

FOLDER = Path(__file__).parent
VALID = (FOLDER / "valid.toml").read_text()
FLEXIBLE = (FOLDER / "flexible.toml").read_text()
COUPLED = (FOLDER / "coupled.toml").read_text()
LOOSE = (FOLDER / "loose.toml").read_text()


@dataclass(frozen=True)
class Mistake:
    """In the text `valid`, `old` written as `new` must be rejected with `sentence`, after the file's name."""

    kind: str
    old: str
    new: str
    sentence: str
    valid: str = VALID

    @property
    def text(self) -> str:
        assert self.old in self.valid
        return self.valid.replace(self.old, self.new, 1)

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
        "is not a robot: line 7 holds a number of thousands of digits.",
    ),
    # Parsing it would take a minute and 2.4 GB: this test fails by its time without the check.
    Mistake(
        "endless key",
        MASS,
        "a." * 100_000 + MASS,
        "is not a robot: line 7 has a key of more than 32 dotted parts; give the tables that are meant.",
    ),
    Mistake(
        "endless table name",
        LINKS,
        f"[{'a . ' * 40}a]\n{LINKS}",
        "is not a robot: line 5 has a key of more than 32 dotted parts; give the tables that are meant.",
    ),
    Mistake(
        "huge whole number",
        MASS,
        "mass = 1" + "0" * 400,
        ": links[link1].mass: must be a number (it is a whole number of very many digits).",
    ),
    Mistake("too many bodies", LINKS, MANY_LINKS + LINKS, ": links: has too many entries; it may have 256."),
)


def listed(name: str, valid: str) -> list[Mistake]:
    """The mistakes of a TOML file."""
    entries = tomllib.loads((FOLDER / name).read_text())["mistakes"]
    return [Mistake(**entry, valid=valid) for entry in entries]


MISTAKES = (
    *listed("mistakes.toml", VALID),
    *listed("flexible_mistakes.toml", FLEXIBLE),
    *listed("coupled_mistakes.toml", COUPLED),
    *listed("loose_mistakes.toml", LOOSE),
    *LONG,
)
