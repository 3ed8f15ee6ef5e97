"""Next experiments: inside the limits, better than what was recorded, and a file that can be read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnosis_cases import Array, Sines, bare, plain_view, problem_of, recorded, term
from scipy.interpolate import make_interp_spline

from missing_physics.diagnosis import Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.experiments.design import design_experiments, still_needed
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.naming.judge import Weighed
from missing_physics.recordings import load_recording
from missing_physics.results.result import Diagnosis, Experiment, Finding, Result
from reference_model.simulation import simulate
from robot_model import Actuator, EffectUse, Quintic, Recording, Reference, Table

ROBOT = bare("single_axis", noise=True)
#: One fast sine: its velocity is large whenever the joint moves, so that Coulomb and viscous friction
#: differ little, and a spring and the mass not at all.
POOR = (Sines((0.05,), (0.5,), (0.0,), centre=0.2),)
DRY = term("coulomb_friction", "joint1", torque=20.0)
WET = term("viscous_friction", "joint1", coefficient=200.0)


@pytest.fixture(scope="module")
def best() -> Explanation:
    made = recorded(ROBOT, POOR, lambda t, q, qd, qdd: 20.0 * np.sign(qd), seed=1)
    problem = problem_of(ROBOT, made)
    return explain(problem, plain_view(problem), [DRY])


def designed(
    best: Explanation, *, rival: float = 0.4, seed: int = 0
) -> tuple[list[Experiment], dict[str, str]]:
    weighed = [Weighed(best.terms[0], 1 - rival, ((WET, rival),))]
    told, motions = design_experiments(ROBOT, best.problem, best, weighed, seed=seed)
    return list(told), motions


@pytest.fixture(scope="module")
def motion(best: Explanation, tmp_path_factory: pytest.TempPathFactory) -> Recording:
    path: Path = tmp_path_factory.mktemp("motion") / "experiment_1.csv"
    path.write_text(designed(best)[1]["experiment_1.csv"])
    return load_recording(path)


def separation(time: Array, position: Array) -> float:
    """rms of Coulomb friction that neither viscous friction nor mass nor offset can imitate [N]."""
    spline = make_interp_spline(time, position, k=5)
    columns = np.column_stack([spline(time, 1), spline(time, 2)])
    law = 20.0 * np.sign(columns[:, 0])
    left = law - columns @ np.linalg.lstsq(columns, law, rcond=None)[0]
    return float(np.sqrt(np.mean(left**2)))


def test_the_motion_is_a_readable_recording_within_the_limits(motion: Recording) -> None:
    assert list(motion) == ["joint1.reference_position"]
    joint = ROBOT.joint("joint1")
    position = motion["joint1.reference_position"]
    assert joint.position_limits is not None
    assert joint.velocity_limit is not None
    assert joint.position_limits[0] <= position.min() < position.max() <= joint.position_limits[1]
    assert np.abs(np.gradient(position, motion.time)).max() <= joint.velocity_limit
    assert motion.duration > 10.0
    assert np.ptp(np.diff(motion.time)) < 1e-6
    speed = np.gradient(position, motion.time)
    assert position[0] == pytest.approx(joint.initial_position, abs=1e-6)  # a robot can begin there
    assert np.abs(speed[[0, -1]]).max() < 1e-3 * np.abs(speed).max()


def test_a_slow_robot_gets_a_slow_motion(tmp_path: Path) -> None:
    """A tenth of the recorded speed is allowed."""
    limit = 0.015
    joint = ROBOT.joints[0].model_copy(update={"velocity_limit": limit})
    robot = ROBOT.model_copy(update={"joints": (joint,)})
    problem = problem_of(robot, recorded(robot, POOR, seed=1))
    explained = explain(problem, plain_view(problem), [DRY])
    for seed in range(3):
        (tmp_path / "motion.csv").write_text(designed(explained, seed=seed)[1]["experiment_1.csv"])
        slow = load_recording(tmp_path / "motion.csv")
        speed = np.abs(np.gradient(slow["joint1.reference_position"], slow.time)).max()
        assert 0.01 * limit < speed <= limit


def test_it_separates_better_than_the_recorded_motion(best: Explanation, motion: Recording) -> None:
    now = separation(motion.time, motion["joint1.reference_position"])
    recorded_motion = best.problem.segments[0].motion
    before = separation(recorded_motion.time, POOR[0](recorded_motion.time)[0])
    assert now > 1.1 * before


def test_the_sentence_names_both_and_the_file(best: Explanation) -> None:
    [told], motions = designed(best)
    assert told.separates == ("coulomb_friction", "viscous_friction")
    assert told.motion == "experiment_1.csv"
    assert told.motion in told.do
    assert list(motions) == [told.motion]
    assert "times the present residual" in told.why


def test_no_rival_no_experiment(best: Explanation) -> None:
    assert designed(best, rival=0.01) == ([], {})


def test_the_same_seed_draws_the_same_motion(best: Explanation) -> None:
    assert designed(best)[1] == designed(best)[1]
    assert designed(best)[1] != designed(best, seed=1)[1]


ONE_WAY = Reference(
    duration=6.0,
    sample_rate=200.0,
    joints=(Quintic(joint="joint1", displacement=0.3, start=0.5, duration=5.0),),
)


@pytest.mark.proof
@pytest.mark.parametrize(
    ("truth", "left"),
    [
        (EffectUse(effect="coulomb_friction", at="joint1", torque=20.0), {"coulomb_friction@joint1"}),
        (
            EffectUse(effect="torque_offset", at="joint1", torque=-20.0),
            {"torque_offset@joint1", "sensor_offset@joint1.torque", "gravity@base"},
        ),
    ],
    ids=["friction", "offset"],
)
def test_the_motion_when_run_separates_what_was_ambiguous(
    truth: EffectUse, left: set[str], tmp_path: Path
) -> None:
    """A joint that moved one way only: dry friction, offset and gravity are the same.

    On one axis that never tilts, offset, gravity and the torque sensor's offset stay the same.
    """
    nominal = ROBOT.model_copy(update={"reference": ONE_WAY})
    first = simulate(nominal.with_effects(truth), seed=10162)
    asked = diagnose(nominal, [first], options=Options(simulation=False))
    assert asked.diagnosis.verdict == "ambiguous"
    assert {"coulomb_friction@joint1", "torque_offset@joint1"} <= told_of(asked.diagnosis)
    name = next(e.motion for e in asked.diagnosis.experiments if e.do.startswith("run the reference motion"))
    assert name is not None
    (tmp_path / name).write_text(asked.experiment_motions[name])
    motion = load_recording(tmp_path / name)
    position = tuple(motion["joint1.reference_position"])
    table = Table(joint="joint1", times=tuple(motion.time), positions=position)
    reference = Reference(duration=motion.duration, sample_rate=200.0, joints=(table,))
    moved = nominal.with_effects(truth).model_copy(update={"reference": reference})
    both = [first, simulate(moved, seed=10163)]
    answer = diagnose(nominal, both, options=Options(simulation=False)).diagnosis
    assert told_of(answer) == left


def told_of(diagnosis: Diagnosis) -> set[str]:
    """The one finding, with what it cannot be told from."""
    [finding] = diagnosis.findings
    return {f"{finding.effect}@{finding.location}", *finding.ambiguous_with}


def test_no_motion_needs_more_torque_than_the_actuator_has(best: Explanation) -> None:
    """The axis must be pushed against 20 N of friction, so a limit of 15 N allows no motion at all."""
    told, motions = designed(best)
    assert told[0].motion in motions
    limited = ROBOT.joints[0].model_copy(update={"actuator": Actuator(torque_limit=15.0)})
    robot = ROBOT.model_copy(update={"joints": (limited,)})
    problem = problem_of(robot, recorded(robot, POOR, lambda t, q, qd, qdd: 20.0 * np.sign(qd), seed=1))
    [weak], none = designed(explain(problem, plain_view(problem), [DRY]))
    assert weak.motion is None
    assert none == {}
    assert "limits of range, speed and torque" in weak.do


def test_what_runs_have_distinguished_needs_no_experiment_and_all_else_has_words() -> None:
    """Of three designed motions two are still needed; gears, which torques do not plan, are told in words."""
    made = simulate(bare("single_axis", noise=True).model_copy(update={"effects": ()}), seed=1)
    whole = diagnose(ROBOT, [made], options=Options(experiments=False, simulation=False))
    designed = [
        Experiment(("coulomb_friction", "viscous_friction"), "at joint1", "why", "experiment_1.csv"),
        Experiment(("payload", "torque_gain"), "settled", "why", "experiment_2.csv"),
        Experiment(("viscous_friction", "coulomb_friction"), "at joint2", "why", "experiment_3.csv"),
    ]
    findings = [
        Finding("viscous_friction", "joint1", 0.5, {}, ("coulomb_friction@joint1",)),
        Finding("link_flexibility", "link2", 0.5, {}, ("joint_elasticity@joint2",)),
    ]
    told = replace(whole.diagnosis, findings=tuple(findings), experiments=tuple(designed))
    motions = {f"experiment_{k}.csv": f"text {k}" for k in (1, 2, 3)}
    result: Result = still_needed(replace(whole, diagnosis=told, experiment_motions=motions))
    first, second, in_words = result.diagnosis.experiments
    assert (first, second) == (designed[0], designed[2])
    assert in_words.separates == ("link_flexibility", "joint_elasticity")
    assert in_words.motion is None
    assert in_words.do
    assert result.experiment_motions == {k: motions[k] for k in ("experiment_1.csv", "experiment_3.csv")}
