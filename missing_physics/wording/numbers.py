"""Numbers and intervals with as many digits as are significant."""

from __future__ import annotations

import math

__all__ = ["ABSENT", "interval_text", "number", "range_text", "within_text"]

#: Placeholder for a missing number.
ABSENT = "–"
#: A value that lies closer to one end of its interval than this part of the distance to the other end lies
#: at that end: to resolve the difference would take three more digits than the interval supports.
AT_THE_END = 1e-3


def number(value: float | None, digits: int = 3) -> str:
    """`value` with the given number of significant digits; a dash when it is None or not a number."""
    if value is None or math.isnan(value):
        return ABSENT
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    if value == 0.0:
        return "0"
    if not 1e-3 <= abs(value) < 10.0 ** max(digits, 5):
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa}e{int(exponent)}"
    return f"{value:.{max(digits - 1 - math.floor(math.log10(abs(value))), 0)}f}"


def interval_text(value: float, ci95: tuple[float, float]) -> tuple[str, str, str]:
    """Value, lower and upper bound, with two digits of the narrower side of the interval.

    The bounds are dashes where they are equal: then the uncertainty is not known.
    """
    low, high = ci95
    if low == high:
        return number(value, 4), ABSENT, ABSENT
    side = _narrower_side(value, low, high)
    if side is None:
        return number(value, 4), number(low, 4), number(high, 4)
    largest = max(abs(v) for v in (value, low, high) if math.isfinite(v))
    if not 1e-3 <= largest < 1e6:
        digits = max(2 + _magnitude(largest) - _magnitude(side), 2)
        return number(value, digits), number(low, digits), number(high, digits)
    decimals = max(1 - _magnitude(side), 0)
    shown = _fixed(value, decimals)
    if low >= 0.0 < value and float(shown) == 0.0:  # far below an upper bound that is hardly known
        shown = number(value, 2)
    return shown, _fixed(low, decimals), _fixed(high, decimals)


def within_text(value: float, ci95: tuple[float, float], unit: str = "") -> str:
    """``4.40 [4.10, 4.70] N m``; the value alone where its uncertainty is not known."""
    shown, low, high = interval_text(value, ci95)
    unit = "" if unit in ("", "-", "1") else f" {unit}"
    return f"{shown}{unit}" if (low, high) == (ABSENT, ABSENT) else f"{shown} [{low}, {high}]{unit}"


def range_text(low: float, high: float, unit: str = "", *, between: str = " to ") -> str:
    """``6.887 to 6.892 s``: both ends with two digits of the width; one number where they are one."""
    _, first, last = interval_text(low, (low, high))
    text = number(low) if low == high else f"{first}{between}{last}"
    return text if unit in ("", "-", "1") else f"{text} {unit}"


def _narrower_side(value: float, low: float, high: float) -> float | None:
    """The smallest distance that must be visible: of the value from its bounds, and between these."""
    sides = [side for side in (abs(value - low), abs(high - value)) if math.isfinite(side)]
    shown = [side for side in sides if side > AT_THE_END * max(sides)]
    if math.isfinite(high - low):
        shown.append(abs(high - low))
    return min(shown, default=None)


def _magnitude(value: float) -> int:
    """Power of ten of the first digit of a positive number that is rounded to two."""
    return int(f"{value:.1e}".split("e")[1])


def _fixed(value: float, decimals: int) -> str:
    """`value` with the given number of decimals, and no minus sign before zero."""
    if not math.isfinite(value):
        return number(value)
    return f"{round(value, decimals) + 0.0:.{decimals}f}"
