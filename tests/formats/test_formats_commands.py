"""Robots in URDF, xacro and MJCF on the command line."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from missing_physics.cli import UNUSABLE_INPUT, main
from missing_physics.recordings import load_recording
from robot_model import load_robot

OVERLAY = """
{effects}
[controller]
kind = "pd"
kp = 30.0
kd = 3.0
[reference]
duration = 3.0
sample_rate = 200.0
[[reference.joints]]
joint = "pivot"
kind = "multisine"
amplitudes = [0.6, 0.3]
frequencies = [0.5, 1.3]
ramp = 0.5
[[sensors]]
channel = "pivot.position"
noise = 1e-5
[[sensors]]
channel = "pivot.torque"
noise = 1e-2
"""


@dataclass(frozen=True)
class Printed:
    """Exit code and printed output."""

    code: int
    out: str
    err: str


class Front:
    """Runs the command as a user does."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self.monkeypatch, self.capsys = monkeypatch, capsys

    def __call__(self, *words: object) -> Printed:
        self.monkeypatch.setattr("sys.argv", ["missing-physics", *map(str, words)])
        with pytest.raises(SystemExit) as left:
            main()
        printed = self.capsys.readouterr()
        return Printed(int(left.value.code or 0), printed.out, printed.err)


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Front:
    return Front(monkeypatch, capsys)


@pytest.fixture
def arm(files: Path, tmp_path: Path) -> Path:
    """A URDF with an overlay next to it."""
    (tmp_path / "arm.urdf").write_text((files / "pendulum.urdf").read_text())
    (tmp_path / "arm.overlay.toml").write_text(OVERLAY.format(effects=""))
    return tmp_path / "arm.urdf"


def test_from_a_urdf_to_a_finding(run: Front, arm: Path, tmp_path: Path) -> None:
    """Friction of the URDF affects the simulation, and is found by a diagnosis without it."""
    log = tmp_path / "run.csv"
    assert run("simulate", arm, "--out", log, "--quiet") == Printed(0, "", "")
    assert set(load_recording(log)) >= {"pivot.position", "pivot.torque"}
    seen = run("inspect", log, "--robot", arm, "--json")
    assert seen.code == 0
    assert [f for f in json.loads(seen.out)["findings"] if f["severity"] != "note"] == []
    bare = tmp_path / "bare.toml"
    bare.write_text(OVERLAY.format(effects="effects = []"))
    out = tmp_path / "out"
    found = run("diagnose", arm, log, "--overlay", bare, "--out", out, "--json", "--quiet")
    assert (found.code, found.err) == (0, "")
    named = {f["effect"]: f["parameters"] for f in json.loads(found.out)["findings"]}
    assert named["viscous_friction"]["coefficient"]["value"] == pytest.approx(0.1, rel=0.02)
    assert named["coulomb_friction"]["torque"]["value"] == pytest.approx(0.2, rel=0.02)
    augmented = load_robot(out / "robot.augmented.toml")
    assert augmented.joint("pivot").axis == (0.0, 1.0, 0.0)
    assert len(augmented.effects) == 2


def test_both_engines(run: Front, arm: Path, tmp_path: Path) -> None:
    printed = run("crosscheck", arm, "--out", tmp_path / "both", "--duration", 0.2, "--json", "--quiet")
    assert (printed.code, printed.out, printed.err) == (0, "", "")
    assert (tmp_path / "both" / "crosscheck.json").is_file()


def test_assumptions_are_reported_on_stderr(run: Front, arm: Path, tmp_path: Path) -> None:
    printed = run("simulate", arm, "--out", tmp_path / "run.csv")
    lines = printed.err.splitlines()
    assert f"{arm}: arm.overlay.toml beside it is put over it." in lines
    assert len(lines) == len(set(lines)) == 3
    assert all(line.startswith(f"{arm}: ") for line in lines)
    assert "overlay" not in printed.out


@pytest.mark.parametrize("command", ["simulate", "crosscheck", "diagnose", "inspect"])
def test_unusable_files_end_every_command(run: Front, tmp_path: Path, command: str) -> None:
    (tmp_path / "arm.urdf").write_text("<robot><link name='a'/></robo>")
    (tmp_path / "log.csv").write_text("time,pivot.position\n0,0\n1,1\n")
    words = {"diagnose": [tmp_path / "arm.urdf", tmp_path / "log.csv"]}.get(command, [tmp_path / "arm.urdf"])
    if command == "inspect":
        words = [tmp_path / "log.csv", "--robot", tmp_path / "arm.urdf"]
    printed = run(command, *words, "--quiet")
    assert printed.code == UNUSABLE_INPUT
    assert (
        printed.err
        == f"missing-physics: {tmp_path / 'arm.urdf'}, line 1: is not valid XML: mismatched tag.\n"
    )
    assert sorted(file.name for file in tmp_path.iterdir()) == ["arm.urdf", "log.csv"]


BOMB = '<!DOCTYPE robot [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'
MESH = '<mujoco><worldbody><body name="a"><joint/><geom type="mesh"/></body></worldbody></mujoco>'


@pytest.mark.parametrize(
    ("name", "text", "printed"),
    [
        ("cut.urdf", "<robot name='a'><link name='b'>", "cut.urdf, line 1: is not valid XML: no"),
        ("bomb.urdf", f"{BOMB}<robot name='&b;'/>", "bomb.urdf declares entities or refers to another file"),
        ("mesh.xml", MESH, "body 'a' takes its mass from a mesh (line 1), and meshes are not read"),
        ("odd.urdf", None, "joint 'pivot' has the unknown type=\"hinge\""),
        ("package://arm/urdf/arm.urdf", "", "is an address, and robots are read from files; give"),
        ("http://robots/arm.urdf", "", "is an address, and robots are read from files; give"),
    ],
)
def test_unusable_robots_end_with_one_sentence(
    run: Front, files: Path, tmp_path: Path, name: str, text: str | None, printed: str
) -> None:
    robot: str | Path = name
    if "://" not in name:
        valid = (files / "pendulum.urdf").read_text()
        robot = tmp_path / name
        robot.write_text(valid.replace('"revolute"', '"hinge"') if text is None else text)
    ended = run("simulate", robot, "--out", tmp_path / "out" / "run.csv", "--quiet")
    assert ended.code == UNUSABLE_INPUT
    assert ended.err.startswith(f"missing-physics: {robot}")
    assert printed in ended.err
    assert ended.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_missing_mesh_is_ignored(run: Front, arm: Path, tmp_path: Path) -> None:
    """Meshes are never opened, whatever their address: the file itself gives mass and inertia."""
    mesh = '<visual><geometry><mesh filename="package://arm/rod.stl"/></geometry></visual>'
    arm.write_text(arm.read_text().replace('<link name="rod">', f'<link name="rod">{mesh}'))
    assert run("simulate", arm, "--out", tmp_path / "run.csv", "--quiet") == Printed(0, "", "")


def test_xml_is_imported_only_for_robots_in_xml() -> None:
    heavy = {"defusedxml", "xml.sax", "xacro", "simpleeval", "yaml"}
    code = f"import robot_model, sys; print(sorted({heavy} & sys.modules.keys()))"
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True).stdout
        == "[]\n"
    )


def test_a_missing_motion_is_reported_with_the_overlay_as_remedy(
    run: Front, files: Path, tmp_path: Path
) -> None:
    printed = run("simulate", files / "pendulum.urdf", "--out", tmp_path / "run.csv", "--quiet")
    assert printed.code == UNUSABLE_INPUT
    assert (
        "has no reference motion; add a [reference] table with a duration to its file or an overlay"
        in printed.err
    )
