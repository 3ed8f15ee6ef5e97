"""Expansion of a xacro file to a URDF."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from robot_model.formats.parts.markup import Element, parse_markup
from robot_model.formats.xacro.expressions import CONSTANTS, evaluate, namespaces
from robot_model.formats.xacro.packages import Packages
from robot_model.input.errors import InputError

__all__ = ["expanded"]

#: Largest number of processed elements; the expansion of two arms with hands takes some thousand.
MOST_ELEMENTS = 20_000

#: Characters of one attribute or text.
LONGEST_TEXT = 100_000


def expanded(path: Path, arguments: Mapping[str, Any]) -> Element:
    """The root element of the URDF from a xacro file.

    Args:
        path: the file.
        arguments: values of its ``<xacro:arg>`` by name.

    Raises:
        InputError: it cannot be expanded.
    """
    import xacro

    with _guarded(xacro, path):
        try:
            document = xacro.process_file(str(path), mappings={k: _word(v) for k, v in arguments.items()})
            text = document.toxml(encoding="utf-8")
        except RecursionError:
            raise InputError(f"{path}: its macros call each other without end.") from None
        except Exception as error:  # the package raises errors of any type
            raise InputError(f"{_where(xacro, path)}: xacro: {_reason(error)}.") from None
    return parse_markup(text, f"{path} as expanded")


def _word(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _where(xacro: Any, path: Path) -> str:
    """The file, and the included one that was being read."""
    files = [str(file) for file in xacro.filestack or [] if file]
    return f"{path} (in {files[-1]})" if files[1:] else str(path)


def _reason(error: Exception) -> str:
    """The error in one line; its type if it has no message."""
    return " ".join(str(error).split()).rstrip(".") or type(error).__name__


@contextlib.contextmanager
def _guarded(xacro: Any, path: Path) -> Iterator[None]:
    """The package with guarded expressions, files and sizes; restored at the end."""
    guard = _Guard(xacro, path)
    exchanged = {
        "safe_eval": guard.value,
        "eval_text": guard.text,
        "eval_all": guard.all,
        "eval_extension": guard.extension,
        "parse": guard.document,
        "warning": lambda *_: None,
        "print_location": lambda: None,
        "_global_symbols": {**CONSTANTS, **guard.names},
        "filestack": None,
        "macrostack": None,
    }
    before = {name: getattr(xacro, name) for name in exchanged}
    for name, value in exchanged.items():
        setattr(xacro, name, value)
    try:
        yield
    finally:
        for name, value in before.items():
            setattr(xacro, name, value)
        xacro.substitution_args_context.clear()


class _Guard:
    """Replacements for parts of the package."""

    def __init__(self, xacro: Any, path: Path) -> None:
        self._xacro, self._packages, self._elements = xacro, Packages(path), 0
        self._text: Callable[[str, Any], Any] = xacro.eval_text
        self._all: Callable[[Any, Any, Any], None] = xacro.eval_all
        self._files: dict[str, Callable[..., Any]] = {
            "load_yaml": self._yaml,
            "abs_filename": xacro.abs_filename_spec,
            "dotify": xacro.YamlDictWrapper,
        }
        self.names = namespaces(
            **self._files,
            arg=self._argument,
            message=self._silent,
            warning=self._silent,
            error=self._silent,
            fatal=self._fatal,
        )

    def value(self, expression: str, names: Any, _: Any = None) -> Any:
        """Instead of Python's `eval`."""
        x = self._xacro
        return evaluate(expression, names, self._files, (x.YamlDictWrapper, x.YamlListWrapper, x.NameSpace))

    def text(self, text: str, names: Any) -> Any:
        """A text with its expressions replaced, limited in length."""
        found = self._text(text, names)
        if isinstance(found, str) and len(found) > LONGEST_TEXT:
            raise ValueError(f"a text of more than {LONGEST_TEXT} characters")
        return found

    def all(self, node: Any, macros: Any, names: Any) -> None:
        """Everything inside an element, limited in number."""
        self._elements += 1
        if self._elements > MOST_ELEMENTS:
            raise ValueError(f"it expands to more than {MOST_ELEMENTS} elements")
        self._all(node, macros, names)

    def document(self, source: Any, file: str | None = None) -> Any:
        """A file as a document; a document is returned unchanged."""
        return source if file is None else self._packages.document(file)

    def extension(self, text: str) -> str:
        """``$(arg NAME)``, ``$(find PACKAGE)`` and the like."""
        command, _, rest = text[2:-1].strip().partition(" ")
        words = rest.split()
        if command == "arg" and len(words) == 1:
            return self._argument(words[0])
        if command == "find" and len(words) == 1:
            return self._packages.find(words[0])
        if command == "dirname":
            return str(Path(self._xacro.filestack[-1]).parent)
        if command == "optenv" and words:
            return " ".join(words[1:])  # as if it were not set
        if command == "eval":
            return str(evaluate(rest, {**CONSTANTS, **self.names, **self._arguments()}))
        raise InputError(f"{text} is not read; xacro arguments can be given under [xacro] in an overlay")

    def _arguments(self) -> dict[str, Any]:
        given: dict[str, str] = self._xacro.substitution_args_context.get("arg", {})
        return {name: self._xacro.Table._eval_literal(value) for name, value in given.items()}

    def _argument(self, name: str) -> str:
        given: dict[str, str] = self._xacro.substitution_args_context.get("arg", {})
        if name not in given:
            raise InputError(f"the argument '{name}' has no value; give it under [xacro] in an overlay")
        return given[name]

    def _yaml(self, file: str) -> Any:
        """Figures of a YAML file."""
        import yaml

        content = self._packages.content(self._xacro.abs_filename_spec(file))
        return self._xacro.YamlListWrapper.wrap(yaml.load(content, Loader=_loader(yaml)))

    @staticmethod
    def _silent(*_: Any, **__: Any) -> str:
        return ""

    @staticmethod
    def _fatal(*words: Any) -> str:
        raise InputError(" ".join(map(str, words)))


def _loader(yaml: Any) -> Any:
    """PyYAML's safe loader with the units that xacro adds to it."""

    class Loader(yaml.SafeLoader):
        pass

    for unit, scale in UNITS.items():
        Loader.add_constructor(
            f"!{unit}",
            lambda loader, node, scale=scale: (
                scale * float(evaluate(str(loader.construct_scalar(node)), dict(CONSTANTS)))
            ),
        )
    return Loader


#: Tags of figures in YAML files, in SI units.
UNITS: Mapping[str, float] = {
    "radians": 1.0,
    "degrees": 3.141592653589793 / 180,
    "meters": 1.0,
    "millimeters": 0.001,
    "foot": 0.3048,
    "inches": 0.0254,
}
