"""Degenerate recordings give a result or a sentence, and never a warning."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from missing_physics.cli import main
from missing_physics.recordings import write_recording
from robot_model import Recording, load_robot, save_robot

TIME = np.arange(1200) / 200.0
N = TIME.size
#: What a carriage of 95 kg needs for two sines, with the sensors' noise of the shipped axis.
POSITION = 0.05 * np.sin(3.0 * TIME) + 0.02 * np.sin(7.1 * TIME + 0.4)
FORCE = 95.0 * (-0.45 * np.sin(3.0 * TIME) - 0.02 * 7.1**2 * np.sin(7.1 * TIME + 0.4))
HALF = np.arange(N) > N // 2
ONE = np.arange(N) == N // 2


def noise(size: float, seed: int) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal(N)


MOVES, PUSHES = POSITION + noise(1e-6, 1), FORCE + noise(0.5, 2)
CASES: dict[str, tuple[np.ndarray, np.ndarray, int]] = {
    "no torque at all": (MOVES, 0.0 * TIME, 0),
    "constant torque": (MOVES, 3.7 + 0.0 * TIME, 0),
    "one torque": (MOVES, np.where(ONE, 1.0, 0.0), 0),
    "torque of noise alone": (MOVES, noise(0.5, 3), 0),
    "tiny torque": (MOVES, 1e-160 * PUSHES, 0),
    "small torque": (MOVES, 1e-40 * PUSHES, 0),
    "huge torque": (MOVES, 1e300 * PUSHES, 2),
    "a huge torque": (MOVES, np.where(ONE, 9e11, PUSHES), 0),
    "no motion": (0.0 * TIME, PUSHES, 0),
    "constant position": (0.3 + 0.0 * TIME, PUSHES, 0),
    "one position": (np.where(ONE, 0.1, 0.0), PUSHES, 0),
    "one step": (np.where(HALF, 0.1, 0.0), PUSHES, 0),
    "one sample moves": (np.where(HALF, 0.1, 0.0) + noise(1e-6, 1), PUSHES, 0),
    "tiny position": (1e-160 * MOVES, PUSHES, 0),
    "small position": (1e-40 * MOVES, PUSHES, 0),
    "huge position": (1e300 * MOVES, PUSHES, 2),
    "a huge position": (np.where(ONE, 9e11, MOVES), PUSHES, 2),
    "a ramp": (0.05 * TIME, 20.0 + 0.0 * TIME, 0),
    "nothing moves and nothing drives": (0.0 * TIME, 0.0 * TIME, 0),
    "half without numbers": (MOVES, np.where(HALF, np.nan, PUSHES), 0),
    "one number": (MOVES, np.where(ONE, 1.0, np.nan), 2),
}


#: With --as-recorded what is refused or left out is computed all the same.
INSISTING = [("no torque at all", True), ("constant torque", True), ("a huge position", True)]


#: Of each kind of the others there is one among the quick tests.
ALIKE = {
    *("tiny torque", "huge torque", "torque of noise alone", "constant position", "one position"),
    *("one sample moves", "tiny position", "small position", "a ramp", "a huge torque"),
}


def proof(case: str, insist: bool) -> bool:
    return case in ALIKE or (insist and case == "constant torque")


@pytest.mark.parametrize(
    ("case", "insist"),
    [
        pytest.param(case, insist, marks=pytest.mark.proof if proof(case, insist) else ())
        for case, insist in [*((case, False) for case in CASES), *INSISTING]
    ],
)
def test_degenerate_recordings_print_no_library_warnings(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    case: str,
    insist: bool,
) -> None:
    position, torque, code = CASES[case]
    robot, log = tmp_path / "robot.toml", tmp_path / "log.npz"
    save_robot(load_robot("single_axis"), robot)
    write_recording(Recording(TIME, {"joint1.position": position, "joint1.torque": torque}), log)

    def run(*words: object) -> int:
        monkeypatch.setattr("sys.argv", ["missing-physics", *map(str, words)])
        with pytest.raises(SystemExit) as left:
            main()
        return int(left.value.code or 0)

    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        words = ("diagnose", robot, log, "--out", tmp_path / "out", *(["--as-recorded"] if insist else []))
        ended = run(*words)
        if not insist:
            assert ended == code, capsys.readouterr().err
            assert run("inspect", log, "--robot", robot) in (0, 2)
    message = capsys.readouterr().err
    assert ended in (0, 2)
    assert "Warning" not in message
    assert "Traceback" not in message
