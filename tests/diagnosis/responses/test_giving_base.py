"""A base that gives way although it is described as fixed, from joint encoders and torques alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from missing_physics.diagnosis import Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.least_squares.explanation import explain
from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.preparation.setup import inertial_basis, make_segments, nominal_terms
from missing_physics.diagnosis.preparation.split import split
from missing_physics.diagnosis.responses.compliant_base import GivingBase
from missing_physics.diagnosis.terms.term import Term
from reference_model.effects.catalogue import get_effect
from reference_model.passive.prescribed import prescribed
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, Robot, load_robot

Array = NDArray[np.float64]

MOUNT = {"compliance": 1e-5, "arm": 0.5, "damping": 2e-3, "mass": 40.0, "inertia": 6.0}
LOOSE = EffectUse.model_validate({"effect": "base_motion", "at": "base", **MOUNT})
FRICTION = [EffectUse(effect="coulomb_friction", at=j, torque=t) for j, t in (("joint1", 4), ("joint2", 2))]


def arm(**reference: Any) -> Robot:
    data = load_robot("two_link_arm").model_dump()
    data["reference"] |= reference
    return Robot.model_validate(data)


@pytest.fixture(scope="module")
def segment() -> Segment:
    robot = arm(duration=3.0, sample_rate=250.0).model_copy(update={"sensors": (), "effects": ()})
    return make_segments(robot, [simulate(robot, sensors=False)], cutoff=20.0)[0]


@pytest.fixture(scope="module")
def base(segment: Segment) -> GivingBase:
    return segment.hidden.giving_base


def test_the_response_is_what_a_simulation_gives(segment: Segment, base: GivingBase) -> None:
    motion, robot = segment.motion, segment.robot
    state = motion.time, motion.position, motion.velocity, motion.acceleration
    joints = [joint.name for joint in robot.moving_joints]
    torques = []
    for described in (robot.with_effects(LOOSE), robot):
        made = prescribed(described, *state)
        torques.append(np.column_stack([made[f"{joint}.torque"] for joint in joints]))
    exact = torques[0] - torques[1]
    assert exact.std() > 0.5

    def apart(**changed: float) -> float:
        linear = base.respond(*{**MOUNT, **changed}.values())[0, :, :, 0]
        return float(np.sqrt(np.mean((linear - exact) ** 2) / np.mean(exact**2)))

    # What is left out is of second order in the base's displacement of millimetres.
    assert apart() < 0.06
    for name in ("compliance", "arm", "mass"):
        assert min(apart(**{name: factor * MOUNT[name]}) for factor in (0.97, 1.03)) > 0.12


def test_derivatives_of_the_response(base: GivingBase) -> None:
    _, *derivatives = base.respond(*MOUNT.values())
    for name, derivative in zip(MOUNT, derivatives):
        step = 1e-4 * MOUNT[name]
        ends = [base.respond(*{**MOUNT, name: MOUNT[name] + s}.values())[0] for s in (step, -step)]
        slope = (ends[0] - ends[1]) / (2 * step)
        # the derivative's own forces are interpolated linearly between samples, 20 and more to a period
        assert np.abs(slope - derivative).max() < 0.02 * np.abs(derivative).max(), name


def test_joints_at_rest_leave_the_base_at_rest(segment: Segment) -> None:
    still = segment.motion.position.copy()
    still[:100] = still[100]
    resting = replace(segment.motion, position=still)
    dynamics = type(segment.dynamics)(segment.dynamics.model, resting)
    assert not Segment(segment.robot, dynamics, resting).hidden.starts("base_motion", "base")
    moving = replace(segment.motion, position=segment.motion.position + 0.5 * segment.motion.time[:, None])
    dynamics = type(segment.dynamics)(segment.dynamics.model, moving)
    assert Segment(segment.robot, dynamics, moving).hidden.starts("base_motion", "base")


def test_held_out_data_need_no_start_of_a_base_at_rest() -> None:
    robot = arm(duration=4.0, sample_rate=250.0)
    segments = make_segments(robot, [simulate(robot, seed=seed) for seed in (10162, 10163)])
    for segment in segments:
        modes = segment.hidden.giving_base
        modes.slowest = modes.slowest[:, :0]
    data = split(segments, 1, inertial_basis(robot, segments[:1]), seed=0)
    term = Term(get_effect("base_motion"), "base", MOUNT, frozen=True)
    fit = explain(data.problem, data.view, [*nominal_terms(robot), term])
    left = data.held_out.residual(fit)
    np.testing.assert_array_equal(left, data.validation.measured - fit.predict(data.validation))


def recorded(robot: Robot, seed: int) -> Recording:
    """Without references, so that the regression alone has to tell."""
    whole = simulate(robot, seed=seed)
    return replace(whole, channels={k: v for k, v in whole.channels.items() if "reference" not in k})


@pytest.mark.proof
def test_a_base_that_is_compliant_is_named_beside_friction() -> None:
    robot = arm(duration=10.0, sample_rate=250.0)
    options = Options(experiments=False, simulation=False)
    result = diagnose(robot, [recorded(robot.with_effects(LOOSE, *FRICTION), 10160)], options=options)
    found = {f"{f.effect}@{f.location}": f for f in result.diagnosis.findings}
    assert set(found) == {"coulomb_friction@joint1", "coulomb_friction@joint2", "base_motion@base"}
    assert result.diagnosis.verdict == "explained"
    estimates = found["base_motion@base"].parameters
    for name, true in MOUNT.items():
        assert estimates[name].ci95[0] <= true <= estimates[name].ci95[1], name
        assert estimates[name].value == pytest.approx(true, rel=0.1), name  # damping's interval: 40 %
    assert "base_motion" in result.augmented_robot_toml
    assert not any("start" in sentence for sentence in result.diagnosis.could_not_tell)
