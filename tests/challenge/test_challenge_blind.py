"""The diagnosing process can access its case, and nothing of the challenge."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from missing_physics.challenge.processes import blind, stage
from missing_physics.challenge.seals.seal import new_key, seal

ROOT = Path(__file__).parents[2]
PROBE = """
import ctypes, importlib.util, json, os, subprocess, sys
from pathlib import Path
hidden, parent, others = Path(sys.argv[1]), sys.argv[2], sys.argv[3:]

def listed(place):
    try:
        return sorted(path.name for path in Path(place).iterdir())
    except OSError:
        return []

def tried(*command):
    try:
        return subprocess.run(command, capture_output=True).returncode
    except OSError:
        return -1

libc = ctypes.CDLL(None, use_errno=True)
mounts = [line.split()[4] for line in Path("/proc/self/mountinfo").read_text().splitlines()]
facts = {
    "environment": dict(os.environ),
    "command": Path("/proc/self/cmdline").read_text().split(chr(0))[:1],
    "here": listed("."),
    "above": listed(".."),
    "processes": [name for name in os.listdir("/proc") if name.isdigit()],
    "parent": os.path.exists(f"/proc/{parent}"),
    "times": sorted({path.stat().st_mtime for path in Path.cwd().iterdir()}),
    "mounts": Path("/proc/self/mountinfo").read_text(),
    "unmounted": [place for place in reversed(mounts) if libc.umount2(place.encode(), 2) == 0],
    "new namespaces": libc.unshare(0x10000000),
    "privileged": tried("unshare", "--user", "--map-root-user", "--mount", "true"),
    "mounted": tried("mount", "-t", "tmpfs", "none", "."),
    "chroot": libc.chroot(b"/proc/1/root"),
    "hidden": listed(hidden),
    "seen": [place for place in others if os.path.exists(place)],
    "cases": [place for place in listed(Path.cwd().parents[2]) if place != Path.cwd().parents[1].name],
    "truth": [
        name
        for name in ("cases", "draws", "one_case", "course")
        if importlib.util.find_spec(f"missing_physics.challenge.{name}")
    ],
}
Path("../out/diagnosis.json").write_text(json.dumps(facts))
"""


def probed(monkeypatch: pytest.MonkeyPatch, hidden: Path, *others: Path) -> dict:
    """What the probe tells from where a diagnosis would run."""
    real = stage._command

    def command(step: stage.Step, folder: Path, covered: list[str]) -> list[str]:
        line = real(step, folder, covered)
        start = line.index(sys.executable)
        words = [sys.executable, "-c", PROBE, str(hidden), str(os.getpid()), *map(str, others)]
        return [*line[:start], *words]

    monkeypatch.setattr(stage, "_command", command)
    files = dict.fromkeys(("robot.toml", "recording.csv", "validation.csv"), b"x")
    code, written, words = stage.attempt("diagnose", files, hidden=[str(hidden)])
    assert code == 0, words
    return json.loads(written["diagnosis.json"])


@pytest.fixture(autouse=True)
def _begun() -> None:
    stage.begin()


@pytest.fixture
def namespaces() -> None:
    """For tests that need them."""
    if blind.isolation() != blind.NAMESPACES:
        pytest.skip("this system allows no namespaces")


@pytest.fixture
def challenge(tmp_path: Path) -> Path:
    """A folder with a sealed truth in it."""
    folder = tmp_path / "challenge-31415-9"
    (folder / "sealed").mkdir(parents=True)
    (folder / "sealed" / "1.bin").write_bytes(seal(b"the truth", new_key()))
    (folder / "challenge.json").write_text("{}")
    return folder


def test_diagnosing_process_cannot_read_key_or_seal(monkeypatch: pytest.MonkeyPatch, challenge: Path) -> None:
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
    if blind.isolation() != blind.NAMESPACES:
        pytest.skip("this system allows no namespaces; emptied environment and folder were checked")
    assert seen["hidden"] == []
    assert not seen["parent"] or os.getpid() == 1
    assert seen["processes"] == ["1"]


def _program() -> tuple[Path, ...]:
    """Where this program and its Python lie."""
    return ROOT.resolve(), Path(sys.prefix).resolve(), Path(sys.base_prefix).resolve()


@pytest.mark.usefixtures("namespaces")
def test_diagnosing_process_cannot_read_the_truth(
    monkeypatch: pytest.MonkeyPatch, challenge: Path, tmp_path: Path
) -> None:
    """No privilege, no way back to the disk, no other case, no checkout, and nothing that draws truths."""
    top = ("Makefile", "reports", "docs", "tests", "benchmarks", ".git", "pyproject.toml")
    drawing = ROOT / "missing_physics" / "challenge" / "draws" / "design.py"
    others = [*(ROOT / name for name in top), drawing]
    with blind.case_folder() as other:
        (other / "in" / "design.json").write_text("the truth")
        seen = probed(monkeypatch, challenge, *others, other, other.parent, tmp_path, Path(__file__))
    assert seen["seen"] == []
    # of the folder for temporary files nothing but the way to this program, where that lies in it
    temporary = Path(tempfile.gettempdir()).resolve()
    way = {place.relative_to(temporary).parts[0] for place in _program() if place.is_relative_to(temporary)}
    assert set(seen["cases"]) <= way
    assert seen["truth"] == []
    assert "31415" not in seen["mounts"]
    assert "challenge-" not in seen["mounts"]
    assert seen["unmounted"] == []
    assert seen["new namespaces"] != 0
    assert seen["privileged"] != 0
    assert seen["mounted"] != 0
    assert seen["chroot"] != 0
    assert (challenge / "challenge.json").read_text() == "{}"


@pytest.mark.usefixtures("namespaces")
def test_isolation_works_for_an_installed_package(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """As if Python itself lay around the program, the challenge, a checkout and the folder of all cases."""
    site = tmp_path / "lib" / "python3" / "site-packages"
    for room in ("robot_model", "reference_model", "missing_physics"):
        shutil.copytree(ROOT / room, site / room, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "reports" / "challenge-5-2").mkdir(parents=True)
    (tmp_path / "reports" / "challenge-5-2" / "challenge.json").write_text("{}")
    monkeypatch.setattr(blind, "_sources", lambda: site)
    real = blind._interpreter()
    monkeypatch.setattr(blind, "_interpreter", lambda: {*real, tmp_path})
    monkeypatch.setattr(blind, "namespaces_allowed", lambda: True)
    hidden = tmp_path / "reports" / "challenge-5-2"
    seen = probed(monkeypatch, hidden, site / "missing_physics" / "diagnosis", hidden / "challenge.json")
    assert seen["seen"] == [str(site / "missing_physics" / "diagnosis")]
    assert seen["truth"] == []
    assert seen["hidden"] == []
    assert seen["unmounted"] == []


def test_checkout_is_hidden_except_for_the_diagnosis(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    checkout = tmp_path / "src"
    for room in (*blind.PACKAGES, "missing_physics/challenge", ".venv", "reports"):
        (checkout / room).mkdir(parents=True)
    (checkout / "pyproject.toml").touch()
    monkeypatch.setattr(blind, "_sources", lambda: checkout)
    monkeypatch.setattr(blind, "_interpreter", lambda: {tmp_path, checkout / ".venv"})
    monkeypatch.setattr(blind.tempfile, "gettempdir", lambda: "/nowhere")
    orders = [order for order in blind._orders([checkout / "reports"]) if str(tmp_path) in order[1]]
    told = [(kind, str(Path(path).relative_to(tmp_path))) for kind, path in orders]
    assert told == [
        ("show", "."),
        ("cover", "src"),
        ("show", "src/.venv"),
        ("show", "src/missing_physics"),
        ("cover", "src/missing_physics/challenge"),
        ("show", "src/reference_model"),
        ("show", "src/robot_model"),
    ]


@pytest.mark.usefixtures("namespaces")
def test_public_command_runs_in_isolation() -> None:
    """With all that it imports, and without the challenge."""
    with blind.case_folder() as folder:
        line = stage._command("diagnose", folder, ())
        done = subprocess.run(
            line, cwd=folder / "in", env=dict(blind.environment(folder)), capture_output=True, text=True
        )
    assert done.returncode == stage.UNUSABLE
    assert "robot.toml" in done.stderr  # which is not there
    assert "Traceback" not in done.stderr


@pytest.mark.usefixtures("namespaces")
def test_namespaces_have_no_network() -> None:
    look = "import socket; print([name for _, name in socket.if_nameindex()])"
    with blind.case_folder() as folder:
        done = subprocess.run(
            [*blind.prefix(folder), sys.executable, "-c", look], capture_output=True, text=True, check=True
        )
    assert done.stdout.strip() in ("['lo']", "[]")


@pytest.mark.usefixtures("namespaces")
def test_a_root_folder_that_cannot_be_made_stops_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """It says nothing of the case, so that it must not be counted as an answer."""
    monkeypatch.setattr(blind, "SETUP", blind.SETUP.replace("tmpfs", "no-such-file-system"))
    outcome = stage.carry_out("diagnose", {"robot.toml": b""})
    assert (outcome.status, outcome.attempts) == ("stopped", 1)


def test_missing_namespaces_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blind, "namespaces_allowed", lambda: False)
    assert blind.prefix(Path("/"), [Path("/")]) == []
    assert blind.isolation() == blind.EMPTIED


def test_a_root_folder_without_python_is_not_called_isolated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blind, "_interpreter", lambda: set())
    monkeypatch.setattr(blind, "SYSTEM", ("/dev/null",))
    assert not blind._tried.__wrapped__()
