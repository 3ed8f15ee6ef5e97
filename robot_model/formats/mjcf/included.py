"""One document from a model in several files, none of which may be outside the model's folder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from robot_model.formats.parts.markup import Element, parse_markup
from robot_model.formats.parts.sources import bytes_of

__all__ = ["with_includes"]


def with_includes(root: Element, path: Path) -> Element:
    """The document with each ``<include>`` replaced by the children of the included file.

    File names are relative to the folder of the main file, and each file may be included once, as in MuJoCo.

    Raises:
        InputError: a file is missing, outside the folder, no XML or included twice.
    """
    return _expanded(root, path.parent, {path.resolve()})


def _expanded(element: Element, folder: Path, seen: set[Path]) -> Element:
    children: list[Element] = []
    for child in element.children:
        if child.tag == "include":
            children += _expanded(_file(child, folder, seen), folder, seen).children
        else:
            children.append(_expanded(child, folder, seen))
    return replace(element, children=children)


def _file(include: Element, folder: Path, seen: set[Path]) -> Element:
    name = include.text("file")
    try:
        target = (folder / name).resolve()
        found = target.is_file()
    except (OSError, ValueError):
        include.fault(f"names '{name}', which no file can be called")
    if not target.is_relative_to(folder.resolve()):
        include.fault(
            f"names '{name}', which is outside the folder of the model; only files inside it are read"
        )
    if not found:
        include.fault(f"names '{name}', which is no file in {folder}")
    if target in seen:
        include.fault(f"names '{name}', which is included already")
    seen.add(target)
    return parse_markup(bytes_of(target), str(folder / name))
