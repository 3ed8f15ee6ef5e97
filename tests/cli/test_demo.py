"""The demo: a case is sealed before it is diagnosed, and failures are shown."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer import Typer
from typer.testing import CliRunner

from exudyn_model.control.motion import motions
from missing_physics.challenge import one_case
from missing_physics.challenge.cases.ranges import DRY
from missing_physics.challenge.concealing.conceal import FILES
from missing_physics.challenge.one_case import draw_case
from missing_physics.challenge.processes import stage
from missing_physics.challenge.processes.stage import Outcome
from missing_physics.challenge.seals.seal import digest, unseal
from missing_physics.cli.commands import demo as module
from missing_physics.reporting.terminal.console import PlainConsole
from reference_model.simulation import simulate
from robot_model import EffectUse, Robot, robot_from_toml

SEEDS = range(40)


def test_demo_draws_all_kinds_and_joints_reproducibly() -> None:
    drawn = [draw_case(seed) for seed in SEEDS]
    assert {case.hidden[0].effect for case in drawn} == {"coulomb_friction", "stribeck_friction"}
    assert {case.hidden[0].at for case in drawn} == {"joint1", "joint2"}
    assert all(case.nominal.flexible_links and case.nominal.base.kind == "free" for case in drawn)
    assert not {use.effect for use in drawn[0].nominal.effects} & set(DRY)
    assert draw_case(3) == draw_case(3)


def test_demo_motions_keep_the_limits_and_differ() -> None:
    time = np.arange(0, one_case.DURATION, 0.02)
    for seed in range(10):
        case = draw_case(seed)
        other = case.nominal.model_copy(update={"reference": case.validation})
        for joint, *both in zip(case.nominal.moving_joints, motions(case.nominal), motions(other)):
            one, two = (np.array([motion(t)[:2] for t in time]) for motion in both)
            assert max(np.abs(one[:, 1]).max(), np.abs(two[:, 1]).max()) < joint.velocity_limit
            assert one[:, 1].min() < 0 < one[:, 1].max()
            assert np.corrcoef(one[:, 0], two[:, 0])[0, 1] < 0.98


FOUND = {
    "effect": "coulomb_friction",
    "location": "joint1",
    "probability": 0.97,
    "ambiguous_with": [],
    "parameters": {"torque": {"value": 4.0, "ci95": [3.9, 4.1], "unit": "N m"}},
}
ANSWER = {"verdict": "explained", "findings": [FOUND], "mismatch": []}


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """One second of motion in this process and in the other engine."""

    def exact(robot: str) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        made = simulate(Robot.model_validate_json(robot), sensors=False)
        return made.time, dict(made.channels)

    class Here:
        def __init__(self, *args: Any, **kwargs: Any) -> None: ...
        def __enter__(self) -> Here:
            return self

        def __exit__(self, *args: object) -> None: ...
        def map(self, function: Any, items: list[str]) -> list[Any]:
            return [exact(item) for item in items]

    monkeypatch.setattr(one_case, "ProcessPoolExecutor", Here)
    monkeypatch.setattr(one_case, "DURATION", 1.0)


def run(*arguments: str) -> Any:
    app = Typer()
    module.register(app)
    return CliRunner().invoke(app, list(arguments))


@pytest.mark.usefixtures("quick")
def test_demo_stores_the_truth_in_no_file_before_the_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Mapping[str, bytes]] = []
    out = tmp_path / "demo"

    def answered(step: str, files: Mapping[str, bytes], **options: Any) -> Outcome:
        truth = draw_case(7).hidden[0]
        assert list(tmp_path.iterdir()) == []
        assert all(truth.effect.encode() not in content for content in files.values())
        assert options["hidden"] == (str(out.resolve()),)
        assert step == "diagnose"
        seen.append(files)
        return Outcome("done", {"diagnosis.json": json.dumps(ANSWER).encode()}, "", 1, 1.0)

    monkeypatch.setattr(stage, "carry_out", answered)
    result = run("--out", str(out), "--seed", "7")
    assert result.exit_code == 0, result.output
    assert set(seen[0]) == set(FILES)
    words = result.output
    assert f"hidden: {draw_case(7).hidden[0].effect} at {draw_case(7).hidden[0].at}" in words
    assert "EXPLAINED" in words
    assert "coulomb_friction at joint1, probability 0.97" in words
    assert str(out / "report.html") in words
    assert "--seed 7" in words
    # what was promised before the diagnosis is what the published key opens
    opened = json.loads((out / "opened.json").read_text())
    sealed = (out / "sealed.bin").read_bytes()
    assert digest(sealed) in words
    truth = unseal(sealed, bytes.fromhex(opened["key"]), what="sealed.bin")
    assert digest(truth) in words
    assert words.index(digest(truth)) < words.index("The diagnosis says")
    assert json.loads(truth) == opened["truth"]
    assert robot_from_toml(seen[0]["robot.toml"].decode()).effects == draw_case(7).nominal.effects


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(("status", "code"), [("refused", 2), ("failed", 1), ("stopped", 75)])
def test_failing_diagnosis_ends_the_demo_and_keeps_the_earlier_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, status: Any, code: int
) -> None:
    monkeypatch.setattr(
        stage, "carry_out", lambda *a, **k: Outcome(status, {}, "no torque was recorded", 1, 1.0)
    )
    earlier = {*module.MADE, *module.CASE}
    for name in earlier:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("old")
    result = run("--out", str(tmp_path), "--seed", "7")
    assert result.exit_code == code
    assert "no torque was recorded" in result.output
    left = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert left == earlier
    assert all((tmp_path / name).read_bytes() == b"old" for name in earlier)


def test_demo_draws_a_random_seed_by_default() -> None:
    assert len({module.secrets.randbits(module.SEED_BITS) for _ in range(5)}) == 5


def revealed(truth: dict[str, Any], findings: list[dict[str, Any]]) -> str:
    console = PlainConsole(record=True, width=80)
    module.reveal(EffectUse.model_validate(truth), findings, console)
    return console.export_text()


def test_demo_prints_truth_and_finding() -> None:
    text = revealed({"effect": "coulomb_friction", "at": "joint1", "torque": 4.05}, [FOUND])
    rows = {line.split()[0]: line.split() for line in text.splitlines() if line.strip()}
    assert "hidden: coulomb_friction at joint1" in text
    assert "found:  coulomb_friction at joint1 (effect: yes, place: yes)" in text
    assert rows["torque"] == ["torque", "[N", "m]", "4.05", "4.00", "3.90", "to", "4.10", "yes"]


def test_demo_prints_a_failed_diagnosis() -> None:
    truth = {"effect": "cable_spring", "at": "joint2", "stiffness": 3.0}
    text = revealed(truth, [FOUND, {**FOUND, "effect": "torque_offset", "location": "joint2"}])
    rows = {line.split()[0]: line.split() for line in text.splitlines() if line.strip()}
    assert "found:  torque_offset at joint2 (effect: no, place: yes)" in text
    assert rows["stiffness"][:3] == ["stiffness", "3", "-"]
    assert "torque" not in rows  # a wrong effect's numbers are not set beside the truth's
    assert "also found: coulomb_friction at joint1" in text
    assert "found:  nothing (missed)" in revealed(truth, [])


def test_demo_prints_a_truth_among_ambiguous_findings() -> None:
    truth = {"effect": "torque_offset", "at": "joint1", "torque": 3.0}
    several = {**FOUND, "ambiguous_with": ["torque_offset@joint1"]}
    assert "among those that these data cannot distinguish" in revealed(truth, [several])
    assert "in the set" not in revealed(truth, [FOUND])


#: Longest time from the command to the revealed truth [s].
LONGEST = 120.0


@pytest.mark.proof
def test_demo_finishes_in_time_with_all_files(tmp_path: Path) -> None:
    """The real command, twice in one folder: what the first left is gone or replaced."""
    fresh, took = [], []
    for seed in (5, 6):
        began = time.monotonic()
        words = [sys.executable, "-m", "missing_physics", "demo", "--out", str(tmp_path), "--seed", str(seed)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        took.append(time.monotonic() - began)
        assert done.returncode == 0, done.stderr
        assert f"hidden: {draw_case(seed).hidden[0].effect} at {draw_case(seed).hidden[0].at}" in done.stdout
        assert (tmp_path / "report.html").stat().st_size > 0
        assert (tmp_path / "comparison.rrd").stat().st_size > 0
        opened = json.loads((tmp_path / "opened.json").read_text())
        assert opened["seed"] == seed
        fresh.append({name: (tmp_path / name).read_bytes() for name in (*module.CASE, *module.MADE)})
    assert all(fresh[0][name] != fresh[1][name] for name in fresh[0])
    found = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert found == {*module.CASE, *module.MADE}
    assert max(took) < LONGEST, took
