"""A complete challenge with real processes, and on a dask cluster of which a worker is killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from challenge_cases import AXIS, hiding, truth
from typer.testing import CliRunner

from missing_physics import cli
from missing_physics.challenge import Settings, course, run, show
from missing_physics.challenge.processes import stage, workers
from missing_physics.challenge.processes.stage import Outcome
from missing_physics.challenge.processes.workers import Work, carried_out
from missing_physics.cli import app
from robot_model import InputError

distributed = pytest.importorskip("distributed")

SLOW_ANSWER = "import time, pathlib; time.sleep(1.5); pathlib.Path('../out/diagnosis.json').write_text('x')"


def sleeping(step: str, folder: Path, hidden: object) -> list[str]:
    return [sys.executable, "-c", SLOW_ANSWER]


def carry_out_asleep(*args: Any, **kwargs: Any) -> Outcome:
    """What a worker runs: the real step, with a process that sleeps in place of the diagnosis."""
    from missing_physics.challenge.processes import stage

    stage._command = sleeping
    return stage.carry_out(*args, **kwargs)


@pytest.mark.proof
def test_a_dask_worker_that_is_killed_loses_no_case(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("missing_physics.challenge.processes.workers.carry_out", carry_out_asleep)
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        work = Work("diagnose", scheduler=cluster.scheduler_address)
        pids = [worker.pid for worker in cluster.workers.values()]
        outcomes = {}
        for name, outcome in carried_out(work, iter([(n, {"name": n.encode()}) for n in "abcdef"])):
            outcomes[name] = outcome
            if len(outcomes) == 1:
                os.kill(pids[0], signal.SIGKILL)
        assert {name: outcome.status for name, outcome in outcomes.items()} == dict.fromkeys("abcdef", "done")


FOREVER = "import time, pathlib; pathlib.Path({0!r}).joinpath(str(time.time_ns())).touch(); time.sleep(600)"


def carry_out_forever(*args: Any, **kwargs: Any) -> Outcome:
    """The same with a process that does not end, and says in a folder that it has begun."""
    from unittest import mock

    from missing_physics.challenge.processes import stage

    script = FOREVER.format(args[1]["folder"].decode())
    with mock.patch.object(stage, "_command", return_value=[sys.executable, "-c", script]):
        return stage.carry_out(*args, **kwargs)


def processes_with(words: str) -> list[str]:
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            found += [path.parent.name] if words.encode() in path.read_bytes() else []
    return found


@pytest.mark.proof
def test_interrupt_ends_work_on_a_cluster(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """And no more cases were handed over than a window of them; another challenge there is left alone."""
    monkeypatch.setattr("missing_physics.challenge.processes.workers.carry_out", carry_out_forever)
    mine, other = tmp_path / "mine", tmp_path / "other"
    mine.mkdir()
    other.mkdir()
    taken: list[str] = []

    def cases() -> Iterator[tuple[str, dict[str, bytes]]]:
        for name in "abcdefghijklmnop":
            taken.append(name)
            yield name, {"folder": str(mine).encode()}

    with distributed.LocalCluster(n_workers=1, threads_per_worker=2, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        with distributed.Client(address) as client:
            files = {"folder": str(other).encode()}
            theirs = client.submit(carry_out_forever, "diagnose", files, tag="theirs", pure=False)
            while not list(other.iterdir()):
                time.sleep(0.05)
            work = Work("diagnose", scheduler=address, tag="ours")

            def interrupt() -> None:
                while not list(mine.iterdir()):
                    time.sleep(0.05)
                os.kill(os.getpid(), signal.SIGINT)

            threading.Thread(target=interrupt, daemon=True).start()
            with pytest.raises(KeyboardInterrupt):
                list(carried_out(work, cases()))
            assert 0 < len(taken) <= 2 * 2
            patience = time.monotonic() + 20
            while processes_with(str(mine)) and time.monotonic() < patience:
                time.sleep(0.1)
            assert not processes_with(str(mine))
            assert len(list(mine.iterdir())) == 1  # none was tried again
            assert processes_with(str(other))
            assert not theirs.done()
            client.run(stage.end_all, "theirs")


def test_cluster_error_is_not_an_answer() -> None:
    class Future:
        def __init__(self, error: Exception) -> None:
            self.error = error

        def result(self) -> Outcome:
            raise self.error

    killed = distributed.KilledWorker("a", SimpleNamespace(address="tcp://there"), 3)
    assert workers._result(Future(killed)).status == "failed"
    assert workers._result(Future(ModuleNotFoundError("missing_physics"))).status == "stopped"


def test_absent_scheduler_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("missing_physics.challenge.processes.workers.ANSWER_TIME", 1)
    with pytest.raises(InputError, match=r"no dask scheduler answers at tcp://127\.0\.0\.1:9"):
        list(carried_out(Work("diagnose", scheduler="tcp://127.0.0.1:9"), iter([])))


@pytest.mark.proof
def test_small_challenge_runs_completely(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two cases in real processes; one diagnosis is killed from outside and tried again; then shown."""
    plain = truth(AXIS)
    hidden = hiding("coulomb_friction", "joint1", torque=10.0).model_copy(
        update={"number": AXIS + 1, "name": "0123456789ab"}
    )
    small = plain.model_copy(update={"designs": (*plain.designs, hidden)})
    monkeypatch.setattr(course, "draw_truth", lambda first, cases: small)
    killed: list[int] = []

    def kill_once(phrase: str, share: float) -> None:
        if phrase.startswith("diagnosing") and not killed:
            killed.append(0)

            def work() -> None:
                while not stage.LIVE:
                    time.sleep(0.01)
                time.sleep(0.5)
                os.killpg(next(iter(stage.LIVE)).pid, signal.SIGKILL)

            threading.Thread(target=work, daemon=True).start()

    report = run(Settings(seed=AXIS, cases=2, folder=tmp_path, workers=1, tell=kill_once))
    assert {score.number for score in report.scores} == {AXIS, AXIS + 1}
    assert sorted(score.attempts for score in report.scores) == [1, 2]
    assert all(score.verdict != "no answer" for score in report.scores)
    for score in report.scores:
        # The run without noise differs from the recording by the noise that the sensors are said to have.
        assert 0.8 < score.errors["truth"] < 1.2
        assert set(score.models) == {"correlation", "sparse regression", "nominal refitted", "diagnosis"}
    folder = show(tmp_path, AXIS + 1)
    assert (folder / "comparison.rrd").stat().st_size > 0
    assert json.loads((folder / "design.json").read_text())["hidden"]


