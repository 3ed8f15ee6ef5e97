"""Formatted numbers: digits supported by the interval, and no excess certainty."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from missing_physics.reporting.elements.formatting import (
    estimate_text,
    interval_text,
    joined,
    number,
    p_value_text,
    percent,
    plus_minus_text,
    probability_text,
    rival_text,
)
from missing_physics.results.result import Estimate
from missing_physics.wording.numbers import range_text


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
        # the narrower side decides, whatever the wider one is
        (0.3496, (0.3017, 3.0), ("0.350", "0.302", "3.000")),
        (0.3496, (0.3017, math.inf), ("0.350", "0.302", "∞")),
        (7.0e-4, (2.8e-4, 7.5e-4), ("7.00e-4", "2.80e-4", "7.50e-4")),
        # at one end of the interval, and beyond it
        (0.34960001, (0.3496, 3.0), ("0.3", "0.3", "3.0")),
        (2.0, (1.0, 1.0001), ("2.00000", "1.00000", "1.00010")),
        # a positive quantity whose upper bound is hardly known
        (0.00292, (0.0, 10.0), ("0.0029", "0", "10")),
        # nothing is known of the uncertainty
        (6.887, (6.887, 6.887), ("6.887", "–", "–")),
        (1.0, (-math.inf, math.inf), ("1.000", "-∞", "∞")),
    ],
)
def test_interval(value: float, interval: tuple[float, float], expected: tuple[str, str, str]) -> None:
    assert interval_text(value, interval) == expected


@pytest.mark.parametrize(
    ("probability", "text"),
    [(1.0, "> 99.9 %"), (0.0, "< 0.1 %"), (0.97, "97 %"), (0.996, "99.6 %"), (0.02, "2.0 %")],
)
def test_probability_is_never_printed_as_certain(probability: float, text: str) -> None:
    assert probability_text(probability) == text


def test_percentages_p_values_and_lists_are_formatted() -> None:
    assert percent(0.833) == "83 %"
    assert percent(-0.03) == "-3.0 %"
    assert percent(-2e-4) == "0 %"  # as nothing is written, whatever its sign
    assert p_value_text(1e-40) == "< 1e-12"
    assert p_value_text(0.012) == "0.012"
    assert joined(["a", "b", "c"]) == "a, b and c"
    assert joined(["a"]) == "a"
    assert joined([]) == ""


def test_rival_at_the_same_place_is_named_without_the_place() -> None:
    assert rival_text("torque_offset@joint2", "joint2") == "Torque offset"
    assert rival_text("torque_offset@joint1", "joint2") == "Torque offset at joint1"
    assert rival_text("torque_offset", "joint2") == "Torque offset"


@given(
    st.floats(-1e9, 1e9),
    st.floats(1e-6, 1.0),
    st.floats(1e-6, 1.0),
    st.floats(1e-9, 1e9),
)
def test_an_interval_is_never_printed_as_one_number(
    value: float, below: float, above: float, size: float
) -> None:
    low, high = value - below * size, value + above * size
    _, first, last = interval_text(value, (low, high))
    assert (first == last) == (low == high)
    assert (" to " in range_text(low, high)) == (low != high)
    assert first in estimate_text(Estimate(value, (low, high), "m")) or low == high


@given(st.floats(-1e5, 1e5), st.floats(2e-3, 1.0), st.floats(1e-6, 1e5))
def test_both_sides_of_an_interval_are_printed_to_a_tenth(value: float, narrow: float, wide: float) -> None:
    told, low, high = interval_text(value, (value - narrow * wide, value + wide))
    # two digits of the narrower side: each end is off by at most a twentieth of it, and rounding
    assert abs(float(told) - float(low) - narrow * wide) <= 0.11 * narrow * wide + 1e-9
    assert abs(float(high) - float(told) - wide) <= 0.11 * narrow * wide + 1e-9


def test_a_value_without_uncertainty_has_no_interval() -> None:
    certain = Estimate(6.887, (6.887, 6.887), "m")
    assert estimate_text(certain) == plus_minus_text(certain) == "6.887 m"


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [
        (6.8871, 6.8893, "6.8871 to 6.8893 s"),
        (-0.128, 0.128, "-0.13 to 0.13 s"),
        (6.887, 6.887, "6.89 s"),
        (1.0, math.inf, "1.000 to ∞ s"),
    ],
)
def test_a_range_shows_its_width(low: float, high: float, text: str) -> None:
    assert range_text(low, high, "s") == text


def test_zero_has_no_sign() -> None:
    assert interval_text(-1e-6, (-0.0074, 0.0074))[0] == "0.0000"
