"""Pages that cite code: every cited file, function, class and test exists."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
#: Pages that cite `file:name`, and the folder to which their paths are relative.
PAGES = {
    "CONTRIBUTING.md": ".",
    "docs/method.md": "missing_physics",
    "docs/paper.md": ".",
    "docs/theory.md": ".",
}
#: A path in backticks, and the cited name in it.
CITED = re.compile(r"`((?:\w+/)+[\w.]+|\w+\.py)(?::([A-Za-z_][\w.]*))?`")
#: Citations of the theory page in code: its sections and equations.
SECTION = re.compile(r"docs/theory\.md (?:\((\d+)\)|(\d+))")


@cache
def names(path: Path) -> frozenset[str]:
    """Functions and classes of a module, methods as `Class.method`, and module constants."""
    found: set[str] = set()
    for node in ast.parse(path.read_text("utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        if isinstance(node, ast.ClassDef):
            found |= {f"{node.name}.{part.name}" for part in node.body if isinstance(part, ast.FunctionDef)}
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        found |= {target.id for target in targets if isinstance(target, ast.Name)}
    return frozenset(found)


def cited(text: str) -> list[tuple[str, str]]:
    return [(path, name) for path, name in CITED.findall(text)]


def missing(text: str, folder: str = ".") -> list[str]:
    """Citations of a text that exist neither in the folder nor in the repository."""
    lost = []
    for file, name in cited(text):
        near = ROOT / folder / file
        path = near if near.exists() else ROOT / file
        if not path.exists() or (name and (path.suffix != ".py" or name not in names(path))):
            lost.append(f"{file}:{name}")
    return lost


@pytest.mark.parametrize("page", PAGES)
def test_cited_code_exists(page: str) -> None:
    text = (ROOT / page).read_text("utf-8")
    assert cited(text)
    assert not missing(text, PAGES[page])


def test_a_missing_name_is_detected() -> None:
    there = "`reference_model/dynamics/tree.py:recursion`"
    page = f"{there} `reference_model/dynamics/tree.py:no_such` `reference_model/none.py`"
    assert missing(page) == ["reference_model/dynamics/tree.py:no_such", "reference_model/none.py:"]


def test_cited_sections_and_equations_exist_in_the_theory_page() -> None:
    text = (ROOT / "docs" / "theory.md").read_text("utf-8")
    sections = set(re.findall(r"^## (\d+)\.", text, flags=re.MULTILINE))
    equations = set(re.findall(r"\((\d+)\)\s*$", text, flags=re.MULTILINE))
    found = [
        match
        for room in ("reference_model", "exudyn_model")
        for path in (ROOT / room).rglob("*.py")
        for match in SECTION.findall(path.read_text("utf-8"))
    ]
    assert found
    assert not [pair for pair in found if (pair[0] or pair[1]) not in (equations if pair[0] else sections)]
