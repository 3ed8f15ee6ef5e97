"""Drawn flexible links: a beam with a tip force, attached bodies, and the magnification."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from missing_physics.reporting.scene.deflection import SHOWN, bent_line, held_by, magnification, tip_of
from missing_physics.reporting.scene.skeleton import Poses, poses, reach
from robot_model import Beam, InputError, Joint, Link, Robot, Tube, load_robot

#: Sums and products of a few numbers in double precision.
ROUNDING = 1e-12

BOOM = Link(
    name="boom",
    beam=Beam(
        length=2.0,
        direction=(0.0, 1.0, 0.0),
        section_y=(1.0, 0.0, 0.0),
        section=Tube(outer_diameter=0.02),
        young=7e10,
        shear=2.7e10,
        density=2700.0,
        elements=4,
        modes=2,
    ),
)


def test_drawn_deflection_equals_a_cantilever_with_a_tip_force() -> None:
    """EI w'' = F (L - x) with w(0) = w'(0) = 0, integrated here by quadrature twice."""
    line = bent_line(BOOM, np.array([[0.05, 0.0, 0.0]]))[0]
    x = np.linspace(0.0, 2.0, 20001)
    slope = np.concatenate(([0.0], np.cumsum(0.5 * np.diff(x) * ((2.0 - x[1:]) + (2.0 - x[:-1])))))
    bend = np.concatenate(([0.0], np.cumsum(0.5 * np.diff(x) * (slope[1:] + slope[:-1]))))
    expected = np.interp(line[:, 1], x, 0.05 * bend / bend[-1])
    assert np.allclose(line[:, 0], expected, atol=1e-9)  # of the quadrature's steps, 1e-4 squared
    assert np.allclose(line[-1], [0.05, 2.0, 0.0], atol=ROUNDING)


def test_bodies_at_the_tip_follow_the_deflection() -> None:
    moved = np.array([[0.01, 0.0, -0.02]])
    displacement, turn = held_by(BOOM, np.array([0.0, 2.0, 0.0]), moved)
    assert np.allclose(displacement, moved, atol=ROUNDING)
    # The slope of the line at its end is 3/2 w / L; turns of some hundredths, so to their square.
    along = turn[0] @ [0.0, 1.0, 0.0]
    assert np.allclose(along, [1.5 * 0.01 / 2, 1.0, -1.5 * 0.02 / 2], atol=1e-3)
    displacement, turn = held_by(BOOM, np.zeros(3), moved)
    assert not displacement.any()
    assert np.allclose(turn[0], np.eye(3), atol=ROUNDING)


def test_links_after_a_bent_link_are_drawn_at_its_tip() -> None:
    hand = Link(name="hand", mass=1.0, inertia=(0.1, 0.1, 0.1))
    joints = (
        Joint(name="q1", parent="base", child="boom", origin=(0.0, 0.0, 1.0)),
        Joint(name="q2", parent="boom", child="hand", origin=(0.0, 2.0, 0.0)),
    )
    robot = Robot(name="crane", links=(BOOM, hand), joints=joints)
    angle = np.array([0.3])
    placed = poses(robot, {"q1": angle}, deflections={"boom": np.array([[0.1, 0.0, 0.2]])})
    turn = np.array([[np.cos(0.3), -np.sin(0.3), 0], [np.sin(0.3), np.cos(0.3), 0], [0, 0, 1]])
    assert np.allclose(placed["hand"].translation[0], [0, 0, 1] + turn @ [0.1, 2.0, 0.2], atol=ROUNDING)
    identity = placed["hand"].rotation[0] @ placed["hand"].rotation[0].T
    assert np.allclose(identity, np.eye(3), atol=ROUNDING)


def test_all_bodies_move_with_a_free_base() -> None:
    robot = load_robot("flexible_space_robot")
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    base = Poses(np.array([[1.0, 2.0, 3.0]]), turn[None])
    here, there = poses(robot, {}), poses(robot, {}, base=base)
    for body, pose in here.items():
        assert np.allclose(there[body].translation[0], [1, 2, 3] + turn @ pose.translation[0], atol=ROUNDING)
        assert np.allclose(there[body].rotation[0], turn @ pose.rotation[0], atol=ROUNDING)


def test_beam_length_counts_in_the_reach() -> None:
    assert reach(load_robot("flexible_space_robot")) == pytest.approx(12.0)  # 1 m base, 5 m link, 6 m beam


@given(largest=st.floats(1e-9, 5.0))
def test_magnification_makes_the_largest_deflection_visible(largest: float) -> None:
    moved = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, largest], [np.nan] * 3])
    factor = magnification((BOOM,), (moved,))
    assert factor >= 1.0
    power = 10.0 ** np.floor(np.log10(factor) + 1e-9)
    assert factor / power == pytest.approx(min((1, 2, 5), key=lambda step: abs(step - factor / power)))
    if factor > 1.0:
        assert 0.39 * SHOWN < factor * largest / 2.0 <= SHOWN * (1 + 1e-9)
    else:
        assert 2 * largest / 2.0 > SHOWN * (1 - 1e-9)


def test_rigid_motion_is_not_magnified() -> None:
    assert magnification((), ()) == 1.0
    assert magnification((BOOM,), (np.zeros((3, 3)),)) == 1.0
    with pytest.raises(InputError, match="'stick' is rigid"):
        tip_of(Link(name="stick", mass=1.0))
