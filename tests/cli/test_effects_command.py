"""An effect's page in the terminal, with its plot, and as a file."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from html import unescape
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from rich.text import Text

from benchmarks.signatures.cases import CASES
from missing_physics.cli import UNUSABLE_INPUT, main
from missing_physics.cli.commands.effects import WIDEST, description, print_page
from missing_physics.reporting.pages.effect_page import render_effect
from missing_physics.reporting.terminal.console import PlainConsole
from missing_physics.reporting.terminal.plot import LINES, Plot, drawn, read
from reference_model.effects.catalogue import catalogue, get_effect
from reference_model.effects.coulomb_friction import CoulombFriction
from reference_model.effects.page import facts, picture_of

BRAILLE = re.compile("[\u2801-\u28ff]")
Run = Callable[..., tuple[int, str, str]]
HEADING = "In a simulation:"


class Foreign(CoulombFriction):
    """An effect of another package, whose texts are not to be trusted."""

    id = "foreign"
    title = "<script>alert(1)</script>"
    equation = "T = <b>q</b> & more"
    source = "<img src=x>"


Foreign.__module__ = "elsewhere"


def plot_of(effect_id: str) -> Plot:
    picture = picture_of(get_effect(effect_id))
    assert picture is not None
    return read(picture.read_text("utf-8"))


def printed(effect_id: str, *, encoding: str = "utf-8", width: int = 80) -> str:
    data = io.BytesIO()
    stream = io.TextIOWrapper(data, encoding=encoding, write_through=True)
    print_page(PlainConsole(file=stream, width=width), get_effect(effect_id))
    return data.getvalue().decode(encoding)


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    def of(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["missing-physics", "effects", *words])
        with pytest.raises(SystemExit) as end:
            main()
        code = end.value.code
        return int(code or 0) if not isinstance(code, str) else 1, *capsys.readouterr()

    return of


@pytest.mark.parametrize("effect_id", list(catalogue()))
def test_every_picture_is_drawn_with_characters(effect_id: str) -> None:
    plot = plot_of(effect_id)
    assert [curve.label for curve in plot.curves] in (["with"], ["without", "with"])
    assert plot.title.startswith(effect_id)
    assert all(len(curve.x) == len(curve.y) > 50 for curve in plot.curves)
    lines = Text.from_ansi(drawn(plot, columns=64)).plain.rstrip("\n").split("\n")
    assert len(lines) <= LINES
    assert all(len(line) <= 64 for line in lines)
    text = "\n".join(lines)
    assert len(BRAILLE.findall(text)) > 20
    assert ("···" in text) == (len(plot.curves) == 2)
    for words in (plot.x_label, plot.y_label, *(word for _, word in plot.y_marks)):
        assert words in text


def test_terminal_plot_shows_the_values_of_the_simulation() -> None:
    plot = plot_of("coulomb_friction")
    (low, low_word), *_, (high, high_word) = plot.y_marks
    scale = (float(high_word) - float(low_word)) / (high - low)
    without, real = (float(low_word) + scale * (np.array(curve.y) - low) for curve in plot.curves)
    torque = CASES["coulomb_friction"].values["torque"]
    assert np.abs(without).max() < 0.02 * torque
    assert [real.min(), real.max()] == pytest.approx([-torque, torque], rel=0.02)
    lines = Text.from_ansi(drawn(plot, columns=60)).plain.split("\n")
    level = [line for line in lines[2:-3] if len(BRAILLE.findall(line)) > 10]
    forwards, backwards = (BRAILLE.search(line) for line in (level[0], level[-1]))
    assert forwards is not None
    assert backwards is not None
    assert backwards.start() < 5 < 25 < forwards.start(), "forwards above on the right"


def test_a_page_in_the_terminal_ends_with_its_plot() -> None:
    text = printed("stribeck_friction", width=200)
    plot = text.split(HEADING)[1]
    assert BRAILLE.search(plot)
    assert max(map(len, plot.rstrip().split("\n"))) <= WIDEST
    assert "rad/s" in plot.rstrip().split("\n")[-1]
    assert "\x1b" not in text, "no colours where there is no terminal"


@pytest.mark.parametrize("effect_id", list(catalogue()))
def test_terminal_without_plot_characters_gets_text_only(effect_id: str) -> None:
    for text in (printed(effect_id, encoding="ascii"), printed(effect_id, encoding="latin-1")):
        assert HEADING not in text
        assert get_effect(effect_id).id in text
    assert HEADING not in printed(effect_id, width=30)


class Page(HTMLParser):
    """What a page consists of, and what it would load."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.loads: list[str] = []
        self.words = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.loads += [str(value) for name, value in attrs if name in ("src", "href", "xlink:href")]

    def handle_data(self, data: str) -> None:
        self.words += data


@pytest.mark.parametrize("effect_id", ["lugre_friction", "contact", "clock_drift"])
def test_effect_page_is_self_contained(effect_id: str, run: Run, tmp_path: Path) -> None:
    out = tmp_path / "new" / "page.html"
    assert run(effect_id, "--out", str(out)) == (0, f"{out}\n", "")
    page, effect = Page(out.read_text("utf-8")), get_effect(effect_id)
    assert [path.name for path in out.parent.iterdir()] == ["page.html"]
    for text in (effect.title, effect.equation, *facts(effect), *facts(effect).values()):
        assert text in page.words
    for parameter in effect.parameters:
        assert parameter.name in page.words
        assert parameter.meaning in page.words
    assert page.tags.count("svg") == 1
    assert page.tags.count("path") > 5
    assert page.loads == []
    assert not {"script", "link", "iframe", "img"} & set(page.tags)
    assert "default-src 'none'" in unescape(out.read_text("utf-8"))


def test_pages_of_all_effects_go_into_a_folder(run: Run, tmp_path: Path) -> None:
    code, message, _ = run("--out", str(tmp_path / "all"))
    assert code == 0
    assert {path.stem for path in (tmp_path / "all").iterdir()} == set(catalogue())
    assert len(message.split()) == len(catalogue())
    assert run("slosh", "--out", str(tmp_path))[1] == f"{tmp_path / 'slosh.html'}\n"


def test_unwritable_page_is_rejected_with_one_sentence(run: Run, tmp_path: Path) -> None:
    code, message, why = run("--out", str(tmp_path / "page.html"))
    assert (code, message) == (UNUSABLE_INPUT, "")
    assert "name its effect" in why
    (tmp_path / "file").write_text("mine")
    code, message, why = run("slosh", "--out", str(tmp_path / "file"))
    assert (code, message) == (UNUSABLE_INPUT, "")
    assert "cannot write" in why
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("file", "mine")]


def test_effect_texts_of_other_packages_are_escaped_without_picture() -> None:
    effect = Foreign()
    page = Page(render_effect(effect))
    assert not {"script", "img", "b", "svg"} & set(page.tags)
    assert effect.title in page.words
    assert effect.equation in page.words
    assert description(effect)["plot"] is None
    stream = io.StringIO()
    print_page(PlainConsole(file=stream, width=120), effect)
    assert HEADING not in stream.getvalue()
