"""A robot file with other inertial numbers: all of them arrive, and bodies stay real."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from pydantic import ValidationError

from missing_physics.bodies.realisable import BODY_NUMBERS, pseudo_inertia
from missing_physics.bodies.written import as_real_bodies, with_numbers
from reference_model.dynamics.inertial import nominal_inertial, ten_numbers
from reference_model.evaluation.model import RobotModel
from robot_model import Robot, load_robot, robot_from_toml, robot_to_toml

Array = NDArray[np.float64]

ARM = load_robot("two_link_arm").model_copy(update={"effects": ()})
MODEL = RobotModel(ARM)
NAMES = MODEL.inertial_names
#: Every number but gravity may change.
FREE = np.array([not name.startswith("gravity") for name in NAMES])
SCALE = np.maximum(np.abs(MODEL.inertial), 0.05)


def place(name: str) -> int:
    return NAMES.index(name)


def rows(robot: Robot, samples: int = 60, seed: int = 4) -> Array:
    """Regressor of random states, shape (samples * n, P)."""
    chance = np.random.default_rng(seed)
    motion = [chance.normal(size=(samples, len(robot.moving_joints))) for _ in range(3)]
    model = RobotModel(robot)
    return model.regressor(*motion).reshape(-1, len(model.inertial_names))


def body_numbers(robot: Robot, body: str) -> Array:
    return ten_numbers(robot.link(body))


@settings(max_examples=25)
@given(
    products=st.tuples(*(st.floats(-0.01, 0.01) for _ in range(3))),
    moments=st.tuples(*(st.floats(0.25, 0.35) for _ in range(3))),
    first=st.tuples(*(st.floats(-0.1, 0.1) for _ in range(3))),
    mass=st.floats(0.5, 3.0),
    reflected=st.floats(0.0, 0.5),
)
def test_each_of_the_ten_numbers_and_the_rotor_arrive_at_their_own_place(
    products: tuple[float, ...],
    moments: tuple[float, ...],
    first: tuple[float, ...],
    mass: float,
    reflected: float,
) -> None:
    """Products of inertia all different: none stands for another one."""
    ten = dict(zip(BODY_NUMBERS, (mass, *first, *moments, *products)))
    numbers = {f"link2.{name}": value for name, value in ten.items()}
    numbers["joint1.reflected_inertia"] = reflected
    found = nominal_inertial(robot_from_toml(robot_to_toml(with_numbers(ARM, numbers))))
    wanted = {**dict(zip(NAMES, MODEL.inertial)), **numbers}
    # eight digits are kept of mass, centre and central inertia
    np.testing.assert_allclose(found, list(wanted.values()), atol=1e-7)


def test_the_products_of_inertia_of_the_file_are_those_of_its_matrix() -> None:
    """The central inertia in the file is Ixx Iyy Izz Ixy Ixz Iyz, the first moment taken off by Steiner."""
    numbers = {f"link2.{name}": 0.0 for name in BODY_NUMBERS}
    numbers |= {"link2.mass": 2.0, "link2.first_moment.x": 0.2, "link2.first_moment.y": 0.6}
    numbers |= {"link2.inertia.xx": 0.5, "link2.inertia.yy": 0.4, "link2.inertia.zz": 0.6}
    numbers |= {"link2.inertia.xy": -0.05, "link2.inertia.xz": 0.02, "link2.inertia.yz": 0.03}
    link = with_numbers(ARM, numbers).link("link2")
    assert link.center_of_mass == (0.1, 0.3, 0.0)
    # m (c.c 1 - c c^T) = [[.18, -.06, 0], [-.06, .02, 0], [0, 0, .2]]
    np.testing.assert_allclose(link.inertia, (0.32, 0.38, 0.4, 0.01, 0.02, 0.03), atol=1e-12)


def test_bodies_that_cannot_be_are_refused() -> None:
    for name, value in (("link2.mass", -1.0), ("link2.inertia.yy", -0.5), ("joint1.reflected_inertia", -0.1)):
        with pytest.raises(ValidationError):
            with_numbers(ARM, {name: value})


def test_a_rotor_makes_actuators_of_all_joints_or_of_none() -> None:
    """One actuator among joints without any would say that nothing drives the others."""
    bare = ARM.model_copy(
        update={"joints": tuple(joint.model_copy(update={"actuator": None}) for joint in ARM.joints)}
    )
    found = with_numbers(bare, {"joint1.reflected_inertia": 0.3})
    actuators = [joint.actuator for joint in found.moving_joints]
    assert [a.rotor_inertia for a in actuators if a is not None] == [0.3, 0.0]
    same = with_numbers(bare, {"joint1.reflected_inertia": 0.0, "link1.mass": 9.0})
    assert all(joint.actuator is None or not joint.actuator.rotor_inertia for joint in same.moving_joints)


def test_a_change_to_real_bodies_is_taken_as_it_is() -> None:
    change = np.zeros(len(NAMES))
    change[place("link1.mass")], change[place("joint2.reflected_inertia")] = 0.5, 0.01
    found = as_real_bodies(ARM, change, scale=SCALE, free=FREE, weight=1e6 * rows(ARM))
    assert found is not None
    np.testing.assert_allclose(nominal_inertial(found), MODEL.inertial + change, atol=1e-7)


def test_of_equivalent_numbers_real_ones_are_found() -> None:
    """Less of both links as torques see it: taken from there no body is real, others predict the same."""
    seen = rows(ARM)
    less = MODEL.inertial.copy()
    less[FREE] *= 0.6
    wanted = less - MODEL.inertial
    change = np.zeros(len(NAMES))
    change[FREE] = np.linalg.lstsq((seen * SCALE)[:, FREE], seen @ wanted, rcond=1e-9)[0] * SCALE[FREE]
    change[place("link2.inertia.xx")] -= 5.0  # about an axis that link 2 never turns about
    with pytest.raises(ValidationError):
        with_numbers(ARM, dict(zip(NAMES, MODEL.inertial + change)))
    found = as_real_bodies(ARM, change, scale=SCALE, free=FREE, weight=1e3 * seen)
    assert found is not None
    torque, true = (seen @ numbers for numbers in (nominal_inertial(found), less))
    # a deviation of a thousandth starts to matter, and so does a number that changes by its own size
    np.testing.assert_allclose(torque, true, atol=5e-3)
    for body in ("link1", "link2"):
        assert np.linalg.eigvalsh(pseudo_inertia(body_numbers(found, body)))[0] >= -1e-9
    assert abs(nominal_inertial(found)[place("link2.inertia.xx")] - MODEL.inertial[4 + 10]) < 1.0


def test_where_no_real_bodies_do_it_the_nearest_come_out() -> None:
    """A rotor of negative inertia at the first joint: the link has to give as much as it has."""
    seen, change = rows(ARM), np.zeros(len(NAMES))
    change[place("joint1.reflected_inertia")] = -(MODEL.inertial[place("joint1.reflected_inertia")] + 0.2)
    only = np.array([name.startswith("joint1") for name in NAMES])
    found = as_real_bodies(ARM, change, scale=SCALE, free=only, weight=1e3 * seen)
    assert found is not None
    others = ~only
    np.testing.assert_array_equal(nominal_inertial(found)[others], MODEL.inertial[others])
    assert 0.0 <= nominal_inertial(found)[place("joint1.reflected_inertia")] < 1e-4


def test_what_is_known_of_a_body_stays() -> None:
    change = np.zeros(len(NAMES))
    change[place("link2.inertia.zz")] = -10.0
    free = FREE & ~np.isin(NAMES, ["link2.mass", "link2.first_moment.x"])
    found = as_real_bodies(ARM, change, scale=SCALE, free=free, weight=rows(ARM))
    assert found is not None
    for name in ("link2.mass", "link2.first_moment.x"):
        before = MODEL.inertial[place(name)]
        assert nominal_inertial(found)[place(name)] == pytest.approx(before, abs=1e-9)
    assert np.linalg.eigvalsh(pseudo_inertia(body_numbers(found, "link2")))[0] >= -1e-9


def test_a_joint_that_nothing_drives_gets_no_rotor() -> None:
    first, second = ARM.joints
    assert first.actuator is not None
    passive = ARM.model_copy(update={"joints": (first, second.model_copy(update={"actuator": None}))})
    model = RobotModel(passive)
    change = np.zeros(len(NAMES))
    change[place("link1.mass")] = 0.5
    heavier = as_real_bodies(passive, change, scale=SCALE, free=FREE, weight=np.eye(len(NAMES)))
    assert heavier is not None
    assert heavier.joint("joint2").actuator is None  # or it would count as driven by a torque nobody recorded
    change = np.zeros(len(NAMES))
    change[place("joint2.reflected_inertia")] = 0.1
    seen = rows(passive)
    found = as_real_bodies(passive, change, scale=SCALE, free=FREE, weight=1e3 * seen)
    assert found is not None
    assert found.joint("joint2").actuator is None
    left, nothing = (
        np.linalg.norm(seen @ (numbers - model.inertial - change))
        for numbers in (
            nominal_inertial(found),
            model.inertial,
        )
    )
    assert left < 0.9 * nothing  # the link makes up for what it can


def test_a_free_base_takes_its_change() -> None:
    robot = load_robot("six_joint_space_arm")
    found = with_numbers(robot, {"base.mass": robot.base.mass + 7.0})
    assert found.base.mass == pytest.approx(robot.base.mass + 7.0)
    assert found.links == robot.links
