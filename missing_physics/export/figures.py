"""Numbers as model files have them."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["figure", "figures"]


def figure(value: float) -> str:
    """Twelve digits, as many as a robot file is good for."""
    return f"{float(value):.12g}"


def figures(values: Iterable[float]) -> str:
    """Numbers with spaces between them."""
    return " ".join(map(figure, values))
