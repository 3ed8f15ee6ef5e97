"""Processes of a challenge: they end with it, leave nothing behind, and have no network."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from missing_physics.challenge.processes import stage, workers
from missing_physics.challenge.processes.sockets import behind_filter

linux = pytest.mark.skipif(sys.platform != "linux", reason="what the Linux kernel does")
#: A step that would take for ever, under a parent that can be killed.
PARENT = """
import os, sys
from missing_physics.challenge.processes import stage
{kernel}
step = "{watch}import time; time.sleep(600)".replace("%d", str(os.getpid()))
stage._command = lambda *_: [sys.executable, "-c", step]
stage.attempt("conceal", {{}})
"""
BY_THE_KERNEL = {"kernel": "", "watch": ""}
BY_ITSELF = {
    "kernel": "stage.ends_with_us = lambda: ()",
    "watch": "from missing_physics.challenge.one_step import end_with; end_with(%d); ",
}


def _children(pid: int) -> list[int]:
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for task in tasks for child in task.read_text().split()]


def _until(condition, patience: float = 60.0) -> bool:
    end = time.monotonic() + patience
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.02)
    return False


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


@linux
@pytest.mark.parametrize("way", [BY_THE_KERNEL, BY_ITSELF])
def test_killed_challenge_ends_its_steps_and_the_next_one_cleans_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: dict[str, str]
) -> None:
    if way is BY_THE_KERNEL and not stage.ends_with_us():
        pytest.skip("setpriv is not on this machine")
    environment = {**os.environ, "TMPDIR": str(tmp_path), "PYTHONPATH": os.pathsep.join(sys.path)}
    parent = subprocess.Popen([sys.executable, "-c", PARENT.format(**way)], env=environment)
    try:
        assert _until(lambda: _children(parent.pid) and list(tmp_path.glob("step-*")))
        (child,) = _children(parent.pid)
    finally:
        parent.send_signal(signal.SIGKILL)
        parent.wait()
    assert _until(lambda: not _runs(child))
    assert list(tmp_path.glob("step-*"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    stage.begin()
    assert not list(tmp_path.glob("step-*"))


@linux
def test_diagnosing_process_has_no_socket_to_the_host(tmp_path: Path) -> None:
    (tmp_path / "tried.py").write_text(
        "import errno, socket, sys\n"
        "try:\n"
        "    socket.socket(40, socket.SOCK_STREAM)\n"
        "    print('a socket')\n"
        "except OSError as error:\n"
        "    print(errno.errorcode[error.errno])\n"
        "socket.socket(socket.AF_UNIX).close()\n"
        "print(sys.argv[1])\n"
    )
    done = subprocess.run(
        behind_filter("tried", "given"), cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["EPERM", "given"]
    assert done.stderr == ""
    assert hasattr(socket, "AF_VSOCK")


def _listening() -> set[str]:
    """Sockets of this process that wait for connections."""
    own = {os.readlink(path) for path in Path("/proc/self/fd").iterdir() if path.is_symlink()}
    lines = [line.split() for name in ("tcp", "tcp6") for line in _table(name)]
    return {f"socket:[{words[9]}]" for words in lines if words[3] == "0A"} & own


def _table(name: str) -> list[str]:
    place = Path("/proc/self/net") / name
    return place.read_text().splitlines()[1:] if place.exists() else []


@linux
def test_a_challenge_without_a_scheduler_opens_no_port(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)):
        assert _listening()  # such a port would be seen
    found: list[set[str]] = []
    done = stage.Outcome("done", {}, "", 1, 0.0)
    monkeypatch.setattr(workers, "carry_out", lambda *_, **__: found.append(_listening()) or done)
    outcomes = list(workers.carried_out(workers.Work("conceal", workers=1), iter([("case", {})])))
    assert outcomes == [("case", done)]
    assert found == [set()]
