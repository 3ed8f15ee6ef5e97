"""The commands in `examples/*/README.md` that diagnose a machine by its own URDF or MJCF file."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from missing_physics.cli import main
from missing_physics.cli.commands import diagnose as command
from missing_physics.recordings.datasets import find_dataset
from robot_model import Recording, Robot, robot_from_toml

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"```sh\n(.*?)```", re.DOTALL)


def commands() -> Iterator[tuple[str, str]]:
    """Folder under `examples`, and the command with its lines joined."""
    for page in sorted((ROOT / "examples").glob("*/README.md")):
        for block in BLOCK.findall(page.read_text("utf-8")):
            for line in block.replace("\\\n", " ").splitlines():
                if re.match(r"missing-physics diagnose DATA/\S+\.(urdf|xml) ", line):
                    yield page.parent.name, " ".join(line.split())


EVERY = list(commands())


class RanError(Exception):
    """The diagnosis would begin."""


def words_of(machine: str, line: str, *, most: int | None = None) -> list[str]:
    """The words of a command, for the layout of the data folder that is here; wildcards as a shell does.

    Args:
        machine: folder of the data.
        line: the command.
        most: recordings of one word or one option that are kept.
    """
    folder = find_dataset(machine)
    if folder is None:
        pytest.skip(f"the recordings of {machine} are not here; set MISSING_PHYSICS_DATA")
    found: list[str] = []
    for word in shlex.split(line):
        if not word.startswith("DATA/"):
            found.append(word)
            continue
        name, at, part = word.removeprefix("DATA/").partition("@")
        paths = sorted(folder.rglob(name))
        if not paths:
            pytest.skip(f"{machine} is laid out otherwise here: no {name}")
        found += [f"{path}{at}{part}" for path in paths[:most]]
    if most is not None:
        options = [place for place, word in enumerate(found) if word == "--validate"]
        for place in reversed(options[most:]):
            del found[place : place + 2]
    return found


def test_machines_with_a_manufacturer_robot_file_have_a_command() -> None:
    assert {machine for machine, _ in EVERY} >= {"dfki_double_pendulum", "kuka_iiwa14", "kinova_gen3", "go2"}


@pytest.mark.parametrize(("machine", "line"), EVERY)
def test_example_command_reaches_the_diagnosis(
    machine: str, line: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Robot, overlay, map and recordings are read, checked and handed on."""
    seen: list[tuple[Robot, int, int]] = []

    def run(robot: Robot, fitted: list[Recording], scored: list[Recording], **_: object) -> None:
        seen.append((robot, len(fitted), len(scored)))
        raise RanError

    words = words_of(machine, line, most=1)
    monkeypatch.setattr(command, "run_diagnosis", run)
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr("sys.argv", [*words, "--out", str(tmp_path / "out"), "--quiet"])
    with pytest.raises(RanError):
        main()
    robot, fitted, scored = seen[0]
    assert len(robot.moving_joints) in (1, 2, 7, 12)
    assert any(robot.gravity)
    assert scored == words.count("--validate")
    assert fitted > 0


@pytest.mark.parametrize(("machine", "line"), EVERY)
def test_inspect_accepts_the_arguments_of_the_example_command(
    machine: str, line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The first recording, with the robot, the overlay and the map of the command, is usable as it is."""
    command, what, robot, recording, *rest = words_of(machine, line, most=1)
    assert what == "diagnose"
    options = [word for name in ("--overlay", "--map") for word in rest[rest.index(name) :][:2]]
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr("sys.argv", [command, "inspect", recording, "--robot", robot, *options, "--json"])
    with pytest.raises(SystemExit) as left:
        main()
    assert not left.value.code
    seen = json.loads(capsys.readouterr().out)
    assert [one for one in seen["findings"] if one["severity"] == "error"] == []


@pytest.mark.proof
@pytest.mark.parametrize(("machine", "line"), EVERY)
def test_example_command_writes_its_diagnosis(
    machine: str, line: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """All recordings of the command, as somebody types it: some seconds to some minutes."""
    words = words_of(machine, line)
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr("sys.argv", [*words, "--out", str(tmp_path / "out"), "--quiet"])
    with pytest.raises(SystemExit) as left:
        main()
    assert not left.value.code
    told = json.loads((tmp_path / "out" / "diagnosis.json").read_text("utf-8"))
    assert told["verdict"] in ("explained", "partly_explained", "ambiguous", "unexplained")
    assert told["findings"]
    saved = robot_from_toml((tmp_path / "out" / "robot.augmented.toml").read_text("utf-8"))
    assert {(one["effect"], one["location"]) for one in told["findings"]} & {
        (use.effect, use.at) for use in saved.effects
    }
