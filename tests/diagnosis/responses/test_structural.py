"""Links that bend although they are described as rigid, from joint encoders and torques alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from missing_physics.challenge.torques.along import ArmAlong
from missing_physics.diagnosis import Options
from missing_physics.diagnosis import by_regression as diagnose
from missing_physics.diagnosis.candidates.structural import hidden_modes, looked_for
from missing_physics.diagnosis.least_squares.explanation import Explanation, explain
from missing_physics.diagnosis.least_squares.problem import Segment
from missing_physics.diagnosis.modal.courses import march
from missing_physics.diagnosis.naming.noise_bias import evidence_without_noise, without_noise_bias
from missing_physics.diagnosis.preparation.setup import inertial_basis, make_segments, nominal_terms
from missing_physics.diagnosis.preparation.split import split
from missing_physics.diagnosis.responses.hidden_modes import HiddenModes
from missing_physics.diagnosis.runs.numbers import in_runs, with_numbers
from missing_physics.results.result import Result
from reference_model.effects.catalogue import get_effect
from reference_model.passive.prescribed import prescribed
from reference_model.simulation import simulate
from robot_model import EffectUse, Recording, Robot, load_robot, robot_from_toml

Array = NDArray[np.float64]

LINK = get_effect("link_flexibility")
QUICK = Options(experiments=False, simulation=False)


def robot_of(name: str, **reference: Any) -> Robot:
    data = load_robot(name).model_dump()
    data["reference"] |= reference
    return Robot.model_validate(data)


def bending(robot: Robot, link: str, period: float, damping: float = 0.02) -> Robot:
    return robot.with_effects(
        EffectUse(effect="link_flexibility", at=link, period=period, damping_ratio=damping)
    )


def recorded(robot: Robot, seed: int) -> Recording:
    """Without references, so that the regression alone has to tell."""
    whole = simulate(robot, seed=seed)
    return replace(whole, channels={k: v for k, v in whole.channels.items() if "reference" not in k})


@pytest.fixture(scope="module", params=["two_link_arm", "six_joint_space_arm"])
def segment(request: pytest.FixtureRequest) -> Segment:
    """A motion without noise."""
    robot = robot_of(request.param, duration=3.0).model_copy(update={"sensors": ()})
    return make_segments(robot, [simulate(robot, sensors=False)])[0]


def modes_of(segment: Segment, link: str) -> HiddenModes:
    modes = segment.hidden.modes("link_flexibility", link)
    assert modes is not None
    return modes


def apart(segment: Segment, link: str, period: float, exact: Array) -> float:
    linear = modes_of(segment, link).respond(period, 0.02)[0, :, : exact.shape[1], 0]
    return float(np.sqrt(np.mean((linear - exact) ** 2) / np.mean(exact**2)))


@pytest.mark.parametrize(("link", "period"), [("link1", 0.1), ("link2", 0.3)])
def test_the_response_is_what_a_simulation_of_the_bending_link_gives(
    segment: Segment, link: str, period: float
) -> None:
    motion, robot = segment.motion, segment.robot
    state = motion.time, motion.position, motion.velocity, motion.acceleration
    torques = []
    for described in (bending(robot, link, period), robot):
        made = prescribed(described.model_copy(update={"sensors": ()}), *state)
        torques.append(np.column_stack([made[f"{joint.name}.torque"] for joint in robot.moving_joints]))
    exact = torques[0] - torques[1]
    # What is left out is of second order in deflections of some hundredths of the length: as much as a change
    # of the period by a part in a thousand does.
    assert apart(segment, link, period, exact) < 0.06
    assert min(apart(segment, link, factor * period, exact) for factor in (0.99, 1.01)) > 0.12


def test_derivatives_of_the_response(segment: Segment) -> None:
    modes, (period, damping) = modes_of(segment, "link2"), (0.25, 0.03)
    _, *derivatives = modes.respond(period, damping)
    for derivative, change in zip(derivatives, ((1e-5, 0.0), (0.0, 1e-5))):
        moved = modes.respond(period + change[0], damping + change[1])[0]
        back = modes.respond(period - change[0], damping - change[1])[0]
        # the derivative's own forces are interpolated linearly between samples, 30 and more to a period
        slope = (moved - back) / (2 * sum(change))
        assert np.abs(slope - derivative).max() < 0.02 * np.abs(derivative).max()


def test_stretches_side_by_side_are_one_after_the_other() -> None:
    chance = np.random.default_rng(5)
    poses, size, forces, columns, samples = 3, 4, 2, 2, 50
    moves = tuple(0.4 * chance.standard_normal((poses, size, width)) for width in (size, forces, forces))
    pose = np.sort(chance.integers(0, poses, samples))
    pushed = chance.standard_normal((samples, forces, columns))
    state = first = chance.standard_normal((size, columns))
    found = march((moves[0], moves[1], moves[2]), pose, pushed, first)
    for k in range(samples):
        # sums in another order: rounding
        np.testing.assert_allclose(found[k], state, rtol=1e-9, atol=1e-9 * np.abs(found).max())
        if k + 1 < samples:
            before, after = (moves[which][pose[k]] @ pushed[k + which - 1] for which in (1, 2))
            state = moves[0][pose[k]] @ state + before + after


def named(result: Result) -> list[str]:
    return [f"{f.effect}@{f.location}" for f in result.diagnosis.findings]


ARM = robot_of("two_link_arm", duration=12.0, sample_rate=250.0)


@pytest.fixture(scope="module")
def found() -> Result:
    friction = [
        EffectUse(effect="coulomb_friction", at=j, torque=t) for j, t in (("joint1", 4), ("joint2", 2))
    ]
    return diagnose(ARM, [recorded(bending(ARM, "link2", 0.2).with_effects(*friction), 10141)], options=QUICK)


@pytest.mark.proof
def test_a_bending_link_is_named_beside_friction(found: Result) -> None:
    assert set(named(found)) == {
        "coulomb_friction@joint1",
        "coulomb_friction@joint2",
        "link_flexibility@link2",
    }
    assert found.diagnosis.verdict == "explained"
    finding = next(f for f in found.diagnosis.findings if f.effect == "link_flexibility")
    assert set(finding.parameters) == {"period", "damping_ratio"}
    assert finding.parameters["period"].value == pytest.approx(0.2, rel=0.01)  # as its interval
    assert finding.parameters["damping_ratio"].value == pytest.approx(0.02, abs=0.01)


@pytest.fixture(scope="module")
def fitted() -> Explanation:
    """Of encoders with six times the noise, without friction: little but noise excites the link later on."""
    sensors = tuple(
        s.model_copy(update={"noise": 6 * s.noise}) if s.channel.endswith("position") else s
        for s in ARM.sensors
    )
    robot = ARM.model_copy(update={"sensors": sensors})
    segments = make_segments(robot, [recorded(bending(robot, "link2", 0.2), 10144)])
    data = split(segments, 1, inertial_basis(robot, segments), seed=0)
    terms = nominal_terms(robot)
    before = explain(data.problem, data.view, terms)
    hidden = next(t for t in hidden_modes(data.problem, before, LINK) if t.at == "link2")
    return explain(data.problem, data.view, [*terms, hidden])


@pytest.mark.proof
def test_noise_of_encoders_makes_no_damping(fitted: Explanation) -> None:
    """Least squares damps a mode that noise shakes."""
    values = [
        next(t for t in fit.terms if t.key == ("link_flexibility", "link2")).parameters
        for fit in (fitted, without_noise_bias(fitted))
    ]
    assert values[0]["damping_ratio"] > 0.024
    assert values[1]["damping_ratio"] == pytest.approx(0.02, abs=0.004)  # one recording's own noise: 0.0025
    assert abs(values[1]["period"] - 0.2) < 0.5 * abs(values[0]["period"] - 0.2)


@pytest.mark.proof
def test_nothing_is_looked_for_in_noise(fitted: Explanation, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the link's mode in it, encoders' noise is left, which a base on springs would take away."""
    base = get_effect("base_motion")
    level = np.sqrt(np.mean(fitted.residual**2, axis=0))
    monkeypatch.setattr(fitted.problem, "noise_floor", level)
    assert not list(looked_for(fitted.problem, fitted, base))
    monkeypatch.setattr(fitted.problem, "noise_floor", 0.5 * level)
    fitted = replace(fitted)  # with the other floor
    (found,) = looked_for(fitted.problem, fitted, base)
    trial = explain(fitted.problem, fitted.view, [*fitted.terms, found])
    own = next(term for term in trial.terms if term.key == found.key)
    # odds of e^10 for what is noise, and none once it counts as such
    assert trial.evidence_over(fitted) > 10.0
    assert evidence_without_noise(trial, fitted, own) < 0.0


