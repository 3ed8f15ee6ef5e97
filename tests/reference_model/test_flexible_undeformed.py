"""The rigid model that a controller uses for a flexible robot."""

from __future__ import annotations

import numpy as np
import pytest

from reference_model.dynamics.inertial import ten_numbers
from reference_model.flexible import flexible_body
from reference_model.flexible.undeformed import undeformed, undeformed_link
from reference_model.simulation import simulate
from robot_model import Link, Robot, load_robot


def test_its_mass_properties_are_the_undeformed_body_s() -> None:
    link = load_robot("flexible_space_robot").link("link2")
    assert link.beam is not None
    beam = link.beam.model_copy(update={"direction": (0.6, 0.0, 0.8), "boundary": "clamped"})
    hub = {"mass": 3.0, "center_of_mass": (0.1, -0.2, 0.3), "inertia": (0.2, 0.3, 0.4, 0.01, -0.02, 0.03)}
    flexible = Link.model_validate({"name": "arm", "beam": beam, **hub})
    body, rigid = flexible_body(flexible), undeformed_link(flexible)
    inertia = [body.inertia[pair] for pair in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    # rounding of Steiner's term there and back
    np.testing.assert_allclose(ten_numbers(rigid), [body.mass, *body.first_moment, *inertia], atol=1e-10)
    assert not rigid.flexible


def test_a_lumped_beam_is_nearly_the_continuous_one() -> None:
    link = load_robot("flexible_space_robot").link("link2")
    assert link.beam is not None
    rigid, beam = undeformed_link(link), link.beam
    assert rigid.mass == pytest.approx(beam.mass + beam.tip.mass, rel=1e-12)
    about_root = rigid.inertia_matrix[2, 2] + rigid.mass * rigid.center_of_mass[0] ** 2
    # the trapezium rule over twelve elements, 1/288 of the beam's part, which is a seventh of all
    wanted = (beam.mass / 3 + beam.tip.mass) * beam.length**2
    assert about_root == pytest.approx(wanted, rel=1e-3)


def test_rigid_robots_are_unchanged_and_others_change_only_their_flexible_links() -> None:
    arm = load_robot("two_link_arm")
    assert undeformed(arm) is arm
    flexible = load_robot("flexible_space_robot")
    rigid = undeformed(flexible)
    assert rigid.link("link1") == flexible.link("link1")
    assert (rigid.joints, rigid.controller, rigid.reference) == (
        flexible.joints,
        flexible.controller,
        flexible.reference,
    )


def test_the_load_moment_follows_from_bearing_forces_and_moment() -> None:
    """W lies between the radial force alone and force and couple added: R_1,2 = F/2 +- c as vectors."""
    robot = undeformed(load_robot("flexible_space_robot"))
    reference = robot.reference.model_copy(update={"duration": 5.0, "sample_rate": 50.0})
    robot = Robot.model_validate({**robot.model_dump(), "sensors": (), "reference": reference.model_dump()})
    recording = simulate(robot, sensors=False)
    for joint in robot.joints:
        axial, radial, bending, load = (
            recording[f"{joint.name}.{q}"]
            for q in ("axial_force", "radial_force", "bending_moment", "load_moment")
        )
        bearing = joint.bearing
        assert bearing is not None
        assert bearing.span is not None
        rest, couple = load - bearing.axial_arm * axial, bending / bearing.span
        assert np.all(rest >= bearing.radial_arm * np.maximum(radial, 2 * couple) - 1e-9)
        assert np.all(rest <= bearing.radial_arm * (radial + 2 * couple) + 1e-9)
        assert load.max() > 0.5
