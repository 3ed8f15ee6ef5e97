"""JSON: a list of samples, an object with such a list and scalars, or an object of columns."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.channels.raw import Raw, Want
from missing_physics.recordings.readers.base import reading
from missing_physics.recordings.readers.budget import NUMBER
from missing_physics.recordings.readers.source import Source
from robot_model import InputError

__all__ = ["SUFFIXES", "read"]

SUFFIXES = (".json",)

#: Largest memory of the Python objects that each of these characters begins [bytes]: a table of a few keys
#: and its flat copy, a list, a key and its value, an entry of a list.
_COSTS = {b"{": 500, b"[": 100, b":": 150, b",": 50}


def read(source: Source, *, want: Want) -> Raw:
    """The values of a JSON file by their path in it.

    ``[{"a": 1}, ...]`` gives ``a``; ``{"entries": [{"a": 1}, ...], "kp": 2}`` gives ``entries.a`` (N,) and
    ``kp`` (); ``{"a": [1, 2]}`` gives ``a``. A key that a sample lacks is NaN there; a list of numbers in a
    sample gives an array (N, k).

    Raises:
        InputError: not JSON, truncated, or nested too deeply.
    """
    with reading(source, "JSON"):
        data = json.loads(_text(source))
        if not isinstance(data, dict | list):
            raise InputError(f"{source} holds a single value; a list of samples is expected.")
        known = dict(_variables("", data))
        found = {name: _taken(source, name, values) for name, values in known.items() if want(name)}
        return Raw(source.name, found, tuple(known))
    raise AssertionError("unreachable: reading() raises")


def _text(source: Source) -> str:
    """The text, after taking the memory of the parsed objects from the budget."""
    size = source.path.stat().st_size
    source.budget.take(2 * size, f"{source} has {size} bytes of text")
    content = source.path.read_bytes()
    entries = {mark: content.count(mark) for mark in _COSTS}
    cost = sum(count * _COSTS[mark] for mark, count in entries.items())
    source.budget.take(cost, f"{source} holds {entries[b','] + 1} values")
    return content.decode("utf-8-sig")


class _Values(NamedTuple):
    """Values of a variable that are still to be collected.

    Attributes:
        size: number of values.
        collect: returns them in order.
        scalar: whether it is a single value of shape ().
    """

    size: int
    collect: Callable[[], list[Any]]
    scalar: bool = False


def _taken(source: Source, name: str, values: _Values) -> NDArray[Any]:
    """The array of a variable, taken from the budget: a key of few samples needs memory for all of them."""
    source.budget.take_array(source, name, (values.size,), NUMBER)
    return _array(values.collect(), scalar=values.scalar)


def _variables(prefix: str, data: Any) -> Iterator[tuple[str, _Values]]:
    if isinstance(data, Mapping):
        for key, value in data.items():
            yield from _variables(f"{prefix}.{key}" if prefix else str(key), value)
    elif isinstance(data, list) and data and all(isinstance(item, dict) for item in data):
        yield from _samples(prefix, data)
    elif isinstance(data, list) and prefix:
        yield prefix, _Values(len(data), lambda: data)
    elif data is not None and prefix:
        yield prefix, _Values(1, lambda: [data], scalar=True)


def _samples(prefix: str, samples: list[dict[str, Any]]) -> Iterator[tuple[str, _Values]]:
    flat = [dict(_leaves("", sample)) for sample in samples]
    for key in dict.fromkeys(name for sample in flat for name in sample):
        collect = partial(_column, flat, key)
        yield (f"{prefix}.{key}" if prefix else key), _Values(len(flat), collect)


def _column(samples: list[dict[str, Any]], key: str) -> list[Any]:
    return [sample.get(key) for sample in samples]


def _leaves(prefix: str, data: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for key, value in data.items():
        name = f"{prefix}.{key}" if prefix else str(key)
        if isinstance(value, Mapping):
            yield from _leaves(name, value)
        else:
            yield name, value


def _array(values: list[Any], *, scalar: bool = False) -> NDArray[Any]:
    """Numbers as float64 (None as NaN), anything else as objects for error messages."""
    if all(v is None or isinstance(v, bool | int | float) for v in values):
        try:
            numbers = np.array([np.nan if v is None else v for v in values], dtype=np.float64)
        except OverflowError:  # an integer beyond the range of a float
            numbers = np.array(values, dtype=object)
        return numbers.reshape(()) if scalar else numbers
    lengths = {len(v) if isinstance(v, list) else -1 for v in values}
    if len(lengths) == 1 and lengths.pop() > 0:
        flat = [item for row in values for item in row]
        return _array(flat).reshape(len(values), -1)
    return np.fromiter(values, dtype=object, count=len(values))
