"""Drawn cases: reproducible, valid in both engines, and without hints to the hidden effect."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from challenge_cases import AXIS, design, hiding, made, numbered

from exudyn_model.effects import effects_of
from missing_physics.challenge.cases.families import DECK, family_of
from missing_physics.challenge.cases.numbers import DEVELOPMENT_SEEDS, FIRST_SCORING_SEED
from missing_physics.challenge.cases.ranges import DRY, MODIFIERS, SENSOR, Draw, Scale
from missing_physics.challenge.cases.truth import Truth, canonical, commitment
from missing_physics.challenge.concealing import conceal
from missing_physics.challenge.concealing.conceal import FILES, Concealed, concealed, with_exact
from missing_physics.challenge.draws.design import draw_design
from missing_physics.challenge.draws.hiding import TILT
from missing_physics.challenge.draws.manoeuvre import reference_samples
from missing_physics.challenge.draws.robots import ROBOTS
from missing_physics.challenge.torques.along import ArmAlong
from missing_physics.plausibility import implausible
from reference_model.effects.catalogue import used_effects
from robot_model import EffectUse, InputError, load_robot, robot_from_toml

NUMBERS = range(10000, 10025)


@pytest.fixture(scope="module")
def drawn() -> list:
    return [numbered(number) for number in NUMBERS]


def test_every_block_of_numbers_contains_all_families(drawn: list) -> None:
    block = len(DECK) * 400
    assert Counter(family_of(block + k) for k in range(len(DECK))) == Counter(DECK)
    assert Counter(d.family for d in drawn)["none"] >= 3


def test_case_number_determines_the_case(drawn: list) -> None:
    again = Truth(nonce="a", designs=tuple(draw_design(n) for n in list(NUMBERS)[:4]))
    truth = Truth(nonce="a", designs=tuple(drawn[:4]))
    assert commitment(again) == commitment(truth)
    assert commitment(Truth.model_validate_json(canonical(truth))) == commitment(truth)
    assert commitment(truth.model_copy(update={"nonce": "b"})) != commitment(truth)


def test_scoring_and_development_numbers_are_disjoint() -> None:
    assert FIRST_SCORING_SEED not in DEVELOPMENT_SEEDS


def test_both_engines_support_all_hidden_effects(drawn: list) -> None:
    for case in drawn:
        assert len(used_effects(case.real)) == len(effects_of(case.real).faults) + sum(
            "." not in use.at for use in case.real.effects
        )


def test_the_nominal_robot_lacks_what_is_hidden(drawn: list) -> None:
    for case in drawn:
        nominal = {(use.effect, use.at) for use in case.nominal.effects}
        assert not nominal & {(use.effect, use.at) for use in case.hidden}
        for joint in case.real.moving_joints:
            own = [use.effect for use in case.real.effects if use.at == joint.name]
            assert sum(effect in DRY for effect in own) <= 1
            assert all("coulomb_friction" in own for effect in own if effect in MODIFIERS)


def test_sensors_and_gravity_are_drawn_within_realistic_ranges() -> None:
    arm = load_robot("two_link_arm")
    d = Draw(np.random.default_rng(5))
    sizes = {"torque": 1.0, "speed": 1.0, "peak": 10.0, "coulomb": 1.0, "viscous": 1.0}
    scale = Scale(**sizes, low=-1.0, high=1.0, duration=10.0)
    for _ in range(200):
        for effect, (quantities, draw) in SENSOR.items():
            for quantity in quantities:
                assert not implausible(effect, f"joint1.{quantity}", draw(d, scale, quantity), arm)
        tilt = {axis: d.sign() * d.decades(*TILT) for axis in "xyz"}
        assert not implausible("gravity", "base", tilt, arm)


def test_cases_match_their_family(drawn: list) -> None:
    for case in drawn:
        assert bool(case.foreign) == (case.family == "foreign")
        assert len(case.hidden) == {"none": 0, "foreign": 0, "mixed": len(case.hidden)}.get(case.family, 1)
        assert case.family != "mixed" or len(case.hidden) in (2, 3)
        assert case.family != "compensated" or ROBOTS[case.shipped].compensated


def test_feedforward_cancels_most_of_a_compensated_effect() -> None:
    for number in (n for n in range(10000, 10200) if family_of(n) == "compensated"):
        case = numbered(number)
        [use] = case.hidden
        assert use.effect in DRY
        level = use.parameters.get("torque", use.parameters.get("coulomb_torque"))
        place = [joint.name for joint in case.nominal.moving_joints].index(use.at)
        made_up = case.nominal.controller.coulomb_feedforward[place] / level
        assert 0.6 <= made_up <= 0.95


def test_feedforward_does_not_reveal_the_family(drawn: list) -> None:
    with_it = {c.family for c in drawn if np.any(np.array(c.nominal.controller.coulomb_feedforward))}
    assert len(with_it - {"compensated"}) >= 2
    for case in drawn:
        levels = np.atleast_1d(case.nominal.controller.coulomb_feedforward)
        assert levels.all() or not levels.any()  # never at one joint only


def test_motions_keep_the_limits(drawn: list) -> None:
    for case in drawn:
        for reference in (case.nominal.reference, case.validation):
            robot = case.nominal.model_copy(update={"reference": reference})
            position, velocity, _ = reference_samples(robot)
            for k, joint in enumerate(robot.moving_joints):
                assert np.abs(velocity[:, k]).max() <= joint.velocity_limit
                low, high = joint.position_limits or (-np.inf, np.inf)
                assert low <= position[:, k].min()
                assert position[:, k].max() <= high


def test_case_files_do_not_reveal_the_hidden_effect() -> None:
    """Hidden or not: the same files, columns, rows, instants and digits, and no word of the truth."""
    case = hiding("coulomb_friction", "joint1", torque=8.0)
    plain, hidden = made(case.model_copy(update={"hidden": ()})), made(case)
    one, other = plain.files(), hidden.files()
    assert tuple(one) == tuple(other) == FILES
    assert one["robot.toml"] == other["robot.toml"]
    for file in FILES[1:]:
        rows = one[file].splitlines(), other[file].splitlines()
        assert len(rows[0]) == len(rows[1])
        assert rows[0][0] == rows[1][0]
        assert [r.split(b",")[0] for r in rows[0]] == [r.split(b",")[0] for r in rows[1]]
        # Columns without resolution end in as many digits as their value happens to have.
        assert abs(len(one[file]) - len(other[file])) < 0.05 * len(one[file])
    words = other["robot.toml"].decode()
    for secret in (str(AXIS), hidden.design.family, hidden.design.name, "8.0", hidden.design.shipped + "-"):
        assert secret not in words.replace("1800.0", "")
    assert len(robot_from_toml(words).effects) == len(hidden.design.nominal.effects)


def test_folder_names_are_unrelated_to_case_numbers(drawn: list) -> None:
    names = [case.name for case in drawn]
    assert len(set(names)) == len(names)
    assert names != sorted(names)


def test_noise_ratio_is_met() -> None:
    case = hiding("coulomb_friction", "joint1", torque=8.0)
    case = case.model_copy(update={"noise_ratio": 1.0, "noise_of": case.hidden[0]})
    sensor = made(case).given.sensor("joint1.torque")
    assert sensor is not None
    assert 3.0 < sensor.noise < 8.0  # rms of a friction of 8 N that rests now and then, mean left out


def test_tuning_hides_friction_in_the_nominal_parameters() -> None:
    """The tuned robot leaves less of the torque unexplained than the untuned one, with the same effects."""
    case = hiding("coulomb_friction", "joint1", torque=8.0)
    viscous = EffectUse.model_validate({"effect": "viscous_friction", "at": "joint1", "coefficient": 100.0})
    case = case.model_copy(update={"nominal": case.nominal.with_effects(viscous)})
    tuned_case = Concealed(case.model_copy(update={"family": "tuned_away"}))
    left, tuned = tuned_case.sensed_by, tuned_case.given
    assert tuned.links[0].mass != left.links[0].mass
    assert [use.effect for use in tuned.effects] == [use.effect for use in left.effects]
    assert tuned.effects[0].parameters["coefficient"] > left.effects[0].parameters["coefficient"]
    energies = [
        float(np.sum((along.torque - along.nominal()) ** 2))
        for along in (ArmAlong(robot, tuned_case.exact[0]) for robot in (left, tuned))
    ]
    assert energies[1] < 0.95 * energies[0]


def test_exact_motion_is_restored_from_its_file() -> None:
    files = concealed(design())
    again = with_exact(design(), files["exact.npz"])
    assert again.files() == {name: files[name] for name in FILES}


@pytest.mark.parametrize(("wider", "inside"), [(1.0, True), (300.0, False)])
def test_unstable_joint_makes_no_case(wider: float, inside: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    case = design()
    along = made(case).exact[0]
    moved = {
        name: values * (wider if name == "joint1.position" else 1.0)
        for name, values in along.channels.items()
    }
    monkeypatch.setattr(conceal, "simulate", lambda *robot, **how: replace(along, channels=moved))
    if inside:
        assert set(concealed(case)) >= set(FILES)
    else:
        with pytest.raises(InputError, match="joint1 ran out of its limits"):
            concealed(case)


def test_excessive_speed_without_position_limits_makes_no_case(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    case = design()
    along = made(case).exact[0]
    limit = case.nominal.joint("joint1").velocity_limit
    assert limit is not None
    racing = dict(along.channels)
    racing["joint1.velocity"] = racing["joint1.velocity"] + 11.0 * limit
    monkeypatch.setattr(conceal, "simulate", lambda *robot, **how: replace(along, channels=racing))
    with pytest.raises(InputError, match="joint1 ran away with"):
        concealed(case)
