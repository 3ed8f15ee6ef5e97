"""Readable fractions."""

from __future__ import annotations

import math

import pytest

from missing_physics.recordings import percent


@pytest.mark.parametrize(
    ("share", "words"),
    [
        (1.0, "100 %"),
        (0.999, "100 %"),
        (0.1, "10 %"),
        (0.0995, "10 %"),
        (0.042, "4.2 %"),
        (0.00012, "0.012 %"),
        (1e-9, "less than 0.01 %"),
        (0.0, "0 %"),
        (9.0, "900 %"),
        (2.6e16, "more than 1000 %"),
        (math.inf, "more than 1000 %"),
        (math.nan, "an unknown part"),
    ],
)
def test_percent(share: float, words: str) -> None:
    assert percent(share) == words
