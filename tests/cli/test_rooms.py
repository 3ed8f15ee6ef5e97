"""A foreign package that shadows one of this program is reported in one sentence."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_shadowing_package_gives_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "robot_model.py").write_text("SOMETHING = 1\n")
    path = os.pathsep.join([str(tmp_path), str(ROOT)])
    done = subprocess.run(
        [sys.executable, "-c", "from missing_physics.__main__ import main; main()"],
        env={**os.environ, "PYTHONPATH": path},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert (
        f"that in {tmp_path / 'robot_model.py'} hides it; install missing-physics in an environment"
        in done.stderr
    )
