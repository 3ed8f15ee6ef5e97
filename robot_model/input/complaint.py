"""Validation errors as sentences for people: the key, the fault and the value."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ValidationError

from robot_model.input.errors import nearest

__all__ = ["complaint", "shown"]

#: A key or value longer than this is truncated.
LONGEST_SHOWN = 60

#: Keys by which an entry of a list is named in a message.
LABELS = ("name", "channel", "joint", "effect")

#: Message for an error type of pydantic, filled in from the error's context.
WORDS: Mapping[str, str] = {
    "float_type": "must be a number",
    "bool_type": "must be true or false",
    "int_type": "must be a whole number",
    "string_type": "must be text in quotes",
    "string_unicode": "must be valid Unicode text",
    "string_too_long": "must have at most {max_length} characters",
    "string_pattern_mismatch": "must hold only letters, digits, - and _, and not begin with -",
    "tuple_type": "must be a list in square brackets",
    "model_type": "must be a table of keys",
    "model_attributes_type": "must be a table of keys",
    "finite_number": "must be a finite number",
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must be at least {ge:g}",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must be at most {le:g}",
    "too_short": "has {actual_length} entries but needs at least {min_length}",
    "too_long": "has too many entries; it may have {max_length}",
    "literal_error": "must be {expected}",
    "union_tag_invalid": "must be one of {expected_tags}",
}

#: Errors reported first and last: a misspelt key also makes its right spelling missing.
FIRST = ("extra_forbidden", "union_tag_invalid", "value_error")
LAST = ("missing", "union_tag_not_found")

Location = tuple[int | str, ...]


def complaint(error: ValidationError, data: Mapping[str, Any], model: type[BaseModel]) -> str:
    """The most informative of the errors, as ``key: fault (it is ...)`` without a full stop.

    Args:
        error: of pydantic.
        data: the validated data; its names replace positions in the message.
        model: the validated type; an unknown key is compared with its keys.
    """
    found = sorted(error.errors(include_url=False), key=lambda one: _rank(one["type"]))
    return _sentence(found[0], found, data, model)


def _enumerated(keys: set[str]) -> str:
    return f"; the keys here are {', '.join(sorted(keys))}"


def _rank(kind: str) -> int:
    if kind in FIRST:
        return FIRST.index(kind)
    return len(FIRST) + (kind in LAST)


def _sentence(one: Any, found: Sequence[Any], data: Mapping[str, Any], model: type[BaseModel]) -> str:
    kind, location = one["type"], one["loc"]
    where = _path(location, data)
    if kind == "extra_forbidden":
        known = _keys_at(location[:-1], model)
        return f"unknown key '{where}'{nearest(str(location[-1]), known) or _enumerated(known)}"
    if kind == "missing" and isinstance(location[-1], int):
        return _too_few(location, found, data)
    if kind == "missing":
        return f"key '{where}' is missing"
    if kind == "union_tag_not_found":
        return f"key '{where}.kind' is missing"
    where = f"{where}.kind" if kind == "union_tag_invalid" else where
    value = _value(one)
    text = _words(one) + (f" (it is {shown(value)})" if shown(value) else "")
    if kind in ("literal_error", "union_tag_invalid"):
        text += nearest(str(value), _choices(one))
    return f"{where}: {text}" if where else text


def _words(one: Any) -> str:
    """The fault in words; pydantic's own for kinds without a message here."""
    if one["type"] == "value_error":
        return str(one["msg"]).removeprefix("Value error, ")
    if one["type"] == "tuple_type" and isinstance(one["input"], dict):
        return f"must be a list of tables; write its name in double brackets, [[{one['loc'][-1]}]]"
    message = WORDS.get(one["type"])
    return message.format(**one.get("ctx", {})) if message else str(one["msg"]).lower()


def _value(one: Any) -> Any:
    """The offending value: for a wrong `kind` the kind itself."""
    return one["ctx"]["tag"] if one["type"] == "union_tag_invalid" else one["input"]


def _choices(one: Any) -> list[str]:
    """The accepted words, from pydantic's quoted enumeration of them."""
    listed = one["ctx"].get("expected") or one["ctx"].get("expected_tags")
    return str(listed).split("'")[1::2]


def _too_few(location: Location, found: Sequence[Any], data: Mapping[str, Any]) -> str:
    """A list of fixed length is too short: pydantic reports each missing entry."""
    absent = [
        one["loc"][-1] for one in found if one["type"] == "missing" and one["loc"][:-1] == location[:-1]
    ]
    return f"{_path(location[:-1], data)}: has {min(absent)} entries but needs {max(absent) + 1}"


def shown(value: Any) -> str:
    """The value as a person would write it, truncated if long; empty for tables and the like."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list) and all(isinstance(item, int | float | str) for item in value):
        return _cut(", ".join(shown(item) for item in value[:LONGEST_SHOWN]), "[]")
    if isinstance(value, int) and abs(value) >= 10**LONGEST_SHOWN:
        return "a whole number of very many digits"
    return _cut(repr(value)) if isinstance(value, str | int | float) else ""


def _cut(text: str, around: str = "") -> str:
    short = text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}..."
    return f"{around[:1]}{short}{around[1:]}"


def _path(location: Location, data: Any) -> str:
    """``links[link1].mass`` rather than ``links.0.mass``; tags of unions are omitted."""
    words: list[str] = []
    for step, here in _walk(location, data):
        if isinstance(step, int) and words:
            words[-1] += f"[{_label(here, step)}]"
        elif isinstance(step, str):
            words.append(_cut(step))
    return ".".join(words)


def _walk(location: Location, data: Any) -> Iterator[tuple[int | str, Any]]:
    """Each step into the data, with its value; tags of unions are skipped."""
    here = data
    last = len(location) - 1
    for place, step in enumerate(location):
        if isinstance(here, list) and isinstance(step, int):
            here = here[step] if step < len(here) else None
        elif isinstance(here, dict) and (step in here or place == last) and not _is_tag(step, here):
            here = here.get(step)
        else:
            continue
        yield step, here


def _is_tag(step: int | str, here: Mapping[str, Any]) -> bool:
    return step not in here and here.get("kind") == step


def _label(entry: Any, position: int) -> str:
    """The name of a list's entry, else its position counted from 0."""
    names = [entry.get(key) for key in LABELS] if isinstance(entry, dict) else []
    return next((_cut(name) for name in names if isinstance(name, str) and name), str(position))


def _keys_at(location: Location, model: type[BaseModel]) -> set[str]:
    """All keys allowed in the table at `location`."""
    here = [model]
    for step in location:
        if isinstance(step, int):
            continue
        fields = [part.model_fields[step] for part in here if step in part.model_fields]
        tagged = [part for part in here if _kind(part) == step]
        here = [part for field in fields for part in _models(field.annotation)] or tagged or here
    return {key for part in here for key in part.model_fields}


def _kind(model: type[BaseModel]) -> Any:
    return model.model_fields["kind"].default if "kind" in model.model_fields else None


def _models(annotation: Any) -> list[type[BaseModel]]:
    """The models inside a type such as ``tuple[Link, ...]`` or ``A | B | None``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in getattr(annotation, "__args__", ()) for model in _models(part)]
