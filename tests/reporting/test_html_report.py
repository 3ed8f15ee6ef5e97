"""The HTML report: well formed, self-contained, escaped, and consistent with the result."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest
from reporting_cases import empty_result, hidden_friction, two_link_arm
from unnamed_cases import drag, with_unnamed

from missing_physics.reporting import write_html
from missing_physics.reporting.elements.figures import Figure
from missing_physics.reporting.pages.html_report import render_html
from missing_physics.reporting.sections import SECTIONS
from missing_physics.results.result import Estimate, Result
from robot_model import InputError

VOID = {"meta", "br", "link", "img", "hr", "input"}
#: An element, an attribute's end, an entity, a script's end, and markup that plotly itself understands.
HOSTILE = "\"><script>alert(1)</script><img src=x onerror=alert(2)>'&amp;<a href='javascript:alert(3)'>y</a>"


class Page(HTMLParser):
    """Elements, visible text and JSON blocks of a page; fails when an element is not closed in order."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.scripts: list[str] = []
        self.figures: dict[str, dict[str, object]] = {}
        self.feed(text)
        self.close()
        assert not self.open, f"left open: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open[-1] == tag, f"</{tag}> closes <{self.open[-1]}>"
        self.open.pop()

    def handle_data(self, data: str) -> None:
        inside = self.open[-1] if self.open else ""
        last = self.elements[-1][1] if self.elements else {}
        if inside == "script" and last.get("type") == "application/json":
            self.figures[str(last["id"])] = json.loads(data)
        elif inside == "script":
            self.scripts.append(data)
        elif inside != "style":
            self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.words))


@pytest.fixture(scope="module")
def result() -> Result:
    return hidden_friction()


@pytest.fixture(scope="module")
def page(result: Result) -> Page:
    return Page(render_html(result, two_link_arm()))


def test_html_report_has_its_sections_in_order() -> None:
    page = Page(render_html(with_unnamed(drag()), two_link_arm()))
    anchors = [attributes["id"] for tag, attributes in page.elements if tag == "section"]
    assert anchors == [
        "verdict",
        "mismatch",
        "findings",
        "unnamed",
        "overlay",
        "residual_maps",
        "spectrum",
        "ladder",
        "parameters",
        "experiments",
        "limits",
        "method",
    ]
    assert len(anchors) == len(SECTIONS)


def test_html_report_loads_no_external_resource(page: Page) -> None:
    for tag, attributes in page.elements:
        assert tag not in {"link", "iframe", "object", "embed", "img", "base", "form"}
        assert "src" not in attributes
        if tag == "a":
            assert str(attributes["href"]).startswith("#")
        assert not [name for name in attributes if name.startswith("on")]
    style = Path("missing_physics/reporting/templates/style.css")
    text = (Path(__file__).parents[2] / style).read_text("utf-8")
    assert "url(" not in text
    assert "@import" not in text


def test_content_policy_allows_only_the_scripts_of_the_page(page: Page) -> None:
    policy = next(
        str(a["content"]) for t, a in page.elements if a.get("http-equiv") == "Content-Security-Policy"
    )
    digests = [base64.b64encode(hashlib.sha256(s.encode()).digest()).decode() for s in page.scripts]
    allowed = " ".join(f"'sha256-{digest}'" for digest in digests)
    assert len(digests) == 2
    assert policy.startswith("default-src 'none'; script-src ")
    assert f"script-src {allowed};" in policy
    assert "http" not in policy


def test_numbers_in_the_html_report_equal_the_result(page: Page, result: Result) -> None:
    text = page.text
    assert result.diagnosis.summary in text
    assert "Explained" in text
    for words in ("97 %", "98 %", "4.40 4.10 to 4.70 N m", "0.800 0.790 to 0.810 N m", "< 1e-12"):
        assert words in text, words
    fit = result.diagnosis.fit.channels["joint2.torque"]
    assert f"{fit.before.validation_rms:.2f} {fit.after.validation_rms:.4f}" in text
    for sentence in (*result.diagnosis.could_not_tell, *result.diagnosis.notes):
        assert sentence in text
    for finding in result.diagnosis.findings:
        for alternative in finding.alternatives:
            assert alternative.why_not in text
    for rung in result.ladder:
        assert rung.why in text


