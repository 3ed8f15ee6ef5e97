"""Fractions in words."""

from __future__ import annotations

import math

__all__ = ["percent"]

#: Fractions below and above these are not written with digits.
LEAST, MOST = 1e-4, 10.0


def percent(share: float) -> str:
    """``97 %``, ``4.2 %``, ``less than 0.01 %``, ``more than 1000 %``: integers, two digits below 10 %."""
    if math.isnan(share):
        return "an unknown part"
    if share > MOST:
        return f"more than {100 * MOST:.0f} %"
    if 0.0 < share < LEAST:
        return f"less than {100 * LEAST:g} %"
    return f"{100 * share:.0f} %" if share >= 0.0995 else f"{100 * share:.2g} %"
