"""Ctrl-C, other signals and closed pipes end a command with the exit code that a shell expects."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
import typer

from missing_physics import cli
from missing_physics.cli.interrupts import AGAIN
from missing_physics.cli.listing import Commands

#: Longer than any of these waits on a busy machine [s].
PATIENCE = 60.0


def ended(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["missing-physics", *words])
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert isinstance(end.value.code, int)
    return end.value.code


def running(monkeypatch: pytest.MonkeyPatch, command: Callable[[], None]) -> int:
    """Exit code of the command line with this as its only command."""
    app = typer.Typer(cls=Commands)
    app.command("run")(command)
    app.command("other")(lambda: None)
    monkeypatch.setattr(cli, "app", app)
    return ended(monkeypatch, "run")


def interrupt(kind: signal.Signals = signal.SIGINT) -> None:
    os.kill(os.getpid(), kind)


@pytest.fixture(autouse=True)
def _default_handlers() -> Iterator[None]:
    """These tests may run under nohup, which is respected."""
    before = {kind: signal.signal(kind, signal.SIG_DFL) for kind in (signal.SIGTERM, signal.SIGHUP)}
    yield
    for kind, handler in before.items():
        signal.signal(kind, handler)


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (signal.SIGINT, "missing-physics: interrupted.\n"),
        (signal.SIGTERM, "missing-physics: ended by SIGTERM.\n"),
        (signal.SIGHUP, "missing-physics: ended by SIGHUP.\n"),
    ],
)
def test_signal_gives_one_sentence_and_its_exit_code(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], kind: signal.Signals, words: str
) -> None:
    assert running(monkeypatch, lambda: interrupt(kind)) == 128 + kind
    assert capsys.readouterr() == ("", words)


def test_interrupt_dropped_by_a_library_is_raised_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """CasADi drops it wherever it asks Python for an attribute of an operand."""

    def command() -> None:
        with suppress(KeyboardInterrupt):
            interrupt()
        threading.Event().wait(PATIENCE)

    assert running(monkeypatch, command) == 130


def test_interrupt_converted_to_another_exception_is_raised_again(monkeypatch: pytest.MonkeyPatch) -> None:
    def command() -> None:
        try:
            with suppress(KeyboardInterrupt):
                interrupt()
            raise RuntimeError("the right-hand side failed")
        except RuntimeError:
            threading.Event().wait(PATIENCE)

    assert running(monkeypatch, command) == 130


def test_cleanup_after_an_interrupt_is_not_interrupted(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []

    def command() -> None:
        try:
            interrupt()
        finally:
            threading.Event().wait(5 * AGAIN)
            done.append("tidied")

    assert running(monkeypatch, command) == 130
    assert done == ["tidied"]


def test_no_timer_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    before = signal.getsignal(signal.SIGALRM)
    assert running(monkeypatch, interrupt) == 130
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    assert signal.getsignal(signal.SIGALRM) is before


def test_interrupt_while_libraries_are_loaded_gives_one_sentence() -> None:
    program = (
        "import os, signal, sys\n"
        "class Interrupt:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'missing_physics.cli': os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupt())\n"
        "from missing_physics.__main__ import main; main()"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=PATIENCE)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


RECORDING = "time,joint1.position,joint1.torque\n" + "".join(
    f"{k / 100},{k * k % 7},{k % 5}\n" for k in range(200)
)


@pytest.mark.parametrize(
    "words",
    [
        ["inspect", "s.csv"],
        ["inspect", "s.csv", "--json"],
        ["effects"],
        ["effects", "backlash"],
        ["effects", "--json"],
        ["datasets", "list"],
        ["--help"],
        ["diagnose", "--help"],
    ],
)
def test_closed_pipe_ends_the_program_silently(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, words: list[str]
) -> None:
    """Without a word, and with what a shell says of a program that SIGPIPE has ended."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.csv").write_text(RECORDING)
    reader, writer = os.pipe()
    os.close(reader)
    with open(writer, "w") as printed, (tmp_path / "errors").open("w+") as errors:
        monkeypatch.setattr(sys, "stdout", printed)
        monkeypatch.setattr(sys, "stderr", errors)
        assert ended(monkeypatch, *words) == 141
        printed.flush()  # what was kept back meets no closed pipe any more
        errors.seek(0)
        assert errors.read() == ""