def test_changed_file_parameters_are_at_the_top_of_the_report(page: Page) -> None:
    """With the verdict, before the first section on what differs; what may be right is not there."""
    moved = "joint2.viscous_friction.coefficient 1.310 [1.270, 1.350] N m s/rad, in the robot file 1.200"
    assert page.text.index(moved) < page.text.index("Changes sign with the velocity of joint2")
    assert "link2.mass 4.020" not in page.text


def test_every_picture_is_one_that_plotly_accepts(page: Page) -> None:
    # `go.Figure` raises on an attribute or a value that the library does not know.
    for spec in page.figures.values():
        go.Figure(spec)  # type: ignore[arg-type]
    drawn = {a["data-spec"] for t, a in page.elements if "data-spec" in a}
    assert drawn == set(page.figures)


def test_drawn_series_equal_the_samples_of_the_result(page: Page, result: Result) -> None:
    figure = page.figures["time-0-spec"]
    series = next(s for s in result.series if s.channel == "joint2.torque" and s.role == "train")
    lines = {item["name"]: item for item in figure["data"]}  # type: ignore[attr-defined]
    for name, values in (
        ("measured", series.measured),
        ("augmented model (after)", series.augmented),
        ("residual before", series.measured - series.nominal),
    ):
        x, y = (_unpacked(lines[name][axis]) for axis in "xy")
        rows = np.searchsorted(series.time, x)
        assert np.array_equal(series.time[rows], x)
        # Drawn in single precision: half a unit in the last of 24 bits.
        assert np.allclose(y, values[rows], rtol=6e-8, atol=0)
        assert y.max() == np.float32(values.max())
        assert y.min() == np.float32(values.min())


@pytest.mark.parametrize("name", [HOSTILE, "<script>", "</script>", "<!--", "{{ 7*7 }}", "joint'\"2"])
def test_names_are_escaped_in_the_report(name: str) -> None:
    page = Page(render_html(hidden_friction(seconds=2.0, name=name), two_link_arm()))
    clean = Page(render_html(hidden_friction(seconds=2.0, name="plain"), two_link_arm()))
    assert [tag for tag, _ in page.elements] == [tag for tag, _ in clean.elements]
    assert page.scripts == clean.scripts
    assert re.sub(r"\s+", " ", name) in page.text
    for spec in page.figures.values():
        shown = json.dumps([item.get("name", "") for item in spec["data"]] + [spec["layout"]])  # type: ignore[attr-defined]
        assert "<script" not in shown
        assert "<img" not in shown
        assert "<a href" not in shown


def test_figure_text_cannot_close_its_script() -> None:
    data = [{"name": HOSTILE, "text": ["</script>", "<!--", "&lt;"]}]
    text = Figure("x", data, {}).json
    assert not set("<>&") & set(text)
    assert json.loads(text)["data"] == data


@pytest.mark.parametrize("verdict", ["consistent", "not_enough_data", "unexplained", "ambiguous"])
@pytest.mark.parametrize("series", [True, False])
def test_html_report_renders_all_verdicts(verdict: str, series: bool) -> None:
    result = empty_result(verdict, series=series)  # type: ignore[arg-type]
    text = Page(render_html(result, two_link_arm())).text
    assert f"A summary that says {verdict}." in text
    assert {"consistent": "Consistent", "not_enough_data": "Not enough data"}.get(verdict, "") in text
    assert ("There is no series to draw" in text) is not series


def test_rivals_are_listed_for_ambiguous_findings() -> None:
    result = hidden_friction(seconds=2.0)
    first, *others = result.diagnosis.findings
    rivals = replace(first, ambiguous_with=("lugre_friction",))
    changed = replace(result.diagnosis, verdict="ambiguous", findings=(rivals, *others))
    text = Page(render_html(replace(result, diagnosis=changed), two_link_arm())).text
    assert "These data cannot distinguish it from" in text


def scattered(result: Result) -> Result:
    """The same with an effect at another place between its two findings, and more at that place."""
    friction, offset = result.diagnosis.findings
    others = tuple(
        replace(offset, effect=effect, location="joint1") for effect in ("cable_spring", "torque_ripple")
    )
    findings = (friction, others[0], offset, others[1], replace(offset, effect="payload", location="link2"))
    return replace(result, diagnosis=replace(result.diagnosis, findings=findings))


