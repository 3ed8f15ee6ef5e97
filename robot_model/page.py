"""The page of all keys of a robot file, made from the fields themselves.

``python -m robot_model.page > docs/robot.md`` writes it anew.
"""

from __future__ import annotations

import inspect
import re
import types
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from typing import Annotated, Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from robot_model.description.types import EffectUse, Robot
from robot_model.formats.page import other_formats

__all__ = ["robot_page"]

INTRODUCTION = """\
# Robot files

A robot is described in TOML. This page lists every key; it is written from the program itself by
`python -m robot_model.page`, do not edit it by hand.

All figures are in SI units: m, kg, s, rad, N. Each body carries one frame, fixed in it. A link's frame
sits at the joint that moves it: parent frame, then `origin` and `rpy` of the joint, then the motion of
the joint, then the link's frame, as in URDF. Roll, pitch and yaw turn about fixed axes: R = Rz(yaw)
Ry(pitch) Rx(roll). The order of the joints in the file, fixed ones left out, is the order of every list
with one number for each moving joint.

The bodies form a tree that hangs on `base`: each link is the child of one joint. Every coordinate must
move some inertia; a link may weigh nothing where something beyond it, or a rotor, makes its motion
definite.

A key that is not listed here is an error, and so is a value outside its range. Keys without a default
must be given. A robot on the command line is such a file, a
[URDF, xacro or MJCF file](#urdf-xacro-and-mjcf-files-and-overlays), or the name of a shipped robot: SHIPPED.

For example, the shipped robot `single_axis`:

```toml
EXAMPLE```
"""

EFFECT_PARAMETERS = """
Every other key is a parameter of the effect, a number. Effects, their parameters, units and defaults are on
the [page of effects](effects.md).
"""


@dataclass(frozen=True)
class _Section:
    """One table of the file: its heading in TOML and the model of its keys."""

    heading: str
    model: type[BaseModel]


def robot_page() -> str:
    """The whole page in Markdown."""
    library = resources.files("robot_model").joinpath("library")
    names = sorted(
        item.name.removesuffix(".toml") for item in library.iterdir() if item.name.endswith(".toml")
    )
    example = library.joinpath("single_axis.toml").read_text("utf-8")
    shipped = ", ".join(f"`{name}`" for name in names)
    parts = [INTRODUCTION.replace("SHIPPED", shipped).replace("EXAMPLE", example)]
    parts += [other_formats(), *(_section(section) for section in _sections(_Section("top level", Robot)))]
    return "\n".join(parts)


def _sections(section: _Section) -> Iterator[_Section]:
    """The section and all below it, each table where it first stands."""
    yield section
    for key, field in section.model.model_fields.items():
        path = key if section.model is Robot else f"{section.heading.strip('[]')}.{key}"
        for model in _models(field.annotation):
            heading = f"[[{path}]]" if _is_list(field.annotation) else f"[{path}]"
            yield from _sections(_Section(heading, model))


def _section(section: _Section) -> str:
    fields = section.model.model_fields
    kind = fields["kind"].default if "kind" in fields and _constant(fields["kind"]) else None
    title = f"`{section.heading}`" if section.model is not Robot else "Top level"
    title += f' with `kind = "{kind}"`' if kind else ""
    keys = sorted(fields, key=lambda key: key != "name")  # a name stands first, inherited keys or not
    rows = [_row(key, fields[key]) for key in keys if not _constant(fields[key])]
    table = ["| key | value | unit | default | meaning |", "|---|---|---|---|---|", *rows] if rows else []
    text = _plain(inspect.getdoc(section.model) or "")
    extra = EFFECT_PARAMETERS if section.model is EffectUse else ""
    return "\n".join([f"## {title}", "", text, "", *table, extra]).rstrip() + "\n"


def _constant(field: FieldInfo) -> bool:
    """A key whose only value is its default: the tag of a union."""
    return get_origin(field.annotation) is Literal and len(get_args(field.annotation)) == 1


def _row(key: str, field: FieldInfo) -> str:
    meaning, unit = _meaning_and_unit(field.description or "")
    cells = (f"`{key}`", _form(field), unit, _default(field), meaning)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _meaning_and_unit(description: str) -> tuple[str, str]:
    """``mass [kg]`` is a meaning and a unit; a description without brackets has no unit."""
    match = re.fullmatch(r"(.*) \[([^\[\]]+)\]", description)
    return (match[1], match[2]) if match else (description, "")


def _form(field: FieldInfo) -> str:
    """What kind of value it is, with its range."""
    return _words(field.annotation) + "".join(_range(item) for item in field.metadata)


def _range(constraint: Any) -> str:
    """Only ranges with a physical sense; that numbers beyond all measure are refused is told nowhere."""
    if hasattr(constraint, "gt"):
        return f" > {constraint.gt}"
    return f" >= {constraint.ge}" if getattr(constraint, "ge", None) == 0 else ""


def _words(annotation: Any) -> str:
    arguments = get_args(annotation)
    origin = get_origin(annotation)
    if origin is Annotated:
        return _words(arguments[0]) + "".join(_range(item) for item in _flat(arguments[1:]))
    if origin is Literal:
        return " or ".join(f'`"{word}"`' for word in arguments)
    if origin is tuple:
        return _list_words(arguments)
    if _is_union(annotation):
        return " or ".join(dict.fromkeys(_words(part) for part in arguments if part is not type(None)))
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return "table"
    return {float: "number", int: "whole number", str: "text", bool: "true or false"}[annotation]


def _list_words(arguments: tuple[Any, ...]) -> str:
    inner = _words(arguments[0])
    if arguments[-1] is ...:
        return f"list of {inner.replace('list', 'lists', 1) if inner.startswith('list') else f'{inner}s'}"
    return f"{len(arguments)} {inner}s"


def _flat(metadata: tuple[Any, ...]) -> Iterator[Any]:
    """Constraints, whether they stand by themselves or inside a `FieldInfo`."""
    for item in metadata:
        yield from item.metadata if isinstance(item, FieldInfo) else (item,)


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "**must be given**"
    value = field.get_default(call_default_factory=True)
    if value is None:
        return "none"
    if isinstance(value, BaseModel):
        kind = getattr(value, "kind", None)
        return f'`kind = "{kind}"`' if kind else "its defaults"
    return f"`{_toml(value)}`"


def _toml(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(_toml(item) for item in value)}]"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _plain(docstring: str) -> str:
    """A docstring as Markdown: formulas keep their asterisks and underscores."""
    return re.sub(r"([*_])", r"\\\1", docstring)


def _is_union(annotation: Any) -> bool:
    return isinstance(annotation, types.UnionType) or str(get_origin(annotation)) == "typing.Union"


def _is_list(annotation: Any) -> bool:
    return get_origin(annotation) is tuple


def _models(annotation: Any) -> list[type[BaseModel]]:
    """The models inside a type such as ``tuple[Link, ...]`` or ``A | B | None``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models(part)]


if __name__ == "__main__":
    print(robot_page(), end="")
