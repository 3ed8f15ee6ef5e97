"""Joints that nothing drives: their torque is known to be nothing, and that tells what holds them."""

from __future__ import annotations

import numpy as np
import pytest
from diagnosis_cases import plain_view, problem_of, term

from missing_physics.checks.actuation import is_passive
from missing_physics.diagnosis import Options, Result
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.candidates.effects import candidates
from missing_physics.diagnosis.least_squares.explanation import explain
from reference_model.simulation import simulate
from robot_model import Recording, Robot, robot_from_toml

#: A driven hub with an arm on a spring at its rim: `hinge` has no actuator.
SPRUNG = """
name = "sprung_arm"
known = ["hub", "arm"]
effects = [
    { effect = "cable_spring", at = "hinge", stiffness = 30.0 },
    { effect = "viscous_friction", at = "hinge", coefficient = 0.1 },
    { effect = "viscous_friction", at = "motor", coefficient = 2.0 },
]

[[links]]
name = "hub"
mass = 1.0
inertia = [0.1, 0.1, 0.1]

[[links]]
name = "arm"
mass = 1.5
center_of_mass = [0.3, 0.0, 0.0]
inertia = [0.02, 0.02, 0.02]

[[joints]]
name = "motor"
parent = "base"
child = "hub"
actuator = { gear_ratio = 50.0, rotor_inertia = 2e-5 }

[[joints]]
name = "hinge"
parent = "hub"
child = "arm"
origin = [0.08, 0.0, 0.0]

[[sensors]]
channel = "motor.position"
noise = 1e-5

[[sensors]]
channel = "hinge.position"
noise = 2e-5

[[sensors]]
channel = "motor.torque"
noise = 0.02

[controller]
kind = "pd"
kp = [150.0, 0.0]
kd = [15.0, 0.0]

[reference]
duration = 16.0
sample_rate = 250.0

[[reference.joints]]
joint = "motor"
kind = "multisine"
amplitudes = [0.5, 0.2, 0.05]
frequencies = [0.17, 0.43, 1.1]
phases = [0.0, 1.3, 2.1]
ramp = 1.0
"""
#: What the file says of the spring, and what it is; 30 N m/rad is what the theory of a slender beam promises.
STATED, TRUE = 30.0, 21.0


def without_torque(recording: Recording, joint: str) -> Recording:
    """As a machine records: no channel for what does not exist."""
    kept = {n: recording[n] for n in recording if not n.startswith(f"{joint}.") or n.endswith(".position")}
    noise = {n: s for n, s in recording.noise.items() if n in kept}
    return Recording(recording.time, kept, recording.source, noise=noise)


@pytest.fixture(scope="module")
def nominal() -> Robot:
    return robot_from_toml(SPRUNG)


@pytest.fixture(scope="module")
def found(nominal: Robot) -> Result:
    text = SPRUNG.replace(f"stiffness = {STATED}", f"stiffness = {TRUE}")
    made = simulate(robot_from_toml(text), seed=3)
    return diagnose(
        nominal, [without_torque(made, "hinge")], options=Options(experiments=False, simulation=False)
    )


def test_a_wrong_spring_of_a_passive_joint_is_named_with_its_stiffness(found: Result) -> None:
    [finding] = found.diagnosis.findings
    assert (finding.effect, finding.location) == ("cable_spring", "hinge")
    stiffness = finding.parameters["stiffness"]
    # 3 %: what the noise of a twice differentiated position makes of it
    assert stiffness.value == pytest.approx(TRUE, rel=0.03)
    assert stiffness.ci95[1] < STATED
    assert finding.probability > 0.9
    assert "The robot file has it already, with stiffness 30 N m/rad." in finding.note


def test_the_wrong_spring_lowers_the_held_out_error(found: Result) -> None:
    fit = found.diagnosis.fit.channels["hinge.torque"]
    assert fit.after.validation_rms < 0.5 * fit.before.validation_rms
    assert found.diagnosis.findings[0].validation_improvement > 0


def test_left_out_means_as_in_the_robot_file(nominal: Robot) -> None:
    """What a finding brings is weighed against the stated spring, not against no spring at all."""
    problem = problem_of(nominal, without_torque(simulate(nominal, seed=3), "hinge"))
    spring = term("cable_spring", "hinge", stiffness=TRUE)
    friction = term("coulomb_friction", "motor", torque=1.0)
    fitted = explain(problem, plain_view(problem), [spring, friction])
    [stated, _] = fitted.terms_without(spring)
    assert (stated.key, stated.frozen, stated.nominal) == (spring.key, True, True)
    assert stated.parameters == {"stiffness": STATED, "torque_at_zero": 0.0}
    assert [t.key for t in fitted.terms_without(friction)] == [spring.key]


def test_no_relative_error_where_nothing_drives(found: Result) -> None:
    channels = found.diagnosis.fit.channels
    assert channels["hinge.torque"].relative_error_after is None
    assert channels["motor.torque"].relative_error_after is not None
    assert all("hinge.torque" not in stage.relative_error for stage in found.diagnosis.stages)


def test_no_actuator_effect_where_there_is_no_actuator(nominal: Robot) -> None:
    problem = problem_of(nominal, without_torque(simulate(nominal, seed=3), "hinge"))
    fitted = explain(problem, plain_view(problem), [])
    places: dict[str, set[str]] = {}
    for option in candidates(problem, fitted, nominal_numbers=True):
        places.setdefault(option.term.effect.id, set()).add(option.term.at)
    for effect in ("torque_ripple", "torque_gain", "torque_offset", "actuator_lag"):
        assert places[effect] == {"motor"}
    assert "hinge" in places["coulomb_friction"]


def test_a_stated_spring_that_is_right_is_no_finding(nominal: Robot) -> None:
    made = without_torque(simulate(nominal, seed=4), "hinge")
    diagnosis = diagnose(nominal, [made], options=Options(experiments=False, simulation=False)).diagnosis
    assert diagnosis.findings == ()


def test_what_is_passive(nominal: Robot) -> None:
    time = np.arange(60) / 100.0
    positions = {"motor.position": time, "hinge.position": time}
    bare = Recording(time, positions)
    assert is_passive(nominal, bare, "hinge")
    assert not is_passive(nominal, bare, "motor")
    for quantity in ("torque", "current", "voltage"):
        assert not is_passive(nominal, Recording(time, {**positions, f"hinge.{quantity}": time}), "hinge")
    # A file that mentions no actuator at all leaves open what drives its joints.
    silent = robot_from_toml(SPRUNG.replace("actuator = { gear_ratio = 50.0, rotor_inertia = 2e-5 }", ""))
    assert not is_passive(silent, bare, "hinge")
