"""The catalogue's pictures drawn with characters, for terminals.

A picture is read from its SVG, as written by `benchmarks.svg_lines` with one panel: curves and axis marks
keep their positions in its pixels, and marks keep their text.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from xml.etree import ElementTree

import plotext

__all__ = ["Curve", "Plot", "drawn", "read"]

#: Lines of text that a plot takes.
LINES = 20
#: Characters of curves in drawing order, the last one on top; distinguishable without colours as well.
MARKERS = (("·", "gray"), ("braille", "blue+"))
#: Legend entry of each.
SHOWN = {"·": "···", "braille": "⠒⠒⠒"}
SVG = "{http://www.w3.org/2000/svg}"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


@dataclass(frozen=True)
class Curve:
    """One curve in pixels, y upwards."""

    label: str
    x: tuple[float, ...]
    y: tuple[float, ...]


@dataclass
class Plot:
    """The content of a picture; marks are (pixel, word)."""

    title: str = ""
    x_label: str = ""
    y_label: str = ""
    x_marks: list[tuple[float, str]] = field(default_factory=list)
    y_marks: list[tuple[float, str]] = field(default_factory=list)
    curves: list[Curve] = field(default_factory=list)
    box: tuple[float, float] = (0.0, 0.0)


def read(svg: str) -> Plot:
    """The plot in a picture of one panel."""
    plot, labels = Plot(), {}
    parts = list(ElementTree.fromstring(svg))
    for path, text in _pairs(parts):
        numbers = [float(number) for number in NUMBER.findall(path.get("d", ""))]
        stroke, words = path.get("stroke", ""), text.text or ""
        if path.get("fill") == "none" and "L" not in path.get("d", ""):
            labels[stroke] = words
        elif path.get("fill") == "none":
            plot.curves.append(Curve(labels[stroke], tuple(numbers[::2]), tuple(-y for y in numbers[1::2])))
        elif text.get("text-anchor") == "end":
            plot.y_marks.append((-numbers[1], words))
            plot.box = numbers[0], numbers[2]
        elif "v5" in path.get("d", ""):
            plot.x_marks.append((numbers[0], words))
    plot.title, plot.x_label, plot.y_label = (part.text or "" for part in parts[-3:])
    return plot


def _pairs(parts: list[ElementTree.Element]) -> Iterator[tuple[ElementTree.Element, ElementTree.Element]]:
    """Every path with the element behind it, which names it if anything does."""
    return ((one, other) for one, other in pairwise(parts) if one.tag == f"{SVG}path")


def drawn(plot: Plot, *, columns: int) -> str:
    """The plot as lines of text, coloured by ANSI sequences."""
    plotext.clear_figure()
    plotext.theme("clear")
    plotext.limit_size(False, False)
    plotext.plot_size(columns, LINES)
    legend = ""
    for curve, (marker, colour) in zip(plot.curves, MARKERS[-len(plot.curves) :]):
        plotext.plot(curve.x, curve.y, marker=marker, color=colour)
        legend += f"  {SHOWN[marker]} {curve.label}"
    heights = [y for curve in plot.curves for y in curve.y] + [y for y, _ in plot.y_marks]
    plotext.xlim(*plot.box)
    plotext.ylim(min(heights), max(heights))
    plotext.xticks(*zip(*plot.x_marks))
    plotext.yticks(*zip(*plot.y_marks))
    plotext.title(plot.y_label + legend)
    plotext.xlabel(plot.x_label)
    text = str(plotext.build())
    plotext.clear_figure()
    return text
