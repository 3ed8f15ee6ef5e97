"""A wall that the tip of an arm runs against, from joint encoders and torques alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from missing_physics.diagnosis import Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.candidates.walls import walls
from missing_physics.diagnosis.least_squares.explanation import explain
from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.preparation.setup import inertial_basis, make_segments, nominal_terms
from missing_physics.diagnosis.preparation.split import split
from missing_physics.diagnosis.terms.term import Term
from missing_physics.results.result import Result
from reference_model.effects.catalogue import get_effect
from reference_model.passive.prescribed import prescribed
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, Robot, load_robot

Array = NDArray[np.float64]

CONTACT = get_effect("contact")
TIP = 0.4
DEPTH = 0.01


def arm() -> Robot:
    data = load_robot("two_link_arm").model_dump()
    data["reference"] |= {"duration": 12.0, "sample_rate": 250.0}
    return Robot.model_validate(data)


ARM = arm()
FREE = simulate(ARM, sensors=False)


def wall(angle: float) -> dict[str, float]:
    """A wall that faces along this angle above the x axis, met over a centimetre of the tip's way."""
    normal = np.array([np.cos(angle), np.sin(angle)])
    first = FREE["joint1.position"]
    both = first + FREE["joint2.position"]
    place = 0.5 * np.column_stack([np.cos(first), np.sin(first)])
    place += TIP * np.column_stack([np.cos(both), np.sin(both)])
    offset = float((place @ normal).min()) + DEPTH
    values = {"stiffness": 50.0 / DEPTH**1.5, "offset": offset, "damping": 0.3, "x": TIP}
    return values | {"normal_x": round(normal[0], 12) + 0.0, "normal_z": round(normal[1], 12)}


def against(robot: Robot, values: Mapping[str, float]) -> Robot:
    return robot.with_effects(EffectUse.model_validate({"effect": "contact", "at": "link2", **values}))


def recorded(robot: Robot, seed: int) -> Recording:
    """Without references, so that the regression alone has to tell."""
    whole = simulate(robot, seed=seed)
    return replace(whole, channels={k: v for k, v in whole.channels.items() if "reference" not in k})


FLOOR = wall(np.pi / 2)
QUICK = Options(experiments=False, simulation=False)
FRICTION = [EffectUse(effect="coulomb_friction", at=j, torque=t) for j, t in (("joint1", 4), ("joint2", 2))]


def term_of(values: Mapping[str, float]) -> Term:
    return Term(CONTACT, "link2", {**CONTACT.defaults(), **values})


@pytest.fixture(scope="module")
def segment() -> Segment:
    robot = ARM.model_copy(update={"sensors": ()})
    return make_segments(robot, [FREE], cutoff=40.0)[0]


def test_it_is_what_a_simulation_of_the_wall_gives(segment: Segment) -> None:
    motion, values = segment.motion, wall(0.6)
    state = motion.time, motion.position, motion.velocity, motion.acceleration
    bare = ARM.model_copy(update={"sensors": (), "effects": ()})
    made = [prescribed(robot, *state) for robot in (against(bare, values), bare)]
    exact = np.column_stack(
        [made[0][f"{j}.torque"] - made[1][f"{j}.torque"] for j in segment.dynamics.model.joints]
    )
    assert np.abs(exact).max() > 10.0
    added = segment.contribution(term_of(values)).value
    # both are the effect's own equations at the same samples: rounding
    np.testing.assert_allclose(added, segment.reduce(exact), atol=1e-9 * np.abs(exact).max())


def test_derivatives(segment: Segment) -> None:
    term = term_of(FLOOR)
    made = segment.contribution(term)
    for k, name in enumerate(term.free):
        step = 1e-6 * abs(term.parameters[name])
        ends = [
            segment.contribution(
                replace(term, parameters={**term.parameters, name: term.parameters[name] + s})
            )
            for s in (step, -step)
        ]
        slope = (ends[0].value - ends[1].value) / (2 * step)
        # by the offset the force has a corner at the wall, over a step of half a micrometre
        np.testing.assert_allclose(slope, made.jacobian[:, :, k], atol=1e-4 * np.abs(slope).max())


def test_a_slanted_wall_is_found() -> None:
    values = wall(1.0)
    robot = against(ARM, values)
    segments = make_segments(ARM, [recorded(robot, 10151)])
    data = split(segments, 1, inertial_basis(ARM, segments), seed=0)
    (found,) = walls(data.problem, explain(data.problem, data.view, nominal_terms(ARM)), CONTACT)
    assert found.at == "link2"
    normals = [np.array([p["normal_x"], p["normal_z"]]) for p in (values, found.parameters)]
    assert normals[0] @ normals[1] > np.cos(np.deg2rad(3.0))  # less than the grid's step


@pytest.fixture(scope="module")
def found() -> Result:
    recording = recorded(against(ARM, FLOOR).with_effects(*FRICTION), 10150)
    return diagnose(ARM, [recording], options=QUICK)


def test_a_wall_is_named_beside_friction(found: Result) -> None:
    named = {f"{f.effect}@{f.location}" for f in found.diagnosis.findings}
    assert named == {"coulomb_friction@joint1", "coulomb_friction@joint2", "contact@link2"}
    # Stribeck friction may stand beside Coulomb friction at a joint, nothing beside the wall
    assert found.diagnosis.verdict in ("explained", "ambiguous")
    finding = next(f for f in found.diagnosis.findings if f.effect == "contact")
    assert finding.ambiguous_with == ()
    assert finding.probability > 0.9
    assert set(finding.parameters) == {"stiffness", "offset", "damping"}
    for name, estimate in finding.parameters.items():
        assert estimate.ci95[0] <= FLOOR[name] <= estimate.ci95[1], name
    assert finding.parameters["offset"].value == pytest.approx(FLOOR["offset"], abs=1e-3)
    assert finding.parameters["stiffness"].value == pytest.approx(FLOOR["stiffness"], rel=0.1)


def test_the_augmented_robot_has_it(found: Result) -> None:
    assert 'effect = "contact"' in found.augmented_robot_toml
    assert "normal_z = 1.0" in found.augmented_robot_toml


@pytest.mark.proof
def test_a_push_that_comes_once_is_no_wall() -> None:
    """At both joints, but not as a force at the tip shares itself."""
    pushes = [
        EffectUse.model_validate(
            {"effect": "external_torque", "at": j, "torque": t, "start": 5.0, "duration": 0.4}
        )
        for j, t in (("joint1", 12.0), ("joint2", -8.0))
    ]
    result = diagnose(ARM, [recorded(ARM.with_effects(*pushes), 10152)], options=QUICK)
    assert {f.effect for f in result.diagnosis.findings} == {"external_torque"}