@pytest.mark.proof
def test_numbers_of_runs_leave_an_explanation_whole(fitted: Explanation) -> None:
    """How hidden modes began is no number of runs, but one of the explanation from which these are built."""
    own = in_runs(next(term for term in fitted.terms if term.key == ("link_flexibility", "link2")))
    assert not {p.name for p in own.beside} & set(own.free)
    built = []
    with_numbers(fitted, lambda found: built.append(found))([own.at_values(1.1 * own.values)])
    (found,) = built
    assert found.terms[-1].parameters["period"] == pytest.approx(1.1 * own.parameters["period"])
    assert found.terms[-1].free == fitted.terms[-1].free
    # whether its masses moved is asked of it
    size = np.arange(fitted.nuisance.size)
    assert found.regression.wald_p_value(size) == pytest.approx(fitted.regression.wald_p_value(size), abs=0.1)


@pytest.mark.proof
def test_what_a_link_does_is_more_than_noise(fitted: Explanation) -> None:
    before = explain(fitted.problem, fitted.view, fitted.terms[:-1])
    alone = evidence_without_noise(fitted, before, fitted.terms[-1])
    assert alone > 0.5 * fitted.evidence_over(before) > 100.0


@pytest.mark.proof
def test_the_start_of_another_recording_is_its_own(fitted: Explanation) -> None:
    robot = fitted.problem.robot
    later = recorded(bending(robot, "link2", 0.2), 10145)
    rows = later.time > 0.25  # a recording that begins while the link rings
    cut = Recording(later.time[rows], {name: later[name][rows] for name in later}, "cut")
    segments = (*fitted.problem.segments, *make_segments(robot, [cut], cutoff=40.0 * 250.0 / 500.0))
    data = split(segments, 1, inertial_basis(robot, segments[:1]), seed=0)
    fit = replace(fitted, problem=data.problem, view=data.view)
    left = data.held_out.residual(fit)
    unknown = data.validation.measured - fit.predict(data.validation)
    assert np.mean(left[:, 1] ** 2) < 0.7 * np.mean(unknown[:, 1] ** 2)


