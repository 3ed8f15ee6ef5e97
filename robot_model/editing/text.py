"""An XML text whose attributes are edited in place; comments, order and spacing stay."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.parsers.expat import ParserCreate
from xml.sax.saxutils import quoteattr

from robot_model.input.errors import InputError

__all__ = ["Marked", "Tag"]

#: Content of a start tag: names with values in quotes.
_ATTRIBUTE = r"(\s+){key}(\s*=\s*)(\"[^\"]*\"|'[^']*')"
_START = re.compile(rb"<(?:[^\"'>]|\"[^\"]*\"|'[^']*')*>")


@dataclass(eq=False)
class Tag:
    """An element with its position in the text.

    Attributes:
        name: of the element.
        attributes: as read.
        start, stop: bytes of its start tag.
        end: start of its end tag; `stop` where it has none.
        parent: None of the root.
        children: in order.
    """

    name: str
    attributes: Mapping[str, str]
    start: int
    stop: int = 0
    end: int = 0
    parent: Tag | None = None
    children: list[Tag] = field(default_factory=list)

    def all(self, name: str) -> Iterator[Tag]:
        """Children of that name."""
        return (child for child in self.children if child.name == name)

    def child(self, name: str) -> Tag | None:
        """The first child of that name."""
        return next(self.all(name), None)

    def inside(self, name: str) -> Iterator[Tag]:
        """All elements of that name at any depth, in the order of the text."""
        for child in self.children:
            if child.name == name:
                yield child
            yield from child.inside(name)


class Marked:
    """A text and its pending changes."""

    def __init__(self, content: bytes, source: str) -> None:
        """Find all elements.

        Args:
            content: of a file that was read as a robot, so that it is valid and declares no entities.
            source: its name, for people.

        Raises:
            InputError: it is not written in UTF-8.
        """
        try:
            content.decode("utf-8")
        except UnicodeDecodeError:
            raise InputError(
                f"{source} is not written in UTF-8, so that it is not edited; convert it."
            ) from None
        self.content, self.source = content, source
        self._attributes: dict[Tag, dict[str, str | None]] = {}
        self._children: dict[Tag, list[str]] = {}
        self.root = _read(content)

    def set(self, tag: Tag, **attributes: str | None) -> None:
        """Set attributes; None removes one."""
        self._attributes.setdefault(tag, {}).update(attributes)

    def add(self, tag: Tag, child: str) -> None:
        """Insert an element's text after the start tag."""
        self._children.setdefault(tag, []).append(child)

    def text(self) -> bytes:
        """The text with all changes."""
        parts, at = [], 0
        for tag in sorted({*self._attributes, *self._children}, key=lambda one: one.start):
            opening = self.content[tag.start : tag.stop].decode("utf-8")
            for key, value in self._attributes.get(tag, {}).items():
                opening = _changed(opening, key, value)
            if tag in self._children:
                opening = self._with_children(tag, opening)
            parts += [self.content[at : tag.start], opening.encode("utf-8")]
            at = tag.stop
        return b"".join([*parts, self.content[at:]])

    def _with_children(self, tag: Tag, opening: str) -> str:
        line = self.content[self.content.rfind(b"\n", 0, tag.start) + 1 : tag.start].decode("utf-8")
        indent = line if not line.strip() else ""
        newline = "\r\n" if b"\r\n" in self.content else "\n"
        added = "".join(f"{newline}{indent}  {child}" for child in self._children[tag])
        if opening.endswith("/>"):
            return f"{opening[:-2].rstrip()}>{added}{newline}{indent}</{tag.name}>"
        return opening + added


def _changed(opening: str, key: str, value: str | None) -> str:
    """A start tag with another value of an attribute, or without it."""
    pattern = re.compile(_ATTRIBUTE.format(key=re.escape(key)))
    if value is None:
        return pattern.sub("", opening, count=1)
    if pattern.search(opening):
        return pattern.sub(lambda found: f"{found[1]}{key}{found[2]}{quoteattr(value)}", opening, count=1)
    closing = "/>" if opening.endswith("/>") else ">"
    whole = opening[: -len(closing)]
    return f"{whole.rstrip()} {key}={quoteattr(value)}{whole[len(whole.rstrip()) :]}{closing}"


def _read(content: bytes) -> Tag:
    parser = ParserCreate("utf-8")
    parser.buffer_text = True
    opened: list[Tag] = []
    roots: list[Tag] = []

    def start(name: str, attributes: dict[str, str]) -> None:
        at = parser.CurrentByteIndex
        found = _START.match(content, at)
        assert found is not None
        parent = opened[-1] if opened else None
        tag = Tag(name, attributes, at, found.end(), found.end(), parent)
        (parent.children if parent else roots).append(tag)
        opened.append(tag)

    def end(_: str) -> None:
        tag = opened.pop()
        if not content[tag.start : tag.stop].endswith(b"/>"):
            tag.end = parser.CurrentByteIndex

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.Parse(content, True)
    return roots[0]
