"""What stays without a name: its figures, its pictures in the rerun file, its words in the summary."""

from __future__ import annotations

import base64
import io
import json
import re
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest
from numpy.typing import NDArray
from reporting_cases import empty_result, hidden_friction, two_link_arm
from rerun.chunk import RrdReader
from rich.console import Console
from unnamed_cases import drag, law_that_changes, surface, wandering, with_unnamed

from missing_physics.reporting import print_summary, write_rerun
from missing_physics.reporting.elements.curves import panels, variables
from missing_physics.reporting.pages.html_report import render_html
from missing_physics.reporting.sections.plots.unnamed import section
from missing_physics.results.result import Unnamed

Array = NDArray[np.float64]
CASES = (drag, wandering, surface)
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


def test_nothing_is_said_where_everything_has_its_name() -> None:
    assert section(hidden_friction(seconds=2.0), two_link_arm()) is None


@pytest.mark.parametrize("case", CASES)
def test_figure_is_one_that_plotly_accepts(case: Callable[[], Unnamed]) -> None:
    go.Figure(spec_of(case()))  # raises on what the library does not know


def test_each_direction_is_drawn_on_its_side_of_rest_where_it_was_measured() -> None:
    item = drag()
    lines = {entry["name"]: entry for entry in spec_of(item)["data"] if "name" in entry}
    forwards, backwards = lines["moving forwards"], lines["moving backwards"]
    assert np.allclose(unpacked(forwards["x"]), [0.0, 0.3, 0.9, 1.4, 2.1])
    assert np.allclose(unpacked(backwards["x"]), [-2.0, -1.5, -1.0, -0.4, 0.0])
    assert np.allclose(unpacked(forwards["y"])[1:], item.curves[0].torque[4:], rtol=SINGLE)
    # The line between the knots beside rest, read at rest.
    ends = item.curves[0].torque[3:5]
    assert unpacked(forwards["y"])[0] == pytest.approx(ends[0] + 0.4 / 0.7 * (ends[1] - ends[0]), rel=SINGLE)
    assert np.isnan(unpacked(backwards["y"])[0])
    assert np.isfinite(unpacked(backwards["y"])[1:]).all()


def test_band_holds_the_interval() -> None:
    item = drag()
    areas = [entry for entry in spec_of(item)["data"] if entry.get("fill") == "toself"]
    assert len(areas) == 2
    x, y = unpacked(areas[0]["x"]), unpacked(areas[0]["y"])
    half = x.size // 2
    assert np.allclose(x[:half], x[half:][::-1])
    low, high = np.array(item.curves[0].ci95[4:]).T
    assert np.allclose(y[1:half], high, rtol=SINGLE)
    assert np.allclose(y[half:][::-1][1:], low, rtol=SINGLE)


def test_axes_have_words_and_units() -> None:
    layout = spec_of(drag())["layout"]
    assert layout["xaxis"]["title"]["text"] == "joint2's velocity [rad/s]"
    assert layout["yaxis"]["title"]["text"] == "joint2.torque [N m]"
    text = render_html(with_unnamed(drag()), two_link_arm())
    assert "What joint2 takes beyond the model, over joint2&#39;s velocity" in text
    assert drag().words in text


def test_parts_of_a_force_over_time_have_a_panel_and_a_unit_each() -> None:
    layout = spec_of(wandering())["layout"]
    titles = [layout[f"yaxis{n}"]["title"]["text"] for n in ("", "2", "3")]
    assert titles == ["joint2.torque [N m]", "joint2.torque [N m]", "joint2.torque [N m s/rad]"]
    assert "yaxis4" not in layout  # of the fourth the data tell nothing
    assert [note["text"] for note in layout["annotations"]] == [
        "whatever the motion",
        "along the direction of motion",
        "in proportion to velocity",
    ]
    domains = [layout[f"yaxis{n}"]["domain"] for n in ("", "2", "3")]
    for above, below in pairwise(domains):
        assert 0.0 <= below[0] < below[1] < above[0] < above[1] <= 1.0


