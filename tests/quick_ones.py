"""Parameters of which a few are quick tests; the others are tried by `make proof`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def quick_names(names: Iterable[str], *quick: str) -> list[Any]:
    """Names as parameters, of which those in `quick` are quick tests."""
    found = list(names)
    assert set(quick) < set(found), f"no parameters: {set(quick) - set(found)}"
    return [pytest.param(name, marks=() if name in quick else pytest.mark.proof) for name in found]


def quick_places(values: Iterable[Any], *quick: int) -> list[Any]:
    """Values as parameters (tuples for several arguments); those at the places `quick` are quick tests."""
    found = [value if isinstance(value, tuple) else (value,) for value in values]
    assert set(quick) < set(range(len(found))), f"no places: {quick}"
    return [
        pytest.param(*value, marks=() if place in quick else pytest.mark.proof)
        for place, value in enumerate(found)
    ]
