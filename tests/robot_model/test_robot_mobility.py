"""A robot is rejected exactly when its mass matrix is singular in every pose."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn
from robot_strategies import trees

from reference_model.evaluation.model import RobotModel
from robot_model import Actuator, Base, Beam, EffectUse, Joint, Link, ModalBody, Robot, Tube
from robot_model.description import checks
from robot_model.description.mobility import idle_coordinate

#: Scaled to a unit diagonal, a singular mass matrix has an eigenvalue of some 1e-16; those of the small
#: robots drawn here, with figures of like size, stay above 1e-9 when regular. In between would be doubtful.
SINGULAR = 1e-12


def arm(link: Link, *, kind: str = "revolute", **joint: object) -> Robot:
    first = Joint(name="joint1", kind=kind, parent="base", child=link.name, **joint)  # type: ignore[arg-type]
    return Robot(name="arm", links=(link,), joints=(first,))


def test_a_mass_on_the_axis_has_no_inertia_about_it() -> None:
    with pytest.raises(ValueError, match=r"joints\[joint1\]: it moves nothing that has inertia"):
        arm(Link(name="link1", mass=2.0, center_of_mass=(0, 0, 0.3)))


def test_a_mass_on_a_skewed_axis_has_no_inertia_about_it() -> None:
    # The axis is no round number in the link's frame, so that the lever is zero but for rounding.
    along = (0.3 / 7, 0.1 / 7, 0.7 / 7)
    with pytest.raises(ValueError, match="moves nothing that has inertia"):
        arm(Link(name="link1", mass=2.0, center_of_mass=along), axis=(0.3, 0.1, 0.7))


def test_a_mass_on_the_axis_has_inertia_along_it() -> None:
    assert arm(Link(name="link1", mass=2.0), kind="prismatic").moving_joints


def test_a_lever_or_a_rotor_or_an_inertia_is_enough() -> None:
    assert arm(Link(name="link1", mass=2.0, center_of_mass=(1e-3, 0, 0.3)))
    assert arm(Link(name="link1"), actuator=Actuator(rotor_inertia=1e-7))
    assert arm(Link(name="link1", mass=2.0, inertia=(0.0, 1e-6, 1e-6)), axis=(0, 1, 0))


def test_a_long_thin_rod_has_enough_roll_inertia() -> None:
    # 10 m long, 2 mm thick: roll inertia m r^2 / 2 is 1.5e-8 of the others.
    rod = Link(name="link1", mass=10.0, center_of_mass=(5, 0, 0), inertia=(5e-6, 83.3, 83.3))
    assert arm(rod, axis=(1, 0, 0))


def chain(second_axis: tuple[float, float, float], **first: object) -> Robot:
    """Two joints with a link between them that weighs nothing."""
    tip = Link(name="link2", mass=1.0, center_of_mass=(0.2, 0.1, 0), inertia=(0.01, 0.01, 0.01))
    joints = (
        Joint(name="joint1", parent="base", child="link1", **first),  # type: ignore[arg-type]
        Joint(name="joint2", parent="link1", child="link2", axis=second_axis),
    )
    return Robot(name="arm", links=(Link(name="link1"), tip), joints=joints)


def test_a_massless_link_between_crossed_axes_is_allowed() -> None:
    assert chain((1.0, 0.0, 0.0))


def test_a_massless_link_between_equal_axes_is_refused() -> None:
    with pytest.raises(ValueError, match=r"joints\[joint1\]"):
        chain((0.0, 0.0, 1.0))


def bent(rpy: tuple[float, float, float], center: tuple[float, float, float]) -> Robot:
    """A turning massless link, half a metre along which a point mass is fixed."""
    joints = (
        Joint(name="joint1", parent="base", child="link1"),
        Joint(name="mount", kind="fixed", parent="link1", child="link2", origin=(0.5, 0, 0), rpy=rpy),
    )
    links = (Link(name="link1"), Link(name="link2", mass=3.0, center_of_mass=center))
    return Robot(name="arm", links=links, joints=joints)


@pytest.mark.parametrize("height", [0.0, 0.3])
def test_a_mass_back_on_the_axis_has_no_inertia_about_it(height: float) -> None:
    quarter = np.pi / 2  # yaw by it turns y into -x
    for rpy, center in (((0, 0, 0), (-0.5, 0, height)), ((0, 0, quarter), (0, 0.5, height))):
        with pytest.raises(ValueError, match=r"joints\[joint1\]"):
            bent(rpy, center)


def test_roll_pitch_and_yaw_follow_the_urdf_convention() -> None:
    # R = Rz(yaw) Ry(pitch) Rx(roll): a roll turns y into z, then a pitch turns z into x.
    quarter = np.pi / 2
    with pytest.raises(ValueError, match=r"joints\[joint1\]"):
        bent((quarter, quarter, 0), (0.1, -0.5, 0))
    assert bent((quarter, quarter, 0), (-0.5, 0.1, 0))


def test_a_mass_on_the_axis_in_one_pose_only_is_accepted() -> None:
    """A polar manipulator at its origin: the mass is on the first axis, but slides off it."""
    joints = (
        Joint(name="joint1", parent="base", child="link1"),
        Joint(name="joint2", kind="prismatic", parent="link1", child="link2", axis=(1, 0, 0)),
    )
    links = (Link(name="link1"), Link(name="link2", mass=3.0))
    assert Robot(name="polar", links=links, joints=joints).moving_joints


def test_a_long_chain_is_accepted() -> None:
    """Pivots shrink beside all that is carried with the third power of the length; they stay pivots."""
    links = tuple(
        Link(name=f"link{k}", mass=1.0, center_of_mass=(0.1, 0, 0), inertia=(1e-4, 1e-3, 1e-3))
        for k in range(200)
    )
    joints = tuple(
        Joint(name=f"joint{k}", parent=f"link{k - 1}" if k else "base", child=f"link{k}", origin=(0.2, 0, 0))
        for k in range(200)
    )
    assert Robot(name="snake", links=links, joints=joints)


def test_a_rotor_provides_the_inertia() -> None:
    assert chain((0.0, 0.0, 1.0), actuator=Actuator(rotor_inertia=1e-5))


def test_an_effect_may_provide_the_mass() -> None:
    payload = EffectUse(effect="payload", at="link1", mass=1.0)
    first = Joint(name="joint1", parent="base", child="link1")
    assert Robot(name="arm", links=(Link(name="link1"),), joints=(first,), effects=(payload,))


def test_a_free_base_needs_moments_of_inertia() -> None:
    with pytest.raises(ValueError, match=r"base.inertia: the free base turns without any inertia"):
        Robot(name="sat", base=Base(kind="free", mass=5.0), links=(), joints=())


def test_a_free_base_may_get_inertia_from_links_fixed_to_it() -> None:
    wing = Link(name="wing", mass=1.0, center_of_mass=(1, 0, 0), inertia=(1.0, 1.0, 1.0))
    mount = Joint(name="mount", kind="fixed", parent="base", child="wing")
    assert Robot(name="sat", base=Base(kind="free", mass=5.0), links=(wing,), joints=(mount,))


@st.composite
def robots_with_light_links(draw: DrawFn) -> Robot:
    """Fixed-base robots, some of whose links are points or weigh nothing; axes along x, y or z."""
    links, joints = draw(trees(most=4))
    axes = st.sampled_from([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
    aligned = {"rpy": (0.0, 0.0, 0.0), "actuator": None}
    placed = st.sampled_from([(0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.0, 0.4, 0.3)])
    return Robot.model_construct(
        name="drawn",
        base=Base(),
        links=tuple(draw(light(link)) for link in links),
        joints=tuple(
            joint.model_copy(update={**aligned, "axis": draw(axes), "origin": draw(placed)})
            for joint in joints
        ),
    )


def light(link: Link) -> st.SearchStrategy[Link]:
    return st.builds(
        Link,
        name=st.just(link.name),
        mass=st.sampled_from([0.0, 1.0, 2.0]),
        center_of_mass=st.sampled_from([(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.1, 0.2, -0.2)]),
    )


@settings(max_examples=40)
@given(robots_with_light_links())
def test_agrees_with_the_mass_matrix_of_the_reference_model(robot: Robot) -> None:
    if not robot.moving_joints:
        assert idle_coordinate(robot) is None
        return
    poses = np.random.default_rng(1).uniform(-2, 2, (4, len(robot.moving_joints)))
    regular = max(smallest(matrix) for matrix in RobotModel(robot).mass_matrix(poses)) > SINGULAR
    assert regular == (idle_coordinate(robot) is None)


def smallest(matrix: np.ndarray) -> float:
    """Smallest eigenvalue of the matrix scaled to a unit diagonal; 0 where the diagonal has a zero."""
    diagonal = np.diag(matrix)
    if diagonal.min() <= 1e-15:
        return 0.0
    scale = np.sqrt(diagonal)
    return float(np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0])


def test_the_check_is_made_when_a_robot_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, "idle_coordinate", lambda robot: "joint1")
    with pytest.raises(ValueError, match=r"joints\[joint1\]"):
        arm(Link(name="link1", mass=2.0, inertia=(1.0, 1.0, 1.0)))


BOOM = Beam(
    length=2.0,
    section=Tube(outer_diameter=0.05, inner_diameter=0.04),
    young=70e9,
    shear=27e9,
    density=2700.0,
    elements=4,
    modes=4,
)


def test_a_beam_has_inertia_about_every_axis() -> None:
    for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.3, -0.2, 0.9)):
        assert arm(Link(name="link1", beam=BOOM), axis=axis)
    assert arm(Link(name="link1", modal=ModalBody(file="b.npz", modes=2)), axis=(1, 0, 0))


def test_joints_on_a_beam_must_move_inertia_too() -> None:
    links = (Link(name="boom", beam=BOOM), Link(name="tip", mass=1.0))
    joints = (
        Joint(name="joint1", parent="base", child="boom"),
        Joint(name="joint2", parent="boom", child="tip", origin=(2.0, 0, 0)),
    )
    with pytest.raises(ValueError, match=r"joints\[joint2\]: it moves nothing"):
        Robot(name="arm", links=links, joints=joints)
    modal = links[0].model_copy(update={"beam": None, "modal": ModalBody(file="b.npz", modes=2)})
    with pytest.raises(ValueError, match=r"joints\[joint2\]: it moves nothing"):
        Robot(name="arm", links=(modal, links[1]), joints=joints)


@pytest.mark.parametrize(
    ("keys", "turns"),
    [
        ({"mass": 1.0}, False),
        ({"mass": 1.0, "center_of_mass": (0.1, 0.0, 0.0)}, False),  # not about its own lever
        ({"mass": 1.0, "inertia": (0.0, 0.1, 0.1)}, False),  # a needle
        ({"mass": 1.0, "center_of_mass": (0.1, 0.2, 0.0), "inertia": (0.0, 0.1, 0.1)}, True),
        ({"beam": BOOM}, True),
    ],
)
def test_a_spherical_joint_needs_inertia_about_all_axes(keys: dict, turns: bool) -> None:
    link = Link(name="link1", **keys)
    if turns:
        assert arm(link, kind="spherical").spherical_joints
    else:
        with pytest.raises(ValueError, match=r"joints\[joint1\]: it moves nothing"):
            arm(link, kind="spherical")


def test_a_hinge_on_a_spherical_joint_is_accepted() -> None:
    """A point that turns about a hinge leaves the massless link between free to turn; an inertia does not."""
    joints = (
        Joint(name="socket", kind="spherical", parent="base", child="link1"),
        Joint(name="hinge", parent="link1", child="link2", origin=(0.0, 0.3, 0.1)),
    )
    tip = Link(name="link2", mass=1.0, center_of_mass=(0.4, 0.0, 0.0))
    with pytest.raises(ValueError, match=r"joints\[socket\]"):
        Robot(name="r", links=(Link(name="link1"), tip), joints=joints)
    heavy = Link(name="link1", mass=0.1, inertia=(0.01, 0.01, 0.01))
    assert Robot(name="r", links=(heavy, tip), joints=joints)
