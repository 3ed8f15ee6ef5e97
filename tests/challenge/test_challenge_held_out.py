"""Held-out errors per joint, and the part that timing explains."""

from __future__ import annotations

import numpy as np
import pytest
from challenge_cases import ARM, AXIS, design, hiding, made
from quick_ones import quick_names

from missing_physics.challenge.cases.conditions import Conditions, TorqueRecord
from missing_physics.challenge.cases.truth import Design
from missing_physics.challenge.concealing.conceal import Concealed
from missing_physics.challenge.concealing.tuning import corrects_file
from missing_physics.challenge.scoring.held_out import held_out_errors
from missing_physics.challenge.scoring.information import IDENTIFIABLE, distances
from missing_physics.challenge.torques.along import ArmAlong
from robot_model import EffectUse

RATE = 200.0
RECORDS = {
    "measured": TorqueRecord(),
    "delayed": TorqueRecord(kind="delayed", delay=0.8 / RATE),
    "filtered": TorqueRecord(kind="filtered", order=2, corner=40.0),
}


def recorded(case: Design, record: TorqueRecord) -> Concealed:
    return made(case.model_copy(update={"conditions": Conditions(torque=record)}))


def errors(case: Concealed) -> dict[str, float]:
    """What the file and the true robot leave at the first joint."""
    robots = {"nominal": case.given, "answer": case.design.real}
    robots = {name: case.completed(robot) for name, robot in robots.items()}
    return held_out_errors(case, robots, case.recordings[1])["joint1"]


@pytest.mark.parametrize("kind", quick_names(RECORDS, "measured", "filtered"))
def test_true_robot_leaves_noise_for_every_kind_of_torque_record(kind: str) -> None:
    case = recorded(hiding("viscous_friction", "joint1", coefficient=150.0), RECORDS[kind])
    found = errors(case)
    assert found["answer"] == pytest.approx(found["noise"], rel=0.02)
    # Passing the log takes nothing from a slow part; both parts are independent.
    velocity = case.exact[1]["joint1.velocity"]
    missing = 150.0 * np.sqrt(np.mean(velocity**2))
    assert found["nominal"] == pytest.approx(np.hypot(found["noise"], missing), rel=0.05)


@pytest.mark.parametrize(
    ("effect", "values"),
    [("sensor_offset", {"offset": 9.0}), ("sensor_gain", {"gain_error": 0.3})],
)
def test_torque_sensor_errors_are_part_of_the_expected_torque(effect: str, values: dict[str, float]) -> None:
    found = errors(made(hiding(effect, "joint1.torque", **values)))
    assert found["answer"] == pytest.approx(found["noise"], rel=0.01)
    assert found["nominal"] > 1.2 * found["noise"]


def test_unusable_robot_has_no_held_out_error() -> None:
    case = made(design())
    other = design(ARM).nominal
    found = held_out_errors(case, {"nominal": case.given, "answer": other, "x": None}, case.recordings[1])
    assert set(found["joint1"]) == {"noise", "nominal"}


def distance(case: Design) -> float:
    there = made(case)
    [found] = distances(ArmAlong(there.sensed_by, there.exact[0]), case.hidden).values()
    return found


def test_one_sample_delay_is_timing_and_a_long_delay_is_an_effect() -> None:
    """All torques of the axis come late, as from a bus of their own; at 200 Hz a sample is 5 ms."""
    short, long = (
        distance(hiding("sensor_delay", "joint1.torque", AXIS, delay=seconds)) for seconds in (0.005, 0.03)
    )
    assert short < 0.5 * IDENTIFIABLE  # 360 if no timing were taken off, 8 by a delay to second order
    assert long > IDENTIFIABLE


def test_delay_at_one_of_two_joints_is_not_timing() -> None:
    """What differs between joints is no offset between the buses of torque and position."""
    one = distance(hiding("sensor_delay", "joint2.torque", ARM, delay=0.005))
    assert one > 0.5 * IDENTIFIABLE


def test_friction_is_not_explained_by_timing() -> None:
    assert distance(hiding("coulomb_friction", "joint1", torque=8.0)) > 10 * IDENTIFIABLE


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize(
    ("error", "effect", "name"),
    [
        ("link2.mass", "payload", "mass"),
        ("link2.mass", "inertia", "mass"),
        ("link2.inertia", "inertia", "inertia_zz"),
        ("joint2.rotor_inertia", "inertia", "inertia_yy"),
    ],
)
def test_a_finding_that_corrects_a_wrong_file_is_right(sign: int, error: str, effect: str, name: str) -> None:
    """Where the file has too much, less is right."""
    case = design(ARM)
    wrong = case.model_copy(update={"conditions": Conditions(file_errors={error: 0.08})})
    item = {"effect": effect, "location": "link2", "parameters": {name: {"value": 0.01 * sign}}}
    assert corrects_file(wrong, Concealed(wrong).given, item) == (sign < 0)
    assert not corrects_file(case, made(case).given, item)


def test_finding_of_wrong_friction_replaces_the_whole_coefficient() -> None:
    use = EffectUse.model_validate({"effect": "viscous_friction", "at": "joint1", "coefficient": 100.0})
    case = design()
    case = case.model_copy(update={"nominal": case.nominal.model_copy(update={"effects": (use,)})})
    conditions = Conditions(file_errors={"viscous_friction@joint1": -0.1})
    wrong = case.model_copy(update={"conditions": conditions})
    given = Concealed(wrong).given
    assert given.effects[0].parameters["coefficient"] == pytest.approx(90.0)
    for value, right in ((95.0, True), (80.0, False)):
        item = {"effect": use.effect, "location": use.at, "parameters": {"coefficient": {"value": value}}}
        assert corrects_file(wrong, given, item) == right
