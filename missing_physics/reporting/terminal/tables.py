"""Tables for a terminal of any width: names may be wrapped, numbers never."""

from __future__ import annotations

from collections.abc import Sequence

from rich.cells import cell_len
from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

__all__ = ["number_table"]

#: Smallest width of a column of names [characters]: shorter pieces of names are unreadable.
SHORTEST_NAME = 12
#: Blanks between two columns.
GAP = 2


def number_table(
    rows: Sequence[Sequence[str | Text]],
    console: Console,
    *,
    headings: Sequence[str] = (),
    right: Sequence[int] = (),
    expendable: Sequence[int] = (),
    indent: int = 2,
) -> RenderableType:
    """A table whose first column holds names and whose others hold numbers.

    On a narrow terminal names are wrapped, then columns are dropped, and finally every number has a separate
    line below its name.

    Args:
        rows: cells, as many in each row.
        console: on which it is printed; its width counts.
        headings: of the columns; may be empty.
        right: columns that are flush right.
        expendable: columns that may be dropped, in this order.
        indent: blanks on the left.
    """
    cells = [[Text(cell) if isinstance(cell, str) else cell for cell in row] for row in rows]
    titles = [Text(title) for title in headings]
    lines = [*([titles] if titles else []), *cells]
    columns = list(range(len(lines[0]) if lines else 0))
    widths = [max(line[column].cell_len for line in lines) for column in columns]
    room = console.width - indent
    for column in (None, *expendable):
        columns = [one for one in columns if one != column]
        numbers = sum(widths[one] + GAP for one in columns[1:])
        name = min(widths[0] if columns else 0, room - numbers)
        if name >= min(widths[0] if columns else 0, SHORTEST_NAME):
            return Padding(_table(lines, columns, name, right), (0, 0, 0, indent), expand=False)
    return Padding(_stacked(cells, headings), (0, 0, 0, indent), expand=False)


def _table(lines: Sequence[Sequence[Text]], columns: Sequence[int], name: int, right: Sequence[int]) -> Table:
    """A table of the remaining columns, with names of the given width."""
    table = Table.grid(padding=(0, GAP, 0, 0), pad_edge=False)
    for column in columns:
        if column == 0:
            table.add_column(overflow="fold", width=name)
        else:
            table.add_column(no_wrap=True, justify="right" if column in right else "left")
    for line in lines:
        table.add_row(*(line[column] for column in columns))
    return table


def _stacked(cells: Sequence[Sequence[Text]], headings: Sequence[str]) -> RenderableType:
    """Each name, and below it a line for each of its numbers."""
    titles = [f"{title} " if title else "" for title in headings] or [""] * max(map(len, cells), default=0)
    lines: list[Text] = []
    for name, *numbers in cells:
        lines.append(Text(name.plain, style=name.style, overflow="fold"))
        lines += [
            Text.assemble("  ", title, number, overflow="fold")
            for title, number in zip(titles[1:], numbers)
            if cell_len(number.plain)
        ]
    return Group(*lines)
