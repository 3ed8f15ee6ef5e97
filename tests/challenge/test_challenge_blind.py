"""What a diagnosing process can reach: its case, and nothing of the challenge."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from challenge_cases import design

from missing_physics.challenge import blind, stage
from missing_physics.challenge.seal import new_key, seal
from missing_physics.challenge.workers import Work, carried_out
from robot_model import EffectUse

PROBE = """
import json, os, sys
from pathlib import Path
hidden, parent = Path(sys.argv[1]), sys.argv[2]
print(json.dumps({
    "environment": dict(os.environ),
    "arguments": sys.argv[3:],
    "hidden": sorted(path.name for path in hidden.iterdir()) if hidden.is_dir() else [],
    "here": sorted(path.name for path in Path.cwd().iterdir()),
    "above": sorted(path.name for path in Path.cwd().parent.iterdir()),
    "processes": sorted(name for name in os.listdir("/proc") if name.isdigit()),
    "parent": os.path.exists(f"/proc/{parent}"),
    "own": os.getpid(),
    "times": sorted({path.stat().st_mtime for path in Path.cwd().iterdir()}),
}))
"""


def probed(monkeypatch: pytest.MonkeyPatch, hidden: Path) -> dict:
    """What the probe tells from where a diagnosis would run."""
    told = hidden.parent / "told.json"
    real = stage._command

    def command(step: stage.Step, folder: Path, covered: list[str]) -> list[str]:
        line = real(step, folder, covered)
        start = line.index(sys.executable)
        told.unlink(missing_ok=True)
        script = f"{PROBE}\nPath('../out/told.json').write_text(''); "
        words = [sys.executable, "-c", script, str(hidden), str(os.getpid()), *line[start + 1 :]]
        return ["sh", "-c", '"$@" > ../out/told.json', "sh", *line[:start], *words]

    monkeypatch.setattr(stage, "_command", command)
    files = dict.fromkeys(("robot.toml", "recording.csv", "validation.csv"), b"x")
    code, written, words = stage.attempt("diagnose", files, hidden=[str(hidden)])
    assert code == 0, words
    return json.loads(written["told.json"])


@pytest.fixture
def challenge(tmp_path: Path) -> Path:
    """A folder with a sealed truth in it."""
    folder = tmp_path / "challenge"
    (folder / "sealed").mkdir(parents=True)
    (folder / "sealed" / "1.bin").write_bytes(seal(b"the truth", new_key()))
    (folder / "challenge.json").write_text("{}")
    return folder


def test_the_process_reaches_neither_key_nor_seal(monkeypatch: pytest.MonkeyPatch, challenge: Path) -> None:
    monkeypatch.setenv("CHALLENGE_SECRET", "the key")
    seen = probed(monkeypatch, challenge)
    assert set(seen["environment"]) <= {
        *blind.environment(Path("/")),
        "PWD",
        "OLDPWD",
        "SHLVL",
        "_",
        "LC_CTYPE",
    }
    assert "the key" not in json.dumps(seen["environment"])
    assert seen["here"] == ["recording.csv", "robot.toml", "validation.csv"]
    assert seen["above"] == ["in", "out"]
    assert seen["times"] == [0.0]
    assert not any(str(challenge) in word or word.isdigit() for word in seen["arguments"])
    if blind.isolation() != blind.NAMESPACES:
        pytest.skip("this system allows no namespaces; emptied environment and folder were checked")
    assert seen["hidden"] == []
    assert not seen["parent"] or str(os.getpid()) in seen["processes"][:3]
    assert len(seen["processes"]) <= 3  # itself and the shell around it


def test_namespaces_have_no_network() -> None:
    if blind.isolation() != blind.NAMESPACES:
        pytest.skip("this system allows no namespaces")
    look = "import socket; print([name for _, name in socket.if_nameindex()])"
    done = subprocess.run(
        [*blind.prefix([]), sys.executable, "-c", look], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() in ("['lo']", "[]")


def test_without_namespaces_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blind, "namespaces_allowed", lambda: False)
    assert blind.prefix([Path("/")]) == []
    assert blind.isolation() == blind.EMPTIED


def sleeper(monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    monkeypatch.setattr(stage, "_command", lambda step, folder, hidden: [sys.executable, "-c", script])


def test_a_worker_that_dies_costs_its_case_one_attempt(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """One of three is killed from outside while it works; all three answer."""
    sleeper(
        monkeypatch,
        "import time, pathlib\n"
        f"go, name = pathlib.Path({str(tmp_path / 'go')!r}), pathlib.Path('name').read_text()\n"
        "while not go.exists(): time.sleep(0.02)\n"
        "pathlib.Path('../out/answer').write_text(name)",
    )

    def kill_one() -> None:
        while len(stage.LIVE) < 3:
            time.sleep(0.01)
        os.kill(next(iter(stage.LIVE)).pid, signal.SIGKILL)
        (tmp_path / "go").touch()

    killer = threading.Thread(target=kill_one)
    killer.start()
    cases = ((name, {"name": name.encode()}) for name in "abc")
    outcomes = dict(carried_out(Work("score", workers=3), cases))
    killer.join()
    assert {name: outcome.files["answer"] for name, outcome in outcomes.items()} == {
        "a": b"a",
        "b": b"b",
        "c": b"c",
    }
    assert sorted(outcome.attempts for outcome in outcomes.values()) == [1, 1, 2]


def test_a_case_that_always_dies_fails_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    sleeper(
        monkeypatch,
        "import os, pathlib\nif pathlib.Path('name').read_text() == 'b': os.kill(os.getpid(), 9)\n",
    )
    outcomes = dict(
        carried_out(Work("score", workers=2), iter([("a", {"name": b"a"}), ("b", {"name": b"b"})]))
    )
    assert outcomes["a"].status == "done"
    assert (outcomes["b"].status, outcomes["b"].attempts) == ("failed", stage.ATTEMPTS)


def test_a_refusal_is_no_death(monkeypatch: pytest.MonkeyPatch) -> None:
    sleeper(monkeypatch, "import sys; print('no joint', file=sys.stderr); sys.exit(2)")
    outcome = stage.carry_out("score", {})
    assert (outcome.status, outcome.attempts, outcome.message) == ("refused", 1, "no joint")


def test_an_interrupt_leaves_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    sleeper(monkeypatch, "import time; time.sleep(600)")

    def cases() -> Iterator[tuple[str, dict[str, bytes]]]:
        yield "a", {}
        while not stage.LIVE:
            time.sleep(0.01)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(carried_out(Work("score", workers=1), cases()))
    assert not stage.LIVE


def test_a_step_says_nothing_of_its_own(tmp_path: Path) -> None:
    """What a step writes to stderr is kept as the words of its case."""
    (tmp_path / "in").mkdir()
    case = design().model_copy(update={"hidden": (EffectUse(effect="no_such", at="joint1"),)})
    (tmp_path / "in" / "design.json").write_text(case.model_dump_json())
    done = subprocess.run(stage._command("conceal", tmp_path, ()), capture_output=True, text=True)
    assert done.returncode == stage.UNUSABLE
    assert len(done.stderr.splitlines()) == 1
    assert "no_such" in done.stderr
