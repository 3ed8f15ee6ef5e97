"""Robot files that list what acts on the whole robot: a base that gives way, a link that bends, a wall."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from two_encoders import arm

from missing_physics.diagnosis import Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.least_squares.explanation import explain
from missing_physics.diagnosis.naming.nominal import _as_given
from missing_physics.diagnosis.naming.search import Search
from missing_physics.diagnosis.preparation.setup import inertial_basis, make_segments, nominal_terms
from missing_physics.diagnosis.preparation.split import split
from reference_model.simulation import simulate
from robot_model import EffectUse, InputError, Robot, load_robot

BASE = {"effect": "base_motion", "at": "base", "compliance": 1e-5, "mass": 50.0, "inertia": 10.0}
LINK = {"effect": "link_flexibility", "at": "link2", "period": 0.15}
WALL = {"effect": "contact", "at": "link2", "stiffness": 1e4, "offset": 0.9, "x": 0.4}
DRY = EffectUse(effect="coulomb_friction", at="joint2", torque=2.0)


def listing(known: dict[str, Any]) -> Robot:
    """The arm that lists something, with an encoder at each joint only."""
    robot = arm(known, duration=6.0)
    sensors = tuple(s for s in robot.sensors if not s.channel.endswith("motor_position"))
    return robot.model_copy(update={"sensors": sensors})


@pytest.mark.parametrize(
    "known",
    [BASE, pytest.param(LINK, marks=pytest.mark.proof), pytest.param(WALL, marks=pytest.mark.proof)],
    ids=["base", "link", "wall"],
)
def test_what_is_missing_beside_it_is_found_and_it_stays_as_described(known: dict[str, Any]) -> None:
    robot = listing(known)
    recording = simulate(robot.with_effects(DRY), seed=1)
    told = diagnose(robot, [recording], options=Options(simulation=False)).diagnosis
    [finding] = told.findings
    assert (finding.effect, finding.location) == ("coulomb_friction", "joint2")
    # to first order in what bends or gives way, a part in a hundred of the torque
    assert finding.parameters["torque"].value == pytest.approx(2.0, rel=0.02)
    assert not [p for p in told.nominal_parameters if p.name.startswith(f"{known['effect']}@")]


def test_nothing_is_found_where_it_is_all_that_differs() -> None:
    robot = listing(BASE)
    unknown = robot.model_copy(update={"reference": None})  # so that nothing is simulated beforehand
    told = diagnose(unknown, [simulate(robot, seed=1)], options=Options(simulation=False)).diagnosis
    assert told.findings == ()
    assert told.verdict == "consistent"


def test_what_joints_do_not_tell_has_to_be_left_out() -> None:
    shipped = load_robot("flexible_space_robot_planar")
    robot = shipped.with_effects(
        EffectUse(effect="slosh", at="base", mass=5.0, frequency=0.3, damping_ratio=0.02)
    )
    with pytest.raises(InputError, match="'slosh' at 'base': recorded joints do not determine what it does"):
        make_segments(robot, [simulate(shipped, seed=1).window(0.0, 1.0)])


def test_numbers_of_the_file_go_by_their_places() -> None:
    """A gear, which is no term of the torque, may stand before what is."""
    gear = {"effect": "joint_elasticity", "at": "joint1", "stiffness": 1e5, "damping": 30.0}
    data = arm(duration=3.0).model_dump()
    robot = Robot.model_validate({**data, "effects": [gear, *data["effects"]]})
    segments = make_segments(robot, [simulate(robot, seed=1)])
    whole = split(segments, 1, inertial_basis(robot, segments), seed=0)
    terms = [replace(t, parameters={"coefficient": 9.0}) for t in nominal_terms(robot)]
    start = explain(whole.problem, whole.view, terms, nuisance=False)
    given = {t.label: dict(t.parameters) for t in _as_given(Search(start, start))}
    assert given == {
        "viscous_friction@joint1": {"coefficient": 2.5},
        "viscous_friction@joint2": {"coefficient": 1.2},
    }
