"""Documented commands are valid for the command line; none of them is run."""

from __future__ import annotations

import importlib.util
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.main import get_command

from missing_physics.cli import app
from missing_physics.cli.listing import SUMMARIES, loaded

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted(ROOT.glob("examples/*/README.md")),
]
BLOCK = re.compile(r"^```(?:sh|bash|console)?\n(.*?)^```", re.DOTALL | re.MULTILINE)
#: In running text, but for what stands for options (`[--map FILE]`).
INLINE = re.compile(r"`((?:missing-physics|python -m|make) [^`\n\[]+)`")
#: With or without the folder in which a command is typed.
PROMPT = re.compile(r"^[\w/.]*\$ ")
TARGET = re.compile(r"^([a-z][a-z-]*):", re.MULTILINE)


def shown() -> Iterator[tuple[str, str]]:
    """Page and command: lines of blocks that begin with the program, and what stands between backquotes."""
    for page in PAGES:
        text = page.read_text("utf-8")
        lines = [line for block in BLOCK.findall(text) for line in block.replace("\\\n", " ").splitlines()]
        for line in (*lines, *INLINE.findall(text)):
            words = PROMPT.sub("", line).strip()
            if words.startswith(("missing-physics ", "python -m ", "make ")):
                yield page.relative_to(ROOT).as_posix(), " ".join(words.split("  #")[0].split())


EVERY = list(dict.fromkeys(shown()))


def test_pages_show_commands() -> None:
    assert {page for page, _ in EVERY} >= {"README.md", "docs/first_diagnosis.md", "examples/emps/README.md"}


@pytest.mark.parametrize(("page", "line"), EVERY, ids=[f"{page}: {line[:60]}" for page, line in EVERY])
def test_documented_command_is_valid(page: str, line: str) -> None:
    program, first, *words = shlex.split(line)
    if program == "make":
        assert first in TARGET.findall((ROOT / "Makefile").read_text())
    elif program == "python":
        assert importlib.util.find_spec(words[0]) is not None
    elif first.startswith("-"):
        get_command(app).make_context(program, [first, *words], resilient_parsing=True)
    else:
        assert first in SUMMARIES
        if words:  # a command alone is spoken of
            loaded(first).make_context(first, words)