@pytest.mark.proof
def test_the_augmented_robot_has_it_and_runs(found: Result) -> None:
    robot = robot_from_toml(found.augmented_robot_toml)
    use = next(use for use in robot.effects if use.effect == "link_flexibility")
    assert set(use.parameters) == {"period", "damping_ratio", "modes"}
    short = robot.model_copy(update={"reference": robot.reference.model_copy(update={"duration": 1.0})})
    exact = simulate(short, sensors=False)
    alone = robot.model_copy(update={"effects": (use,)})
    part = (
        ArmAlong(alone, exact).nominal() - ArmAlong(robot.model_copy(update={"effects": ()}), exact).nominal()
    )
    assert np.abs(part).max() > 0.1  # the score of a challenge can use it


@pytest.mark.proof
def test_known_from_the_motor_alone_it_may_as_well_be_the_gear() -> None:
    """One revolute axis: behind an elastic gear the link vibrates alike."""
    data = ARM.model_dump()
    data["links"], data["joints"] = data["links"][1:], [{**data["joints"][1], "parent": "base"}]
    data["sensors"] = [s for s in data["sensors"] if s["channel"].startswith("joint2")]
    data["controller"] |= {"kp": 1500.0, "kd": 60.0}
    data["reference"]["joints"] = data["reference"]["joints"][1:]
    data["effects"] = [
        {"effect": "viscous_friction", "at": "joint2", "coefficient": 1.2},
    ]
    robot = Robot.model_validate(data)
    rings = recorded(bending(robot, "link2", 0.2).with_effects(FRICTION), 10147)
    motor = {name.replace(".position", ".motor_position"): rings[name] for name in rings}
    for recording, sets in ((rings, ()), (replace(rings, channels=motor), ("joint_elasticity@joint2",))):
        result = diagnose(robot, [recording], options=QUICK)
        finding = next(f for f in result.diagnosis.findings if f.effect == "link_flexibility")
        assert finding.ambiguous_with == sets
        assert result.diagnosis.verdict == ("ambiguous" if sets else "explained")


FRICTION = EffectUse(effect="coulomb_friction", at="joint2", torque=2.0)


@pytest.mark.proof
def test_a_mass_on_a_spring_at_one_joint_is_no_bending_link() -> None:
    robot = ARM.model_copy(update={"effects": ()})
    exact = simulate(robot, seed=10142)
    q = exact["joint2.position"]
    time = exact.time
    w, zeta, inertia = 2 * np.pi * 4.0, 0.02, 0.3
    acceleration = np.gradient(np.gradient(q, time), time)
    x = xd = 0.0
    added = np.zeros_like(q)
    h = time[1] - time[0]
    for k in range(len(time)):
        xd += h * (-acceleration[k] - 2 * zeta * w * xd - w * w * x)
        x += h * xd
        added[k] = inertia * (acceleration[k] + (-acceleration[k] - 2 * zeta * w * xd - w * w * x))
    channels = {**exact.channels, "joint2.torque": exact["joint2.torque"] + added}
    channels = {k: v for k, v in channels.items() if "reference" not in k}
    result = diagnose(robot, [replace(exact, channels=channels)], options=QUICK)
    whole = ("link_flexibility", "base_motion", "contact")
    assert not [label for label in named(result) if label.startswith(whole)]


def test_no_grid_promises_anything_where_all_links_are_stiff() -> None:
    result = diagnose(ARM, [recorded(ARM, 10143)], options=QUICK)
    assert not named(result)
    assert not {"link_flexibility", "base_motion", "contact"} & {rung.effect for rung in result.ladder}
