"""The augmented robot: same physics as the fit, a valid file, and no unphysical bodies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from diagnosis_cases import bare, term
from hypothesis import given, settings
from hypothesis import strategies as st

from missing_physics.diagnosis.written.augment import augmented_robot, with_inertial
from reference_model.evaluation.model import RobotModel
from robot_model import load_robot, robot_from_toml, robot_to_toml, save_robot

ARM = load_robot("two_link_arm")


@settings(max_examples=25)
@given(
    mass=st.floats(-1.0, 3.0),
    moment=st.floats(-0.2, 0.4),
    spread=st.floats(0.0, 0.1),
    reflected=st.floats(-0.1, 0.5),
)
def test_a_change_of_inertial_numbers_arrives(
    mass: float, moment: float, spread: float, reflected: float
) -> None:
    change = {
        "link2.mass": mass,
        "link2.first_moment.x": moment,
        # about the origin: what mass and moment need so that the body stays one, plus a share
        "link2.inertia.yy": spread + 0.4,
        "link2.inertia.zz": spread + 0.4,
        "joint1.reflected_inertia": reflected,
    }
    changed, remark = with_inertial(ARM, list(change), np.array(list(change.values())))
    assert remark == ""
    before, after = RobotModel(ARM), RobotModel(changed)
    wanted = dict(zip(before.inertial_names, before.inertial))
    for name, delta in change.items():
        wanted[name] += delta
    # eight digits are kept of mass, centre and central inertia
    np.testing.assert_allclose(after.inertial, list(wanted.values()), atol=1e-6)
    assert robot_from_toml(robot_to_toml(changed)) == changed


def test_no_change_changes_nothing_but_rounding() -> None:
    names = list(RobotModel(ARM).inertial_names)
    same, remark = with_inertial(ARM, names, np.zeros(len(names)))
    assert remark == ""
    np.testing.assert_allclose(RobotModel(same).inertial, RobotModel(ARM).inertial, atol=1e-9)
    assert (same.effects, same.sensors, same.controller, same.reference) == (
        ARM.effects,
        ARM.sensors,
        ARM.controller,
        ARM.reference,
    )


@pytest.mark.parametrize(
    "change",
    [{"link2.mass": -5.0}, {"link1.inertia.yy": -0.9}, {"link2.inertia.xx": 3.0}],
    ids=["negative mass", "negative inertia", "triangle inequality"],
)
def test_bodies_that_cannot_exist_are_refused_with_a_sentence(change: dict[str, float]) -> None:
    kept, remark = with_inertial(ARM, list(change), np.array(list(change.values())))
    assert kept == ARM
    assert "not those of real bodies" in remark
    assert "keeps the nominal ones" in remark


def test_a_free_base_takes_its_change() -> None:
    robot = load_robot("six_joint_space_arm")
    changed, remark = with_inertial(robot, ["base.mass"], np.array([7.0]))
    assert remark == ""
    assert changed.base.mass == pytest.approx(robot.base.mass + 7.0)


def test_the_effects_are_exactly_those_of_the_fit(tmp_path: Path) -> None:
    terms = (
        term("viscous_friction", "joint1", coefficient=2.123456789),
        term("sensor_delay", "joint2.position", delay=0.004),
    )
    robot = augmented_robot(ARM, terms)
    assert [(use.effect, use.at) for use in robot.effects] == [t.key for t in terms]
    assert robot.effects[0].parameters["coefficient"] == pytest.approx(2.123456789, rel=1e-8)
    save_robot(robot, tmp_path / "robot.toml")
    assert load_robot(tmp_path / "robot.toml") == robot
    assert bare("two_link_arm", noise=True).links == robot.links
