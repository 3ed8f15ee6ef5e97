"""Nothing that the diagnosis sees reveals that something is hidden."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np
import pytest
from challenge_cases import hiding, numbered

from missing_physics.challenge.cases.families import DECK, FAMILIES, NAMELESS, as_often_as, family_of
from missing_physics.challenge.cases.truth import Design
from missing_physics.challenge.concealing.conceal import Concealed
from missing_physics.challenge.concealing.torque_sensors import effect_size
from missing_physics.challenge.draws.manoeuvre import reference_samples
from missing_physics.challenge.draws.robots import friction_at, usual
from robot_model import EffectUse, Robot, load_robot, robot_to_toml

MANY = range(10000, 10400)
#: So many of these where each is looked at by itself.
SOME = 40
#: Gains over shipped ones, and feed-forward in hundredths of the actuator's limit, that most stay below.
STIFF, STRONG = 2.5, 3.8
#: Digits that a number drawn at random has at least.
DIGITS = 9


@pytest.fixture(scope="module")
def drawn() -> list[Design]:
    return [numbered(number) for number in MANY[:SOME]]


@pytest.fixture(scope="module")
def many() -> list[Design]:
    return [numbered(number) for number in MANY]


def features(case: Design) -> Iterator[str]:
    """What is to be seen in the robot file of a case, and in the level of its noise."""
    robot, shipped = case.nominal, load_robot(case.shipped)
    channels = [sensor.channel for sensor in robot.sensors]
    controller = robot.controller
    gains, usual_gains = np.atleast_1d(controller.kp), np.atleast_1d(shipped.controller.kp)
    if gains[0] > STIFF * usual_gains[0]:
        yield "stiff"
        yield "stiff and sampled" if controller.sample_time else "stiff and continuous"
    yield "sampled" if controller.sample_time else "continuous"
    yield "noise of an effect's size" if case.noise_ratio else "noise as shipped"
    yield from feedforward(robot)
    if robot.base.kind == "free":
        yield f"base sensors: {sorted({c.split('.')[1] for c in channels if c.startswith('base.')})}"
    for link in robot.flexible_links:
        of_link = sorted({c.split(".")[1] for c in channels if c.startswith(f"{link.name}.")})
        yield f"sensors of a bending link: {of_link}"
    if any(c.endswith(".motor_position") for c in channels):
        yield "second encoders"
    if any(c.endswith(".velocity") for c in channels):
        yield "velocities"
    if case.warming:
        yield "thermometer"
    frictions = {(use.effect, use.at) for use in robot.effects}
    for joint in robot.moving_joints:
        laws = [law for law in ("viscous", "coulomb") if (f"{law}_friction", joint.name) in frictions]
        yield f"friction: {laws}"


def feedforward(robot: Robot) -> Iterator[str]:
    levels = np.atleast_1d(robot.controller.coulomb_feedforward)
    if not levels.any():
        return
    yield "feed-forward"
    for joint, level in zip(robot.moving_joints, levels):
        limit = joint.actuator.torque_limit or 100.0
        own = friction_at(robot, joint.name, "coulomb_friction")
        if not own and level > STRONG * limit / 100:
            yield "strong feed-forward without friction"
        if own:
            yield "feed-forward near friction" if 0.6 <= level / own <= 0.95 else "feed-forward off friction"


@pytest.mark.proof
def test_no_feature_of_a_case_reveals_a_hidden_effect(many: list[Design]) -> None:
    """Each occurs where nothing is missing and with foreign physics, or is rare everywhere."""
    seen = {family: Counter() for family in FAMILIES}
    for case in many:
        seen[case.family].update(set(features(case)))
    count = Counter(case.family for case in many)
    silent = sum(count[family] for family in NAMELESS)
    for feature in sorted(set().union(*seen.values())):
        quiet = sum(seen[family][feature] for family in NAMELESS)
        others = sum(seen[family][feature] for family in FAMILIES if family not in NAMELESS)
        share = others / (len(many) - silent)
        assert quiet > 0, feature
        # Of some hundred cases with nothing to be named so many show it that chance explains the rest.
        assert quiet > silent * share / 2 - 2, (feature, quiet, share)
        for family in NAMELESS:
            expected = count[family] * share
            assert seen[family][feature] > 0 or expected < 3, (feature, family, expected)
    for family in NAMELESS:  # tuning, which is done when a case is made, puts friction off its feed-forward
        assert seen[family]["feed-forward off friction"]


def test_effects_are_listed_in_one_order(drawn: list[Design]) -> None:
    for case in drawn:
        joints = [joint.name for joint in case.nominal.joints]
        listed = [(joints.index(use.at), use.effect) for use in case.nominal.effects]
        assert listed == sorted(listed)


def test_parameters_of_all_robots_are_within_the_same_ranges(drawn: list[Design]) -> None:
    for case in drawn:
        ranges = usual(case.shipped)
        for use in case.nominal.effects:
            low, high = ranges[f"{use.effect}@{use.at}"]
            assert low <= next(iter(use.parameters.values())) <= high
        for link in case.nominal.links:
            low, high = ranges[link.name]
            assert low <= link.mass <= high


def test_drawn_numbers_have_full_precision(drawn: list[Design]) -> None:
    def digits(value: float) -> int:
        return len(repr(float(value)).split("e")[0].replace(".", "").strip("0-"))

    for case in drawn:
        robot = case.nominal
        values = [next(iter(use.parameters.values())) for use in robot.effects]
        values += [x for x in np.atleast_1d(robot.controller.coulomb_feedforward) if x]
        values += [*np.atleast_1d(robot.controller.kp), *(s.noise for s in robot.sensors if s.noise)]
        assert min(map(digits, values)) >= DIGITS, case.number


def test_features_of_a_family_are_equally_frequent_without_hidden_effects() -> None:
    for family in ("feedback", "noisy"):
        weights = {own: DECK.count(own) for own in FAMILIES}
        hiding = [own for own in FAMILIES if own not in NAMELESS]
        share = sum(weights[own] * as_often_as(family, own, 0.1) for own in hiding)
        share /= sum(weights[own] for own in hiding)
        assert as_often_as(family, "none", 0.1) == as_often_as(family, "foreign", 0.1)
        assert as_often_as(family, "none", 0.1) == pytest.approx(share)
        assert as_often_as(family, family, 0.1) == 1.0


def test_remote_effect_acts_where_no_sensor_is() -> None:
    remote = [numbered(number) for number in MANY if family_of(number) == "remote"]
    effects = {use.effect for case in remote for use in case.hidden}
    assert len(effects) >= 4
    for case in remote:
        [use] = case.hidden
        assert use.at not in {joint.name for joint in case.nominal.joints}
        assert not [s for s in case.nominal.sensors if s.channel.split(".")[0] == use.at]


def test_a_brief_effect_acts_in_less_than_a_twentieth_of_the_time() -> None:
    stops = 0
    for number in MANY:
        if family_of(number) != "brief":
            continue
        case = numbered(number)
        [use] = case.hidden
        if use.effect == "external_torque":
            assert case.nominal.reference is not None
            assert use.parameters["duration"] < 0.05 * case.nominal.reference.duration
            continue
        place = [joint.name for joint in case.nominal.moving_joints].index(use.at)
        beyond = use.parameters["side"] * (
            reference_samples(case.nominal)[0][:, place] - use.parameters["position"]
        )
        assert 0 < np.mean(beyond > 0) < 0.05
        stops += 1
    assert stops > 4


def test_a_constant_effect_has_the_size_of_its_rms() -> None:
    assert effect_size(np.full(1001, 0.1)) == pytest.approx(0.1)
    assert effect_size(np.zeros(5)) == 0.0
    wave = np.sin(np.linspace(0, 2 * np.pi, 10001))
    assert effect_size(3.0 + wave) == pytest.approx(0.5**0.5, rel=1e-3)


def test_noise_of_a_constant_effect_equals_its_rms() -> None:
    case = hiding("torque_offset", "joint1", torque=8.0)
    made = Concealed(case.model_copy(update={"noise_ratio": 1.0, "noise_of": case.hidden[0]}))
    sensor = made.sensed_by.sensor("joint1.torque")
    assert sensor is not None
    assert sensor.noise == pytest.approx(8.0)


def test_negligible_effect_does_not_change_the_noise() -> None:
    """A wall out of reach and a limit above all torques do nothing but round."""
    for effect, values in (
        ("end_stop", {"stiffness": 1e5, "position": 9.0, "side": 1.0}),
        ("torque_saturation", {"limit": 1e6}),
    ):
        case = hiding(effect, "joint1", **values)
        case = case.model_copy(update={"noise_ratio": 1.0, "noise_of": case.hidden[0]})
        sensed = Concealed(case).sensed_by
        assert sensed.sensors == case.nominal.sensors


def test_noise_ratio_is_met_for_effects_that_are_not_hidden() -> None:
    hidden = hiding("torque_offset", "joint1", torque=8.0)
    case = hidden.model_copy(update={"hidden": (), "noise_ratio": 0.5, "noise_of": hidden.hidden[0]})
    sensor = Concealed(case).sensed_by.sensor("joint1.torque")
    assert sensor is not None
    assert sensor.noise == pytest.approx(4.0)


def test_tuned_parameters_are_within_the_drawn_ranges() -> None:
    case = hiding("coulomb_friction", "joint1", torque=300.0)
    viscous = EffectUse.model_validate({"effect": "viscous_friction", "at": "joint1", "coefficient": 250.0})
    nominal = case.nominal.with_effects(viscous)
    ranges = usual(case.shipped)
    made = Concealed(case.model_copy(update={"nominal": nominal, "family": "tuned_away"})).given
    assert "coefficient" in robot_to_toml(made)
    for name, value in (
        (made.links[0].name, made.links[0].mass),
        ("viscous_friction@joint1", friction_at(made, "joint1", "viscous_friction")),
    ):
        low, high = ranges[name]
        assert 1.0001 * low < value < 0.9999 * high