def test_surface_lies_between_its_knots_and_leaves_out_what_is_not_reported() -> None:
    item = surface()
    maps = [entry for entry in spec_of(item)["data"] if entry["type"] == "heatmap"]
    assert len(maps) == 4
    x, y, z = (unpacked(maps[0][key]) for key in "xyz")
    value = np.array(item.curves[0].torque).reshape(5, 4)
    # bilinear by hand at a grid point within one cell
    row, column = int(np.searchsorted(y, 0.3)), int(np.searchsorted(x, 1.1))
    q, v = y[row], x[column]
    a, b = (q - 0.0) / 0.5, (v - 2 / 3) / (4 / 3)
    cell = value[2:4, 2:4]
    expected = (1 - a) * ((1 - b) * cell[0, 0] + b * cell[0, 1]) + a * ((1 - b) * cell[1, 0] + b * cell[1, 1])
    assert z[row, column] == pytest.approx(expected, rel=SINGLE)
    assert np.isnan(z[0, 0])
    assert np.isfinite(z[-1]).all()
    half = unpacked(maps[1]["z"])
    assert np.nanmin(half) >= 0.1 * (1 - SINGLE)


def test_law_whose_numbers_change_has_its_words_and_no_figure() -> None:
    made = section(with_unnamed(law_that_changes()), two_link_arm())
    assert made is not None
    assert made.figures == []
    assert law_that_changes().words in render_html(with_unnamed(law_that_changes()), two_link_arm())


@pytest.mark.parametrize("case", CASES)
def test_names_are_text_and_nothing_else(case: Callable[[], Unnamed]) -> None:
    text = render_html(with_unnamed(case(), name=HOSTILE), two_link_arm())
    assert not re.search(r"<(img|a href=.javascript)", text)
    assert text.count("alert(1)") == text.count("alert(1)&lt;") + text.count("alert(1)\\u0026lt;")
    for block in re.findall(r'<script type="application/json" id="unnamed.*?</script>', text, re.DOTALL):
        said = json.dumps(json.loads(block.split(">", 1)[1].removesuffix("</script>")))
        assert "<" not in re.sub("</?extra>", "", said)  # what plotly would read as a tag


def test_rerun_file_holds_each_curve_as_it_is(tmp_path: Path) -> None:
    for case in CASES:
        item, target = case(), tmp_path / f"{case.__name__}.rrd"
        write_rerun(with_unnamed(item), two_link_arm(), target)
        chunks = {
            c.entity_path: c for c in RrdReader(target).stream() if c.entity_path.startswith("/unnamed")
        }
        number = 0
        for panel in panels(item, two_link_arm()):
            for band in panel.bands:
                if case is not drag or band is panel.bands[0]:
                    number += 1
                path = f"/unnamed/joint2.torque/part{number}/{band.carrier or 'curve'}"
                held = held_by(target, path)
                for name in ("value", "low", "high"):
                    expected = getattr(band, name).ravel()
                    assert np.allclose(held[name], expected, equal_nan=True), (path, name)
                over = [v.knots for v in variables(item, two_link_arm())]
                assert np.allclose(held["knots1"], band.knots if len(over) == 1 else over[0])
                assert f"{path}/value" in chunks
        assert not [path for path in chunks if "torque/part4" in path]
        assert len(RrdReader(target).blueprints()) == 1


def held_by(target: Path, path: str) -> dict[str, Array]:
    """Numbers that lie beside the lines of an entity."""
    found: dict[str, Array] = {}
    for chunk in RrdReader(target).stream():
        if chunk.entity_path != path:
            continue
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name in ("value", "low", "high", "knots1", "knots2"):
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


def test_summary_says_it_between_what_was_named_and_the_fit() -> None:
    text = printed(drag(), law_that_changes())
    places = [text.find(words) for words in ("What is missing", "Forces without a name", "On held-out data")]
    assert -1 not in places
    assert places == sorted(places)
    assert text.count(drag().words) == 2
    assert "Forces without a name" not in printed()


def test_intervals_without_an_end_are_none_in_the_file() -> None:
    [held] = with_unnamed(drag()).diagnosis.to_dict()["unnamed"]
    assert held["curves"][0]["ci95"][0] == [None, None]
    assert None not in held["curves"][0]["ci95"][-1]


def test_it_is_drawn_where_nothing_was_named() -> None:
    bare = empty_result("unexplained", series=True)
    left = replace(bare, diagnosis=replace(bare.diagnosis, unnamed=(drag(),)))
    text = render_html(left, two_link_arm())
    assert text.index('id="findings"') < text.index('id="unnamed-0"') < text.index('id="overlay"')
