"""Cases of `remote` are drawn as its page says, and the page counts what its answers hold."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.unseen import remote
from benchmarks.unseen.remote import Answer, page
from benchmarks.unseen.remote_cases import friction_case, label_of, twin_case
from exudyn_model.bodies.mechanism import mechanism_of
from exudyn_model.control.rigid_dynamics import BaseState, InverseDynamics
from missing_physics.challenge.cases.numbers import DEVELOPMENT_SEEDS, FIRST_SCORING_SEED

NUMBERS = range(10292, 10300)


@pytest.mark.parametrize("number", NUMBERS)
def test_what_is_hidden_is_not_in_the_file_and_comes_again_with_its_number(number: int) -> None:
    for case, again in (
        (friction_case(number), friction_case(number)),
        (twin_case(number), twin_case(number)),
    ):
        assert case == again
        there = {(use.effect, use.at) for use in case.robot.effects}
        assert (case.hidden.effect, case.hidden.at) not in there
    assert (label_of(twin_case(number).hidden) == "payload@link1") == (number % 2 == 0)


@pytest.mark.parametrize("number", [10292, 10293])
def test_the_torque_of_the_twins_joint_is_one_inertia_times_its_acceleration(number: int) -> None:
    """By the other engine: whatever the angle and the speed, so that a scale imitates a payload."""
    case = twin_case(number)
    loaded = case.robot.with_effects(twin_case(10292).hidden)
    for robot in (case.robot, loaded):
        dynamics = InverseDynamics(mechanism_of(robot))
        base = BaseState(np.eye(3), np.zeros(3))
        inertias = [
            float(dynamics([angle], [speed], [acceleration], base=base)[0]) / acceleration
            for angle, speed, acceleration in ((0.0, 0.0, 1.0), (0.7, 0.4, 1.0), (-1.9, -0.8, 2.0))
        ]
        assert inertias == pytest.approx([inertias[0]] * 3, rel=1e-9)


def answer(verdict: str, *labels: str, **numbers: tuple[float, float, float]) -> Answer:
    own = {(labels[0], name): values for name, values in numbers.items()} if labels else {}
    return Answer(verdict, " ".join(labels), frozenset(labels), own, 1.0)


def test_the_page_counts_right_answers_only() -> None:
    case = friction_case(10293)
    [value] = case.hidden.parameters.values()
    [name] = case.hidden.parameters
    label = label_of(case.hidden)
    inside, outside = (value, 0.9 * value, 1.1 * value), (value, 1.1 * value, 1.2 * value)
    friction = [
        (case, answer("explained", label, **{name: inside})),
        (case, answer("explained", label, **{name: outside})),
        (case, answer("explained", label, "torque_offset@joint1")),
        (case, answer("unexplained")),
    ]
    payload, gain = twin_case(10294), twin_case(10295)
    both = answer("ambiguous", "payload@link1", "torque_gain@joint1")
    twins = [
        (payload, both, answer("explained", "payload@link1")),
        (payload, answer("explained", "payload@link1"), both),
        (gain, both, answer("ambiguous", "torque_gain@joint1", "sensor_gain@joint1.torque")),
        (gain, answer("unexplained"), answer("explained", "torque_gain@joint1")),
    ]
    text = page(friction, twins)
    assert "Exactly what was hidden was named in 2 of 4 recordings." in text
    assert "inside their 95 % intervals in 1 of 2." in text
    assert "Without the gyro the answer is right in 2 of 4 cases, with it in 2 of 4." in text


def test_seeds_of_the_page_are_for_it_alone() -> None:
    numbers = range(remote.FIRST_SEED, remote.FIRST_SEED + 2 * remote.DRAWS)
    assert min(numbers) > FIRST_SCORING_SEED
    assert not set(numbers) & set(DEVELOPMENT_SEEDS)
