"""The commands of `docs/first_diagnosis.md` give the shown results."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "first_diagnosis.md"


def without_numbers(line: str) -> str:
    """A line whose numbers may differ in their last digits from machine to machine."""
    return " ".join(re.sub(r"\d+(\.\d+)?(e-?\d+)?", "0", line).split())


@pytest.mark.proof
def test_commands_of_the_first_diagnosis_page_can_be_replayed(tmp_path: Path) -> None:
    blocks = re.findall(r"```sh\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    programs = tmp_path / "bin"
    programs.mkdir()
    for name, words in (("missing-physics", "-m missing_physics "), ("python", "")):
        (programs / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {words}"$@"\n')
        (programs / name).chmod(0o755)
    folder = tmp_path / "empty"
    folder.mkdir()
    path = {"PATH": f"{programs}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        ["bash", "-euc", "\n".join(blocks)],
        cwd=folder,
        env={**os.environ, **path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads((folder / "found" / "diagnosis.json").read_text("utf-8"))
    named = {(one["effect"], one["location"]): one["parameters"] for one in found["findings"]}
    for at, name, truth in (
        (("viscous_friction", "shoulder"), "coefficient", 1.1),
        (("coulomb_friction", "elbow"), "torque", 0.9),
    ):
        assert named[at][name]["value"] == pytest.approx(truth, rel=0.05)
    masses = re.findall(r'mass value="([\d.]+)"', (folder / "found" / "arm.urdf").read_text("utf-8"))
    assert float(masses[1]) == pytest.approx(1.8, rel=0.06)
    printed = set(map(without_numbers, done.stdout.splitlines()))
    for shown in re.findall(r"```text\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL):
        lines = [line for line in shown.splitlines() if line.strip() and line != "[...]"]
        assert [line for line in lines if without_numbers(line) not in printed] == []
