"""Figures as plotly specifications: plain dictionaries with packed arrays, safe to embed in a page."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from missing_physics.reporting.elements.palette import INK

__all__ = ["Figure", "axis", "label", "layout", "line", "packed", "rectangle", "swatch"]

Spec = dict[str, Any]
FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
GRID = "#E6E6E6"


@dataclass(frozen=True)
class Figure:
    """A picture of the report.

    Attributes:
        name: identifier in the page, letters, digits and hyphens.
        data, layout: as plotly.js takes them.
        title: one line above the picture.
        caption: explanation.
        height: [px].
        folded: hidden until the reader opens it.
    """

    name: str
    data: Sequence[Spec]
    layout: Spec
    title: str = ""
    caption: str = ""
    height: int = 420
    folded: bool = False

    @property
    def json(self) -> str:
        """The specification as JSON that cannot end the script element around it."""
        text = json.dumps({"data": list(self.data), "layout": self.layout}, allow_nan=False)
        return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def packed(values: NDArray[Any], dtype: str = "f4") -> Spec:
    """An array, 1-D or 2-D, in plotly's binary form; `dtype` is ``f4``, ``f8`` or ``u1``. NaN is a gap."""
    array = np.ascontiguousarray(values, dtype=np.dtype(dtype).newbyteorder("<"))
    spec: Spec = {"dtype": dtype, "bdata": base64.b64encode(array.tobytes()).decode("ascii")}
    if array.ndim == 2:
        spec["shape"] = f"{array.shape[0]}, {array.shape[1]}"
    return spec


def label(text: str) -> str:
    """Text for a figure: plotly reads tags in its labels, so that names must be escaped."""
    return html.escape(text, quote=False)


def line(x: NDArray[Any], y: NDArray[Any], *, name: str, colour: str, **more: Any) -> Spec:
    """A line; `x` keeps double precision since times may be long and finely sampled."""
    width = more.pop("width", 1.2)
    return {
        "type": "scatter",
        "mode": "lines",
        "x": packed(x, "f8"),
        "y": packed(y),
        "name": label(name),
        "line": {"color": colour, "width": width, **more.pop("line", {})},
        "hovertemplate": "%{x:.5g}, %{y:.4g}<extra>" + label(name) + "</extra>",
        **more,
    }


def swatch(name: str, colour: str) -> Spec:
    """A legend entry for shading, which has none in plotly."""
    return {
        "type": "scatter",
        "mode": "markers",
        "x": [None],
        "y": [None],
        "name": label(name),
        "marker": {"symbol": "square", "size": 12, "color": colour},
        "hoverinfo": "skip",
    }


def rectangle(x0: float, x1: float, colour: str, **more: Any) -> Spec:
    """A vertical band over the full height of the panels."""
    return {
        "type": "rect",
        "xref": "x",
        "yref": "paper",
        "x0": x0,
        "x1": x1,
        "y0": 0,
        "y1": 1,
        "fillcolor": colour,
        "line": {"width": 0},
        "layer": "below",
        **more,
    }


def axis(title: str, **more: Any) -> Spec:
    """An axis with its title, light grid and ticks outside."""
    return {
        "title": {"text": label(title), "standoff": 8},
        "gridcolor": GRID,
        "zerolinecolor": "#BDBDBD",
        "linecolor": "#9A9A9A",
        "ticks": "outside",
        "tickcolor": "#9A9A9A",
        "ticklen": 4,
        "automargin": True,
        **more,
    }


def layout(**more: Any) -> Spec:
    """Layout shared by all figures: white, legend above, room for labels."""
    return {
        "font": {"family": FONT, "size": 13, "color": INK},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "margin": {"l": 70, "r": 20, "t": 64, "b": 50},
        "hovermode": "closest",
        "legend": {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom", "itemsizing": "constant"},
        **more,
    }
