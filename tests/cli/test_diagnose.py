"""`missing-physics diagnose`: output files and rejected input."""

from __future__ import annotations

import json
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from missing_physics.cli import UNUSABLE_INPUT, main
from missing_physics.recordings import load_recording, write_recording
from missing_physics.standard import MODEL_ERROR
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, Robot, load_robot, save_robot

FILES = {"diagnosis.json", "report.html", "comparison.rrd", "robot.augmented.toml"}
HIDDEN = EffectUse(effect="coulomb_friction", at="joint1", torque=3.0)


def arm() -> Robot:
    """The shipped arm with a shorter and coarser reference motion."""
    robot = load_robot("two_link_arm")
    assert robot.reference is not None
    reference = robot.reference.model_copy(update={"duration": 12.0, "sample_rate": 250.0})
    return robot.model_copy(update={"reference": reference})


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the nominal robot, a recording of the true one and a second recording."""
    folder = tmp_path_factory.mktemp("case")
    save_robot(arm(), folder / "robot.toml")
    for name, seed in (("recording.csv", 1), ("validation.csv", 2)):
        write_recording(simulate(arm().with_effects(HIDDEN), seed=seed), folder / name)
    return folder


@dataclass(frozen=True)
class Said:
    """Exit code and what was printed."""

    code: int
    out: str
    err: str


class Front:
    """The front door: runs the command as its user does."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self.monkeypatch, self.capsys = monkeypatch, capsys

    def diagnose(self, *words: object) -> Said:
        self.monkeypatch.setattr("sys.argv", ["missing-physics", "diagnose", *map(str, words)])
        with pytest.raises(SystemExit) as left:
            main()
        message = self.capsys.readouterr()
        return Said(int(left.value.code or 0), message.out, message.err)


@pytest.fixture(scope="module")
def first(case: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Said]:
    """A quiet run of a recording and a held-out one into a folder that is not there yet, and what it said."""
    out = tmp_path_factory.mktemp("first") / "deep" / "out"
    words = [case / "robot.toml", case / "recording.csv", "--validate", case / "validation.csv"]
    words += ["--out", out, "--json", "--quiet"]
    with pytest.MonkeyPatch.context() as patch, StringIO() as printed, StringIO() as told:
        patch.setattr("sys.argv", ["missing-physics", "diagnose", *map(str, words)])
        with redirect_stdout(printed), redirect_stderr(told), pytest.raises(SystemExit) as left:
            main()
        return out, Said(int(left.value.code or 0), printed.getvalue(), told.getvalue())