def test_findings_are_grouped_by_place(result: Result) -> None:
    text = Page(render_html(scattered(result), two_link_arm())).text
    first = (
        "joint2 Coulomb friction 97 %, Torque offset > 99.9 % joint1 Cable or hose spring > 99.9 %, Torque"
    )
    assert first in text
    below = [
        text.index(f"{name} at {place}", text.index("What the simulation leaves out"))
        for name, place in (
            ("Coulomb friction", "joint2"),
            ("Torque offset", "joint2"),
            ("Cable or hose spring", "joint1"),
        )
    ]
    assert below == sorted(below)


def test_long_text_answer_is_collapsed(page: Page, result: Result) -> None:
    long = Page(render_html(scattered(result), two_link_arm()))
    folded = "The answer in one paragraph"
    assert folded in long.text
    assert folded not in page.text
    assert result.diagnosis.summary in long.text


def test_equivalent_candidates_are_listed_once(result: Result) -> None:
    again = replace(result, ladder=(*result.ladder, *result.ladder))
    own, twice = (Page(render_html(found, two_link_arm())) for found in (result, again))
    assert twice.figures["ladder-bars-spec"] == own.figures["ladder-bars-spec"]
    assert twice.text.count("lowers the held-out error most") == 1


def test_tried_curve_is_not_listed_as_an_effect(result: Result) -> None:
    rung = replace(result.ladder[0], effect="unknown_of_direction_and_position")
    text = Page(render_html(replace(result, ladder=(rung,)), two_link_arm())).text
    assert "Force without a name, over direction and position" in text


def test_torque_fractions_are_listed_before_those_of_encoders(result: Result) -> None:
    torque = result.diagnosis.mismatch[0]
    gap = replace(torque, channel="joint1.position", location="joint1", share=1.0, words="")
    both = replace(result.diagnosis, mismatch=(gap, torque))
    text = Page(render_html(replace(result, diagnosis=both), two_link_arm())).text
    start = text.index("Where the recording and the nominal robot differ", text.index("Spectral peaks") - 900)
    assert text.index("joint2.torque", start) < text.index("joint1.position", start)
    assert "of the differences of encoders each by itself" in text


def test_report_handles_missing_numbers() -> None:
    result = hidden_friction(seconds=2.0)
    nan = float("nan")
    finding = replace(result.diagnosis.findings[0], parameters={"torque": Estimate(nan, (nan, nan), "N m")})
    gaps = tuple(replace(s, nominal=np.where(s.time < 1, np.nan, s.nominal)) for s in result.series)
    empty = tuple(replace(s, augmented=np.full_like(s.time, np.nan)) for s in gaps)
    changed = replace(result, series=empty, diagnosis=replace(result.diagnosis, findings=(finding,)))
    Page(render_html(changed, two_link_arm()))


def test_long_recordings_stay_small() -> None:
    # Six joints at 100,000 samples; the budget of the page is 8 MB, of which plotly.js takes 5.
    result = hidden_friction(seconds=200.0)
    first = result.series[1]
    series = tuple(
        replace(first, channel=f"joint{n}.torque", location=f"joint{n}", role="train") for n in range(1, 7)
    )
    assert first.time.size == 100_000
    text = render_html(replace(result, series=series), two_link_arm())
    assert len(text.encode()) < 8e6


def test_many_recordings_stay_small_and_report_omissions() -> None:
    result = hidden_friction(seconds=10.0)
    series = tuple(replace(result.series[1], recording=f"run_{n}.csv") for n in range(200))
    text = render_html(replace(result, series=series), two_link_arm())
    assert len(text.encode()) < 8e6
    assert "176 more series are in comparison.rrd" in text


def test_same_result_gives_the_same_page(result: Result) -> None:
    assert render_html(result, two_link_arm()) == render_html(result, two_link_arm())


def test_writing_is_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "report.html"
    path.write_text("old")
    broken = replace(hidden_friction(seconds=2.0), series=(object(),))  # type: ignore[arg-type]
    with pytest.raises(AttributeError):
        write_html(broken, two_link_arm(), path)
    assert path.read_text() == "old"
    assert [item.name for item in tmp_path.iterdir()] == ["report.html"]
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write"):
        write_html(hidden_friction(seconds=2.0), two_link_arm(), tmp_path / "file" / "report.html")


def _unpacked(packed: dict[str, str]) -> np.ndarray:
    return np.frombuffer(base64.b64decode(packed["bdata"]), np.dtype(packed["dtype"]).newbyteorder("<"))
