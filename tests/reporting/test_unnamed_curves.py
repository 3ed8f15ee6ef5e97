"""Unnamed curves: their figures, their pictures in the rerun file, their sentences in the summary."""

from __future__ import annotations

import base64
import io
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest
from numpy.typing import NDArray
from reporting_cases import empty_result, hidden_friction, two_link_arm
from rerun.chunk import RrdReader
from rich.console import Console
from unnamed_cases import drag, roughness, with_unnamed

from missing_physics.reporting import print_summary, write_rerun
from missing_physics.reporting.elements.curves import drawn
from missing_physics.reporting.pages.html_report import render_html
from missing_physics.reporting.sections.plots.unnamed import section
from missing_physics.results.result import Unnamed

Array = NDArray[np.float64]
CASES = (drag, roughness)
HOSTILE = (
    "\"></script><script>alert(1)</script><img src=x onerror=alert(2)><a href='javascript:alert(3)'>y</a>"
)
#: Figures are drawn in single precision.
SINGLE = 1e-6


def spec_of(item: Unnamed) -> dict:  # type: ignore[type-arg]
    made = section(with_unnamed(item), two_link_arm())
    assert made is not None
    [figure] = made.figures
    return dict(json.loads(figure.json))


def unpacked(packed: dict[str, str]) -> Array:
    values = np.frombuffer(base64.b64decode(packed["bdata"]), np.dtype(packed["dtype"]).newbyteorder("<"))
    shape = packed.get("shape")
    return values.reshape([int(n) for n in shape.split(",")]) if shape else values


def test_no_curve_is_reported_if_everything_is_named() -> None:
    assert section(hidden_friction(seconds=2.0), two_link_arm()) is None


@pytest.mark.parametrize("case", CASES)
def test_figure_is_one_that_plotly_accepts(case: Callable[[], Unnamed]) -> None:
    go.Figure(spec_of(case()))  # raises on what the library does not know


def test_curve_is_drawn_at_its_knots() -> None:
    item = drag()
    [curve] = [entry for entry in spec_of(item)["data"] if "name" in entry]
    assert np.array_equal(unpacked(curve["x"]), item.knots[0])
    assert np.allclose(unpacked(curve["y"]), item.curves[0].torque, rtol=SINGLE)


def test_band_holds_the_interval() -> None:
    item = drag()
    [area] = [entry for entry in spec_of(item)["data"] if entry.get("fill") == "toself"]
    x, y = unpacked(area["x"]), unpacked(area["y"])
    half = x.size // 2
    assert np.allclose(x[:half], x[half:][::-1])
    low, high = np.array(item.curves[0].ci95).T
    assert np.allclose(y[:half], high, rtol=SINGLE)
    assert np.allclose(y[half:][::-1], low, rtol=SINGLE)


def test_curve_axes_have_labels_and_units() -> None:
    layout = spec_of(drag())["layout"]
    assert layout["xaxis"]["title"]["text"] == "joint2's velocity [rad/s]"
    assert layout["yaxis"]["title"]["text"] == "joint2.torque [N m]"
    text = render_html(with_unnamed(drag()), two_link_arm())
    assert "Torque of joint2 beyond the model, over joint2&#39;s velocity" in text
    assert drag().words in text


@pytest.mark.parametrize("case", CASES)
def test_names_of_curves_are_escaped(case: Callable[[], Unnamed]) -> None:
    text = render_html(with_unnamed(case(), name=HOSTILE), two_link_arm())
    assert not re.search(r"<(img|a href=.javascript)", text)
    assert text.count("alert(1)") == text.count("alert(1)&lt;") + text.count("alert(1)\\u0026lt;")
    for block in re.findall(r'<script type="application/json" id="unnamed.*?</script>', text, re.DOTALL):
        message = json.dumps(json.loads(block.split(">", 1)[1].removesuffix("</script>")))
        assert "<" not in re.sub("</?extra>", "", message)  # what plotly would read as a tag


def test_rerun_file_contains_each_curve_unchanged(tmp_path: Path) -> None:
    """Also where both are forces of one joint."""
    items, target = [case() for case in CASES], tmp_path / "both.rrd"
    write_rerun(with_unnamed(*items), two_link_arm(), target)
    paths = {chunk.entity_path for chunk in RrdReader(target).stream()}
    for order, item in enumerate(items, 1):
        path = f"/unnamed/joint2.torque/curve{order}"
        held, curve = held_by(target, path), drawn(item, two_link_arm())
        for name in ("knots", "value", "low", "high"):
            assert np.array_equal(held[name], getattr(curve, name)), (path, name)
        assert {f"{path}/value", f"{path}/low", f"{path}/high", f"{path}/frame"} <= paths
    assert len(RrdReader(target).blueprints()) == 1


def held_by(target: Path, path: str) -> dict[str, Array]:
    """Numbers that lie beside the lines of an entity."""
    found: dict[str, Array] = {}
    for chunk in RrdReader(target).stream():
        if chunk.entity_path != path:
            continue
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name in ("knots", "value", "low", "high"):
                found[name] = np.array(batch.column(name).to_pylist()[0], dtype=float)
    return found


@pytest.mark.parametrize("name", ["<script>alert(1)</script>", "a/b c\\d", "..", "joint 2.[torque]\n"])
def test_any_name_makes_a_valid_file(name: str, tmp_path: Path) -> None:
    target = tmp_path / "named.rrd"
    write_rerun(with_unnamed(drag(), name=name), two_link_arm(), target)
    assert [c for c in RrdReader(target).stream() if c.entity_path.startswith("/unnamed")]


def printed(*items: Unnamed) -> str:
    out = io.StringIO()
    print_summary(with_unnamed(*items), Console(file=out, width=100))
    return " ".join(out.getvalue().split())


def test_summary_reports_curves_between_findings_and_fit() -> None:
    text = printed(drag(), roughness())
    places = [text.find(words) for words in ("What is missing", "Forces without a name", "On held-out data")]
    assert -1 not in places
    assert places == sorted(places)
    assert drag().words in text
    assert roughness().words in text
    assert "Forces without a name" not in printed()


def test_curve_is_drawn_without_findings() -> None:
    bare = empty_result("unexplained", series=True)
    left = replace(bare, diagnosis=replace(bare.diagnosis, unnamed=(drag(),)))
    text = render_html(left, two_link_arm())
    assert text.index('id="findings"') < text.index('id="unnamed-0"') < text.index('id="overlay"')
