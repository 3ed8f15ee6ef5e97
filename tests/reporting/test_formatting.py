"""Numbers for people: digits that the interval supports, never more certainty than there is."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from missing_physics.reporting.formatting import (
    interval_text,
    joined,
    number,
    p_value_text,
    percent,
    probability_text,
    rival_text,
)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (1.0, "1.00"),
        (123.456, "123"),
        (0.00123, "0.00123"),
        (1.5e-9, "1.50e-9"),
        (2.5e7, "2.50e7"),
        (-4.4, "-4.40"),
        (None, "–"),
        (math.nan, "–"),
        (math.inf, "∞"),
    ],
)
def test_number(value: float | None, text: str) -> None:
    assert number(value) == text


@given(st.floats(-1e12, 1e12, allow_nan=False).filter(lambda v: abs(v) > 1e-12))
def test_number_is_right_to_three_digits(value: float) -> None:
    # Rounding to three significant digits moves a number by at most half a unit in the third.
    assert float(number(value)) == pytest.approx(value, rel=5.01e-3)


@pytest.mark.parametrize(
    ("value", "interval", "expected"),
    [
        (4.4, (4.1, 4.7), ("4.40", "4.10", "4.70")),
        (95.1089, (94.8, 95.4), ("95.11", "94.80", "95.40")),
        (12345.6, (12000.0, 12700.0), ("12346", "12000", "12700")),
        (2e-5, (1e-5, 3e-5), ("2.0e-5", "1.0e-5", "3.0e-5")),
        (1.0, (-math.inf, math.inf), ("1.000", "-∞", "∞")),
    ],
)
def test_interval(value: float, interval: tuple[float, float], expected: tuple[str, str, str]) -> None:
    assert interval_text(value, interval) == expected


@pytest.mark.parametrize(
    ("probability", "text"),
    [(1.0, "> 99.9 %"), (0.0, "< 0.1 %"), (0.97, "97 %"), (0.996, "99.6 %"), (0.02, "2.0 %")],
)
def test_probability_never_claims_certainty(probability: float, text: str) -> None:
    assert probability_text(probability) == text


def test_small_words() -> None:
    assert percent(0.833) == "83 %"
    assert percent(-0.03) == "-3.0 %"
    assert percent(-2e-4) == "0 %"  # as nothing is written, whatever its sign
    assert p_value_text(1e-40) == "< 1e-12"
    assert p_value_text(0.012) == "0.012"
    assert joined(["a", "b", "c"]) == "a, b and c"
    assert joined(["a"]) == "a"
    assert joined([]) == ""


def test_a_rival_at_the_same_place_is_named_without_it() -> None:
    assert rival_text("torque_offset@joint2", "joint2") == "Torque offset"
    assert rival_text("torque_offset@joint1", "joint2") == "Torque offset at joint1"
    assert rival_text("torque_offset", "joint2") == "Torque offset"


def test_zero_has_no_sign() -> None:
    assert interval_text(-1e-6, (-0.0074, 0.0074))[0] == "0.0000"
