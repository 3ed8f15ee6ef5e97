"""JSON: a list of samples, an object that holds one beside scalars, or an object of columns."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.recordings.raw import Raw, Want
from missing_physics.recordings.readers.base import reading
from robot_model import InputError

__all__ = ["SUFFIXES", "read"]

SUFFIXES = (".json",)


def read(path: Path, *, want: Want) -> Raw:
    """The values of a JSON file by their path in it.

    ``[{"a": 1}, ...]`` gives ``a``; ``{"entries": [{"a": 1}, ...], "kp": 2}`` gives ``entries.a`` (N,) and
    ``kp`` (); ``{"a": [1, 2]}`` gives ``a``. A key that a sample lacks is NaN there; a list of numbers in a
    sample gives an array (N, k).

    Raises:
        InputError: not JSON, truncated, or nested too deeply.
    """
    with reading(path, "JSON"):
        data = json.loads(path.read_text("utf-8-sig"))
        if not isinstance(data, dict | list):
            raise InputError(f"{path} holds a single value; a list of samples is due.")
        found = dict(_variables("", data))
        return Raw(str(path), {k: v for k, v in found.items() if want(k)}, tuple(found))
    raise AssertionError("unreachable: reading() raises")


def _variables(prefix: str, data: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    if isinstance(data, Mapping):
        for key, value in data.items():
            yield from _variables(f"{prefix}.{key}" if prefix else str(key), value)
    elif isinstance(data, list) and data and all(isinstance(item, dict) for item in data):
        yield from _samples(prefix, data)
    elif data is not None and prefix:
        yield prefix, _array(data if isinstance(data, list) else [data], scalar=not isinstance(data, list))


def _samples(prefix: str, samples: list[dict[str, Any]]) -> Iterator[tuple[str, NDArray[Any]]]:
    flat = [dict(_leaves("", sample)) for sample in samples]
    for key in dict.fromkeys(name for sample in flat for name in sample):
        yield (f"{prefix}.{key}" if prefix else key), _array([sample.get(key) for sample in flat])


def _leaves(prefix: str, data: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for key, value in data.items():
        name = f"{prefix}.{key}" if prefix else str(key)
        if isinstance(value, Mapping):
            yield from _leaves(name, value)
        else:
            yield name, value


def _array(values: list[Any], *, scalar: bool = False) -> NDArray[Any]:
    """Numbers as float64 (None as NaN), anything else as objects that an error can show."""
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
    objects = np.empty(len(values), dtype=object)
    objects[:] = values
    return objects
