"""Commands are known without loading them."""

from __future__ import annotations

import pkgutil
import subprocess
import sys
from importlib import import_module, metadata

import pytest

import missing_physics.cli.commands
from missing_physics.cli import main
from missing_physics.cli.listing import SUMMARIES, loaded

HEAVY = {"casadi", "pandas", "rerun", "plotly", "exudyn", "pyarrow", "h5py", "scipy"}


def test_every_command_is_listed_by_the_words_of_its_own_help() -> None:
    package = missing_physics.cli.commands
    modules = [info.name for info in pkgutil.iter_modules(package.__path__)]
    commands = [name for name in modules if hasattr(import_module(f"{package.__name__}.{name}"), "register")]
    assert sorted(SUMMARIES) == sorted(commands)
    for name, summary in SUMMARIES.items():
        assert " ".join(loaded(name).help.split()).startswith(summary)


def test_help_names_every_command_and_loads_none() -> None:
    code = (
        "import sys, atexit; sys.argv = ['missing-physics', '--help']\n"
        "atexit.register(lambda: print(*sys.modules, file=sys.stderr))\n"
        "from missing_physics.__main__ import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert all(name in done.stdout for name in SUMMARIES)
    assert not HEAVY & {name.split(".")[0] for name in done.stderr.split()}


def test_the_version_is_that_of_the_package(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["missing-physics", "--version"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 0
    assert capsys.readouterr().out == f"missing-physics {metadata.version('missing-physics')}\n"


def test_unknown_command_is_reported(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["missing-physics", "diagnos"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    assert "diagnose" in capsys.readouterr().err
