"""Commands print text unchanged: brackets, codes and control characters included."""

from __future__ import annotations

import ast
import io
import shutil
from pathlib import Path

import numpy as np
import pytest
from rich.table import Table
from rich.text import Text

from missing_physics.cli import main
from missing_physics.reporting.terminal.console import PlainConsole, styled

COMMANDS = Path(__file__).parents[2] / "missing_physics" / "cli"


def printed(*words: object, table: bool = False) -> str:
    stream = io.StringIO()
    console = PlainConsole(file=stream, width=200)
    for word in words:
        if table:
            grid = Table.grid()
            grid.add_row(word)
            word = grid
        console.print(word)
    return stream.getvalue()


@pytest.mark.parametrize("name", ["[time]", "x[/y].csv", "[bold]b[/bold]", ":warning:", "[link=a]b", "a[0]"])
@pytest.mark.parametrize("table", [False, True])
def test_text_is_not_interpreted_as_markup(name: str, table: bool) -> None:
    assert printed(name, table=table).rstrip() == name
    assert printed(styled(("a ", "bold"), name)).rstrip() == f"a {name}"


@pytest.mark.parametrize("name", ["a\x1b[31mred", "a\rb", "a\x07b", "a\x9b2Jb"])
def test_control_characters_do_not_reach_the_terminal(name: str) -> None:
    for shown in (printed(name), printed(Text(name)), printed(name, table=True)):
        assert all(c == "\n" or c.isprintable() for c in shown)
        assert shown.startswith("a")


@pytest.mark.parametrize("name", ["x[/y].csv", "[bold red].csv", ":warning:.csv", "a\x1b[31mred.csv"])
def test_file_names_are_printed_unchanged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    time = np.arange(200) / 100
    rows = "\n".join(f"{t},{np.sin(t)},{np.cos(t)}" for t in time)
    path.write_text(f"time,joint1.position,joint1.torque\n{rows}\n")
    monkeypatch.setattr("sys.argv", ["missing-physics", "inspect", str(path)])
    with pytest.raises(SystemExit) as left:
        main()
    out = capsys.readouterr().out
    assert left.value.code == 0
    assert name.replace("\x1b", "\N{REPLACEMENT CHARACTER}") in out
    shutil.rmtree(tmp_path)


def test_text_in_brackets_is_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Seconds that are milliseconds: the table of the map in which to say so stands in the sentence."""
    path = tmp_path / "log.csv"
    rows = "\n".join(f"{10 * k},{np.sin(k / 30)},{np.cos(k / 30)}" for k in range(300))
    path.write_text(f"time,joint1.position,joint1.torque\n{rows}\n")
    monkeypatch.setattr("sys.argv", ["missing-physics", "inspect", str(path)])
    with pytest.raises(SystemExit) as left:
        main()
    message = capsys.readouterr()
    assert left.value.code == 2
    assert "scale = 0.001 in [time]" in message.out
    assert "scale = 0.001 in [time]" in message.err


@pytest.mark.parametrize("path", sorted(COMMANDS.rglob("*.py")), ids=lambda path: path.stem)
def test_every_command_prints_on_this_console(path: Path) -> None:
    """A console of the library's own would read names as markup."""
    if path.stem == "console":
        return
    used = {
        alias.name
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("rich")
        for alias in node.names
    }
    assert not used & {"Console", "escape", "print", "render"}
