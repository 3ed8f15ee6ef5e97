"""Colours of every figure: Okabe and Ito's palette, distinct for colour-blind readers and in grey print.

M. Okabe, K. Ito, "Color Universal Design", 2008: vermilion, blue, reddish purple, bluish green.
"""

from __future__ import annotations

__all__ = [
    "AFTER",
    "AFTER_DARK",
    "AFTER_ON_DARK",
    "BACKWARDS",
    "BEFORE",
    "BEFORE_DARK",
    "FORWARDS",
    "HELD_OUT",
    "INK",
    "MEASURED",
    "MEASURED_ON_DARK",
    "NOISE",
    "WINDOW",
    "rgba",
]

MEASURED = "#222222"
BEFORE = "#D55E00"
AFTER = "#0072B2"
#: Lines drawn over an area of the colour above.
BEFORE_DARK = "#6E2F00"
AFTER_DARK = "#00304D"
WINDOW = "#CC79A7"
#: Where both hues above stand for something else.
FORWARDS, BACKWARDS = "#009E73", "#CC79A7"
HELD_OUT = "#8C8C8C"
NOISE = "#222222"
INK = "#222222"

#: For the rerun viewer, whose background is dark by default and light by choice.
MEASURED_ON_DARK = "#B0B0B0"
AFTER_ON_DARK = "#56B4E9"


def rgba(colour: str, opacity: float) -> str:
    """``#RRGGBB`` with an opacity between 0 and 1, as CSS."""
    red, green, blue = (int(colour[start : start + 2], 16) for start in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity:g})"
