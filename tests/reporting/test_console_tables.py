"""Tables in the terminal: numbers and names are readable at any width."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from missing_physics.reporting.terminal.tables import number_table

ROWS = [("base.angular_velocity.x", "0.0078379", "1.27e-12", "N m"), ("joint1", "39.1", "-0.101", "N")]
NUMBERS = [cell for row in ROWS for cell in row[1:3]]


def shown(width: int, **options: object) -> str:
    console = Console(file=io.StringIO(), width=width)
    console.print(number_table(ROWS, console, **options))  # type: ignore[arg-type]
    return console.file.getvalue()  # type: ignore[attr-defined, no-any-return]


@pytest.mark.parametrize("width", range(20, 90, 5))
@pytest.mark.parametrize("headings", [(), ("", "truth", "found", "")])
def test_numbers_in_tables_are_never_cut(width: int, headings: tuple[str, ...]) -> None:
    text = shown(width, headings=headings)
    assert all(number in text for number in NUMBERS)
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= width
    assert "base.angular_velocity.x" in "".join(line.strip().split("  ")[0] for line in text.splitlines())


def test_narrow_terminal_drops_columns_before_the_table() -> None:
    wide, narrow = shown(60, expendable=(2,)), shown(34, expendable=(2,))
    assert "1.27e-12" in wide
    assert "1.27e-12" not in narrow
    assert any("base." in line and "0.0078379" in line for line in narrow.splitlines())
