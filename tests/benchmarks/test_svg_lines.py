"""Figures of lines: everything is inside the picture for any number of curves."""

from __future__ import annotations

import re

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.svg_lines import LETTER, Line, Panel, figure

WORDS = st.text(alphabet="abcdefghij ,", min_size=1, max_size=40)


def picture(labels: list[str]) -> str:
    x = np.linspace(0.0, 1.0, 5)
    lines = [Line(label, "#000000", x, x * k) for k, label in enumerate(labels)]
    return figure("title", [Panel("one", "x", "y", lines), Panel("two", "x", "y", lines, log=False)])


@given(st.lists(WORDS, min_size=1, max_size=12, unique=True))
def test_legend_entries_stay_inside_the_picture(labels: list[str]) -> None:
    text = picture(labels)
    width = float(re.search(r'width="(\d+)"', text)[1])  # type: ignore[index]
    named = re.findall(r'<text x="(-?[\d.]+)" y="[\d.]+">([^<]*)</text>', text)
    assert sorted(name for _, name in named) == sorted(labels)
    assert all(float(x) >= 0 and float(x) + LETTER * len(name) <= width for x, name in named)


def test_panels_are_below_a_legend_of_several_rows() -> None:
    text = picture([f"a rather long name of a curve {k}" for k in range(9)])
    legend = [float(y) for y in re.findall(r'<text x="-?[\d.]+" y="([\d.]+)">', text)]
    titles = [float(y) for y in re.findall(r'y="([\d.]+)" font-size="13"', text)]
    assert len(set(legend)) > 1
    assert max(legend) < min(titles)
