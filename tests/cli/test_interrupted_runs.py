"""Ctrl-C ends a simulation with a sampled controller, as started by a user."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from importlib.resources import files
from pathlib import Path

import pytest

#: Longest wait for the run to be under way on a busy machine, and then for its end [s].
PATIENCE = 120.0
#: CPU time [s] that a process has spent when its libraries are loaded and it integrates.
UNDER_WAY = 5.0


def _cpu(pid: int) -> float:
    words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc to see that it runs")
@pytest.mark.parametrize("held", [True, pytest.param(False, marks=pytest.mark.proof)])
def test_interrupted_run_ends_within_two_seconds(tmp_path: Path, held: bool) -> None:
    text = (files("robot_model") / "library" / "six_joint_space_arm.toml").read_text()
    controller = "kd = 12.0\nsample_time = 0.001" if held else "kd = 12.0"
    text = text.replace("kd = 12.0", controller).replace("duration = 30.0", "duration = 3000.0")
    (tmp_path / "arm.toml").write_text(text)
    program = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    program += "from missing_physics.__main__ import main; main()"
    words = ["simulate", "arm.toml", "--out", "run.csv", "--quiet"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [sys.executable, "-c", program, *words],
        cwd=tmp_path,
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        end = time.monotonic() + PATIENCE
        while _cpu(process.pid) < UNDER_WAY and time.monotonic() < end:
            time.sleep(0.05)
        assert process.poll() is None
        before = _cpu(process.pid)
        process.send_signal(signal.SIGINT)
        spent = before
        while process.poll() is None and time.monotonic() < end + PATIENCE:
            spent = max(spent, _cpu(process.pid))
            time.sleep(0.02)
        assert process.wait(PATIENCE) == 130
        assert spent - before < 2.0  # of its own time, whatever else the machine does
        assert process.stderr is not None
        assert process.stderr.read() == "missing-physics: interrupted.\n"
    finally:
        process.kill()
        process.wait()
    assert [path.name for path in tmp_path.iterdir()] == ["arm.toml"]