def test_challenge_command_reports_errors(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["challenge", "--show", "3", "--out", str(tmp_path)])
    assert isinstance(result.exception, InputError)
    assert "no challenge that has been opened" in str(result.exception)


def test_the_command_line_writes_both_pages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from challenge_cases import score

    from missing_physics.challenge.scoring.result import Report

    facts = {"first case": 10000, "cases": 1, "isolation of the diagnosis": "none"}
    seen: list[Settings] = []

    def instant(settings: Settings) -> Report:
        seen.append(settings)
        return Report((score(),), {}, facts)

    monkeypatch.setattr("missing_physics.challenge.run", instant)
    words = ["challenge", "--cases", "1", "--seed", "5", "--quiet", "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, [*words, "--evidence", str(tmp_path / "page.md")])
    assert result.exit_code == 0, result.output
    assert (seen[0].seed, seen[0].cases) == (5, 1)
    assert (tmp_path / "page.md").read_text() == (tmp_path / "out" / "report.md").read_text()
    assert "--cases 1 --seed 5" in (tmp_path / "page.md").read_text()
    assert (tmp_path / "out" / "report.html").is_file()


@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_interrupt_prints_how_to_resume(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    kind: signal.Signals,
) -> None:
    def interrupted(settings: Settings) -> None:
        os.kill(os.getpid(), kind)
        time.sleep(10)

    monkeypatch.setattr("missing_physics.challenge.run", interrupted)
    monkeypatch.setattr(sys, "argv", ["missing-physics", "challenge", "--quiet", "--out", str(tmp_path)])
    before = signal.signal(kind, signal.SIG_DFL)  # these tests may run under nohup, which is respected
    try:
        with pytest.raises(SystemExit) as end:
            cli.main()
    finally:
        signal.signal(kind, before)
    assert end.value.code == 128 + kind
    assert "the same command goes on from there" in capsys.readouterr().err


@pytest.mark.proof
@pytest.mark.parametrize("kind", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_leaves_neither_processes_nor_folders(tmp_path: Path, kind: signal.Signals) -> None:
    """The real command, ended while it makes its case."""
    room = tmp_path / "tmp"
    room.mkdir()
    words = ["challenge", "--quiet", "--cases", "1", "--seed", "10000", "--out", str(tmp_path / "out")]
    before = signal.signal(kind, signal.SIG_DFL)  # nohup has SIGHUP ignored, and the command inherits that
    try:
        command = subprocess.Popen(
            [sys.executable, "-m", "missing_physics", *words],
            env={**os.environ, "TMPDIR": str(room)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
    finally:
        signal.signal(kind, before)
    while not list(room.glob("step-*")):
        assert command.poll() is None, command.communicate()
        time.sleep(0.02)
    time.sleep(0.3)
    command.send_signal(kind)
    _, message = command.communicate(timeout=60)
    assert command.returncode == 128 + kind
    assert "the same command goes on from there" in message
    assert list(room.iterdir()) == []
    assert not [path for path in Path("/proc").glob("[0-9]*/environ") if str(room).encode() in readable(path)]


def readable(path: Path) -> bytes:
    """Content of a file; nothing where it has gone or is another user's."""
    with suppress(OSError):
        return path.read_bytes()
    return b""