@pytest.fixture
def front(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Front:
    return Front(monkeypatch, capsys)


def error(recording: Recording, robot: Robot) -> float:
    """rms of the recorded torque of joint 1 minus that of the simulated robot [N m]."""
    again = simulate(robot, sensors=False)
    return float(np.sqrt(np.mean((recording["joint1.torque"] - again["joint1.torque"]) ** 2)))


def test_diagnose_writes_all_files_and_the_augmented_robot_reproduces_the_recording(
    case: Path, first: tuple[Path, Said]
) -> None:
    out, message = first
    assert (message.code, message.err) == (0, "")
    assert {path.name for path in out.iterdir()} == FILES
    assert all(path.stat().st_size > 0 for path in out.iterdir())
    assert message.out == (out / "diagnosis.json").read_text("utf-8")
    found = json.loads(message.out)
    assert found["verdict"] == "explained"
    assert [(f["effect"], f["location"]) for f in found["findings"]] == [("coulomb_friction", "joint1")]
    torque, compared = found["fit"]["channels"]["joint1.torque"], found["comparison"]["channels"]
    assert torque["standard"]["validation_rms"] < 0.5 * torque["before"]["validation_rms"]
    recording = load_recording(case / "recording.csv")
    any_model = MODEL_ERROR * float(np.sqrt(np.mean(recording["joint1.torque"] ** 2)))
    least = max(1.02 * compared["joint1.torque"]["standard"]["validation_rms"], any_model)
    assert compared["joint1.torque"]["answer"]["validation_rms"] <= least
    assert found["log_score"]["nominal"] < found["log_score"]["answer"]
    assert found["augmented_robot"] == "robot.augmented.toml"
    augmented = load_robot(out / "robot.augmented.toml")
    [dry] = [use for use in augmented.effects if use.effect == "coulomb_friction"]
    assert dry.parameters["torque"] == pytest.approx(3.0, rel=0.02)
    # 3 N m of friction go; the sensor's 0.15 N m of noise stay
    assert error(recording, arm()) > 2.5
    assert error(recording, augmented) < 0.2
    html = (out / "report.html").read_text("utf-8")
    assert "coulomb" in html.lower()


def test_repeated_diagnose_replaces_files_with_summary_on_stdout_and_progress_on_stderr(
    case: Path, tmp_path: Path, front: Front, first: tuple[Path, Said]
) -> None:
    for name in FILES:
        (tmp_path / name).write_text("old")
    words = (case / "robot.toml", case / "recording.csv", "--validate", case / "validation.csv")
    loud = front.diagnose(*words, "--out", tmp_path)
    assert loud.code == 0
    assert "Coulomb friction" in loud.out
    assert "joint1" in loud.out
    assert "report.html" in loud.out
    assert loud.out.index("standard") < loud.out.index("What is missing")  # the table comes first
    assert "weighing" not in loud.out
    assert loud.err
    second = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert set(second) == FILES
    found = json.loads(second["diagnosis.json"])
    assert [Path(name).name for name in found["validation"]] == ["validation.csv"]
    assert found["schema"] == 2
    assert b"old" not in second.values()
    for name in ("diagnosis.json", "robot.augmented.toml"):
        assert (first[0] / name).read_bytes() == second[name]


def test_uninformative_recording_is_a_result_and_not_an_error(
    case: Path, tmp_path: Path, front: Front
) -> None:
    whole = load_recording(case / "recording.csv")
    positions = {name: y for name, y in whole.channels.items() if name.endswith(".position")}
    write_recording(Recording(whole.time, positions), tmp_path / "mute.csv")
    message = front.diagnose(case / "robot.toml", tmp_path / "mute.csv", "--out", tmp_path / "out", "--json")
    assert message.code == 0
    found = json.loads(message.out)
    assert found["verdict"] == "not_enough_data"
    [sentence] = found["could_not_tell"]
    assert sentence.startswith("joint1 and joint2: no torque, current or voltage is recorded")
    assert {path.name for path in (tmp_path / "out").iterdir()} == FILES
    assert load_robot(tmp_path / "out" / "robot.augmented.toml") == arm()


@pytest.mark.parametrize("samples", [55, 70, 90])
def test_very_few_samples_are_insufficient_but_not_an_error(
    case: Path, tmp_path: Path, front: Front, samples: int
) -> None:
    """Of so few, next to none are left inside the edges of the filter."""
    lines = (case / "recording.csv").read_text().splitlines()
    (tmp_path / "brief.csv").write_text("\n".join(lines[: samples + 1]) + "\n")
    message = front.diagnose(case / "robot.toml", tmp_path / "brief.csv", "--out", tmp_path / "out", "--json")
    assert message.code == 0
    assert json.loads(message.out)["verdict"] == "not_enough_data"


def spoilt(case: Path, folder: Path, kind: str) -> tuple[list[Path | str], str]:
    """Words of a command with one thing wrong, and what its sentence must say."""
    robot, recording = case / "robot.toml", folder / "spoilt.csv"
    lines = (case / "recording.csv").read_text().splitlines()
    column = lines[0].replace('"', "").split(",").index("joint1.position")

    def table(rows: list[str]) -> list[Path | str]:
        recording.write_text("\n".join(rows) + "\n")
        return [robot, recording]

    if kind == "missing recording":
        return [robot, folder / "absent.csv"], "absent.csv"
    if kind == "missing robot":
        return [folder / "absent.toml", case / "recording.csv"], "absent.toml"
    if kind == "missing map":
        return [robot, case / "recording.csv", "--map", folder / "absent_map.toml"], "absent_map.toml"
    if kind == "missing validation":
        return [robot, case / "recording.csv", "--validate", folder / "absent.csv"], "absent.csv"
    if kind == "truncated":
        return table([*lines[:500], lines[500][: len(lines[500]) // 2]]), "spoilt.csv"
    if kind == "NaN column":
        fields = [line.split(",") for line in lines]
        for row in fields[1:]:
            row[column] = "nan"
        return table([",".join(row) for row in fields]), "joint1.position"
    if kind == "unsorted time":
        return table([*lines[:300], lines[400], *lines[301:]]), "time"
    if kind == "absent channel":
        return table([lines[0].replace("joint1.position", "joint1.velocity"), *lines[1:]]), "joint1.position"
    if kind == "too short":
        return table(lines[:30]), "29 samples; at least 50 are needed"
    if kind == "cut-off below nothing":
        return [robot, case / "recording.csv", "--cutoff", "-3"], "cut-off of -3 Hz is not between 0 and"
    if kind == "cut-off of nothing":
        return [robot, case / "recording.csv", "--cutoff", "0"], "cut-off of 0 Hz is not between 0 and"
    if kind == "cut-off that is no number":
        return [robot, case / "recording.csv", "--cutoff", "nan"], "cut-off of nan Hz is not between 0 and"
    if kind == "cut-off above the samples":
        return [robot, case / "recording.csv", "--cutoff", "1e5"], "cut-off of 100000 Hz is not between 0 and"
    if kind == "fitted and validated":
        return [*table(lines), "--validate", case / "recording.csv"], "prove nothing"
    if kind == "fitted twice":
        return [*table(lines), case / "recording.csv"], "recording.csv holds the same as recording 1"
    if kind == "no moving joint":
        fixed = folder / "robot.toml"
        link = '[[links]]\nname = "link1"\nmass = 1.0\n'
        joint = '[[joints]]\nname = "joint1"\nkind = "fixed"\nparent = "base"\nchild = "link1"\n'
        fixed.write_text(f'name = "welded"\n{link}{joint}')
        return [fixed, case / "recording.csv"], "it has no moving joint"
    if kind == "torque in one only":
        dumb = [name.split(",") for name in lines]
        names = [name.strip('"') for name in dumb[0]]
        kept = [k for k, name in enumerate(names) if not name.startswith("joint1.") or k == column]
        words = table([",".join(row[k] for k in kept) for row in dumb])
        return [robot, case / "recording.csv", *words[1:]], "spoilt.csv has no torque of joint1"
    if kind == "no table":
        recording.write_bytes(b"\x00\x01\x02 this is no table")
        return [robot, recording], "spoilt.csv"
    if kind == "unknown key":
        broken = folder / "robot.toml"
        broken.write_text(robot.read_text().replace("mass = 8.0", "mas = 8.0", 1))
        return [broken, case / "recording.csv"], "did you mean 'mass'?"
    raise AssertionError(kind)


@pytest.mark.parametrize(
    "kind",
    [
        "missing recording",
        "missing robot",
        "missing map",
        "missing validation",
        "truncated",
        "NaN column",
        "unsorted time",
        "absent channel",
        "too short",
        "cut-off below nothing",
        "cut-off of nothing",
        "cut-off that is no number",
        "cut-off above the samples",
        "fitted and validated",
        "fitted twice",
        "no moving joint",
        "torque in one only",
        "no table",
        "unknown key",
    ],
)
def test_unusable_input_gives_one_sentence_code_2_and_no_file(
    kind: str, case: Path, tmp_path: Path, front: Front
) -> None:
    words, sentence = spoilt(case, tmp_path, kind)
    out = tmp_path / "out"
    message = front.diagnose(*words, "--out", out, "--quiet")
    assert message.code == UNUSABLE_INPUT
    assert message.out == ""
    assert message.err.startswith("missing-physics: ")
    assert message.err.count("\n") == 1
    assert sentence in message.err
    assert "Traceback" not in message.err
    assert not out.exists()


def test_unwritable_folder_is_rejected(case: Path, tmp_path: Path, front: Front) -> None:
    (tmp_path / "out").write_text("a file where the folder should be")
    message = front.diagnose(
        case / "robot.toml", case / "recording.csv", "--out", tmp_path / "out", "--quiet"
    )
    assert message.code == UNUSABLE_INPUT
    assert f"{tmp_path / 'out'} is a file; give a folder for the results." in message.err
    assert (tmp_path / "out").read_text() == "a file where the folder should be"
