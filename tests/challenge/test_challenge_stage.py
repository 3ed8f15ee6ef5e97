"""Steps of a challenge are processes: those that die, are rejected, break off or take too long."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from challenge_cases import design
from hypothesis import given
from hypothesis import strategies as st

from missing_physics.challenge.cases.truth import Design
from missing_physics.challenge.processes import stage
from missing_physics.challenge.processes.parcel import packed, unpacked
from missing_physics.challenge.processes.workers import Work, carried_out
from robot_model import EffectUse


@pytest.fixture(autouse=True)
def _begun() -> None:
    stage.begin()


def sleeper(monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    monkeypatch.setattr(stage, "_command", lambda step, folder, hidden: [sys.executable, "-c", script])


def test_dead_worker_process_costs_one_attempt(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """One of three is killed from outside while it works; all three answer."""
    sleeper(
        monkeypatch,
        "import time, pathlib\n"
        f"go, name = pathlib.Path({str(tmp_path / 'go')!r}), pathlib.Path('name').read_text()\n"
        "while not go.exists(): time.sleep(0.02)\n"
        "pathlib.Path('../out/diagnosis.json').write_text(name)",
    )

    def kill_one() -> None:
        while len(stage.LIVE) < 3:
            time.sleep(0.01)
        os.kill(next(iter(stage.LIVE)).pid, signal.SIGKILL)
        (tmp_path / "go").touch()

    killer = threading.Thread(target=kill_one)
    killer.start()
    cases = ((name, {"name": name.encode()}) for name in "abc")
    outcomes = dict(carried_out(Work("diagnose", workers=3), cases))
    killer.join()
    assert {name: outcome.files["diagnosis.json"] for name, outcome in outcomes.items()} == {
        "a": b"a",
        "b": b"b",
        "c": b"c",
    }
    assert sorted(outcome.attempts for outcome in outcomes.values()) == [1, 1, 2]


def test_case_whose_processes_always_die_fails_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    sleeper(
        monkeypatch,
        "import os, pathlib\nif pathlib.Path('name').read_text() == 'b': os.kill(os.getpid(), 9)\n",
    )
    outcomes = dict(
        carried_out(Work("diagnose", workers=2), iter([("a", {"name": b"a"}), ("b", {"name": b"b"})]))
    )
    assert outcomes["a"].status == "done"
    assert (outcomes["b"].status, outcomes["b"].attempts) == ("failed", stage.ATTEMPTS)


def test_attempt_beyond_the_time_limit_is_not_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    sleeper(monkeypatch, "import time; time.sleep(600)")
    monkeypatch.setattr(stage, "LONGEST", 0.2)
    outcome = stage.carry_out("diagnose", {})
    assert (outcome.status, outcome.attempts, outcome.message) == ("failed", 1, "no end after 0.2 s")


def test_rejected_input_is_not_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    sleeper(monkeypatch, "import sys; print('no joint', file=sys.stderr); sys.exit(2)")
    outcome = stage.carry_out("diagnose", {})
    assert (outcome.status, outcome.attempts, outcome.message) == ("refused", 1, "no joint")


def test_an_interrupt_leaves_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    sleeper(monkeypatch, "import time; time.sleep(600)")

    def cases() -> Iterator[tuple[str, dict[str, bytes]]]:
        yield "a", {}
        while not stage.LIVE:
            time.sleep(0.01)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(carried_out(Work("diagnose", workers=1), cases()))
    assert not stage.LIVE


def step_of(case: Design, step: str = "conceal") -> subprocess.CompletedProcess[bytes]:
    words = stage._command(step, Path.cwd(), ())  # type: ignore[arg-type]
    return subprocess.run(
        words, input=packed({"design.json": case.model_dump_json().encode()}), capture_output=True
    )


def test_step_prints_nothing_to_standard_output() -> None:
    """What a step writes to stderr is kept as the words of its case."""
    done = step_of(design().model_copy(update={"hidden": (EffectUse(effect="no_such", at="joint1"),)}))
    assert done.returncode == stage.UNUSABLE
    assert len(done.stderr.splitlines()) == 1
    assert b"no_such" in done.stderr


def test_hidden_physics_is_in_no_file_during_simulation(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The step reads what it got and says which files there were; none."""
    script = (
        "import sys, pathlib; from missing_physics.challenge.processes.parcel import packed, unpacked\n"
        "given = unpacked(sys.stdin.buffer.read())\n"
        "files = [str(p) for p in pathlib.Path.cwd().parent.rglob('*') if p.is_file()]\n"
        "sys.stdout.buffer.write(packed({'given': given['design.json'], 'files': repr(files).encode()}))"
    )
    sleeper(monkeypatch, script)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    outcome = stage.carry_out("conceal", {"design.json": b"the truth"})
    assert outcome.status == "done", outcome.message
    assert outcome.files == {"given": b"the truth", "files": b"[]"}
    assert list(tmp_path.iterdir()) == []


@given(st.dictionaries(st.text(), st.binary()), st.integers(1, 9))
def test_packed_files_are_recovered_and_truncated_ones_rejected(files: dict[str, bytes], cut: int) -> None:
    assert unpacked(packed(files)) == files
    with pytest.raises(ValueError):  # noqa: PT011
        unpacked(packed({**files, "last": b"x" * 9})[:-cut])


def test_step_with_truncated_output_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    sleeper(monkeypatch, """print('{"a": 5}'); print('abc')""")
    outcome = stage.carry_out("score", {})
    assert (outcome.status, outcome.files) == ("failed", {})
    assert "a breaks off" in outcome.message


@pytest.mark.parametrize("step", ["conceal", "diagnose"])
def test_full_disk_is_not_a_failure_of_the_case(monkeypatch: pytest.MonkeyPatch, step: Any) -> None:
    """Told by the process, by its exit code, or met before it could be started."""
    sleeper(monkeypatch, f"import sys; print('no space', file=sys.stderr); sys.exit({stage.STOPPED})")
    outcome = stage.carry_out(step, {"a": b""})
    assert (outcome.status, outcome.attempts, outcome.message) == ("stopped", 1, "no space")

    def full(*args: Any, **kwargs: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("tempfile.TemporaryDirectory", full)
    outcome = stage.carry_out(step, {"a": b""})
    assert (outcome.status, outcome.message) == ("stopped", "No space left on device")


@pytest.mark.parametrize(
    ("error", "said"),
    [
        ("OSError(errno.ENOSPC, 'No space left')", "No space left"),
        pytest.param("MemoryError()", "too little memory", marks=pytest.mark.proof),
    ],
)
def test_step_reports_a_full_disk_or_memory(monkeypatch: pytest.MonkeyPatch, error: str, said: str) -> None:
    """In its own process: whatever part of it finds no room."""
    script = (
        "import errno, os, sys; from missing_physics.challenge import one_step\n"
        f"def full(step, given): raise {error}\n"
        "one_step._made = full; sys.exit(one_step.main('conceal', os.getppid()))"
    )
    sleeper(monkeypatch, script)
    outcome = stage.carry_out("conceal", {"design.json": b""})
    assert (outcome.status, outcome.attempts) == ("stopped", 1)
    assert said in outcome.message
