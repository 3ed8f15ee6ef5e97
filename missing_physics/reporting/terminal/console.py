"""The console of every command: names and sentences are printed literally, never as markup."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.progress import TextColumn
from rich.segment import Segment
from rich.text import Text

__all__ = ["DescriptionColumn", "PlainConsole", "styled"]

#: Control characters in a name would move the cursor or restyle the terminal; line feed and tab are layout.
_SHOWN_AS = "\N{REPLACEMENT CHARACTER}"
_CONTROL = {code: _SHOWN_AS for code in (*range(0x20), *range(0x7F, 0xA0)) if chr(code) not in "\n\t"}


class PlainConsole(Console):
    """A console that prints text literally: no markup, no emoji codes, no control characters.

    Bold or coloured text is given by a style (`styled`, or the argument `style` of `print`).
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**options, markup=False, emoji=False, highlight=False)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """The segments of `renderable`, control characters replaced."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else text.translate(_CONTROL), style, control)


class DescriptionColumn(TextColumn):
    """Description of a task in a progress display, printed literally."""

    def __init__(self) -> None:
        super().__init__("{task.description}", markup=False)


def styled(*parts: str | tuple[str, str]) -> Text:
    """Text of plain pieces and of pairs of a piece and its style."""
    return Text.assemble(*parts)
