"""Offsets between torque and motion: estimated within two samples, undone, and no missing physics."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from missing_physics.diagnosis import Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.comparison.timing import aligned, with_timing
from missing_physics.results.result import Diagnosis, Estimate, Finding, Fit, Result
from missing_physics.standard import Offset
from reference_model.simulation import simulate
from robot_model import EffectUse, NoController, Recording, Robot, load_robot

RATE = 250.0
ARM = load_robot("two_link_arm").model_copy(update={"effects": ()})
JOINTS = [joint.name for joint in ARM.moving_joints]
#: What the file does not say.
MACHINE = ARM.with_effects(
    *(EffectUse(effect="viscous_friction", at=joint, **{"coefficient": 2.0}) for joint in JOINTS),
    *(EffectUse(effect="coulomb_friction", at=joint, **{"torque": 1.5}) for joint in JOINTS),
)


@pytest.fixture(scope="module")
def run() -> Recording:
    assert MACHINE.reference is not None
    short = MACHINE.reference.model_copy(update={"duration": 12.0, "sample_rate": RATE})
    made = simulate(MACHINE.model_copy(update={"reference": short}), seed=1)
    names = [f"{joint}.{what}" for joint in JOINTS for what in ("position", "torque")]
    return Recording(made.time, {name: made[name] for name in names}, "simulated")


def late(run: Recording, samples: float, joints: list[str] = JOINTS) -> Recording:
    """The torque of `joints` recorded so many samples late."""
    instants = np.maximum(run.time - samples / RATE, 0.0)
    names = [f"{joint}.torque" for joint in joints]
    return run.with_channels({n: make_interp_spline(run.time, run[n], k=3)(instants) for n in names})


@pytest.mark.parametrize("samples", [-0.7, 0.5, 1.0])
def test_a_small_common_offset_is_found_and_undone(run: Recording, samples: float) -> None:
    recording = late(run, samples)
    found = aligned(ARM, [recording], 1)
    [timing] = found.timing
    assert timing.undone
    assert timing.samples == pytest.approx(samples, abs=0.2)
    assert timing.ci95[0] < timing.offset < timing.ci95[1]
    inside = slice(50, -50)
    for joint in JOINTS:
        channel = f"{joint}.torque"
        before, after = (
            np.std((r[channel] - run[channel])[inside]) for r in (recording, found.recordings[0])
        )
        assert after < 0.7 * before


@pytest.mark.parametrize(
    ("samples", "joints"),
    [(0.0, JOINTS), (5.0, JOINTS), (1.2, JOINTS[:1])],
    ids=["none", "too large", "of one joint"],
)
def test_what_is_no_offset_of_recording_stays_for_the_diagnosis(
    run: Recording, samples: float, joints: list[str]
) -> None:
    recording = late(run, samples, joints)
    found = aligned(ARM, [recording], 1)
    assert found.recordings == (recording,)
    assert not any(timing.undone for timing in found.timing)


def test_where_runs_are_possible_torques_stay_as_recorded(run: Recording) -> None:
    recording = late(run, 1.0)
    found = aligned(ARM, [recording], 1, runs=True)
    assert found.recordings == (recording,)
    assert found.timing[0].samples == pytest.approx(1.0, abs=0.2)


def test_one_small_delay_at_all_joints_is_timing_and_at_one_joint_a_finding(run: Recording) -> None:
    def delay(joint: str, value: float) -> Finding:
        told = Estimate(value, (value - 3e-4, value + 3e-4), "s")
        return Finding("sensor_delay", f"{joint}.torque", 0.99, {"delay": told})

    def left(*findings: Finding) -> Diagnosis:
        told = Diagnosis("arm", (), (), "explained", "", (), findings, Fit({}, 0.0))
        return with_timing(Result(told, (), (), ""), (), [run]).diagnosis

    both = left(delay("joint1", 0.003), delay("joint2", 0.0031))
    assert both.findings == ()
    assert both.timing[0].offset == pytest.approx(0.00305)
    assert len(left(delay("joint1", 0.003)).findings) == 1
    assert len(left(delay("joint1", 0.003), delay("joint2", 0.004)).findings) == 2
    assert len(left(delay("joint1", 0.02), delay("joint2", 0.02)).findings) == 2


def test_of_a_recording_too_short_nothing_is_said(run: Recording) -> None:
    assert aligned(ARM, [run.window(0.0, 0.7)], 1).timing == ()


def test_an_offset_that_a_recording_does_not_tell_stays_within_what_is_customary(
    run: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    def vague(*_: object) -> list[list[Offset]]:
        return [[Offset(joint, 50.0 / RATE, 35.0 / RATE) for joint in JOINTS]]

    monkeypatch.setattr("missing_physics.diagnosis.comparison.timing.torque_offsets", vague)
    found = aligned(ARM, [run], 1)
    assert found.recordings == (run,)
    [timing] = found.timing
    assert abs(timing.samples) < 0.2
    assert timing.ci95[1] - timing.ci95[0] == pytest.approx(2 * 1.96 / RATE, rel=0.05)


@pytest.fixture(scope="module")
def axis_runs() -> tuple[Robot, list[Recording]]:
    """One axis with dry friction that its file lacks, two runs; nothing is known of the controller."""
    axis = load_robot("single_axis").model_copy(update={"effects": ()})
    machine = axis.with_effects(EffectUse(effect="coulomb_friction", at="joint1", **{"torque": 2.0}))
    assert machine.reference is not None
    short = machine.reference.model_copy(update={"duration": 12.0, "sample_rate": RATE})
    machine = machine.model_copy(update={"reference": short})
    runs = []
    for seed in (1, 2):
        made = simulate(machine, seed=seed)
        channels = {name: made[name] for name in ("joint1.position", "joint1.torque")}
        runs.append(Recording(made.time, channels, f"run {seed}"))
    return axis.model_copy(update={"reference": None, "controller": NoController()}), runs


@pytest.mark.parametrize("samples", [0.5, 1.0, 5.0])
def test_a_whole_diagnosis_takes_a_small_delay_for_timing_and_a_large_one_for_physics(
    axis_runs: tuple[Robot, list[Recording]], samples: float
) -> None:
    axis, runs = axis_runs
    delayed = [late(run, samples, ["joint1"]) for run in runs]
    told = diagnose(axis, delayed[:1], delayed[1:], options=Options(experiments=False)).diagnosis
    named = {finding.effect: finding for finding in told.findings}
    assert named.pop("coulomb_friction").parameters["torque"].value == pytest.approx(2.0, rel=0.1)
    if samples < 1.5:
        assert named == {}
        assert [timing.samples for timing in told.timing] == pytest.approx([samples] * 2, abs=0.1)
        assert all(timing.undone for timing in told.timing)
    else:
        assert set(named) <= {"sensor_delay", "actuator_lag"}
        [finding] = named.values()
        [estimate] = finding.parameters.values()
        assert estimate.value == pytest.approx(samples / RATE, rel=0.1)
        assert told.timing == ()
