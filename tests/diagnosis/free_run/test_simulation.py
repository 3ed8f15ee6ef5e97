"""The refit in simulation: roles, the controller in force, what the ladder lets in and what it does not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from end_to_end_cases import AXIS, FRICTION, QUICK, otherwise

from missing_physics.diagnosis import Options, one_look
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.free_run.problem import Trial
from missing_physics.diagnosis.free_run.recordings import obstacle, parts_of, trial_of
from missing_physics.diagnosis.preparation.setup import make_segments
from missing_physics.diagnosis.simulation import refinement as simulation
from missing_physics.diagnosis.simulation.fit import grouped, nominal_names
from missing_physics.diagnosis.simulation.refinement import Given, Simulated
from reference_model.simulation import simulate
from robot_model import (
    Actuator,
    EffectUse,
    InputError,
    Joint,
    JointPD,
    Link,
    MultiSine,
    NoController,
    Recording,
    Reference,
    Robot,
    VoltageServo,
    load_robot,
    robot_from_toml,
)

STEP = 2 * np.pi / 4096
LAGGING = EffectUse(effect="viscous_friction", at="joint1", coefficient=0.012)
DRY = EffectUse(effect="coulomb_friction", at="joint1", torque=0.02)


def servo(*effects: EffectUse, gain: float = 0.6, duration: float = 5.0) -> Robot:
    """0.49 kg at 0.1 m on a hobby servo."""
    waves = MultiSine(joint="joint1", amplitudes=(0.7, 0.5), frequencies=(0.4, 1.3), phases=(0.0, 1.0))
    motor = Actuator(rotor_inertia=0.0018, torque_constant=0.38, resistance=4.0)
    return Robot(
        name="servo",
        gravity=(0.0, 0.0, -9.80665),
        links=(Link(name="arm", mass=0.49, center_of_mass=(0.0, 0.0, -0.1)),),
        joints=(Joint(name="joint1", parent="base", child="arm", axis=(0.0, 1.0, 0.0), actuator=motor),),
        known=("arm.mass",),
        controller=VoltageServo(gain=gain, supply=7.4),
        reference=Reference(duration=duration, sample_rate=200.0, joints=(waves,)),
        effects=effects,
    )


def logged(robot: Robot, seed: int) -> Recording:
    """Position by a coarse encoder, the goal, and the voltage that the firmware reports."""
    true = simulate(robot, sensors=False)
    chance = np.random.default_rng(seed)
    said = np.round((true["joint1.position"] + chance.normal(0.0, STEP / 3, len(true))) / STEP) * STEP
    goal = true["joint1.reference_position"]
    assert isinstance(robot.controller, VoltageServo)
    duty = np.clip(float(np.ravel(robot.controller.gain)[0]) * (goal - said), -1, 1)
    channels = {
        "joint1.position": said,
        "joint1.reference_position": goal,
        "joint1.voltage": robot.controller.supply * duty,
    }
    return Recording(true.time, channels, f"log {seed}", resolution={"joint1.position": STEP})


def test_roles_are_disjoint_and_validation_is_never_fitted() -> None:
    trials = [Trial(logged(servo(duration=4.5), seed)) for seed in range(4)]
    given = parts_of(trials[:2], trials[2:])
    sources = [{t.recording.source for t in role} for role in (given.fit, given.folds[0][1], given.score)]
    assert sources == [{"log 0", "log 1"}, {"log 2"}, {"log 3"}]
    alone = parts_of(trials, [])
    assert alone.score == ()
    assert [[t.recording.source for t in decide] for _, decide in alone.folds] == [
        ["log 1", "log 2"],
        ["log 0", "log 3"],
    ]
    for fitted, decide in parts_of(trials[:1], []).folds:
        [one], [other] = fitted, decide
        assert not set(one.recording.time) & set(other.recording.time)


def test_the_gain_in_force_is_found_from_the_voltage() -> None:
    robot = servo(DRY, gain=0.25)
    recording = logged(robot, 1)
    nominal = servo(gain=0.6)
    [segment] = make_segments(nominal, [recording])
    trial, words = trial_of(nominal, recording, segment.motion)
    assert isinstance(trial.controller, VoltageServo)
    # exact but for the tolerance of the search, 1e-5 of the logarithm
    assert np.ravel(trial.controller.gain)[0] == pytest.approx(0.25, rel=1e-3)
    assert "log 1" in words


@pytest.mark.proof
def test_another_controller_is_refused() -> None:
    robot = load_robot("two_link_arm")
    assert isinstance(robot.controller, JointPD)
    recording = simulate(robot, seed=1)
    [segment] = make_segments(robot, [recording])
    assert trial_of(robot, recording, segment.motion)[1] == ""
    weak = robot.controller.model_copy(update={"kp": 100.0, "kd": 5.0})
    with pytest.raises(InputError, match="not what the robot's controller commands"):
        trial_of(robot.model_copy(update={"controller": weak}), recording, segment.motion)


def test_says_what_is_missing_for_a_free_run() -> None:
    robot = servo()
    recording = logged(robot, 1)
    assert obstacle(robot, [recording]) == ""
    assert "no controller" in obstacle(robot.model_copy(update={"controller": NoController()}), [recording])
    without = {k: v for k, v in recording.channels.items() if "reference" not in k}
    assert "reference_position" in obstacle(robot, [replace(recording, channels=without)])
    assert "shorter" in obstacle(robot, [recording.window(0.0, 1.0)])
    floating = robot.model_copy(update={"base": robot.base.model_copy(update={"kind": "free", "mass": 1.0})})
    assert "floats" in obstacle(floating, [recording])


def test_known_numbers_are_not_freed_and_motor_constants_go_together() -> None:
    names = nominal_names(servo())
    assert "arm.mass" not in names
    assert ("joint1.torque_constant", "joint1.resistance") in grouped(names)


@pytest.mark.proof
def test_what_the_regression_missed_is_named_in_simulation_and_says_so() -> None:
    # A coarse encoder leaves the regression few frequencies; free runs of two gains see more.
    logs = [logged(servo(DRY, LAGGING, gain=gain), seed) for seed, gain in enumerate((0.25, 0.25, 0.9, 0.9))]
    diagnosis = diagnose(servo(), logs, options=Options(experiments=False)).diagnosis
    found = {f.effect: f for f in diagnosis.findings}
    assert "viscous_friction" in found or "coulomb_friction" in found
    fit = diagnosis.fit.channels["joint1.position"]
    assert fit.after.validation_rms < 0.3 * fit.before.validation_rms
    for name, true in (("viscous_friction", 0.012), ("coulomb_friction", 0.02)):
        if name in found:
            [estimate] = found[name].parameters.values()
            assert estimate.value == pytest.approx(true, rel=0.25)
    assert any("deci" in note for note in diagnosis.notes)


def test_without_a_controller_the_diagnosis_says_why() -> None:
    robot = servo()
    logs = [logged(servo(DRY, LAGGING), 1)]
    mute = robot.model_copy(update={"controller": NoController()})
    diagnosis = diagnose(mute, logs, options=Options(experiments=False)).diagnosis
    assert any("not possible: the robot file names no controller" in note for note in diagnosis.notes)
    assert "joint1.position" not in diagnosis.fit.channels


@pytest.mark.proof
def test_a_refit_that_runs_farther_off_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Free runs of positions may want other masses; torques in closed loop may not."""
    recordings = [
        simulate(r.with_effects(FRICTION), seed=5 + k) for k, r in enumerate((AXIS, otherwise(AXIS)))
    ]
    heavier = AXIS.links[0].model_copy(update={"mass": 1.5 * AXIS.links[0].mass})

    def refitted(given: Given, progress: Any) -> Simulated:
        return Simulated(given.robot.model_copy(update={"links": (heavier,)}), notes=("refitted",))

    def asked(given: Given, progress: Any) -> Simulated:
        return simulation.refit_in_simulation(replace(given, joints={"joint1"}), progress)

    monkeypatch.setattr(simulation, "_refitted", refitted)
    monkeypatch.setattr(one_look, "refit_in_simulation", asked)
    lacks = AXIS.model_copy(update={"effects": ()})
    result = diagnose(lacks, recordings[:1], recordings[1:], options=QUICK)
    assert robot_from_toml(result.augmented_robot_toml).links[0].mass != heavier.mass
    assert simulation.FARTHER in result.diagnosis.notes
    assert "refitted" not in result.diagnosis.notes
