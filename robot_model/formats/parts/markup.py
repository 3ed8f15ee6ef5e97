"""XML as a tree of elements with their file and line.

Read through `defusedxml`, which refuses features that robot files never need but attackers use: declared
entities, whose expansion can fill the memory, and references to other files or the network. The standard
library's `ElementTree` keeps no line numbers, which error messages in files of thousands of lines need.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import NoReturn
from xml.sax import SAXParseException
from xml.sax.handler import ContentHandler, ErrorHandler
from xml.sax.xmlreader import AttributesImpl, Locator

import numpy as np
from defusedxml import DefusedXmlException
from defusedxml.sax import parseString
from numpy.typing import NDArray

from robot_model.input.errors import InputError, nearest

__all__ = ["Element", "number", "parse_markup"]

#: Elements of a file. A humanoid with hands has some thousand; a hundred times as many take seconds to read.
MOST_ELEMENTS = 100_000

#: Elements inside one another; a robot has at most 256 bodies.
DEEPEST = 300
#: A value is truncated after this many characters in messages.
LONGEST_SHOWN = 40


@dataclass(frozen=True)
class Element:
    """An XML element.

    Attributes:
        tag: name, a namespace's prefix included.
        attributes: name to text.
        file, line: where it starts, for people.
        children: elements inside it, in order.
        words: pieces of text inside it.
    """

    tag: str
    attributes: Mapping[str, str]
    file: str
    line: int
    children: list[Element] = field(default_factory=list)
    words: list[str] = field(default_factory=list)

    @property
    def content(self) -> str:
        """The text between the element's tags, its children's left out."""
        return "".join(self.words).strip()

    @property
    def where(self) -> str:
        """``arm.urdf, line 12``."""
        return f"{self.file}, line {self.line}"

    @property
    def label(self) -> str:
        """``joint 'elbow'``, or ``<origin>`` where it has no name."""
        name = self.attributes.get("name")
        return f"{self.tag} '{name}'" if name else f"<{self.tag}>"

    def fault(self, what: str) -> NoReturn:
        """Raise `InputError` that names file, line and element."""
        raise InputError(f"{self.where}: {self.label} {what}.")

    def all(self, *tags: str) -> Iterator[Element]:
        """Children with one of these tags."""
        return (child for child in self.children if child.tag in tags)

    def child(self, tag: str) -> Element | None:
        """The one child with this tag, if there is one; two are refused."""
        found = list(self.all(tag))
        if len(found) > 1:
            found[1].fault(f"is the second of its kind in {self.label}; one may be given")
        return found[0] if found else None

    def needed(self, tag: str) -> Element:
        """The child with this tag; refused where it is missing."""
        return self.child(tag) or self.fault(f"has no <{tag}>")

    def text(self, key: str) -> str:
        """An attribute that must be there."""
        if not (value := self.attributes.get(key, "").strip()):
            self.fault(f"has no {key}=")
        return value

    def several(self, key: str, most: int) -> NDArray[np.float64]:
        """At most `most` numbers; none where the attribute is missing."""
        words = self.attributes.get(key, "").split()
        if len(words) > most:
            self.fault(f"has {len(words)} numbers in {key}=, which takes at most {most}")
        return np.array([self._number(key, word) for word in words])

    def numbers(self, key: str, count: int, default: tuple[float, ...] | None = None) -> NDArray[np.float64]:
        """`count` numbers, or `default` where the attribute is missing; it must be there without one."""
        if key not in self.attributes and default is not None:
            return np.array(default)
        words = self.text(key).split()
        if len(words) != count:
            self.fault(f"has {len(words)} numbers in {key}=, which takes {count}")
        return np.array([self._number(key, word) for word in words])

    def number(self, key: str, default: float | None = None) -> float:
        """One number, or `default` where the attribute is missing."""
        return float(self.numbers(key, 1, None if default is None else (default,))[0])

    def choice(self, key: str, choices: tuple[str, ...], default: str) -> str:
        """One of a few words."""
        word = self.attributes.get(key, default).strip()
        if word not in choices:
            self.fault(f'has {key}="{word}"{nearest(word, choices) or f"; it may be {_or(choices)}"}')
        return word

    def _number(self, key: str, word: str) -> float:
        value = number(word)
        if value is None:
            self.fault(f'has {key}="{word[:LONGEST_SHOWN]}", which is not a finite number')
        return value


def number(word: str) -> float | None:
    """The finite number that a word is; None when it is none."""
    try:
        value = float(word)
    except ValueError:
        return None
    return value if math.isfinite(value) and "_" not in word else None


def _or(words: tuple[str, ...]) -> str:
    return f"{', '.join(words[:-1])} or {words[-1]}"


def parse_markup(content: bytes, file: str) -> Element:
    """The root element of an XML document. Raises `InputError`."""
    builder = _Builder(file)
    try:
        parseString(content, builder, ErrorHandler())
    except SAXParseException as error:
        raise InputError(
            f"{file}, line {error.getLineNumber()}: is not valid XML: {error.getMessage()}."
        ) from None
    except DefusedXmlException:
        raise InputError(
            f"{file} declares entities or refers to another file, which is refused; remove its DOCTYPE."
        ) from None
    except (LookupError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{file} is not valid XML: {error}.") from None
    if builder.root is None:
        raise InputError(f"{file} is not valid XML: it has no element.")
    return builder.root


class _Builder(ContentHandler):
    """Builds the tree while the parser reads."""

    def __init__(self, file: str) -> None:
        super().__init__()
        self.root: Element | None = None
        self._file, self._count = file, 0
        self._open: list[Element] = []
        self._locator: Locator | None = None

    def setDocumentLocator(self, locator: Locator) -> None:
        self._locator = locator

    def startElement(self, name: str, attrs: AttributesImpl) -> None:
        line = (self._locator.getLineNumber() if self._locator else None) or 0
        element = Element(name, dict(attrs.items()), self._file, line)
        self._count += 1
        if self._count > MOST_ELEMENTS:
            element.fault(f"is one of more than {MOST_ELEMENTS} elements, far too many for a robot file")
        if len(self._open) > DEEPEST:
            element.fault("is nested too deeply for a robot file")
        if self._open:
            self._open[-1].children.append(element)
        else:
            self.root = element
        self._open.append(element)

    def characters(self, content: str) -> None:
        if content.strip():
            self._open[-1].words.append(content)

    def endElement(self, name: str) -> None:
        self._open.pop()
